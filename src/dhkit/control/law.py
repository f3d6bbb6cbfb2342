"""Control laws as expressions: a batch then evaluates the law and the step of the arm in one program."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from dhkit.description import Array, Description
from dhkit.symbolic import InertialTable

if TYPE_CHECKING:
    import casadi


class Symbols(NamedTuple):
    """What a law is a function of, n x 1 each."""

    q: casadi.SX
    qd: casadi.SX
    wanted_q: casadi.SX
    """Of the setpoint, as those that follow."""
    wanted_qd: casadi.SX
    wanted_qdd: casadi.SX


@dataclass(frozen=True, eq=False)
class Law:
    """A controller without a memory, as an expression."""

    name: str
    """Says which expression it is, together with the pattern of the arm."""
    description: Description
    """The arm that the controller knows."""
    gains: Array
    """Numbers of the law, shape (p,), or (B, p) of the runs of a batch."""
    torques: Callable[[InertialTable, Symbols, casadi.SX], casadi.SX]
    """Of the arm's table, the state and the setpoint, and the gains p x 1: the torques, n x 1."""


def law_of(controller: Any) -> Law | None:
    """Return a controller's law, or None where it has none.

    A subclass has none of its own accord: whatever it overrides, the law would be its parent's.
    """
    law: Law | None = controller.law() if "law" in vars(type(controller)) else None
    return law
