"""Seven joints with a spherical shoulder, axes 1, 2 and 3 that meet at right angles: its elbow, and joints that meet.

The arm is a :class:`dhkit.kinematics.chain.Chain`, whose first frame has its origin in the shoulder's point S.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dhkit.description.poses import inverse_pose
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.chain import Chain
from dhkit.kinematics.closed_form.family import Parameter, PoseSymbols, Vector
from dhkit.kinematics.closed_form.formulas import (
    BOUNDARY_SHARE,
    SINGULAR,
    SX,
    Pair,
    add_angles,
    fabs,
    hypot,
    if_else,
    logic_and,
    logic_or,
    positive_part,
    sqrt,
    turned_about_x,
    turned_about_z,
    two_link,
    unit_pair,
    weighted_sum,
)
from dhkit.symbolic.differentiable.vectors import dot

SIGNS = (1.0, -1.0)
RIGHT_ANGLE = 1e-12
"""Cosine below which an angle is a right one, as of parallel axes in :mod:`dhkit.kinematics.axes`."""


def shoulder_parameters(axes: Axes) -> dict[str, Parameter] | None:
    """Return the parameters of an arm with a spherical shoulder and axes 5 and 6 that meet; None for another one."""
    if axes.kinds != "RRRRRRR":
        return None
    if not (axes.perpendicular(1, 2) and axes.perpendicular(2, 3)):
        return None
    shoulder = axes.meeting_point(1, 2)
    if shoulder is None or not axes.on(3, shoulder) or axes.meeting_point(5, 6) is None:
        return None
    if axes.parallel(3, 4) or axes.parallel(4, 5):
        return None

    chain = Chain.of(axes)
    # S as seen from link 3, and the point O where axes 5 and 6 meet at theta_4 = 0; joint 4 turns O about z.
    cos_3, sin_3 = exact_pair(chain.alpha[2])
    cos_4, sin_4 = exact_pair(chain.alpha[3])
    upper = (-chain.a[2], -sin_3 * chain.d[2], -cos_3 * chain.d[2])
    fore = (chain.a[3], -sin_4 * chain.d[4], chain.d[3] + cos_4 * chain.d[4])
    lengths = (np.hypot(*upper[:2]), np.hypot(*fore[:2]))
    if min(lengths) <= axes.tolerance * axes.scale:
        return None
    return {
        "T_first_world": inverse_pose(chain.T_world_first)[:3],
        "T_tool_last": inverse_pose(chain.T_last_tool)[:3],
        **{f"offset{i + 1}": exact_pair(chain.offset[i]) for i in range(7)},
        **{f"alpha{i + 1}": exact_pair(chain.alpha[i]) for i in range(6)},
        "upper": upper,
        "fore": fore,
        "L2": lengths[0],
        "L3": lengths[1],
        "straight": exact_pair(np.arctan2(-upper[1], -upper[0]) - np.arctan2(fore[1], fore[0])),
        "reach": axes.scale,
    }


@dataclass(frozen=True)
class Elbow:
    """Joint 4 bent to one side."""

    theta_4: Pair
    shoulder: Vector
    """S as seen from link 3 turned by theta_4, in whose axes O is at ``fore``, m."""
    to_shoulder: Vector
    """S - O as seen from link 4, whose z axis is axis 5."""
    miss: SX
    singular: SX
    clamped: SX


def elbow_bent(p: Mapping[str, SX], centre: Vector, bend: float, pose: PoseSymbols) -> Elbow:
    """Return joint 4, which gives O its distance from S, the origin.

    Seen along axis 4 the two are at the ends of two links; along it their distance does not change.
    """
    along = p["fore"][2] - p["upper"][2]
    distance = sqrt(dot(centre, centre))
    short = fabs(along) - distance
    across = sqrt(positive_part((distance - fabs(along)) * (distance + fabs(along))))
    links = two_link(across, 0.0, p["L2"], p["L3"], pose.scale)
    bent = links.between[1 if bend > 0 else 0]
    theta_4 = add_angles(bent, p["straight"])

    upper = turned_about_z(p["upper"], theta_4, -1.0)
    to_shoulder = turned_about_x(weighted_sum((1.0, -1.0), (upper, p["fore"])), p["alpha4"], -1.0)
    too_near = if_else(short > BOUNDARY_SHARE * pose.scale, short, 0.0)
    return Elbow(
        theta_4,
        upper,
        to_shoulder,
        miss=hypot(links.miss, too_near),
        singular=links.straight,
        clamped=logic_or(links.clamped, logic_and(short > 0, too_near <= 0)),
    )


def sign_names(joint: int, offset: float) -> tuple[str, str]:
    """Return the names of the solutions with positive and negative sine of theta_i = q_i + offset, such as q2+ and q2-.

    For an offset of 0 or pi the joint has the sign that they tell.
    """
    names = (f"q{joint}+", f"q{joint}-")
    return names if np.cos(offset) > 0 else names[::-1]


def three_joints(
    z: Vector, x: Vector, twists: tuple[Pair, Pair], side: float, free: Pair = (1.0, 0.0)
) -> tuple[tuple[Pair, Pair, Pair], SX]:
    """Return three joint angles whose axes meet at right angles, and whether the first and the last nearly coincide.

    The rotation Rz(theta_1) Rx(alpha_1) Rz(theta_2) Rx(alpha_2) Rz(theta_3) has, with twists of +-90 degrees, the third
    column

        z = Rz(theta_1) (sin(theta_2) sin(alpha_2), 0, -cos(theta_2) sin(alpha_1) sin(alpha_2)).

    Parameters
    ----------
    z, x
        Third and first column of the rotation.
    twists
        alpha_1 and alpha_2.
    side
        Sign of sin(theta_2).
    free
        theta_1 where the first and the last axis coincide.
    """
    first_twist, second_twist = twists
    sin_1 = first_twist[1]
    sin_2 = second_twist[1]
    across = hypot(z[0], z[1])
    theta_2 = unit_pair(-z[2] * sin_1 * sin_2, side * across)
    theta_1 = unit_pair(side * sin_2 * z[0], side * sin_2 * z[1], 1.0, free)

    back = turned_about_x(turned_about_z(x, theta_1, -1.0), first_twist, -1.0)
    back = turned_about_x(turned_about_z(back, theta_2, -1.0), second_twist, -1.0)
    theta_3 = unit_pair(back[0], back[1])
    return (theta_1, theta_2, theta_3), across < SINGULAR


def exact_pair(angle: float) -> tuple[float, float]:
    """Return cosine and sine of an angle, exact for right angles."""
    cosine = float(np.cos(angle))
    sine = float(np.sin(angle))
    if abs(cosine) < RIGHT_ANGLE:
        return 0.0, float(np.sign(sine))
    return cosine, sine
