"""Joint 1 as a turntable under an arm that moves in a plane: where the plane goes, and what it looks like inside.

Coordinates: u along axis 1, v along the parallel axes behind it (at right angles to axis 1), x = u x v. They are taken
at zero joint values, with the origin on axis 1 at the height of axis 2, and turn with joint 1.
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
    ROUNDING,
    SINGULAR,
    SX,
    Pair,
    fabs,
    logic_and,
    select_pair,
    hypot,
    logic_not,
    sign,
    sqrt,
    add_angles,
    unit_pair,
    if_else,
)

FLIPS = ("no-flip", "flip")
UPRIGHT = 1e-9
"""Sine of the angle by which axis 1 may miss being upright or level."""

Vector: TypeAlias = tuple[SX, SX, SX]
"""Coordinates along x, u and v."""


@dataclass(frozen=True, eq=False)
class ArmPlane:
    """The frame (x, u, v) of an arm whose axis 2 is at right angles to axis 1."""

    R: Array
    """Shape (3, 3): rows x, u, v in the world."""
    origin: Array
    """Shape (3,), m, in the world."""
    up: tuple[float, float, float]
    """The world's vertical in this frame."""

    @classmethod
    def of(cls, axes: Axes) -> ArmPlane:
        """Return the frame of axes 1 and 2."""
        u, v = axes.direction(1), axes.direction(2)
        height = u @ (axes.point(2) - axes.point(1))
        R = np.stack([np.cross(u, v), u, v]) + 0.0
        # A base that is upright but for rounding is upright.
        x, along, across = (0.0 if abs(entry) <= UPRIGHT else float(entry) for entry in R[:, 2])
        return cls(R, axes.point(1) + height * u, (x, along, across))

    def coordinates(self, point: Array) -> Array:
        """Return a point's coordinates (x, u, v), m."""
        place: Array = self.R @ (point - self.origin)
        return place

    @property
    def T(self) -> Array:
        """Shape (4, 4): the world in this frame."""
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = self.R, -self.R @ self.origin
        return T


@dataclass(frozen=True)
class Shoulder:
    """One of the two places of joint 1 that bring the arm's plane through a point."""

    q1: Pair
    x: SX
    """The point's distance from axis 1 along the plane, m, with its sign."""
    miss: SX
    r: SX
    """The point's distance from axis 1, m."""
    singular: SX
    clamped: SX

    def shortfall(self, offset: SX, x: SX, rise: SX) -> SX:
        """Return how far the point is from one at x along the plane and ``rise`` higher, m, joint 1 turning freely."""
        return hypot(self.r - hypot(x, offset), rise)


def shoulders(point: Vector, offset: SX, scale: SX, reach: SX, free: Pair) -> tuple[Shoulder, Shoulder]:
    """Turn joint 1 so that a point has the coordinate ``offset`` across the plane; the point in front, then behind.

    Parameters
    ----------
    point
        Where it is, with joint 1 at zero, m.
    offset
        How far across the plane it must be, m.
    scale, reach
        What rounding and nearness to the singularity are measured by, m.
    free
        The angle of joint 1 where the point is on its axis.
    """
    x, _, v = point
    r = hypot(x, v)
    short = fabs(offset) - r
    beyond = short > ROUNDING * scale
    square = (r - fabs(offset)) * (r + fabs(offset))
    front = sqrt(if_else(square > 0, square, 0.0))

    def side(along: SX) -> Shoulder:
        # The plane's point (along, offset) seen in the fixed frame is (x, v): their angle is that of joint 1.
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

    An arm without lateral offset has no left and right: there the shoulder in front comes first.
    """
    front, back = shoulders(position, p["offset"], pose.scale, p["reach"], pose.free_1)
    swap = sign(p["up"][1]) * p["offset"] > 0

    def either(a: Shoulder, b: Shoulder) -> Shoulder:
        return replace(a, q1=select_pair(swap, a.q1, b.q1), x=if_else(swap, a.x, b.x))

    return either(back, front), either(front, back)


def branch_names(offset: Any, *choices: Sequence[str]) -> tuple[str, ...]:
    """Return the names of branches: the shoulder's side, then every combination of the other choices.

    An arm whose plane holds axis 1 (offset 0) has no left and right: its shoulders are front and back.
    """
    sides = ("left", "right") if offset else ("front", "back")
    return tuple(" ".join(words) for words in product(sides, *choices))


def turned_back(vector: Vector, q1: Pair, rho: Pair = (1.0, 0.0)) -> Vector:
    """Return a vector as the arm sees it: joint 1 undone, then a turn rho about v."""
    c, s = q1
    x, u, v = c * vector[0] - s * vector[2], vector[1], c * vector[2] + s * vector[0]
    return rho[0] * x + rho[1] * u, rho[0] * u - rho[1] * x, v


def as_pair(x: SX, y: SX) -> tuple[float, float]:
    """Return the direction of a vector of numbers that is not zero as (cosine, sine)."""
    size = float(np.hypot(x, y))
    return x / size + 0.0, y / size + 0.0
