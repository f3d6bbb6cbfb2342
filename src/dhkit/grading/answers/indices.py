"""Indices after names: q[0] is Python's first joint, q(1) MATLAB's, theta[1](t) Maple's."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from dhkit.expressions.syntax import Token
from dhkit.grading.answers.tokens import fail, replace_runs
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES, Vocabulary, plain_name

_SQUARE = re.compile(r"(?<!\w)([A-Za-z_]\w*)\s*\[\s*(\d{1,4})\s*\](\s*\(\s*t\s*\))?", re.ASCII)

_FROM_ZERO = re.compile(r"\*\*|\b(?:np|numpy|math)\s*\.\s*[a-z]|\bpow\s*\(", re.ASCII)
"""Notation of languages that count from 0: Python's and C's."""


def first_index(texts: Iterable[str], vocabulary: Vocabulary) -> int | None:
    """Return the first index, 0 or 1, in square brackets on a whole sheet; None where nothing on it tells.

    It is 0 where a 0 occurs, 1 in Maple's ``theta[1](t)`` or where an index has a meaning only so, and
    otherwise 0 in Python's and C's notation: ``**``, ``np.cos``, ``pow``.
    """
    is_one = False
    is_python = False
    for text in texts:
        for name, index, of_time in _SQUARE.findall(text):
            from_zero, from_one = _readings(name, int(index), vocabulary)
            if index == "0" and from_zero:
                return 0
            is_one = is_one or bool(from_one and (of_time or not from_zero))
        is_python = is_python or _FROM_ZERO.search(text) is not None
    if is_one:
        return 1
    return 0 if is_python else None


def without_indices(tokens: Sequence[Token], vocabulary: Vocabulary, text: str) -> list[Token]:
    """Return tokens with the names that indices make: q1 for q[0].

    Raises
    ------
    AnswerError
        An index without a meaning, or one that may count from 0 and from 1.
    """
    first = vocabulary.first_index
    if first is None and any(token.text == "[" for token in tokens):
        first = first_index([text], vocabulary)

    def read_run(k: int) -> tuple[list[Token], int] | None:
        name, *following = tokens[k : k + 4]
        if (
            name.kind != "name"
            or len(following) != 3
            or following[1].kind != "number"
            or not following[1].text.isdecimal()
        ):
            return None
        whole = ""
        index = int(following[1].text[:4])
        match [token.text for token in following if token.kind == "sign"]:
            case ["(", ")"]:
                whole = _in_round_brackets(name, index, vocabulary, text)
            case ["[", "]"]:
                whole = _in_square_brackets(name, index, first, vocabulary, text)
        return ([Token("name", whole, name.at)], k + 4) if whole else None

    return replace_runs(tokens, read_run)


def _readings(name: str, index: int, vocabulary: Vocabulary) -> tuple[str, str]:
    """Return the names that an index makes, counted from 0 and from 1; empty where it makes none."""
    from_zero = f"{plain_name(name)}{index + 1}"
    from_one = f"{plain_name(name)}{index}"
    return from_zero if vocabulary.knows(from_zero) else "", from_one if vocabulary.knows(
        from_one
    ) else ""


def _in_round_brackets(name: Token, index: int, vocabulary: Vocabulary, text: str) -> str:
    whole = plain_name(name.text) + str(index)
    is_only_joint = len(vocabulary.kinds) == 1 and vocabulary.is_state(name.text)
    is_known = not is_only_joint and (
        vocabulary.is_exactly(name.text) or name.text in FUNCTION_NAMES
    )
    if is_known and (
        vocabulary.is_state(whole) or (name.text in ("c", "s") and vocabulary.knows(whole))
    ):
        problem = f"{name.text}({index}) may be {whole}, or {name.text} and a number in brackets; write which"
        fail(text, name.at, problem)
    return whole if not is_known and vocabulary.knows(whole) else ""


def _in_square_brackets(
    name: Token, index: int, first: int | None, vocabulary: Vocabulary, text: str
) -> str:
    both = _readings(name.text, index, vocabulary)
    if first is None and all(both):
        fail(
            text,
            name.at,
            f"{name.text}[{index}] may be {both[1]} or, counted from 0, {both[0]}; write one of them",
        )
    whole = both[first] if first is not None else both[0] or both[1]
    return whole or fail(text, name.at, f"unknown name {name.text}[{index}]")
