"""Vectors of three floats, exact fractions or CasADi expressions.

They are plain tuples, not CasADi matrices, so that a product with an exact 0 or 1 never becomes an expression.
"""

from __future__ import annotations

from typing import Any, TypeAlias

Scalar: TypeAlias = Any
"""A float, a Fraction, or an expression (1 x 1)."""
Vector3: TypeAlias = tuple[Scalar, Scalar, Scalar]

_NUMBER = (float, int)
"""Types of the numbers that products and sums look at; exact fractions are multiplied and added as they are."""
ZERO_VECTOR: Vector3 = (0.0, 0.0, 0.0)


def plus(a: Vector3, b: Vector3) -> Vector3:
    """Return a + b."""
    return _sum(a[0], b[0]), _sum(a[1], b[1]), _sum(a[2], b[2])


def times(k: Scalar, a: Vector3) -> Vector3:
    """Return k a."""
    return _product(k, a[0]), _product(k, a[1]), _product(k, a[2])


def dot(a: Vector3, b: Vector3) -> Scalar:
    """Return a . b."""
    return _sum(_sum(_product(a[0], b[0]), _product(a[1], b[1])), _product(a[2], b[2]))


def cross(a: Vector3, b: Vector3) -> Vector3:
    """Return a x b."""
    return (
        _difference(_product(a[1], b[2]), _product(a[2], b[1])),
        _difference(_product(a[2], b[0]), _product(a[0], b[2])),
        _difference(_product(a[0], b[1]), _product(a[1], b[0])),
    )


def about_z(c: Scalar, s: Scalar, a: Vector3) -> Vector3:
    """Return Rz a, for the angle's cosine and sine."""
    return (*_rotate(c, s, a[0], a[1]), a[2])


def about_z_back(c: Scalar, s: Scalar, a: Vector3) -> Vector3:
    """Return Rz^T a."""
    y, x = _rotate(c, s, a[1], a[0])
    return x, y, a[2]


def about_x(c: Scalar, s: Scalar, a: Vector3) -> Vector3:
    """Return Rx a."""
    return (a[0], *_rotate(c, s, a[1], a[2]))


def about_x_back(c: Scalar, s: Scalar, a: Vector3) -> Vector3:
    """Return Rx^T a."""
    z, y = _rotate(c, s, a[2], a[1])
    return a[0], y, z


def _rotate(c: Scalar, s: Scalar, x: Scalar, y: Scalar) -> tuple[Scalar, Scalar]:
    """Return (c x - s y, s x + c y)."""
    return _difference(_product(c, x), _product(s, y)), _sum(_product(s, x), _product(c, y))


# CasADi drops products with 0 and 1 as well; asking it takes a hundred times as long as these comparisons.


def _product(a: Scalar, b: Scalar) -> Scalar:
    """Return a b, where 0 and 1 are left out."""
    for x, y in ((a, b), (b, a)):
        if isinstance(x, _NUMBER):
            if x == 0:
                return x
            if x == 1:
                return y
    return a * b


def _sum(a: Scalar, b: Scalar) -> Scalar:
    """Return a + b, where 0 is left out."""
    if isinstance(a, _NUMBER) and a == 0:
        return b
    if isinstance(b, _NUMBER) and b == 0:
        return a
    return a + b


def _difference(a: Scalar, b: Scalar) -> Scalar:
    """Return a - b, where 0 is left out."""
    if isinstance(b, _NUMBER) and b == 0:
        return a
    if isinstance(a, _NUMBER) and a == 0:
        return -b
    return a - b


def is_zero(x: Scalar) -> bool:
    """Return whether a scalar is the number 0, not a symbol."""
    return isinstance(x, float) and x == 0.0
