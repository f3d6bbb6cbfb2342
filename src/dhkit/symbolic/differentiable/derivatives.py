"""Derivatives of inverse and forward dynamics with respect to the state, by composite bodies."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dhkit.symbolic.differentiable.composite_bodies import (
    composite_coriolis_matrix,
    composite_mass_matrix,
    composite_position_derivative,
)
from dhkit.symbolic.differentiable.forward_dynamics import (
    recursive_forward_dynamics,
    solve_for_acceleration,
)
from dhkit.symbolic.differentiable.inertial_table import InertialTable

if TYPE_CHECKING:
    import casadi


def recursive_inverse_dynamics_derivatives(
    table: InertialTable, q: casadi.SX, qd: casadi.SX, qdd: casadi.SX
) -> casadi.SX:
    """Return d tau/dq, d tau/dqd and d tau/dqdd below each other, 3 n x n, with drives and without friction.

    Since tau = M qdd + h + g with h_i = sum_jk Gamma_ijk qd_j qd_k and Gamma_ijk = Gamma_ikj, the last two are matrices
    that have programs of their own: d tau/dqd = 2 C with C_ij = sum_k Gamma_ijk qd_k, and d tau/dqdd = M.

    Parameters
    ----------
    table
        The arm's table in CasADi expressions.
    q
        Symbols of the joint values, n x 1.
    qd, qdd
        Symbols of the joint rates and accelerations, n x 1.

    Returns
    -------
    casadi.SX
        3 n x n: N m and N per unit of q, qd and qdd.

    Examples
    --------
    >>> from dhkit import Arm
    >>> from dhkit.symbolic import InertialTable, joint_symbols
    >>> table = InertialTable.of(Arm.load("planar2r"))
    >>> states = [joint_symbols(name, 2) for name in ("q", "qd", "qdd")]
    >>> recursive_inverse_dynamics_derivatives(table, *states).shape
    (6, 2)
    """
    import casadi

    by_position = composite_position_derivative(table, q, qd, qdd)
    by_rate = 2 * composite_coriolis_matrix(table, q, qd)
    return casadi.vertcat(by_position, by_rate, composite_mass_matrix(table, q))


def derivative_of_matrix(matrix: casadi.SX, q: casadi.SX) -> casadi.SX:
    """Return the derivatives of a matrix with respect to each joint value, below each other.

    Parameters
    ----------
    matrix
        r x c.
    q
        Symbols of the joint values, n x 1.

    Returns
    -------
    casadi.SX
        n r x c: d matrix / dq_1, then d matrix / dq_2 ...

    Examples
    --------
    >>> import casadi
    >>> q = casadi.SX.sym("q", 2)
    >>> derivative_of_matrix(casadi.horzcat(q[0] * q[1], q[1]), q).shape
    (2, 2)
    """
    import casadi

    slopes = casadi.jacobian(casadi.vec(matrix), q)
    blocks = [casadi.reshape(slopes[:, k], *matrix.shape) for k in range(q.numel())]
    return casadi.vertcat(*blocks)


def mass_matrix_derivative(table: InertialTable, q: casadi.SX) -> casadi.SX:
    """Return the derivatives of the mass matrix with respect to each joint value, below each other.

    Parameters
    ----------
    table
        The arm's table in CasADi expressions.
    q
        Symbols of the joint values, n x 1.

    Returns
    -------
    casadi.SX
        n n x n: dM/dq_1, then dM/dq_2 ..., per unit of q.

    Examples
    --------
    >>> from dhkit import Arm
    >>> from dhkit.symbolic import InertialTable, joint_symbols
    >>> table = InertialTable.of(Arm.load("planar2r"))
    >>> mass_matrix_derivative(table, joint_symbols("q", 2)).shape
    (4, 2)
    """
    return derivative_of_matrix(composite_mass_matrix(table, q), q)


def recursive_forward_dynamics_derivatives(
    table: InertialTable, q: casadi.SX, qd: casadi.SX, tau: casadi.SX
) -> casadi.SX:
    """Return d qdd/dq, d qdd/dqd and d qdd/dtau = M^-1 below each other, 3 n x n, with drives and without friction.

    Differentiating tau = ID(q, qd, qdd) at constant torques (Carpentier & Mansard, Analytical Derivatives of Rigid Body
    Dynamics Algorithms, 2018, eq. 15):

        M dqdd = -(d ID/dq) dq - (d ID/dqd) dqd + dtau.

    Parameters
    ----------
    table
        The arm's table in CasADi expressions.
    q
        Symbols of the joint values, n x 1.
    qd, tau
        Symbols of the joint rates and torques, n x 1.

    Returns
    -------
    casadi.SX
        3 n x n: rad/s^2 and m/s^2 per unit of q, qd and tau; NaN where M is singular.

    Examples
    --------
    >>> from dhkit import Arm
    >>> from dhkit.symbolic import InertialTable, joint_symbols
    >>> table = InertialTable.of(Arm.load("planar2r"))
    >>> states = [joint_symbols(name, 2) for name in ("q", "qd", "tau")]
    >>> recursive_forward_dynamics_derivatives(table, *states).shape
    (6, 2)
    """
    import casadi

    n = q.shape[0]
    qdd = casadi.SX.sym("qdd", n)
    by_position = composite_position_derivative(table, q, qd, qdd)
    at_qdd = casadi.substitute(by_position, qdd, recursive_forward_dynamics(table, q, qd, tau))
    by_rate = 2 * composite_coriolis_matrix(table, q, qd)

    # The factors of M occur in every column; a program computes equal operations once.
    M = composite_mass_matrix(table, q)
    right_sides = casadi.horzcat(-at_qdd, -by_rate, casadi.SX.eye(n))
    columns = [solve_for_acceleration(M, right_sides[:, k]) for k in range(3 * n)]
    blocks = [casadi.horzcat(*columns[k * n : (k + 1) * n]) for k in range(3)]
    return casadi.vertcat(*blocks)
