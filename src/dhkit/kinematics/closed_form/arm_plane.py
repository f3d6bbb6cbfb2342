"""Arms that move in a plane which joint 1 turns about its axis: the plane's frame, and joint 1 for a given point.

The frame has u along axis 1, v along axis 2 (at right angles to axis 1), and x = u x v. It is taken at zero joint
positions, with its origin on axis 1 at the height of axis 2, and turns with joint 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, TypeAlias

import numpy as np

from dhkit.description import Array
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.closed_form.family import PoseSymbols
from dhkit.kinematics.closed_form.formulas import (
    BOUNDARY_SHARE,
    SINGULAR,
    SX,
    Pair,
    add_angles,
    fabs,
    hypot,
    if_else,
    logic_and,
    logic_not,
    select_pair,
    sign,
    sqrt,
    unit_pair,
)

FLIPS = ("no-flip", "flip")
UPRIGHT = 1e-9
"""Entries of the vertical's direction below this count as 0, so that a base that is upright but for rounding is."""

Vector: TypeAlias = tuple[SX, SX, SX]
"""Coordinates along x, u and v."""


@dataclass(frozen=True, eq=False)
class ArmPlane:
    """The frame (x, u, v) of an arm whose axis 2 is at right angles to axis 1."""

    R: Array
    """Rows x, u, v in the world, shape (3, 3)."""
    origin: Array
    """Origin in the world, shape (3,), m."""
    up: tuple[float, float, float]
    """The world's vertical in this frame, a unit vector."""

    @classmethod
    def of(cls, axes: Axes) -> ArmPlane:
        """Return the frame of axes 1 and 2."""
        u, v = axes.direction(1), axes.direction(2)
        height = u @ (axes.point(2) - axes.point(1))
        R = np.stack([np.cross(u, v), u, v]) + 0.0
        x, along, across = (0.0 if abs(entry) <= UPRIGHT else float(entry) for entry in R[:, 2])
        return cls(R, axes.point(1) + height * u, (x, along, across))

    def coordinates(self, point: Array) -> Array:
        """Return the coordinates (x, u, v) of a point of the world, shape (3,), m."""
        return self.R @ (point - self.origin)

    @property
    def T(self) -> Array:
        """Pose of the world in this frame, shape (4, 4), m."""
        T = np.eye(4)
        T[:3, :3] = self.R
        T[:3, 3] = -self.R @ self.origin
        return T


@dataclass(frozen=True)
class Shoulder:
    """One of the two positions of joint 1 that bring the arm's plane through a point."""

    q1: Pair
    x: SX
    """Signed distance of the point from axis 1 along the plane, m."""
    miss: SX
    r: SX
    """The point's distance from axis 1, m."""
    singular: SX
    clamped: SX

    def shortfall(self, offset: SX, x: SX, rise: SX) -> SX:
        """Return the distance of the point from one at x along the plane and ``rise`` higher, m, over all joint 1."""
        return hypot(self.r - hypot(x, offset), rise)


def _shoulders(point: Vector, offset: SX, scale: SX, reach: SX, free: Pair) -> tuple[Shoulder, Shoulder]:
    """Return the two positions of joint 1 that give a point the coordinate v = ``offset``: point in front, then behind.

    Parameters
    ----------
    point
        The point's coordinates with joint 1 at zero, m.
    offset
        Its coordinate v across the plane after turning joint 1, m.
    scale, reach
        Lengths that rounding and nearness to the singularity are shares of, m.
    free
        The angle of joint 1 where the point is on its axis.
    """
    x, _, v = point
    r = hypot(x, v)
    short = fabs(offset) - r
    beyond = short > BOUNDARY_SHARE * scale
    square = (r - fabs(offset)) * (r + fabs(offset))
    front = sqrt(if_else(square > 0, square, 0.0))

    def side(along: SX) -> Shoulder:
        # Joint 1 turns (along, offset) in the plane's frame into (x, v) in the fixed frame.
        return Shoulder(
            q1=add_angles(unit_pair(along, offset, scale), unit_pair(x, v, scale, (free[0], -free[1])), -1.0),
            x=along,
            miss=if_else(beyond, short, 0.0),
            r=r,
            singular=front < SINGULAR * reach,
            clamped=logic_and(square < 0, logic_not(beyond)),
        )

    return side(front), side(-front)


def ordered_shoulders(p: Mapping[str, SX], position: Vector, pose: PoseSymbols) -> tuple[Shoulder, Shoulder]:
    """Return the left shoulder first: seen from axis 1 towards the wrist, the arm's plane passes on the left.

    Without lateral offset there is no left and right; the shoulder in front then comes first.
    """
    front, back = _shoulders(position, p["offset"], pose.scale, p["reach"], pose.free_1)
    swap = sign(p["up"][1]) * p["offset"] > 0

    def either(a: Shoulder, b: Shoulder) -> Shoulder:
        return replace(a, q1=select_pair(swap, a.q1, b.q1), x=if_else(swap, a.x, b.x))

    return either(back, front), either(front, back)


def branch_names(offset: Any, *choices: Sequence[str]) -> tuple[str, ...]:
    """Return the names of branches: the shoulder's side with every combination of the other choices.

    With offset 0 the shoulders are called front and back instead of left and right.
    """
    sides = ("left", "right") if offset else ("front", "back")
    return tuple(" ".join(words) for words in product(sides, *choices))


def to_arm_frame(vector: Vector, q1: Pair, rho: Pair = (1.0, 0.0)) -> Vector:
    """Return a vector in the axes of the arm's plane at joint 1 = q1, then rotated by -rho about v."""
    c, s = q1
    x = c * vector[0] - s * vector[2]
    u = vector[1]
    v = c * vector[2] + s * vector[0]
    return rho[0] * x + rho[1] * u, rho[0] * u - rho[1] * x, v


def as_pair(x: SX, y: SX) -> tuple[float, float]:
    """Return the direction of a nonzero vector of numbers as (cosine, sine)."""
    size = float(np.hypot(x, y))
    return x / size + 0.0, y / size + 0.0
