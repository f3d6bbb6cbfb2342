"""What a motion must keep besides the joints' limits, as small values.

A constraint is written twice: as rows of symbols for the optimizer, and as numbers of a motion's samples by another
path (Pinocchio's kinematics and dynamics), by which the result is certified. Rows are scaled so that 1 is the limit.
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
    """Something that must stay between ``low`` and ``high`` in every state."""

    moving: ClassVar[bool] = True
    """Whether velocity counts: a motion that is slowed down enough keeps it."""
    low: ClassVar[float] = -math.inf
    high: ClassVar[float] = 1.0
    needs_torque: ClassVar[bool] = False

    @property
    def what(self) -> str:
        """What it limits, in words."""
        raise NotImplementedError

    def told(self, use: float) -> str:
        """Return a use of the limit, 1 where it is reached, in words."""
        return f"{100 * use:.4g} % of its limit"

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return what must stay between ``low`` and 1, k x 1."""
        raise NotImplementedError

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the same of samples, shape (N, k)."""
        raise NotImplementedError

    def size(self, description: Description) -> int:
        """Return how many parameters it takes."""
        return 0

    def values(self, description: Description, T_start: Array) -> Array:
        """Return its parameters for a motion whose tool begins at a pose, shape (size,)."""
        return np.zeros(0)


@dataclass(frozen=True)
class MotorPower(Constraint):
    """The mechanical power of each joint, tau qd, W, both ways."""

    watts: float | tuple[float, ...]
    low = -1.0
    needs_torque = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "watts", positive("MotorPower", self.watts))

    @property
    def what(self) -> str:
        """What it limits, in words."""
        return "motor power"

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return what must stay within bounds, k x 1."""
        return point.tau * point.qd / _each(self.watts, point.n)

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the same of samples, shape (N, k)."""
        return states.tau * states.qd / _each(self.watts, states.n)

    def __repr__(self) -> str:
        return value_line(self)


@dataclass(frozen=True)
class TorqueSpeedLine(Constraint):
    """A motor's torque falls with its speed: tau / stall + qd / no-load speed stays within -1 and 1."""

    stall_torque: float | tuple[float, ...]
    """Joint side, N m or N."""
    no_load_speed: float | tuple[float, ...]
    """Joint side, rad/s or m/s."""
    low = -1.0
    needs_torque = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "stall_torque", positive("TorqueSpeedLine", self.stall_torque))
        object.__setattr__(self, "no_load_speed", positive("TorqueSpeedLine", self.no_load_speed))

    @property
    def what(self) -> str:
        """What it limits, in words."""
        return "torque-speed line"

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return what must stay within bounds, k x 1."""
        n = point.n
        return point.tau / _each(self.stall_torque, n) + point.qd / _each(self.no_load_speed, n)

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the same of samples, shape (N, k)."""
        n = states.n
        measured: Array = states.tau / _each(self.stall_torque, n) + states.qd / _each(self.no_load_speed, n)
        return measured

    def __repr__(self) -> str:
        return value_line(self)


def _each(value: float | tuple[float, ...], n: int) -> Array:
    array = np.atleast_1d(np.array(value, dtype=float))
    if array.size not in (1, n):
        raise ValueError(f"{array.size} numbers for {n} joints; expected 1 or {n}")
    return np.broadcast_to(array, n)


def positive(name: str, value: float | ArrayLike) -> float | tuple[float, ...]:
    """Return numbers that are positive; a ValueError names whose they are not."""
    array = number_array(value, name, "(n,)")
    if array.ndim > 1 or not array.size or not (array > 0).all():
        raise ValueError(f"{name}: {value!r}; expected positive numbers")
    return float(array) if array.ndim == 0 else tuple(array.tolist())
