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
"""M counts as singular when a pivot is below this share of its largest diagonal entry: rounding leaves as much."""


def solve_for_acceleration(M: casadi.SX, torque: casadi.SX) -> casadi.SX:
    """Return qdd of M qdd = torque, n x 1, SI units, by factors L^T D L (Featherstone 2008, section 6.5, full matrix).

    D_i is the inertia that joint i feels while the joints behind it swing freely; where one is not above ``SINGULAR``
    times the largest M_ii all entries are NaN. Only the upper triangle of M is read.
    """
    import casadi

    n = M.shape[0]
    least = SINGULAR * reduce(casadi.fmax, [M[k, k] for k in range(n)])
    pivots = [casadi.SX(0)] * n
    regular = casadi.SX(1)
    A = [[M[min(i, j), max(i, j)] for j in range(n)] for i in range(n)]
    b = [torque[i] for i in range(n)]
    factors = [[casadi.SX(0)] * n for _ in range(n)]
    for k in reversed(range(n)):
        regular = casadi.logic_and(regular, A[k][k] > least)
        pivots[k] = 1 / A[k][k]
        for i in range(k):
            factors[k][i] = A[k][i] * pivots[k]
            for j in range(i + 1):
                A[i][j] = A[i][j] - factors[k][i] * A[k][j]
            b[i] = b[i] - factors[k][i] * b[k]
    x: list[casadi.SX] = []
    for k in range(n):
        x.append(b[k] * pivots[k] - sum((factors[k][i] * x[i] for i in range(k)), casadi.SX(0)))
    # A sum with NaN is NaN, and one choice serves all entries.
    poison = casadi.if_else(regular, 0.0, casadi.SX.nan())
    return casadi.vertcat(*x) + poison


def recursive_forward_dynamics(table: InertialTable, q: casadi.SX, qd: casadi.SX, tau: casadi.SX) -> casadi.SX:
    """Return the joint accelerations qdd of M qdd = tau - C qd - g, n x 1, rad/s^2 and m/s^2."""
    return solve_for_acceleration(composite_mass_matrix(table, q), tau - recursive_bias(table, q, qd))
