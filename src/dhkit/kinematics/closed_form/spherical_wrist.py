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
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.closed_form.arm_plane import (
    FLIPS,
    ArmPlane,
    Shoulder,
    Vector,
    as_pair,
    branch_names,
    ordered_shoulders,
    to_arm_frame,
)
from dhkit.kinematics.closed_form.family import Fit, PoseSymbols
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
    turn_by_pi,
    unit_pair,
)
from dhkit.kinematics.closed_form.links import ELBOWS, elbows, link_parameters, link_range
from dhkit.kinematics.closed_form.wrist import (
    ill_determined,
    joints_5_and_6,
    wrist_axes,
    wrist_parameters,
)


@dataclass(frozen=True)
class _Region:
    """One solution of the first three joints for the position of the wrist's centre.

    Coordinates x, u lie in the arm's plane and v along its normal, see :class:`ArmPlane`.
    """

    q: tuple[SX, SX, SX]
    rho: Pair
    """Rotation of link 3 about v, counted from all joints at zero, as a pair (cos, sin)."""
    shoulder: Shoulder
    miss: SX
    """How far the wrist's centre is from what links 2 and 3 reach with joint 1 at this solution's angle, m."""
    elbow_is_singular: SX
    """Whether the arm is stretched, folded or drawn in."""
    clamped: SX
    """Whether the centre lies beyond the boundary by rounding only."""
    distance: SX | None = None
    """Distance of the centre from the nearest point reached with any angle of joint 1, m; ``miss`` if not given."""


def elbow_fit(axes: Axes) -> Fit | None:
    """Recognize an arm with parallel axes 2 and 3."""
    if axes.kinds != "RRRRRR" or not (axes.perpendicular(1, 2) and axes.parallel(2, 3)):
        return None
    centre = _wrist_centre(axes)
    if centre is None:
        return None
    plane = ArmPlane.of(axes)
    links = link_parameters(axes, plane, centre)
    if links is None:
        return None
    return Fit(
        geometry="spherical wrist, axes 2 and 3 parallel",
        parameters=wrist_parameters(axes, plane, axes.direction(4), centre) | links,
        branches=branch_names(links["offset"], ELBOWS, FLIPS),
        free_joint=3,
        wrist_distances=link_range(links),
    )


def elbow_formulas(p: Mapping[str, SX], pose: PoseSymbols) -> list[Branch]:
    """Return the eight branches: shoulder, then elbow, then wrist."""
    T = pose.seen(p["T_plane_world"], p["T_tool_wrist"])
    branches = []
    for shoulder in ordered_shoulders(p, T.position, pose):
        # From axis 2 the wrist's centre is at (x - a1, u) in the plane, and the nearest point that the links reach at
        # ``nearest``; joint 1 moves that one on a circle about axis 1.
        for elbow in elbows(p, shoulder.x - p["a1"], T.position[1], shoulder.q1, pose.scale):
            region = _Region(
                q=(angle(shoulder.q1), *elbow.joints),
                rho=elbow.rotation,
                shoulder=shoulder,
                miss=hypot(shoulder.miss, elbow.miss),
                elbow_is_singular=elbow.singular,
                clamped=logic_or(shoulder.clamped, elbow.clamped),
                distance=shoulder.distance_from_circle(
                    p["offset"], p["a1"] + elbow.nearest[0], T.position[1] - elbow.nearest[1]
                ),
            )
            branches += _with_wrist(p, T.rotation, region, pose)
    return branches


def slide_fit(axes: Axes) -> Fit | None:
    """Recognize an arm whose third joint slides at right angles to axis 2."""
    if axes.kinds != "RRPRRR" or not (axes.perpendicular(1, 2) and axes.perpendicular(2, 3)):
        return None
    centre = _wrist_centre(axes)
    if centre is None:
        return None
    plane = ArmPlane.of(axes)
    second = plane.coordinates(axes.point(2))
    wrist = plane.coordinates(centre)
    along = plane.R @ axes.direction(3)
    lever = wrist[:2] - second[:2]

    # As complex numbers x + i u: lever = boom (start + i lift), with |boom| = 1.
    geometry = {
        "a1": second[0],
        "offset": axes.snapped(wrist[2]),
        "boom": as_pair(along[0], along[1]),
        "start": lever @ along[:2],
        "lift": along[0] * lever[1] - along[1] * lever[0],
    }
    return Fit(
        geometry="spherical wrist, joint 3 slides at right angles to axis 2",
        parameters=wrist_parameters(axes, plane, axes.direction(4), centre) | geometry,
        branches=branch_names(geometry["offset"], ("out", "in"), FLIPS),
        free_joint=3,
        wrist_distances=(abs(float(geometry["lift"])), np.inf),
    )


def slide_formulas(p: Mapping[str, SX], pose: PoseSymbols) -> list[Branch]:
    """Return the eight branches: shoulder, then boom, then wrist.

    With the prismatic joint's extension s = start + q3, the wrist's centre is in the plane at

        e^(i q2) e^(i boom) (s + i lift) = x + i u    from axis 2, so that
        s = +-sqrt(R^2 - lift^2),    R = |x + i u|,    q2 = arg(x + i u) - boom - arg(s + i lift).
    """
    T = pose.seen(p["T_plane_world"], p["T_tool_wrist"])
    branches = []
    for shoulder in ordered_shoulders(p, T.position, pose):
        x = shoulder.x - p["a1"]
        u = T.position[1]
        R = hypot(x, u)
        lift = fabs(p["lift"])
        short = lift - R
        beyond = short > BOUNDARY_SHARE * pose.scale

        # R^2 - lift^2 as a product: the difference of squares would cancel where they are nearly equal.
        square = (R - lift) * (R + lift)
        length = sqrt(positive_part(square))

        for s in (length, -length):
            at_zero = add_angles(p["boom"], unit_pair(s, p["lift"], pose.scale))
            q2 = add_angles(unit_pair(x, u, pose.scale), at_zero, -1.0)
            region = _Region(
                q=(angle(shoulder.q1), angle(q2), s - p["start"]),
                rho=q2,
                shoulder=shoulder,
                miss=hypot(shoulder.miss, if_else(beyond, short, 0.0)),
                elbow_is_singular=length < SINGULAR * p["reach"],
                clamped=logic_or(shoulder.clamped, logic_and(square < 0, logic_not(beyond))),
            )
            branches += _with_wrist(p, T.rotation, region, pose)
    return branches


def _wrist_centre(axes: Axes) -> Array | None:
    """Return the point where the last three axes meet, shape (3,), m; None unless axis 5 is perpendicular to both."""
    if not (axes.perpendicular(4, 5) and axes.perpendicular(5, 6)):
        return None
    centre = axes.meeting_point(4, 5)
    return centre if centre is not None and axes.on(6, centre) else None


def _with_wrist(
    p: Mapping[str, SX], rotation: tuple[Vector, Vector, Vector], region: _Region, pose: PoseSymbols
) -> list[Branch]:
    """Return the two branches of the wrist: no flip (joint 5 turned to its positive side), and flip.

    The direction a of axis 6, seen from link 3, gives q4 = arg(a_1 + i a_2), or that plus pi. Where axes 4 and 6
    coincide, as exactly as the pose is known, q4 is the free joint's angle.
    """
    q1 = region.shoulder.q1
    rho = region.rho
    wrist = wrist_axes(p, (to_arm_frame(axis, q1, rho) for axis in rotation))
    q4 = unit_pair(wrist.a[0], wrist.a[1], ill_determined(pose), pose.free)
    roll = angle(q4)
    unflipped, flipped = joints_5_and_6(p, wrist, q4)
    flags = {
        "miss": region.miss,
        "shoulder": region.shoulder.singular,
        "elbow": region.elbow_is_singular,
        "wrist": hypot(wrist.a[0], wrist.a[1]) < SINGULAR,
        "clamped": region.clamped,
        "distance": region.distance,
    }
    return [
        Branch((*region.q, roll, *unflipped), **flags),
        Branch((*region.q, turn_by_pi(roll), *flipped), **flags),
    ]
