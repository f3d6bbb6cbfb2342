"""Six joints with a spherical wrist (axes 4, 5 and 6 meet in one point) on an arm that moves in a plane.

The regional structure puts the wrist's centre in place: two parallel revolute axes (PUMA, KUKA, ABB, Fanuc, Adept) or a
revolute and a prismatic one (Stanford). The wrist then turns the tool (Pieper, The Kinematics of Manipulators under
Computer Control, 1968; branches as in Lee & Ziegler, IEEE Trans. AES 20, 1984, but read off the geometry).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dhkit.description import Array
from dhkit.kinematics.axes import Axes, inverse_pose
from dhkit.kinematics.closed_form.arm_plane import (
    FLIPS,
    ArmPlane,
    Shoulder,
    Vector,
    as_pair,
    branch_names,
    ordered_shoulders,
    turned_back,
)
from dhkit.kinematics.closed_form.family import ALL, Fit, Parameter, PoseSymbols
from dhkit.kinematics.closed_form.formulas import (
    ROUNDING,
    SINGULAR,
    SX,
    Branch,
    Pair,
    absolute,
    angle,
    both,
    chosen,
    either,
    half_turn,
    hypot,
    no,
    positive,
    rotated,
    sign,
    sqrt,
    times,
    two_link,
    unit,
    where,
    wrapped,
)

__all__ = ["elbow_fit", "elbow_formulas", "slide_fit", "slide_formulas"]


@dataclass(frozen=True)
class Region:
    """One way of the first three joints to put the wrist's centre in place."""

    q: tuple[SX, SX, SX]
    rho: Pair
    """How far link 3 has turned about v since zero joint values."""
    shoulder: Shoulder
    miss: SX
    elbow: SX
    clamped: SX


def elbow_fit(axes: Axes) -> Fit | None:
    """Recognise an arm with parallel axes 2 and 3."""
    if axes.kinds != "RRRRRR" or not (axes.perpendicular(1, 2) and axes.parallel(2, 3)):
        return None
    centre = _wrist_centre(axes)
    if centre is None:
        return None
    plane = ArmPlane.of(axes)
    second, third, wrist = (plane.coordinates(point) for point in (axes.point(2), axes.point(3), centre))
    upper, fore = third[:2] - second[:2], wrist[:2] - third[:2]
    if min(np.linalg.norm(upper), np.linalg.norm(fore)) <= axes.tolerance * axes.scale:
        return None
    upper_pair, fore_pair = as_pair(*upper), as_pair(*fore)
    geometry = {
        "a1": second[0],
        "offset": axes.snapped(wrist[2]),
        "L2": np.linalg.norm(upper),
        "L3": np.linalg.norm(fore),
        "upper": upper_pair,
        "bend": times(fore_pair, upper_pair, -1.0),
        "sense3": axes.sense(2, 3),
    }
    return Fit(
        words="spherical wrist, axes 2 and 3 parallel",
        parameters=_parameters(axes, plane, centre) | geometry,
        branches=branch_names(geometry["offset"], ("up", "down"), FLIPS),
        met=ALL,
        free=3,
    )


def elbow_formulas(p: Mapping[str, SX], pose: PoseSymbols) -> list[Branch]:
    """Return the eight branches: shoulder, then elbow, then wrist."""
    T = pose.seen(p["T_plane_world"], p["T_tool_wrist"])
    branches = []
    for shoulder in ordered_shoulders(p, T.position, pose.scale):
        x, u = shoulder.x - p["a1"], T.position[1]
        arm = two_link(x, u, p["L2"], p["L3"], pose.scale)
        # The left elbow of the line to the wrist is the upper one where the wrist is in front of axis 2.
        front = sign(p["up"] * x)
        for raised in (front, -front):
            q2 = times(chosen(raised > 0, *arm.first), p["upper"], -1.0)
            bent = times(chosen(raised > 0, *arm.between), p["bend"], -1.0)
            region = Region(
                q=(angle(shoulder.q1), angle(q2), angle((bent[0], p["sense3"] * bent[1]))),
                rho=times(q2, bent),
                shoulder=shoulder,
                miss=hypot(shoulder.miss, arm.miss),
                elbow=arm.straight,
                clamped=either(shoulder.clamped, arm.clamped),
            )
            branches += _with_wrist(p, T.rotation, region, pose.free)
    return branches


def slide_fit(axes: Axes) -> Fit | None:
    """Recognise an arm whose third joint slides at right angles to axis 2."""
    if axes.kinds != "RRPRRR" or not (axes.perpendicular(1, 2) and axes.perpendicular(2, 3)):
        return None
    centre = _wrist_centre(axes)
    if centre is None:
        return None
    plane = ArmPlane.of(axes)
    second, wrist = plane.coordinates(axes.point(2)), plane.coordinates(centre)
    along = plane.R @ axes.direction(3)
    lever = wrist[:2] - second[:2]
    geometry = {
        "a1": second[0],
        "offset": axes.snapped(wrist[2]),
        "boom": as_pair(along[0], along[1]),
        "start": lever @ along[:2],
        "lift": along[0] * lever[1] - along[1] * lever[0],
    }
    return Fit(
        words="spherical wrist, joint 3 slides at right angles to axis 2",
        parameters=_parameters(axes, plane, centre) | geometry,
        branches=branch_names(geometry["offset"], ("out", "in"), FLIPS),
        met=ALL,
        free=3,
    )


def slide_formulas(p: Mapping[str, SX], pose: PoseSymbols) -> list[Branch]:
    """Return the eight branches: shoulder, then boom, then wrist."""
    T = pose.seen(p["T_plane_world"], p["T_tool_wrist"])
    branches = []
    for shoulder in ordered_shoulders(p, T.position, pose.scale):
        x, u = shoulder.x - p["a1"], T.position[1]
        R, lift = hypot(x, u), absolute(p["lift"])
        short = lift - R
        beyond = short > ROUNDING * pose.scale
        square = (R - lift) * (R + lift)
        length = sqrt(positive(square))
        for along in (length, -length):
            # The wrist is at e^(i q2) boom (along + i lift) from axis 2.
            q2 = times(unit(x, u, pose.scale), times(p["boom"], unit(along, p["lift"], pose.scale)), -1.0)
            region = Region(
                q=(angle(shoulder.q1), angle(q2), along - p["start"]),
                rho=q2,
                shoulder=shoulder,
                miss=hypot(shoulder.miss, where(beyond, short, 0.0)),
                elbow=length < SINGULAR * p["reach"],
                clamped=either(shoulder.clamped, both(square < 0, no(beyond))),
            )
            branches += _with_wrist(p, T.rotation, region, pose.free)
    return branches


def _wrist_centre(axes: Axes) -> Array | None:
    """Return where the last three axes meet, if the middle one is at right angles to its neighbours."""
    if not (axes.perpendicular(4, 5) and axes.perpendicular(5, 6)):
        return None
    centre = axes.meeting_point(4, 5)
    return centre if centre is not None and axes.on(6, centre) else None


def _parameters(axes: Axes, plane: ArmPlane, centre: Array) -> dict[str, Parameter]:
    """Return what both regional structures need: where plane and wrist are, and the wrist's axes at zero."""
    z4, z5, z6 = (axes.direction(i) for i in (4, 5, 6))
    T_world_wrist = np.eye(4)
    T_world_wrist[:3, :3] = np.stack([z6, z5, np.cross(z6, z5)], axis=1)
    T_world_wrist[:3, 3] = centre
    wrist = as_pair(float(z4 @ z6), float(z5 @ np.cross(z4, z6)))
    return {
        "T_plane_world": plane.T[:3],
        "T_tool_wrist": (inverse_pose(axes.T_world_tool) @ T_world_wrist)[:3],
        "F": np.stack([np.cross(z5, z4), z5, z4]) @ plane.R.T + 0.0,
        "wrist": wrist,
        "straight": np.angle(complex(*wrist) ** 2),
        "up": plane.up,
        "reach": axes.scale,
    }


def _with_wrist(
    p: Mapping[str, SX], rotation: tuple[Vector, Vector, Vector], region: Region, free: Pair
) -> list[Branch]:
    """Return the two branches of the wrist: no flip (joint 5 turned to its positive side), and flip.

    Where axes 4 and 6 coincide, q4 is ``free``.
    """
    F = p["F"]

    def seen(vector: Vector) -> Vector:
        return rotated(F, turned_back(vector, region.shoulder.q1, region.rho))

    # Where axis 6, axis 5's first direction and their product have gone, in the axes of the wrist at zero.
    a, n, m = (seen(vector) for vector in rotation)
    swing = hypot(a[0], a[1])
    q4 = unit(a[0], a[1], otherwise=free)
    # From here on everything is taken from the rotation that q4 leaves over: it closes whatever q4 is.
    bend = unit(q4[0] * a[0] + q4[1] * a[1], a[2])
    alpha = (bend[1], bend[0])
    q5 = times(alpha, p["wrist"], -1.0)
    q6 = unit(q4[0] * n[1] - q4[1] * n[0], q4[1] * m[0] - q4[0] * m[1])
    roll, pitch, spin = angle(q4), angle(q5), angle(q6)
    flags = {
        "miss": region.miss,
        "shoulder": region.shoulder.singular,
        "elbow": region.elbow,
        "wrist": swing < SINGULAR,
        "clamped": region.clamped,
    }
    return [
        Branch((*region.q, roll, pitch, spin), **flags),
        Branch((*region.q, half_turn(roll), wrapped(-pitch - p["straight"]), half_turn(spin)), **flags),
    ]
