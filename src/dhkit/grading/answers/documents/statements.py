r"""Statements of formulas, ``M_{12} = M_{21} = f``: the names that they are about, and their formulas."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.latex import GREEK
from dhkit.grading.answers.sheet import ALIASES
from dhkit.grading.answers.vocabulary import plain_name

QUANTITIES = frozenset(("M", "C", "h", "g", "tau", "K", "V", "L", "T", "J", *ALIASES))

SPACE = r"(?:\s|~|\\[,;:!> ]|\\q?quad(?![A-Za-z])|\\(?:enspace|thinspace|space)(?![A-Za-z])|\{\})"
"""Pattern of one space of LaTeX's."""

_STYLES = re.compile(
    r"\\(?:mathbf|mathrm|mathit|mathsf|mathcal|mathscr|boldsymbol|bm|textbf|textrm|text|vec|operatorname|mathnormal|pmb|bf|rm)(?![A-Za-z])"
)
_LETTERS = GREEK | {"ell", "Tau", "mathbf"}
"""Macros that a name may be."""

NAME = re.compile(
    r"\[?(?P<letters>\\?[A-Za-z]+)\]?(?:_(?:(?P<one>[A-Za-z0-9])|\{(?P<below>[\\A-Za-z0-9, ]*)\}))?",
    re.ASCII,
)
_ARGUMENT = re.compile(
    r"(?:\\d?dot|dot)?\{?(?:q|\\theta|\\vartheta|\\phi|\\varphi|\\Theta|theta|phi|x|y|z|t|d|r|qd|dq|qdd|th|qdot)\}?"
    r"(?:_\{?\d*\}?|\d*)(?:\(t\))?",
    re.ASCII,
)


@dataclass(frozen=True)
class Statement:
    """Names and formulas that are said to be equal.

    Attributes
    ----------
    line
        Line in which it begins, from 1.
    targets
        Names on its sides, without marks of typesetting and without arguments: M12, tau1, g, theta1. Empty of a formula
        alone, and where the first side is not a name.
    formulas
        The other sides, in order, as typed.
    problem
        Why it cannot be read; empty where it can.
    text
        The whole, for messages.
    """

    line: int
    targets: tuple[str, ...]
    formulas: tuple[str, ...]
    problem: str = ""
    text: str = ""


def statement_of(
    line: int, sides: Sequence[str], names: Sequence[str], problem: str, text: str
) -> Statement:
    """Return a statement of its sides: M12 = M21 = f is about both names, V = a = f about V.

    Parameters
    ----------
    line
        Line in which it begins, from 1.
    sides
        Formulas between the signs of equality.
    names
        The name that each side is; empty where it is none.
    problem, text
        As in :class:`Statement`.
    """
    if len(sides) == 1 or not names[0]:
        return Statement(line, (), tuple(sides), problem, text)
    # The last side is a formula.
    is_target = [_is_also(name, names[0]) for name in names[:-1]] + [False]
    targets = dict.fromkeys(name for name, is_name in zip(names, is_target, strict=True) if is_name)
    formulas = tuple(side for side, is_name in zip(sides, is_target, strict=True) if not is_name)
    return Statement(line, tuple(targets), formulas, problem, text)


def _is_also(name: str, first: str) -> bool:
    """Whether a name is that of another entry, or another name of the quantity."""
    if not name or name == first:
        return bool(name)
    is_entry = name.rstrip("0123456789_") == first.rstrip("0123456789_")
    return is_entry or (name in QUANTITIES and first in QUANTITIES)


def left_hand_name(side: str) -> str:
    r"""Return the name that a side is, with arguments such as (q, \dot q) left out; empty where it is none.

    ``M_{12}(q)`` is M12, ``\mathbf{g}(\theta)`` g, ``M_{10,2}`` M10_2; ``\dot V``, ``V'`` and ``M^{-1}`` are not names.
    """
    if len(side) > BOUNDS.side_characters:
        return ""
    text = re.sub(
        rf"{SPACE}+", " ", re.sub(r"\\(?:left|right|bigl?|bigr|Bigl?|Bigr)(?![A-Za-z])", "", side)
    )
    styled = ""
    while styled != text:
        styled = text
        text = _STYLES.sub("", text).strip()
        text = re.sub(r"^\{\s*([^{}]*?)\s*\}", r"\1", text)
        text = re.sub(r"\{\s*\{([^{}]*)\}\s*\}", r"{\1}", text)  # \dot{\mathbf{q}}
    text = re.sub(r"\s+", "", re.sub(r"\{\s*(\\?[A-Za-z]+)\s*\}", r"{\1}", text))
    match = NAME.match(text)
    if match is None or (text.startswith("[") != text[: match.end()].count("]")):
        return ""
    letters = match["letters"]
    if letters.startswith("\\") and plain_name(letters) not in _LETTERS:
        return ""
    below = match["one"] or match["below"] or ""
    rest = text[match.end() :]
    if rest.startswith("("):
        depths = accumulate((character == "(") - (character == ")") for character in rest)
        end = next((k for k, depth in enumerate(depths) if depth == 0), -1)
        arguments = rest[1:end].split(",")
        if end < 0:
            return ""
        if all(argument.isdecimal() for argument in arguments) and not below:
            below = ",".join(arguments)
        elif not all(_ARGUMENT.fullmatch(argument) for argument in arguments):
            return ""
        rest = rest[end + 1 :]
    if rest and not below and (under := re.fullmatch(r"_(?:(\w)|\{([\w,]*)\})", rest)):
        below = under[1] or under[2]
        rest = ""
    if rest:
        return ""
    below = below.replace("\\", "")
    if pair := re.fullmatch(r"(\d+),(\d+)", below):
        below = "".join(pair.groups()) if len(below) == 3 else "_".join(pair.groups())
    return plain_name(letters) + below.replace(",", "")
