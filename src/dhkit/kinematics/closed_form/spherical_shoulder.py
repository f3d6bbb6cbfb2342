"""Seven joints with a spherical shoulder (axes 1, 2 and 3 meet) and axes 5 and 6 that meet, at a given joint 7.

Franka's Panda and FR3 and UFACTORY's xArm 7 are of this kind. With q7 known, the point O where axes 5 and 6 meet is
known. Its distance from the shoulder S gives joint 4; S as seen from link 6 gives joints 6 and 5; the rotation that
remains gives joints 1, 2 and 3 (He and Liu 2021, Analytical inverse kinematics for Franka Emika Panda, IEEE ICRA, here
for any twists of the wrist).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

from dhkit.kinematics.axes import Axes
from dhkit.kinematics.chain import Chain
from dhkit.kinematics.closed_form.family import Fit, PoseSymbols, Vector
from dhkit.kinematics.closed_form.formulas import (
    BOUNDARY_SHARE,
    SINGULAR,
    SX,
    Branch,
    Pair,
    add_angles,
    angle,
    fabs,
    hypot,
    if_else,
    logic_and,
    logic_not,
    logic_or,
    positive_part,
    sqrt,
    turned_about_x,
    turned_about_z,
    unit_pair,
    weighted_sum,
)
from dhkit.kinematics.closed_form.seven_joints import (
    SIGNS,
    Elbow,
    elbow_bent,
    exact_pair,
    shoulder_parameters,
    sign_names,
    three_joints,
)
from dhkit.symbolic.differentiable.vectors import dot


def spherical_shoulder_fit(axes: Axes) -> Fit | None:
    """Recognize seven joints with axes 1, 2 and 3 that meet at right angles, and axes 5 and 6 that meet."""
    parameters = shoulder_parameters(axes)
    if parameters is None:
        return None
    # O as seen from frame 6, whose origin is on axis 7.
    chain = Chain.of(axes)
    cos_6, sin_6 = exact_pair(chain.alpha[5])
    parameters["centre"] = (-chain.a[5], -sin_6 * chain.d[5], -cos_6 * chain.d[5])
    return Fit(
        geometry="spherical shoulder, axes 5 and 6 meet",
        parameters=parameters,
        branches=tuple(
            f"{second} {fourth} {side}"
            for fourth, side, second in product(
                ("q4+", "q4-"), ("front", "back"), sign_names(2, chain.offset[1])
            )
        ),
        free_joint=6,  # q7
    )


def spherical_shoulder_formulas(p: Mapping[str, SX], pose: PoseSymbols) -> list[Branch]:
    """Return the eight branches at q7 = ``pose.free``: joint 4 bent to either side, then joint 6, then joint 2.

    Joint 4 is beyond its position in the stretched arm (``q4+``) or before it, the shoulder in front of the plane of
    axes 5 and 6 (on the side of axis 5 x axis 6) or at its back, and q2 positive or negative.
    """
    link_6, centre, to_shoulder = at_joint_7(p, pose)
    free_1 = add_angles(pose.free_1, p["offset1"])
    branches: list[Branch] = []
    for bend in SIGNS:
        elbow = elbow_bent(p, centre, bend, pose)
        for side in SIGNS:
            wrist = _wrist(p, elbow, to_shoulder, side, pose)

            def in_world(vector: Vector, elbow: Elbow = elbow, wrist: _Wrist = wrist) -> Vector:
                """Return a vector of link 3 in frame 0: through joints 4, 5 and 6 to link 6."""
                for theta, twist in (
                    (elbow.theta_4, p["alpha4"]),
                    (wrist.theta_5, p["alpha5"]),
                    (wrist.theta_6, p["alpha6"]),
                ):
                    vector = turned_about_x(turned_about_z(vector, theta, -1.0), twist, -1.0)
                return weighted_sum(vector, link_6)

            # The rotation of link 3 without its twist.
            z_3 = in_world(turned_about_x((0.0, 0.0, 1.0), p["alpha3"], -1.0))
            x_3 = in_world((1.0, 0.0, 0.0))
            for tilt in SIGNS:
                first, is_singular = three_joints(
                    z_3, x_3, (p["alpha1"], p["alpha2"]), tilt, free_1
                )
                thetas = (*first, elbow.theta_4, wrist.theta_5, wrist.theta_6)
                joints = [
                    angle(add_angles(theta, p[f"offset{i}"], -1.0))
                    for i, theta in enumerate(thetas, start=1)
                ]
                branches.append(
                    Branch(
                        (*joints, angle(pose.free)),
                        miss=hypot(elbow.miss, wrist.miss),
                        shoulder=is_singular,
                        elbow=elbow.singular,
                        wrist=wrist.singular,
                        clamped=logic_or(elbow.clamped, wrist.clamped),
                    )
                )
    return branches


def at_joint_7(
    p: Mapping[str, SX], pose: PoseSymbols
) -> tuple[tuple[Vector, Vector, Vector], Vector, Vector]:
    """Return frame 6's axes, O in frame 0, and S - O as seen from link 6 before its twist, at q7 = ``pose.free``."""
    T = pose.seen(p["T_first_world"], p["T_tool_last"])
    # Frame 6 is the last frame turned back by theta_7.
    c, s = add_angles(pose.free, p["offset7"])
    x, y, z = T.rotation
    link_6 = (weighted_sum((c, -s), (x, y)), weighted_sum((s, c), (x, y)), z)
    centre = weighted_sum((1.0, *p["centre"]), (T.position, *link_6))
    seen = tuple(-dot(axis, centre) for axis in link_6)
    return link_6, centre, turned_about_x(seen, p["alpha6"])


@dataclass(frozen=True)
class _Wrist:
    """Joints 5 and 6 for one elbow."""

    theta_5: Pair
    theta_6: Pair
    miss: SX
    singular: SX
    clamped: SX


def _wrist(
    p: Mapping[str, SX], elbow: Elbow, seen_from_6: Vector, side: float, pose: PoseSymbols
) -> _Wrist:
    """Return joints 5 and 6, which turn S - O as seen from link 6 into what link 4 sees, g.

    With w = Rz(theta_6) s and h = Rx(alpha_5) w, g = Rz(theta_5) h. Joint 5 does not change the third entry:

        g_z = sin(alpha_5) w_y + cos(alpha_5) s_z.

    The first follows from the lengths, of which the shorter is the more accurate:

        w_x^2 + w_y^2 = s_x^2 + s_y^2,    h_x^2 + h_y^2 = g_x^2 + g_y^2,    h_x = w_x.
    """
    g_x, g_y, g_z = elbow.to_shoulder
    s_x, s_y, s_z = seen_from_6
    cos_5, sin_5 = p["alpha5"]
    w_y = (g_z - cos_5 * s_z) / sin_5
    h_y = cos_5 * w_y - sin_5 * s_z

    of_w = hypot(s_x, s_y)
    of_h = hypot(g_x, g_y)
    by_w = of_w < of_h
    length = if_else(by_w, of_w, of_h)
    other = fabs(if_else(by_w, w_y, h_y))
    excess = other - length
    beyond = excess > BOUNDARY_SHARE * pose.scale
    w_x = side * sqrt(positive_part((length - other) * (length + other)))

    theta_6 = add_angles(unit_pair(w_x, w_y, pose.scale), unit_pair(s_x, s_y, pose.scale), -1.0)
    theta_5 = add_angles(unit_pair(g_x, g_y, pose.scale), unit_pair(w_x, h_y, pose.scale), -1.0)
    return _Wrist(
        theta_5,
        theta_6,
        miss=if_else(beyond, excess, 0.0),
        singular=fabs(w_x) < SINGULAR * p["reach"],
        clamped=logic_and(excess > 0, logic_not(beyond)),
    )
