"""Constraints of a motion besides the joint limits, as immutable value objects.

A constraint is written twice: as CasADi expressions for the optimizer, and as numbers at samples of a motion, from
Pinocchio's kinematics and dynamics, for the certificate. Both are scaled so that 1 is the limit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description
from dhkit.description.arrays import number_array
from dhkit.display import value_line
from dhkit.planning.point import Point
from dhkit.planning.states import States

if TYPE_CHECKING:
    import casadi


@dataclass(frozen=True)
class Constraint:
    """A quantity that must stay below 1, or between -1 and 1, in every state of a motion.

    Raises
    ------
    TypeError
        A subclass with other bounds: the certificate checks none.
    """

    moving: ClassVar[bool] = True
    """Whether the quantity depends on velocity, so that a motion keeps the constraint if it is slow enough."""
    low: ClassVar[float] = -math.inf
    high: ClassVar[float] = 1.0
    needs_torque: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        if cls.measured is not Constraint.measured and (cls.low, cls.high) not in ((-math.inf, 1.0), (-1.0, 1.0)):
            raise TypeError(f"{cls.__name__}: bounds are {cls.low:g} and {cls.high:g}; expected -inf or -1, and 1")

    @property
    def is_two_sided(self) -> bool:
        """Whether the bounds are -1 and 1, which margins tighten alike."""
        return self.low == -self.high

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        raise NotImplementedError

    def use_text(self, use: float) -> str:
        """Return a use of the limit (1 at the limit) as text."""
        return f"{100 * use:.4g} % of its limit"

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return the limited expressions, k x 1, without unit, which must stay between ``low`` and ``high``."""
        raise NotImplementedError

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the limited quantity at samples, shape (N, k), without unit, 1 at the limit."""
        raise NotImplementedError

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
    low = -1.0
    needs_torque = True

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
    low = -1.0
    needs_torque = True

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
