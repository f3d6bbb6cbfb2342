"""Inverse dynamics by recursion over the links (Newton-Euler), with the fewest operations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from dhkit.symbolic.differentiable.equation_frames import EquationFrame, equation_frames
from dhkit.symbolic.differentiable.inertial_table import InertialTable
from dhkit.symbolic.differentiable.moments import Moments
from dhkit.symbolic.differentiable.vectors import ZERO_VECTOR, Scalar, Vector3, cross, plus, times

if TYPE_CHECKING:
    import casadi


@dataclass(frozen=True)
class AngularMotion:
    """A link's angular velocity w, rad/s, and the matrix U = [wd]x + [w]x [w]x of its angular acceleration wd, rad/s^2.

    A point at r from the link's origin accelerates by U r relative to it. Stored are w, wd_z and the last column of U,
    which does not change across a joint about z; the rest of U follows from them.
    """

    w: Vector3
    wd_z: Scalar
    column: Vector3
    """U_xz, U_yz, U_zz."""

    @cached_property
    def wd_y(self) -> Scalar:
        """wd_y = U_xz - w_x w_z, rad/s^2."""
        return self.column[0] - self.w[0] * self.w[2]

    @cached_property
    def U(self) -> tuple[Vector3, Vector3, Vector3]:
        """The matrix U, row by row, 1/s^2."""
        # [wd]x + [w]x [w]x =
        #   -(y^2 + z^2)   xy - wd_z      xz + wd_y
        #   xy + wd_z      -(x^2 + z^2)   yz - wd_x
        #   xz - wd_y      yz + wd_x      -(x^2 + y^2)      with (x, y, z) = w
        # so that U_xx = U_zz + x^2 - z^2 and U_zy = 2 y z - U_yz.
        x, y, z = self.w
        xy = x * y
        xx = x * x
        zz = z * z
        U_xz, U_yz, U_zz = self.column
        return (
            (U_zz + (xx - zz), xy - self.wd_z, U_xz),
            (xy + self.wd_z, -(xx + zz), U_yz),
            (x * z - self.wd_y, (y + y) * z - U_yz, U_zz),
        )

    def times(self, r: Vector3) -> Vector3:
        """Return U r, m/s^2."""
        a, b, c = (row[0] * r[0] + row[1] * r[1] + row[2] * r[2] for row in self.U)
        return a, b, c

    def in_twisted_axes(self, frame: EquationFrame) -> AngularMotion:
        """Return the same motion in the twisted axes of the next joint."""
        c = frame.cos_alpha
        s = frame.sin_alpha
        w = frame.to_twisted(self.w)

        # The new z axis is (0, -s, c) in the old axes: wd_z' = c wd_z - s wd_y, and the last column of U' is U z'.
        wd_z = c * self.wd_z - s * self.wd_y
        column = self.times((0.0, -s, c))
        return AngularMotion(w, wd_z, frame.to_twisted(column))

    def with_joint_motion(self, qd: Scalar, qdd: Scalar) -> AngularMotion:
        """Return the motion with that of a revolute joint about z added: rates rad/s and rad/s^2."""
        x, y, z = self.w
        return AngularMotion((x, y, z + qd), self.wd_z + qdd, self.column)

    def in_link_axes(self, frame: EquationFrame) -> AngularMotion:
        """Return the same motion, given in twisted axes, in the axes of the link's equations."""
        return AngularMotion(frame.from_twisted(self.w), self.wd_z, frame.from_twisted(self.column))

    def moment(self, link: Moments) -> Vector3:
        """Return the integral of r x U r over a link's mass, N m: the moment that its rotation needs."""
        # With S the integral of r r^T and A = U S, the integral of U r r^T, the moment is
        #   (A_zy - A_yz, A_xz - A_zx, A_yx - A_xy)
        # in which U_xx - U_zz = x^2 - z^2, and U_yx S_xx - U_xy S_yy = (S_xx + S_yy) wd_z + (S_xx - S_yy) x y.
        (U_xx, U_xy, U_xz), (U_yx, U_yy, U_yz), (U_zx, U_zy, U_zz) = self.U
        x, y, z = self.w
        S = link
        return (
            S.yy * U_zy - S.zz * U_yz + S.yz * (U_zz - U_yy) + S.xy * U_zx - S.xz * U_yx,
            S.zz * U_xz - S.xx * U_zx + S.xz * (x * x - z * z) + S.yz * U_xy - S.xy * U_zy,
            (S.xx + S.yy) * self.wd_z
            + S.difference * (x * y)
            + S.xy * (U_yy - U_xx)
            + S.xz * U_yz
            - S.yz * U_xz,
        )


def recursive_inverse_dynamics(
    table: InertialTable,
    q: casadi.SX,
    qd: Sequence[Scalar] | casadi.SX,
    qdd: Sequence[Scalar] | casadi.SX,
) -> casadi.SX:
    """Return the joint torques of a motion by Newton's and Euler's equations, n x 1, N m and N; drives included.

    Luh, Walker & Paul 1980, with accelerations by U and base parameters (Khalil & Kleinfinger 1987), in the axes that
    :class:`dhkit.symbolic.differentiable.equation_frames.EquationFrame` chooses.

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
    >>> tau = recursive_inverse_dynamics(table, q, qd, qdd)
    >>> casadi.Function("tau", [q, qd, qdd], [tau])([0, 0], [1, 0], [0, 2])
    DM([15.6655, 3.103])
    """
    import casadi

    frames = equation_frames(table, q)
    wrenches = transmitted_wrenches(frames, link_motions(frames, table.gravity, qd, qdd))
    tau = []
    for i, (frame, (force, moment)) in enumerate(zip(frames, wrenches, strict=True)):
        tau.append((force if frame.prismatic else moment)[2] + table.armature[i] * qdd[i])
    for i, j, inertia in table.couplings:
        tau[i] = tau[i] + inertia * qdd[j]
        tau[j] = tau[j] + inertia * qdd[i]
    return casadi.SX(casadi.vertcat(*tau))


def link_motions(
    frames: Sequence[EquationFrame],
    gravity: Vector3,
    qd: Sequence[Scalar] | casadi.SX,
    qdd: Sequence[Scalar] | casadi.SX,
) -> list[tuple[AngularMotion, Vector3]]:
    """Return each link's angular motion, and the acceleration of its joint's origin, m/s^2, minus gravity.

    Vectors are in the axes of the links' equations.

    Parameters
    ----------
    frames
        The equation frames of all joints.
    gravity
        In frame 0, m/s^2.
    qd, qdd
        Joint rates and accelerations, n x 1.
    """
    motion = AngularMotion(ZERO_VECTOR, 0.0, ZERO_VECTOR)
    a = times(-1.0, gravity)
    motions = []
    for i, frame in enumerate(frames):
        # a_i = a_(i-1) + U_(i-1) lever, and for a prismatic joint 2 w x z qd + z qdd
        a = frame.to_twisted(plus(a, motion.times(frame.lever)))
        motion = motion.in_twisted_axes(frame)
        if frame.prismatic:
            two_qd = qd[i] + qd[i]
            a = (a[0] + two_qd * motion.w[1], a[1] - two_qd * motion.w[0], a[2] + qdd[i])
        else:
            motion = motion.with_joint_motion(qd[i], qdd[i])
        a = frame.from_twisted(a)
        motion = motion.in_link_axes(frame)
        motions.append((motion, a))
    return motions


def transmitted_wrenches(
    frames: Sequence[EquationFrame], motions: Sequence[tuple[AngularMotion, Vector3]]
) -> list[tuple[Vector3, Vector3]]:
    """Return the force, N, and the moment about its origin, N m, that each joint transmits.

    Vectors are in the axes of the links' equations.

    Parameters
    ----------
    frames
        The equation frames of all joints.
    motions
        Of :func:`link_motions`.
    """
    f = ZERO_VECTOR
    n = ZERO_VECTOR
    wrenches = []
    for frame, (motion, a) in zip(reversed(frames), reversed(motions), strict=True):
        # Newton: F = m a + U h. Euler about the joint's origin: N = integral of r x U r + h x a. h is the first moment.
        link = frame.moments
        f = plus(plus(times(link.mass, a), motion.times(link.first)), f)
        n = plus(plus(motion.moment(link), cross(link.first, a)), n)
        wrenches.append((f, n))

        f = frame.to_previous(f)
        n = frame.to_previous(n)
        n = plus(n, cross(frame.lever, f))
    return wrenches[::-1]


def recursive_bias(table: InertialTable, q: casadi.SX, qd: casadi.SX) -> casadi.SX:
    """Return C qd + g, n x 1: the torques, N m and N, of a motion without acceleration.

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
        n x 1, N m and N.

    Examples
    --------
    >>> import casadi
    >>> from dhkit import Arm
    >>> from dhkit.symbolic import InertialTable, joint_symbols
    >>> table = InertialTable.of(Arm.load("planar2r"))
    >>> q, qd = (joint_symbols(name, 2) for name in ("q", "qd"))
    >>> h = recursive_bias(table, q, qd)
    >>> casadi.Function("h", [q, qd], [h])([0, 0.5], [1, 2])
    DM([14.2699, 2.65464])
    """
    return recursive_inverse_dynamics(table, q, qd, [0.0] * table.n)


def recursive_gravity(table: InertialTable, q: casadi.SX) -> casadi.SX:
    """Return g, n x 1: the torques at rest, N m and N.

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
    >>> g = recursive_gravity(table, q)
    >>> casadi.Function("g", [q], [g])([0, 0])
    DM([15.2055, 2.943])
    """
    return recursive_inverse_dynamics(table, q, [0.0] * table.n, [0.0] * table.n)
