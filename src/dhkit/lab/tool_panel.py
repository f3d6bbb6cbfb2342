"""The panel of the tool: a target that the arm follows by a chosen branch, and all branches as ghosts."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array, pose
from dhkit.errors import DhkitError
from dhkit.kinematics import IKFlag, IKSolutions, IKStatus, classify
from dhkit.kinematics.polynomial.six_joints import has_two_parallel
from dhkit.kinematics.redundant import redundancy_range
from dhkit.lab.desk import Desk
from dhkit.lab.requests import Fields, JsonObject, Panel, answers

MAX_DISTANCE = 1e4
"""Largest coordinate of a target, m."""
MAX_REDUNDANCY = 10.0
"""Largest redundancy that a page asks for, rad."""
MAX_RESTARTS = 3
"""Restarts of the iterative solver for arms without closed form, while a person drags the target."""
ROTATION_TOLERANCE = 1e-6
"""Largest angle, rad, between the target's rotation and a rotation that counts as the same."""
FLATNESS = 1e-9
"""Largest extent of the tool's positions across the plane that they lie in, over the arm's reach; also the largest
distance of a target from that plane that is not reported, m."""
PLANE_SAMPLES = 64
"""Random states by which the plane of a planar arm's tool is found."""
EULER_ORDERS = ("XYZ", "ZYX", "ZYZ", "ZXZ", "xyz", "zyx", "zyz", "zxz")
FLAG_DESCRIPTIONS = {
    IKFlag.shoulder: "shoulder singular",
    IKFlag.elbow: "elbow stretched or folded",
    IKFlag.wrist: "wrist singular",
    IKFlag.singular: "singular",
    IKFlag.clamped: "on the boundary of the workspace",
}


@dataclass(frozen=True, eq=False)
class Plane:
    """The plane in which the tool of a planar arm stays."""

    point: Array
    """A point of the plane, shape (3,), m, world."""
    normal: Array
    """Unit normal, shape (3,), world."""


@dataclass(frozen=True, eq=False)
class Branch:
    """A solution of the inverse kinematics at the target."""

    name: str
    q: Array
    """Joint values, shape (n,), rad and m; angles by whole turns near the state on show."""
    within_limits: bool


class ToolPanel(Panel):
    """Requests ``tool.…``."""

    def __init__(self, desk: Desk) -> None:
        super().__init__(desk)
        self.T: Array | None = None
        """The target, shape (4, 4), m, world."""
        self.chosen: str | None = None
        """Name of the branch that the arm follows."""
        self._plane = _plane_of(desk.arm)
        desk.on_replace.append(self._follow_with_new_arm)

    @answers("tool.target", "T")
    def set_target(self, fields: Fields) -> JsonObject:
        """Move the target to a pose, and the arm after it."""
        return self._follow(fields.pose("T"))

    @answers("tool.pose", "xyz", "euler", "order")
    def set_pose(self, fields: Fields) -> JsonObject:
        """Move the target to a position and Euler angles."""
        order = fields.choice("order", EULER_ORDERS, self.desk.order)
        return self._follow(
            pose(fields.vector("xyz", 3), euler=fields.vector("euler", 3), order=order)
        )

    @answers("tool.jog", "axis", "step", "frame")
    def jog(self, fields: Fields) -> JsonObject:
        """Move the target by a step along or about an axis of the world or of the tool."""
        axis = fields.integer("axis", 0, 5)
        step = fields.number("step", -MAX_DISTANCE, MAX_DISTANCE)
        vector = np.zeros(3)
        vector[axis % 3] = step
        motion = pose(vector) if axis < 3 else pose(euler=vector, order="XYZ")
        T = self.desk.arm.fk(self.desk.q) if self.T is None else self.T
        if fields.choice("frame", ("world", "tool"), "world") == "tool":
            return self._follow(T @ motion)
        target = T.copy()
        target[:3, :3] = motion[:3, :3] @ T[:3, :3]
        target[:3, 3] = T[:3, 3] + motion[:3, 3]
        return self._follow(target)

    @answers("tool.choose", "branch")
    def choose(self, fields: Fields) -> JsonObject:
        """Follow another branch from now on."""
        name = fields.text("branch")
        if self.T is None:
            raise ValueError("tool.choose: there is no target; expected one first")
        solutions, by_iteration = solve_pose(self.desk.arm, self.T, self.desk.q)
        branches = {branch.name: branch for branch in self._branches(solutions, by_iteration)}
        if name not in branches:
            raise ValueError(
                f"tool.choose: found {name[:40]!r}; expected a branch that reaches the target"
            )
        if not branches[name].within_limits:
            raise ValueError(f"tool.choose: {name} is outside the joint limits, and only shown")
        self.chosen = name
        return self._follow(self.T, branches[name].q)

    @answers("tool.redundancy", "value")
    def set_redundancy(self, fields: Fields) -> JsonObject:
        """Move an arm of seven joints without its tool: to joint 7, or the arm angle."""
        value = fields.number("value", -MAX_REDUNDANCY, MAX_REDUNDANCY)
        if self.T is None:
            raise ValueError("tool.redundancy: there is no target; expected one first")
        if classify(self.desk.arm.description).redundant is None:
            raise ValueError("tool.redundancy: the arm has none; expected an arm of seven joints")
        return self._follow(self.T, redundancy=value)

    @answers("tool.intervals")
    def intervals(self, _: Fields) -> JsonObject:
        """Return the intervals of the redundancy in which the target is reached inside the limits."""
        redundant = classify(self.desk.arm.description).redundant
        if self.T is None or redundant is None:
            return {"intervals": []}
        return {"intervals": self.desk.arm.redundancy_intervals(self.T)}

    @answers("tool.order", "order")
    def set_order(self, fields: Fields) -> None:
        """Show the tool's rotation by another convention of Euler angles."""
        self.desk.order = fields.choice("order", EULER_ORDERS)
        self.desk.publish_state()

    @answers("tool.read", "q")
    def read(self, fields: Fields) -> JsonObject:
        """Return the numbers of the tool at joint values that a page shows while it plays a motion."""
        arm = self.desk.arm
        return self.desk.tool_state(arm, fields.joint_values("q", arm.n))

    @answers("tool.clear")
    def clear(self, _: Fields) -> None:
        """Take the target and the ghosts away."""
        self._forget()

    def publish(self) -> None:
        """Tell the pages that there is no target."""
        self.desk.view.panel("target", None)

    def _follow_with_new_arm(self) -> None:
        """Make the arm that has replaced another follow the target, if there is one and the arm can."""
        T = self.T
        self._forget()
        if T is not None:
            with suppress(DhkitError, ValueError):
                self._follow(T)

    def _forget(self) -> None:
        self.T = None
        self.chosen = None
        self.desk.target_q = None
        self._plane = _plane_of(self.desk.arm)
        self.desk.view.ghosts(None)
        self.publish()

    def _follow(
        self, T: Array, near: Array | None = None, redundancy: float | None = None
    ) -> JsonObject:
        """Take a target, shape (4, 4); show the arm at the chosen or nearest branch, and the others as ghosts.

        Unless given, joint values ``near`` to be nearest to, shape (n,), and the redundancy are those of the state on
        show.
        """
        if np.abs(T[:3, 3]).max() > MAX_DISTANCE:
            raise ValueError(
                f"a target at {T[:3, 3].tolist()} m; expected at most {MAX_DISTANCE:g} m away"
            )
        snapped = False
        if self._plane is not None:
            offset = float(self._plane.normal @ (T[:3, 3] - self._plane.point))
            snapped = abs(offset) > FLATNESS
            T = T.copy()
            T[:3, 3] -= offset * self._plane.normal
        self.T = T
        desk = self.desk
        solutions, by_iteration = solve_pose(desk.arm, T, desk.q, redundancy)
        branches = self._branches(solutions, by_iteration)
        usable = [branch for branch in branches if branch.within_limits]
        followed = self._followed_branch(usable, desk.q if near is None else near)
        if followed is not None:
            self.chosen = followed.name
            desk.target_q = followed.q.copy()
            if not desk.running:
                desk.show(desk.target_q)
        others = [
            branch.q for branch in branches if followed is None or branch.name != followed.name
        ]
        if not desk.running:
            desk.view.ghosts(np.array(others) if others else None)
        T_reached = desk.arm.fk(desk.q if followed is None else followed.q)
        cosine = (np.trace(T_reached[:3, :3].T @ T[:3, :3]) - 1) / 2
        angle = float(np.arccos(np.clip(cosine, -1.0, 1.0)))
        if followed is None:
            message: str | None = _unreached_message(solutions, outside_limits=bool(branches))
        else:
            message = self._reached_message(solutions, followed, angle, by_iteration)
        chosen = None if followed is None else followed.name
        state = {
            "T": T.ravel().tolist(),
            "reached": followed is not None,
            "distance": float(np.linalg.norm(T_reached[:3, 3] - T[:3, 3])),
            "angle": angle,
            "message": message,
            "chosen": chosen,
            "branches": [
                {
                    "name": b.name,
                    "q": b.q.tolist(),
                    "within": b.within_limits,
                    "chosen": b.name == chosen,
                }
                for b in branches
            ],
            "numeric": by_iteration,
            "redundancy": _redundancy_state(desk.arm, solutions),
            "snapped": snapped,
        }
        desk.view.panel("target", state)
        return {"reached": followed is not None, "message": message}

    def _branches(self, solutions: IKSolutions, by_iteration: bool) -> list[Branch]:
        """Return the branches that reach the pose."""
        q = solutions.q if by_iteration else solutions.within_limits(near=self.desk.q)
        q = np.where(np.isfinite(q), q, solutions.q)
        allowed = np.atleast_1d(solutions.allowed)
        return [
            Branch(name, q[k], bool(allowed[k]))
            for k, name in enumerate(solutions.branches)
            if solutions.valid[k] and np.isfinite(q[k]).all()
        ]

    def _followed_branch(self, branches: list[Branch], near: Array) -> Branch | None:
        """Return the chosen branch, or else the one nearest to joint values.

        The numbers of solutions by elimination name no branch: there the nearest one is followed.
        """
        found = classify(self.desk.arm.description)
        has_names = found.closed_form or found.redundant is not None or found.neighbour is not None
        if has_names:
            chosen = next((branch for branch in branches if branch.name == self.chosen), None)
            if chosen is not None:
                return chosen
        return min(branches, key=lambda branch: float(np.sum((branch.q - near) ** 2)), default=None)

    def _reached_message(
        self, solutions: IKSolutions, followed: Branch, angle: float, by_iteration: bool
    ) -> str | None:
        if self.desk.running:
            return "a controller moves the arm: it follows the target where Control says so"
        if angle > ROTATION_TOLERANCE:
            return f"this arm cannot turn its tool freely: the rotation is off by {np.degrees(angle):.3g}°"
        if by_iteration:
            return None
        flags = int(solutions.flags[solutions.branches.index(followed.name)])
        descriptions = [text for flag, text in FLAG_DESCRIPTIONS.items() if flags & flag]
        if int(solutions.status_code) == IKStatus.singular and not descriptions:
            descriptions.append("singular")
        return ", ".join(descriptions) or None


def solve_pose(
    arm: Arm, T: Array, near: Array, redundancy: float | None = None
) -> tuple[IKSolutions, bool]:
    """Return the solutions at a pose, and whether they were found by iteration.

    Parameters
    ----------
    arm
        The arm.
    T
        The pose of the tool, shape (4, 4), m, world.
    near
        Joint values where the iteration begins, shape (n,), rad and m.
    redundancy
        Redundancy of an arm of seven joints, rad; that of ``near`` unless given.
    """
    family = classify(arm.description)
    if family.redundant is not None:
        # Kept, so that the arm does not swing; another one where it leads nowhere inside the limits.
        value = float(arm.redundancy(near)) if redundancy is None else redundancy
        found = arm.ik(T, redundancy=value)
        return (found if found.allowed.any() else arm.ik(T, prefer=near)), False
    if family.closed_form or family.neighbour is not None:
        return arm.ik(T), False
    if has_two_parallel(arm.description):
        return arm.ik(T), False
    return arm.ik_numeric(T, near, restarts=MAX_RESTARTS, position_only=arm.n < 6), True


def _redundancy_state(arm: Arm, solutions: IKSolutions) -> JsonObject | None:
    """Return the redundancy that the page has a slider for; None for other arms."""
    redundant = classify(arm.description).redundant
    if redundant is None or solutions.redundancy is None:
        return None
    lower, upper = redundancy_range(arm.description)
    value = float(solutions.redundancy)
    return {"name": redundant[0].redundancy, "value": value, "lower": lower, "upper": upper}


def _unreached_message(solutions: IKSolutions, *, outside_limits: bool) -> str:
    if outside_limits:
        return "in reach only outside the joint limits"
    distance = float(solutions.distance)
    if not np.isfinite(distance):
        return "no solution was found"
    if distance == 0:
        return "the position is in reach, this orientation is not"
    return (
        f"out of reach by {distance:.3g} m"
        if distance >= 1
        else f"out of reach by {1000 * distance:.3g} mm"
    )


def _plane_of(arm: Arm) -> Plane | None:
    """Return the plane that the tool stays in, if there is one."""
    description = arm.description
    spread = np.where(description.numbers.prismatic, 0.3, np.pi)
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (PLANE_SAMPLES, arm.n)) * spread
    points = arm.fk(q)[:, :3, 3]
    middle = points.mean(axis=0)
    sigma, axes = np.linalg.svd(points - middle, full_matrices=False)[1:]
    size = (description.reach or 1.0) * np.sqrt(PLANE_SAMPLES)
    if len(sigma) < 3 or sigma[2] > FLATNESS * size or sigma[1] <= FLATNESS * size:
        return None
    return Plane(middle, axes[2])
