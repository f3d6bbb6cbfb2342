"""Vectors of three floats, exact fractions or CasADi expressions.

They are plain tuples, not CasADi matrices, so that entries 0 and 1 stay Python's numbers. CasADi drops products with 0
and 1 as well; comparing Python's numbers here takes a hundredth of the time.
"""

from __future__ import annotations

from typing import Any, TypeAlias

Scalar: TypeAlias = Any
"""A float, a Fraction, or an expression (1 x 1)."""
Vector3: TypeAlias = tuple[Scalar, Scalar, Scalar]

_NUMBER = (float, int)
"""Types of numbers that are compared with 0 and 1; a Fraction is multiplied and added as it is."""
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
    """Return Rz(angle) a, with c = cos(angle) and s = sin(angle)."""
    return (*_rotate(c, s, a[0], a[1]), a[2])


def about_z_back(c: Scalar, s: Scalar, a: Vector3) -> Vector3:
    """Return Rz(angle)^T a."""
    y, x = _rotate(c, s, a[1], a[0])  # with x and y exchanged, a rotation by the opposite angle
    return x, y, a[2]


def about_x(c: Scalar, s: Scalar, a: Vector3) -> Vector3:
    """Return Rx(angle) a."""
    return (a[0], *_rotate(c, s, a[1], a[2]))


def about_x_back(c: Scalar, s: Scalar, a: Vector3) -> Vector3:
    """Return Rx(angle)^T a."""
    z, y = _rotate(c, s, a[2], a[1])
    return a[0], y, z


def _rotate(c: Scalar, s: Scalar, x: Scalar, y: Scalar) -> tuple[Scalar, Scalar]:
    """Return (c x - s y, s x + c y)."""
    return _difference(_product(c, x), _product(s, y)), _sum(_product(s, x), _product(c, y))


def _product(a: Scalar, b: Scalar) -> Scalar:
    """Return a b without products with 1; 0 where a factor is the number 0, whatever the other is."""
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
    """Return whether a scalar is the number 0, float or int, not a symbol."""
    return isinstance(x, _NUMBER) and x == 0
