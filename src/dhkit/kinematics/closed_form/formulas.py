"""Building blocks of closed forms, as CasADi SX expressions without branches.

Angles are (cosine, sine) pairs: no sine or cosine is computed, and only the results need an arc tangent.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

from dhkit.symbolic.differentiable.vectors import (
    Vector3,
    about_x,
    about_x_back,
    about_z,
    about_z_back,
)

SX: TypeAlias = Any
"""A CasADi SX scalar, or a number instead of one."""
Pair: TypeAlias = tuple[SX, SX]
"""Cosine and sine of an angle."""

BOUNDARY_SHARE = 2e-14
"""Share of ``scale`` by which a pose may lie beyond the boundary of the workspace and still count as on it."""
SINGULAR = 1e-5
"""A branch counts as singular where the sine, or distance over reach, that vanishes there is below this."""
MIN_DIRECTION = 1e-13
"""Shortest vector, as a share of ``scale``, that has a direction. That of a shorter one is only rounding error, and is
replaced by a default: forward kinematics of the solution then differs from the pose by about this share."""


@dataclass(frozen=True)
class Branch:
    """One solution: joint positions, and the conditions under which they hold."""

    q: tuple[SX, ...]
    """Joint positions, rad and m."""
    miss: SX
    """Distance of the pose from this branch's reach in the arm's plane, m; the branch is valid where it is 0."""
    shoulder: SX = 0.0
    """Whether the branch is singular at the shoulder."""
    elbow: SX = 0.0
    """Whether the branch is singular at the elbow."""
    wrist: SX = 0.0
    """Whether the branch is singular at the wrist."""
    clamped: SX = 0.0
    """Whether the pose lies beyond the boundary by rounding."""
    distance: SX | None = None
    """Distance of the pose from the nearest pose that is reached, m; equals ``miss`` if not given."""


def _of_casadi(name: str) -> Callable[..., SX]:
    """Return CasADi's function of this name; CasADi is imported when a formula is derived, not for a cached kernel."""

    def function(*arguments: SX) -> SX:
        import casadi

        return getattr(casadi, name)(*arguments)

    return function


sqrt, fabs, fmax, _atan2, if_else, logic_and, logic_or, logic_not = map(
    _of_casadi, ("sqrt", "fabs", "fmax", "atan2", "if_else", "logic_and", "logic_or", "logic_not")
)


def clamp(x: SX, low: SX, high: SX) -> SX:
    """Return x limited to [low, high]."""
    return if_else(x > high, high, fmax(x, low))


def positive_part(x: SX) -> SX:
    """Return max(x, 0)."""
    return if_else(x > 0, x, 0.0)


def sign(x: SX) -> SX:
    """Return -1 where x is below 0, else 1."""
    return if_else(x < 0, -1.0, 1.0)


def hypot(a: SX, b: SX) -> SX:
    """Return the length of a vector of two entries."""
    return sqrt(a * a + b * b)


def rotate(R: SX, vector: tuple[SX, SX, SX]) -> tuple[SX, SX, SX]:
    """Return a vector times a 3 x 3 matrix."""
    x, y, z = vector
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
    )


def weighted_sum(
    weights: tuple[SX, ...], vectors: tuple[tuple[SX, SX, SX], ...]
) -> tuple[SX, SX, SX]:
    """Return the sum of vectors times their weights."""
    x: SX = 0
    y: SX = 0
    z: SX = 0
    for weight, vector in zip(weights, vectors, strict=True):
        x = x + weight * vector[0]
        y = y + weight * vector[1]
        z = z + weight * vector[2]
    return x, y, z


def turned_about_z(vector: Vector3, angle: Pair, sense: float = 1.0) -> Vector3:
    """Return Rz(angle) vector, or Rz(-angle) vector for ``sense`` -1."""
    turn = about_z if sense > 0 else about_z_back
    return turn(*angle, vector)


def turned_about_x(vector: Vector3, angle: Pair, sense: float = 1.0) -> Vector3:
    """Return Rx(angle) vector, or Rx(-angle) vector for ``sense`` -1."""
    turn = about_x if sense > 0 else about_x_back
    return turn(*angle, vector)


def unit_pair(x: SX, y: SX, scale: SX = 1.0, otherwise: Pair = (1.0, 0.0)) -> Pair:
    """Return (x, y) over its length; ``otherwise`` where it is shorter than MIN_DIRECTION times ``scale``."""
    length = hypot(x, y)
    is_determined = length > MIN_DIRECTION * scale
    inverse = 1.0 / if_else(is_determined, length, 1.0)
    cosine = if_else(is_determined, x * inverse, otherwise[0])
    sine = if_else(is_determined, y * inverse, otherwise[1])
    return cosine, sine


def add_angles(a: Pair, b: Pair, sense: float | SX = 1.0) -> Pair:
    """Return the pair of angle a + b, or a - b for ``sense`` -1; b may be a vector of any length, which a rotates.

    The addition theorems: cos(a + b) = cos a cos b - sin a sin b, and sin(a + b) = sin a cos b + cos a sin b.
    """
    cos_a, sin_a = a
    cos_b = b[0]
    sin_b = sense * b[1]
    return cos_a * cos_b - sin_a * sin_b, sin_a * cos_b + cos_a * sin_b


def angle(pair: Pair) -> SX:
    """Return the angle of a pair in (-pi, pi]."""
    return _atan2(pair[1], pair[0])


def turn_by_pi(x: SX) -> SX:
    """Return an angle in (-pi, pi] plus or minus pi, in (-pi, pi]."""
    return if_else(x > 0, x - math.pi, x + math.pi)


def wrap_angle(x: SX) -> SX:
    """Return an angle of [-3 pi, 3 pi] reduced to (-pi, pi]."""
    x = if_else(x > math.pi, x - 2 * math.pi, x)
    return if_else(x <= -math.pi, x + 2 * math.pi, x)


def select_pair(condition: SX, a: Pair, b: Pair) -> Pair:
    """Return pair a where the condition holds, else b."""
    return if_else(condition, a[0], b[0]), if_else(condition, a[1], b[1])


@dataclass(frozen=True)
class TwoLink:
    """The two solutions of two links in a plane that reach a point."""

    first: tuple[Pair, Pair]
    """Direction of the first link, for the elbow on the left of the line to the point, and on the right."""
    between: tuple[Pair, Pair]
    """Angle from the first link to the second."""
    miss: SX
    """Distance of the point from the reachable ring, m; 0 up to rounding."""
    straight: SX
    """Whether the arm is stretched or folded."""
    clamped: SX
    """Whether the point lies beyond the boundary by rounding only."""


def two_link(x: SX, y: SX, L1: SX, L2: SX, scale: SX) -> TwoLink:
    """Solve L1 e^(i a) + L2 e^(i (a + b)) = x + i y for a and b.

    The squared absolute value gives b by the law of cosines, and the argument then gives a:

        R^2 = L1^2 + L2^2 + 2 L1 L2 cos b,    R = |x + i y|,
        a = arg(x + i y) - arg(L1 + L2 e^(i b)).

    Parameters
    ----------
    x, y
        The point, m.
    L1, L2
        Lengths, m, positive.
    scale
        Size of the numbers from which x and y were computed, m; rounding is a share of it.
    """
    R = hypot(x, y)
    reach = L1 + L2
    gap = fabs(L1 - L2)
    excess = fmax(R - reach, gap - R)
    beyond = excess > BOUNDARY_SHARE * scale

    # As products, so that nothing cancels near the folded (b = pi) and the stretched arm (b = 0):
    #   1 + cos b = (R^2 - (L1 - L2)^2) / (2 L1 L2),    1 - cos b = ((L1 + L2)^2 - R^2) / (2 L1 L2).
    one_plus_cos = (R - gap) * (R + gap) / (2 * L1 * L2)
    one_minus_cos = (reach - R) * (reach + R) / (2 * L1 * L2)
    near_folded = one_plus_cos < 1.0
    cos_b = if_else(near_folded, one_plus_cos - 1.0, 1.0 - one_minus_cos)

    # sin^2 b = (1 + cos b) (1 - cos b), negative where the point is out of reach.
    square = one_plus_cos * one_minus_cos
    c, s = unit_pair(cos_b, sqrt(positive_part(square)))

    # The two elbows are mirror images at the line to the point: b and -b, a = arg(x + i y) -+ arg(L1 + L2 e^(i b)).
    forward = unit_pair(x, y, scale)
    along = if_else(near_folded, L1 - L2 + L2 * one_plus_cos, L1 + L2 * c)
    inside = unit_pair(along, L2 * s, L1)
    return TwoLink(
        first=(add_angles(forward, inside), add_angles(forward, inside, -1.0)),
        between=((c, -s), (c, s)),
        miss=if_else(beyond, excess, 0.0),
        straight=s < SINGULAR,
        clamped=logic_and(square < 0, logic_not(beyond)),
    )
