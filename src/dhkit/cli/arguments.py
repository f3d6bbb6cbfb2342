"""What people type after a command: numbers, joint values and poses, as expressions; and words made into one option."""

from __future__ import annotations

import re
import sys
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from typer.core import TyperCommand

from dhkit.arm import Arm
from dhkit.description import Array, check_pose, pose
from dhkit.description.joint_text import degrees_hint, joint_text, violated_limit_text
from dhkit.errors import DescriptionError, ExpressionError
from dhkit.expressions import parse

if TYPE_CHECKING:
    from dhkit.planning import Floor, Objective, Obstacle, Payload
    from dhkit.trajectories import Limits

LARGEST = 10_000
"""Bytes of a file with a matrix at most."""
UNIT = re.compile(r"deg|°|\bpi\b", re.IGNORECASE)
"""Of an angle, in an expression."""
PLUS = re.compile(r"(?<![\d.][eE])\+")
"""Between two terms, not in 1e+4."""


def numbers(words: Sequence[str], what: str, counts: Sequence[int]) -> Array:
    """Return the values of expressions, separated by spaces, commas or brackets.

    Raises
    ------
    DescriptionError
        Another count, or no expression: says of what.
    """
    listed = _split(words)
    if len(listed) not in counts:
        raise DescriptionError(f"{what}: {len(listed)} values; expected {' or '.join(map(str, counts))}")
    try:
        return np.array([float(parse(word)) for word in listed])
    except ExpressionError as error:
        raise DescriptionError(f"{what}: {error}") from None


def joint_values(
    arm: Arm,
    words: Sequence[str],
    degrees: bool,
    what: str = "joint values",
    *,
    outside: Literal["told", "refused", "fine"] = "told",
) -> Array:
    """Return joint values, shape (n,), rad and m, from expressions or the name of a configuration.

    A joint outside its limits, or turned so far that degrees may be meant, is told on stderr.

    Parameters
    ----------
    outside
        What becomes of values outside the limits: told here, refused by who is given them, or of no account.

    Raises
    ------
    DescriptionError
        No such configuration, another count, or no expression.
    """
    if len(words) == 1 and words[0] in arm.configurations:
        return _told(arm, arm.configurations[words[0]], words[0], outside)
    listed = _split(words)
    if len(listed) == 1 and not listed[0][:1].isdigit() and listed[0][:1] not in "+-.(":
        names = ", ".join(arm.configurations)
        raise DescriptionError(f"{arm.name} has no configuration {listed[0]!r}; it has {names or 'none'}")
    if typo := next((word for word in listed if word.startswith("--")), None):
        raise DescriptionError(f"no such option: {typo}")
    if len(listed) != arm.n:
        raise DescriptionError(f"{len(listed)} {what}; expected {arm.n} for {arm.name}")
    if degrees and (found := next((word for word in listed if UNIT.search(word)), None)):
        raise DescriptionError(f"{what}: found {found[:40]!r}; expected bare numbers, which are degrees with --degrees")
    values = numbers(listed, what, [arm.n])
    values = np.where(arm.description.numbers.prismatic, values, np.radians(values)) if degrees else values
    return _told(arm, values, what, outside)


def _told(arm: Arm, q: Array, what: str, outside: str) -> Array:
    """Return joint values; say on stderr which is outside its limits, or turns so far that degrees may be meant."""
    numbers = arm.description.numbers
    for i, joint in enumerate(arm.description.joints):
        slides = not joint.is_revolute
        beyond = violated_limit_text(q[i], numbers.lower[i], numbers.upper[i], slides=slides)
        hint = degrees_hint(q[i], slides=slides)
        if beyond and outside == "refused":
            break
        if (beyond and outside == "told") or hint:
            words = beyond or f"{joint_text(q[i], slides=slides)}{hint}"
            sys.stderr.write(f"dhkit: warning: {what}: {joint.name} is {words}\n")
            break
    return q


def target(
    arm: Arm, *, xyz: str | None, euler: str, order: str, matrix: str | None, like: str | None, degrees: bool
) -> Array:
    """Return the pose that is asked for, shape (4, 4): by position and Euler angles, by a matrix, or by joint values.

    Raises
    ------
    DescriptionError
        Not one of them alone, another count of numbers, or no expressions.
    ValueError
        No such order of Euler angles, or a matrix that is no pose.
    """
    if sum(given is not None for given in (xyz, matrix, like)) != 1:
        raise DescriptionError("where to? expected one of --xyz, --matrix and --like")
    placed = pose(euler=numbers([euler], "--euler", [3]), order=order, degrees=degrees)
    if matrix is not None:
        return _matrix(matrix)
    if like is not None:
        return arm.fk(joint_values(arm, [like], degrees, "values of --like", outside="fine"))
    placed[:3, 3] = numbers([xyz or ""], "--xyz", [3])
    return placed


def objective(text: str) -> Objective:
    """Return an objective: words such as time and effort, with a factor before each that wants one, joined by +.

    Raises
    ------
    DescriptionError
        Another word, or a factor that is no positive number.

    Examples
    --------
    >>> str(objective("time + 1e-4 effort"))
    '1 time + 0.0001 effort'
    """
    from dhkit.planning.objectives import OBJECTIVES, Objective

    terms = []
    for term in PLUS.split(text):
        words = term.replace("*", " ").split()
        if not words or words[-1] not in OBJECTIVES:
            raise DescriptionError(
                f"--objective: found {term.strip()!r}; expected {', '.join(OBJECTIVES)}, or a sum of them"
            )
        factor = float(numbers(words[:-1], "--objective", [1])[0]) if words[1:] else 1.0
        if factor <= 0:
            raise DescriptionError(f"--objective: found {term.strip()!r}; expected a positive factor")
        terms.append(factor * OBJECTIVES[words[-1]])
    return Objective(tuple(terms))


def joint_limits(arm: Arm, given: Mapping[str, str | None], degrees: bool, speed: float) -> Limits:
    """Return an arm's limits, some of them in place of its own.

    Parameters
    ----------
    given
        Numbers by ``velocity``, ``acceleration``, ``jerk`` and ``torque``: one for all joints, or one for each.
    degrees
        Whether angles are in degrees.
    speed
        Share of the velocities that may be used.

    Raises
    ------
    DescriptionError
        Another count, or no expressions.
    ValueError
        A limit that is not positive.
    """
    from dhkit.trajectories import Limits

    limits = {}
    for name, text in given.items():
        if text is None:
            continue
        values = np.broadcast_to(numbers([text], f"--{name}", sorted({1, arm.n})), arm.n)
        turns = degrees and name != "torque"
        limits[name] = np.where(arm.description.numbers.prismatic | (not turns), values, np.radians(values))
    return Limits.of(arm.description, **limits).scaled(velocity=speed)


def columns(text: str | None) -> dict[str, str] | None:
    """Return what a file calls its columns, by our names: "t=tout q=yout".

    Raises
    ------
    DescriptionError
        Another form.
    """
    if text is None:
        return None
    pairs = [word.partition("=") for word in text.replace(",", " ").split()]
    if not pairs or not all(ours and theirs for ours, _, theirs in pairs):
        raise DescriptionError(f'--columns: found {text!r}; expected OURS=THEIRS ..., such as "t=tout q=yout"')
    return {ours: theirs for ours, _, theirs in pairs}


def payload(text: str | None) -> Payload | None:
    """Return a load: its mass, kg, and after an @ its centre of mass in the tool's frame, m.

    Raises
    ------
    DescriptionError
        Other numbers, or no expressions.
    """
    from dhkit.planning import Payload

    if text is None:
        return None
    mass, _, com = text.partition("@")
    x, y, z = numbers([com], "--payload", [3]) if com else (0.0, 0.0, 0.0)
    return Payload(float(numbers([mass], "--payload", [1])[0]), (float(x), float(y), float(z)))


def obstacles(boxes: Sequence[str], spheres: Sequence[str], floor: str | None) -> list[Obstacle | Floor]:
    """Return what is in the way: boxes "SX SY SZ @ X Y Z", balls "R @ X Y Z" and the height of a floor, m.

    Raises
    ------
    DescriptionError
        Other numbers, or no expressions.
    ValueError
        Sizes that are not positive.
    """
    from dhkit.planning import Floor, Obstacle

    scene: list[Obstacle | Floor] = []
    for k, text in enumerate(boxes):
        size, centre = _placed(text, "--box", 3, "SX SY SZ @ X Y Z")
        scene.append(Obstacle.box(size, centre, _numbered("box", k, boxes)))
    for k, text in enumerate(spheres):
        radius, centre = _placed(text, "--sphere", 1, "R @ X Y Z")
        scene.append(Obstacle.sphere(float(radius[0]), centre, _numbered("sphere", k, spheres)))
    if floor is not None:
        scene.append(Floor(float(numbers([floor], "--floor", [1])[0])))
    return scene


def _placed(text: str, what: str, count: int, expected: str) -> tuple[Array, Array]:
    sizes, at, position = text.partition("@")
    if not at or len(_split([sizes])) != count or len(_split([position])) != 3:
        raise DescriptionError(f'{what}: found {text!r}; expected "{expected}", m')
    return numbers([sizes], what, [count]), numbers([position], what, [3])


def _numbered(name: str, k: int, among: Sequence[str]) -> str:
    return name if len(among) == 1 else f"{name} {k + 1}"


def gathering(counts: Mapping[str, int | None]) -> type[TyperCommand]:
    """Return a kind of command whose options take several words, negative numbers too.

    Parameters
    ----------
    counts
        How many values each option takes; None: all words up to the next option.
    """

    class Gathering(TyperCommand):
        def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
            # A short option ends the words too; other words behind one dash are negative numbers.
            short = {name for option in self.params for name in option.opts if not name.startswith("--")}
            return super().parse_args(ctx, _gathered(args, counts, short))

    return Gathering


def _gathered(args: Sequence[str], counts: Mapping[str, int | None], short: Collection[str]) -> list[str]:
    """Return arguments with the words after each of some options made into one."""
    gathered, rest = [], list(args)
    while rest:
        word = rest.pop(0)
        gathered.append(word)
        if word not in counts:
            continue
        values: list[str] = []
        count = counts[word]
        while rest and not _is_option(rest[0], short) and (count is None or len(_split(values)) < count):
            values.append(rest.pop(0))
        if not values:
            raise DescriptionError(f"{word}: no values; expected {'some' if count is None else count} after it")
        gathered.append(" ".join(values))
    return gathered


def _is_option(word: str, short: Collection[str]) -> bool:
    return word.startswith("--") or word in short


def _split(words: Sequence[str]) -> list[str]:
    return " ".join(words).translate(str.maketrans(",;[]", "    ")).split()


def _matrix(given: str) -> Array:
    """Return the pose of a matrix by row, 16 entries or the first 12, or of a text file that holds them."""
    words = _split([given])
    if len(words) == 1:
        words = _split([_text(Path(given))])
    entries = numbers(words, "--matrix", [16, 12])
    return check_pose(np.append(entries[:12], entries[12:] if len(entries) == 16 else (0, 0, 0, 1)).reshape(4, 4))


def _text(path: Path) -> str:
    if not path.is_file():
        raise DescriptionError(f"--matrix: found {str(path)!r}; expected 16 or 12 numbers, or a text file of them")
    if path.stat().st_size > LARGEST:
        raise DescriptionError(f"{path}: more than {LARGEST} bytes; expected 16 or 12 numbers")
    try:
        return path.read_text("utf-8")
    except UnicodeDecodeError:
        raise DescriptionError(f"{path}: not text; expected 16 or 12 numbers") from None
