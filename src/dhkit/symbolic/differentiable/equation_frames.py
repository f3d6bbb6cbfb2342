"""The axes in which each link's equations are written, chosen so that the equations have the fewest operations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

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
    frames: list[EquationFrame] = []
    # Sum of joint angles since the axes were first parallel; cosine and sine of the sum of the table's own angles.
    angles: tuple[Scalar, Scalar, Scalar] = (0.0, 1.0, 0.0)
    link_rotation = (1.0, 0.0)  # cosine and sine from the axes of link i-1's equations to the link itself
    for i, (row, link) in enumerate(zip(table.rows, table.links, strict=True)):
        d = row.d + q[i] if row.prismatic else row.d
        lever = about_z(*link_rotation, (row.a, -row.sin_alpha * d, row.cos_alpha * d))
        angles = _summed_angles(row, angles, q[i])
        rotation = _cos_sin(angles)
        stays_twisted = i + 1 == len(table.rows) or is_zero(table.rows[i + 1].sin_alpha)
        if stays_twisted:
            shown = (1.0, 0.0)
            moments = link.about_z(*rotation)
            link_rotation = rotation
        else:
            shown = rotation
            moments = link
            link_rotation = (1.0, 0.0)
            angles = (0.0, 1.0, 0.0)
        frames.append(EquationFrame(row.prismatic, row.cos_alpha, row.sin_alpha, lever, shown, moments))
    return frames


def link_velocities(frames: list[EquationFrame], qd: casadi.SX) -> list[tuple[Vector3, Vector3]]:
    """Return each link's angular velocity, rad/s, and the velocity of its joint's origin, m/s, in its equations' axes.

    Parameters
    ----------
    frames
        Of all joints.
    qd
        Joint velocities, n x 1.
    """
    w = ZERO_VECTOR
    v = ZERO_VECTOR
    velocities = []
    for i, frame in enumerate(frames):
        v = frame.to_twisted(plus(v, cross(w, frame.lever)))
        w = frame.to_twisted(w)
        if frame.prismatic:
            v = v[0], v[1], v[2] + qd[i]
        else:
            w = w[0], w[1], w[2] + qd[i]
        w = frame.from_twisted(w)
        v = frame.from_twisted(v)
        velocities.append((w, v))
    return velocities


def _summed_angles(row: JointRow, angles: tuple[Scalar, Scalar, Scalar], q: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """Return a link's angle in its twisted axes: the angle before, reversed for opposed axes, plus the joint's own."""
    angle, c, s = angles
    if is_zero(row.sin_alpha) and float(row.cos_alpha) < 0:
        angle = -angle
        s = -s
    c, s = c * row.cos_theta - s * row.sin_theta, s * row.cos_theta + c * row.sin_theta
    return (angle if row.prismatic else q + angle), c, s


def _cos_sin(angles: tuple[Scalar, Scalar, Scalar]) -> tuple[Scalar, Scalar]:
    """Return cosine and sine of a sum: joint angles are added, the table's own enter by the addition theorem."""
    import casadi

    angle, c, s = angles
    if isinstance(angle, float):
        return c, s
    cos_q = casadi.cos(angle)
    sin_q = casadi.sin(angle)
    return cos_q * c - sin_q * s, sin_q * c + cos_q * s
