"""Constraints of a motion besides the joint limits, as immutable value objects.

A constraint is written twice: as CasADi expressions for the optimizer, and as numbers at samples of a motion, from
Pinocchio's kinematics and dynamics, for the certificate. Both are scaled so that 1 is the limit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description
from dhkit.description.arrays import number_array
from dhkit.display import value_line
from dhkit.errors import PlanningError
from dhkit.planning.point import Point
from dhkit.planning.states import States

if TYPE_CHECKING:
    import casadi


@dataclass(frozen=True)
class Constraint:
    """A quantity that must stay below 1, or between -1 and 1, in every state of a motion."""

    moving: ClassVar[bool] = True
    """Whether the quantity depends on velocity, so that a motion keeps the constraint if it is slow enough."""
    two_sided: ClassVar[bool] = False
    """Whether the quantity must stay between -1 and 1, not only below 1."""
    of_joints: ClassVar[bool] = False
    """Whether there is one row for each joint."""
    active_share: ClassVar[float] = 0.99
    """Share of the limit from which a report calls the constraint active."""

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        raise NotImplementedError(f"{type(self).__name__} has no property what, the name of the limited quantity")

    @property
    def is_limiting(self) -> bool:
        """Whether the constraint limits motions at all."""
        return True

    def use_text(self, use: float) -> str:
        """Return a use of the limit (1 at the limit) as text."""
        return f"{100 * use:.4g} % of its limit"

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return the limited expressions, k x 1, without unit, 1 at the limit."""
        raise NotImplementedError(f"{type(self).__name__} has no method rows, the expressions for the optimizer")

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the limited quantity at samples, shape (N, k), without unit, 1 at the limit."""
        raise NotImplementedError(f"{type(self).__name__} has no method measured, the numbers for the certificate")

    def checked_rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return ``rows``, checked.

        Raises
        ------
        TypeError
            They are no column of CasADi's symbols.
        """
        import casadi

        rows: object = self.rows(point, parameters)
        if not isinstance(rows, casadi.SX) or rows.shape[1] != 1:
            kind = getattr(rows, "shape", type(rows).__name__)
            raise TypeError(f"{type(self).__name__}.rows returned {kind}; expected casadi.SX of shape (k, 1)")
        return rows

    def use(self, states: States, parameters: Array) -> Array:
        """Return the use of the limit at samples, shape (N, k), 1 at the limit: ``measured``, checked.

        Raises
        ------
        ValueError, TypeError
            ``measured`` returned another shape, or no real numbers.
        PlanningError
            It returned NaN: whether the limit is kept cannot be decided.
        """
        name = f"{type(self).__name__}.measured"
        values = number_array(self.measured(states, parameters), name, "(N, k)")
        if values.ndim != 2 or len(values) != len(states.times) or not values.size:
            raise ValueError(f"{name} has shape {values.shape}; expected ({len(states.times)}, k)")
        if np.isnan(values).any():
            t = states.times[int(np.isnan(values).any(axis=1).argmax())]
            raise PlanningError(f"{self.what} is not a number at {t:.3g} s, so that no motion can be certified")
        return np.abs(values) if self.two_sided else values

    def bounds(self, parameters: Array, shares: Array) -> tuple[Array, Array]:
        """Return the bounds of ``rows`` for the optimizer, shape (P, k) each, less margins.

        Parameters
        ----------
        shares
            Margins at P points as shares of the limit, shape (P, k).
        """
        high = 1 - shares
        return -high if self.two_sided else np.full_like(high, -np.inf), high

    def size(self, description: Description) -> int:
        """Return the number of parameters."""
        return 0

    def values(self, description: Description, T_start: Array) -> Array:
        """Return the parameters of a motion that starts at the tool's pose ``T_start`` (4, 4), shape (size,)."""
        return np.zeros(0)


@dataclass(frozen=True)
class MotorPower(Constraint):
    """Limit of the mechanical power |tau qd| of each joint, W."""

    watts: float | tuple[float, ...]
    two_sided = True
    of_joints = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "watts", positive("MotorPower", self.watts))

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        return "motor power"

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return the limited expressions, k x 1, without unit: scaled so that the bound is 1."""
        return point.tau * point.qd / _each(self.watts, point.n)

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the limited quantity at samples, shape (N, k), without unit, 1 at the limit."""
        return states.tau * states.qd / _each(self.watts, states.n)

    __repr__ = value_line


@dataclass(frozen=True)
class TorqueSpeedLine(Constraint):
    """Torque-speed line of a motor: tau / stall torque + qd / no-load speed stays between -1 and 1."""

    stall_torque: float | tuple[float, ...]
    """Stall torque at the joint, N m or N: one number, or one for each joint."""
    no_load_speed: float | tuple[float, ...]
    """No-load speed at the joint, rad/s or m/s, likewise."""
    two_sided = True
    of_joints = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "stall_torque", positive("TorqueSpeedLine", self.stall_torque))
        object.__setattr__(self, "no_load_speed", positive("TorqueSpeedLine", self.no_load_speed))

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        return "torque-speed line"

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return the limited expressions, k x 1, without unit: scaled so that the bound is 1."""
        n = point.n
        return point.tau / _each(self.stall_torque, n) + point.qd / _each(self.no_load_speed, n)

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the limited quantity at samples, shape (N, k), without unit, 1 at the limit."""
        n = states.n
        measured: Array = states.tau / _each(self.stall_torque, n) + states.qd / _each(self.no_load_speed, n)
        return measured

    __repr__ = value_line


def _each(value: float | tuple[float, ...], n: int) -> Array:
    array = np.atleast_1d(np.array(value, dtype=float))
    if array.size not in (1, n):
        raise ValueError(f"{array.size} numbers for {n} joints; expected 1 or {n}")
    return np.broadcast_to(array, n)


def positive(name: str, value: float | ArrayLike) -> float | tuple[float, ...]:
    """Return a positive number or a tuple of shape (n,), of any unit; a ValueError names the argument."""
    array = number_array(value, name, "(n,)")
    if array.ndim > 1 or not array.size or not (array > 0).all():
        raise ValueError(f"{name}: {value!r}; expected positive numbers")
    return float(array) if array.ndim == 0 else tuple(array.tolist())
