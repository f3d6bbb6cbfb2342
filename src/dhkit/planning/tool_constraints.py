"""Constraints of the tool: speed, acceleration, direction, orientation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description
from dhkit.description.arrays import number_array
from dhkit.display import value_line
from dhkit.planning.constraints import Constraint, positive
from dhkit.planning.point import Point
from dhkit.planning.states import States

if TYPE_CHECKING:
    import casadi


@dataclass(frozen=True)
class ToolSpeed(Constraint):
    """Limit of the speed of the tool's origin, m/s."""

    limit: float

    def __post_init__(self) -> None:
        positive("ToolSpeed", self.limit)

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        return "tool speed"

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return the limited expressions, k x 1, without unit: scaled so that the bound is 1."""
        import casadi

        return casadi.sumsqr(point.tool_velocity) / self.limit**2

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the limited quantity at samples, shape (N, k)."""
        square: Array = np.sum(states.tool_velocity**2, axis=1, keepdims=True)
        return square / self.limit**2


@dataclass(frozen=True)
class ToolAcceleration(Constraint):
    """Limit of the magnitude of the acceleration of the tool's origin, m/s^2."""

    limit: float

    def __post_init__(self) -> None:
        positive("ToolAcceleration", self.limit)

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        return "tool acceleration"

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return the limited expressions, k x 1, without unit: scaled so that the bound is 1."""
        import casadi

        return casadi.sumsqr(point.tool_acceleration) / self.limit**2

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the limited quantity at samples, shape (N, k)."""
        square: Array = np.sum(states.tool_acceleration**2, axis=1, keepdims=True)
        return square / self.limit**2


@dataclass(frozen=True)
class ToolDirection(Constraint):
    """Limit of the angle between an axis of the tool and a direction in the world, as for carrying a full glass."""

    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """Axis in the tool's frame."""
    direction: tuple[float, float, float] | None = None
    """Direction in the world; None for that of the axis at the start."""
    tolerance: float = math.radians(2)
    """Largest angle, rad."""
    moving = False

    def __post_init__(self) -> None:
        _angle("ToolDirection", self.tolerance)
        object.__setattr__(self, "axis", _unit("ToolDirection", self.axis))
        if self.direction is not None:
            object.__setattr__(self, "direction", _unit("ToolDirection", self.direction))

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        return "tool direction"

    def use_text(self, use: float) -> str:
        """Return a use of the limit as text."""
        return _angle_use_text(use, self.tolerance)

    def size(self, description: Description) -> int:
        """Return the number of parameters."""
        return 3

    def values(self, description: Description, T_start: Array) -> Array:
        """Return the parameters, shape (size,), without unit."""
        return T_start[:3, :3] @ np.array(self.axis) if self.direction is None else np.array(self.direction)

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return the limited expressions, k x 1, without unit: scaled so that the bound is 1."""
        import casadi

        axis = point.T_world_tool[:3, :3] @ casadi.DM(self.axis)
        share: casadi.SX = _share_of_angle(casadi.dot(axis, parameters), self.tolerance)
        return share

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the limited quantity at samples, shape (N, k)."""
        cosine = (states.T_world_tool[:, :3, :3] @ np.array(self.axis)) @ parameters
        return np.asarray(_share_of_angle(cosine, self.tolerance))[:, None]

    __repr__ = value_line


@dataclass(frozen=True)
class ToolOrientation(Constraint):
    """Limit of the angle between the tool's orientation and that at the start."""

    tolerance: float = math.radians(2)
    """Largest angle, rad."""
    moving = False

    def __post_init__(self) -> None:
        _angle("ToolOrientation", self.tolerance)

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        return "tool orientation"

    def use_text(self, use: float) -> str:
        """Return a use of the limit as text."""
        return _angle_use_text(use, self.tolerance)

    def size(self, description: Description) -> int:
        """Return the number of parameters."""
        return 9

    def values(self, description: Description, T_start: Array) -> Array:
        """Return the parameters, shape (size,), without unit."""
        return T_start[:3, :3].ravel(order="F")

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return the limited expressions, k x 1, without unit: scaled so that the bound is 1."""
        import casadi

        trace = casadi.dot(casadi.vec(point.T_world_tool[:3, :3]), parameters)
        share: casadi.SX = _share_of_angle((trace - 1) / 2, self.tolerance)
        return share

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the limited quantity at samples, shape (N, k)."""
        trace = np.einsum("kij,ij->k", states.T_world_tool[:, :3, :3], parameters.reshape(3, 3, order="F"))
        return np.asarray(_share_of_angle((trace - 1) / 2, self.tolerance))[:, None]


def _share_of_angle(cosine: Any, tolerance: float) -> Any:
    """Return (1 - cos angle) / (1 - cos tolerance)."""
    return (1 - cosine) / (1 - math.cos(tolerance))


def _angle_use_text(use: float, tolerance: float) -> str:
    angle = math.acos(max(-1.0, 1 - use * (1 - math.cos(tolerance))))
    return f"{math.degrees(angle):.4g} deg off, {math.degrees(tolerance):.4g} deg are"


def _angle(name: str, value: float) -> None:
    if not 0 < value < math.pi:
        raise ValueError(f"{name}: tolerance is {value!r}; expected an angle between 0 and pi, rad")


def _unit(name: str, vector: ArrayLike) -> tuple[float, ...]:
    array = number_array(vector, name, "(3,)")
    length = float(np.linalg.norm(array)) if array.shape == (3,) else 0.0
    if not 0 < length < math.inf:
        raise ValueError(f"{name}: {vector!r}; expected a vector of three numbers, not all 0")
    return tuple((array / length).tolist())
