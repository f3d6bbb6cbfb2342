"""Score a program's kinematics and controllers against an arm, and say where they fail first."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Iterator

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array, Robot, description_of
from dhkit.display import listed
from dhkit.errors import AnswerError, DhkitError
from dhkit.programs.caller import CLOSE, EXAMPLES, Caller
from dhkit.programs.inverse import score_inverse
from dhkit.programs.process import ProgramError
from dhkit.programs.program import Program
from dhkit.programs.random_poses import random_states
from dhkit.programs.report import CheckReport, Part, share_within
from dhkit.programs.rubric import CheckRubric, ControllerTask

ROUNDED = 2e-3
"""Largest difference of poses that may come from rounded numbers."""
APART = 1e-6
"""rad and m between states that are not the same."""
MOVED = 0.5
"""rad, and shares of the reach, that joints are moved where the configurations of a task are one state."""


def check(
    arm: Robot,
    program: Program,
    rubric: CheckRubric | None = None,
    seed: int | None = None,
    samples: int = 200,
    progress: Callable[[str], None] = lambda text: None,
) -> CheckReport:
    """Score a program.

    Parameters
    ----------
    arm
        The truth.
    program
        What is scored.
    rubric
        What it is worth; by the functions that the program has unless given.
    seed
        Of the random states; from the system's entropy unless given.
    samples
        Random states of each part.
    progress
        Called with what is done next.

    Raises
    ------
    ProgramError
        The program cannot be loaded.
    DhkitError
        The arm lacks what is asked for, such as bodies for a controller.
    """
    arm = arm if isinstance(arm, Arm) else Arm(description_of(arm))
    if not 1 <= samples <= 100_000:
        raise ValueError(f"samples is {samples}; expected 1 to 100000")
    program.start()
    seed = secrets.randbits(32) if seed is None else seed
    rubric = rubric or CheckRubric()
    wanted = rubric.wanted(program.functions)
    functions: dict[str, tuple[Part, ...]] = {}
    for name in wanted:
        progress(name)
        if name not in program.functions:
            most = sum(rubric.points(name).values())
            functions[name] = (Part("defined", 0.0, most, f"{program.name} does not define {name}"),)
            continue
        rng = np.random.default_rng([seed, len(functions)])
        score = {"fk": _fk, "ik": score_inverse, "controller": _controller}[name]
        functions[name] = tuple(score(arm, Caller(program, name), rubric, rng, samples))
    notes = [f"{program.name} imports {module}" for module in program.imported]
    other = {"fk": "ik", "ik": "fk"}
    absent = [other[name] for name in wanted if name in other and other[name] not in program.functions]
    if absent and rubric.named == ():
        notes.append(f"{program.name} does not define {absent[0]}: a rubric that names it asks for it")
    return CheckReport(arm.name, program.name, functions, tuple(notes), seed)


# Forward kinematics


def _fk(arm: Arm, call: Caller, rubric: CheckRubric, rng: np.random.Generator, samples: int) -> Iterator[Part]:
    states = random_states(arm, rng, samples)
    truth = arm.fk(states)
    found = [_matrix(call, q) for q in states]
    apart = np.array([np.inf if T is None else _apart(arm, T, truth[k]) for k, T in enumerate(found)])
    good = apart < CLOSE
    most = rubric.points("fk")["agrees"]
    text = f"{good.sum()} of {samples} poses agree"
    details = call.said()
    if not good.all() and not details:
        k = int(np.argmin(good))
        poses = [T for T in found if T is not None]
        hint = _pose_hint(np.array(poses), float(apart.max())) or _fk_hint(arm, call, rng)
        details = (f"first at q = {listed(states[k])}", *hint)
    yield Part("agrees", most * good.mean(), most, text, details)


def _apart(arm: Arm, T: Array, other: Array) -> float:
    """Return how far two poses are apart: entries of rotations and last rows, and positions in shares of the reach."""
    found = np.abs(T - other)
    found[:3, 3] /= arm.description.reach or 1.0
    return float(found.max())


def _matrix(call: Caller, q: Array) -> Array | None:
    """Return the pose that the program gives; None where it gives none."""
    try:
        return call(q)
    except ProgramError:
        return None


def _pose_hint(poses: Array, apart: float) -> tuple[str, ...]:
    """Say what is wrong with poses whatever the arm is, shape (N, 4, 4); ``apart`` is the largest difference."""
    R = poses[:, :3, :3]
    if np.ptp(poses, axis=0).max() < CLOSE:
        return ("it gives the same pose for every q",)
    if np.abs(poses[:, 3] - [0, 0, 0, 1]).max() > CLOSE:
        return ("its last row is not 0 0 0 1",)
    if apart < ROUNDED:
        return (f"it differs by {apart:.1g} at most: are its numbers rounded? {CLOSE:g} is allowed",)
    skew = float(np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max())
    if skew > ROUNDED or np.any(np.linalg.det(R) < 0):
        return (f"its upper left 3 x 3 part is no rotation: R^T R differs from 1 by {skew:.2g}; look at signs in A_i",)
    return ()


def _fk_hint(arm: Arm, call: Caller, rng: np.random.Generator) -> tuple[str, ...]:
    """Say which joint's axis is wrong first: the motion of the tool, seen from the base, by that joint alone."""
    q = random_states(arm, rng, 1)[0]
    scale = np.where(arm.description.numbers.prismatic, 1.0, 180 / np.pi)
    T = _matrix(call, q * scale)
    if T is not None and _apart(arm, T, arm.fk(q)) < CLOSE:
        return ("it agrees when it is given degrees; expected radians",)
    for i, joint in enumerate(arm.description.joints):
        moved = q.copy()
        moved[i] += 0.1
        theirs, start = _matrix(call, moved), _matrix(call, q)
        if theirs is None or start is None or np.linalg.matrix_rank(start) < 4:
            return ()
        ours = arm.fk(moved) @ np.linalg.inv(arm.fk(q))
        if np.abs(theirs @ np.linalg.inv(start) - ours).max() > CLOSE:
            before = f"row {i}" if i else "the base"
            return (
                f"joint {i + 1} ({joint.name}) is the first whose axis is wrong: look at {before} and its own sign",
            )
    return ("every joint's axis is right: look at the last row and the tool",)


# Controllers


def _controller(arm: Arm, call: Caller, rubric: CheckRubric, rng: np.random.Generator, samples: int) -> Iterator[Part]:
    task, most = rubric.controller, rubric.points("controller")["follows"]
    start, goal = _ends(arm, task.start, task.goal)
    plant = arm.with_payload(task.payload) if task.payload else arm

    motion = arm.quintic(start, goal, task.duration)
    try:
        result = arm.simulate(call, motion, rate=task.rate, plant=plant)
    except DhkitError as error:
        yield Part("follows", 0.0, most, "the run failed", (*call.said(), str(error))[:EXAMPLES])
        return
    errors = np.abs(result.q - result.reference_q)
    peak = float(errors.max())
    share = share_within(peak, task.bound)
    joint = int(np.argmax(errors.max(axis=0)))
    name = arm.description.joints[joint].name
    unit = "rad" if arm.description.joints[joint].is_revolute else "m"
    text = f"peak error {peak:.3g} {unit} in joint {joint + 1} ({name}); {task.bound:g} {unit} is asked for"
    yield Part("follows", most * share, most, text, call.said())


def _ends(arm: Arm, start: str, goal: str) -> tuple[Array, Array]:
    """Return two configurations by name; where they are the same state, another one takes the place of the second."""
    known = {"zero": np.zeros(arm.n)} | {name: np.array(q) for name, q in arm.configurations.items()}
    # The usual task begins in "ready", which not every arm has.
    known.setdefault(ControllerTask.start, known["zero"])
    for key, name in (("start", start), ("goal", goal)):
        if name not in known:
            raise AnswerError(f"controller.{key}: {arm.name} has no configuration {name!r}; it has {', '.join(known)}")
    first, second = known[start], known[goal]
    if np.abs(second - first).max() > APART:
        return first, second
    numbers = arm.description.numbers
    room = np.where(numbers.upper - first >= first - numbers.lower, numbers.upper - first, numbers.lower - first)
    way = np.where(numbers.prismatic, MOVED * (arm.description.reach or 1.0), MOVED)
    return first, first + np.clip(room / 2, -way, way)
