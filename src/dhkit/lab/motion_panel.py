"""The panel of motions: planned, taught or read from a file, played and plotted with their limits."""

from __future__ import annotations

import base64
import binascii
import tempfile
from collections.abc import Callable, Collection
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dhkit.arm import Arm
from dhkit.description import Array
from dhkit.errors import DescriptionError, DhkitError
from dhkit.lab.contacts import NearestState, contacts_along
from dhkit.lab.desk import Desk, file_content, has_bodies
from dhkit.lab.jobs import Job, Jobs
from dhkit.lab.obstacle_panel import ObstaclePanel
from dhkit.lab.record import LIMIT_SAMPLES, limit_times
from dhkit.lab.requests import MAX_JOINT_VALUE, MAX_TEXT_LENGTH, Fields, JsonObject, Panel, answers
from dhkit.lab.tool_panel import solve_pose
from dhkit.planning import Progress
from dhkit.trajectories import Trajectory, read_motion
from dhkit.trajectories.files import TRAJECTORY
from dhkit.trajectories.matlab_samples import matlab_choices
from dhkit.viewer.interactive import limits_state
from dhkit.viewer.motion import exceeded_limit

KINDS = ("quintic", "trapezoidal", "least-time", "line", "circle")
GOAL_FIELDS = ("q", "T", "waypoints", "radius", "plane", "centre")
PLANES = {"horizontal": (0.0, 0.0, 1.0), "xz": (0.0, 1.0, 0.0), "yz": (1.0, 0.0, 0.0)}
"""Normals of the planes of circles, world."""
MAX_DURATION = 600.0
"""Longest duration of a motion, s."""
CONTACT_SAMPLES = 101
"""Samples of a motion at which contacts of links and obstacles are looked for."""
CONTACT_DELAY = 0.2
"""Time before they are looked for, s: an obstacle that a person drags moves again soon."""
MAX_WAYPOINTS = 100
MAX_FILE_LENGTH = 700_000
"""Largest length of a file in base64, characters."""
SUFFIXES = (".csv", ".mat", ".npz", ".yaml", ".yml")
SAME_STATE = 1e-9
"""Joint values that differ by less than this, rad and m, are one state."""
USUAL_DURATION = 2.0
"""Duration of a motion that no limit of the arm bounds, s, unless one is given."""
CIRCLE_DURATION = 4.0
"""That of a circle, s."""
CIRCLE_RADIUS = 0.08
"""Radius of a circle, as a share of the arm's reach."""
MIN_LENGTH = 1e-9
"""Distance from the base's axis, m, below which the direction to the axis is not known."""


class PlannedMotion(NamedTuple):
    """A motion with the call that makes it, as Python has it."""

    motion: Trajectory
    call: str
    notes: tuple[str, ...] = ()
    """Sentences about its certificate."""


class MotionPanel(Panel):
    """Requests ``motion.…`` and ``waypoints.…``."""

    def __init__(self, desk: Desk, jobs: Jobs, obstacles: ObstaclePanel) -> None:
        super().__init__(desk)
        self.jobs: Jobs = jobs
        self._obstacles = obstacles
        self.motion: Trajectory | None = None
        self.excess: str | None = None
        """The limit that the motion exceeds most, in words; None if it keeps all limits."""
        self.call = ""
        """The call that makes the motion, as Python has it."""
        self.waypoints: list[Array] = []
        """Joint values that were taught, shape (n,) each, rad and m."""
        self.on_change: list[Callable[[], None]] = []
        """Called when there is another motion, or none."""
        self._contacts = Jobs()
        self._state: dict[str, object] = {}
        """The motion as pages show it."""
        desk.on_replace.append(self._forget)
        desk.on_place.append(self._check_among_obstacles)

    @answers("motion.plan", "kind", "goal", "duration")
    def plan(self, fields: Fields) -> JsonObject | None:
        """Plan a motion from the state on show; one that takes long is answered with the number of its job."""
        kind = fields.choice("kind", KINDS)
        duration = fields.number("duration", 1e-3, MAX_DURATION) if "duration" in fields else None
        arm = self.desk.arm
        start = self.desk.q.copy()
        goal_data = fields.data.get("goal")
        goal = Fields("motion.plan", goal_data if isinstance(goal_data, dict) else {}, GOAL_FIELDS)
        if "waypoints" in goal:
            return self._plan_through_waypoints(kind, duration)
        if kind == "circle":
            circles = _circles(arm, start, goal)
            seconds = duration if duration is not None or _is_limited(arm) else CIRCLE_DURATION
            return self._start_job(kind, lambda job: _first_circle(arm, start, circles, seconds))
        if duration is None and not _is_limited(arm) and kind == "line":
            duration = USUAL_DURATION
        if kind == "line":
            T = goal.pose("T") if "T" in goal else arm.fk(goal.joint_values("q", arm.n))
            call = f"arm.straight_line(arm.fk({literal(start)}), {literal(T)}, {literal(start)}, {duration!r})"
            return self._start_job(
                kind,
                lambda job: PlannedMotion(
                    arm.straight_line(arm.fk(start), T, start, duration), call
                ),
            )
        if "T" in goal:
            end: Array = solve_pose(arm, goal.pose("T"), start)[0].require(start)
        else:
            end = goal.joint_values("q", arm.n)
        if np.abs(end - start).max() < SAME_STATE:
            raise ValueError("motion.plan: the arm is there already; expected another goal")
        if kind == "least-time":
            return self._start_job("least time", self._least_time([start, end]))
        if duration is None and not _is_limited(arm):
            duration = USUAL_DURATION
        make = arm.quintic if kind == "quintic" else arm.trapezoidal
        call = f"arm.{make.__name__}({literal(start)}, {literal(end)}, {duration!r})"
        self._take(kind, PlannedMotion(make(start, end, duration), call))
        return None

    @answers("motion.cancel")
    def cancel(self, _: Fields) -> None:
        """Cancel the job that runs."""
        self.jobs.cancel()

    @answers("motion.clear")
    def clear(self, _: Fields) -> None:
        """Take the motion away."""
        self.motion = None
        self.desk.view.panel("motion", None)
        if not self.desk.running:
            self.desk.show(self.desk.q)
        self._report_change()

    @answers("motion.columns", "name", "content")
    def list_columns(self, fields: Fields) -> JsonObject:
        """Return the variables of a .mat file that may be the times or the joint values."""
        _, content = _file_of(fields, (".mat",))
        try:
            return matlab_choices(self.desk.arm.description, content, TRAJECTORY.most)
        except DescriptionError as error:
            raise ValueError(f"{fields.text('name')}: {error}") from None

    @answers("motion.file", "name", "content", "degrees", "columns")
    def read_file(self, fields: Fields) -> None:
        """Read a motion from a file whose content the page sends; a path would be a file of this machine."""
        suffix, content = _file_of(fields, SUFFIXES)
        degrees = fields.flag("degrees", False)
        columns = fields.data.get("columns")
        if columns is not None and not (
            isinstance(columns, dict) and all(map(_is_text, columns.values()))
        ):
            raise ValueError("motion.file: columns is not an object of texts")
        with tempfile.TemporaryDirectory(prefix="dhkit-lab-") as folder:
            path = Path(folder) / f"file{suffix}"
            path.write_bytes(content)
            try:
                motion = read_motion(
                    path, self.desk.arm.description, degrees=degrees, columns=columns
                )
            except DescriptionError as error:
                raise ValueError(str(error).replace(str(path), fields.text("name"))) from None
        name = f"{self.desk.arm.name}-motion.npz"
        self._take(
            "file", PlannedMotion(motion, f"dhkit.Trajectory.load({name!r})  # downloaded as NPZ")
        )

    @answers("motion.play")
    def play(self, _: Fields) -> None:
        """Play the motion once more, where another state has taken its place."""
        self.desk.view.play(self._movable_motion("motion.play"))

    @answers("motion.show", "time")
    def show(self, fields: Fields) -> None:
        """Show the state at a time of the motion."""
        time = fields.number("time", 0.0, MAX_DURATION)
        motion = self._movable_motion("motion.show")
        self.desk.show(motion.q(min(time, motion.duration)))

    @answers("motion.download", "format")
    def download(self, fields: Fields) -> JsonObject:
        """Return the motion as a file."""
        kind = fields.choice("format", ("csv", "npz"))
        motion = self._require_motion("motion.download")
        return {
            "name": f"{self.desk.arm.name}-motion.{kind}",
            "content": file_content(motion, kind),
        }

    @answers("waypoints.add")
    def add_waypoint(self, _: Fields) -> None:
        """Teach the state on show as a waypoint."""
        if len(self.waypoints) >= MAX_WAYPOINTS:
            raise ValueError(f"waypoints.add: {MAX_WAYPOINTS} waypoints are enough")
        self.waypoints.append(self.desk.q.copy())
        self._publish_waypoints()

    @answers("waypoints.remove", "index")
    def remove_waypoint(self, fields: Fields) -> None:
        """Forget a waypoint."""
        del self.waypoints[self._waypoint_index(fields)]
        self._publish_waypoints()

    @answers("waypoints.go", "index")
    def go_to_waypoint(self, fields: Fields) -> None:
        """Move the arm to a waypoint."""
        self.desk.steer(self.waypoints[self._waypoint_index(fields)], None)

    @answers("waypoints.clear")
    def clear_waypoints(self, _: Fields) -> None:
        """Forget all waypoints."""
        self.waypoints.clear()
        self._publish_waypoints()

    def publish(self) -> None:
        """Tell the pages that there is no motion and no job, and which waypoints there are."""
        self.desk.view.panel("motion", None)
        self.desk.view.panel("job", None)
        self._publish_waypoints()

    def close(self) -> None:
        """End the jobs."""
        super().close()
        self._contacts.close()

    def _waypoint_index(self, fields: Fields) -> int:
        if not self.waypoints:
            raise ValueError(f"{fields.request}: there are no waypoints")
        return fields.integer("index", 0, len(self.waypoints) - 1)

    def _require_motion(self, request: str) -> Trajectory:
        if self.motion is None:
            raise ValueError(f"{request}: there is no motion")
        return self.motion

    def _movable_motion(self, request: str) -> Trajectory:
        """Return the motion, which the arm can be moved along only while no controller moves it."""
        motion = self._require_motion(request)
        if self.desk.running:
            raise ValueError(
                f"{request}: a controller moves the arm; expected it to be stopped first"
            )
        return motion

    def _plan_through_waypoints(self, kind: str, duration: float | None) -> JsonObject | None:
        arm = self.desk.arm
        points = [q.copy() for q in self.waypoints]
        if kind not in ("quintic", "least-time"):
            raise ValueError(
                "motion.plan: waypoints are gone through by a quintic spline or in least time alone"
            )
        if len(points) < 2:
            raise ValueError("motion.plan: fewer than 2 waypoints; expected some to go through")
        for k, (q, next_q) in enumerate(pairwise(points), start=1):
            if np.abs(q - next_q).max() < SAME_STATE:
                raise ValueError(f"motion.plan: waypoints {k} and {k + 1} are the same")
        if kind == "least-time":
            return self._start_job("least time", self._least_time(points))
        times = None if duration is None else np.linspace(0.0, duration, len(points))
        call = f"arm.spline({literal(points)}, {'None' if times is None else literal(times)})"
        self._take("waypoints", PlannedMotion(arm.spline(np.array(points), times), call))
        return None

    def _least_time(self, points: list[Array]) -> Callable[[Job], PlannedMotion]:
        """Return the work that plans a motion in least time through joint values, shape (n,) each, around obstacles."""
        arm = self.desk.arm
        scene = self.desk.scene
        start, *via, goal = points
        through = f", via={literal(via)}" if via else ""
        around = (
            f", obstacles=[{', '.join(each.call for each in self._obstacles.placed)}]"
            if scene
            else ""
        )
        call = f"arm.plan({literal(start)}, {literal(goal)}{through}{around})"

        def work(job: Job) -> PlannedMotion:
            def report(progress: Progress) -> None:
                job.progress(f"iteration {progress.iteration}: {progress.duration:.3f} s")

            job.progress("making the program")
            motion = arm.plan(start, goal, via=via, obstacles=scene, compare=False, progress=report)
            notes = motion.report.notes if motion.report is not None else ()
            return PlannedMotion(motion, call, tuple(notes))

        return work

    def _start_job(self, title: str, work: Callable[[Job], PlannedMotion]) -> JsonObject:
        return {
            "job": self.jobs.start(
                title, work, lambda planned: self._take(title, planned, by_job=True)
            )
        }

    def _take(self, kind: str, planned: PlannedMotion, by_job: bool = False) -> None:
        """Publish the numbers of a motion, and play it unless a controller moves the arm; contacts are added later."""
        motion = planned.motion
        arm = self.desk.arm
        if motion.duration > MAX_DURATION:
            raise ValueError(
                f"the motion lasts {motion.duration:g} s; expected at most {MAX_DURATION:g} s"
            )
        # The times at which limits are looked at contain those that are plotted.
        times = limit_times(motion)
        q = motion.q(times)
        qd = motion.qd(times)
        tau = motion.tau(times) if has_bodies(arm) else None
        if not np.isfinite(q).all() or np.abs(q).max() > MAX_JOINT_VALUE:
            raise ValueError(f"the motion's joint values go beyond {MAX_JOINT_VALUE:g}")
        excess = exceeded_limit(arm.description, q, qd, tau)
        plotted = np.searchsorted(times, np.linspace(0.0, motion.duration, LIMIT_SAMPLES))
        state: dict[str, object] = {
            "kind": kind,
            "duration": motion.duration,
            "times": times[plotted].tolist(),
            "q": q[plotted].tolist(),
            "qd": qd[plotted].tolist(),
            "tau": None if tau is None else tau[plotted].tolist(),
            "limits": limits_state(arm.description),
            "contacts": None,
            "excess": excess,
            "notes": list(planned.notes),
        }
        self._state = state
        self.motion = motion
        self.excess = excess
        self.call = planned.call
        # Published last: a page that knows of the motion asks for it.
        self.desk.view.panel("motion", dict(state))
        if not by_job:
            self.jobs.cancel()
            self.desk.view.panel("job", None)
        if not self.desk.running:
            self.desk.view.play(motion)
        self._report_change()
        self._find_contacts()

    def _check_among_obstacles(self) -> None:
        """Look for contacts of the motion with obstacles that have changed; its certificate was about the old ones."""
        if self.motion is None:
            return
        if self._state["notes"]:
            self._state["notes"] = []
            self.desk.view.panel("motion", dict(self._state))
        self._find_contacts()

    def _find_contacts(self) -> None:
        """Publish the contacts along the motion once they are known: computing them takes a second the first time."""
        motion = self.motion
        if motion is None:
            return
        arm = self.desk.arm
        scene = self.desk.scene
        q = motion.q(np.linspace(0.0, motion.duration, CONTACT_SAMPLES))

        def work(job: Job) -> list[NearestState | None]:
            job.wait(CONTACT_DELAY)
            return contacts_along(arm, q, scene)

        def publish(contacts: list[NearestState | None]) -> None:
            if self.motion is not motion or self.desk.scene is not scene:
                return
            had_contacts = self._state["contacts"] is not None
            self._state["contacts"] = contacts if any(contacts) else None
            if had_contacts or any(contacts):
                self.desk.view.panel("motion", dict(self._state))

        self._contacts.start("contacts", work, publish)

    def _report_change(self) -> None:
        for call in self.on_change:
            call()

    def _publish_waypoints(self) -> None:
        points = [
            {"name": f"waypoint {k}", "q": q.tolist()}
            for k, q in enumerate(self.waypoints, start=1)
        ]
        self.desk.view.panel("waypoints", points)

    def _forget(self) -> None:
        """Forget the motion and the waypoints of an arm that another has replaced."""
        self.jobs.cancel()
        self.motion = None
        self.waypoints.clear()
        self.publish()


def literal(array: ArrayLike) -> str:
    """Return an array of any shape as Python writes it."""
    return f"np.array({np.asarray(array).tolist()!r})"


def _is_limited(arm: Arm) -> bool:
    """Return whether the speed or the torque of some joint is limited, so that there is a shortest duration."""
    numbers = arm.description.numbers
    is_fast = np.isfinite(numbers.velocity).any()
    return bool(is_fast or (has_bodies(arm) and np.isfinite(numbers.effort).any()))


def _file_of(fields: Fields, suffixes: Collection[str]) -> tuple[str, bytes]:
    """Return the suffix and the content of the file that a request holds."""
    suffix = Path(fields.text("name")).suffix.lower()
    if suffix not in suffixes:
        raise ValueError(
            f"{fields.request}: name ends in {suffix[:10]!r}; expected {', '.join(suffixes)}"
        )
    try:
        return suffix, base64.b64decode(fields.text("content", MAX_FILE_LENGTH), validate=True)
    except (binascii.Error, ValueError):
        raise ValueError(f"{fields.request}: content is not in base64") from None


def _is_text(value: object) -> bool:
    return isinstance(value, str) and len(value) <= MAX_TEXT_LENGTH


class Circle(NamedTuple):
    """A full circle of the tool from where it is."""

    centre: Array
    """Shape (3,), m, world."""
    axis: tuple[float, float, float]
    """Normal of its plane, world."""

    def planned(self, arm: Arm, start: Array, duration: float | None) -> PlannedMotion:
        """Return the motion from joint values, shape (n,), in a duration, s; the shortest if None."""
        q0 = literal(start)
        call = f"arm.circle(arm.fk({q0}), {literal(self.centre)}, {self.axis}, q0={q0}, duration={duration!r})"
        return PlannedMotion(
            arm.circle(arm.fk(start), self.centre, self.axis, q0=start, duration=duration), call
        )


def _circles(arm: Arm, start: Array, goal: Fields) -> list[Circle]:
    """Return the circle that a request asks for, in the plane that it names or in each of several to be tried.

    A circle is about a centre, or has a radius and its centre towards the normal through the world's origin.
    """
    position = arm.fk(start)[:3, 3]
    planes = [goal.choice("plane", list(PLANES))] if "plane" in goal else list(PLANES)
    radius = goal.number("radius", MIN_LENGTH, 1e3, CIRCLE_RADIUS * (arm.description.reach or 1.0))
    circles = []
    for plane in planes:
        axis = np.array(PLANES[plane])
        if "centre" in goal:
            centre = goal.vector("centre", 3)
            # The circle lies in the plane through the tool.
            circles.append(Circle(centre + axis * ((position - centre) @ axis), PLANES[plane]))
            continue
        towards = -position + axis * (position @ axis)
        length = float(np.linalg.norm(towards))
        if length > MIN_LENGTH:
            circles.append(Circle(position + radius * towards / length, PLANES[plane]))
    if not circles:
        raise DescriptionError(
            "the tool stands on the normal through the origin; expected a centre, or another place"
        )
    return circles


def _first_circle(
    arm: Arm, start: Array, circles: list[Circle], duration: float | None
) -> PlannedMotion:
    """Return the motion along the first circle that the arm can follow."""
    for circle in circles[:-1]:
        try:
            return circle.planned(arm, start, duration)
        except DhkitError:
            continue
    return circles[-1].planned(arm, start, duration)
