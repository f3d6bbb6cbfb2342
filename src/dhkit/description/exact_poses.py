"""Rigid transforms with exact entries, shape (4, 4), m: for moved bodies, tools and locked joints."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dhkit.description.bodies import ExactPose, settled_vector
from dhkit.description.poses import pose_parts
from dhkit.description.values import ONE, Convention, Joint, Placement
from dhkit.expressions import (
    ZERO,
    Expression,
    arc_tangent,
    cos,
    decimals,
    exact,
    exact_angle,
    sin,
    sqrt,
    substitute,
)


def identity() -> ExactPose:
    """Return the identity transform."""
    T: ExactPose = np.full((4, 4), ZERO, dtype=object)
    np.fill_diagonal(T, ONE)
    return T


def _plane_rotation(first: int, second: int, angle: Expression) -> ExactPose:
    """Return the rotation from the first axis towards the second by an angle, rad."""
    T = identity()
    c = decimals(cos(angle))
    s = decimals(sin(angle))
    T[first, first] = c
    T[first, second] = -s
    T[second, first] = s
    T[second, second] = c
    return T


def rotation_x(angle: Expression) -> ExactPose:
    """Return the rotation about x by an angle, rad."""
    return _plane_rotation(1, 2, angle)


def rotation_z(angle: Expression) -> ExactPose:
    """Return the rotation about z by an angle, rad."""
    return _plane_rotation(0, 1, angle)


def translation(x: Expression = ZERO, y: Expression = ZERO, z: Expression = ZERO) -> ExactPose:
    """Return the translation along the axes, m."""
    T = identity()
    T[:3, 3] = x, y, z
    return T


def pose_of(placement: Placement, values: Mapping[str, Expression] | None = None) -> ExactPose:
    """Return the transform of an origin, m, and fixed-axis angles, rad, with parameters replaced by ``values``."""
    known = values or {}
    # T(x, y, z) Rz(yaw) Ry(pitch) Rx(roll)
    x, y, z = (substitute(entry, known) for entry in placement.xyz)
    roll, pitch, yaw = (exact_angle(substitute(entry, known)) for entry in placement.rpy)
    T: ExactPose = (
        translation(x, y, z) @ rotation_z(yaw) @ _plane_rotation(2, 0, pitch) @ rotation_x(roll)
    )
    return T


def placement_of(T: ExactPose) -> Placement:
    """Return origin, m, and fixed-axis angles, rad, of a transform, by arc tangents alone (an arc sine loses 1e-9).

    The angles are exact where they are rational parts of a turn or hold parameters. Otherwise all three are computed
    in floats, one from the other: near gimbal lock the errors of three separate angles would add up.
    """
    # R = Rz(yaw) Ry(pitch) Rx(roll) has, with c and s for cosines and sines,
    #     first column: (c_pitch c_yaw, c_pitch s_yaw, -s_pitch),
    #     last row:     (-s_pitch, c_pitch s_roll, c_pitch c_roll).
    R = T[:3, :3]
    level = R[0, 0] * R[0, 0] + R[1, 0] * R[1, 0]
    if level.is_zero:
        # At +-90 degrees of pitch, roll and yaw rotate about one axis: yaw is chosen 0, and the second row of R is then
        # (0, c_roll, -s_roll).
        roll = arc_tangent(-R[1, 2], R[1, 1])
        yaw = ZERO
    else:
        roll = arc_tangent(R[2, 1], R[2, 2])
        yaw = arc_tangent(R[1, 0], R[0, 0])
    angles = roll, arc_tangent(-R[2, 0], sqrt(level)), yaw
    has_symbols = any(entry.symbols for entry in R.ravel().tolist())
    if not has_symbols and any(angle.half_turns is None for angle in angles):
        _, euler = pose_parts(T.astype(float), order="ZYX")
        yaw, pitch, roll = (exact_angle(exact(float(angle))) for angle in euler)
        angles = roll, pitch, yaw
    return Placement(settled_vector(T[:3, 3]), angles)


def inverse(T: ExactPose) -> ExactPose:
    """Return the inverse of a rigid transform, (R^T, -R^T p)."""
    result = identity()
    result[:3, :3] = T[:3, :3].T
    result[:3, 3] = -(T[:3, :3].T @ T[:3, 3])
    return result


def moved(placement: Placement, T: ExactPose) -> Placement:
    """Return a placement in the frame that T maps its own frame to."""
    return placement_of(T @ pose_of(placement))


def fixed_row(joint: Joint, convention: Convention, q: Expression = ZERO) -> ExactPose:
    """Return A_i of a table's row with its joint variable at q, rad or m.

    A product of elementary exact transforms, derived independently of the closed form in floats of
    :func:`dhkit.description.link_transforms` and of the origins of :mod:`dhkit.model.urdf`.
    """
    # Standard: Rz(theta) Tz(d) Tx(a) Rx(alpha); modified: Tx(a) Rx(alpha) Rz(theta) Tz(d).
    theta, d = (joint.theta + q, joint.d) if joint.is_revolute else (joint.theta, joint.d + q)
    along_z = rotation_z(theta) @ translation(z=d)
    along_x = translation(x=joint.a) @ rotation_x(joint.alpha)
    T: ExactPose = along_z @ along_x if convention is Convention.STANDARD else along_x @ along_z
    return T
