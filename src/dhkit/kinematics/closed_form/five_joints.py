"""Arms of five joints: a turntable, three parallel axes, and a last axis that rolls the tool in the arm's plane.

Most small arms for teaching are of this kind (SO-100 and SO-101, ScorBot, many toys). Axis 5 stays in a plane parallel
to that of the arm, so that a pose is reached where the position lets joint 1 turn this plane along the wanted direction
of axis 5. Of other poses the nearest one with the same position is given: the wanted rotation, turned by the least
angle that brings axis 5 into the plane.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

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
    BOUNDARY_SHARE,
    SINGULAR,
    SX,
    Branch,
    Pair,
    add_angles,
    angle,
    clamp,
    fabs,
    hypot,
    if_else,
    logic_or,
    unit_pair,
    weighted_sum,
)
from dhkit.kinematics.closed_form.links import ELBOWS, elbows, link_parameters

_STEPS = 6
"""Newton steps of joint 1: none changes anything where the pose is reached, or the tool's origin is on axis 5."""
_LARGEST_STEP = 0.3
"""Largest such step, rad."""
_CLOSED = 16 * BOUNDARY_SHARE
"""Share of ``scale`` by which the last step may miss: it ends at rounding, or has not converged."""


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
    # The point of axis 5 nearest to the tool's origin, which is at e from it.
    foot = axes.point(5) + direction * (direction @ (tool - axes.point(5)))
    e = tool - foot
    if np.linalg.norm(e) <= axes.tolerance * axes.scale:
        e = np.zeros(3)
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
        # In the tool's frame: axis 5, the vector e, and the direction that is across the plane at zero joint positions.
        "axis": to_tool @ direction,
        "beside": to_tool @ e,
        "across": to_tool @ plane.R[2],
    }
    return Fit(
        geometry="a turntable, axes 2, 3 and 4 parallel, axis 5 across them",
        parameters=links | own,
        branches=branch_names(offset, ELBOWS),
        coordinates=("x", "y", "z", "roll", "pitch"),
    )


def five_joints_formulas(p: Mapping[str, SX], pose: PoseSymbols) -> list[Branch]:
    """Return the four branches that put the tool's origin in place and turn it as near as possible.

    In the arm's plane at q1 the wanted axis 5 is a = c u + s v, with v across the plane and u in it. The least rotation
    Q that takes it to u takes (v - s a) / c to v, and keeps w = u x v. The foot of the tool's origin on axis 5 is then
    at x - Q e, and its coordinate across the plane, x_v - e_v / c, must be the offset of axis 5: an equation for q1.
    """
    T = pose.seen(p["T_plane_world"], np.eye(4)[:3])
    axis = weighted_sum(p["axis"], T.rotation)
    beside = weighted_sum(p["beside"], T.rotation)
    across = weighted_sum(p["across"], T.rotation)
    # Where the pose is reached, Q is 1.
    x, y, z = (here - there for here, there in zip(T.position, beside, strict=True))
    branches = []
    for first in ordered_shoulders(p, (x, y, z), pose):
        shoulder = _turned(p, first, T.position, axis, beside, pose)
        seen = _Seen.at(shoulder.q1, axis)
        rho = add_angles(seen.along, p["pointing"], -1.0)
        lever = add_angles(rho, p["lever"])
        tool = to_arm_frame(T.position, shoulder.q1)
        # Q e in the plane is its component along w = (u_u, -u_x).
        _, e_w = seen.across(beside)
        foot_x = tool[0] - e_w * seen.along[1]
        foot_u = tool[1] + e_w * seen.along[0]
        sideways = seen.c < SINGULAR

        # Turned about u, v goes to w: joint 5 is the angle from v to what is across the plane at zero.
        q5 = angle(unit_pair(*seen.across(across)))
        for elbow in elbows(
            p, foot_x - p["a1"] - lever[0], foot_u - lever[1], shoulder.q1, pose.scale
        ):
            rest = add_angles(rho, elbow.rotation, -1.0)
            q4 = angle((rest[0], p["sense4"] * rest[1]))
            branches.append(
                Branch(
                    (angle(shoulder.q1), *elbow.joints, q4, q5),
                    miss=hypot(shoulder.miss, elbow.miss),
                    shoulder=shoulder.singular,
                    elbow=elbow.singular,
                    wrist=sideways,
                    clamped=logic_or(shoulder.clamped, elbow.clamped),
                )
            )
    return branches


@dataclass(frozen=True)
class _Seen:
    """The wanted axis 5 in the axes (x, u, v) of the arm's plane."""

    q1: Pair
    axis: Vector
    along: Pair
    """Its direction in the plane."""
    c: SX
    """Cosine of its angle with the plane."""

    @classmethod
    def at(cls, q1: Pair, axis: Vector) -> _Seen:
        """Return the axis at joint 1 = q1, from its coordinates with joint 1 at zero."""
        seen = to_arm_frame(axis, q1)
        return cls(q1, seen, unit_pair(seen[0], seen[1]), hypot(seen[0], seen[1]))

    def across(self, vector: Vector) -> tuple[SX, SX]:
        """Return the components along v and w of a vector that is at right angles to the axis, turned by Q."""
        x, u, v = to_arm_frame(vector, self.q1)
        along_x, along_u = self.along
        return v / self.c, x * along_u - u * along_x


def _turned(
    p: Mapping[str, SX],
    shoulder: Shoulder,
    position: Vector,
    axis: Vector,
    beside: Vector,
    pose: PoseSymbols,
) -> Shoulder:
    """Return a shoulder with joint 1 where the foot of the tool's origin is at axis 5, by Newton's method.

    With joint 1, v components change by x components, and those by -v:

        f = x_v - e_v / c - offset,    f' = x_x - e_x / c - e_v s a_x / c^3,    c^2 = 1 - s^2,  s = a_v.
    """
    q1 = shoulder.q1
    is_reached = shoulder.miss <= 0.0

    def residual(q1: Pair) -> tuple[SX, SX]:
        x = to_arm_frame(position, q1)
        e = to_arm_frame(beside, q1)
        a = to_arm_frame(axis, q1)
        c = hypot(a[0], a[1])
        f = x[2] - e[2] / c - p["offset"]
        return f, x[0] - e[0] / c - e[2] * a[2] * a[0] / (c * c * c)

    for _ in range(_STEPS):
        f, slope = residual(q1)
        step = clamp(-f / slope, -_LARGEST_STEP, _LARGEST_STEP)
        # NaN where axis 5 is across the plane, or the tool over axis 1.
        half = if_else(fabs(step) <= _LARGEST_STEP, step / 2.0, 0.0)
        # The angle 2 arctan(step / 2), which is the step up to its cube.
        over = 1.0 / (1.0 + half * half)
        turned = add_angles(q1, ((1.0 - half * half) * over, 2.0 * half * over))
        q1 = (if_else(is_reached, turned[0], q1[0]), if_else(is_reached, turned[1], q1[1]))

    f, _ = residual(q1)
    has_closed = fabs(f) <= _CLOSED * pose.scale
    missed = if_else(has_closed, 0.0, fabs(f))
    return replace(shoulder, q1=q1, miss=if_else(is_reached, missed, shoulder.miss))
