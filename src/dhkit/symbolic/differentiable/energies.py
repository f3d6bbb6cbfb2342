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
    et al., Robotics, 2009, section 7.1.1).
    """
    import casadi

    # Each link adds to 2 K:  m v^2 + w . (J w) + 2 v . (w x m c); stored are second moments, so that
    #     J = trace(S) 1 - S  and  w . (J w) = (S_yy + S_zz) w_x^2 + ... - 2 (S_xy w_x w_y + ...).
    frames = equation_frames(table, q)
    twice: Scalar = casadi.SX(0)
    for i, (frame, (w, v)) in enumerate(zip(frames, link_velocities(frames, qd), strict=True)):
        own = frame.moments
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = own.tensor
        x, y, z = w
        spinning = (yy + zz) * (x * x) + (xx + zz) * (y * y) + (xx + yy) * (z * z)
        products = xy * (x * y) + xz * (x * z) + yz * (y * z)
        carried = dot(v, cross(w, own.first))
        twice += own.mass * dot(v, v) + spinning - 2 * products + 2 * carried + table.armature[i] * (qd[i] * qd[i])
    for i, j, inertia in table.couplings:
        twice += 2 * inertia * (qd[i] * qd[j])
    return casadi.SX(twice / 2)


def potential_energy(table: InertialTable, q: casadi.SX) -> casadi.SX:
    """Return the potential energy V = -sum(m g . c) of the moving links, 1 x 1, J; 0 at the world's origin."""
    import casadi

    gravity: Vector3 = table.gravity
    energy: Scalar = casadi.SX(table.potential)
    height: Scalar = 0.0  # g . p, p the joint's origin, m^2/s^2
    for frame in equation_frames(table, q):
        height = height + dot(gravity, frame.lever)
        gravity = frame.from_twisted(frame.to_twisted(gravity))
        energy -= frame.moments.mass * height + dot(gravity, frame.moments.first)
    return casadi.SX(energy)


def lagrange_mass_matrix(table: InertialTable, q: casadi.SX) -> casadi.SX:
    """Return M = d2K/dqd2, n x n, kg m^2, kg m and kg, for q (n x 1)."""
    import casadi

    qd = casadi.SX.sym("qd", table.n)
    return casadi.hessian(kinetic_energy(table, q, qd), qd)[0]


def lagrange_coriolis_matrix(table: InertialTable, q: casadi.SX, qd: casadi.SX) -> casadi.SX:
    """Return the Christoffel C = (Mdot + A - A^T) / 2 with A = d(M qd)/dq, n x n; C qd is in N m and N.

    Sum over k of (dM_ij/dq_k + dM_ik/dq_j - dM_jk/dq_i) qd_k / 2 (Siciliano et al. 2009, eq. 7.45).
    """
    import casadi

    M = lagrange_mass_matrix(table, q)
    rate = casadi.reshape(casadi.jtimes(casadi.vec(M), q, qd), table.n, table.n)
    A = casadi.jacobian(M @ qd, q)
    return (rate + A - A.T) / 2


def lagrange_gravity_torque(table: InertialTable, q: casadi.SX) -> casadi.SX:
    """Return g = dV/dq, n x 1, N m and N."""
    import casadi

    return casadi.gradient(potential_energy(table, q), q)


def lagrange_inverse_dynamics(table: InertialTable, q: casadi.SX, qd: casadi.SX, qdd: casadi.SX) -> casadi.SX:
    """Return tau = M qdd + C qd + g, n x 1, N m and N, from the matrices."""
    M = lagrange_mass_matrix(table, q)
    C = lagrange_coriolis_matrix(table, q, qd)
    return M @ qdd + C @ qd + lagrange_gravity_torque(table, q)


def lagrange_torque(table: InertialTable, q: casadi.SX, qd: casadi.SX, qdd: casadi.SX) -> casadi.SX:
    """Return tau = d/dt dL/dqd - dL/dq with L = K - V, n x 1: Lagrange's equations as they stand."""
    import casadi

    L = kinetic_energy(table, q, qd) - potential_energy(table, q)
    momentum = casadi.gradient(L, qd)
    along = casadi.vertcat(qd, qdd)
    return casadi.jtimes(momentum, casadi.vertcat(q, qd), along) - casadi.gradient(L, q)
