"""Indices behind names: q[0] is Python's first joint, q(1) MATLAB's, theta[1](t) Maple's."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from dhkit.expressions.syntax import Token
from dhkit.grading.answers.tokens import fail
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES, Vocabulary, plain_name

SQUARE = re.compile(r"(?<!\w)([A-Za-z_]\w*)\s*\[\s*(\d{1,4})\s*\](\s*\(\s*t\s*\))?", re.ASCII)

FROM_ZERO = re.compile(r"\*\*|\b(?:np|numpy|math)\s*\.\s*[a-z]|\bpow\s*\(", re.ASCII)
"""Notation of languages that count from 0: Python's and C's."""


def first_index(texts: Iterable[str], vocabulary: Vocabulary) -> int | None:
    """Return from where indices in square brackets count on a whole sheet; None where nothing on it tells.

    They count from 0 where a 0 occurs, from 1 in Maple's ``theta[1](t)`` or where an index has a meaning only so, and
    otherwise from 0 in Python's and C's notation: ``**``, ``np.cos``, ``pow``.
    """
    one, is_python = False, False
    for text in texts:
        for name, index, by_time in SQUARE.findall(text):
            from_zero, from_one = _both(name, int(index), vocabulary)
            if index == "0" and from_zero:
                return 0
            one = one or bool(from_one and (by_time or not from_zero))
        is_python = is_python or FROM_ZERO.search(text) is not None
    return 1 if one else 0 if is_python else None


def without_indices(tokens: Sequence[Token], vocabulary: Vocabulary, text: str) -> list[Token]:
    """Put in the names that indices make.

    Raises
    ------
    AnswerError
        An index without a meaning, or one that may count from 0 and from 1.
    """
    found: list[Token] = []
    first = vocabulary.first_index
    if first is None and any(token.text == "[" for token in tokens):
        first = first_index([text], vocabulary)
    k = 0
    while k < len(tokens):
        name, *behind = tokens[k : k + 4]
        pattern = [x.text if x.kind == "sign" else x.kind for x in behind]
        if name.kind == "name" and behind[1:2] and behind[1].text.isdecimal():
            index = int(behind[1].text[:4])
            whole = ""
            if pattern == ["(", "number", ")"]:
                whole = _in_round_brackets(name, index, vocabulary, text)
            elif pattern == ["[", "number", "]"]:
                whole = _in_square_brackets(name, index, first, vocabulary, text)
            if whole:
                found.append(Token("name", whole, name.at))
                k += 4
                continue
        found.append(name)
        k += 1
    return found


def _both(name: str, index: int, vocabulary: Vocabulary) -> tuple[str, str]:
    """Return the names that an index makes, counted from 0 and from 1; empty where it makes none."""
    plain = plain_name(name)
    names = f"{plain}{index + 1}", f"{plain}{index}"
    return names[0] if vocabulary.knows(names[0]) else "", names[1] if vocabulary.knows(names[1]) else ""


def _in_round_brackets(name: Token, index: int, vocabulary: Vocabulary, text: str) -> str:
    whole = plain_name(name.text) + str(index)
    alone = len(vocabulary.kinds) == 1 and vocabulary.is_state(name.text)
    is_known = vocabulary.is_exactly(name.text) or name.text in FUNCTION_NAMES
    if is_known and not alone and (vocabulary.is_state(whole) or (name.text in ("c", "s") and vocabulary.knows(whole))):
        fail(
            text, name.at, f"{name.text}({index}) may be {whole}, or {name.text} and a number in brackets; write which"
        )
    return whole if (alone or not is_known) and vocabulary.knows(whole) else ""


def _in_square_brackets(name: Token, index: int, first: int | None, vocabulary: Vocabulary, text: str) -> str:
    both = _both(name.text, index, vocabulary)
    if first is None and all(both):
        fail(text, name.at, f"{name.text}[{index}] may be {both[1]} or, counted from 0, {both[0]}; write one of them")
    found = both[first] if first is not None else both[0] or both[1]
    return found or fail(text, name.at, f"unknown name {name.text}[{index}]")
