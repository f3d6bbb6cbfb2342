"""Trigonometric polynomials and their roots in symbols: coefficients, values, which roots are real."""

from __future__ import annotations

import math
from functools import reduce
from typing import Any, TypeAlias

import casadi as ca

from dhkit.kinematics.polynomial.extension import Extension, Root

SX: TypeAlias = Any
"""A CasADi SX scalar or vector."""

BEYOND = 4.0
"""Stands for the angle of a root that is not nearly real, rad: no angle is beyond pi."""
_IMAGINARY_UNIT = Root(-1.0)
ROUNDING = 4e-15
"""A value below this share of the sum of the terms' absolute values is rounding: its estimate is a root."""
_NEARLY_REAL = 3e-2
"""Largest imaginary part, rad, of a root that is tried: rounding of 1e-15 in the coefficients moves a root of
multiplicity k by its k-th root, 0.013 for k = 8. Whether a solution is there is decided by what follows."""
ERROR_OF_VALUE = 1e-11
"""Assumed error of a polynomial near a root, relative to its largest coefficient. The error itself is some 1e-14; the
four roots of a pose at two singularities, which it moves by 1e-3, are held to be real with this margin only."""
_UNKNOWN = 100.0
"""Factor of the coefficients' error: where |f| is smaller, real and complex roots are not told apart. Of published arms
with offset wrists hardly any pose has such a complex root, of arms whose wrists are almost spherical most have."""
_MARGIN = 1e4
"""Factor of the assumed error of the value, ``ERROR_OF_VALUE`` or that of the coefficients if it is larger, below which
a root is tried."""
_PARTS = 4
"""Number of polynomials in x^4 that make one in x."""
NEAR_ROOTS = 1e-3
"""Distance of two roots, rad, below which a solution may be singular."""


def coefficients(values: SX, degree: int) -> tuple[SX, SX]:
    """Return the coefficients of f = sum c_k z^k for k from -degree to degree, and their error.

    They are c_0, the real and then the imaginary parts of c_1 to c_degree, and the largest of absolute value is 1. The
    error is the largest of those that follow, which are 0 but for rounding.
    """
    samples = values.shape[0]
    real = []
    imaginary = []
    for k in range(samples // 2 + 1):
        # c_k = 1/N sum_j f_j e^(-2 pi i j k / N).
        angles = [-math.tau * (j * k % samples) / samples for j in range(samples)]
        real.append(ca.dot(ca.DM([math.cos(angle) for angle in angles]), values) / samples)
        imaginary.append(ca.dot(ca.DM([math.sin(angle) for angle in angles]), values) / samples)

    sizes = [ca.sqrt(x * x + y * y) for x, y in zip(real, imaginary, strict=True)]
    largest = reduce(ca.fmax, sizes[: degree + 1])
    beyond = reduce(ca.fmax, sizes[degree + 1 :])
    factor = 1.0 / ca.if_else(largest > 0, largest, 1.0)
    numbers = ca.vertcat(*real[: degree + 1], *imaginary[1 : degree + 1]) * factor
    return numbers, ca.if_else(largest > 0, beyond * factor, math.inf)


def nearly_real(polynomial: list[Extension], root: Extension, error: SX) -> tuple[SX, SX, SX]:
    """Return angle, height and whether it is real of a root, of z = e^(i (angle + i height)).

    The angle is ``BEYOND`` for a root whose height is beyond ``_NEARLY_REAL``, or which is not real even if the error
    of f is ``_MARGIN`` times the assumed one. A root is real if f at the real angle is 0 up to its error, or hardly
    larger than the coefficients' error, so that real and complex roots are not told apart.

    Parameters
    ----------
    polynomial, root
        The polynomial, and its root.
    error
        Error of the coefficients.
    """
    tolerance = ca.fmax(ERROR_OF_VALUE, error)
    square = root.norm
    # ln(square) / 2 of a square near 1, up to its cube.
    height = ca.fabs((square - 1.0) / (square + 1.0))
    # Between the two roots of a pair f = f'' (x^2 + height^2) / 2: that is height f' / 2, as f' is at the roots.
    least = ca.fabs(_at_real_angle(polynomial, root))
    value = 2.0 * least
    is_tried = ca.logic_and(height < _NEARLY_REAL, value < _MARGIN * tolerance)
    angle = ca.if_else(is_tried, ca.atan2(root.y, root.x), BEYOND)
    # Where |f| is that small over a whole interval, the roots in it may be anywhere.
    is_unknown = least < _UNKNOWN * ca.fmax(error, ROUNDING)
    return angle, height, ca.if_else(ca.logic_or(value < tolerance, is_unknown), 1.0, 0.0)


def _at_real_angle(polynomial: list[Extension], root: Extension) -> SX:
    """Return f = c_0 + 2 Re(c_1 w + c_2 w^2 + ...) at w = z / |z|."""
    degree = len(polynomial) // 2
    over_radius = 1.0 / ca.sqrt(root.norm)
    w = complex_of(root.x * over_radius, root.y * over_radius)
    upper = polynomial[0]
    for coefficient in polynomial[1:degree]:
        upper = upper * w + coefficient
    return polynomial[degree].x + 2.0 * (upper * w).x


def square_of_distance(root: Extension, other: Extension) -> SX:
    """Return the square of the distance of two roots near the unit circle, rad."""
    # e^(i x) - e^(i y) is as long as x - y, through pi too, and heights count like angles.
    return (root - other).norm


def complex_of(x: SX, y: SX) -> Extension:
    """Return x + i y, whose ``norm`` is the square of its absolute value."""
    return Extension(x, y, _IMAGINARY_UNIT)


def polynomial_of(numbers: SX, degree: int) -> list[Extension]:
    """Return the coefficients from that of z^(2 degree) to that of z^0: c_degree, ..., c_0, ..., conj(c_degree)."""
    upper = [complex_of(numbers[k], numbers[degree + k]) for k in range(degree, 0, -1)]
    middle = complex_of(numbers[0], 0.0)
    lower = [complex_of(c.x, -c.y) for c in reversed(upper)]
    return [*upper, middle, *lower]


def value_and_slope(polynomial: list[Extension], x: Extension) -> tuple[Extension, Extension]:
    """Return the value of a polynomial, highest coefficient first, and that of its derivative.

    With w = x^4 and p(x) = p_0(w) + x p_1(w) + x^2 p_2(w) + x^3 p_3(w) the slope is

        p_1 + 2 x p_2 + 3 x^2 p_3 + 4 x^3 (p_0' + x p_1' + x^2 p_2' + x^3 p_3')

    with derivatives with respect to w. Chains of sums and products are half as long as Horner's for x, and the
    processor works on four at a time.
    """
    lowest = polynomial[::-1]
    square = x * x
    cube = square * x
    w = square * square
    both = [_horner(lowest[k::_PARTS][::-1], w) for k in range(_PARTS) if len(lowest) > k]
    value, inner = both[0]
    for (part, slope), power in zip(both[1:], [x, square, cube], strict=False):
        value = _product_and(value, part, power)
        inner = _product_and(inner, slope, power)
    _, outer, *parts = (value_of_part for value_of_part, _ in both)
    for k, (part, power) in enumerate(zip(parts, [x, square], strict=False), start=2):
        outer = _product_and(outer, part, power * float(k))
    return value, _product_and(outer, inner, cube * 4.0)


def _horner(polynomial: list[Extension], x: Extension) -> tuple[Extension, Extension]:
    """Return the value of a polynomial, highest coefficient first, and that of its derivative."""
    value = polynomial[0]
    slope = value * 0.0
    for coefficient in polynomial[1:]:
        slope = _product_and(value, slope, x)
        value = _product_and(coefficient, value, x)
    return value, slope


def _product_and(c: Extension, a: Extension, b: Extension) -> Extension:
    """Return c + a b, as two fused products and sums for each part."""
    return complex_of((c.x + a.x * b.x) - a.y * b.y, (c.y + a.x * b.y) + a.y * b.x)
