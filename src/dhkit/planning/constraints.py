"""What a motion must keep besides the joints' limits, as small values.

A constraint is written twice: as rows of symbols for the optimizer, and as numbers of a motion's samples by another
path (Pinocchio's kinematics and dynamics), by which the result is certified. Rows are scaled so that 1 is the limit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description
from dhkit.planning.point import Point
from dhkit.planning.states import States

if TYPE_CHECKING:
    import casadi

__all__ = [
    "Constraint",
    "MotorPower",
    "ToolAcceleration",
    "ToolDirection",
    "ToolOrientation",
    "ToolSpeed",
    "TorqueSpeedLine",
]


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
        object.__setattr__(self, "watts", _positive("MotorPower", self.watts))

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
        object.__setattr__(self, "stall_torque", _positive("TorqueSpeedLine", self.stall_torque))
        object.__setattr__(self, "no_load_speed", _positive("TorqueSpeedLine", self.no_load_speed))

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


@dataclass(frozen=True)
class ToolSpeed(Constraint):
    """The speed of the tool's origin, m/s."""

    limit: float

    def __post_init__(self) -> None:
        _positive("ToolSpeed", self.limit)

    @property
    def what(self) -> str:
        """What it limits, in words."""
        return "tool speed"

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return what must stay within bounds, k x 1."""
        import casadi

        return casadi.sumsqr(point.tool_velocity) / self.limit**2

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the same of samples, shape (N, k)."""
        square: Array = np.sum(states.tool_velocity**2, axis=1, keepdims=True)
        return square / self.limit**2


@dataclass(frozen=True)
class ToolAcceleration(Constraint):
    """The size of the acceleration of the tool's origin, m/s^2."""

    limit: float

    def __post_init__(self) -> None:
        _positive("ToolAcceleration", self.limit)

    @property
    def what(self) -> str:
        """What it limits, in words."""
        return "tool acceleration"

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return what must stay within bounds, k x 1."""
        import casadi

        return casadi.sumsqr(point.tool_acceleration) / self.limit**2

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the same of samples, shape (N, k)."""
        square: Array = np.sum(states.tool_acceleration**2, axis=1, keepdims=True)
        return square / self.limit**2


@dataclass(frozen=True)
class ToolDirection(Constraint):
    """An axis of the tool keeps its direction in the world up to an angle, as a full glass needs it."""

    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """In the tool's frame."""
    direction: tuple[float, float, float] | None = None
    """In the world; None: as at the start."""
    tolerance: float = math.radians(2)
    """rad."""
    moving = False

    def __post_init__(self) -> None:
        _angle("ToolDirection", self.tolerance)
        object.__setattr__(self, "axis", _unit("ToolDirection", self.axis))
        if self.direction is not None:
            object.__setattr__(self, "direction", _unit("ToolDirection", self.direction))

    @property
    def what(self) -> str:
        """What it limits, in words."""
        return "tool direction"

    def told(self, use: float) -> str:
        """Return a use of the limit in words."""
        return _told_angle(use, self.tolerance)

    def size(self, description: Description) -> int:
        """Return how many parameters it takes."""
        return 3

    def values(self, description: Description, T_start: Array) -> Array:
        """Return its parameters, shape (size,)."""
        return T_start[:3, :3] @ np.array(self.axis) if self.direction is None else np.array(self.direction)

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return what must stay within bounds, k x 1."""
        import casadi

        axis = point.T_world_tool[:3, :3] @ casadi.DM(self.axis)
        share: casadi.SX = _share_of_angle(casadi.dot(axis, parameters), self.tolerance)
        return share

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the same of samples, shape (N, k)."""
        cosine = (states.T_world_tool[:, :3, :3] @ np.array(self.axis)) @ parameters
        return np.asarray(_share_of_angle(cosine, self.tolerance))[:, None]


@dataclass(frozen=True)
class ToolOrientation(Constraint):
    """The tool keeps the orientation that it has at the start up to an angle."""

    tolerance: float = math.radians(2)
    """rad."""
    moving = False

    def __post_init__(self) -> None:
        _angle("ToolOrientation", self.tolerance)

    @property
    def what(self) -> str:
        """What it limits, in words."""
        return "tool orientation"

    def told(self, use: float) -> str:
        """Return a use of the limit in words."""
        return _told_angle(use, self.tolerance)

    def size(self, description: Description) -> int:
        """Return how many parameters it takes."""
        return 9

    def values(self, description: Description, T_start: Array) -> Array:
        """Return its parameters, shape (size,)."""
        return T_start[:3, :3].ravel(order="F")

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return what must stay within bounds, k x 1."""
        import casadi

        trace = casadi.dot(casadi.vec(point.T_world_tool[:3, :3]), parameters)
        share: casadi.SX = _share_of_angle((trace - 1) / 2, self.tolerance)
        return share

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the same of samples, shape (N, k)."""
        trace = np.einsum("kij,ij->k", states.T_world_tool[:, :3, :3], parameters.reshape(3, 3, order="F"))
        return np.asarray(_share_of_angle((trace - 1) / 2, self.tolerance))[:, None]


def _share_of_angle(cosine: Any, tolerance: float) -> Any:
    """Return (1 - cos angle) / (1 - cos tolerance)."""
    return (1 - cosine) / (1 - math.cos(tolerance))


def _told_angle(use: float, tolerance: float) -> str:
    angle = math.acos(max(-1.0, 1 - use * (1 - math.cos(tolerance))))
    return f"{math.degrees(angle):.4g} deg off, {math.degrees(tolerance):.4g} deg are"


def _each(value: float | tuple[float, ...], n: int) -> Array:
    array = np.atleast_1d(np.array(value, dtype=float))
    if array.size not in (1, n):
        raise ValueError(f"{array.size} numbers for {n} joints; expected 1 or {n}")
    return np.broadcast_to(array, n)


def _positive(name: str, value: float | ArrayLike) -> float | tuple[float, ...]:
    array = np.asarray(value, dtype=float)
    if array.ndim > 1 or not array.size or not (array > 0).all():
        raise ValueError(f"{name}: {value!r}; expected positive numbers")
    return float(array) if array.ndim == 0 else tuple(array.tolist())


def _angle(name: str, value: float) -> None:
    if not 0 < value < math.pi:
        raise ValueError(f"{name}: tolerance is {value!r}; expected an angle between 0 and pi, rad")


def _unit(name: str, vector: ArrayLike) -> tuple[float, ...]:
    array = np.asarray(vector, dtype=float)
    length = float(np.linalg.norm(array)) if array.shape == (3,) else 0.0
    if not 0 < length < math.inf:
        raise ValueError(f"{name}: {vector!r}; expected a vector of three numbers, not all 0")
    return tuple((array / length).tolist())
