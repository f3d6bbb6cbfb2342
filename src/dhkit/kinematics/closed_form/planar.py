"""Arms that move in parallel planes.

Two or three parallel revolute joints with or without a prismatic joint along them (planar 2R and 3R, SCARA), and one
revolute joint with a prismatic joint across its axis (R-P and P-R).

Coordinates: v along the revolute axes, x and u across, with the origin on the first of them. Directions in the plane
are pairs (cosine, sine) of their angle from x. Parameters of the formulas, all with the joints at zero:

chain
    upper, fore: from the first revolute axis to the second, and on to the third or to the tool; L2, L3 their lengths;
    bend: angle from upper to fore; lever: from the third axis to the tool, m; height: v of the tool, m; axis: the
    tool's axis that is seen best along v, and pointing: its direction; senses: 1 or -1 for each joint, whether it
    turns or slides as the first axis; up: 1 if v points upwards, else -1.
polar (R-P)
    boom: direction of the slide; start: distance of the tool along the slide from the foot of the perpendicular from
    the revolute axis, m; lift: signed length of that perpendicular, m; height: v of the tool, m.
slider (P-R)
    L: distance of the tool from the revolute axis, m; pointing: its direction; height: v of the tool, m.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dhkit.description import Array
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.closed_form.arm_plane import UPRIGHT, as_pair
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
    positive_part,
    select_pair,
    sqrt,
    two_link,
    unit_pair,
    weighted_sum,
)

_FLAT = 1e-9
"""Share of the reach by which a pose may lie off the plane of a planar arm."""
_IDENTITY = np.eye(4)[:3]
"""Pose of the tool in itself, without the last row, shape (3, 4)."""
_CHAINS = ("RR", "RRR", "RRPR", "RRRP", "PRRR", "RPRR", "RRP", "RPR", "PRR")
"""Orders of joints that form a chain: two or three revolute joints and at most one prismatic."""


def chain_fit(axes: Axes) -> Fit | None:
    """Recognize two or three parallel revolute joints with at most one prismatic joint along them."""
    if axes.kinds not in _CHAINS or not all(axes.parallel(1, i) for i in range(2, axes.n + 1)):
        return None
    revolute = [i for i in range(1, axes.n + 1) if not axes.prismatic[i - 1]]
    first = revolute[0]

    # All points are taken in the plane (u, v) perpendicular to the revolute axes, from the first axis.
    R = _across(axes.direction(first))
    origin = axes.point(first)
    tool = R @ (axes.T_world_tool[:3, 3] - origin)
    elbow = R @ (axes.point(revolute[1]) - origin)
    end = R @ (axes.point(revolute[2]) - origin) if len(revolute) == 3 else tool
    upper = elbow[:2]
    fore = end[:2] - elbow[:2]

    # Without an upper or a fore arm the elbow's angle is not determined.
    if min(np.linalg.norm(upper), np.linalg.norm(fore)) <= axes.tolerance * axes.scale:
        return None

    # The tool's axis that lies best in the plane tells the sum of the angles.
    seen = R @ axes.T_world_tool[:3, :3]
    column = int(np.argmax(np.linalg.norm(seen[:2], axis=0)))
    slides = " and a prismatic joint along them" if "P" in axes.kinds else ""
    return Fit(
        geometry=f"{len(revolute)} parallel revolute axes{slides}",
        parameters={
            "T_plane_world": _frame(R, origin),
            "upper": as_pair(*upper),
            "L2": np.linalg.norm(upper),
            "L3": np.linalg.norm(fore),
            "bend": add_angles(as_pair(*fore), as_pair(*upper), -1.0),
            "lever": tool[:2] - end[:2],
            "height": tool[2],
            "axis": np.eye(3)[column],
            "pointing": as_pair(seen[0, column], seen[1, column]),
            "senses": tuple(axes.sense(first, i) for i in range(1, axes.n + 1)),
            "up": 1.0 if R[2, 2] >= -UPRIGHT else -1.0,
            "reach": axes.scale,
        },
        branches=("left", "right"),
        coordinates=("x", "y", "z", "yaw") if len(revolute) == 3 else ("x", "y", "z"),
        structure=axes.kinds,
    )


def chain_formulas(p: Mapping[str, SX], pose: PoseSymbols) -> list[Branch]:
    """Return two branches: the elbow left of the line from the first axis to the last, seen from above; then right.

    With the revolute joints' angles qa, qb and qc about v and their sum rho, the tool is at

        L2 e^(i (qa + upper)) + L3 e^(i (qa + upper + qb + bend)) + lever e^(i rho) = x + i u

    in the plane, where the last term is left out with two revolute joints. A prismatic joint moves along v.
    """
    T = pose.seen(p["T_plane_world"], _IDENTITY)
    kinds = pose.structure
    x, u, v = T.position

    # The tool's direction in the plane gives rho, and with it the position of the third axis.
    wanted = weighted_sum(p["axis"], T.rotation)
    rho = add_angles(unit_pair(wanted[0], wanted[1]), p["pointing"], -1.0)
    if kinds.count("R") == 3:
        lever = add_angles(rho, p["lever"])
        x = x - lever[0]
        u = u - lever[1]
    arm = two_link(x, u, p["L2"], p["L3"], pose.scale)

    rise = v - p["height"]
    off = 0.0 if "P" in kinds else _off_plane(rise, pose.scale)
    branches = []
    for side in (0, 1):
        # Seen from above, the elbow is on the left if v points up; otherwise left and right are exchanged.
        upright = p["up"] > 0
        other = 1 - side
        qa = add_angles(select_pair(upright, arm.first[side], arm.first[other]), p["upper"], -1.0)
        qb = add_angles(
            select_pair(upright, arm.between[side], arm.between[other]), p["bend"], -1.0
        )
        qc = add_angles(add_angles(rho, qa, -1.0), qb, -1.0)

        angles = iter((qa, qb, qc))
        joints = []
        for kind, sense in zip(kinds, p["senses"], strict=True):
            joints.append(sense * rise if kind == "P" else _sensed(next(angles), sense))
        branches.append(
            Branch(
                tuple(joints), miss=hypot(arm.miss, off), elbow=arm.straight, clamped=arm.clamped
            )
        )
    return branches


def polar_fit(axes: Axes) -> Fit | None:
    """Recognize a revolute joint with a slide across its axis."""
    if axes.kinds != "RP" or not axes.perpendicular(1, 2):
        return None
    R = _across(axes.direction(1))
    origin = axes.point(1)
    tool = R @ (axes.T_world_tool[:3, 3] - origin)
    along = R @ axes.direction(2)

    # As complex numbers x + i u the tool is at boom (start + i lift), with |boom| = 1.
    return Fit(
        geometry="a slide at right angles to a revolute axis",
        parameters={
            "T_plane_world": _frame(R, origin),
            "boom": as_pair(along[0], along[1]),
            "start": tool[:2] @ along[:2],
            "lift": along[0] * tool[1] - along[1] * tool[0],
            "height": tool[2],
            "reach": axes.scale,
        },
        branches=("out", "in"),
        coordinates=("x", "y", "z"),
    )


def polar_formulas(p: Mapping[str, SX], pose: PoseSymbols) -> list[Branch]:
    """Return two branches: the prismatic joint extended in its positive direction, then in its negative.

    With the prismatic joint's extension s = start + q2 from the foot of the perpendicular,

        e^(i q1) e^(i boom) (s + i lift) = x + i u,    so that    s = +-sqrt(R^2 - lift^2),    R = |x + i u|,
        q1 = arg(x + i u) - boom - arg(s + i lift).
    """
    x, u, v = pose.seen(p["T_plane_world"], _IDENTITY).position
    R = hypot(x, u)
    lift = fabs(p["lift"])
    beyond = lift - R > BOUNDARY_SHARE * pose.scale
    square = (R - lift) * (R + lift)
    length = sqrt(positive_part(square))
    miss = hypot(if_else(beyond, lift - R, 0.0), _off_plane(v - p["height"], pose.scale))

    point = unit_pair(x, u, pose.scale)
    branches = []
    for s in (length, -length):
        at_zero = add_angles(p["boom"], unit_pair(s, p["lift"], pose.scale))
        q1 = add_angles(point, at_zero, -1.0)
        branches.append(
            Branch(
                (angle(q1), s - p["start"]),
                miss=miss,
                elbow=length < SINGULAR * p["reach"],
                clamped=logic_and(square < 0, logic_not(beyond)),
            )
        )
    return branches


def slider_fit(axes: Axes) -> Fit | None:
    """Recognize a slide that carries a revolute joint across it."""
    if axes.kinds != "PR" or not axes.perpendicular(1, 2):
        return None
    x = axes.direction(1)
    v = axes.direction(2)
    R = np.stack([x, np.cross(v, x), v]) + 0.0
    origin = axes.point(2)
    tool = R @ (axes.T_world_tool[:3, 3] - origin)
    length = float(np.linalg.norm(tool[:2]))
    if length <= axes.tolerance * axes.scale:
        return None
    return Fit(
        geometry="a revolute axis at right angles to a slide",
        parameters={
            "T_plane_world": _frame(R, origin),
            "L": length,
            "pointing": as_pair(tool[0], tool[1]),
            "height": tool[2],
            "reach": axes.scale,
        },
        branches=("ahead", "behind"),
        coordinates=("x", "y", "z"),
    )


def slider_formulas(p: Mapping[str, SX], pose: PoseSymbols) -> list[Branch]:
    """Return two branches: the tool ahead of the revolute axis along the prismatic joint, then behind it.

    The prismatic joint moves along x, and the tool is at the distance L from the revolute axis:

        q1 + L e^(i (q2 + pointing)) = x + i u,    so that    x - q1 = +-sqrt(L^2 - u^2),
        q2 = arg(x - q1 + i u) - pointing.
    """
    x, u, v = pose.seen(p["T_plane_world"], _IDENTITY).position
    L = p["L"]
    beyond = fabs(u) - L > BOUNDARY_SHARE * pose.scale
    square = (L - u) * (L + u)
    ahead = sqrt(positive_part(square))
    miss = hypot(if_else(beyond, fabs(u) - L, 0.0), _off_plane(v - p["height"], pose.scale))

    branches = []
    for along in (ahead, -ahead):
        q2 = add_angles(unit_pair(along, u), p["pointing"], -1.0)
        branches.append(
            Branch(
                (x - along, angle(q2)),
                miss=miss,
                elbow=ahead < SINGULAR * p["reach"],
                clamped=logic_and(square < 0, logic_not(beyond)),
            )
        )
    return branches


def _across(v: Array) -> Array:
    """Return rows x, u, v of a right-handed frame, shape (3, 3), with x close to the world's x or y axis."""
    # x is a coordinate axis h less its part along v, h - (h . v) v; h is not nearly parallel to v.
    helper = np.eye(3)[0] if abs(v[0]) < 0.9 else np.eye(3)[1]
    x = helper - (helper @ v) * v
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(v, x), v]) + 0.0


def _frame(R: Array, origin: Array) -> Array:
    """Return the world in the frame with rows R and an origin, m, shape (3, 4)."""
    return np.column_stack([R, -R @ origin])


def _sensed(pair: Pair, sense: SX) -> SX:
    """Return the value of a revolute joint, rad, from its angle about v; ``sense`` is -1 if its axis is opposite."""
    return angle((pair[0], sense * pair[1]))


def _off_plane(rise: SX, scale: SX) -> SX:
    """Return the distance of a pose from the arm's plane, m; 0 if it is rounding."""
    return if_else(fabs(rise) > _FLAT * scale, fabs(rise), 0.0)
