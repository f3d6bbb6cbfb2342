"""Control laws as CasADi expressions: a batch evaluates the law and the step of the arm in one program."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from dhkit.description import Array, Description
from dhkit.symbolic import InertialTable

if TYPE_CHECKING:
    import casadi


class Symbols(NamedTuple):
    """Arguments of a control law: symbols of shape n x 1 each, rad, m and seconds."""

    q: casadi.SX
    qd: casadi.SX
    setpoint_q: casadi.SX
    """Joint values of the setpoint; its rates and accelerations follow."""
    setpoint_qd: casadi.SX
    setpoint_qdd: casadi.SX


@dataclass(frozen=True, eq=False)
class Law:
    """Expression of a controller without internal states."""

    name: str
    """Identifies the expression, together with the pattern of the arm, in the cache of programs."""
    description: Description
    """The robot that the controller knows."""
    gains: Array
    """Gains of the law, shape (p,), or (B, p) for the runs of a batch."""
    torques: Callable[[InertialTable, Symbols, casadi.SX], casadi.SX]
    """Function of the arm's table, the state and setpoint, and the gains (p x 1), that returns the torques (n x 1)."""


def law_of(controller: Any) -> Law | None:
    """Return a controller's law, or None if it has none.

    A subclass has no law unless it defines one: the inherited law would ignore the methods that it overrides.
    """
    return controller.law() if "law" in vars(type(controller)) else None
