"""The pieces that closed forms are made of, as CasADi SX expressions without branches.

An angle is carried as its (cosine, sine) pair: no sine or cosine is ever taken, and only results need an arc tangent.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeAlias

SX: TypeAlias = Any
"""A CasADi SX scalar, or a number that stands for one."""
Pair: TypeAlias = tuple[SX, SX]
"""Cosine and sine of an angle."""

ROUNDING = 2e-14
"""Share of the lengths at hand by which a pose may lie beyond the boundary and still counts as on it."""
SINGULAR = 1e-5
"""A branch is flagged where the sine, or the distance over the reach, that vanishes at a singularity is below this."""
NOTHING = 1e-13
"""Below this share a direction is noise, and any direction serves: the pose closes to about this."""


@dataclass(frozen=True)
class Branch:
    """One solution: joint values, and the conditions under which it holds."""

    q: tuple[SX, ...]
    """rad and m."""
    miss: SX
    """How far the pose is out of this branch's reach, m, in the arm's plane; the branch holds where it is 0."""
    shoulder: SX = 0.0
    elbow: SX = 0.0
    wrist: SX = 0.0
    clamped: SX = 0.0
    distance: SX | None = None
    """How far the pose is from the nearest point reached, m; ``miss`` unless given."""


def _casadi() -> Any:
    """CasADi, imported when a formula is derived: who finds its kernel on the disk never needs it."""
    import casadi

    return casadi


def sqrt(x: SX) -> SX:
    """Return the square root."""
    return _casadi().sqrt(x)


def fabs(x: SX) -> SX:
    """Return the absolute value."""
    return _casadi().fabs(x)


def fmax(a: SX, b: SX) -> SX:
    """Return the greater of two numbers."""
    return _casadi().fmax(a, b)


def clamp(x: SX, low: SX, high: SX) -> SX:
    """Return x, or the bound that it is beyond."""
    return if_else(x > high, high, fmax(x, low))


def logic_and(a: SX, b: SX) -> SX:
    """Return whether both conditions hold."""
    return _casadi().logic_and(a, b)


def either(a: SX, b: SX) -> SX:
    """Return whether one of two conditions holds."""
    return _casadi().logic_or(a, b)


def if_else(condition: SX, true: SX, false: SX) -> SX:
    """Return one of two values."""
    return _casadi().if_else(condition, true, false)


def positive_part(x: SX) -> SX:
    """Return x where it is above 0, else 0."""
    return if_else(x > 0, x, 0.0)


def sign(x: SX) -> SX:
    """Return -1 where x is below 0, else 1."""
    return if_else(x < 0, -1.0, 1.0)


def logic_not(condition: SX) -> SX:
    """Return the opposite of a condition."""
    return _casadi().logic_not(condition)


def hypot(a: SX, b: SX) -> SX:
    """Return the length of a vector of two entries."""
    return sqrt(a * a + b * b)


def rotate(R: SX, vector: tuple[SX, SX, SX]) -> tuple[SX, SX, SX]:
    """Return a vector times a 3 x 3 matrix."""
    x, y, z = (sum(R[i, k] * vector[k] for k in range(3)) for i in range(3))
    return x, y, z


def weighted_sum(weights: tuple[SX, ...], vectors: tuple[tuple[SX, SX, SX], ...]) -> tuple[SX, SX, SX]:
    """Return a sum of vectors, each times its weight."""
    x, y, z = (sum(w * vector[k] for w, vector in zip(weights, vectors, strict=True)) for k in range(3))
    return x, y, z


def unit_pair(x: SX, y: SX, scale: SX = 1.0, otherwise: Pair = (1.0, 0.0)) -> Pair:
    """Return the direction of (x, y) as a pair; where both are noise at ``scale``, the pair given."""
    size = hypot(x, y)
    sure = size > NOTHING * scale
    inverse = 1.0 / if_else(sure, size, 1.0)
    return if_else(sure, x * inverse, otherwise[0]), if_else(sure, y * inverse, otherwise[1])


def add_angles(a: Pair, b: Pair, sense: float | SX = 1.0) -> Pair:
    """Return the pair of the sum of two angles, or of their difference for sense -1; b of any length is turned by a."""
    sine = sense * b[1]
    return a[0] * b[0] - a[1] * sine, a[1] * b[0] + a[0] * sine


def angle(pair: Pair) -> SX:
    """Return the angle of a pair in (-pi, pi]."""
    return _casadi().atan2(pair[1], pair[0])


def turn_by_pi(x: SX) -> SX:
    """Return an angle in (-pi, pi] turned by pi, in (-pi, pi]."""
    return if_else(x > 0, x - math.pi, x + math.pi)


def wrap_angle(x: SX) -> SX:
    """Return an angle in [-3 pi, 3 pi] in (-pi, pi]."""
    x = if_else(x > math.pi, x - 2 * math.pi, x)
    return if_else(x <= -math.pi, x + 2 * math.pi, x)


def select_pair(condition: SX, a: Pair, b: Pair) -> Pair:
    """Return one of two pairs."""
    return if_else(condition, a[0], b[0]), if_else(condition, a[1], b[1])


@dataclass(frozen=True)
class TwoLink:
    """How two links of lengths L1 and L2 in a plane reach a point; both elbows."""

    first: tuple[Pair, Pair]
    """Direction of the first link, for the elbow on the left of the line to the point, and on the right."""
    between: tuple[Pair, Pair]
    """Angle from the first link to the second."""
    miss: SX
    """How far the point is out of reach, m; up to rounding 0."""
    straight: SX
    """Whether the arm is stretched or folded."""
    clamped: SX
    """Whether the point lies beyond the boundary by rounding."""


def two_link(x: SX, y: SX, L1: SX, L2: SX, scale: SX) -> TwoLink:
    """Solve L1 e^(i a) + L2 e^(i (a + b)) = x + i y for a and b.

    Parameters
    ----------
    x, y
        The point, m.
    L1, L2
        Lengths, m, positive.
    scale
        The size of the numbers that x and y were computed from, m: what rounding is measured by.
    """
    R = hypot(x, y)
    reach, gap = L1 + L2, fabs(L1 - L2)
    excess = fmax(R - reach, gap - R)
    beyond = excess > ROUNDING * scale
    # 1 + cos b and 1 - cos b as products: nothing cancels near the stretched and the folded arm.
    folded = (R - gap) * (R + gap) / (2 * L1 * L2)
    stretched = (reach - R) * (reach + R) / (2 * L1 * L2)
    near_folded = folded < 1.0
    square = folded * stretched
    c, s = unit_pair(if_else(near_folded, folded - 1.0, 1.0 - stretched), sqrt(positive_part(square)))
    # Both elbows mirror each other at the line to the point: a = arg(point) -+ arg(L1 + L2 e^(i b)).
    forward = unit_pair(x, y, scale)
    inside = unit_pair(if_else(near_folded, L1 - L2 + L2 * folded, L1 + L2 * c), L2 * s, L1)
    return TwoLink(
        first=(add_angles(forward, inside), add_angles(forward, inside, -1.0)),
        between=((c, -s), (c, s)),
        miss=if_else(beyond, excess, 0.0),
        straight=s < SINGULAR,
        clamped=logic_and(square < 0, logic_not(beyond)),
    )
