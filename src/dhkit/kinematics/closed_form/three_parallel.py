"""Six joints of which 2, 3 and 4 are parallel, and 5 and 6 meet at right angles: the Universal Robots family.

The point where axes 5 and 6 meet and the direction of axis 6 give joints 1, 5 and 6 and the sum of the three in
between; those are then two links in a plane (Hawkins, Analytic inverse kinematics for the Universal Robots UR-5/UR-10
arms, 2013).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

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
from dhkit.kinematics.closed_form.family import ALL, Fit, PoseSymbols, Seen
from dhkit.kinematics.closed_form.formulas import (
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
    larger,
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

__all__ = ["three_parallel_fit", "three_parallel_formulas"]

FREE = 1e-12
"""By how much the tool's rotation may miss the pose where that brings a pose near the wrist's singularity in reach."""


def three_parallel_fit(axes: Axes) -> Fit | None:
    """Recognise an arm by its axes."""
    if axes.kinds != "RRRRRR" or not (axes.perpendicular(1, 2) and axes.parallel(2, 3) and axes.parallel(2, 4)):
        return None
    if not (axes.perpendicular(4, 5) and axes.perpendicular(5, 6)):
        return None
    meeting = axes.meeting_point(5, 6)
    if meeting is None:
        return None
    plane = ArmPlane.of(axes)
    second, third, fourth, end = (
        plane.coordinates(point) for point in (axes.point(2), axes.point(3), axes.point(4), meeting)
    )
    upper, fore = third[:2] - second[:2], fourth[:2] - third[:2]
    if min(np.linalg.norm(upper), np.linalg.norm(fore)) <= axes.tolerance * axes.scale:
        return None
    v, z5, z6 = axes.direction(2), axes.direction(5), axes.direction(6)
    T_world_wrist = np.eye(4)
    T_world_wrist[:3, :3] = np.stack([z6, z5, np.cross(z6, z5)], axis=1)
    T_world_wrist[:3, 3] = meeting
    upper_pair, fore_pair, wrist = as_pair(*upper), as_pair(*fore), as_pair(v @ z6, z5 @ np.cross(v, z6))
    offset = axes.snapped(end[2])
    return Fit(
        words="axes 2, 3 and 4 parallel, 5 and 6 meet",
        parameters={
            "T_plane_world": plane.T[:3],
            "T_tool_wrist": (inverse_pose(axes.T_world_tool) @ T_world_wrist)[:3],
            "F": np.stack([np.cross(z5, v), z5, v]) @ plane.R.T + 0.0,
            "wrist": wrist,
            "straight": np.angle(complex(*wrist) ** 2),
            "lever": end[:2] - fourth[:2],
            "a1": second[0],
            "offset": offset,
            "L2": np.linalg.norm(upper),
            "L3": np.linalg.norm(fore),
            "upper": upper_pair,
            "bend": times(fore_pair, upper_pair, -1.0),
            "sense3": axes.sense(2, 3),
            "sense4": axes.sense(2, 4),
            "up": plane.up,
            "reach": axes.scale,
        },
        branches=branch_names(offset, ("up", "down"), FLIPS),
        met=ALL,
        free=5,
    )


def three_parallel_formulas(p: Mapping[str, SX], pose: PoseSymbols) -> list[Branch]:
    """Return the eight branches: shoulder, then elbow, then wrist."""
    T = pose.seen(p["T_plane_world"], p["T_tool_wrist"])
    branches = []
    for shoulder in ordered_shoulders(p, T.position, pose.scale):
        unflipped, flipped = _wrists(p, T, shoulder, pose)
        for raised in (True, False):
            branches += [wrist[0 if raised else 1] for wrist in (unflipped, flipped)]
    return branches


def _wrists(
    p: Mapping[str, SX], T: Seen, shoulder: Shoulder, pose: PoseSymbols
) -> tuple[tuple[Branch, Branch], tuple[Branch, Branch]]:
    """Return upper and lower elbow of the wrist without flip (joint 5 turned to its positive side), and with it."""
    F = p["F"]
    a, n, m = (rotated(F, turned_back(vector, shoulder.q1)) for vector in T.rotation)
    swing = hypot(a[0], a[1])
    # rho is how far links 2 to 4 have turned in all. Where axis 6 is parallel to them only rho and joint 6 together
    # are determined: joint 6 is then free, and rho is read off axis 5 with joint 6 undone.
    c6, s6 = pose.free
    seen = turned_back(T.position, shoulder.q1)
    free = unit(c6 * n[1] - s6 * m[1], s6 * m[0] - c6 * n[0])
    rho = _within_reach(p, seen, unit(a[0], a[1], otherwise=free), swing)
    bend = unit(rho[0] * a[0] + rho[1] * a[1], a[2])
    q5 = angle(times((bend[1], bend[0]), p["wrist"], -1.0))
    q6 = angle(unit(rho[0] * n[1] - rho[1] * n[0], rho[1] * m[0] - rho[0] * m[1]))
    singular = swing < SINGULAR
    flipped = wrapped(-q5 - p["straight"]), half_turn(q6)
    return (
        _elbows(p, seen, shoulder, rho, (q5, q6), singular, pose.scale),
        _elbows(p, seen, shoulder, (-rho[0], -rho[1]), flipped, singular, pose.scale),
    )


def _within_reach(p: Mapping[str, SX], position: Vector, rho: Pair, swing: SX) -> Pair:
    """Return rho, or where axis 4 would then be out of the two links' reach, the next one that is within it.

    Near the wrist's singularity rho is ill determined, and turning it costs the tool only ``swing`` times as much.
    """
    lever = p["lever"]
    x, u = position[0] - p["a1"], position[1]
    far, arm = hypot(x, u), hypot(lever[0], lever[1])
    distance = hypot(x - (rho[0] * lever[0] - rho[1] * lever[1]), u - (rho[1] * lever[0] + rho[0] * lever[1]))
    reach, gap = p["L2"] + p["L3"], absolute(p["L2"] - p["L3"])
    wanted = where(distance > reach, reach, larger(distance, gap))
    # The triangle of axis 2, axis 4 and the meeting point: its angle at the latter by the law of cosines.
    area = 2.0 * far * arm
    cosine = (far * far + arm * arm - wanted * wanted) / where(area > 0, area, 1.0)
    to_end, to_lever = unit(x, u), unit(lever[0], lever[1])
    side = sign(times(times(rho, to_lever), to_end, -1.0)[1])
    corner = unit(cosine, side * sqrt(positive(1.0 - cosine * cosine)))
    turned = times(times(to_end, corner), to_lever, -1.0)
    cost = swing * hypot(turned[0] - rho[0], turned[1] - rho[1])
    return chosen(both(wanted != distance, cost < FREE), turned, rho)


def _elbows(
    p: Mapping[str, SX],
    position: Vector,
    shoulder: Shoulder,
    rho: Pair,
    wrist: tuple[SX, SX],
    singular: SX,
    scale: SX,
) -> tuple[Branch, Branch]:
    lever = p["lever"]
    x = position[0] - p["a1"] - (rho[0] * lever[0] - rho[1] * lever[1])
    u = position[1] - (rho[1] * lever[0] + rho[0] * lever[1])
    arm = two_link(x, u, p["L2"], p["L3"], scale)
    # The left elbow of the line to axis 4 is the upper one where axis 4 is in front of axis 2.
    front = sign(p["up"] * x)

    def branch(raised: SX) -> Branch:
        q2 = times(chosen(raised > 0, *arm.first), p["upper"], -1.0)
        bent = times(chosen(raised > 0, *arm.between), p["bend"], -1.0)
        rest = times(times(rho, q2, -1.0), bent, -1.0)
        q3, q4 = (bent[0], p["sense3"] * bent[1]), (rest[0], p["sense4"] * rest[1])
        return Branch(
            (angle(shoulder.q1), angle(q2), angle(q3), angle(q4), *wrist),
            miss=hypot(shoulder.miss, arm.miss),
            shoulder=shoulder.singular,
            elbow=arm.straight,
            wrist=singular,
            clamped=either(shoulder.clamped, arm.clamped),
        )

    return branch(front), branch(-front)
