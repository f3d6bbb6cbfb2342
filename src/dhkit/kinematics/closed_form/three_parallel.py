"""Six joints of which 2, 3 and 4 are parallel, 1 and 5 perpendicular to them, and 5 and 6 meet at right angles.

This is the Universal Robots family. The point where axes 5 and 6 meet gives joint 1, the direction of axis 6 gives
joint 5 and the rotation of link 4, which places axis 4, and the tool's other directions give joint 6; joints 2 and 3
then are two links in a plane (Hawkins, Analytic inverse kinematics for the Universal Robots UR-5/UR-10 arms, 2013).
"""

from __future__ import annotations

from collections.abc import Mapping

from dhkit.kinematics.axes import Axes
from dhkit.kinematics.closed_form.arm_plane import (
    FLIPS,
    ArmPlane,
    Shoulder,
    Vector,
    branch_names,
    ordered_shoulders,
    to_arm_frame,
)
from dhkit.kinematics.closed_form.family import Fit, FramedPose, Parameter, PoseSymbols
from dhkit.kinematics.closed_form.formulas import (
    MIN_DIRECTION,
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
    positive_part,
    select_pair,
    sign,
    sqrt,
    unit_pair,
)
from dhkit.kinematics.closed_form.links import ELBOWS, Elbow, elbows, link_parameters
from dhkit.kinematics.closed_form.wrist import (
    ERROR_OVER_DEFECT,
    ill_determined,
    joints_5_and_6,
    wrist_axes,
    wrist_parameters,
)

_ROTATION_SLACK = 1e-12
"""Largest error of the tool's rotation, rad, that is accepted to reach a pose near the wrist's singularity."""


def three_parallel_fit(axes: Axes) -> Fit | None:
    """Recognize axes 2, 3 and 4 parallel, 1 and 5 perpendicular to them, and 5 and 6 meeting at right angles."""
    if axes.kinds != "RRRRRR" or not (
        axes.perpendicular(1, 2) and axes.parallel(2, 3) and axes.parallel(2, 4)
    ):
        return None
    if not (axes.perpendicular(4, 5) and axes.perpendicular(5, 6)):
        return None
    meeting = axes.meeting_point(5, 6)
    if meeting is None:
        return None
    plane = ArmPlane.of(axes)
    links = link_parameters(axes, plane, axes.point(4))
    if links is None:
        return None
    fourth = plane.coordinates(axes.point(4))
    end = plane.coordinates(meeting)
    own: dict[str, Parameter] = {
        "offset": axes.snapped(end[2]),
        "lever": end[:2]
        - fourth[:2],  # (x, u) from axis 4 to the meeting point of axes 5 and 6 at zero, m
        "sense4": axes.sense(2, 4),
    }
    return Fit(
        geometry="axes 2, 3 and 4 parallel, 5 and 6 meet",
        # ``offset`` of ``own``, that of the meeting point, replaces the one of ``links``, of a point of axis 4.
        parameters=wrist_parameters(axes, plane, axes.direction(2), meeting) | links | own,
        branches=branch_names(own["offset"], ELBOWS, FLIPS),
        free_joint=5,  # q6
    )


def three_parallel_formulas(p: Mapping[str, SX], pose: PoseSymbols) -> list[Branch]:
    """Return the eight branches: shoulder, then elbow, then wrist."""
    T = pose.seen(p["T_plane_world"], p["T_tool_wrist"])
    branches: list[Branch] = []
    for shoulder in ordered_shoulders(p, T.position, pose):
        unflipped, flipped = _wrists(p, T, shoulder, pose)
        for elbow in zip(unflipped, flipped, strict=True):
            branches += elbow
    return branches


def _wrists(
    p: Mapping[str, SX], T: FramedPose, shoulder: Shoulder, pose: PoseSymbols
) -> tuple[tuple[Branch, Branch], tuple[Branch, Branch]]:
    """Return upper and lower elbow of the wrist without flip (joint 5 turned to its positive side), and with it.

    Link 4 has rotated by rho = q2 + sense3 q3 + sense4 q4 about v since zero, where a sense is +1 or -1 as an axis has
    the direction of axis 2 or the opposite one. In coordinates across v and along it, the direction of axis 6 is
    a = (S cos(rho), S sin(rho), C), S and C the sine and cosine of q5 + const, so that, up to the flip,

        rho = arg(a_1 + i a_2), or that plus pi.
    """
    wrist = wrist_axes(p, (to_arm_frame(axis, shoulder.q1) for axis in T.rotation))
    position = to_arm_frame(T.position, shoulder.q1)

    # Where axis 6 is parallel to axes 2 to 4, swing = |S| is 0, and only the sum of rho and q6 is determined (their
    # difference if axis 6 has the opposite direction): q6 is then free, and axis 5 gives rho by
    # c6 n - s6 m = (-sin(rho), cos(rho), 0).
    c6, s6 = pose.free
    swing = hypot(wrist.a[0], wrist.a[1])
    free = unit_pair(c6 * wrist.n[1] - s6 * wrist.m[1], s6 * wrist.m[0] - c6 * wrist.n[0])
    rho = unit_pair(wrist.a[0], wrist.a[1], ill_determined(pose), free)
    rho = _within_reach(p, position, rho, swing, pose)

    unflipped, flipped = joints_5_and_6(p, wrist, rho)
    singular = swing < SINGULAR
    return (
        _elbows(p, position, shoulder, rho, unflipped, singular, pose.scale),
        _elbows(p, position, shoulder, (-rho[0], -rho[1]), flipped, singular, pose.scale),
    )


def _within_reach(
    p: Mapping[str, SX], position: Vector, rho: Pair, swing: SX, pose: PoseSymbols
) -> Pair:
    """Return rho, or the nearest one for which axis 4 is in reach of the two links, if that hardly rotates the tool.

    Near the wrist's singularity rho is ill determined: changing it rotates the tool only ``swing`` times as much. The
    wrist with a flip has rho + pi. Rho is changed for the wrist that is out of reach; if both are, for the one that
    misses by less. Where rho is free, it is not changed for the flip alone.
    """
    lever = p["lever"]
    x = position[0] - p["a1"]
    u = position[1]
    reach = p["L2"] + p["L3"]
    inner_reach = fabs(p["L2"] - p["L3"])
    rotated_lever = add_angles(rho, lever)

    def distances(flip_sign: float) -> tuple[SX, SX]:
        """Return axis 4's distance from axis 2 for rho (sign 1) or rho + pi (-1), and the nearest within reach."""
        distance = hypot(x - flip_sign * rotated_lever[0], u - flip_sign * rotated_lever[1])
        return distance, if_else(distance > reach, reach, fmax(distance, inner_reach))

    distance, nearest = distances(1.0)
    distance_of_flip, nearest_of_flip = distances(-1.0)
    excess = fabs(distance - nearest)
    excess_of_flip = fabs(distance_of_flip - nearest_of_flip)

    # Rho is changed for the flip where the flip is out of reach, and either it alone is and rho is determined (as
    # ``unit_pair`` decided it), or both are and it misses by less.
    is_determined = swing > MIN_DIRECTION * ill_determined(pose)
    alone = logic_and(excess <= 0, is_determined)
    of_flip = logic_and(excess_of_flip > 0, logic_or(alone, excess_of_flip < excess))
    flip_sign = if_else(of_flip, -1.0, 1.0)
    wanted = if_else(of_flip, nearest_of_flip, nearest)

    # The triangle of axis 2, axis 4 and the meeting point M, at (x, u) from axis 2, has the sides b = |M|, c = |lever|
    # and, opposite to M, the wanted distance w of axis 4. Its angle at M by the law of cosines:
    # w^2 = b^2 + c^2 - 2 b c cos(corner). Without a lever, or with M on axis 2, rho does not change the distance.
    b = hypot(x, u)
    c = hypot(lever[0], lever[1])
    product = 2.0 * b * c
    cosine = (b * b + c * c - wanted * wanted) / if_else(product > 0, product, 1.0)
    to_meeting = unit_pair(x, u)
    to_lever = unit_pair(lever[0], lever[1])

    # Axis 4 stays on its side of the line to M: rho + arg(lever) = arg(M) +- corner, with rho + pi for the flip. A
    # cosine beyond 1 or -1 stands for a corner of 0 or pi.
    _, sine_from_meeting = add_angles(add_angles(rho, to_lever), to_meeting, -1.0)
    side = sign(flip_sign * sine_from_meeting)
    corner = unit_pair(cosine, side * sqrt(positive_part(1.0 - cosine * cosine)))
    turned = add_angles(add_angles(to_meeting, corner), to_lever, -1.0)
    turned = (flip_sign * turned[0], flip_sign * turned[1])

    # A change of rho rotates the tool by ``swing`` times as much; small angles are taken by their chords.
    cost = swing * hypot(turned[0] - rho[0], turned[1] - rho[1])
    is_beyond = logic_or(of_flip, excess > 0)
    is_harmless = cost < _ROTATION_SLACK + ERROR_OVER_DEFECT * pose.noise
    return select_pair(logic_and(is_beyond, is_harmless), turned, rho)


def _elbows(
    p: Mapping[str, SX],
    position: Vector,
    shoulder: Shoulder,
    rho: Pair,
    wrist: tuple[SX, SX],
    singular: SX,
    scale: SX,
) -> tuple[Branch, Branch]:
    """Return the branches of upper and lower elbow for a rotation rho of link 4; ``wrist`` is (q5, q6).

    Axis 4 is at the meeting point minus e^(i rho) lever; two links reach it from axis 2, and q4 is the rest of rho.
    """
    lever = add_angles(rho, p["lever"])
    x = position[0] - p["a1"] - lever[0]
    u = position[1] - lever[1]

    def branch(elbow: Elbow) -> Branch:
        rest = add_angles(rho, elbow.rotation, -1.0)
        q4 = angle((rest[0], p["sense4"] * rest[1]))
        return Branch(
            (angle(shoulder.q1), *elbow.joints, q4, *wrist),
            miss=hypot(shoulder.miss, elbow.miss),
            shoulder=shoulder.singular,
            elbow=elbow.singular,
            wrist=singular,
            clamped=logic_or(shoulder.clamped, elbow.clamped),
        )

    upper, lower = elbows(p, x, u, shoulder.q1, scale)
    return branch(upper), branch(lower)
