"""Elementary functions of vectors without branches and calls: their operations are part of a kernel's body.

Polynomials have the coefficients of fdlibm (Sun Microsystems, 1993; its s_sin.c, k_cos.c and s_atan.c), computed by
Remez exchange; they are numbers, the code is ours.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan
from typing import Any, TypeAlias

from dhkit.kernels.vectors import Vector, absolute, select

Select: TypeAlias = Callable[[Any, Any, Any], Any]
Absolute: TypeAlias = Callable[[Any], Any]

EXACT_RANGE = 1e6
"""Largest angle, rad, of sine and cosine; beyond it, where a double has few digits of an angle, they are NaN."""

_ROUND_TO_INTEGER = 6755399441055744.0
"""1.5 x 2^52; adding and subtracting it rounds a double to the nearest integer."""
_TWO_OVER_PI = 0.6366197723675814
# pi/2 in three parts. The first two have 33 bits, so that k times them is exact for k up to 2^20.
_HALF_PI_1 = 1.57079632673412561417
_HALF_PI_2 = 6.07710050630396597660e-11
_HALF_PI_3 = 2.02226624879595063154e-21

_QUARTER_PI = 0.78539816339744830962
_HALF_PI = 1.57079632679489661923
_PI = 3.14159265358979323846
_TAN_EIGHTH_PI = 0.41421356237309504880


def minimum(a: Vector, b: Vector) -> Vector:
    """Return the smaller of two numbers; b where one is NaN."""
    return select(a < b, a, b)


def maximum(a: Vector, b: Vector) -> Vector:
    """Return the greater of two numbers; b where one is NaN."""
    return select(a > b, a, b)


def sincos(x: Vector) -> tuple[Vector, Vector]:
    """Return sine and cosine by one reduction to [-pi/4, pi/4] (Cody & Waite, 1980, in three parts).

    The absolute error is at most 2.3e-16 up to ``EXACT_RANGE``, and 2 units in the last place of results above 1e-5;
    beyond it, and of what is not finite, they are NaN.
    """
    # x = k pi/2 + r + tail with the integer k nearest to x / (pi/2) and pi/2 = P_1 + P_2 + P_3:
    #     r = x - k P_1 - k P_2, rounded,    tail = its rounding error - k P_3.
    # Without the tail the result would lose half a unit in the last place.
    k = (x * _TWO_OVER_PI + _ROUND_TO_INTEGER) - _ROUND_TO_INTEGER
    t = x - k * _HALF_PI_1
    second = k * _HALF_PI_2
    r = select(absolute(x) <= EXACT_RANGE, t - second, nan)
    tail = ((t - r) - second) - k * _HALF_PI_3

    # sin(r + tail) = sin(r) + tail cos(r) to first order, with sin(r) = r + r z p(z), z = r^2, and cos(r) = 1 - z / 2.
    z = r * r
    half = 0.5 * z
    p = z * 1.58969099521155010221e-10 - 2.50507602534068634195e-08
    p = p * z + 2.75573137070700676789e-06
    p = p * z - 1.98412698298579493134e-04
    p = p * z + 8.33333333332248946124e-03
    p = p * z - 1.66666666666666324348e-01
    sine = r + (r * (z * p) + tail * (1.0 - half))

    # cos(r + tail) = cos(r) - tail sin(r) to first order, with cos(r) = 1 - z / 2 + z^2 p(z) and sin(r) = r. The
    # rounding error of 1 - z / 2 is (1 - near_one) - half, and is added again.
    p = z * -1.13596475577881948265e-11 + 2.08757232129817482790e-09
    p = p * z - 2.75573143513906633035e-07
    p = p * z + 2.48015872894767294178e-05
    p = p * z - 1.38888888888741095749e-03
    p = p * z + 4.16666666666666019037e-02
    near_one = 1.0 - half
    cosine = near_one + ((((1.0 - near_one) - half) + (z * z) * p) - r * tail)

    # For k = 0, 1, 2, 3 modulo 4, with s = sin(r + tail) and c = cos(r + tail),
    #     sin(x) = s, c, -s, -c,    cos(x) = c, -s, -c, s;
    # k/4 minus its nearest integer is 0, 1/4, ±1/2, -1/4.
    quarter = k * 0.25
    quadrant = quarter - ((quarter + _ROUND_TO_INTEGER) - _ROUND_TO_INTEGER)
    opposite = absolute(quadrant) > 0.375
    odd = absolute(absolute(quadrant) - 0.25) < 0.125
    s = select(odd, cosine, sine)
    c = select(odd, sine, cosine)
    return select(opposite | (quadrant < -0.125), -s, s), select(
        opposite | (quadrant > 0.125), -c, c
    )


def atan2(y: Any, x: Any, select: Select = select, absolute: Absolute = absolute) -> Any:
    """Return the angle of (x, y) in (-pi, pi], to 4 units in the last place; 0 of (0, 0), NaN of NaN.

    The values are vectors, or objects with the same operators and their own ``select`` and ``absolute``.
    """
    width = absolute(x)
    height = absolute(y)
    steep = height > width
    longer = select(steep, height, width)
    shorter = select(steep, width, height)

    # atan(a) = pi/4 + atan((a - 1) / (a + 1)), taken for a > tan(pi/8): the polynomial's argument is at most tan(pi/8).
    wide = shorter > _TAN_EIGHTH_PI * longer
    numerator = select(wide, shorter - longer, shorter)
    denominator = select(wide, shorter + longer, longer)
    t = select(denominator > 0.0, numerator / denominator, 0.0)

    # atan(t) = t - t z p(z) with z = t^2.
    z = t * t
    p = z * 1.62858201153657823623e-02 - 3.65315727442169155270e-02
    p = p * z + 4.97687799461593236017e-02
    p = p * z - 5.83357013379057348645e-02
    p = p * z + 6.66107313738753120669e-02
    p = p * z - 7.69187620504482999495e-02
    p = p * z + 9.09088713343650656196e-02
    p = p * z - 1.11111104054623557880e-01
    p = p * z + 1.42857142725034663711e-01
    p = p * z - 1.99999999998764832476e-01
    p = p * z + 3.33333333333329318027e-01
    angle = t - t * (z * p)
    angle = select(wide, _QUARTER_PI + angle, angle)

    # From the first octant to the quadrant, atan(h / w) = pi/2 - atan(w / h), then by mirroring in both axes.
    angle = select(steep, _HALF_PI - angle, angle)
    angle = select(x < 0.0, _PI - angle, angle)
    angle = select(y < 0.0, -angle, angle)
    # The comparison is false if y or x is NaN.
    return select(absolute(x) + absolute(y) <= inf, angle, nan)
