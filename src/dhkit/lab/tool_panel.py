"""The panel of the tool: a target that the arm follows by a chosen branch, and all branches as ghosts."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array, pose
from dhkit.errors import DhkitError
from dhkit.kinematics import IKFlag, IKSolutions, IKStatus, classify
from dhkit.lab.desk import Desk
from dhkit.lab.fields import LARGEST_JOINT_VALUE, Fields

FAR = 1e4
"""m: positions beyond are refused."""
RESTARTS = 3
"""Of the iteration for arms without closed form, while a person drags."""
TURNED = 1e-6
"""rad between the target's rotation and one that meets it."""
FLAT = 1e-9
"""Extent of the tool's positions across a plane, over the reach, below which they lie in it."""
PROBES = 64
ORDERS = ("XYZ", "ZYX", "ZYZ", "ZXZ", "xyz", "zyx", "zyz", "zxz")
FLAG_WORDS = {
    IKFlag.shoulder: "shoulder singular",
    IKFlag.elbow: "elbow stretched or folded",
    IKFlag.wrist: "wrist singular",
    IKFlag.clamped: "on the boundary of the workspace",
}


@dataclass(frozen=True, eq=False)
class Plane:
    """Where the tool can be, for an arm whose tool stays in a plane."""

    point: Array
    normal: Array


class ToolPanel:
    """Requests ``tool.…``."""

    def __init__(self, desk: Desk) -> None:
        self.desk = desk
        self.T: Array | None = None
        self.chosen: str | None = None
        self._plane = _plane_of(desk.arm)
        desk.changed.append(self._replaced)

    def target(self, data: dict[str, Any]) -> dict[str, Any]:
        """Move the target to a pose, and the arm after it."""
        return self._follow(Fields("tool.target", data, ["T"]).pose("T"))

    def pose(self, data: dict[str, Any]) -> dict[str, Any]:
        """Move the target to a position and Euler angles."""
        fields = Fields("tool.pose", data, ["xyz", "euler", "order"])
        order = fields.choice("order", ORDERS, self.desk.order)
        return self._follow(pose(fields.vector("xyz", 3), euler=fields.vector("euler", 3), order=order))

    def jog(self, data: dict[str, Any]) -> dict[str, Any]:
        """Move the target by a step along or about an axis of the world or of the tool."""
        fields = Fields("tool.jog", data, ["axis", "step", "frame"])
        axis, step = fields.whole("axis", 0, 5), fields.number("step", -FAR, FAR)
        vector = np.zeros(3)
        vector[axis % 3] = step
        moved = pose(vector) if axis < 3 else pose(euler=vector, order="XYZ")
        T = self.desk.arm.fk(self.desk.q) if self.T is None else self.T
        if fields.choice("frame", ("world", "tool"), "world") == "tool":
            return self._follow(T @ moved)
        turned = T.copy()
        turned[:3, :3] = moved[:3, :3] @ T[:3, :3]
        turned[:3, 3] = T[:3, 3] + moved[:3, 3]
        return self._follow(turned)

    def choose(self, data: dict[str, Any]) -> dict[str, Any]:
        """Follow another branch from now on."""
        name = Fields("tool.choose", data, ["branch"]).text("branch")
        if self.T is None:
            raise ValueError("tool.choose: there is no target; expected one first")
        branches = {one["name"]: one for one in self._branches(*solved(self.desk.arm, self.T, self.desk.q))}
        if name not in branches:
            raise ValueError(f"tool.choose: found {name[:40]!r}; expected a branch that reaches the target")
        if not branches[name]["within"]:
            raise ValueError(f"tool.choose: {name} is outside the joint limits, and only shown")
        self.chosen = name
        return self._follow(self.T)

    def order(self, data: dict[str, Any]) -> dict[str, Any]:
        """Read the tool's rotation by another convention of Euler angles."""
        self.desk.order = Fields("tool.order", data, ["order"]).choice("order", ORDERS)
        self.desk.publish_state()
        return {}

    def read(self, data: dict[str, Any]) -> dict[str, Any]:
        """Return the numbers of the tool at joint values that a page shows: those of a motion on its way."""
        arm = self.desk.arm
        return self.desk.tool(arm, Fields("tool.read", data, ["q"]).vector("q", arm.n, LARGEST_JOINT_VALUE))

    def clear(self, data: dict[str, Any]) -> dict[str, Any]:
        """Take the target and the ghosts away."""
        Fields("tool.clear", data, [])
        self._forget()
        return {}

    def _replaced(self) -> None:
        """Have another arm follow the target, where there is one."""
        T = self.T
        self._forget()
        if T is not None:
            with suppress(DhkitError, ValueError):  # an arm that cannot: there is no target any more
                self._follow(T)

    def _forget(self) -> None:
        self.T, self.chosen, self.desk.aimed = None, None, None
        self._plane = _plane_of(self.desk.arm)
        self.desk.view.ghosts(None)
        self.desk.view.panel("target", None)

    def _follow(self, T: Array) -> dict[str, Any]:
        if np.abs(T[:3, 3]).max() > FAR:
            raise ValueError(f"a target at {T[:3, 3].tolist()} m; expected at most {FAR:g} m away")
        snapped = False
        if self._plane is not None:
            away = float(self._plane.normal @ (T[:3, 3] - self._plane.point))
            snapped = abs(away) > FLAT
            T = T.copy()
            T[:3, 3] -= away * self._plane.normal
        self.T = T
        found, numeric = solved(self.desk.arm, T, self.desk.q)
        branches = self._branches(found, numeric)
        near = self._nearest([branch for branch in branches if branch["within"]])
        if near is not None:
            self.chosen = near["name"]
            self.desk.aimed = np.array(near["q"])
            if not self.desk.running:
                self.desk.show(self.desk.aimed)
        for branch in branches:
            branch["chosen"] = near is not None and branch["name"] == near["name"]
        others = [branch["q"] for branch in branches if not branch["chosen"]]
        if not self.desk.running:
            self.desk.view.ghosts(np.array(others) if others else None)
        T_now = self.desk.arm.fk(self.desk.q if near is None else np.array(near["q"]))
        state = {
            "T": T.ravel().tolist(),
            "reached": near is not None,
            "distance": float(np.linalg.norm(T_now[:3, 3] - T[:3, 3])),
            "angle": _angle(T_now, T),
            "message": self._message(found, near, numeric, _angle(T_now, T), beyond=bool(branches)),
            "chosen": near["name"] if near else None,
            "branches": branches,
            "numeric": numeric,
            "snapped": snapped,
        }
        self.desk.view.panel("target", state)
        return {"reached": state["reached"], "message": state["message"]}

    def _branches(self, found: IKSolutions, numeric: bool) -> list[dict[str, Any]]:
        """Return the branches that reach the pose, angles by whole turns near the state on show."""
        q = found.q if numeric else found.within_limits(near=self.desk.q)
        q, within = np.where(np.isfinite(q), q, found.q), np.atleast_1d(found.allowed)
        return [
            {"name": name, "q": q[k].tolist(), "within": bool(within[k]), "chosen": False}
            for k, name in enumerate(found.branches)
            if found.valid[k] and np.isfinite(q[k]).all()
        ]

    def _nearest(self, branches: list[dict[str, Any]]) -> dict[str, Any] | None:
        """Return the chosen branch, or else the one nearest to the state on show."""
        chosen = next((branch for branch in branches if branch["name"] == self.chosen), None)
        if chosen is not None or not branches:
            return chosen
        return min(branches, key=lambda branch: float(np.sum((np.array(branch["q"]) - self.desk.q) ** 2)))

    def _message(
        self, found: IKSolutions, near: dict[str, Any] | None, numeric: bool, angle: float, *, beyond: bool
    ) -> str | None:
        if near is None and beyond:
            return "in reach only outside the joint limits"
        if near is None:
            distance = float(found.distance)
            if not np.isfinite(distance):
                return "not reached by iteration from here"
            if distance == 0:
                return "the position is in reach, this orientation is not"
            return f"out of reach by {distance:.3g} m" if distance >= 1 else f"out of reach by {1000 * distance:.3g} mm"
        if self.desk.running:
            return "a controller moves the arm: it follows the target where Control says so"
        if angle > TURNED:
            return f"this arm cannot turn its tool freely: the rotation is off by {np.degrees(angle):.3g}°"
        if numeric:
            return None
        flags = int(found.flags[found.branches.index(near["name"])])
        words = [text for flag, text in FLAG_WORDS.items() if flags & flag]
        if int(found.status_code) == IKStatus.singular and not words:
            words.append("singular")
        return ", ".join(words) or None


def solved(arm: Arm, T: Array, near: Array) -> tuple[IKSolutions, bool]:
    """Return the solutions at a pose, and whether they were found by iteration.

    Never by ssik, whose preparation takes many seconds: a person waits.
    """
    if classify(arm.description).fit is not None:
        return arm.ik(T), False
    return arm.ik_numeric(T, near, restarts=RESTARTS, position_only=arm.n < 6), True


def _angle(T: Array, goal: Array) -> float:
    cosine = (np.trace(T[:3, :3].T @ goal[:3, :3]) - 1) / 2
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _plane_of(arm: Arm) -> Plane | None:
    """Return the plane that the tool stays in, if there is one."""
    description = arm.description
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (PROBES, arm.n)) * np.where(
        description.numbers.prismatic, 0.3, np.pi
    )
    points = arm.fk(q)[:, :3, 3]
    middle = points.mean(axis=0)
    sigma, axes = np.linalg.svd(points - middle, full_matrices=False)[1:]
    size = (description.reach or 1.0) * np.sqrt(PROBES)
    if len(sigma) < 3 or sigma[2] > FLAT * size or sigma[1] <= FLAT * size:
        return None
    return Plane(middle, axes[2])
