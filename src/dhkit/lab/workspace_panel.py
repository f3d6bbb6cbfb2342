"""The panel of the workspace: points that the tool reaches, all or a slice, and how far it is from the boundary."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array, Description
from dhkit.kinematics import workspace
from dhkit.kinematics.boundaries import boundaries
from dhkit.kinematics.workspace import first_axis
from dhkit.lab.desk import Desk
from dhkit.lab.jobs import Job, Jobs, JobState
from dhkit.lab.requests import Fields, JsonObject, Panel, answers
from dhkit.viewer.overlays import heat_colors

SLICE_SAMPLES = 400_000
"""Random states of which a slice keeps a few in a hundred."""
MAX_POINTS = 10_000
"""Largest number of points that are drawn: more are slow without a graphics processor."""
HALF_THICKNESS = 0.02
"""Half the thickness of a slice, as a share of the arm's reach."""
SAME_PLACE = 1e-9
"""Distances below this, m, count as none."""
SCALE_COLORS = 6
"""Colors of the scale beside a cloud, from which the page interpolates."""
WRIST_FRAME = 5
"""Frame whose origin is the wrist's centre of an arm with six joints, in both conventions."""


class WorkspacePanel(Panel):
    """Requests ``workspace.…``."""

    def __init__(self, desk: Desk, lock: AbstractContextManager[object]) -> None:
        super().__init__(desk)
        self._state: dict[str, object] = {"kind": "none"}
        self.jobs: Jobs = Jobs(self._publish_failure, lock)
        desk.on_replace.append(self._forget)

    @answers("workspace.show", "kind")
    def show(self, fields: Fields) -> None:
        """Draw points that the tool reaches, or those in the vertical plane that it is in now."""
        kind = fields.choice("kind", ("none", "points", "slice"))
        self.jobs.cancel()
        if kind == "none":
            self.desk.view.points(None)
            self._publish(kind="none", count=0, progress=None)
            return
        arm = self.desk.arm
        tool = self.desk.arm.fk(self.desk.q)[:3, 3]
        self._publish(kind=kind, count=0, progress="sampling")

        def take(cloud: _Cloud) -> None:
            positions = cloud.positions
            self.desk.view.points(positions, heat_colors(cloud.manipulability))
            self._publish(
                kind=kind,
                count=len(positions),
                progress=None,
                about=cloud.about,
                heat=_heat_scale(cloud.manipulability),
            )

        self.jobs.start(
            "workspace", lambda job: _sample(arm, tool if kind == "slice" else None, job), take
        )

    @answers("workspace.read", "q")
    def read(self, fields: Fields) -> JsonObject:
        """Return how far the tool is from the boundary of its workspace."""
        arm = self.desk.arm
        nearest = boundary_distance(arm, fields.joint_values("q", arm.n))
        return dict(
            zip(("distance", "boundary", "point"), nearest or (None, None, None), strict=True)
        )

    def publish(self) -> None:
        """Send the drawing to the pages."""
        self.desk.view.panel("workspace", self._state)

    def _publish(self, **state: object) -> None:
        self._state = state
        self.publish()

    def _publish_failure(self, state: JobState | None) -> None:
        if state is not None and state["error"] and self._state["kind"] != "none":
            self._publish(kind="none", count=0, progress=None, error=state["error"])

    def _forget(self) -> None:
        """Forget the points of an arm that another has replaced; the view has taken them away."""
        self.jobs.cancel()
        self._publish(kind="none", count=0, progress=None)


def boundary_distance(arm: Arm, q: Array) -> tuple[float, str, str] | None:
    """Return how far a state is from the nearest boundary of its arm's workspace.

    Parameters
    ----------
    arm
        The arm.
    q
        Joint values, shape (n,), rad and m.

    Returns
    -------
    tuple[float, str, str] | None
        The distance, m; the boundary: outer, inner, shoulder, or the upper or lower end of a slide; and the point that
        it bounds, such as ``wrist centre``. None where the boundaries are not known in closed form. Limits of turning
        joints do not count.
    """
    sections = _sections(arm.description)
    if not sections:
        return None
    axis = first_axis(arm.description)
    frames = arm.frames(q)
    tool = arm.fk(q)
    candidates: list[tuple[float, str, str]] = []
    for name, point, section in sections:
        T = tool if point == "tool" else frames[min(WRIST_FRAME, arm.n)]
        place = _about_axis(T[None, :3, 3], axis)[0]
        candidates.append((_distance_from_line(place, section), name, point))
        known = section[np.isfinite(section).all(axis=1)]
        if len(known) > 1 and np.ptp(known[:, 0]) < SAME_PLACE and np.ptp(known[:, 1]) > SAME_PLACE:
            # The wall of a tube that a slide along axis 1 makes: it ends above and below.
            for height, end in ((known[:, 1].max(), "upper"), (known[:, 1].min(), "lower")):
                candidates.append((float(abs(place[1] - height)), end, point))
    return min((c for c in candidates if np.isfinite(c[0])), key=lambda c: c[0], default=None)


@lru_cache(maxsize=8)
def _sections(description: Description) -> tuple[tuple[str, str, Array], ...]:
    """Return the name, the point and the section of each boundary; the section as distances from axis 1 and heights."""
    axis = first_axis(description)
    return tuple((b.name, b.point, _about_axis(b.section, axis)) for b in boundaries(description))


def _about_axis(points: Array, axis: Array) -> Array:
    """Return the distance from an axis and the height along it, shape (k, 2), m, of points, shape (k, 3), m."""
    local = (points - axis[:3, 3]) @ axis[:3, :3]
    return np.stack([np.hypot(local[:, 0], local[:, 1]), local[:, 2]], axis=1)


def _distance_from_line(point: Array, line: Array) -> float:
    """Return the distance of a point, shape (2,), from a line through points, shape (k, 2), NaN between its pieces."""
    if len(line) == 0:
        return np.inf
    if len(line) == 1:
        return float(np.linalg.norm(point - line[0]))
    # The nearest point of a piece a + s (b - a) has s = (p - a) . (b - a) / |b - a|^2, cut to [0, 1].
    start = line[:-1]
    segment = np.diff(line, axis=0)
    length = np.einsum("ij,ij->i", segment, segment)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.where(length > 0, np.einsum("ij,ij->i", point - start, segment) / length, 0.0)
    distances = np.linalg.norm(start + np.clip(share, 0.0, 1.0)[:, None] * segment - point, axis=1)
    return float(np.nanmin(distances)) if np.isfinite(distances).any() else np.inf


@dataclass(frozen=True, eq=False)
class _Cloud:
    """Points that the tool reaches."""

    positions: Array
    """Shape (N, 3), m, world."""
    manipulability: Array
    """Shape (N,)."""
    about: str
    """What was assumed, for a person; it may be empty."""


def _heat_scale(manipulability: Array) -> JsonObject:
    """Return the largest value and the colors from 0 to it, as CSS, for the scale of a cloud."""
    colors = heat_colors(np.linspace(0.0, 1.0, SCALE_COLORS))
    return {
        "largest": float(np.nan_to_num(manipulability).max(initial=0.0)),
        "colors": [f"rgb({r:.0f} {g:.0f} {b:.0f})" for r, g, b in 255.0 * colors],
    }


def _sample(arm: Arm, through: Array | None, job: Job) -> _Cloud:
    """Return points that the tool reaches.

    With ``through``, shape (3,), m, only points in the plane of axis 1 and that point are returned.
    """

    def report(done: int, whole: int) -> None:
        job.progress(f"{round(100 * done / whole)} %")

    count = MAX_POINTS if through is None else SLICE_SAMPLES
    space = workspace(arm.description, samples=count, progress=report)
    chosen = np.arange(len(space.positions))
    if through is not None:
        axis = first_axis(arm.description)
        local = (space.positions - axis[:3, 3]) @ axis[:3, :3]
        towards = (through - axis[:3, 3]) @ axis[:3, :3]

        # Distance from the plane through axis 1 (z) and the point: its normal is (-sin, cos) of the point's angle.
        angle = np.arctan2(towards[1], towards[0])
        offset = -np.sin(angle) * local[:, 0] + np.cos(angle) * local[:, 1]
        chosen = np.flatnonzero(np.abs(offset) < HALF_THICKNESS * max(arm.description.reach, 1e-9))[
            :MAX_POINTS
        ]
    about = "assumed: " + ", ".join(space.assumed) if space.assumed else ""
    return _Cloud(space.positions[chosen], space.manipulability[chosen], about)
