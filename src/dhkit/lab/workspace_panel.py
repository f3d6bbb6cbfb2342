"""The panel of the workspace: points that the tool reaches, all or a slice, and how far it is from the boundary."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import lru_cache
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array, Description
from dhkit.kinematics import workspace
from dhkit.kinematics.boundaries import boundaries
from dhkit.kinematics.workspace import first_axis
from dhkit.lab.desk import Desk
from dhkit.lab.fields import LARGEST_JOINT_VALUE, Fields
from dhkit.lab.jobs import Job, Jobs
from dhkit.viewer.overlays import heat_colors

SAMPLES = 400_000
"""Random states, of which a slice keeps a few in a hundred."""
SHOWN = 10_000
"""Points that are drawn at most: more are slow without a graphics processor."""
THIN = 0.02
"""Half the thickness of a slice, share of the arm's reach."""
SAME = 1e-9
"""m."""
WRIST = 5
"""Frame whose origin is the wrist's centre of an arm with six joints, in both conventions."""


class WorkspacePanel:
    """Requests ``workspace.…``."""

    def __init__(self, desk: Desk, lock: AbstractContextManager[Any]) -> None:
        self.desk = desk
        self._state: dict[str, Any] = {"kind": "none"}
        self._jobs = Jobs(self._told, lock)
        desk.changed.append(self._replaced)

    def show(self, data: dict[str, Any]) -> dict[str, Any]:
        """Draw points that the tool reaches, or those in the vertical plane that it is in now."""
        kind = Fields("workspace.show", data, ["kind"]).choice("kind", ("none", "points", "slice"))
        self._jobs.cancel()
        if kind == "none":
            self.desk.view.points(None)
            self._tell(kind="none", count=0, progress=None)
            return {}
        arm, tool = self.desk.arm, self.desk.arm.fk(self.desk.q)[:3, 3]
        self._tell(kind=kind, count=0, progress="sampling")

        def take(found: tuple[Array, Array, str]) -> None:
            positions, colors, about = found
            self.desk.view.points(positions, colors)
            self._tell(kind=kind, count=len(positions), progress=None, about=about)

        self._jobs.start("workspace", lambda job: _sampled(arm, tool if kind == "slice" else None, job), take)
        return {}

    def read(self, data: dict[str, Any]) -> dict[str, Any]:
        """Return how far the tool is from the boundary of what it reaches."""
        arm = self.desk.arm
        q = Fields("workspace.read", data, ["q"]).vector("q", arm.n, LARGEST_JOINT_VALUE)
        found = boundary_distance(arm, q)
        if found is None:
            return {"distance": None, "boundary": None, "point": None}
        distance, boundary, point = found
        return {"distance": distance, "boundary": boundary, "point": point}

    def publish(self) -> None:
        """Tell the pages what is drawn."""
        self.desk.view.panel("workspace", self._state)

    def close(self) -> None:
        """End what runs."""
        self._jobs.close()

    def _tell(self, **state: Any) -> None:
        self._state = state
        self.publish()

    def _told(self, state: dict[str, Any] | None) -> None:
        if state is not None and self._state["kind"] != "none" and state.get("error"):
            self._tell(kind="none", count=0, progress=None, error=state["error"])

    def _replaced(self) -> None:
        """Leave the points of another arm, which the view has taken away."""
        self._jobs.cancel()
        self._tell(kind="none", count=0, progress=None)


def boundary_distance(arm: Arm, q: Array) -> tuple[float, str, str] | None:
    """Return how far a state is from the nearest boundary of its arm's workspace, for a point that has one.

    Parameters
    ----------
    arm
        The arm.
    q
        Joint values, shape (n,), rad and m.

    Returns
    -------
    tuple[float, str, str] | None
        Distance, m; the boundary: outer, inner, shoulder, or the upper or lower end of a slide; and the point that it
        bounds, such as ``wrist centre``.
        None where the boundaries are not known in closed form. Limits of turning joints do not count.
    """
    found = _sections(arm.description)
    if not found:
        return None
    axis, sections = found
    frames = arm.frames(q)
    best: tuple[float, str, str] | None = None
    for name, point, section in sections:
        position = arm.fk(q)[:3, 3] if point == "tool" else frames[min(WRIST, arm.n), :3, 3]
        place = _turned_in(position[None], axis)[0]
        candidates = [(_from_line(place, section), name)]
        heights = section[np.isfinite(section).all(axis=1)]
        if len(heights) > 1 and np.ptp(heights[:, 0]) < SAME and np.ptp(heights[:, 1]) > SAME:
            # The wall of a tube that a slide along axis 1 makes: it ends above and below.
            ends = ((heights[:, 1].max(), "upper"), (heights[:, 1].min(), "lower"))
            candidates += [(abs(place[1] - height), end) for height, end in ends]
        for distance, boundary in candidates:
            if np.isfinite(distance) and (best is None or distance < best[0]):
                best = float(distance), boundary, point
    return best


@lru_cache(maxsize=8)
def _sections(description: Description) -> tuple[Array, tuple[tuple[str, str, Array], ...]] | None:
    """Return axis 1 and the boundaries as lines in a half-plane through it: distance from it and height, m."""
    axis = first_axis(description)
    lines = tuple((b.name, b.point, _turned_in(b.section, axis)) for b in boundaries(description))
    return (axis, lines) if lines else None


def _turned_in(points: Array, axis: Array) -> Array:
    """Return the distance from an axis and the height along it of points, shape (k, 3), as shape (k, 2)."""
    local = (points - axis[:3, 3]) @ axis[:3, :3]
    return np.stack([np.hypot(local[:, 0], local[:, 1]), local[:, 2]], axis=1)


def _from_line(point: Array, line: Array) -> float:
    """Return the distance of a point, shape (2,), from a line through points, shape (k, 2), NaN between its pieces."""
    if len(line) == 0:
        return np.inf
    if len(line) == 1:
        return float(np.linalg.norm(point - line[0]))
    start, way = line[:-1], np.diff(line, axis=0)
    length = np.einsum("ij,ij->i", way, way)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.clip(np.where(length > 0, np.einsum("ij,ij->i", point - start, way) / length, 0.0), 0.0, 1.0)
    distances = np.linalg.norm(start + share[:, None] * way - point, axis=1)
    return float(np.nanmin(distances)) if np.isfinite(distances).any() else np.inf


def _sampled(arm: Arm, through: Array | None, job: Job) -> tuple[Array, Array, str]:
    """Return points, colors and what they are: of all that is reached, or of the plane of axis 1 and a point."""

    def told(done: int, whole: int) -> None:
        job.progress(f"{round(100 * done / whole)} %")

    count = SHOWN if through is None else SAMPLES
    space = workspace(arm.description, samples=count, progress=told)
    shown = np.arange(len(space.positions))
    if through is not None:
        axis = first_axis(arm.description)
        local, towards = (space.positions - axis[:3, 3]) @ axis[:3, :3], (through - axis[:3, 3]) @ axis[:3, :3]
        angle = np.arctan2(towards[1], towards[0])
        across = -np.sin(angle) * local[:, 0] + np.cos(angle) * local[:, 1]
        shown = np.flatnonzero(np.abs(across) < THIN * max(arm.description.reach, 1e-9))[:SHOWN]
    about = "brighter: the tool moves more easily there"
    if space.assumed:
        about += "; assumed: " + ", ".join(space.assumed)
    return space.positions[shown], heat_colors(space.manipulability[shown]), about
