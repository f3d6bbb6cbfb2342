"""Arms of two to four joints whose first joint turns a plane: pan and tilt, yaw with two or three parallel joints."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dhkit.kinematics.axes import Axes
from dhkit.kinematics.closed_form.arm_plane import (
    ArmPlane,
    Shoulder,
    as_pair,
    branch_names,
    ordered_shoulders,
    to_arm_frame,
)
from dhkit.kinematics.closed_form.family import Fit, Parameter, PoseSymbols
from dhkit.kinematics.closed_form.formulas import (
    SINGULAR,
    SX,
    Branch,
    Pair,
    add_angles,
    angle,
    hypot,
    logic_or,
    unit_pair,
    weighted_sum,
)
from dhkit.kinematics.closed_form.links import ELBOWS, elbows, link_parameters

_IDENTITY = np.eye(4)[:3]
"""Pose of the tool in itself, without the last row, shape (3, 4)."""


def pan_tilt_fit(axes: Axes) -> Fit | None:
    """Recognize two joints at right angles; the tool off axis 2."""
    if axes.kinds != "RR" or not axes.perpendicular(1, 2):
        return None
    plane = ArmPlane.of(axes)
    second = plane.coordinates(axes.point(2))
    tool = plane.coordinates(axes.T_world_tool[:3, 3])
    lever = tool[:2] - second[:2]
    if np.linalg.norm(lever) <= axes.tolerance * axes.scale:
        return None
    return Fit(
        geometry="pan and tilt: axes 1 and 2 at right angles",
        parameters=_common(axes, plane)
        | {"offset": axes.snapped(tool[2]), "a1": second[0], "lever": as_pair(*lever)},
        branches=branch_names(axes.snapped(tool[2])),
        coordinates=("azimuth", "elevation"),
    )


def pan_tilt_formulas(p: Mapping[str, SX], pose: PoseSymbols) -> list[Branch]:
    """Return the branches that aim: the tool lies in the direction of the pose's origin, at whatever distance.

    In the arm's plane, from axis 2: q2 = arg(x + i u) - arg(lever).
    """
    position = pose.seen(p["T_plane_world"], _IDENTITY).position
    branches = []
    for shoulder in ordered_shoulders(p, position, pose):
        x = shoulder.x - p["a1"]
        u = position[1]
        tilt = add_angles(unit_pair(x, u, pose.scale), p["lever"], -1.0)
        branches.append(
            Branch(
                (angle(shoulder.q1), angle(tilt)),
                miss=shoulder.miss,
                shoulder=shoulder.singular,
                elbow=hypot(x, u) < SINGULAR * p["reach"],
                clamped=shoulder.clamped,
            )
        )
    return branches


def yaw_two_fit(axes: Axes) -> Fit | None:
    """Recognize a turntable with two parallel joints."""
    if axes.kinds != "RRR" or not (axes.perpendicular(1, 2) and axes.parallel(2, 3)):
        return None
    plane = ArmPlane.of(axes)
    links = link_parameters(axes, plane, axes.T_world_tool[:3, 3])
    if links is None:
        return None
    return Fit(
        geometry="a turntable, axes 2 and 3 parallel",
        parameters=_common(axes, plane) | links,
        branches=branch_names(links["offset"], ELBOWS),
        coordinates=("x", "y", "z"),
    )


def yaw_two_formulas(p: Mapping[str, SX], pose: PoseSymbols) -> list[Branch]:
    """Return the four branches that put the tool's origin in place: shoulder, then elbow."""
    position = pose.seen(p["T_plane_world"], _IDENTITY).position
    branches = []
    for shoulder in ordered_shoulders(p, position, pose):
        branches += _branches(p, shoulder, shoulder.x - p["a1"], position[1], pose.scale, None, 0.0)
    return branches


def yaw_three_fit(axes: Axes) -> Fit | None:
    """Recognize a turntable with three parallel joints; the tool's z axis points, or its x axis if z is sideways."""
    if axes.kinds != "RRRR" or not (
        axes.perpendicular(1, 2) and axes.parallel(2, 3) and axes.parallel(2, 4)
    ):
        return None
    plane = ArmPlane.of(axes)
    links = link_parameters(axes, plane, axes.point(4))
    tool = plane.coordinates(axes.T_world_tool[:3, 3])
    if links is None:
        return None
    column = 2 if np.linalg.norm((plane.R @ axes.T_world_tool[:3, 2])[:2]) > 0.5 else 0
    pointing = plane.R @ axes.T_world_tool[:3, column]
    offset = axes.snapped(tool[2])
    own = {
        "offset": offset,
        "lever": tool[:2] - plane.coordinates(axes.point(4))[:2],
        "pointing": as_pair(pointing[0], pointing[1]),
        "axis": np.eye(3)[column],
        "sense4": axes.sense(2, 4),
    }
    return Fit(
        geometry="a turntable, axes 2, 3 and 4 parallel",
        parameters=_common(axes, plane) | links | own,
        branches=branch_names(offset, ELBOWS),
        coordinates=("x", "y", "z", f"pitch of the tool's {'xyz'[column]} axis"),
    )


def yaw_three_formulas(p: Mapping[str, SX], pose: PoseSymbols) -> list[Branch]:
    """Return the four branches that put the tool's origin in place and point it: shoulder, then elbow.

    The direction w of the tool's axis in the arm's plane gives the rotation of links 2 to 4, and with it the position
    of axis 4, which two links reach from axis 2:

        rho = q2 + q3 + q4 = arg(w) - pointing,    axis 4 at (x + i u) - e^(i rho) lever.
    """
    T = pose.seen(p["T_plane_world"], _IDENTITY)
    branches = []
    for shoulder in ordered_shoulders(p, T.position, pose):
        wanted = to_arm_frame(weighted_sum(p["axis"], T.rotation), shoulder.q1)
        rho = add_angles(unit_pair(wanted[0], wanted[1]), p["pointing"], -1.0)
        lever = add_angles(rho, p["lever"])
        x = shoulder.x - p["a1"] - lever[0]
        u = T.position[1] - lever[1]
        sideways = hypot(wanted[0], wanted[1]) < SINGULAR
        branches += _branches(p, shoulder, x, u, pose.scale, rho, sideways)
    return branches


def _branches(
    p: Mapping[str, SX], shoulder: Shoulder, x: SX, u: SX, scale: SX, rho: Pair | None, sideways: SX
) -> list[Branch]:
    """Return upper and lower elbow for a point at (x, u) from axis 2, m; with ``rho`` joint 4 is the rest of it."""
    branches = []
    for elbow in elbows(p, x, u, shoulder.q1, scale):
        joints = [angle(shoulder.q1), *elbow.joints]
        if rho is not None:
            rest = add_angles(rho, elbow.rotation, -1.0)
            joints.append(angle((rest[0], p["sense4"] * rest[1])))
        branches.append(
            Branch(
                tuple(joints),
                miss=hypot(shoulder.miss, elbow.miss),
                shoulder=shoulder.singular,
                elbow=elbow.singular,
                wrist=sideways,
                clamped=logic_or(shoulder.clamped, elbow.clamped),
            )
        )
    return branches


def _common(axes: Axes, plane: ArmPlane) -> dict[str, Parameter]:
    """Return the parameters that all arms of this file have."""
    return {"T_plane_world": plane.T[:3], "up": plane.up, "reach": axes.scale}
