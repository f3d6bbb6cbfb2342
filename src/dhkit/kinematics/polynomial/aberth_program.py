"""One step of Aberth's method for all roots of a trigonometric polynomial, as a program without branches."""

from __future__ import annotations

from functools import reduce
from typing import Any, TypeAlias

import casadi as ca

from dhkit.kinematics.polynomial.extension import Extension, Root
from dhkit.symbolic import Graph

SX: TypeAlias = Any
"""A CasADi SX scalar."""

_ROUNDING = 4e-15
"""A value below this share of the sum of the terms' absolute values is rounding: its estimate is a root."""


def aberth_program(degree: int) -> Graph:
    """Return the program: coefficients and estimates of the 2 ``degree`` roots to better ones, and the largest step.

    The coefficients are c_0, then the real and then the imaginary parts of c_1 to c_degree. Each estimate moves by

        -p / (p' - p sum_j 1 / (z - z_j)),

    which is Newton's step for p over the product of all other z - z_j (Aberth 1973, Math. Comp. 27). Steps are counted
    as shares of |z|, and as 0 where p is 0 up to rounding, as it is in a whole neighbourhood of a double root.
    """
    numbers = ca.SX.sym("numbers", 2 * degree + 1)
    z = ca.SX.sym("z", 4 * degree)
    imaginary_unit = Root(-1.0)

    def complex_number(x: SX, y: SX) -> Extension:
        return Extension(x, y, imaginary_unit)

    # The coefficients from that of z^(2 degree) down to that of z^0: c_degree, ..., c_0, ..., conj(c_degree).
    upper = [complex_number(numbers[k], numbers[degree + k]) for k in range(degree, 0, -1)]
    middle = complex_number(numbers[0], 0.0)
    lower = [complex_number(c.x, -c.y) for c in reversed(upper)]
    polynomial = [*upper, middle, *lower]

    count = 2 * degree
    roots = [complex_number(z[k], z[count + k]) for k in range(count)]
    sums = [complex_number(0.0, 0.0) for _ in roots]
    for i in range(count):
        for j in range(i):
            one_over = (roots[i] - roots[j]).inverse
            sums[i] = sums[i] + one_over
            sums[j] = sums[j] - one_over

    sizes = [ca.sqrt(c.x * c.x + c.y * c.y) for c in polynomial]
    moved = []
    steps = []
    for root, repulsion in zip(roots, sums, strict=True):
        p, slope = _horner(polynomial, root)
        step = p * (slope - p * repulsion).inverse
        length = ca.sqrt(step.x * step.x + step.y * step.y)
        is_finite = length < 1e300
        step = complex_number(
            ca.if_else(is_finite, step.x, 0.0), ca.if_else(is_finite, step.y, 0.0)
        )
        moved.append(root - step)

        radius = ca.sqrt(root.x * root.x + root.y * root.y)
        largest = reduce(lambda value, size: value * radius + size, sizes)
        is_root = ca.fabs(p.x) + ca.fabs(p.y) < _ROUNDING * largest
        steps.append(ca.if_else(is_root, 0.0, length / radius))

    return Graph.of(
        "aberth",
        {"parameters": ca.SX.sym("none"), "numbers": numbers, "z": z},
        {
            "z": ca.vertcat(*(root.x for root in moved), *(root.y for root in moved)),
            "step": reduce(ca.fmax, steps),
        },
    )


def _horner(polynomial: list[Extension], x: Extension) -> tuple[Extension, Extension]:
    """Return the value of a polynomial, highest coefficient first, and that of its derivative."""
    value = polynomial[0]
    slope = value * 0.0
    for coefficient in polynomial[1:]:
        slope = slope * x + value
        value = value * x + coefficient
    return value, slope
