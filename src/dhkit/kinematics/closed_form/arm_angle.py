"""Seven joints with a spherical shoulder and a spherical wrist (axes 5, 6 and 7 meet), at a given arm angle.

KUKA's iiwa and LBR arms are of this kind. The wrist's centre W is known. Its distance from the shoulder S gives joint
4. The arm then turns about the line from S to W: the arm angle psi is that of axis 4 about this line, counted from the
direction at right angles to axis 1. With it the rotation of link 3 is known, and with that the joints of the shoulder
and the wrist (Shimizu et al. 2008, Analytical inverse kinematic computation for 7-DOF redundant manipulators with joint
limits, IEEE Trans. Robotics 24; there psi is that of the elbow).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

from dhkit.kinematics.axes import Axes
from dhkit.kinematics.chain import Chain
from dhkit.kinematics.closed_form.family import Fit, PoseSymbols, Vector
from dhkit.kinematics.closed_form.formulas import (
    SX,
    Branch,
    add_angles,
    angle,
    hypot,
    if_else,
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
    shoulder_parameters,
    sign_names,
    three_joints,
)
from dhkit.symbolic.differentiable.vectors import dot


def arm_angle_fit(axes: Axes) -> Fit | None:
    """Recognize seven joints with axes 1, 2 and 3 that meet at right angles, and axes 5, 6 and 7 that do."""
    parameters = shoulder_parameters(axes)
    if parameters is None:
        return None
    if not (axes.perpendicular(5, 6) and axes.perpendicular(6, 7)):
        return None
    chain = Chain.of(axes)
    wrist = axes.meeting_point(5, 6)
    if wrist is None or not axes.on(7, wrist):
        return None
    return Fit(
        geometry="spherical shoulder and wrist",
        parameters=parameters,
        branches=tuple(
            f"{second} {fourth} {sixth}"
            for fourth, sixth, second in product(
                ("q4+", "q4-"),
                sign_names(6, chain.offset[5]),
                sign_names(2, chain.offset[1]),
            )
        ),
        free_joint=6,
    )


def arm_angle_formulas(p: Mapping[str, SX], pose: PoseSymbols) -> list[Branch]:
    """Return the eight branches at psi = ``pose.free``: joint 4 bent to either side, then joint 6, then joint 2."""
    free_1 = add_angles(pose.free_1, p["offset1"])
    free_5 = add_angles(pose.free_5, p["offset5"])
    branches: list[Branch] = []
    for arm in bent_arms(p, pose):
        elbow = arm.elbow
        x_3, _, z_3 = arm.shoulder
        x_7, _, z_7 = arm.wrist
        for side in SIGNS:
            wrist, wrist_is_singular = three_joints(
                z_7, x_7, (p["alpha5"], p["alpha6"]), side, free_5
            )
            for tilt in SIGNS:
                first, shoulder_is_singular = three_joints(
                    z_3, x_3, (p["alpha1"], p["alpha2"]), tilt, free_1
                )
                joints = [
                    angle(add_angles(theta, p[f"offset{i}"], -1.0))
                    for i, theta in enumerate((*first, elbow.theta_4, *wrist), start=1)
                ]
                branches.append(
                    Branch(
                        tuple(joints),
                        miss=elbow.miss,
                        shoulder=shoulder_is_singular,
                        elbow=elbow.singular,
                        wrist=wrist_is_singular,
                        clamped=elbow.clamped,
                    )
                )
    return branches


@dataclass(frozen=True)
class BentArm:
    """Joint 4 bent to one side, and the rotations that the other joints make; their columns are x, y and z axes.

    All entries of the rotations are a + b cos(psi) + c sin(psi).
    """

    elbow: Elbow
    shoulder: tuple[Vector, Vector, Vector]
    """Rz(theta_1) Rx(alpha_1) Rz(theta_2) Rx(alpha_2) Rz(theta_3)."""
    wrist: tuple[Vector, Vector, Vector]
    """Rz(theta_5) Rx(alpha_5) Rz(theta_6) Rx(alpha_6) Rz(theta_7)."""


def bent_arms(p: Mapping[str, SX], pose: PoseSymbols) -> list[BentArm]:
    """Return the arm with joint 4 bent to either side, at psi = ``pose.free``."""
    T = pose.seen(p["T_first_world"], p["T_tool_last"])
    # The last frame has its origin in W: it is on axis 7, and a_6 = d_6 = 0.
    line = _line_frame(T.position, pose)
    arms = []
    for bend in SIGNS:
        elbow = elbow_bent(p, T.position, bend, pose)
        in_link_3 = _triangle_frame(p, elbow)

        # Vectors of link 3 in frame 0 and back: their coordinates in the triangle's directions stay.
        x_3, y_3, z_3 = (
            _carried(turned_about_x(axis, p["alpha3"], -1.0), in_link_3, line)
            for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        )
        x_7, y_7, z_7 = (
            turned_about_x(
                turned_about_z(_carried(axis, line, in_link_3), elbow.theta_4, -1.0),
                p["alpha4"],
                -1.0,
            )
            for axis in T.rotation
        )
        arms.append(BentArm(elbow, (x_3, y_3, z_3), (x_7, y_7, z_7)))
    return arms


def _line_frame(W: Vector, pose: PoseSymbols) -> tuple[Vector, Vector, Vector]:
    """Return the direction from S to W, that of axis 4 across it, and their cross product, in frame 0.

    Where psi is 0, axis 4 is along z x W, with axis 1 along z; if W is on axis 1, along y.
    """
    x, y, z = W
    radius = hypot(x, y)
    cos_azimuth, sin_azimuth = unit_pair(x, y, pose.scale)
    sin_polar, cos_polar = unit_pair(radius, z, pose.scale)
    along = (sin_polar * cos_azimuth, sin_polar * sin_azimuth, cos_polar)
    level = (-sin_azimuth, cos_azimuth, 0.0)
    # along x level, which is the vertical for a level line.
    up = (-cos_polar * cos_azimuth, -cos_polar * sin_azimuth, sin_polar)
    c, s = pose.free
    across = weighted_sum((c, s), (level, up))
    third = weighted_sum((c, -s), (up, level))
    return along, across, third


def _carried(
    vector: Vector, start: tuple[Vector, Vector, Vector], end: tuple[Vector, Vector, Vector]
) -> Vector:
    """Return the vector that has the coordinates in the directions ``end`` that the given one has in ``start``."""
    coordinates = (dot(start[0], vector), dot(start[1], vector), dot(start[2], vector))
    return weighted_sum(coordinates, end)


def _triangle_frame(p: Mapping[str, SX], elbow: Elbow) -> tuple[Vector, Vector, Vector]:
    """Return the same directions as seen from link 3."""
    # In the axes of link 3 turned by theta_4, O = W is at ``fore`` and S at ``elbow.shoulder``; z is axis 4.
    x, y, z = weighted_sum((1.0, -1.0), (p["fore"], elbow.shoulder))
    length = sqrt(x * x + y * y + z * z)
    over = 1.0 / if_else(length > 0, length, 1.0)
    radius = hypot(x, y)
    cosine, sine = unit_pair(x, y, p["reach"])
    height = z * over
    share = radius * over
    along = (share * cosine, share * sine, height)
    across = (-height * cosine, -height * sine, share)
    third = (sine, -cosine, 0.0)
    along, across, third = (
        turned_about_z(vector, elbow.theta_4) for vector in (along, across, third)
    )
    return along, across, third
