"""Forward dynamics: M qdd = tau - C qd - g solved without a branch, from the last joint to the first."""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING

from dhkit.symbolic.differentiable.composite_bodies import composite_mass_matrix
from dhkit.symbolic.differentiable.inertial_table import InertialTable
from dhkit.symbolic.differentiable.recursive import recursive_bias

if TYPE_CHECKING:
    import casadi

SINGULAR = 1e-14
"""Smallest pivot of a regular M, relative to the largest entry of its diagonal: rounding leaves as much of a zero."""


def solve_for_acceleration(M: casadi.SX, torque: casadi.SX) -> casadi.SX:
    """Return qdd of M qdd = torque, n x 1, SI units, by factors L^T D L (Featherstone 2008, section 6.5, full matrix).

    D_i is the inertia that joint i feels while the joints after it swing freely; where one is not above ``SINGULAR``
    times the largest M_ii all entries are NaN. Only the upper triangle of M is read.

    Parameters
    ----------
    M
        Mass matrix, n x n.
    torque
        Torques less C qd + g, n x 1.

    Returns
    -------
    casadi.SX
        n x 1; all entries NaN where M is singular.

    Examples
    --------
    >>> import casadi
    >>> M, b = casadi.SX.sym("M", 2, 2), casadi.SX.sym("b", 2)
    >>> f = casadi.Function("f", [M, b], [solve_for_acceleration(M, b)])
    >>> f(casadi.DM([[2, 0], [0, 4]]), casadi.DM([2, 2]))
    DM([1, 0.5])
    """
    import casadi

    n = M.shape[0]
    smallest_pivot = SINGULAR * reduce(casadi.fmax, [M[k, k] for k in range(n)])

    # Symmetric: row i of A from the upper triangle of M.
    A = []
    for i in range(n):
        row = [M[min(i, j), max(i, j)] for j in range(n)]
        A.append(row)
    b = [torque[i] for i in range(n)]

    # Elimination from the last joint to the first. When row k is reached, A_kk = D_k. With L_ki = A_ki / D_k:
    #   A_ij <- A_ij - L_ki A_kj,   b_i <- b_i - L_ki b_k   for j <= i < k
    is_regular = casadi.SX(1)
    D_inverse = [casadi.SX(0)] * n
    L = [[casadi.SX(0)] * n for _ in range(n)]
    for k in reversed(range(n)):
        is_regular = casadi.logic_and(is_regular, A[k][k] > smallest_pivot)
        D_inverse[k] = 1 / A[k][k]
        for i in range(k):
            L[k][i] = A[k][i] * D_inverse[k]
            for j in range(i + 1):
                A[i][j] = A[i][j] - L[k][i] * A[k][j]
            b[i] = b[i] - L[k][i] * b[k]

    # Substitution from the first joint to the last: x_k = b_k / D_k - sum over i < k of L_ki x_i
    x: list[casadi.SX] = []
    for k in range(n):
        known = sum((L[k][i] * x[i] for i in range(k)), casadi.SX(0))
        x.append(b[k] * D_inverse[k] - known)

    # A sum with NaN is NaN, and one choice serves all entries.
    zero_or_nan = casadi.if_else(is_regular, 0.0, casadi.SX.nan())
    return casadi.vertcat(*x) + zero_or_nan


def recursive_forward_dynamics(
    table: InertialTable, q: casadi.SX, qd: casadi.SX, tau: casadi.SX
) -> casadi.SX:
    """Return the joint accelerations qdd of M qdd = tau - C qd - g, n x 1, rad/s^2 and m/s^2.

    Parameters
    ----------
    table
        The arm's table in CasADi expressions.
    q
        Joint values, n x 1.
    qd, tau
        Joint rates and torques, n x 1.

    Returns
    -------
    casadi.SX
        n x 1, rad/s^2 and m/s^2; NaN where M is singular.

    Examples
    --------
    >>> import casadi
    >>> from dhkit import Arm
    >>> from dhkit.symbolic import InertialTable, joint_symbols
    >>> table = InertialTable.of(Arm.load("planar2r"))
    >>> q, qd = (joint_symbols(name, 2) for name in ("q", "qd"))
    >>> tau = joint_symbols("tau", 2)
    >>> qdd = recursive_forward_dynamics(table, q, qd, tau)
    >>> casadi.Function("qdd", [q, qd, tau], [qdd])([0, 0], [0, 0], [0, 0])
    DM([-25.8984, 37.6704])
    """
    return solve_for_acceleration(
        composite_mass_matrix(table, q), tau - recursive_bias(table, q, qd)
    )
