"""Statements of one entry of a sheet, or of lines ``name = formula``, in LaTeX or as plain text."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from dhkit.grading.answers.documents.latex_statements import latex_statements
from dhkit.grading.answers.documents.statements import Statement, statement_of
from dhkit.grading.answers.latex import is_latex

_LATEX_COMMENT = re.compile(r"(?<!\\)%(?!(?:pi|e|i)(?![A-Za-z0-9_]))[^\n]*")
_PLAIN_COMMENT = re.compile(r"#.*|%(?!(?:pi|e|i|gamma|phi)(?![A-Za-z0-9_])).*")
"""Comments of Python, MATLAB and LaTeX; %pi, %e and %i are Maxima's numbers."""

_CONTINUATION = re.compile(r"\s*(?:[-+*/^=)\].]|\*\*)")
"""Beginning of a line that continues the one before."""

_UNFINISHED = re.compile(r"(?:[-+*/^=(\[,]|\.\.\.|\\)\s*$")
"""End of a line that the next one continues."""


def statements_of(text: str, suffix: str = ".tex") -> list[Statement]:
    """Return the statements of an answer's entry, or of lines of ``name = formula``.

    Parameters
    ----------
    text
        LaTeX with or without environments, or plain text as programs and `dhkit equations` write it.
    suffix
        ``.tex`` of LaTeX; of other suffixes, text without a backslash or a brace is plain.

    Returns
    -------
    list
        One without targets where the text is a formula alone.
    """
    if is_latex(text) or (suffix == ".tex" and "&" in text):
        return list(latex_statements(_LATEX_COMMENT.sub("", text), 1))
    return list(_plain_statements(text))


def _plain_statements(text: str) -> Iterator[Statement]:
    """Yield the statements of plain text: one a line, or between semicolons; lines that go on belong together."""
    held: list[str] = []
    start = 1
    depth = 0
    for number, typed in enumerate(text.splitlines(), start=1):
        line = _PLAIN_COMMENT.sub("", typed)
        if typed.strip() and not line.strip():
            continue
        goes_on = depth > 0
        if line.strip() and held and not re.search(r";\s*$", held[-1]):
            goes_on = goes_on or _CONTINUATION.match(line) is not None or _UNFINISHED.search(held[-1][-20:]) is not None
        if not goes_on:
            yield from _statements_of_lines(held, start)
            held = []
            start = number
            depth = 0
        if line.strip():
            start = start if held else number
            held.append(line)
            depth += _open_brackets(line)
    yield from _statements_of_lines(held, start)


def _open_brackets(text: str) -> int:
    return sum(map(text.count, "([{")) - sum(map(text.count, ")]}"))


def _statements_of_lines(lines: Sequence[str], line: int) -> Iterator[Statement]:
    """Yield the statements of lines that belong together."""
    for piece in _split(" ".join(part.strip().removesuffix("...") for part in lines), ";"):
        text = re.sub(r"^where\s+", "", piece.strip())
        parts = _split(text, ",")
        if len(parts) == 1 or not all(len(_split(part, "=")) > 1 for part in parts):
            parts = [text] if piece.strip() else []
        for part in parts:
            sides = [side.strip() for side in _split(part, "=")]
            yield statement_of(line, sides, [_name(side) for side in sides], _problem(part, sides), part)


def _problem(text: str, sides: Sequence[str]) -> str:
    """Return why a statement cannot be read; nothing of one that can, and of a formula alone."""
    if len(sides) == 1:
        return ""
    if re.search(r"[<>~!]|[-+*/]=", text):
        return "another relation than ="
    if _open_brackets(text):
        return "brackets that do not close"
    return "" if all(sides) else "an = with nothing on one side"


def _split(text: str, sign: str) -> list[str]:
    """Split a text at a sign that stands in no brackets."""
    pieces: list[list[str]] = [[]]
    depth = 0
    for character in text:
        depth += (character in "([{") - (character in ")]}")
        if depth == 0 and character == sign:
            pieces.append([])
        else:
            pieces[-1].append(character)
    return ["".join(piece) for piece in pieces]


def _name(side: str) -> str:
    """Return the name that a side is; M(1, 2) and M[0, 1] are M1_2, and arguments such as (q, qd) are left out."""
    match = re.fullmatch(r"([A-Za-z]\w*)\s*(?:\(([^()]*)\)|\[(\d+)\]\[(\d+)\]|\[([\d,\s]+)\])?", side, re.ASCII)
    if match is None:
        return ""
    name, arguments, i, j, inside = match.groups()
    if arguments is not None:
        parts = [part.strip() for part in arguments.split(",")]
        if all(part.isdecimal() for part in parts):
            return name + "_".join(parts)
        is_usual = all(re.fullmatch(r"(?:d|dd)?(?:q|th|theta|t|x)(?:d|dd|dot|ddot)?\d*", part) for part in parts)
        return name if is_usual else ""
    numbers = [i, j] if i is not None else (inside or "").split(",")
    return name + "_".join(str(int(k) + 1) for k in numbers if k.strip())
