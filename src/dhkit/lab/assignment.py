"""Assignments: a robot, texts and goals, read from a TOML file; nothing in it is run."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array, library_robot, pose, read_robot
from dhkit.description.files import read_bounded
from dhkit.description.toml_text import plain_numbers, toml_document
from dhkit.display import counted, html_block, html_table, plain, repr_line, value_line
from dhkit.errors import DescriptionError, DhkitError
from dhkit.kinematics import classify
from dhkit.lab.assignment_form import AssignmentForm, GoalForm, PoseForm, StepForm, validated
from dhkit.trajectories import Trajectory

MAX_BYTES = 100_000
MAX_BYTES_OF_ROBOT = 1_000_000
"""Of a robot file: what is longer is neither."""
ROUNDING = 1e-9
"""Of joint limits (rad, m), durations (s) and shares of points."""


@dataclass(frozen=True, eq=False)
class ToolAt:
    """The tool at a pose.

    Attributes
    ----------
    T
        The pose in the world, shape (4, 4).
    turned
        Whether its rotation counts; otherwise the position alone.
    position, angle
        Largest distance, m, and largest angle between the two rotations, rad.
    """

    T: Array
    turned: bool
    position: float
    angle: float

    def met(self, T: Array) -> bool:
        """Return whether a pose of the tool, shape (4, 4), is near enough."""
        if np.linalg.norm(T[:3, 3] - self.T[:3, 3]) > self.position:
            return False
        # The Frobenius norm of the difference of two rotations is 2 sqrt(2) times the sine of half the angle between.
        chord = float(np.linalg.norm(T[:3, :3] - self.T[:3, :3])) / np.sqrt(8.0)
        return not self.turned or bool(2 * np.arcsin(min(1.0, chord)) <= self.angle)

    def __repr__(self) -> str:
        return value_line(self)


@dataclass(frozen=True, eq=False)
class JointsAt:
    """Joint values, shape (n,), each within ``joint``, rad or m."""

    q: Array
    joint: float

    def met(self, q: Array) -> bool:
        """Return whether joint values, shape (n,), are near enough; whole turns count."""
        return bool(np.abs(q - self.q).max() <= self.joint)

    def __repr__(self) -> str:
        return value_line(self)


@dataclass(frozen=True, eq=False)
class MotionBetween:
    """A motion from joint values to others, shape (n,) each, within ``joint``, rad or m, and the arm's limits."""

    begin: Array
    end: Array
    joint: float
    duration: float
    """s at most."""

    def met(self, motion: Trajectory, excess: str | None) -> bool:
        """Return whether a motion is one; ``excess`` is the limit that it exceeds."""
        if excess is not None or motion.duration > self.duration + ROUNDING:
            return False
        ends = motion.q(np.array([0.0, motion.duration]))
        return bool(np.abs(ends - np.stack([self.begin, self.end])).max() <= self.joint)

    def __repr__(self) -> str:
        return value_line(self)


@dataclass(frozen=True)
class OwnScore:
    """A share, from 0 to 1, of the points of a function of the person's own program."""

    function: Literal["fk", "ik", "controller"]
    share: float

    def met(self, report: Mapping[str, Any]) -> bool:
        """Return whether a report, as :meth:`dhkit.programs.CheckReport.to_dict` has it, says so."""
        parts = report.get("functions", {}).get(self.function, ())
        most = sum(part["most"] for part in parts)
        return bool(most > 0 and sum(part["points"] for part in parts) >= (self.share - ROUNDING) * most)


Condition: TypeAlias = ToolAt | JointsAt | MotionBetween | OwnScore


@dataclass(frozen=True, eq=False)
class Goal:
    """What is to be reached, in words, and as a condition that is checked."""

    text: str
    points: float
    condition: Condition

    def __repr__(self) -> str:
        return repr_line("Goal", said=f"{counted(self.points, 'point')}, {self.text}")


@dataclass(frozen=True, eq=False)
class Step:
    """A step: a title, a text of paragraphs between empty lines, a panel to open, and goals."""

    title: str
    text: str
    panel: str | None
    goals: tuple[Goal, ...]

    def __repr__(self) -> str:
        return repr_line(f"Step {plain(self.title, 80)}", said=counted(len(self.goals), "goal"))


@dataclass(frozen=True, eq=False)
class Assignment:
    """A robot, where it begins, and steps with goals.

    Attributes
    ----------
    title
        In one line.
    arm
        The robot.
    start
        Joint values, shape (n,), rad and m; None for those that the lab shows anyway.
    panels
        Names of the panels that are shown beside the task's; None for all.
    steps
        In their order.

    Examples
    --------
    >>> from pathlib import Path
    >>> _ = Path("wave.toml").write_text('''
    ... kind = "assignment"
    ... format = 1
    ... title = "Stretch the arm"
    ... robot = "planar2r"
    ... [[step]]
    ... title = "With the sliders"
    ... [[step.goal]]
    ... text = "The arm straight up"
    ... joints = ["pi/2", 0]
    ... ''')
    >>> assignment = Assignment.read("wave.toml")
    >>> assignment.points, assignment.steps[0].goals[0].condition.q.round(4)
    (1.0, array([1.5708, 0.    ]))
    """

    title: str
    arm: Arm
    start: Array | None
    panels: tuple[str, ...] | None
    steps: tuple[Step, ...]

    @property
    def points(self) -> float:
        """What all goals are worth together."""
        return sum(goal.points for step in self.steps for goal in step.goals)

    @classmethod
    def read(cls, path: str | Path) -> Assignment:
        """Read an assignment: a TOML file with ``kind = "assignment"``; a robot file that it names is beside it.

        Raises
        ------
        DescriptionError
            No such file, one over 100 kB, no TOML, an unknown key, a value that does not fit, or a goal that the robot
            cannot reach: names the file, the key, what was found and what was expected.
        """
        path = Path(path)
        content = read_bounded(path, MAX_BYTES, "an assignment")
        try:
            form = validated(plain_numbers(toml_document(content.decode())))
            arm = _arm_of(form.robot, path.parent)
            start = None if form.start is None else _joint_values(arm, form.start, "start: ")
            steps = tuple(_step(arm, step, form, f"step {k}: ") for k, step in enumerate(form.step, start=1))
        except (DescriptionError, UnicodeDecodeError) as error:
            raise DescriptionError(f"{path}: {error}") from None
        return cls(form.title, arm, start, form.panels, steps)

    def require(self, arm: Arm) -> None:
        """Refuse another robot than the assignment's.

        Raises
        ------
        DescriptionError
            It is another one.
        """
        if arm.description.digest != self.arm.description.digest:
            raise DescriptionError(f"found {arm.name}; expected {self.arm.name} as the assignment has it")

    def __repr__(self) -> str:
        said = f"{counted(len(self.steps), 'step')}, {counted(self.points, 'point')}, {self.arm.name}"
        return repr_line(f"Assignment {plain(self.title, 60)}", said=said)

    def _repr_html_(self) -> str:
        rows = [(step.title, f"{goal.points:g}", goal.text) for step in self.steps for goal in step.goals]
        return html_block(f"{self.title}: {self.arm.name}", html_table(("step", "points", "goal"), rows, align="lrl"))


def is_assignment(path: str | Path) -> bool:
    """Return whether a file is TOML that says ``kind = "assignment"``; what else it says is not looked at.

    Raises
    ------
    DescriptionError
        It says a kind that nearly is this one.
    """
    if Path(path).suffix.lower() != ".toml":
        return False
    try:
        document = toml_document(read_bounded(Path(path), MAX_BYTES_OF_ROBOT).decode())
    except (DhkitError, UnicodeDecodeError):
        return False
    kind = document.get("kind")
    if isinstance(kind, str) and kind != "assignment" and difflib.get_close_matches(kind, ["assignment"]):
        raise DescriptionError(f"{path}: kind is {kind[:40]!r}; expected 'assignment', or no kind for a robot file")
    return kind == "assignment"


def _arm_of(name: str, folder: Path) -> Arm:
    """Return a robot of the library, or of a file in an assignment's own folder."""
    if not name.endswith(".toml"):
        try:
            return Arm(library_robot(name))
        except DescriptionError as error:
            raise DescriptionError(f"robot: {error}") from None
    expected = "expected a library name, or a robot file beside the assignment"
    inside = folder.resolve()
    try:
        path = (inside / name).resolve()
    except (ValueError, OSError, RuntimeError):  # a NUL in the name, one too long, a link to itself
        raise DescriptionError(f"robot: {name[:60]!r} is no file name; {expected}") from None
    if not name.isprintable() or not path.is_relative_to(inside):
        raise DescriptionError(f"robot: {name[:60]!r} leaves the assignment's folder; {expected}")
    try:
        return Arm(read_robot(path))
    except DescriptionError as error:
        raise DescriptionError(f"robot: {error}") from None


def _step(arm: Arm, form: StepForm, assignment: AssignmentForm, place: str) -> Step:
    if assignment.panels is not None and form.panel not in (None, *assignment.panels):
        raise DescriptionError(f"{place}panel: found {form.panel!r}; expected one that panels lists")
    goals = tuple(_goal(arm, goal, f"{place}goal {k}: ") for k, goal in enumerate(form.goal, start=1))
    return Step(form.title, form.text or "", form.panel, goals)


def _goal(arm: Arm, form: GoalForm, place: str) -> Goal:
    return Goal(form.text, form.points, _condition(arm, form, place))


def _condition(arm: Arm, form: GoalForm, place: str) -> Condition:
    within = form.tolerance
    if form.pose is not None:
        return _tool_at(arm, form.pose, within.position, within.angle, f"{place}pose: ")
    if form.joints is not None:
        return JointsAt(_joint_values(arm, form.joints, f"{place}joints: "), within.joint)
    if form.motion is not None:
        begin = _joint_values(arm, form.motion.begin, f"{place}motion.from: ")
        end = _joint_values(arm, form.motion.end, f"{place}motion.to: ")
        if np.abs(begin - end).max() <= within.joint:
            raise DescriptionError(f"{place}motion: it ends where it begins; expected two configurations")
        longest = np.inf if form.motion.duration is None else form.motion.duration
        return MotionBetween(begin, end, within.joint, longest)
    own = form.own
    assert own is not None  # noqa: S101 - for mypy: the form has exactly one
    return OwnScore(own.function, own.share)


def _joint_values(arm: Arm, given: str | tuple[float, ...], place: str) -> Array:
    """Return joint values, shape (n,), that are inside the limits."""
    if isinstance(given, str):
        known = {"zero": np.zeros(arm.n), **arm.configurations}
        if given not in known:
            found = f"{arm.name} has no configuration {given[:40]!r}"
            raise DescriptionError(f"{place}{found}; expected {', '.join(known)}, or a list of joint values")
        q = np.array(known[given])
    elif len(given) != arm.n:
        raise DescriptionError(f"{place}found {len(given)} joint values; expected {arm.n} for {arm.name}")
    else:
        q = np.array(given)
    numbers = arm.description.numbers
    for i in np.flatnonzero((q < numbers.lower - ROUNDING) | (q > numbers.upper + ROUNDING)):
        joint, limits = arm.description.joints[i].name, f"{numbers.lower[i]:.4g} to {numbers.upper[i]:.4g}"
        raise DescriptionError(f"{place}{joint} is {q[i]:.4g}; expected {limits}, its limits")
    return q


def _tool_at(arm: Arm, form: PoseForm, position: float, angle: float, place: str) -> ToolAt:
    T = pose(form.xyz, euler=form.euler, order=form.order)
    description = arm.description
    numbers = description.numbers
    away = float(np.linalg.norm(T[:3, 3] - numbers.T_world_base[:3, 3]))
    reach = numbers.reach + float(np.linalg.norm(numbers.T_last_tool[:3, 3]))
    if away > reach + position:
        raise DescriptionError(f"{place}{away:.4g} m from the base; expected at most {reach:.4g} m, the arm's reach")
    fit = classify(description).fit
    # With a rotation the pose must be met; without one, the position of an arm that has no other choice.
    decided = fit is not None and ((form.euler is not None and arm.n >= 6) or set(fit.met) <= {"x", "y", "z"})
    if decided:
        found = arm.ik(T)
        near = 0 < float(found.distance) <= position  # beyond the workspace by less than the tolerance
        if not near and not bool(np.any(found.valid & found.allowed)):
            beyond = "in reach only outside the joint limits" if np.any(found.valid) else "out of reach"
            raise DescriptionError(f"{place}{beyond}; expected a pose that the arm can take")
    return ToolAt(T, form.euler is not None, position, angle)
