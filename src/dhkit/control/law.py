"""Control laws as CasADi expressions: evaluated alone for one arm, and with the step of the arm for batches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dhkit.control.references import Setpoint
from dhkit.description import Array, Description
from dhkit.kernels import fill, kernel
from dhkit.symbolic import Graph, InertialTable, inertial_pattern, joint_symbols

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


class LawFunction:
    """A law as a function of the state, the setpoint and the gains, for one arm or a batch.

    Parameters
    ----------
    law
        The law; its gains are given with each call, since they may change.
    """

    def __init__(self, law: Law) -> None:
        pattern, self._parameters = inertial_pattern(law.description)
        self._kernel = kernel(law.name, pattern, lambda: _graph(law))
        self._n = law.description.n

    def __call__(self, q: Array, qd: Array, setpoint: Setpoint, gains: Array) -> Array:
        """Return the torques, shape (..., n), N m and N, at states (..., n) and gains (..., p).

        Raises
        ------
        ValueError
            A state or setpoint of another shape.
        """
        named = ((q, "q"), (qd, "qd"), (setpoint.q, "setpoint.q"), (setpoint.qd, "setpoint.qd"))
        states = [
            _checked(x, name, self._n) for x, name in (*named, (setpoint.qdd, "setpoint.qdd"))
        ]
        return fill(self._kernel, self._parameters, [*states, gains], (self._n,))


def _checked(x: ArrayLike, name: str, n: int) -> Array:
    array = np.asarray(x, dtype=float)
    if array.shape[-1:] != (n,):
        raise ValueError(
            f"{name} has shape {array.shape}; expected ({n},), or (B, {n}) for a batch"
        )
    return array


def _graph(law: Law) -> Graph:
    """Return a law's program."""
    import casadi

    table, parameters = InertialTable.parametric(law.description)
    states = {name: joint_symbols(name, law.description.n) for name in Symbols._fields}
    gains = casadi.SX.sym("gains", law.gains.shape[-1])
    tau = law.torques(table, Symbols(**states), gains)
    return Graph.of(law.name, {"parameters": parameters, **states, "gains": gains}, {"tau": tau})


def law_of(controller: Any) -> Law | None:
    """Return a controller's law, or None if it has none.

    A subclass has no law unless it defines one: the inherited law would ignore the methods that it overrides.
    """
    return controller.law() if "law" in vars(type(controller)) else None
