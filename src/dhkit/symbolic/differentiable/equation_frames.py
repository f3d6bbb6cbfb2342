"""The axes in which each link's equations are written, chosen so that the equations have the fewest operations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from dhkit.symbolic.differentiable.inertial_table import InertialTable
from dhkit.symbolic.differentiable.joint_frames import JointRow
from dhkit.symbolic.differentiable.moments import Moments
from dhkit.symbolic.differentiable.vectors import (
    ZERO_VECTOR,
    Scalar,
    Vector3,
    about_x,
    about_x_back,
    about_z,
    about_z_back,
    cross,
    is_zero,
    plus,
)

if TYPE_CHECKING:
    import casadi


@dataclass(frozen=True)
class EquationFrame:
    """Joint i and its link at a state, in the axes that the link's equations are written in.

    A vector is taken across joint i in two steps. The *twisted* axes are those of link i-1's equations, turned by the
    twist alpha alone: they do not turn with joint i. From there it is taken to the axes of link i's equations. Where
    joint i+1 is parallel to joint i, and for the last joint, these stay the twisted axes, and the link's own moments
    are turned instead, by the sum of the joint angles since the axes were first parallel; otherwise they are the axes
    of the link. So links of parallel joints share their axes.
    """

    prismatic: bool
    cos_alpha: Scalar
    sin_alpha: Scalar
    lever: Vector3
    """Joint i's origin from joint i-1's, m, in the axes of link i-1's equations."""
    rotation: tuple[Scalar, Scalar]
    """Cosine and sine of the angle about z from the twisted axes to those of link i's equations."""
    moments: Moments
    """The link's moments about joint i's origin, in the axes of its equations."""

    def to_previous(self, a: Vector3) -> Vector3:
        """Return a vector of link i's equations in the axes of link i-1's."""
        return about_x(self.cos_alpha, self.sin_alpha, about_z(*self.rotation, a))

    def to_twisted(self, a: Vector3) -> Vector3:
        """Return a vector of link i-1's equations in the twisted axes."""
        return about_x_back(self.cos_alpha, self.sin_alpha, a)

    def from_twisted(self, a: Vector3) -> Vector3:
        """Return a vector of the twisted axes in those of link i's equations."""
        return about_z_back(*self.rotation, a)


def equation_frames(table: InertialTable, q: casadi.SX) -> list[EquationFrame]:
    """Return the equation frames of all joints at joint positions q, n x 1, rad and m."""
    no_rotation = (1.0, 0.0)
    frames: list[EquationFrame] = []
    angle = _ZERO_ANGLE
    link_rotation = (
        no_rotation  # cosine and sine from the axes of link i-1's equations to the link itself
    )
    for i, (row, link) in enumerate(zip(table.rows, table.links, strict=True)):
        # The translation of Rx(alpha) Tx(a) Tz(d), in the axes of link i-1's equations.
        d = row.d + q[i] if row.prismatic else row.d
        lever = about_z(*link_rotation, (row.a, -row.sin_alpha * d, row.cos_alpha * d))

        angle = _with_joint(angle, row, q[i])
        rotation = angle.cosine_and_sine()
        stays_twisted = i + 1 == len(table.rows) or is_zero(table.rows[i + 1].sin_alpha)
        if stays_twisted:
            equation_rotation = no_rotation
            moments = link.about_z(*rotation)
            link_rotation = rotation
        else:
            equation_rotation = rotation
            moments = link
            link_rotation = no_rotation
            angle = _ZERO_ANGLE
        frames.append(
            EquationFrame(
                row.prismatic, row.cos_alpha, row.sin_alpha, lever, equation_rotation, moments
            )
        )
    return frames


def link_velocities(frames: list[EquationFrame], qd: casadi.SX) -> list[tuple[Vector3, Vector3]]:
    """Return each link's angular velocity, rad/s, and the velocity of its joint's origin, m/s, in its equations' axes.

    Parameters
    ----------
    frames
        The equation frames of all joints.
    qd
        Joint velocities, n x 1, rad/s and m/s.
    """
    w = ZERO_VECTOR
    v = ZERO_VECTOR
    velocities = []
    for i, frame in enumerate(frames):
        # v_i = v_(i-1) + w_(i-1) x lever, then the joint's own motion along or about z.
        v = frame.to_twisted(plus(v, cross(w, frame.lever)))
        w = frame.to_twisted(w)
        if frame.prismatic:
            v = (v[0], v[1], v[2] + qd[i])
        else:
            w = (w[0], w[1], w[2] + qd[i])

        w = frame.from_twisted(w)
        v = frame.from_twisted(v)
        velocities.append((w, v))
    return velocities


class _Angle(NamedTuple):
    """The angle from the twisted axes to a link: the sum of a joint part and a part from the table."""

    joints: Scalar
    """Sum of joint angles since the axes were first parallel, rad; the float 0.0 without a revolute joint."""
    cos_table: Scalar
    """Cosine of the sum of the table's own angles."""
    sin_table: Scalar
    """Sine of the same sum."""

    def cosine_and_sine(self) -> tuple[Scalar, Scalar]:
        """Return the angle's cosine and sine, by the addition theorem."""
        import casadi

        if isinstance(self.joints, float):
            return self.cos_table, self.sin_table
        c = casadi.cos(self.joints)
        s = casadi.sin(self.joints)
        return c * self.cos_table - s * self.sin_table, s * self.cos_table + c * self.sin_table


_ZERO_ANGLE = _Angle(0.0, 1.0, 0.0)


def _with_joint(angle: _Angle, row: JointRow, q: Scalar) -> _Angle:
    """Return a link's angle in its twisted axes: the angle before, reversed for opposed axes, plus the joint's own."""
    joints, c, s = angle
    if is_zero(row.sin_alpha) and float(row.cos_alpha) < 0:
        joints = -joints
        s = -s

    cos_table = c * row.cos_theta - s * row.sin_theta
    sin_table = s * row.cos_theta + c * row.sin_theta
    return _Angle(joints if row.prismatic else q + joints, cos_table, sin_table)
