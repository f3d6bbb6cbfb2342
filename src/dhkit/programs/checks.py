"""Scores of a program's kinematics and controller against an arm, with hints about the first error."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array, Robot, description_of
from dhkit.display import listed
from dhkit.errors import AnswerError, DhkitError
from dhkit.execution.process import ProgramError
from dhkit.programs.bounds import BOUNDS
from dhkit.programs.caller import LENGTH_UNITS, POSE_TOLERANCE, Caller
from dhkit.programs.check_report import CheckReport, Part, share_within
from dhkit.programs.inverse import score_inverse
from dhkit.programs.program import Program
from dhkit.programs.random_poses import random_states
from dhkit.programs.rubric import CheckRubric, ControllerTask

_MAX_ROUNDING = 2e-3
"""Largest difference of poses that may come from rounded numbers."""
_SAME_STATE = 1e-6
"""Largest difference of joint values, rad and m, of configurations that are the same."""
_MAX_MOTION = 0.5
"""Farthest that joints move, rad and shares of the reach, where both configurations of a task are the same."""


def check(
    arm: Robot,
    program: Program,
    rubric: CheckRubric | None = None,
    seed: int | None = None,
    samples: int = 200,
    progress: Callable[[str], None] = lambda text: None,
) -> CheckReport:
    r"""Score a program.

    Parameters
    ----------
    arm
        The arm that is right.
    program
        The program that is scored.
    rubric
        The points of each part; by default those of the functions that the program has.
    seed
        Seed of the random states; by default from the system's entropy.
    samples
        Number of random states of each part.
    progress
        Called with the name of each function before it is scored.

    Returns
    -------
    CheckReport
        Points of each part, with notes on what the program imports and how it was isolated.

    Raises
    ------
    ProgramError
        The program cannot be loaded.
    DhkitError
        The arm lacks something that the rubric needs, such as bodies for a controller.

    Examples
    --------
    >>> from pathlib import Path
    >>> from dhkit import Arm
    >>> from dhkit.programs import Program
    >>> lines = ["from math import cos, sin", "def fk(q):", "    x, y = 0.5 * cos(q[0]), 0.5 * sin(q[0])"]
    >>> lines += ["    return [[1, 0, 0, x], [0, 1, 0, y], [0, 0, 1, 0], [0, 0, 0, 1]]"]
    >>> size = Path("mine.py").write_text("\n".join(lines))
    >>> with Program(Path("mine.py")) as program:
    ...     report = check(Arm.load("planar2r"), program, samples=5, seed=1)
    >>> report.points, report.functions["fk"][0].text
    (0.0, '0 of 5 poses agree')
    """
    arm = arm if isinstance(arm, Arm) else Arm(description_of(arm))
    if not 1 <= samples <= 100_000:
        raise ValueError(f"samples is {samples}; expected 1 to 100000")
    program.start()
    seed = secrets.randbits(32) if seed is None else seed
    rubric = rubric or CheckRubric()
    scored = rubric.scored_functions(program.functions)
    functions: dict[str, tuple[Part, ...]] = {}
    for name in scored:
        progress(name)
        if name not in program.functions:
            most = sum(rubric.points(name).values())
            functions[name] = (
                Part("defined", 0.0, most, f"{program.name} does not define {name}"),
            )
            continue
        rng = np.random.default_rng([seed, len(functions)])
        score = {"fk": _score_forward, "ik": score_inverse, "controller": _score_controller}[name]
        functions[name] = tuple(score(arm, Caller(program, name), rubric, rng, samples))
    notes = [f"{program.name} imports {module}" for module in program.imported]
    if not program.isolation:
        notes.append(
            f"{program.name} was {program.isolation}: it may have used dhkit in ways that are not seen"
        )
    other = {"fk": "ik", "ik": "fk"}
    absent = [
        other[name] for name in scored if name in other and other[name] not in program.functions
    ]
    if absent and rubric.named == ():
        notes.append(
            f"{program.name} does not define {absent[0]}: a rubric that names it asks for it"
        )
    return CheckReport(arm.name, program.name, functions, tuple(notes), seed)


# Forward kinematics


def _score_forward(
    arm: Arm, call: Caller, rubric: CheckRubric, rng: np.random.Generator, samples: int
) -> Iterator[Part]:
    """Score poses at random joint values."""
    states = random_states(arm, rng, samples)
    truth = arm.fk(states)
    poses = [_pose(call, q) for q in states]
    errors = np.array(
        [np.inf if T is None else _pose_error(arm, T, truth[k]) for k, T in enumerate(poses)]
    )
    agrees = errors < POSE_TOLERANCE
    most = rubric.points("fk")["agrees"]
    text = f"{agrees.sum()} of {samples} poses agree"
    details = call.failure_texts()
    if not agrees.all() and not details:
        k = int(np.argmin(agrees))
        returned = np.array([T for T in poses if T is not None])
        hint = (
            _pose_hint(returned, float(errors.max()))
            or _unit_hint(poses, truth)
            or _axis_hint(arm, call, rng)
        )
        details = (f"first at q = {listed(states[k])}", *hint)
    yield Part("agrees", most * agrees.mean(), most, text, details)


def _pose_error(arm: Arm, T: Array, truth: Array) -> float:
    """Return the largest difference of poses, shape (4, 4): entries, with positions as shares of the reach."""
    difference = np.abs(T - truth)
    difference[:3, 3] /= arm.description.reach or 1.0
    return float(difference.max())


def _pose(call: Caller, q: Array) -> Array | None:
    """Return the program's pose, shape (4, 4), at joint values, shape (n,); None if the call fails."""
    try:
        return call(q)
    except ProgramError:
        return None


def _pose_hint(poses: Array, error: float) -> tuple[str, ...]:
    """Return the fault of poses, shape (N, 4, 4), whatever the arm is; ``error`` is the largest difference."""
    R = poses[:, :3, :3]
    if np.ptp(poses, axis=0).max() < POSE_TOLERANCE:
        return ("it gives the same pose for every q",)
    if np.abs(poses[:, 3] - [0, 0, 0, 1]).max() > POSE_TOLERANCE:
        return ("its last row is not 0 0 0 1",)
    if error < _MAX_ROUNDING:
        return (
            f"it differs by {error:.1g} at most: are its numbers rounded? {POSE_TOLERANCE:g} is allowed",
        )
    skew = float(np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max())
    if skew > _MAX_ROUNDING or np.any(np.linalg.det(R) < 0):
        return (
            f"its upper left 3 x 3 part is not a rotation: R^T R differs from 1 by {skew:.2g}; look at signs in A_i",
        )
    return ()


def _unit_hint(poses: Sequence[Array | None], truth: Array) -> tuple[str, ...]:
    """Return the unit of positions that are right but for it; ``poses`` and ``truth`` are (4, 4) each, m."""
    pairs = [(T, right) for T, right in zip(poses, truth, strict=True) if T is not None]
    if not pairs:
        return ()
    theirs, ours = (np.array(matrices) for matrices in zip(*pairs, strict=True))
    if np.abs(theirs[:, :3, :3] - ours[:, :3, :3]).max() > POSE_TOLERANCE:
        return ()
    size = float(np.abs(ours[:, :3, 3]).max())
    for unit, factor in LENGTH_UNITS.items():
        if (
            size > 0
            and np.abs(theirs[:, :3, 3] / factor - ours[:, :3, 3]).max() < POSE_TOLERANCE * size
        ):
            return (f"its positions are in {unit}; expected m",)
    return ()


def _axis_hint(arm: Arm, call: Caller, rng: np.random.Generator) -> tuple[str, ...]:
    """Return the first joint whose axis is wrong: the tool's motion in the base by that joint alone is another one."""
    q = random_states(arm, rng, 1)[0]
    scale = np.where(arm.description.numbers.prismatic, 1.0, 180 / np.pi)
    T = _pose(call, q * scale)
    if T is not None and _pose_error(arm, T, arm.fk(q)) < POSE_TOLERANCE:
        return ("it agrees when it is given degrees; expected radians",)
    for i, joint in enumerate(arm.description.joints):
        moved = q.copy()
        moved[i] += 0.1
        theirs = _pose(call, moved)
        start = _pose(call, q)
        if theirs is None or start is None or np.linalg.matrix_rank(start) < 4:
            return ()
        ours = arm.fk(moved) @ np.linalg.inv(arm.fk(q))
        if np.abs(theirs @ np.linalg.inv(start) - ours).max() > POSE_TOLERANCE:
            place = f"row {i}" if i else "the base"
            return (
                f"joint {i + 1} ({joint.name}) is the first whose axis is wrong: look at {place} and its own sign",
            )
    return ("every joint's axis is right: look at the last row and the tool",)


# Controllers


def _score_controller(
    arm: Arm, call: Caller, rubric: CheckRubric, rng: np.random.Generator, samples: int
) -> Iterator[Part]:
    """Score the peak error of the controller on the motion of the rubric."""
    task = rubric.controller
    most = rubric.points("controller")["follows"]
    start, goal = _ends(arm, task.start, task.goal)
    plant = arm.with_payload(task.payload) if task.payload else arm

    motion = arm.quintic(start, goal, task.duration)
    try:
        result = arm.simulate(call, motion, rate=task.rate, plant=plant)
    except DhkitError as error:
        yield Part(
            "follows",
            0.0,
            most,
            "the run failed",
            (*call.failure_texts(), str(error))[: BOUNDS.listed_failures],
        )
        return
    errors = np.abs(result.q - result.reference_q)
    peak = float(errors.max())
    share = share_within(peak, task.bound)
    joint = int(np.argmax(errors.max(axis=0)))
    name = arm.description.joints[joint].name
    unit = "rad" if arm.description.joints[joint].is_revolute else "m"
    text = f"peak error {peak:.3g} {unit} in joint {joint + 1} ({name}); {task.bound:g} {unit} is asked for"
    yield Part("follows", most * share, most, text, call.failure_texts())


def _ends(arm: Arm, start: str, goal: str) -> tuple[Array, Array]:
    """Return two configurations by name, shape (n,) each; if they are the same, the second is moved."""
    known = {"zero": np.zeros(arm.n)} | {
        name: np.array(q) for name, q in arm.configurations.items()
    }
    # The default task begins in "ready", which not every arm has.
    known.setdefault(ControllerTask.start, known["zero"])
    for key, name in (("start", start), ("goal", goal)):
        if name not in known:
            raise AnswerError(
                f"controller.{key}: {arm.name} has no configuration {name!r}; it has {', '.join(known)}"
            )
    first, second = known[start], known[goal]
    if np.abs(second - first).max() > _SAME_STATE:
        return first, second
    numbers = arm.description.numbers
    room = np.where(
        numbers.upper - first >= first - numbers.lower, numbers.upper - first, numbers.lower - first
    )
    distance = np.where(
        numbers.prismatic, _MAX_MOTION * (arm.description.reach or 1.0), _MAX_MOTION
    )
    return first, first + np.clip(room / 2, -distance, distance)
