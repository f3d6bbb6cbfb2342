"""Gaussian elimination with partial pivoting in symbols, for programs whose items choose different pivots."""

from __future__ import annotations

from typing import Any, TypeAlias

import casadi as ca

from dhkit.kinematics.closed_form.formulas import SINGULAR

_SX: TypeAlias = Any
"""A CasADi SX scalar or matrix."""
_TINY = 1e-300
"""Pivot instead of 0."""


def eliminated(
    matrix: list[list[_SX]], right: list[_SX] | None = None
) -> tuple[list[list[_SX]], list[_SX], _SX]:
    """Return a matrix and a right side after Gaussian elimination with partial pivoting, and the sign of the exchanges.

    Without a right side, the matrix's last column is returned in its place.
    """
    A = [list(row) for row in matrix]
    if right is not None:
        A = [[*row, x] for row, x in zip(A, right, strict=True)]
    size = len(matrix)
    sign = ca.SX(1.0)
    for k in range(size):
        for row in range(k + 1, size):
            is_larger = ca.fabs(A[row][k]) > ca.fabs(A[k][k])
            sign = ca.if_else(is_larger, -sign, sign)
            for column in range(k, len(A[k])):
                upper = A[k][column]
                lower = A[row][column]
                A[k][column] = ca.if_else(is_larger, lower, upper)
                A[row][column] = ca.if_else(is_larger, upper, lower)
        over = 1.0 / not_zero(A[k][k])
        for row in range(k + 1, size):
            factor = A[row][k] * over
            for column in range(k + 1, len(A[k])):
                A[row][column] = A[row][column] - factor * A[k][column]
    return A, [row[-1] for row in A], sign


def not_zero(x: _SX) -> _SX:
    """Return a pivot, or a number that is hardly larger than 0."""
    return ca.if_else(x == 0.0, _TINY, x)


def back_substituted(A: list[list[_SX]], right: list[_SX]) -> list[_SX]:
    """Return x with A x = right, of a matrix and a right side as :func:`eliminated` returns them."""
    size = len(right)
    x: list[_SX] = [ca.SX(0.0)] * size
    for k in reversed(range(size)):
        rest = right[k] - sum((A[k][m] * x[m] for m in range(k + 1, size)), ca.SX(0.0))
        x[k] = rest / not_zero(A[k][k])
    return x


def newton_step(J: _SX, twist: _SX) -> tuple[_SX, _SX]:
    """Return the step of Newton's method, 6 x 1, rad, and whether the Jacobian has no small singular value.

    ``J`` and ``twist`` have lengths as shares of the reach. The product of the five larger singular values is at most
    (|J|^2 / 5)^(5/2), with the squares' sum |J|^2; with the determinant it bounds the least one.
    """
    A, right, _ = eliminated([ca.horzsplit(row) for row in ca.vertsplit(J)], ca.vertsplit(twist))
    step = back_substituted(A, right)
    determinant = ca.SX(1.0)
    for k in reversed(range(6)):
        determinant = determinant * A[k][k]
    mean = ca.sumsqr(J) / 5.0
    return ca.vertcat(*step), ca.fabs(determinant) > SINGULAR * mean * mean * ca.sqrt(mean)
