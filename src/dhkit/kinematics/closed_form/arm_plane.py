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
"""Names of the wrist's two solutions: joint 5 turned to its positive side, and to its negative one."""
UPRIGHT = 1e-9
"""Entries of the vertical's direction below this count as 0, so that a base that is upright but for rounding is."""

Vector: TypeAlias = tuple[SX, SX, SX]
"""Coordinates along x, u and v."""


@dataclass(frozen=True, eq=False)
class ArmPlane:
    """The frame (x, u, v) of an arm whose axis 2 is at right angles to axis 1."""

    R: Array
    """Directions x, u and v in the world, one a row, shape (3, 3)."""
    origin: Array
    """Origin in the world, shape (3,), m."""
    up: tuple[float, float, float]
    """The world's vertical in this frame, a unit vector."""

    @classmethod
    def of(cls, axes: Axes) -> ArmPlane:
        """Return the frame of axes 1 and 2."""
        u = axes.direction(1)
        v = axes.direction(2)
        height = u @ (axes.point(2) - axes.point(1))
        R = np.stack([np.cross(u, v), u, v]) + 0.0

        # R maps the world's coordinates to (x, u, v), so that its last column is the world's vertical.
        vertical = np.where(np.abs(R[:, 2]) <= UPRIGHT, 0.0, R[:, 2])
        up_x, up_u, up_v = vertical.tolist()
        return cls(R, axes.point(1) + height * u, (up_x, up_u, up_v))

    def coordinates(self, point: Array) -> Array:
        """Return the coordinates (x, u, v) of a point of the world, shape (3,), m."""
        return self.R @ (point - self.origin)

    @property
    def T(self) -> Array:
        """Pose of the world in this frame, shape (4, 4), m: R (point - origin) = R point - R origin."""
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
    """Distance by which the point is nearer to axis 1 than the plane is, m; 0 where the plane passes through it."""
    r: SX
    """The point's distance from axis 1, m."""
    singular: SX
    """Whether the two positions of joint 1 nearly coincide: the point is about as near to axis 1 as the plane is."""
    clamped: SX
    """Whether the point is too near to axis 1 by rounding only."""

    def distance_from_circle(self, offset: SX, x: SX, rise: SX) -> SX:
        """Return the least distance, m, of the point from the circle on which joint 1 moves a point (x, offset).

        The circle's radius is sqrt(x^2 + offset^2), its height differs by ``rise``, so that the distance is

            sqrt((r - sqrt(x^2 + offset^2))^2 + rise^2).
        """
        return hypot(self.r - hypot(x, offset), rise)


def _shoulders(
    point: Vector, offset: SX, scale: SX, reach: SX, free: Pair
) -> tuple[Shoulder, Shoulder]:
    """Return the two positions of joint 1 that give a point the coordinate v = ``offset``: point in front, then behind.

    The point has coordinates (x, v) with joint 1 at zero and (X, offset) in the plane at q1. Joint 1 turns v towards x,
    so that as complex numbers

        x + i v = e^(-i q1) (X + i offset),    and with r = |x + i v|
        X = +-sqrt(r^2 - offset^2),    q1 = arg(X + i offset) - arg(x + i v).

    Parameters
    ----------
    point
        The point's coordinates with joint 1 at zero, m.
    offset
        Its coordinate v across the plane after revolute joint 1, m.
    scale, reach
        Lengths that rounding and nearness to the singularity are shares of, m.
    free
        The angle of joint 1 where the point is on its axis.
    """
    x, _, v = point
    r = hypot(x, v)
    short = fabs(offset) - r
    beyond = short > BOUNDARY_SHARE * scale

    # r^2 - offset^2 as a product: the difference of squares would cancel where they are nearly equal.
    square = (r - fabs(offset)) * (r + fabs(offset))
    front = sqrt(if_else(square > 0, square, 0.0))

    def side(X: SX, facing: float) -> Shoulder:
        in_plane = unit_pair(X, offset, scale, (facing, 0.0))
        at_zero = unit_pair(x, v, scale, (free[0], -free[1]))
        return Shoulder(
            q1=add_angles(in_plane, at_zero, -1.0),
            x=X,
            miss=if_else(beyond, short, 0.0),
            r=r,
            singular=front < SINGULAR * reach,
            clamped=logic_and(square < 0, logic_not(beyond)),
        )

    return side(front, 1.0), side(-front, -1.0)


def ordered_shoulders(
    p: Mapping[str, SX], position: Vector, pose: PoseSymbols
) -> tuple[Shoulder, Shoulder]:
    """Return the left shoulder first: seen from axis 1 towards the wrist, the arm's plane passes on the left.

    Without lateral offset there is no left and right; the shoulder in front then comes first.
    """
    front, back = _shoulders(position, p["offset"], pose.scale, p["reach"], pose.free_1)

    # Seen with u up, the left of a direction along x is u x (u x v) = -v. The plane, at v = offset, thus passes on the
    # right of the arm in front where offset > 0, and on the left of the one at the back, which points along -x.
    back_is_left = sign(p["up"][1]) * p["offset"] > 0

    def selected(a: Shoulder, b: Shoulder) -> Shoulder:
        """Return a where the shoulder at the back is the left one, else b; they differ in q1 and x only."""
        return replace(
            a, q1=select_pair(back_is_left, a.q1, b.q1), x=if_else(back_is_left, a.x, b.x)
        )

    return selected(back, front), selected(front, back)


def branch_names(offset: Any, *choices: Sequence[str]) -> tuple[str, ...]:
    """Return the names of branches: the shoulder's side with every combination of the other choices.

    With offset 0 the shoulders are called front and back instead of left and right.
    """
    sides = ("left", "right") if offset else ("front", "back")
    return tuple(" ".join(words) for words in product(sides, *choices))


def to_arm_frame(vector: Vector, q1: Pair, rho: Pair = (1.0, 0.0)) -> Vector:
    """Return a vector in the axes of the arm's plane at joint 1 = q1, then rotated by -rho about v.

    The plane turns about u, along axis 1, and the links about v, along axis 2. A vector (x, u, v) becomes

        (c1 x - s1 v, u, s1 x + c1 v),    and then    (c x + s u, c u - s x, v),    c = cos(rho), s = sin(rho).
    """
    c1, s1 = q1
    x = c1 * vector[0] - s1 * vector[2]
    u = vector[1]
    v = c1 * vector[2] + s1 * vector[0]

    c, s = rho
    return c * x + s * u, c * u - s * x, v


def as_pair(x: SX, y: SX) -> tuple[float, float]:
    """Return the direction of a nonzero vector of numbers as (cosine, sine)."""
    size = float(np.hypot(x, y))
    return x / size + 0.0, y / size + 0.0
