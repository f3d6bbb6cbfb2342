"""What people type after a command: numbers, joint values and poses, as expressions; and words made into one option."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from typer.core import TyperCommand

from dhkit.arm import Arm
from dhkit.description import Array, check_pose, pose
from dhkit.errors import DescriptionError, ExpressionError
from dhkit.expressions import parse

__all__ = ["gathering", "joint_values", "numbers", "target"]

LARGEST = 10_000
"""Bytes of a file with a matrix at most."""


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


def joint_values(arm: Arm, words: Sequence[str], degrees: bool, what: str = "joint values") -> Array:
    """Return joint values, shape (n,), rad and m, from expressions or the name of a configuration.

    Raises
    ------
    DescriptionError
        No such configuration, another count, or no expression.
    """
    if len(words) == 1 and words[0] in arm.configurations:
        return arm.configurations[words[0]]
    listed = _split(words)
    if len(listed) == 1 and not listed[0][:1].isdigit() and listed[0][:1] not in "+-.(":
        names = ", ".join(arm.configurations)
        raise DescriptionError(f"{arm.name} has no configuration {listed[0]!r}; it has {names or 'none'}")
    if typo := next((word for word in listed if word.startswith("--")), None):
        raise DescriptionError(f"no such option: {typo}")
    if len(listed) != arm.n:
        raise DescriptionError(f"{len(listed)} {what}; expected {arm.n} for {arm.name}")
    values = numbers(listed, what, [arm.n])
    return np.where(arm.description.numbers.prismatic, values, np.radians(values)) if degrees else values


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
        return arm.fk(joint_values(arm, [like], degrees, "values of --like"))
    placed[:3, 3] = numbers([xyz or ""], "--xyz", [3])
    return placed


def gathering(counts: Mapping[str, int | None]) -> type[TyperCommand]:
    """Return a kind of command whose options take several words, negative numbers too.

    Parameters
    ----------
    counts
        How many values each option takes; None: all words up to the next that begins with two dashes.
    """

    class Gathering(TyperCommand):
        def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
            return super().parse_args(ctx, _gathered(args, counts))

    return Gathering


def _gathered(args: Sequence[str], counts: Mapping[str, int | None]) -> list[str]:
    """Return arguments with the words after each of some options made into one."""
    gathered, rest = [], list(args)
    while rest:
        word = rest.pop(0)
        gathered.append(word)
        if word not in counts:
            continue
        values: list[str] = []
        count = counts[word]
        while rest and not rest[0].startswith("--") and (count is None or len(_split(values)) < count):
            values.append(rest.pop(0))
        if not values:
            raise DescriptionError(f"{word}: no values; expected {'some' if count is None else count} after it")
        gathered.append(" ".join(values))
    return gathered


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
