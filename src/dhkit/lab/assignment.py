"""Assignments: a robot, texts and goals, read from a TOML file; nothing in it is run."""

from __future__ import annotations

import difflib
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array, library_robot, pose, read_robot
from dhkit.description.files import read_bounded
from dhkit.description.toml_text import plain_numbers, toml_document
from dhkit.display import counted, html_block, html_table, plain, repr_line, value_line
from dhkit.errors import DescriptionError, DhkitError
from dhkit.kinematics import classify
from dhkit.lab.assignment_form import GoalForm, PoseForm, ToleranceForm, validated
from dhkit.lab.run_settings import Settings
from dhkit.trajectories import Trajectory

MAX_BYTES = 100_000
MAX_ROBOT_BYTES = 1_000_000
"""Largest size of a file that is looked at to tell an assignment from a robot file."""
GOAL_TOLERANCE = 1e-9
"""Rounding that joint limits (rad, m), durations (s) and shares of points may be exceeded by."""


class Condition:
    """Condition that a goal asks for; its subclasses are the kinds of conditions."""

    __repr__ = value_line


@dataclass(frozen=True, eq=False, repr=False)
class ToolAt(Condition):
    """The tool at a pose.

    Attributes
    ----------
    T
        The pose, shape (4, 4), m, world.
    turned
        Whether the rotation counts; otherwise only the position does.
    position, angle
        Largest distance, m, and largest angle between the two rotations, rad.
    """

    T: Array
    turned: bool
    position: float
    angle: float

    def is_reached(self, T: Array) -> bool:
        """Return whether a pose of the tool, shape (4, 4), m, world, is near enough."""
        if np.linalg.norm(T[:3, 3] - self.T[:3, 3]) > self.position:
            return False
        # The Frobenius norm of the difference of two rotations is 2 sqrt(2) times the sine of half the angle between.
        chord = float(np.linalg.norm(T[:3, :3] - self.T[:3, :3])) / np.sqrt(8.0)
        return not self.turned or bool(2 * np.arcsin(min(1.0, chord)) <= self.angle)


@dataclass(frozen=True, eq=False, repr=False)
class JointsAt(Condition):
    """Joint values.

    Attributes
    ----------
    q
        The joint values, shape (n,), rad and m.
    joint
        Largest difference of each joint value, rad or m.
    """

    q: Array
    joint: float

    def is_reached(self, q: Array) -> bool:
        """Return whether joint values, shape (n,), rad and m, are near enough; whole turns count."""
        return bool(np.abs(q - self.q).max() <= self.joint)


@dataclass(frozen=True, eq=False, repr=False)
class MotionBetween(Condition):
    """A motion between joint values, within the arm's limits.

    Attributes
    ----------
    begin, end
        Joint values at the beginning and the end, shape (n,), rad and m.
    joint
        Largest difference of each joint value there, rad or m.
    duration
        Longest duration, s.
    """

    begin: Array
    end: Array
    joint: float
    duration: float

    def is_reached(self, motion: Trajectory, excess: str | None) -> bool:
        """Return whether a motion is as asked for; ``excess`` names the limit that it exceeds, None if it keeps all."""
        if excess is not None or motion.duration > self.duration + GOAL_TOLERANCE:
            return False
        ends = motion.q(np.array([0.0, motion.duration]))
        return bool(np.abs(ends - np.stack([self.begin, self.end])).max() <= self.joint)


@dataclass(frozen=True, repr=False)
class OwnScore(Condition):
    """A score of a function of the person's own program.

    Attributes
    ----------
    function
        The function.
    share
        Smallest share of the function's points, from 0 to 1.
    """

    function: Literal["fk", "ik", "controller"]
    share: float

    def is_reached(self, report: Mapping[str, object]) -> bool:
        """Return whether a report, as :meth:`dhkit.programs.CheckReport.to_dict` has it, has enough points."""
        functions = report.get("functions", {})
        parts = functions.get(self.function, ()) if isinstance(functions, Mapping) else ()
        max_points = sum(part["most"] for part in parts)
        return bool(
            max_points > 0
            and sum(part["points"] for part in parts) >= (self.share - GOAL_TOLERANCE) * max_points
        )


@dataclass(frozen=True, repr=False)
class AnswerRight(Condition):
    """An entry of the robot's equations or kinematics that is judged to be right.

    Attributes
    ----------
    name
        Name of the entry, such as ``M11``.
    """

    name: str


@dataclass(frozen=True, repr=False)
class NumberIs(Condition):
    """A number that is typed.

    Attributes
    ----------
    value
        The right number.
    tolerance
        Largest difference from it.
    """

    value: float
    tolerance: float

    def is_reached(self, number: float) -> bool:
        """Return whether a number is near enough."""
        return abs(number - self.value) <= self.tolerance


@dataclass(frozen=True, repr=False)
class ControlWithin(Condition):
    """A simulated run whose errors stay small for a time.

    Attributes
    ----------
    error
        Largest error of each joint value, rad or m.
    seconds
        Time for which it is kept without a break, s.
    reference
        Name of what the run follows: ``sine`` or ``motion``.
    payload
        Smallest load at the tool, kg.
    controller
        Name of the controller; None for any.
    """

    error: float
    seconds: float
    reference: str
    payload: float
    controller: str | None

    def is_kept(self, settings: Settings, errors: Array) -> bool:
        """Return whether a run with these settings is asked for, and its errors, shape (k,), rad and m, are small."""
        is_asked_for = (
            settings.reference.value == self.reference and settings.payload >= self.payload
        )
        has_controller = self.controller in (None, settings.controller)
        return bool(is_asked_for and has_controller and np.abs(errors).max() <= self.error)


@dataclass(frozen=True, eq=False)
class Goal:
    """Goal of a step.

    Attributes
    ----------
    text
        The goal in words.
    points
        Points of the goal.
    condition
        The goal as a condition that is checked.
    """

    text: str
    points: float
    condition: Condition

    def __repr__(self) -> str:
        return repr_line("Goal", summary=f"{counted(self.points, 'point')}, {self.text}")


@dataclass(frozen=True, eq=False)
class Step:
    """A step of an assignment.

    Attributes
    ----------
    title, text
        Its title, and paragraphs between empty lines.
    panel
        Name of the panel to open; None for none.
    goals
        Its goals, in their order.
    """

    title: str
    text: str
    panel: str | None
    goals: tuple[Goal, ...]

    def __repr__(self) -> str:
        return repr_line(f"Step {plain(self.title, 80)}", summary=counted(len(self.goals), "goal"))


class Place(NamedTuple):
    """The place of a goal in an assignment, counted from 0."""

    step: int
    goal: int


@dataclass(frozen=True, eq=False)
class Assignment:
    """A robot, the joint values where it begins, and steps with goals.

    Attributes
    ----------
    title
        Title, one line.
    arm
        The robot.
    start
        Joint values at the beginning, shape (n,), rad and m; None for those that the lab shows by default.
    panels
        Names of the panels that are shown beside that of the task; None for all.
    steps
        The steps, in their order.
    digest
        SHA-256 of the file and its robot, in hexadecimal: records of work name the assignment by it.

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
    digest: str = ""

    @property
    def places(self) -> tuple[Place, ...]:
        """The places of all goals, in their order."""
        places = []
        for i, step in enumerate(self.steps):
            places += [Place(i, j) for j in range(len(step.goals))]
        return tuple(places)

    @property
    def points(self) -> float:
        """The points of all goals together."""
        goals = chain.from_iterable(step.goals for step in self.steps)
        return sum(goal.points for goal in goals)

    @classmethod
    def read(cls, path: str | Path) -> Assignment:
        """Read an assignment: a TOML file with ``kind = "assignment"``; a robot file that it names is beside it.

        Raises
        ------
        DescriptionError
            There is no such file, it is over 100 kB or no TOML, or it has an unknown key, a value that does not fit or
            a goal that the robot cannot reach. The message names the file, the key, what was found and what was
            expected.
        """
        path = Path(path)
        content = read_bounded(path, MAX_BYTES, "an assignment")
        try:
            form = validated(plain_numbers(toml_document(content.decode())))
            arm = _arm_of(form.robot, path.parent)
            start = None if form.start is None else _joint_values(arm, form.start, "start: ")
            steps = []
            for k, step in enumerate(form.step, start=1):
                place = f"step {k}: "
                if form.panels is not None and step.panel not in (None, *form.panels):
                    raise DescriptionError(
                        f"{place}panel: found {step.panel!r}; expected one that panels lists"
                    )
                goals = tuple(
                    Goal(goal.text, goal.points, _condition(arm, goal, f"{place}goal {i}: "))
                    for i, goal in enumerate(step.goal, start=1)
                )
                steps.append(Step(step.title, step.text or "", step.panel, goals))
        except (DescriptionError, UnicodeDecodeError) as error:
            raise DescriptionError(f"{path}: {error}") from None
        digest = hashlib.sha256(content + arm.description.digest.encode()).hexdigest()
        return cls(form.title, arm, start, form.panels, tuple(steps), digest)

    def require(self, arm: Arm) -> None:
        """Refuse another robot than the assignment's.

        Raises
        ------
        DescriptionError
            The robot is another one.
        """
        if arm.description.digest != self.arm.description.digest:
            raise DescriptionError(
                f"found {arm.name}; expected {self.arm.name} as the assignment has it"
            )

    def __repr__(self) -> str:
        content = (
            f"{counted(len(self.steps), 'step')}, {counted(self.points, 'point')}, {self.arm.name}"
        )
        return repr_line(f"Assignment {plain(self.title, 60)}", summary=content)

    def _repr_html_(self) -> str:
        rows = []
        for step in self.steps:
            rows += [(step.title, f"{goal.points:g}", goal.text) for goal in step.goals]
        return html_block(
            f"{self.title}: {self.arm.name}",
            html_table(("step", "points", "goal"), rows, align="lrl"),
        )


def is_assignment(path: str | Path) -> bool:
    """Return whether a file is TOML with ``kind = "assignment"``; its other contents do not count.

    Raises
    ------
    DescriptionError
        The kind is a misspelling of this one.
    """
    if Path(path).suffix.lower() != ".toml":
        return False
    try:
        document = toml_document(read_bounded(Path(path), MAX_ROBOT_BYTES).decode())
    except (DhkitError, UnicodeDecodeError):
        return False
    kind = document.get("kind")
    if (
        isinstance(kind, str)
        and kind != "assignment"
        and difflib.get_close_matches(kind, ["assignment"])
    ):
        raise DescriptionError(
            f"{path}: kind is {kind[:40]!r}; expected 'assignment', or no kind for a robot file"
        )
    return kind == "assignment"


def _arm_of(name: str, folder: Path) -> Arm:
    """Return a robot of the library, or of a file in an assignment's own folder."""
    try:
        return Arm(
            read_robot(_robot_path(name, folder)) if name.endswith(".toml") else library_robot(name)
        )
    except DescriptionError as error:
        raise DescriptionError(f"robot: {error}") from None


def _robot_path(name: str, folder: Path) -> Path:
    expected = "expected a library name, or a robot file beside the assignment"
    inside = folder.resolve()
    try:
        path = (inside / name).resolve()
    except (ValueError, OSError, RuntimeError):  # a NUL in the name, one too long, a link to itself
        raise DescriptionError(f"{name[:60]!r} is not a file name; {expected}") from None
    if not name.isprintable() or not path.is_relative_to(inside):
        raise DescriptionError(f"{name[:60]!r} leaves the assignment's folder; {expected}")
    return path


def _condition(arm: Arm, form: GoalForm, place: str) -> Condition:
    tolerance = form.tolerance
    if form.pose is not None:
        return _tool_at(arm, form.pose, tolerance, f"{place}pose: ")
    if form.joints is not None:
        return JointsAt(_joint_values(arm, form.joints, f"{place}joints: "), tolerance.joint)
    if form.motion is not None:
        begin = _joint_values(arm, form.motion.begin, f"{place}motion.from: ")
        end = _joint_values(arm, form.motion.end, f"{place}motion.to: ")
        if np.abs(begin - end).max() <= tolerance.joint:
            raise DescriptionError(
                f"{place}motion: it ends where it begins; expected two configurations"
            )
        max_duration = np.inf if form.motion.duration is None else form.motion.duration
        return MotionBetween(begin, end, tolerance.joint, max_duration)
    if form.answer is not None:
        return AnswerRight(form.answer.name)
    if form.number is not None:
        return NumberIs(form.number.value, form.number.tolerance)
    if form.control is not None:
        control = form.control
        return ControlWithin(
            control.error, control.seconds, control.reference, control.payload, control.controller
        )
    own = form.own
    assert own is not None  # noqa: S101 - for mypy: the form has exactly one
    return OwnScore(own.function, own.share)


def _joint_values(arm: Arm, given: str | tuple[float, ...], place: str) -> Array:
    """Return the joint values, shape (n,), rad and m, of a configuration or a list, if they are inside the limits."""
    if isinstance(given, str):
        configurations = {"zero": np.zeros(arm.n), **arm.configurations}
        if given not in configurations:
            found = f"{arm.name} has no configuration {given[:40]!r}"
            raise DescriptionError(
                f"{place}{found}; expected {', '.join(configurations)}, or a list of joint values"
            )
        q = np.array(configurations[given])
    elif len(given) != arm.n:
        raise DescriptionError(
            f"{place}found {len(given)} joint values; expected {arm.n} for {arm.name}"
        )
    else:
        q = np.array(given)
    numbers = arm.description.numbers
    for i in np.flatnonzero(
        (q < numbers.lower - GOAL_TOLERANCE) | (q > numbers.upper + GOAL_TOLERANCE)
    ):
        joint = arm.description.joints[i].name
        limits = f"{numbers.lower[i]:.4g} to {numbers.upper[i]:.4g}"
        raise DescriptionError(f"{place}{joint} is {q[i]:.4g}; expected {limits}, its limits")
    return q


def _tool_at(arm: Arm, form: PoseForm, tolerance: ToleranceForm, place: str) -> ToolAt:
    T = pose(form.xyz, euler=form.euler, order=form.order)
    numbers = arm.description.numbers
    distance = float(np.linalg.norm(T[:3, 3] - numbers.T_world_base[:3, 3]))
    reach = numbers.reach + float(np.linalg.norm(numbers.T_last_tool[:3, 3]))
    if distance > reach + tolerance.position:
        raise DescriptionError(
            f"{place}{distance:.4g} m from the base; expected at most {reach:.4g} m, the arm's reach"
        )
    fit = classify(arm.description).fit
    # With a rotation, the closed form of six joints decides whether the pose is reached; without one, the closed form
    # of an arm whose solutions meet the position alone.
    if fit is not None and (
        (form.euler is not None and arm.n >= 6) or set(fit.coordinates) <= {"x", "y", "z"}
    ):
        solutions = arm.ik(T)
        # Beyond the workspace by less than the tolerance.
        is_near = 0 < float(solutions.distance) <= tolerance.position
        if not is_near and not bool(np.any(solutions.valid & solutions.allowed)):
            problem = (
                "in reach only outside the joint limits"
                if np.any(solutions.valid)
                else "out of reach"
            )
            raise DescriptionError(f"{place}{problem}; expected a pose that the arm can take")
    return ToolAt(T, form.euler is not None, tolerance.position, tolerance.angle)
