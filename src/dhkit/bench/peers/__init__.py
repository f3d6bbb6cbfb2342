"""The contenders, a file a package; each package is imported when its contender is set up."""

from itertools import chain

from dhkit.bench.contenders import Contender
from dhkit.bench.peers import dhkit_arm, eaik, frankik, ikpy, opw, pinocchio, roboticstoolbox, ssik

__all__ = ["all_contenders"]


def all_contenders() -> tuple[Contender, ...]:
    """Return every contender, dhkit's own first."""
    peers = (eaik, opw, ssik, frankik, roboticstoolbox, ikpy)
    first = (*dhkit_arm.contenders(), *pinocchio.contenders(), *dhkit_arm.casadi_contenders())
    others = chain.from_iterable(peer.contenders() for peer in peers)
    return (*first, *others)
