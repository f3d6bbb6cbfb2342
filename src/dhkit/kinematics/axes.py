"""Arrangement of an arm's joint axes, which decides whether its inverse kinematics have a closed form."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Description, world_to_frames
from dhkit.description.frames import carrying

TOLERANCE = 1e-12
"""Tolerance for parallel and perpendicular axes (sine of an angle) and for intersecting ones (share of the reach). A
closed form then closes to about this."""


@dataclass(frozen=True, eq=False)
class Axes:
    """The joint axes in the world at zero joint positions, offsets included; methods count joints from 1."""

    directions: Array
    """Unit vectors in the positive sense of each joint, shape (n, 3)."""
    points: Array
    """A point of each axis, shape (n, 3), m."""
    prismatic: NDArray[np.bool_]
    T_world_tool: Array
    """The tool in the world, shape (4, 4), m."""
    scale: float
    """The reach, m, which lengths are compared with."""
    tolerance: float = TOLERANCE

    @classmethod
    @lru_cache(maxsize=512)
    def of(cls, description: Description, tolerance: float = TOLERANCE) -> Axes:
        """Return the axes of an arm."""
        frames = world_to_frames(description, np.zeros(description.n))
        moving = carrying(description.convention, frames)
        return cls(
            directions=moving[:, :3, 2],
            points=moving[:, :3, 3],
            prismatic=description.numbers.prismatic,
            T_world_tool=frames[-1] @ description.numbers.T_last_tool,
            scale=_scale(description),
            tolerance=tolerance,
        )

    @property
    def n(self) -> int:
        """The number of joints."""
        return len(self.prismatic)

    @property
    def kinds(self) -> str:
        """One letter a joint, R or P."""
        return "".join("P" if moves else "R" for moves in self.prismatic)

    def direction(self, i: int) -> Array:
        """Return the unit vector along axis i (from 1), shape (3,), world axes."""
        direction: Array = self.directions[i - 1]
        return direction

    def point(self, i: int) -> Array:
        """Return a point of axis i (from 1), shape (3,), m, in the world."""
        point: Array = self.points[i - 1]
        return point

    def parallel(self, i: int, j: int) -> bool:
        """Return whether axes i and j have the same or opposite direction."""
        return bool(
            np.linalg.norm(np.cross(self.direction(i), self.direction(j))) <= self.tolerance
        )

    def perpendicular(self, i: int, j: int) -> bool:
        """Return whether the directions of axes i and j are at right angles."""
        return bool(abs(self.direction(i) @ self.direction(j)) <= self.tolerance)

    def sense(self, i: int, j: int) -> float:
        """Return +1 if parallel axes i and j have the same direction, else -1."""
        return 1.0 if self.direction(i) @ self.direction(j) > 0 else -1.0

    def distance(self, i: int, point: Array) -> float:
        """Return the distance of a point, shape (3,), m, from axis i, m."""
        return float(np.linalg.norm(np.cross(self.direction(i), point - self.point(i))))

    def on(self, i: int, point: Array) -> bool:
        """Return whether axis i passes through a point, shape (3,), m."""
        return self.distance(i, point) <= self.tolerance * self.scale

    def snapped(self, length: float) -> float:
        """Return a length, m, or 0 if it is as small as rounding."""
        return 0.0 if abs(length) <= self.tolerance * self.scale else float(length)

    def meeting_point(self, i: int, j: int) -> Array | None:
        """Return the point, shape (3,), m, where axes i and j intersect; None if they are parallel or skew."""
        a = self.direction(i)
        b = self.direction(j)
        normal = np.cross(a, b)

        # |a x b| is the sine of the angle between the axes.
        square = normal @ normal
        if square <= self.tolerance**2:
            return None

        # The point of line p_i + s a nearest to p_j + t b: s = ((p_j - p_i) x b) . (a x b) / |a x b|^2.
        s = np.cross(self.point(j) - self.point(i), b) @ normal / square
        point: Array = self.point(i) + s * a
        return point if self.on(j, point) else None


def _scale(description: Description) -> float:
    reach = description.reach
    return reach if np.isfinite(reach) and reach > 0 else 1.0
