"""The panel of motions: planned, taught or read from a file, played and plotted with their limits."""

from __future__ import annotations

import base64
import binascii
import tempfile
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dhkit.arm import Arm
from dhkit.description import Array
from dhkit.errors import DescriptionError, DhkitError
from dhkit.lab.contacts import touching
from dhkit.lab.desk import Desk, file_content
from dhkit.lab.fields import LARGEST_JOINT_VALUE, Fields
from dhkit.lab.jobs import Job, Jobs
from dhkit.lab.tool_panel import solved
from dhkit.planning import Progress
from dhkit.trajectories import Trajectory, read_motion
from dhkit.viewer.interactive import limits_state
from dhkit.viewer.motion import exceeded_limit

KINDS = ("quintic", "trapezoidal", "least-time", "line", "circle")
GOAL = ("q", "T", "waypoints")
LONGEST = 600.0
"""s of a motion."""
SHOWN = 401
"""Samples that are plotted."""
CHECKED = 101
"""Samples at which links are kept from each other."""
MOST_WAYPOINTS = 100
LONGEST_FILE = 700_000
"""Bytes of a file in base64."""
SUFFIXES = (".csv", ".mat", ".npz", ".yaml", ".yml")
SAME = 1e-9
"""rad and m between states that are the same."""
CIRCLE = 0.15
"""Radius of a circle, over the reach, where no goal says more."""


class MotionPanel:
    """Requests ``motion.…`` and ``waypoints.…``."""

    def __init__(self, desk: Desk, jobs: Jobs) -> None:
        self.desk, self.jobs = desk, jobs
        self.motion: Trajectory | None = None
        self.excess: str | None = None
        """The limit that the motion exceeds most, in words."""
        self.kind = ""
        self.waypoints: list[Array] = []
        self.changed: list[Callable[[], None]] = []
        """Called when there is another motion, or none."""
        self.made = ""
        """The call that makes the motion, as Python has it."""
        self._contacts = Jobs(lambda state: None)
        desk.changed.append(self._forget)

    def plan(self, data: dict[str, Any]) -> dict[str, Any]:
        """Plan a motion from the state on show; what takes long answers with the number of its job."""
        fields = Fields("motion.plan", data, ["kind", "goal", "duration"])
        kind = fields.choice("kind", KINDS)
        duration = fields.number("duration", 1e-3, LONGEST) if "duration" in fields else None
        arm, start = self.desk.arm, self.desk.q.copy()
        given = data.get("goal")
        goal = Fields("motion.plan", given if isinstance(given, dict) else {}, GOAL)
        if "waypoints" in goal:
            return self._through(kind, duration)
        if kind == "circle":
            return self._started(kind, lambda job: _circle(arm, start, duration))
        if kind == "line":
            T = goal.pose("T") if "T" in goal else arm.fk(goal.vector("q", arm.n, LARGEST_JOINT_VALUE))
            made = f"arm.straight_line(arm.fk({literal(start)}), {literal(T)}, {literal(start)}, {duration!r})"
            return self._started(kind, lambda job: (arm.straight_line(arm.fk(start), T, start, duration), made))
        end = self._configuration(goal, arm, start)
        if np.abs(end - start).max() < SAME:
            raise ValueError("motion.plan: the arm is there already; expected another goal")
        if kind == "least-time":
            return self._started("least time", lambda job: _quickest(arm, start, end, [], job))
        make = arm.quintic if kind == "quintic" else arm.trapezoidal
        made = f"arm.{make.__name__}({literal(start)}, {literal(end)}, {duration!r})"
        self._take(make(start, end, duration), kind, made)
        return {}

    def cancel(self, data: dict[str, Any]) -> dict[str, Any]:
        """Cancel the job that runs."""
        Fields("motion.cancel", data, [])
        self.jobs.cancel()
        return {}

    def clear(self, data: dict[str, Any]) -> dict[str, Any]:
        """Take the motion away."""
        Fields("motion.clear", data, [])
        self.motion = None
        self.desk.view.panel("motion", None)
        if not self.desk.running:
            self.desk.show(self.desk.q)
        self._tell_changed()
        return {}

    def file(self, data: dict[str, Any]) -> dict[str, Any]:
        """Read a motion that somebody has as a file; no path comes from the page."""
        fields = Fields("motion.file", data, ["name", "content", "degrees"])
        suffix = Path(fields.text("name")).suffix.lower()
        if suffix not in SUFFIXES:
            raise ValueError(f"motion.file: name ends in {suffix[:10]!r}; expected {', '.join(SUFFIXES)}")
        try:
            content = base64.b64decode(fields.text("content", LONGEST_FILE), validate=True)
        except (binascii.Error, ValueError):
            raise ValueError("motion.file: content is not in base64") from None
        degrees = fields.flag("degrees", False)
        with tempfile.TemporaryDirectory(prefix="dhkit-lab-") as folder:
            path = Path(folder) / f"file{suffix}"
            path.write_bytes(content)
            try:
                motion = read_motion(path, self.desk.arm.description, degrees=degrees)
            except DescriptionError as error:
                raise ValueError(str(error).replace(str(path), fields.text("name"))) from None
        self._take(
            motion, "file", f"dhkit.Trajectory.load({f'{self.desk.arm.name}-motion.npz'!r})  # downloaded as NPZ"
        )
        return {}

    def play(self, data: dict[str, Any]) -> dict[str, Any]:
        """Play the motion once more, where another state has taken its place."""
        Fields("motion.play", data, [])
        if self.motion is None:
            raise ValueError("motion.play: there is no motion")
        self._require_still("motion.play")
        self.desk.view.play(self.motion)
        return {}

    def show(self, data: dict[str, Any]) -> dict[str, Any]:
        """Show the state at a time of the motion."""
        time = Fields("motion.show", data, ["time"]).number("time", 0.0, LONGEST)
        if self.motion is None:
            raise ValueError("motion.show: there is no motion")
        self._require_still("motion.show")
        self.desk.show(self.motion.q(min(time, self.motion.duration)))
        return {}

    def download(self, data: dict[str, Any]) -> dict[str, Any]:
        """Return the motion as a file."""
        kind = Fields("motion.download", data, ["format"]).choice("format", ("csv", "npz"))
        motion = self.motion
        if motion is None:
            raise ValueError("motion.download: there is no motion")
        return {"name": f"{self.desk.arm.name}-motion.{kind}", "content": file_content(motion, kind)}

    def add(self, data: dict[str, Any]) -> dict[str, Any]:
        """Teach the state on show as a waypoint."""
        Fields("waypoints.add", data, [])
        if len(self.waypoints) >= MOST_WAYPOINTS:
            raise ValueError(f"waypoints.add: {MOST_WAYPOINTS} waypoints are enough")
        self.waypoints.append(self.desk.q.copy())
        self._tell_waypoints()
        return {}

    def remove(self, data: dict[str, Any]) -> dict[str, Any]:
        """Forget a waypoint."""
        del self.waypoints[self._waypoint("waypoints.remove", data)]
        self._tell_waypoints()
        return {}

    def go(self, data: dict[str, Any]) -> dict[str, Any]:
        """Show a waypoint."""
        self.desk.steer(self.waypoints[self._waypoint("waypoints.go", data)], None)
        return {}

    def forget(self, data: dict[str, Any]) -> dict[str, Any]:
        """Forget all waypoints."""
        Fields("waypoints.clear", data, [])
        self.waypoints.clear()
        self._tell_waypoints()
        return {}

    def close(self) -> None:
        """End what runs."""
        self.jobs.close()
        self._contacts.close()

    def publish(self) -> None:
        """Tell the pages that there is nothing yet."""
        self.desk.view.panel("motion", None)
        self.desk.view.panel("job", None)
        self._tell_waypoints()

    def _waypoint(self, request: str, data: dict[str, Any]) -> int:
        fields = Fields(request, data, ["index"])
        if not self.waypoints:
            raise ValueError(f"{request}: there are no waypoints")
        return fields.whole("index", 0, len(self.waypoints) - 1)

    def _require_still(self, request: str) -> None:
        if self.desk.running:
            raise ValueError(f"{request}: a controller moves the arm; expected it to be stopped first")

    def _configuration(self, goal: Fields, arm: Arm, start: Array) -> Array:
        if "T" in goal:
            found: Array = solved(arm, goal.pose("T"), start)[0].require(start)
            return found
        return goal.vector("q", arm.n, LARGEST_JOINT_VALUE)

    def _through(self, kind: str, duration: float | None) -> dict[str, Any]:
        arm, points = self.desk.arm, [x.copy() for x in self.waypoints]
        if kind not in ("quintic", "least-time"):
            raise ValueError("motion.plan: waypoints are gone through by a quintic spline or in least time alone")
        if len(points) < 2:
            raise ValueError("motion.plan: fewer than 2 waypoints; expected some to go through")
        for k, (one, other) in enumerate(pairwise(points), start=1):
            if np.abs(one - other).max() < SAME:
                raise ValueError(f"motion.plan: waypoints {k} and {k + 1} are the same")
        if kind == "least-time":
            return self._started("least time", lambda job: _quickest(arm, points[0], points[-1], points[1:-1], job))
        times = None if duration is None else np.linspace(0.0, duration, len(points))
        made = f"arm.spline({literal(np.array(points))}, {'None' if times is None else literal(times)})"
        self._take(arm.spline(np.array(points), times), "waypoints", made)
        return {}

    def _started(self, title: str, work: Callable[[Job], tuple[Trajectory, str]]) -> dict[str, Any]:
        return {"job": self.jobs.start(title, work, lambda found: self._take(found[0], title, found[1], planned=True))}

    def _take(self, motion: Trajectory, kind: str, made: str, planned: bool = False) -> None:
        """Play a motion, unless a controller moves the arm, and tell its numbers."""
        if motion.duration > LONGEST:
            raise ValueError(f"the motion lasts {motion.duration:g} s; expected at most {LONGEST:g} s")
        arm = self.desk.arm
        times = np.linspace(0.0, motion.duration, SHOWN)
        shown, speeds = motion.q(times), motion.qd(times)
        torques = motion.tau(times) if all(joint.bodies for joint in arm.description.joints) else None
        excess = exceeded_limit(arm.description, shown, speeds, torques)
        state = {
            "kind": kind,
            "duration": motion.duration,
            "times": times.tolist(),
            "q": shown.tolist(),
            "qd": speeds.tolist(),
            "tau": None if torques is None else torques.tolist(),
            "limits": limits_state(arm.description),
            "touching": None,
            "excess": excess,
        }
        q = motion.q(np.linspace(0.0, motion.duration, CHECKED))
        if not np.isfinite(q).all() or np.abs(q).max() > LARGEST_JOINT_VALUE:
            raise ValueError(f"the motion's joint values go beyond {LARGEST_JOINT_VALUE:g}")
        self.desk.view.panel("motion", state)
        self.motion, self.excess, self.kind, self.made = motion, excess, kind, made
        if not planned:
            self.jobs.cancel()
            self.desk.view.panel("job", None)
        if not self.desk.running:
            self.desk.view.play(motion)
        self._tell_changed()

        def tell(links: list[list[int]]) -> None:
            if any(links) and self.motion is motion:
                self.desk.view.panel("motion", state | {"touching": links})

        # Told behind the motion: the first time it takes a second.
        self._contacts.start("contacts", lambda job: touching(arm, q), tell)

    def _tell_changed(self) -> None:
        for call in self.changed:
            call()

    def _tell_waypoints(self) -> None:
        points = [{"name": f"waypoint {k}", "q": q.tolist()} for k, q in enumerate(self.waypoints, start=1)]
        self.desk.view.panel("waypoints", points)

    def _forget(self) -> None:
        self.jobs.cancel()
        self.motion = None
        self.waypoints.clear()
        self.publish()


def literal(array: ArrayLike) -> str:
    """Return an array as Python writes it."""
    return f"np.array({np.asarray(array).tolist()!r})"


def _quickest(arm: Arm, start: Array, goal: Array, via: list[Array], job: Job) -> tuple[Trajectory, str]:
    def told(now: Progress) -> None:
        job.progress(f"iteration {now.iteration}: {now.duration:.3f} s")

    job.progress("making the program")
    through = f", via={literal(np.array(via))}" if via else ""
    made = f"arm.plan({literal(start)}, {literal(goal)}{through})"
    return arm.plan(start, goal, via=via, compare=False, progress=told), made


def _circle(arm: Arm, start: Array, duration: float | None) -> tuple[Trajectory, str]:
    """Return a full circle of the tool, about the axis along which the arm has most room: its own z, or the world's."""
    T = arm.fk(start)
    radius = CIRCLE * (arm.description.reach or 1.0)
    wrong: DhkitError | None = None
    for axis, towards in (((0.0, 0.0, 1.0), -T[:3, 3] * [1, 1, 0]), ((0.0, 1.0, 0.0), -T[:3, 3] * [1, 0, 1])):
        length = float(np.linalg.norm(towards))
        if length < 1e-9:
            continue
        centre = T[:3, 3] + radius * towards / length
        q0 = literal(start)
        made = f"arm.circle(arm.fk({q0}), {literal(centre)}, {axis}, q0={q0}, duration={duration!r})"
        try:
            return arm.circle(T, centre, axis, q0=start, duration=duration), made
        except DhkitError as error:
            wrong = error
    raise wrong or DescriptionError("the tool stands on the base's axis; expected a place beside it")
