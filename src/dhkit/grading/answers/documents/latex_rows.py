r"""Rows of displays and of matrices in LaTeX, taken apart at \\ and at columns.

Displays are align, split, aligned, gather, cases and the like.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain

from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.tokens import word_set

ROWS = word_set(
    """
    align aligned alignat alignedat flalign split multline multlined gather gathered eqnarray IEEEeqnarray
    equation dmath dgroup displaymath math cases dcases rcases subequations empheq dseries xalignat
    """
)
"""Environments whose rows are equations, or parts of them."""
_JOINED = frozenset(("eqnarray", "IEEEeqnarray"))
"""Environments with an & on either side of the relation."""
_OPTIONED = frozenset(
    (
        "alignat",
        "alignedat",
        "xalignat",
        "IEEEeqnarray",
        "empheq",
        "multlined",
        "gathered",
        "aligned",
    )
)
"""Environments whose name options or columns may follow."""
_MARK = re.compile(
    r"\\begin\s*\{(?P<begin>\w+)\*?\}(?P<options>\s*(?:\[[^\]\n]*\]|\{[clrCLR|\d ]*\})*)?"
    r"|\\end\s*\{(?P<end>\w+)\*?\}"
    r"|\\(?:\\\*?|cr(?![A-Za-z])|newline(?![A-Za-z]))(?:\s*\[-?\d*\.?\d+\s*(?:pt|em|ex|mm|cm)\])?"
    r"|\\(?:left|right)(?![A-Za-z])\s*(?:\\.|.)|\\[{}]|\\.|[&{}\n]|\n\s*\n",
    re.DOTALL,
)


_SYSTEM = re.compile(
    r"\\left\s*\\\{\s*\\begin\s*\{(array|aligned|matrix)\}(?:\s*\{[clr@{}|]*\})?((?:(?!\\begin|\\end).)*)"
    r"\\end\s*\{\1\}\s*\\right\s*\.",
    re.DOTALL,
)
r"""A system of equations: \left\{ \begin{array} ... \end{array} \right."""


@dataclass(frozen=True)
class Row:
    """A row, or one of several equations in it.

    Attributes
    ----------
    line
        Line in which it begins, from 1.
    text
        Without marks of columns.
    before
        What stands in front of its first &; empty where that is nothing.
    is_after_mark
        Whether it begins after an &.
    column
        The pair of columns in which it begins, from 0.
    is_first
        Whether it is the first equation of a row.
    """

    line: int
    text: str
    before: str = ""
    is_after_mark: bool = False
    column: int = 0
    is_first: bool = True


def rows_of(text: str, line: int) -> Iterator[Row]:
    r"""Yield the rows of a display; what stands in matrices and in braces stays together.

    ``\left\{ \begin{array}{l} a = b \\ c = d \end{array} \right.`` is a system of equations, as ``cases`` is.

    Parameters
    ----------
    text
        The inside of the display.
    line
        Its first line, from 1.
    """
    text = _SYSTEM.sub(
        lambda m: rf"\begin{{cases}}{m[2]}\end{{cases}}" if "=" in m[2] else m[0], text
    )
    matrices: list[str] = []  # open environments whose rows are not equations
    environments = [""]  # open environments of rows
    braces = 0
    columns: list[str] = []
    pieces: list[str] = []  # of the last column
    start = line
    at = 0

    def end_row() -> Iterator[Row]:
        yield from _equations([*columns, "".join(pieces)], start, environments[-1] in _JOINED)
        columns.clear()
        pieces.clear()

    for mark in _MARK.finditer(text):
        pieces.append(text[at : mark.start()])
        line += text.count("\n", at, mark.start())
        if len(pieces) <= BOUNDS.blank_pieces and not columns and not "".join(pieces).strip():
            start = line
        at = mark.end()
        word = mark[0]
        begins = mark["begin"]
        ends = mark["end"]
        if begins and (begins not in ROWS or matrices):
            matrices.append(begins)
            pieces.append(word)
        elif ends and matrices:
            matrices.pop()
            pieces.append(word)
        elif begins or ends:
            yield from end_row()
            if begins:
                environments.append(begins)
                pieces.append("" if begins in _OPTIONED else mark["options"] or "")
            elif len(environments) > 1:
                environments.pop()
            start = line
        elif matrices or braces:
            pieces.append(word)
        elif word == "&":
            columns.append("".join(pieces))
            pieces.clear()
        elif re.match(r"\\(?:\\|cr|newline)", word):
            yield from end_row()
            start = line
        else:
            pieces.append(" " if word.isspace() else word)
        if not begins and not ends:
            braces += (word == "{") - (word == "}" and braces > 0)
        line += word.count("\n")
    pieces.append(text[at:])
    yield from end_row()


def _equations(columns: list[str], line: int, is_joined: bool) -> Iterator[Row]:
    """Yield the equations of a row: in pairs of columns, of which an empty one has none."""
    before = columns[0].strip() if len(columns) > 1 else ""
    if len(columns) <= 2 or is_joined:
        yield Row(line, " ".join(columns), before, len(columns) > 1 and not before)
        return
    pairs = [columns[k : k + 2] for k in range(0, len(columns), 2)]
    filled = [(k, pair) for k, pair in enumerate(pairs) if "".join(pair).strip()] or [(0, [""])]
    for column, pair in filled:
        row = Row(line, " ".join(pair), before, not before, column)
        is_first = column == filled[0][0]
        yield row if is_first else replace(row, before=pair[0].strip() or " ", is_first=False)


# Matrices

MATRIX_BEGINNING = re.compile(r"\\begin\s*\{(?:[bpvBV]?|small)?(?:matrix|array)\*?\}")

_WHOLE_MATRIX = re.compile(
    r"\s*(?:\\left\s*[\[(]\s*)?\\begin\s*\{(\w+\*?)\}(?:\{[clr|]*\})?(.*)\\end\s*\{\1\}\s*(?:\\right\s*[\])])?\s*",
    re.DOTALL,
)

_SYMMETRY_MARK = re.compile(
    r"(?:\*|\\(?:ast|star|cdot|bullet)(?![A-Za-z])"
    r"|\\(?:text|textrm|mbox|mathrm|textit|rm)\s*\{\s*(?:[Ss]ymm?\.?|[Ss]ymmetric|SYM\.?)\s*\}|[Ss]ymm?\.?)"
)
"""Mark of an entry of a symmetric matrix that is equal to its mirror image: *, sym. and others."""


def matrix_rows(formula: str) -> list[list[str]] | None:
    r"""Return the rows of a matrix that is all of a formula, entries as typed; None of another formula."""
    match = _WHOLE_MATRIX.fullmatch(formula)
    if match is None or "\\begin" in match[2]:
        return None
    rows: list[list[str]] = [[""]]
    depth = 0
    for piece in re.split(r"(\\\\(?:\s*\[[^\]]*\])?|(?<!\\)&|[{}])", match[2]):
        depth += (piece == "{") - (piece == "}")
        if depth == 0 and piece.startswith("\\\\"):
            rows.append([""])
        elif depth == 0 and piece == "&":
            rows[-1].append("")
        else:
            rows[-1][-1] += piece
    if not "".join(rows[-1]).strip():
        rows.pop()
    stripped_rows = []
    for row in rows:
        stripped = [entry.strip() for entry in row]
        stripped_rows.append(stripped)
    return stripped_rows


def has_symmetry_marks(formula: str) -> bool:
    """Whether a formula is a matrix in which signs stand for entries."""
    entries = chain.from_iterable(matrix_rows(formula) or ())
    return any(_is_mark(entry) for entry in entries)


def marked_places(rows: list[list[str]]) -> set[tuple[int, int]]:
    """Return the places, from 0, where a sign or nothing refers to the other half; none where both halves have one."""
    places = set[tuple[int, int]]()
    for i, row in enumerate(rows):
        places |= {(i, j) for j, entry in enumerate(row) if not entry or _is_mark(entry)}
    is_one_half = len({i > j for i, j in places}) == 1
    is_off_diagonal = all(i != j for i, j in places)
    return places if is_one_half and is_off_diagonal else set()


def _is_mark(entry: str) -> bool:
    while entry.startswith("{") and entry.endswith("}"):
        entry = entry[1:-1].strip()
    return _SYMMETRY_MARK.fullmatch(entry) is not None
