"""Arms of five joints: a turntable, three parallel axes, and a last axis that rolls the tool in the arm's plane.

Most small arms for teaching are of this kind (SO-100 and SO-101, ScorBot, many toys). Axis 5 stays in the arm's plane,
so that five of a pose's six coordinates can be chosen: joint 1 turns the plane along the wanted axis 5, and through its
foot, the point nearest to the tool's origin. Both conditions must give the same plane.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from dhkit.kinematics.axes import Axes
from dhkit.kinematics.closed_form.arm_plane import (
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
    SINGULAR,
    SX,
    Branch,
    Pair,
    add_angles,
    angle,
    fabs,
    fmax,
    hypot,
    if_else,
    logic_and,
    logic_or,
    select_pair,
    sign,
    unit_pair,
    weighted_sum,
)
from dhkit.kinematics.closed_form.links import ELBOWS, elbows, link_parameters

_WELL_CONDITIONED = 1e-3
"""Share of the horizontal part of axis 5 that the foot's distance along the plane needs, over ``scale``, to decide."""
_EPSILON = 1e-16
"""Relative rounding error of a number."""
OFF_PLANE = 1e-9
"""Sine of an angle, or share of ``scale``, by which axis 5 may lie off the arm's plane: a pose that misses it by more
is out of reach."""


def five_joints_fit(axes: Axes) -> Fit | None:
    """Recognize a turntable with three parallel joints and a last one at right angles to them."""
    if axes.kinds != "RRRRR":
        return None
    is_turntable = axes.perpendicular(1, 2) and axes.parallel(2, 3) and axes.parallel(2, 4)
    if not (is_turntable and axes.perpendicular(4, 5)):
        return None
    plane = ArmPlane.of(axes)
    links = link_parameters(axes, plane, axes.point(4))
    if links is None:
        return None
    direction = axes.direction(5)
    tool = axes.T_world_tool[:3, 3]
    # The point of axis 5 nearest to the tool's origin.
    foot = axes.point(5) + direction * (direction @ (tool - axes.point(5)))
    to_tool = axes.T_world_tool[:3, :3].T
    along = plane.R @ direction
    offset = axes.snapped(plane.coordinates(foot)[2])
    own = {
        "T_plane_world": plane.T[:3],
        "up": plane.up,
        "reach": axes.scale,
        "offset": offset,
        "lever": plane.coordinates(foot)[:2] - plane.coordinates(axes.point(4))[:2],
        "pointing": as_pair(along[0], along[1]),
        "sense4": axes.sense(2, 4),
        # In the tool's frame: axis 5, the foot, and the direction that is across the plane at zero joint positions.
        "axis": to_tool @ direction,
        "foot": to_tool @ (foot - tool),
        "across": to_tool @ plane.R[2],
    }
    return Fit(
        geometry="a turntable, axes 2, 3 and 4 parallel, axis 5 across them",
        parameters=links | own,
        branches=branch_names(offset, ELBOWS),
    )


def five_joints_formulas(p: Mapping[str, SX], pose: PoseSymbols) -> list[Branch]:
    """Return the four branches: shoulder, then elbow. A shoulder whose plane does not hold axis 5 does not reach.

    The direction w of axis 5 in the arm's plane gives the rotation of links 2 to 4, and with it the position of axis 4,
    which two links reach from axis 2, as for four joints:

        rho = q2 + q3 + q4 = arg(w) - pointing,    axis 4 at the foot - e^(i rho) lever.

    Joint 5 is the angle from v, across the plane, to what is across it at zero joint positions.
    """
    T = pose.seen(p["T_plane_world"], np.eye(4)[:3])
    axis = weighted_sum(p["axis"], T.rotation)
    across = weighted_sum(p["across"], T.rotation)
    beside = weighted_sum(p["foot"], T.rotation)
    x, u, v = (here + there for here, there in zip(T.position, beside, strict=True))
    branches = []
    for shoulder in _planes(p, (x, u, v), axis, pose):
        seen = to_arm_frame(axis, shoulder.q1)
        along = unit_pair(seen[0], seen[1])
        rho = add_angles(along, p["pointing"], -1.0)
        lever = add_angles(rho, p["lever"])

        # Turned about w, v goes to w x v = (w_u, -w_x).
        side = to_arm_frame(across, shoulder.q1)
        q5 = angle(unit_pair(side[2], side[0] * along[1] - side[1] * along[0]))
        end = (shoulder.x - p["a1"] - lever[0], u - lever[1])
        for elbow in elbows(p, *end, shoulder.q1, pose.scale):
            rest = add_angles(rho, elbow.rotation, -1.0)
            q4 = angle((rest[0], p["sense4"] * rest[1]))
            branches.append(
                Branch(
                    (angle(shoulder.q1), *elbow.joints, q4, q5),
                    miss=hypot(shoulder.miss, elbow.miss),
                    shoulder=shoulder.singular,
                    elbow=elbow.singular,
                    wrist=0.0,
                    clamped=logic_or(shoulder.clamped, elbow.clamped),
                )
            )
    return branches


def _planes(p: Mapping[str, SX], foot: Vector, axis: Vector, pose: PoseSymbols) -> list[Shoulder]:
    """Return the two positions of joint 1 that bring the plane through the foot, or along axis 5.

    The foot decides, unless it is so near to axis 1 that q1 hardly moves it across the plane: then axis 5 does, if it
    is not along axis 1. The other condition is checked.
    """
    horizontal = hypot(axis[0], axis[2])
    scale = pose.scale
    found = []
    for shoulder in ordered_shoulders(p, foot, pose):
        # Rounding turns q1 by eps / horizontal along the axis, and by sqrt(eps / (r / scale)) at most through the foot.
        by_foot = logic_or(
            fabs(shoulder.x) >= _WELL_CONDITIONED * horizontal * scale,
            horizontal * horizontal * scale < _EPSILON * shoulder.r,
        )
        q1 = select_pair(by_foot, shoulder.q1, _along(axis, shoulder))
        seen = to_arm_frame(axis, q1)
        here = to_arm_frame(foot, q1)
        # The foot is in front of axis 1, or behind it, as the shoulder has it.
        aside = fmax(fabs(here[2] - p["offset"]), -here[0] * sign(shoulder.x))
        off = fmax(fabs(seen[2]), aside / scale)
        found.append(
            replace(
                shoulder,
                q1=q1,
                x=if_else(by_foot, shoulder.x, here[0]),
                miss=if_else(off > OFF_PLANE, fmax(off * scale, shoulder.miss), 0.0),
                singular=logic_and(shoulder.singular, horizontal < SINGULAR),
            )
        )
    return found


def _along(axis: Vector, shoulder: Shoulder) -> Pair:
    """Return joint 1 along the horizontal part of axis 5: of its two angles the one nearer to the shoulder's.

    a_v = s1 a_x + c1 a_v at q1 is 0 where (c1, s1) is along +-(a_x, -a_v).
    """
    first = unit_pair(axis[0], -axis[2])
    near = shoulder.q1
    is_near = first[0] * near[0] + first[1] * near[1] >= 0.0
    return select_pair(is_near, first, (-first[0], -first[1]))
