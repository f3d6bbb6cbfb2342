"""Kinetic and potential energy, and Lagrange's equations by differentiating them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dhkit.symbolic.differentiable.equation_frames import equation_frames, link_velocities
from dhkit.symbolic.differentiable.inertial_table import InertialTable
from dhkit.symbolic.differentiable.vectors import Scalar, Vector3, cross, dot

if TYPE_CHECKING:
    import casadi


def kinetic_energy(table: InertialTable, q: casadi.SX, qd: casadi.SX) -> casadi.SX:
    """Return the kinetic energy of links and drives, 1 x 1, J, for q and qd (n x 1).

    Each link adds (m v^2 + w . (J w) + 2 v . (w x m c)) / 2, with v the velocity of the joint frame's origin (Siciliano
    et al., Robotics, 2009, section 7.1.1), each drive I qd_i^2 / 2, and each drive that moves joints i and j together
    I qd_i qd_j.

    Parameters
    ----------
    table
        The arm's table in CasADi expressions.
    q
        Joint values, n x 1.
    qd
        Joint rates, n x 1.

    Returns
    -------
    casadi.SX
        1 x 1, J.

    Examples
    --------
    >>> import casadi
    >>> from dhkit import Arm
    >>> from dhkit.symbolic import InertialTable, joint_symbols
    >>> table = InertialTable.of(Arm.load("planar2r"))
    >>> q, qd = (joint_symbols(name, 2) for name in ("q", "qd"))
    >>> K = kinetic_energy(table, q, qd)
    >>> casadi.Function("K", [q, qd], [K])([0, 0], [1, 0])
    DM(0.460833)
    """
    import casadi

    frames = equation_frames(table, q)
    twice_K: Scalar = casadi.SX(0)
    for i, (frame, (w, v)) in enumerate(zip(frames, link_velocities(frames, qd), strict=True)):
        link = frame.moments

        # w . (J w) with J = tr(S) 1 - S:  (S_yy + S_zz) w_x^2 + ... - 2 (S_xy w_x w_y + ...)
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = link.tensor
        x, y, z = w
        squares = (yy + zz) * (x * x) + (xx + zz) * (y * y) + (xx + yy) * (z * z)
        products = xy * (x * y) + xz * (x * z) + yz * (y * z)

        # v . (w x m c)
        mixed = dot(v, cross(w, link.first))

        twice_K += (
            link.mass * dot(v, v)
            + squares
            - 2 * products
            + 2 * mixed
            + table.armature[i] * (qd[i] * qd[i])
        )
    for i, j, inertia in table.couplings:
        twice_K += 2 * inertia * (qd[i] * qd[j])
    return casadi.SX(twice_K / 2)


def potential_energy(table: InertialTable, q: casadi.SX) -> casadi.SX:
    """Return the potential energy V = -sum(m g . c) of the moving links, 1 x 1, J; 0 at the world's origin.

    Parameters
    ----------
    table
        The arm's table in CasADi expressions.
    q
        Joint values, n x 1.

    Returns
    -------
    casadi.SX
        1 x 1, J.

    Examples
    --------
    >>> import casadi
    >>> from dhkit import Arm
    >>> from dhkit.symbolic import InertialTable, joint_symbols
    >>> table = InertialTable.of(Arm.load("planar2r"))
    >>> q = joint_symbols("q", 2)
    >>> V = potential_energy(table, q)
    >>> casadi.Function("V", [q], [V])([1.5707963267948966, 0])  # upright
    DM(15.2055)
    """
    import casadi

    # V = -sum of (m g . p + g . m c), with p the origin of the link's joint frame and c the centre of mass from there
    V: Scalar = casadi.SX(table.potential)
    g: Vector3 = table.gravity
    g_p: Scalar = 0.0
    for frame in equation_frames(table, q):
        g_p = g_p + dot(g, frame.lever)
        g = frame.from_twisted(frame.to_twisted(g))
        V -= frame.moments.mass * g_p + dot(g, frame.moments.first)
    return casadi.SX(V)


def lagrange_mass_matrix(table: InertialTable, q: casadi.SX) -> casadi.SX:
    """Return M = d2K/dqd2, n x n, kg m^2, kg m and kg, for q (n x 1).

    Parameters
    ----------
    table
        The arm's table in CasADi expressions.
    q
        Joint values, n x 1.

    Returns
    -------
    casadi.SX
        n x n, symmetric, kg m^2, kg m and kg.

    Examples
    --------
    >>> import casadi
    >>> from dhkit import Arm
    >>> from dhkit.symbolic import InertialTable, joint_symbols
    >>> table = InertialTable.of(Arm.load("planar2r"))
    >>> q = joint_symbols("q", 2)
    >>> M = lagrange_mass_matrix(table, q)
    >>> casadi.Function("M", [q], [M])([0, 0]).full().round(4)
    array([[0.9217, 0.23  ],
           [0.23  , 0.08  ]])
    """
    import casadi

    qd = casadi.SX.sym("qd", table.n)
    return casadi.hessian(kinetic_energy(table, q, qd), qd)[0]


def lagrange_coriolis_matrix(table: InertialTable, q: casadi.SX, qd: casadi.SX) -> casadi.SX:
    """Return the Coriolis matrix of the Christoffel symbols, n x n; C qd is in N m and N.

    C_ij = sum over k of (dM_ij/dq_k + dM_ik/dq_j - dM_jk/dq_i) qd_k / 2 (Siciliano et al. 2009, eq. 7.45).

    Parameters
    ----------
    table
        The arm's table in CasADi expressions.
    q
        Joint values, n x 1.
    qd
        Joint rates, n x 1.

    Returns
    -------
    casadi.SX
        n x n, kg m^2/s, kg m/s and kg/s.

    Examples
    --------
    >>> import casadi
    >>> from dhkit import Arm
    >>> from dhkit.symbolic import InertialTable, joint_symbols
    >>> table = InertialTable.of(Arm.load("planar2r"))
    >>> q, qd = (joint_symbols(name, 2) for name in ("q", "qd"))
    >>> C = lagrange_coriolis_matrix(table, q, qd)
    >>> casadi.Function("C", [q, qd], [C])([0, 0.5], [1, 2]).full().round(4)
    array([[-0.1438, -0.2157],
           [ 0.0719,  0.    ]])
    """
    import casadi

    # C = (dM/dt + A - A^T) / 2 with A = d(M qd)/dq, A_ij = sum over k of dM_ik/dq_j qd_k
    M = lagrange_mass_matrix(table, q)
    dM_dt = casadi.reshape(casadi.jtimes(casadi.vec(M), q, qd), table.n, table.n)
    A = casadi.jacobian(M @ qd, q)
    return (dM_dt + A - A.T) / 2


def lagrange_gravity_torque(table: InertialTable, q: casadi.SX) -> casadi.SX:
    """Return g = dV/dq, n x 1, N m and N.

    Parameters
    ----------
    table
        The arm's table in CasADi expressions.
    q
        Joint values, n x 1.

    Returns
    -------
    casadi.SX
        n x 1, N m and N.

    Examples
    --------
    >>> import casadi
    >>> from dhkit import Arm
    >>> from dhkit.symbolic import InertialTable, joint_symbols
    >>> table = InertialTable.of(Arm.load("planar2r"))
    >>> q = joint_symbols("q", 2)
    >>> g = lagrange_gravity_torque(table, q)
    >>> casadi.Function("g", [q], [g])([0, 0])
    DM([15.2055, 2.943])
    """
    import casadi

    return casadi.gradient(potential_energy(table, q), q)


def lagrange_inverse_dynamics(
    table: InertialTable, q: casadi.SX, qd: casadi.SX, qdd: casadi.SX
) -> casadi.SX:
    """Return tau = M qdd + C qd + g, n x 1, N m and N, from the matrices.

    Parameters
    ----------
    table
        The arm's table in CasADi expressions.
    q
        Joint values, n x 1.
    qd, qdd
        Joint rates and accelerations, n x 1.

    Returns
    -------
    casadi.SX
        n x 1, N m and N.

    Examples
    --------
    >>> import casadi
    >>> from dhkit import Arm
    >>> from dhkit.symbolic import InertialTable, joint_symbols
    >>> table = InertialTable.of(Arm.load("planar2r"))
    >>> q, qd, qdd = (joint_symbols(name, 2) for name in ("q", "qd", "qdd"))
    >>> tau = lagrange_inverse_dynamics(table, q, qd, qdd)
    >>> casadi.Function("tau", [q, qd, qdd], [tau])([0, 0], [1, 0], [0, 2])
    DM([15.6655, 3.103])
    """
    M = lagrange_mass_matrix(table, q)
    C = lagrange_coriolis_matrix(table, q, qd)
    return M @ qdd + C @ qd + lagrange_gravity_torque(table, q)


def lagrange_torque(table: InertialTable, q: casadi.SX, qd: casadi.SX, qdd: casadi.SX) -> casadi.SX:
    """Return tau = d/dt dL/dqd - dL/dq with L = K - V, n x 1: Lagrange's equations as they stand.

    Parameters
    ----------
    table
        The arm's table in CasADi expressions.
    q
        Joint values, n x 1.
    qd, qdd
        Joint rates and accelerations, n x 1.

    Returns
    -------
    casadi.SX
        n x 1, N m and N.

    Examples
    --------
    >>> import casadi
    >>> from dhkit import Arm
    >>> from dhkit.symbolic import InertialTable, joint_symbols
    >>> table = InertialTable.of(Arm.load("planar2r"))
    >>> q, qd, qdd = (joint_symbols(name, 2) for name in ("q", "qd", "qdd"))
    >>> tau = lagrange_torque(table, q, qd, qdd)
    >>> casadi.Function("tau", [q, qd, qdd], [tau])([0, 0], [1, 0], [0, 2])
    DM([15.6655, 3.103])
    """
    import casadi

    L = kinetic_energy(table, q, qd) - potential_energy(table, q)

    # p = dL/dqd depends on the state x = (q, qd), which changes by (qd, qdd): dp/dt = dp/dx (qd, qdd)
    p = casadi.gradient(L, qd)
    state = casadi.vertcat(q, qd)
    state_rate = casadi.vertcat(qd, qdd)
    dp_dt = casadi.jtimes(p, state, state_rate)
    return dp_dt - casadi.gradient(L, q)
