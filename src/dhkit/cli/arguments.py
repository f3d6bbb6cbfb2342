"""Values that people type after a command: numbers, joint values and poses, as expressions; long options."""

from __future__ import annotations

import re
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from enum import Enum, auto
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from typer.core import TyperCommand

from dhkit.arm import Arm
from dhkit.cli.quantities import quantity
from dhkit.description import Array, check_pose, pose
from dhkit.description.joint_text import degrees_hint, joint_text, violated_limit_text
from dhkit.errors import DescriptionError, ExpressionError

if TYPE_CHECKING:
    from dhkit.planning import Floor, Objective, Obstacle, Payload
    from dhkit.trajectories import Limits

MAX_MATRIX_BYTES = 10_000
"""Largest size of a file with a matrix."""
ANGLE_UNIT = re.compile(r"deg|°|\bpi\b|\brad\b", re.IGNORECASE)
"""Sign that an expression has its own unit of angles."""
PLUS = re.compile(r"(?<![\d.][eE])\+")
"""A plus between two terms, not that of 1e+4."""


class OutsideLimits(Enum):
    """Treatment of joint values outside the limits."""

    WARN = auto()
    """A warning on stderr names the joint."""
    REFUSED_LATER = auto()
    """Nothing here: the function that gets the values refuses them."""
    ALLOWED = auto()
    """Nothing: limits do not count."""


def numbers(words: Sequence[str], what: str, counts: Sequence[int]) -> Array:
    """Return the values, shape (count,), of expressions that are separated by spaces, commas or brackets.

    Parameters
    ----------
    words
        The expressions.
    what
        Name of the values, for messages.
    counts
        How many values there may be.

    Raises
    ------
    DescriptionError
        There is another count, or a word is not an expression.
    """
    expressions = _split(words)
    if len(expressions) not in counts:
        raise DescriptionError(
            f"{what}: {len(expressions)} values; expected {' or '.join(map(str, counts))}"
        )
    try:
        return np.array([quantity(word) for word in expressions])
    except ExpressionError as error:
        raise DescriptionError(f"{what}: {error}") from None


def joint_values(
    arm: Arm,
    words: Sequence[str],
    degrees: bool,
    what: str = "joint values",
    *,
    outside: OutsideLimits = OutsideLimits.WARN,
) -> Array:
    """Return joint values, shape (n,), rad and m, from expressions or the name of a configuration.

    A warning on stderr names a joint outside its limits, or one turned so far that degrees may be meant.

    Parameters
    ----------
    arm
        The arm.
    words
        The expressions, or one name.
    degrees
        Whether bare numbers of revolute joints are in degrees.
    what
        Name of the values, for messages.
    outside
        What happens to values outside the limits.

    Raises
    ------
    DescriptionError
        There is no such configuration, there is another count, or a word is not an expression.
    """
    if len(words) == 1 and words[0] in arm.configurations:
        return _with_warning(arm, arm.configurations[words[0]], words[0], outside)
    expressions = _split(words)
    if (
        len(expressions) == 1
        and not expressions[0][:1].isdigit()
        and expressions[0][:1] not in "+-.("
    ):
        names = ", ".join(arm.configurations)
        raise DescriptionError(
            f"{arm.name} has no configuration {expressions[0]!r}; it has {names or 'none'}"
        )
    if option := next((word for word in expressions if word.startswith("--")), None):
        raise DescriptionError(f"no such option: {option}")
    if len(expressions) != arm.n:
        raise DescriptionError(f"{len(expressions)} {what}; expected {arm.n} for {arm.name}")
    _require_bare(expressions, what, degrees)
    values = numbers(expressions, what, [arm.n])
    values = (
        np.where(arm.description.numbers.prismatic, values, np.radians(values))
        if degrees
        else values
    )
    return _with_warning(arm, values, what, outside)


def _require_bare(expressions: Sequence[str], what: str, degrees: bool) -> None:
    """Refuse angles with a unit of their own where bare numbers are in degrees: they would be converted twice.

    Raises
    ------
    DescriptionError
        Names the expression.
    """
    found = next((word for word in expressions if ANGLE_UNIT.search(word)), None)
    if degrees and found is not None:
        raise DescriptionError(
            f"{what}: found {found[:40]!r}; expected bare numbers, which are degrees with --degrees"
        )


def option_values(
    arm: Arm,
    text: str,
    option: str,
    degrees: bool,
    outside: OutsideLimits = OutsideLimits.REFUSED_LATER,
) -> Array:
    """Return the joint values of an option, shape (n,), rad and m: see :func:`joint_values`."""
    return joint_values(arm, [text], degrees, f"values of {option}", outside=outside)


def _with_warning(arm: Arm, q: Array, what: str, outside: OutsideLimits) -> Array:
    """Return joint values; warn of the first outside its limits, or turned so far that degrees may be meant."""
    numbers = arm.description.numbers
    for i, joint in enumerate(arm.description.joints):
        slides = not joint.is_revolute
        beyond = violated_limit_text(q[i], numbers.lower[i], numbers.upper[i], slides=slides)
        hint = degrees_hint(q[i], slides=slides)
        if beyond and outside is OutsideLimits.REFUSED_LATER:
            break
        if (beyond and outside is OutsideLimits.WARN) or hint:
            problem = beyond or f"{joint_text(q[i], slides=slides)}{hint}"
            sys.stderr.write(f"dhkit: warning: {what}: {joint.name} is {problem}\n")
            break
    return q


def target(
    arm: Arm,
    *,
    xyz: str | None,
    euler: str,
    order: str,
    matrix: str | None,
    like: str | None,
    degrees: bool,
) -> Array:
    """Return the pose of --xyz and --euler, of --matrix, or of the joint values of --like, shape (4, 4), m, world.

    Raises
    ------
    DescriptionError
        Not exactly one of --xyz, --matrix and --like is given, there is another count of numbers, or a word is no
        expression.
    ValueError
        There is no such order of Euler angles, or the matrix is not a pose.
    """
    if sum(given is not None for given in (xyz, matrix, like)) != 1:
        raise DescriptionError("no single pose; expected one of --xyz, --matrix and --like")
    _require_bare(_split([euler]), "--euler", degrees)
    angles = numbers([euler], "--euler", [3])
    if found := next((x for x in angles if degrees_hint(x, slides=False)), None):
        sys.stderr.write(
            f"dhkit: warning: --euler: found {found:g} rad{degrees_hint(found, slides=False)}\n"
        )
    T = pose(euler=angles, order=order, degrees=degrees)
    if matrix is not None:
        return _matrix(matrix)
    if like is not None:
        return arm.fk(option_values(arm, like, "--like", degrees, OutsideLimits.ALLOWED))
    T[:3, 3] = numbers([xyz or ""], "--xyz", [3])
    return T


def objective(text: str) -> Objective:
    """Return an objective: names such as time and effort, each with an optional factor before it, joined by +.

    Raises
    ------
    DescriptionError
        There is no such objective, or a factor is not a positive number.

    Examples
    --------
    >>> str(objective("time + 1e-4 effort"))
    '1 time + 0.0001 effort'
    """
    from dhkit.planning.criteria import OBJECTIVES, Objective

    terms = []
    for term in PLUS.split(text):
        words = term.replace("*", " ").split()
        if not words or words[-1] not in OBJECTIVES:
            raise DescriptionError(
                f"--objective: found {term.strip()!r}; expected {', '.join(OBJECTIVES)}, or a sum of them"
            )
        factor = float(numbers(words[:-1], "--objective", [1])[0]) if words[1:] else 1.0
        if factor <= 0:
            raise DescriptionError(
                f"--objective: found {term.strip()!r}; expected a positive factor"
            )
        terms.append(factor * OBJECTIVES[words[-1]])
    return Objective(tuple(terms))


def joint_limits(arm: Arm, given: Mapping[str, str | None], degrees: bool, speed: float) -> Limits:
    """Return an arm's limits, with some of them replaced.

    Parameters
    ----------
    given
        Numbers of ``velocity``, ``acceleration``, ``jerk`` and ``torque``: one for all joints, or one for each.
    degrees
        Whether angles are in degrees.
    speed
        Share of the velocity limits that may be used.

    Raises
    ------
    DescriptionError
        There is another count, or a word is not an expression.
    ValueError
        A limit is not positive.
    """
    from dhkit.trajectories import Limits

    limits = {}
    for name, text in given.items():
        if text is None:
            continue
        is_angle = degrees and name != "torque"
        _require_bare(_split([text]), f"--{name}", is_angle)
        values = np.broadcast_to(numbers([text], f"--{name}", sorted({1, arm.n})), arm.n)
        limits[name] = np.where(
            arm.description.numbers.prismatic | (not is_angle), values, np.radians(values)
        )
    return Limits.of(arm.description, **limits).scaled(velocity=speed)


def columns(text: str | None) -> dict[str, str] | None:
    """Return the names of a file's columns, by our names, from a text such as "t=tout q=yout".

    Raises
    ------
    DescriptionError
        The text has another form.
    """
    if text is None:
        return None
    pairs = [word.partition("=") for word in text.replace(",", " ").split()]
    if not pairs or not all(ours and theirs for ours, _, theirs in pairs):
        raise DescriptionError(
            f'--columns: found {text!r}; expected OURS=THEIRS ..., such as "t=tout q=yout"'
        )
    return {ours: theirs for ours, _, theirs in pairs}


def payload(text: str | None) -> Payload | None:
    """Return the load of a text "KG [@ X Y Z]": its mass, kg, and its centre of mass in the tool's frame, m.

    Raises
    ------
    DescriptionError
        There are other numbers, or a word is not an expression.
    """
    from dhkit.planning import Payload

    if text is None:
        return None
    mass, com = split_at(text)
    x, y, z = numbers([com], "--payload", [3]) if com else (0.0, 0.0, 0.0)
    return Payload(float(numbers([mass], "--payload", [1])[0]), (float(x), float(y), float(z)))


def obstacles(
    boxes: Sequence[str], spheres: Sequence[str], floor: str | None
) -> list[Obstacle | Floor]:
    """Return obstacles: boxes "SX SY SZ @ X Y Z", balls "R @ X Y Z" and the height of a floor, m.

    Raises
    ------
    DescriptionError
        There are other numbers, or a word is not an expression.
    ValueError
        A size is not positive.
    """
    from dhkit.planning import Floor, Obstacle

    scene: list[Obstacle | Floor] = []
    for name, text in _numbered("box", boxes):
        size, centre = _size_and_centre(text, "--box", 3, "SX SY SZ @ X Y Z")
        scene.append(Obstacle.box(size, centre, name))
    for name, text in _numbered("sphere", spheres):
        radius, centre = _size_and_centre(text, "--sphere", 1, "R @ X Y Z")
        scene.append(Obstacle.sphere(float(radius[0]), centre, name))
    if floor is not None:
        scene.append(Floor(float(numbers([floor], "--floor", [1])[0])))
    return scene


def split_at(text: str) -> tuple[str, str | None]:
    """Return the parts of a text before and after its ``@``; None for the second if it has none."""
    before, sign, after = text.partition("@")
    return before, after if sign else None


def _size_and_centre(text: str, what: str, count: int, expected: str) -> tuple[Array, Array]:
    size, centre = split_at(text)
    if centre is None or len(_split([size])) != count or len(_split([centre])) != 3:
        raise DescriptionError(f'{what}: found {text!r}; expected "{expected}", m')
    return numbers([size], what, [count]), numbers([centre], what, [3])


def _numbered(name: str, texts: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield each text with a name, which has a number if there are several."""
    for k, text in enumerate(texts, start=1):
        yield name if len(texts) == 1 else f"{name} {k}", text


def with_long_options(counts: Mapping[str, int | None]) -> type[TyperCommand]:
    """Return a class of commands whose options take several words, negative numbers too.

    Parameters
    ----------
    counts
        How many values each option takes; None: all words up to the next option.
    """

    class LongOptionCommand(TyperCommand):
        def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
            # A short option ends the words too; other words that begin with one dash are negative numbers.
            names = chain.from_iterable(option.opts for option in self.params)
            short = {name for name in names if not name.startswith("--")}
            return super().parse_args(ctx, _join_option_words(args, counts, short))

    return LongOptionCommand


def _join_option_words(
    args: Sequence[str], counts: Mapping[str, int | None], short: Collection[str]
) -> list[str]:
    """Return arguments with the words after each of these options joined into one."""
    joined = []
    rest = list(args)
    while rest:
        word = rest.pop(0)
        joined.append(word)
        if word not in counts:
            continue
        values: list[str] = []
        count = counts[word]
        while (
            rest
            and not (rest[0].startswith("--") or rest[0] in short)
            and (count is None or len(_split(values)) < count)
        ):
            values.append(rest.pop(0))
        if not values:
            raise DescriptionError(
                f"{word}: no values; expected {'some' if count is None else count} after it"
            )
        joined.append(" ".join(values))
    return joined


def _split(words: Sequence[str]) -> list[str]:
    return " ".join(words).translate(str.maketrans(",;[]", "    ")).split()


def _matrix(given: str) -> Array:
    """Return the pose, shape (4, 4), m, of 16 entries by row or the first 12, or of a text file that has them."""
    words = _split([given])
    if len(words) == 1:
        words = _split([_file_text(Path(given))])
    entries = numbers(words, "--matrix", [16, 12])
    return check_pose(
        np.append(entries[:12], entries[12:] if len(entries) == 16 else (0, 0, 0, 1)).reshape(4, 4)
    )


def _file_text(path: Path) -> str:
    if not path.is_file():
        raise DescriptionError(
            f"--matrix: found {str(path)!r}; expected 16 or 12 numbers, or a text file of them"
        )
    if path.stat().st_size > MAX_MATRIX_BYTES:
        raise DescriptionError(
            f"{path}: more than {MAX_MATRIX_BYTES} bytes; expected 16 or 12 numbers"
        )
    try:
        return path.read_text("utf-8")
    except UnicodeDecodeError:
        raise DescriptionError(f"{path}: not text; expected 16 or 12 numbers") from None
