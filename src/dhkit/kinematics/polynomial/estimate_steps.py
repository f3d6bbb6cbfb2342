"""Steps of a pipeline to all roots of a trigonometric polynomial at the same time, a root in each lane of vectors.

An estimate z becomes

    z - N / (1 - N sum_j 1 / (z - u_j)),    N = p(z) / p'(z),

with the sum over the other estimates: Newton's step for p over the product of all z - u_j (Aberth 1973, Math. Comp.
27). They count as at u_j = z_j - N_j, where Newton's method would take them next: near simple roots errors then shrink
by their fourth powers instead of their cubes (Nourein 1977, An improvement on two iteration methods for simultaneous
determination of the zeros of a polynomial, Int. J. Comput. Math. 6).

Far from a root Newton's method leads anywhere. Where |N| is not below 0.05 |z|, u = z - N / s with s = 32, else s = 1.
So u differs from z, and the sum S over all estimates needs no exception: it has the own term s / N, and the step is

    N / (1 + s - N S).

Where N is 0 that is not finite, and the step is 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeAlias

import casadi as ca

from dhkit.kinematics.polynomial.extension import Extension
from dhkit.kinematics.polynomial.root_symbols import (
    ROUNDING,
    complex_of,
    polynomial_of,
    value_and_slope,
)
from dhkit.symbolic import Graph, PipelineStep

_SX: TypeAlias = Any
"""A CasADi SX scalar or matrix."""
_MOST_STEPS = 60
"""Largest number of steps; most polynomials take 5 to 10."""
_CONVERGED = 1e-7
"""Estimates at which Newton's steps are below this share of their absolute value are foreseen to rounding."""
_FIRST_RADII = (0.95, 1.05)
"""The first estimates are near the circle, but neither on it nor in pairs z, 1 / conj(z): steps keep both symmetries.
"""
_FIRST_ANGLE = 0.4
"""Angle of the first one, rad."""
_SHORT = 0.05
"""Share of |z| below which Newton's step counts in full, s = 1."""
_SHORTEST = 1e-4
"""Share of |z| up to which Newton's step counts even where the value is rounding. That moves roots of multiplicity four
farther, but simple ones with a small slope hardly."""
_DIVISOR = 32.0
"""The number s of longer steps."""
_OFF_CIRCLE = 0.01
"""Share of min(| |z|^2 - 1 |, 1) below which Newton's step shows that a root is not on the unit circle."""
_INFINITE = 1e300
"""Squares of absolute values above it count as infinite."""
_STATE = ("z_x", "z_y", "newton_x", "newton_y", "is_short")
"""What an estimate's next step follows from, besides the other estimates."""
_SUMS = 4
"""Number of sums that the processor computes at the same time."""
_TOGETHER = 8
"""Numbers whose reciprocals are computed together."""


@dataclass(frozen=True)
class PolynomialSource:
    """Where a pipeline has a trigonometric polynomial, and the estimates of its roots.

    The coefficients may be those of one lane of several: then they are every ``lanes``-th number.
    """

    degree: int
    numbers: str = "numbers"
    total: str = "total"
    """Outputs with the coefficients, and with the sum of their absolute values, see :func:`total_of`."""
    lane: int = 0
    lanes: int = 1
    x: str = "x"
    y: str = "y"
    """Outputs with the real and the imaginary part of each root."""

    @property
    def roots(self) -> int:
        """The number of roots."""
        return 2 * self.degree

    def symbol(self, name: str, size: int) -> tuple[_SX, _SX]:
        """Return the symbol of all numbers of an input, and those of this polynomial, as many as ``size``."""
        every = ca.SX.sym(name, size * self.lanes)
        return every, every[self.lane :: self.lanes]

    @property
    def coefficients(self) -> int:
        """The number of coefficients' real and imaginary parts."""
        return 2 * self.degree + 1

    def own(self, name: str) -> str:
        """Return the name of an output with the state of the iteration."""
        return f"{self.x}_{name}"


def total_of(numbers: _SX, degree: int) -> _SX:
    """Return the sum of the absolute values of a polynomial's coefficients, or somewhat more."""
    return sum(ca.fabs(c.x) + ca.fabs(c.y) for c in polynomial_of(numbers, degree))


def estimate_steps(parameters: _SX, source: PolynomialSource) -> tuple[PipelineStep, ...]:
    """Return the steps that find all roots of a polynomial.

    Parameters
    ----------
    parameters
        Symbols of the pipeline's parameters.
    source
        The polynomial.
    """
    return _first_estimates(parameters, source), _better_estimates(parameters, source)


@dataclass(frozen=True)
class _Estimate:
    """An estimate of a root, and Newton's step from there."""

    z: Extension
    newton: Extension
    is_short: _SX
    """Whether Newton's step is short, so that s = 1."""
    is_rounded: _SX
    """Whether the value is 0 up to rounding, as it is in a whole neighbourhood of a double root."""

    @classmethod
    def at(cls, z: Extension, polynomial: list[Extension], total: _SX) -> _Estimate:
        """Return an estimate.

        Parameters
        ----------
        z
            Where it is.
        polynomial, total
            Coefficients, highest first, and the sum of their absolute values.
        """
        p, slope = value_and_slope(polynomial, z)
        # Where the slope is 0, any direction leads away.
        newton = _finite(p * slope.inverse, z)
        square = z.norm
        is_short = newton.norm < _SHORT**2 * square
        # |p| <= total max(1, |z|)^(2 degree), and its rounding is a share of that.
        largest = total * _power(ca.fmax(1.0, square), len(polynomial) // 2)
        return cls(z, newton, is_short, ca.fabs(p.x) + ca.fabs(p.y) <= ROUNDING * largest)

    @property
    def foreseen(self) -> Extension:
        """The number u, which is the root once the iteration has ended.

        Where the value is rounding, so are all but the shortest of Newton's steps: the estimate stays.
        """
        is_longer = self.newton.norm > _SHORTEST**2 * self.z.norm
        share = ca.if_else(self.is_short, 1.0, 1.0 / _DIVISOR)
        stays = ca.logic_and(self.is_rounded, is_longer)
        u: Extension = self.z - self.newton * ca.if_else(stays, 0.0, share)
        return u

    def outputs(self, source: PolynomialSource) -> dict[str, _SX]:
        """Return the state of the iteration, as outputs of a step."""
        root = self.foreseen
        return {
            source.own("z_x"): self.z.x,
            source.own("z_y"): self.z.y,
            source.own("newton_x"): self.newton.x,
            source.own("newton_y"): self.newton.y,
            source.own("is_short"): ca.if_else(self.is_short, 1.0, 0.0),
            source.x: root.x,
            source.y: root.y,
        }


def _first_estimates(parameters: _SX, source: PolynomialSource) -> PipelineStep:
    """Return the step with the first estimates of the roots, alternately inside and outside the unit circle.

    They are the roots of (z^n - r^n a) (z^n + R^n a) with the degree n, the radii r and R and |a| = 1. Half the ratio
    of the second derivative to the first is the sum of 1 / (z - z_j), here

        ((n - 1) / 2 + n r^n / (r^n + R^n)) / z

    at the inner ones, and the same with R^n above at the outer ones. A step by Aberth's method follows.
    """
    n = source.degree
    symbols = _Symbols.of(parameters, source)
    index = ca.SX.sym("index")
    is_odd = index - 2.0 * ca.floor(index / 2.0) > 0.5
    radius = ca.if_else(is_odd, _FIRST_RADII[1], _FIRST_RADII[0])
    angle = _FIRST_ANGLE + index * (math.tau / source.roots)
    z = complex_of(radius * ca.cos(angle), radius * ca.sin(angle))
    total = sum(r**n for r in _FIRST_RADII)
    inner, outer = ((n - 1) / 2 + n * r**n / total for r in _FIRST_RADII)
    repulsion = z.inverse * ca.if_else(is_odd, outer, inner)

    one = complex_of(ca.SX(1.0), ca.SX(0.0))
    moved = symbols.estimate(z - _step(symbols.estimate(z).newton, repulsion, one))
    inputs = {**symbols.inputs, "index": index}
    graph = Graph.of("first_estimates", inputs, moved.outputs(source))
    return PipelineStep(graph, source.roots, each={"index": "index"}, shared=symbols.shared)


def _better_estimates(parameters: _SX, source: PolynomialSource) -> PipelineStep:
    """Return the step of all estimates, which is repeated until none moves."""
    symbols = _Symbols.of(parameters, source)
    own = {name: ca.SX.sym(name) for name in _STATE}
    xs = ca.SX.sym("xs", source.roots)
    ys = ca.SX.sym("ys", source.roots)
    z = complex_of(own["z_x"], own["z_y"])
    newton = complex_of(own["newton_x"], own["newton_y"])
    roots = zip(ca.vertsplit(xs), ca.vertsplit(ys), strict=True)
    repulsion = _repulsion([z - complex_of(x, y) for x, y in roots])
    one_and_s = complex_of(ca.if_else(own["is_short"] != 0.0, 2.0, 1.0 + _DIVISOR), ca.SX(0.0))
    moved = symbols.estimate(z - _step(newton, repulsion, one_and_s))

    # p' / p is the sum of the 2 n numbers 1 / (z - z_j), so that some root is within 2 n |N| of z, 16 |N| at most. With
    # the distance d to the circle, min(| |z|^2 - 1 |, 1) is at most 2.42 d: where |N| is below 0.01 of it, that root is
    # within 0.39 d. It need not be the one that this estimate goes to.
    square = moved.newton.norm
    beyond = moved.z.norm - 1.0
    may_be_real = square >= _OFF_CIRCLE**2 * ca.fmin(beyond * beyond, 1.0)
    # False for NaN.
    moves = ca.logic_and(may_be_real, square >= _CONVERGED**2 * moved.z.norm)
    moves = ca.logic_and(moves, ca.logic_not(moved.is_rounded))
    inputs = {**symbols.inputs, **own, "xs": xs, "ys": ys}
    outputs = {**moved.outputs(source), "goes_on": ca.if_else(moves, 1.0, 0.0)}
    return PipelineStep(
        Graph.of("better_estimates", inputs, outputs),
        source.roots,
        each={name: source.own(name) for name in _STATE},
        shared={**symbols.shared, "xs": source.x, "ys": source.y},
        most=_MOST_STEPS,
    )


@dataclass(frozen=True)
class _Symbols:
    """The polynomial in symbols, as inputs of a step."""

    inputs: dict[str, _SX]
    shared: dict[str, str]
    polynomial: list[Extension]
    total: _SX

    @classmethod
    def of(cls, parameters: _SX, source: PolynomialSource) -> _Symbols:
        """Return new symbols."""
        every_number, numbers = source.symbol("numbers", source.coefficients)
        every_total, total = source.symbol("total", 1)
        return cls(
            {"parameters": parameters, "numbers": every_number, "total": every_total},
            {"numbers": source.numbers, "total": source.total},
            polynomial_of(numbers, source.degree),
            total,
        )

    def estimate(self, z: Extension) -> _Estimate:
        """Return an estimate of a root."""
        return _Estimate.at(z, self.polynomial, self.total)


def _step(newton: Extension, repulsion: Extension, constant: Extension) -> Extension:
    """Return N / (c - N S), the step to subtract, with a sum S and the number c that belongs to it; else 0."""
    return _finite(newton * (constant - newton * repulsion).inverse, _zero())


def _repulsion(apart: list[Extension]) -> Extension:
    """Return the sum of 1 / z over complex numbers z."""
    over_squares = _reciprocals([z.norm for z in apart])
    sums = [_zero()] * _SUMS
    for k, (z, over) in enumerate(zip(apart, over_squares, strict=True)):
        # 1 / z = (x - i y) / |z|^2.
        sums[k % _SUMS] = sums[k % _SUMS] + complex_of(z.x * over, -z.y * over)
    return sum(sums[1:], sums[0])


def _reciprocals(numbers: list[_SX]) -> list[_SX]:
    """Return 1 / x of positive numbers, as the product of the others of eight over that of all eight.

    Quotients with one divisor become products with one reciprocal in kernels (``Pipeline.with_reciprocals``), for a
    division takes as long as some 16 products.
    """
    reciprocals: list[_SX] = []
    for begin in range(0, len(numbers), _TOGETHER):
        part = numbers[begin : begin + _TOGETHER]
        others, product = _products_of_others(part)
        reciprocals += [other / product for other in others]
    return reciprocals


def _products_of_others(numbers: list[_SX]) -> tuple[list[_SX], _SX]:
    """Return the product of all other numbers for each one, and that of all."""
    if len(numbers) == 1:
        return [ca.SX(1.0)], numbers[0]
    half = len(numbers) // 2
    lower, lower_product = _products_of_others(numbers[:half])
    upper, upper_product = _products_of_others(numbers[half:])
    others = [x * upper_product for x in lower] + [x * lower_product for x in upper]
    return others, lower_product * upper_product


def _zero() -> Extension:
    """Return 0."""
    return complex_of(ca.SX(0.0), ca.SX(0.0))


def _finite(z: Extension, otherwise: Extension) -> Extension:
    """Return a number z, or another one where it is none or infinite."""
    is_finite = z.norm < _INFINITE
    x = ca.if_else(is_finite, z.x, otherwise.x)
    return complex_of(x, ca.if_else(is_finite, z.y, otherwise.y))


def _power(x: _SX, exponent: int) -> _SX:
    """Return x to a positive whole power, by repeated squares."""
    if exponent == 1:
        return x
    half = _power(x, exponent // 2)
    return half * half * x if exponent % 2 else half * half
