"""The regressor of M qdd_r + C qd_r + g in the links' inertial parameters, by bilinear Newton-Euler equations."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dhkit.description import INERTIA_PLACES, Convention
from dhkit.symbolic.differentiable.frames import SymbolicTable
from dhkit.symbolic.differentiable.vectors import (
    ZERO_VECTOR,
    Scalar,
    Vector3,
    about_x_back,
    about_z_back,
    cross,
    dot,
    plus,
    times,
)

if TYPE_CHECKING:
    import casadi

_UNITS: tuple[Vector3, Vector3, Vector3] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def velocity_regressor(
    table: SymbolicTable,
    gravity: Vector3,
    q: casadi.SX,
    qd: casadi.SX,
    qd_r: casadi.SX,
    qdd_r: casadi.SX,
) -> casadi.SX:
    """Return Y with Y theta = M(q) qdd_r + C(q, qd) qd_r + g(q), n x 10 n, without the drives' inertia.

    Terms that are quadratic in the rates in the regressor of inverse dynamics (Atkeson, An & Hollerbach 1986, eq. 8)
    are replaced by the symmetric bilinear form of qd and qd_r. That is C(q, qd) qd_r with C of the Christoffel symbols,
    which are symmetric in the two rates that they are multiplied by.

    Parameters
    ----------
    table
        The arm's frames; base and tool do not enter.
    gravity
        Free-fall acceleration in the axes of frame 0, m/s^2.
    q, qd, qd_r, qdd_r
        n x 1: joint values, rates, and reference rates and accelerations, rad, m and seconds.

    Returns
    -------
    casadi.SX
        n x 10 n; columns of link i as :func:`dhkit.dynamics.inertial_parameters` lists its parameters.

    Examples
    --------
    >>> from dhkit import Arm
    >>> from dhkit.symbolic import SymbolicTable, joint_symbols
    >>> table = SymbolicTable.of(Arm.load("planar2r"))
    >>> states = [joint_symbols(name, 2) for name in ("q", "qd", "qd_r", "qdd_r")]
    >>> velocity_regressor(table, (0.0, -9.81, 0.0), *states).shape
    (2, 20)
    """
    import casadi

    Y = casadi.SX(table.n, 10 * table.n)
    motion = _BilinearMotion(ZERO_VECTOR, ZERO_VECTOR, ZERO_VECTOR, times(-1.0, gravity))
    columns: list[tuple[Vector3, Vector3]] = []
    for i in range(table.n):
        step = _FrameStep.of(table, i, q[i])
        motion = step.next_motion(motion, qd[i], qd_r[i], qdd_r[i])
        columns = [step.moved_column(column) for column in columns]
        columns.append(step.own_column)

        # The torque at joint j that link i needs is the power along column j of link i's Jacobian.
        for j, (v, w) in enumerate(columns):
            Y[j, 10 * i : 10 * i + 10] = casadi.horzcat(*motion.power(v, w))
    return Y


@dataclass(frozen=True)
class _BilinearMotion:
    """A link's angular velocities by qd and qd_r, and accelerations bilinear in both, in its DH frame's axes."""

    w: Vector3
    """Angular velocity by qd, rad/s."""
    w_r: Vector3
    """Angular velocity by qd_r, rad/s."""
    wd: Vector3
    """Angular acceleration, rad/s^2."""
    a: Vector3
    """Acceleration of the frame's origin minus gravity, m/s^2."""

    def relative_acceleration(self, r: Vector3) -> Vector3:
        """Return U r, the acceleration of a point at r, m, relative to the frame's origin, m/s^2.

        U = [wd]x + ([w]x [w_r]x + [w_r]x [w]x) / 2.
        """
        twice_centripetal = plus(
            cross(self.w, cross(self.w_r, r)), cross(self.w_r, cross(self.w, r))
        )
        return plus(cross(self.wd, r), times(0.5, twice_centripetal))

    def power(self, v: Vector3, w: Vector3) -> list[Scalar]:
        """Return, for each of the link's ten parameters, the power needed to move with v (of its origin) and w.

        Force m a + U (m c) and moment m c x a + I wd + (w x I w_r + w_r x I w) / 2 about the frame's origin.
        """
        # m:       v . a
        of_mass = dot(v, self.a)

        # m c:     v . U e_k + w . (e_k x a)  for each axis e_k
        of_first = [
            dot(v, self.relative_acceleration(unit)) + dot(w, cross(unit, self.a))
            for unit in _UNITS
        ]

        # I:       w . I wd + (w x w_i) . I w_r / 2 + (w x w_r) . I w_i / 2,  with w_i the link's own angular velocity
        of_second = []
        w_cross_own = cross(w, self.w)
        w_cross_r = cross(w, self.w_r)
        for i, j in INERTIA_PLACES.values():
            terms = [
                _entry(i, j, w, self.wd),
                0.5 * _entry(i, j, w_cross_own, self.w_r),
                0.5 * _entry(i, j, w_cross_r, self.w),
            ]
            of_second.append(sum(terms))
        return [of_mass, *of_first, *of_second]


def _entry(i: int, j: int, a: Vector3, b: Vector3) -> Scalar:
    """Return the coefficient of the tensor's entry (i, j) in a . I b."""
    return a[i] * b[j] if i == j else a[i] * b[j] + a[j] * b[i]


@dataclass(frozen=True)
class _FrameStep:
    """The step from one DH frame to the next, in the axes of the next."""

    prismatic: bool
    standard: bool
    alpha: tuple[Scalar, Scalar]
    """Cosine and sine of the twist."""
    theta: tuple[Scalar, Scalar]
    """Cosine and sine of the joint's angle."""
    lever: Vector3
    """The position of this frame's origin from the previous one's, m."""
    axis: Vector3
    """Unit vector along the joint's axis."""

    @classmethod
    def of(cls, table: SymbolicTable, i: int, q: Scalar) -> _FrameStep:
        """Return the step over joint i, counted from 0, at its position q in rad or m."""
        import casadi

        a, d, cos_alpha, sin_alpha, cos_theta, sin_theta = table.rows[i]
        if table.prismatic[i]:
            d = d + q
            c = cos_theta
            s = sin_theta
        else:
            cos_q = casadi.cos(q)
            sin_q = casadi.sin(q)
            c = cos_q * cos_theta - sin_q * sin_theta
            s = sin_q * cos_theta + cos_q * sin_theta

        # In the next frame's axes. Standard, Rz(theta) Tz(d) Tx(a) Rx(alpha): the axis is Rx^T z.
        # Modified, Rx(alpha) Tx(a) Rz(theta) Tz(d): the axis is z.
        standard = table.convention is Convention.STANDARD
        lever: Vector3
        axis: Vector3
        if standard:
            lever = (a, sin_alpha * d, cos_alpha * d)
            axis = (0.0, sin_alpha, cos_alpha)
        else:
            lever = (a * c, -a * s, d)
            axis = (0.0, 0.0, 1.0)
        return cls(table.prismatic[i], standard, (cos_alpha, sin_alpha), (c, s), lever, axis)

    def to_own_axes(self, x: Vector3) -> Vector3:
        """Return a vector of the previous frame's axes in this frame's axes."""
        if self.standard:
            return about_x_back(*self.alpha, about_z_back(*self.theta, x))
        return about_z_back(*self.theta, about_x_back(*self.alpha, x))

    @property
    def own_column(self) -> tuple[Vector3, Vector3]:
        """The joint's own column of the Jacobian: velocity of the next frame's origin, and angular velocity."""
        if self.prismatic:
            return self.axis, ZERO_VECTOR
        if self.standard:
            return cross(self.axis, self.lever), self.axis
        # In the modified convention the frame's origin lies on the axis.
        return ZERO_VECTOR, self.axis

    def moved_column(self, column: tuple[Vector3, Vector3]) -> tuple[Vector3, Vector3]:
        """Return an earlier joint's column, given for the previous frame, for this frame."""
        v = self.to_own_axes(column[0])
        w = self.to_own_axes(column[1])
        return plus(v, cross(w, self.lever)), w

    def next_motion(
        self, before: _BilinearMotion, qd: Scalar, qd_r: Scalar, qdd_r: Scalar
    ) -> _BilinearMotion:
        """Return this link's motion from the previous link's, the joint's rates qd, qd_r and acceleration qdd_r."""
        z = self.axis
        motion = _BilinearMotion(
            w=self.to_own_axes(before.w),
            w_r=self.to_own_axes(before.w_r),
            wd=self.to_own_axes(before.wd),
            a=self.to_own_axes(before.a),
        )

        # Twice the bilinear form of qd w x z: qd w_r x z + qd_r w x z
        twice_w_z = plus(times(qd, cross(motion.w_r, z)), times(qd_r, cross(motion.w, z)))
        driven = times(qdd_r, z)

        if self.prismatic:
            # a + U lever + 2 qd w x z + qdd z
            a = plus(
                plus(motion.a, motion.relative_acceleration(self.lever)), plus(twice_w_z, driven)
            )
            return _BilinearMotion(motion.w, motion.w_r, motion.wd, a)

        # w + qd z, and wd + qd w x z + qdd z
        after = _BilinearMotion(
            w=plus(motion.w, times(qd, z)),
            w_r=plus(motion.w_r, times(qd_r, z)),
            wd=plus(motion.wd, plus(times(0.5, twice_w_z), driven)),
            a=motion.a,
        )
        # The lever rotates with this link in the standard convention, with the link before in the modified one.
        carrier = after if self.standard else motion
        return replace(after, a=plus(after.a, carrier.relative_acceleration(self.lever)))
