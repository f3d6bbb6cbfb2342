"""Entries of the tool's pose by index, as programs write them: T(2,4), R[0, 2], p(1) for py, r13, px."""

from __future__ import annotations

import re
from itertools import product

from dhkit.grading.answers.vocabulary import Meaning, Vocabulary

_BY_TWO = re.compile(
    r"(?<![\w.\\])(T|R)\s*(?:\(\s*(\d)\s*,\s*(\d)\s*\)|\[\[\s*(\d)\s*,\s*(\d)\s*\]\]|\[\s*(\d)\s*(?:,|\]\s*\[)\s*(\d)\s*\])"
)
"""Entry by two indices: in round brackets (MATLAB) and double ones (Mathematica) from 1, else (Python) from 0."""
_BY_ONE = re.compile(r"(?<![\w.\\])([pP])\s*(?:\(\s*(\d)\s*\)|\[\s*(\d)\s*\])")
_PAUL = {
    "nx": "r11",
    "ny": "r21",
    "nz": "r31",
    "ox": "r12",
    "oy": "r22",
    "oz": "r32",
    "ax": "r13",
    "ay": "r23",
    "az": "r33",
}
"""Paul's columns of the tool's rotation: n, o and a."""


def with_pose_entries(text: str, vocabulary: Vocabulary) -> str:
    """Return a formula with names px ... r33 for entries of the pose by index, where T, R, p mean nothing else."""

    def by_two(match: re.Match[str]) -> str:
        name, *digits = match.groups()
        first = 0 if digits[4] is not None else 1
        i, j = (int(digit) + 1 - first for digit in digits if digit is not None)
        entry = _entry(name, i, j)
        return match[0] if entry is None or vocabulary.is_exactly(name) else f" {entry} "

    def by_one(match: re.Match[str]) -> str:
        name, round_bracket, square = match.groups()
        i = int(round_bracket) if square is None else int(square) + 1
        return match[0] if not 1 <= i <= 3 or vocabulary.is_exactly(name) else f" p{'xyz'[i - 1]} "

    return _BY_ONE.sub(by_one, _BY_TWO.sub(by_two, text))


def other_names() -> dict[str, Meaning]:
    """Return other names of the pose's entries: T14, R13, Px, and Paul's ax."""
    names = {f"T{i}{j}": _entry("T", i, j) for i, j in product((1, 2, 3), (1, 2, 3, 4))}
    names |= {f"R{i}{j}": _entry("R", i, j) for i, j in product((1, 2, 3), (1, 2, 3))}
    names |= {"Px": "px", "Py": "py", "Pz": "pz", **_PAUL}
    return {name: (entry,) for name, entry in names.items() if entry is not None}


def _entry(name: str, i: int, j: int) -> str | None:
    """Return the name of entry i, j, from 1, of T or R; None outside of them, and for the last row of T."""
    if not (1 <= i <= 3 and 1 <= j <= (4 if name == "T" else 3)):
        return None
    return f"p{'xyz'[i - 1]}" if j == 4 else f"r{i}{j}"
