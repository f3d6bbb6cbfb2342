"""Mass and Coriolis matrices by composite rigid bodies: all links that a joint carries, taken as one body."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from dhkit.symbolic.differentiable.equation_frames import (
    EquationFrame,
    equation_frames,
    link_velocities,
)
from dhkit.symbolic.differentiable.inertial_table import InertialTable
from dhkit.symbolic.differentiable.moments import Moments
from dhkit.symbolic.differentiable.recursive import link_motions, transmitted_wrenches
from dhkit.symbolic.differentiable.vectors import (
    ZERO_VECTOR,
    Scalar,
    Vector3,
    cross,
    dot,
    plus,
    times,
)

if TYPE_CHECKING:
    import casadi

_Wrench: TypeAlias = tuple[Vector3, Vector3]
"""Force, N, and moment about a joint's origin, N m."""
_Matrix3: TypeAlias = tuple[Vector3, Vector3, Vector3]
"""A 3 x 3 matrix, row by row."""


def composite_mass_matrix(table: InertialTable, q: casadi.SX) -> casadi.SX:
    """Return M with drives, n x n, kg m^2, kg m and kg, by composite rigid bodies (Walker & Orin 1982, method 3).

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
    >>> M = composite_mass_matrix(table, q)
    >>> casadi.Function("M", [q], [M])([0, 0]).full().round(4)
    array([[0.9217, 0.23  ],
           [0.23  , 0.08  ]])
    """
    frames = equation_frames(table, q)
    M: list[list[Scalar]] = [[0.0] * table.n for _ in frames]
    for j, composite in _composites(frames):
        # M_ij is the torque at joint i, i <= j, for a unit acceleration of joint j: the wrench's component along z_i.
        wrench = _unit_acceleration_wrench(frames[j], composite)
        for i, (force, moment) in _wrench_at_each_joint(frames, j, wrench):
            M[i][j] = M[j][i] = (force if frames[i].prismatic else moment)[2]
        M[j][j] = M[j][j] + table.armature[j]
    for i, j, inertia in table.couplings:
        M[i][j] = M[j][i] = M[i][j] + inertia
    return _matrix(M)


def composite_coriolis_matrix(table: InertialTable, q: casadi.SX, qd: casadi.SX) -> casadi.SX:
    """Return the Coriolis matrix of the Christoffel symbols, n x n.

    C_ij is the integral over all mass of J_i . dJ_j/dt, where J_j(r) is the velocity of a point at r per unit rate of
    joint j. The part that depends on the velocities V of the links that a joint carries is summed over them as two
    integrals over mass, of V and of r V^T: 12 numbers, where the Coriolis inertia of Echeandia & Wensing 2021 has 36.

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
        n x n, kg m^2/s, kg m/s and kg/s: dM/dt - 2 C is skew-symmetric.

    Examples
    --------
    >>> import casadi
    >>> from dhkit import Arm
    >>> from dhkit.symbolic import InertialTable, joint_symbols
    >>> table = InertialTable.of(Arm.load("planar2r"))
    >>> q, qd = (joint_symbols(name, 2) for name in ("q", "qd"))
    >>> C = composite_coriolis_matrix(table, q, qd)
    >>> casadi.Function("C", [q, qd], [C])([0, 0.5], [1, 2]).full().round(4)
    array([[-0.1438, -0.2157],
           [ 0.0719,  0.    ]])
    """
    frames = equation_frames(table, q)
    velocities = link_velocities(frames, qd)
    C: list[list[Scalar]] = [[0.0] * table.n for _ in frames]
    rates = _VelocityMoments.none()
    for j, composite in _composites(frames):
        frame = frames[j]
        w, v = velocities[j]
        rates = rates.joined(_VelocityMoments.of_link(frame.moments, w, v))

        # Column j, i <= j: the integral of dJ_j/dt and of r x dJ_j/dt, along joint i.
        column = _column_rate(frame, composite, rates, w, v)
        for i, (force, moment) in _wrench_at_each_joint(frames, j, column):
            C[i][j] = (force if frames[i].prismatic else moment)[2]

        # Row j, i < j: the integral of J_j . dJ_i/dt.
        couples = dict(_couple_at_each_joint(frames, j, rates.couple(frame.prismatic)))
        row = _unit_acceleration_wrench(frame, composite)
        for i, wrench in _wrench_at_each_joint(frames, j, row):
            if i < j:
                C[j][i] = _row_rate(frames[i], wrench, couples[i], *velocities[i])
        rates = rates.about_previous(frame)
    return _matrix(C)


def composite_position_derivative(
    table: InertialTable, q: casadi.SX, qd: casadi.SX, qdd: casadi.SX
) -> casadi.SX:
    """Return the derivatives of inverse dynamics with respect to the joint values, n x n.

    With the acceleration A of a point at r minus gravity, tau_i is the integral of J_i . A over the mass that joint i
    carries. A small motion of joint j moves the points that it carries by J_j, changes their acceleration by the second
    derivative of J_j with respect to time, and turns the J_i of points that both carry. The sums over mass are those of
    Singh, Russo & Wensing 2022 (Efficient analytical derivatives of rigid-body dynamics using spatial vector algebra),
    here by integrals of V, r V^T and A.

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
        n x n, N m and N per unit of q; column j belongs to joint j.

    Examples
    --------
    >>> import casadi
    >>> from dhkit import Arm
    >>> from dhkit.symbolic import InertialTable, joint_symbols
    >>> table = InertialTable.of(Arm.load("planar2r"))
    >>> q, qd, qdd = (joint_symbols(name, 2) for name in ("q", "qd", "qdd"))
    >>> slopes = composite_position_derivative(table, q, qd, qdd)
    >>> casadi.Function("slopes", [q, qd, qdd], [slopes])([0, 0.5], [1, 2], [0, 1]).full().round(4)
    array([[-1.4109, -2.536 ],
           [-1.4109, -1.2793]])
    """
    frames = equation_frames(table, q)
    velocities = link_velocities(frames, qd)
    motions = link_motions(frames, table.gravity, qd, qdd)
    transmitted = transmitted_wrenches(frames, motions)
    slopes: list[list[Scalar]] = [[0.0] * table.n for _ in frames]
    rates = _VelocityMoments.none()
    for j, composite in _composites(frames):
        frame = frames[j]
        w, v = velocities[j]
        rates = rates.joined(_VelocityMoments.of_link(frame.moments, w, v))

        # Column j, i <= j: the wrench on the mass that joint j carries, which changes with q_j.
        joint = _JointMotion(frame.prismatic, w, v, motions[j][0].column, motions[j][1])
        column = joint.wrench_change(composite, rates, transmitted[j])
        for i, (force, moment) in _wrench_at_each_joint(frames, j, column):
            slopes[i][j] = (force if frames[i].prismatic else moment)[2]

        # Row j, i < j: the torque of joint j, which changes with q_i.
        couples = dict(_couple_at_each_joint(frames, j, rates.couple(frame.prismatic)))
        row = _unit_acceleration_wrench(frame, composite)
        for i, wrench in _wrench_at_each_joint(frames, j, row):
            if i < j:
                before = _JointMotion(
                    frames[i].prismatic, *velocities[i], motions[i][0].column, motions[i][1]
                )
                slopes[j][i] = before.torque_change(wrench, couples[i])
        rates = rates.about_previous(frame)
    return _matrix(slopes)


@dataclass(frozen=True)
class _JointMotion:
    """Motion of a joint's axis z and of its link, in the axes of the link's equations."""

    prismatic: bool
    w: Vector3
    """Angular velocity of the link, rad/s."""
    v: Vector3
    """Velocity of the joint's origin, m/s."""
    z_second: Vector3
    """Second derivative of z with respect to time, 1/s^2."""
    a: Vector3
    """Acceleration of the joint's origin minus gravity, m/s^2."""

    @property
    def z_dot(self) -> Vector3:
        """The derivative w x z of z with respect to time, 1/s."""
        return self.w[1], -self.w[0], 0.0

    def wrench_change(
        self, body: Moments, rates: _VelocityMoments, transmitted: _Wrench
    ) -> _Wrench:
        """Return the change of the wrench on the mass that the joint carries, per unit of its joint value.

        In it the axes of joints before it stay where they are.

        Parameters
        ----------
        body, rates
            Moments of that mass, and of its velocity.
        transmitted
            Its wrench: the integrals of A and of r x A.
        """
        force, moment = transmitted
        turned_force = (-force[1], force[0], 0.0)
        if self.prismatic:
            # J_j = z, so the second derivative is z'', and the mass is moved by z: r x A changes by z x A.
            return (
                times(body.mass, self.z_second),
                plus(cross(body.first, self.z_second), turned_force),
            )

        # J_j = z x r, so d2J_j/dt2 = z'' x r + 2 z' x (V - v) + z x (A - a). With p and G the integrals of V and r V^T:
        #   force  = z'' x h + 2 z' x (p - m v) + z x (f - m a)
        #   moment = J z'' + 2 (z' tr G - G^T z') - 2 h x (z' x v) + z x n - h x (z x a)
        # The last two terms have the integral of r x (z x A) + (z x r) x A = z x (r x A), with n that of r x A.
        z_dot = self.z_dot
        h = body.first
        relative = plus(rates.momentum, times(-body.mass, self.v))
        z_a = (-self.a[1], self.a[0], 0.0)
        two_z_dot = plus(z_dot, z_dot)
        change = plus(cross(self.z_second, h), cross(two_z_dot, relative))
        change = plus(change, plus(turned_force, times(-body.mass, z_a)))
        turned = plus(_inertia_times(body, self.z_second), (-moment[1], moment[0], 0.0))
        turned = plus(turned, rates.twice_about(two_z_dot))
        shift = plus(cross(two_z_dot, self.v), z_a)
        return change, plus(turned, times(-1.0, cross(h, shift)))

    def torque_change(self, wrench: _Wrench, couple: Vector3) -> Scalar:
        """Return the change of the torque of a later joint i per unit of this joint's value.

        Parameters
        ----------
        wrench
            The integrals of J_i and of r x J_i, r from this joint's origin.
        couple
            The integral of V x J_i.
        """
        force, moment = wrench
        if self.prismatic:
            return dot(self.z_second, force)

        # The integral of (z x J_i) . A + J_i . d2J/dt2, in which A cancels:
        #   z'' . moment + 2 z' . (couple - v x force) - z . (a x force)
        about = plus(couple, times(-1.0, cross(self.v, force)))
        x, y, _ = about
        by_rate = self.w[1] * x - self.w[0] * y
        return (
            dot(self.z_second, moment)
            + (by_rate + by_rate)
            - (self.a[0] * force[1] - self.a[1] * force[0])
        )


@dataclass(frozen=True)
class _VelocityMoments:
    """Integrals of V and of r V^T over the mass of some links; V is velocity, r position from a joint's origin."""

    momentum: Vector3
    """kg m/s."""
    G: _Matrix3
    """Row i, column j: the integral of r_i V_j, kg m^2/s."""

    @classmethod
    def none(cls) -> _VelocityMoments:
        """Return the integrals over no mass."""
        return cls(ZERO_VECTOR, (ZERO_VECTOR, ZERO_VECTOR, ZERO_VECTOR))

    @classmethod
    def of_link(cls, link: Moments, w: Vector3, v: Vector3) -> _VelocityMoments:
        """Return the integrals over a link that turns with w, rad/s, and whose origin moves with v, m/s."""
        # V = v + w x r, so the integral of V is m v + w x h, and that of r_i V is h_i v + w x (row i of S);
        # h is the integral of r, S that of r r^T.
        momentum = plus(times(link.mass, v), cross(w, link.first))
        rows = zip(link.first, link.tensor, strict=True)
        x, y, z = (plus(times(h_i, v), cross(w, S_i)) for h_i, S_i in rows)
        return cls(momentum, (x, y, z))

    def joined(self, other: _VelocityMoments) -> _VelocityMoments:
        """Return the sum with the integrals over other links, given about the same origin and in the same axes."""
        x, y, z = (plus(a, b) for a, b in zip(self.G, other.G, strict=True))
        return _VelocityMoments(plus(self.momentum, other.momentum), (x, y, z))

    def couple(self, prismatic: bool) -> Vector3:
        """Return the integral of V x J_j over the mass; J_j is z x r for a revolute joint and z for a prismatic one."""
        # V x z
        if prismatic:
            return self.momentum[1], -self.momentum[0], 0.0
        # V x (z x r) = z (V . r) - r (V . z); its z component is V_x r_x + V_y r_y.
        return -self.G[0][2], -self.G[1][2], self.G[0][0] + self.G[1][1]

    def twice_about(self, two_z: Vector3) -> Vector3:
        """Return the integral of r x (z x V) over the mass, twice, for 2 z with the z component 0."""
        # z (r . V) - V (r . z)
        x, y, _ = two_z
        G = self.G
        trace = G[0][0] + G[1][1] + G[2][2]
        rows = (G[0][k] * x + G[1][k] * y for k in range(3))
        a, b, c = rows
        return trace * x - a, trace * y - b, -c

    def about_previous(self, frame: EquationFrame) -> _VelocityMoments:
        """Return the integrals about the previous joint's origin, in the axes of its link's equations."""
        # Turned axes: R G R^T, first the rows, then the columns.
        p = frame.to_previous(self.momentum)
        rows_turned = [frame.to_previous(row) for row in self.G]
        columns = [frame.to_previous((c[0], c[1], c[2])) for c in zip(*rows_turned, strict=True)]
        rows = [(r[0], r[1], r[2]) for r in zip(*columns, strict=True)]

        # Moved origin: the integral of (r + lever) V^T is R G R^T + lever p^T.
        x, y, z = (plus(row, times(lever, p)) for row, lever in zip(rows, frame.lever, strict=True))
        return _VelocityMoments(p, (x, y, z))


def _composites(frames: list[EquationFrame]) -> Iterator[tuple[int, Moments]]:
    """Yield each joint, the last first, with the moments of all links that it carries, in its link's equation axes."""
    composite = Moments.none()
    for j in reversed(range(len(frames))):
        frame = frames[j]
        composite = composite.joined(frame.moments)
        yield j, composite
        composite = (
            composite.about_z(*frame.rotation)
            .about_x(frame.cos_alpha, frame.sin_alpha)
            .moved(frame.lever)
        )


def _unit_acceleration_wrench(frame: EquationFrame, body: Moments) -> _Wrench:
    """Return the wrench on a body at rest that a unit acceleration of the joint that carries it needs."""
    # Force: the integral of J_j; moment: that of r x J_j.
    x, y, _ = body.first
    if frame.prismatic:
        # J_j = z: force m z, moment h x z
        return (0.0, 0.0, body.mass), (y, -x, 0.0)
    # J_j = z x r: force z x h, moment J z = (tr(S) 1 - S) z
    return (-y, x, 0.0), (-body.xz, -body.yz, body.xx + body.yy)


def _column_rate(
    frame: EquationFrame, body: Moments, rates: _VelocityMoments, w: Vector3, v: Vector3
) -> _Wrench:
    """Return the integrals of dJ_j/dt and of r x dJ_j/dt over the mass that joint j carries.

    The joint's link turns with w, rad/s, and its origin moves with v, m/s.
    """
    z_dot = (w[1], -w[0], 0.0)  # w x z
    if frame.prismatic:
        # J_j = z
        return times(body.mass, z_dot), cross(body.first, z_dot)

    # J_j = z x r, so dJ_j/dt = z x (V - v) + z_dot x r, with r from the joint's origin. With p and G the integrals of
    # V and r V^T, and -z x v = (v_y, -v_x, 0):
    #   force  = z x p - m z x v + z_dot x h
    #   moment = integral of r x (z x V) - h x (z x v) + J z_dot
    minus_z_v = (v[1], -v[0], 0.0)
    p = rates.momentum
    G = rates.G
    z_p = (-p[1], p[0], 0.0)
    r_z_V = (-G[2][0], -G[2][1], G[0][0] + G[1][1])  # r x (z x V) = z (r . V) - V (r . z)
    force = plus(z_p, plus(times(body.mass, minus_z_v), cross(z_dot, body.first)))
    moment = plus(r_z_V, cross(body.first, minus_z_v))
    return force, plus(moment, _inertia_times(body, z_dot))


def _row_rate(
    frame: EquationFrame, wrench: _Wrench, couple: Vector3, w: Vector3, v: Vector3
) -> Scalar:
    """Return the integral of J_j . dJ_i/dt over the mass that a later joint j carries.

    Parameters
    ----------
    frame
        Joint i's frame; its link turns with w, rad/s, and its origin moves with v, m/s.
    wrench
        The integrals of J_j and of r x J_j, r from joint i's origin.
    couple
        The integral of V x J_j.
    """
    force, moment = wrench
    z_dot = (w[1], -w[0], 0.0)  # w x z
    if frame.prismatic:
        return dot(z_dot, force)

    # J_j . (z x (V - v) + z_dot x r) = z . (V x J_j) - (z x v) . J_j + z_dot . (r x J_j)
    minus_z_v = (v[1], -v[0], 0.0)
    return dot(z_dot, moment) + dot(minus_z_v, force) + couple[2]


def _inertia_times(body: Moments, w: Vector3) -> Vector3:
    """Return J w; J = tr(S) 1 - S."""
    x, y, z = w
    return (
        (body.yy + body.zz) * x - body.xy * y - body.xz * z,
        (body.xx + body.zz) * y - body.xy * x - body.yz * z,
        (body.xx + body.yy) * z - body.xz * x - body.yz * y,
    )


def _wrench_at_each_joint(
    frames: list[EquationFrame], j: int, wrench: _Wrench
) -> Iterator[tuple[int, _Wrench]]:
    """Yield joint j's wrench about the origin and in the equation axes of every joint from j down to the first."""
    force, moment = wrench
    for i in reversed(range(j + 1)):
        yield i, (force, moment)
        force = frames[i].to_previous(force)
        moment = frames[i].to_previous(moment)
        moment = plus(moment, cross(frames[i].lever, force))


def _couple_at_each_joint(
    frames: list[EquationFrame], j: int, couple: Vector3
) -> Iterator[tuple[int, Vector3]]:
    """Yield a free vector of joint j's equation axes in those of every joint from j down to the first."""
    for i in reversed(range(j + 1)):
        yield i, couple
        couple = frames[i].to_previous(couple)


def _matrix(entries: list[list[Scalar]]) -> casadi.SX:
    """Return a matrix from its rows."""
    import casadi

    return casadi.SX(casadi.vertcat(*(casadi.horzcat(*row) for row in entries)))
