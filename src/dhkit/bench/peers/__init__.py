"""The contenders, a file a package; each package is imported when its contender is set up."""

from dhkit.bench.contenders import Contender
from dhkit.bench.peers import casadi_map, dhkit_arm, eaik, ikpy, opw, pinocchio, roboticstoolbox, ssik

__all__ = ["all_contenders"]


def all_contenders() -> tuple[Contender, ...]:
    """Return every contender, dhkit's own first."""
    homes = (dhkit_arm, pinocchio, casadi_map, eaik, opw, ssik, roboticstoolbox, ikpy)
    return tuple(contender for home in homes for contender in home.contenders())
