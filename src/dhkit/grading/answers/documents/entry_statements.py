"""Statements of one entry of a sheet, or of lines ``name = formula``, in LaTeX or as plain text."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from dhkit.grading.answers.documents.latex_statements import latex_statements
from dhkit.grading.answers.documents.statements import Statement, statement_of
from dhkit.grading.answers.latex import is_latex

_LATEX_COMMENT = re.compile(r"(?<!\\)%(?!(?:pi|e|i)(?![A-Za-z0-9_]))[^\n]*")
"""Comment of LaTeX. %pi, %e and %i are Maxima's numbers, which its LaTeX output contains."""

_PLAIN_COMMENT = re.compile(r"#.*|%(?!(?:pi|e|i|gamma|phi)(?![A-Za-z0-9_])).*")
"""Comment of Python or MATLAB. %pi, %e, %i, %gamma and %phi are Maxima's numbers."""

_CONTINUATION = re.compile(r"\s*[-+*/^=)\].]")
"""Beginning of a line that continues the one before. A minus in front does so too: a semicolon separates formulas."""

_UNFINISHED = re.compile(r"(?:[-+*/^=(\[,]|\.\.\.)\s*$")
"""End of a line that the next one continues."""

_USUAL_ARGUMENT = re.compile(r"(?:d|dd)?(?:q|th|theta|t|x)(?:d|dd|dot|ddot)?\d*")
"""Argument of a quantity that is left out of its name: M(q), h(q, qd), V(theta)."""


def statements_of(text: str, suffix: str = ".tex") -> list[Statement]:
    """Return the statements of an answer's entry, or of lines of ``name = formula``.

    Parameters
    ----------
    text
        LaTeX with or without environments, or plain text as programs and `dhkit equations` write it.
    suffix
        The file's. Text with a backslash or a brace is LaTeX, and with ``.tex`` text with an & too.

    Returns
    -------
    list
        A formula alone gives one statement without targets.
    """
    if is_latex(text) or (suffix == ".tex" and "&" in text):
        return list(latex_statements(_LATEX_COMMENT.sub("", text), line=1))
    return list(_plain_statements(text))


def _plain_statements(text: str) -> Iterator[Statement]:
    """Yield the statements of plain text: one a line, or between semicolons; lines that go on belong together."""
    # Lines of the unfinished statement, the number of the first, and the brackets that are open after them.
    held: list[str] = []
    start = 1
    depth = 0
    for number, typed in enumerate(text.splitlines(), start=1):
        line = _PLAIN_COMMENT.sub("", typed).rstrip()
        if typed.strip() and not line:  # a line that is only a comment ends no statement
            continue
        is_continued = depth > 0
        if line and held and not held[-1].endswith(";"):
            begins_inside = _CONTINUATION.match(line) is not None
            is_continued = is_continued or begins_inside or _UNFINISHED.search(held[-1]) is not None
        if not is_continued:
            yield from _statements_of_lines(held, start)
            held = []
            depth = 0
        if line:
            start = start if held else number
            held.append(line)
            depth += _open_brackets(line)
    yield from _statements_of_lines(held, start)


def _open_brackets(text: str) -> int:
    """Return the number of opening brackets less that of closing ones."""
    return sum(map(text.count, "([{")) - sum(map(text.count, ")]}"))


def _statements_of_lines(lines: Sequence[str], line: int) -> Iterator[Statement]:
    """Yield the statements of lines that belong together.

    ``M = N = f; a = 1, b = 2`` has two pieces at the semicolon; the first has three sides, the second
    two parts at the comma.
    """
    for piece in _split(" ".join(part.strip().removesuffix("...") for part in lines), ";"):
        text = re.sub(r"^where\s+", "", piece.strip())
        # Commas separate statements only if each of them has its own =.
        parts = _split(text, ",")
        if len(parts) == 1 or not all(len(_split(part, "=")) > 1 for part in parts):
            parts = [text] if piece.strip() else []
        for part in parts:
            sides = [side.strip() for side in _split(part, "=")]
            names = [_name(side) for side in sides]
            yield statement_of(line, sides, names, _problem(part, sides), part)


def _problem(text: str, sides: Sequence[str]) -> str:
    """Return why a statement cannot be read; empty where it can, and for a formula without =."""
    if len(sides) == 1:  # the reader of formulas says what is wrong with it
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
    """Return the name that a side is, and an empty text for a formula; arguments such as (q, qd) are left out.

    M(1, 2) and M[0, 1] are M1_2: numbers in parentheses count from 1, as in MATLAB, those in brackets from 0.
    """
    match = re.fullmatch(
        r"([A-Za-z]\w*)\s*(?:\(([^()]*)\)|\[(\d+)\]\[(\d+)\]|\[([\d,\s]+)\])?", side, re.ASCII
    )
    if match is None:
        return ""
    name, arguments, i, j, inside = match.groups()
    if arguments is not None:
        parts = [part.strip() for part in arguments.split(",")]
        if all(part.isdecimal() for part in parts):
            return name + "_".join(parts)
        return name if all(_USUAL_ARGUMENT.fullmatch(part) for part in parts) else ""
    if i is not None:
        numbers = [i, j]
    elif inside is not None:
        numbers = [k for k in inside.split(",") if k.strip()]
    else:
        return name
    return name + "_".join(str(int(k) + 1) for k in numbers)
