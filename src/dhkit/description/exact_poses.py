"""Rigid transforms with exact entries: what moving a body, a tool or a locked joint needs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dhkit.description.bodies import ExactPose, vector
from dhkit.description.poses import pose_parts
from dhkit.description.values import Convention, Joint, Placement
from dhkit.expressions import ZERO, Expression, arc_tangent, cos, decimals, exact, exact_angle, sin, sqrt, substitute

ONE = Expression.number(1)


def identity() -> ExactPose:
    """Return the pose that moves nothing."""
    return np.array([[ONE if i == j else ZERO for j in range(4)] for i in range(4)], dtype=object)


def _plane_rotation(first: int, second: int, angle: Expression) -> ExactPose:
    T = identity()
    c, s = decimals(cos(angle)), decimals(sin(angle))
    T[first, first], T[first, second], T[second, first], T[second, second] = c, -s, s, c
    return T


def rotation_x(angle: Expression) -> ExactPose:
    """Rotate about x."""
    return _plane_rotation(1, 2, angle)


def rotation_y(angle: Expression) -> ExactPose:
    """Rotate about y."""
    return _plane_rotation(2, 0, angle)


def rotation_z(angle: Expression) -> ExactPose:
    """Rotate about z."""
    return _plane_rotation(0, 1, angle)


def translation(x: Expression = ZERO, y: Expression = ZERO, z: Expression = ZERO) -> ExactPose:
    """Move along the axes."""
    T = identity()
    T[:3, 3] = x, y, z
    return T


def pose_of(placement: Placement, values: Mapping[str, Expression] | None = None) -> ExactPose:
    """Return the transform of an origin and fixed-axis angles, with parameters replaced by ``values``."""
    known = values or {}
    x, y, z = (substitute(entry, known) for entry in placement.xyz)
    roll, pitch, yaw = (exact_angle(substitute(entry, known)) for entry in placement.rpy)
    T: ExactPose = translation(x, y, z) @ rotation_z(yaw) @ rotation_y(pitch) @ rotation_x(roll)
    return T


def placement_of(T: ExactPose) -> Placement:
    """Return origin and fixed-axis angles of a transform, by arc tangents alone (an arc sine would lose 1e-9).

    Exact where the angles are parts of a turn or hold parameters. Elsewhere they are taken in floats, one after the
    other: near gimbal lock each by itself would be off by far more than all of them together.
    """
    R = T[:3, :3]
    level = R[0, 0] * R[0, 0] + R[1, 0] * R[1, 0]
    if level.is_zero:
        # At +-90 degrees of pitch roll and yaw turn about one axis: yaw is chosen 0.
        roll, yaw = arc_tangent(-R[1, 2], R[1, 1]), ZERO
    else:
        roll, yaw = arc_tangent(R[2, 1], R[2, 2]), arc_tangent(R[1, 0], R[0, 0])
    angles = roll, arc_tangent(-R[2, 0], sqrt(level)), yaw
    has_symbols = any(entry.symbols for entry in R.flat)
    if not has_symbols and any(angle.half_turns is None for angle in angles):
        _, euler = pose_parts(np.array([[float(entry) for entry in row] for row in T]), order="ZYX")
        yaw, pitch, roll = (exact_angle(exact(float(angle))) for angle in euler)
        angles = roll, pitch, yaw
    return Placement(vector(T[:3, 3]), angles)


def inverse(T: ExactPose) -> ExactPose:
    """Return the inverse of a rigid transform."""
    R = T[:3, :3]
    result = identity()
    result[:3, :3] = R.T
    result[:3, 3] = -(R.T @ T[:3, 3])
    return result


def moved(placement: Placement, T: ExactPose) -> Placement:
    """Return where a placement comes to lie when its frame is moved by T."""
    return placement_of(T @ pose_of(placement))


def fixed_row(joint: Joint, convention: Convention, q: Expression = ZERO) -> ExactPose:
    """Return A_i of a row with its joint standing at q."""
    theta, d = (joint.theta + q, joint.d) if joint.is_revolute else (joint.theta, joint.d + q)
    along_z = rotation_z(theta) @ translation(z=d)
    along_x = translation(x=joint.a) @ rotation_x(joint.alpha)
    T: ExactPose = along_z @ along_x if convention is Convention.STANDARD else along_x @ along_z
    return T
