r"""Rows of displayed equations: align, split, aligned, gather, cases and the like, taken apart at \\ and at columns."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace

ROWS = frozenset(
    (
        "align",
        "aligned",
        "alignat",
        "alignedat",
        "flalign",
        "split",
        "multline",
        "multlined",
        "gather",
        "gathered",
        "eqnarray",
        "IEEEeqnarray",
        "equation",
        "dmath",
        "dgroup",
        "displaymath",
        "math",
        "cases",
        "dcases",
        "rcases",
        "subequations",
        "empheq",
        "dseries",
        "xalignat",
    )
)
"""Environments whose rows are equations, or parts of them."""
JOINED = frozenset(("eqnarray", "IEEEeqnarray"))
"""Environments with an & on either side of the relation."""
OPTIONED = frozenset(("alignat", "alignedat", "xalignat", "IEEEeqnarray", "empheq", "multlined", "gathered", "aligned"))
"""Environments whose name options or columns may follow."""
MARK = re.compile(
    r"\\begin\s*\{(?P<begin>\w+)\*?\}(?P<options>\s*(?:\[[^\]\n]*\]|\{[clrCLR|\d ]*\})*)?"
    r"|\\end\s*\{(?P<end>\w+)\*?\}"
    r"|\\(?:\\\*?|cr(?![A-Za-z])|newline(?![A-Za-z]))(?:\s*\[-?\d*\.?\d+\s*(?:pt|em|ex|mm|cm)\])?"
    r"|\\(?:left|right)(?![A-Za-z])\s*(?:\\.|.)|\\[{}]|\\.|[&{}\n]|\n\s*\n",
    re.DOTALL,
)


FEW = 8
"""Pieces in front of a row that may all be blank: labels and line breaks."""


@dataclass(frozen=True)
class Row:
    """A row, or one of several equations in it.

    Attributes
    ----------
    line
        From 1, where it begins.
    text
        Without marks of columns.
    before
        What stands in front of its first &; empty where that is nothing.
    after_mark
        Whether it begins behind an &.
    column
        Which pair of columns it begins in, from 0.
    is_first
        Whether it is the first equation of a row.
    """

    line: int
    text: str
    before: str = ""
    after_mark: bool = False
    column: int = 0
    is_first: bool = True


def rows_of(text: str, line: int) -> Iterator[Row]:
    r"""Yield the rows of a display; what stands in matrices and in braces stays together.

    ``\left\{ \begin{array}{l} a = b \\ c = d \end{array} \right.`` is a system of equations, as ``cases`` is.
    """
    text = _systems(text)
    kept: list[str] = []  # environments that are no rows: matrices
    braces = 0
    piece: list[str] = []
    start, kinds = line, [""]
    columns: list[str] = []
    at = 0

    def finished() -> Iterator[Row]:
        columns.append("".join(piece))
        piece.clear()
        yield from _of_columns(list(columns), start, kinds[-1] in JOINED)
        columns.clear()

    for mark in MARK.finditer(text):
        piece.append(text[at : mark.start()])
        line += text.count("\n", at, mark.start())
        if len(piece) <= FEW and not columns and not "".join(piece).strip():
            start = line
        at = mark.end()
        word = mark[0]
        begins, ends = mark["begin"], mark["end"]
        if begins and (begins not in ROWS or kept):
            kept.append(begins)
            piece.append(word)
        elif ends and kept:
            kept.pop()
            piece.append(word)
        elif begins or ends:
            yield from finished()
            if begins:
                kinds.append(begins)
                piece.append("" if begins in OPTIONED else mark["options"] or "")
            elif len(kinds) > 1:
                kinds.pop()
            start = line
        elif kept or braces:
            piece.append(word)
        elif word == "&":
            columns.append("".join(piece))
            piece.clear()
        elif re.match(r"\\(?:\\|cr|newline)", word) and not word.startswith("\\left"):
            yield from finished()
            start = line
        else:
            piece.append(" " if word.isspace() else word)
        if not begins and not ends:
            braces += (word == "{") - (word == "}" and braces > 0)
        line += word.count("\n")
    piece.append(text[at:])
    yield from finished()


def _of_columns(columns: list[str], line: int, is_joined: bool) -> Iterator[Row]:
    """Yield the equations of a row: in pairs of columns, of which an empty one has none."""
    before = columns[0].strip() if len(columns) > 1 else ""
    if len(columns) <= 2 or is_joined:
        yield Row(line, " ".join(columns), before, len(columns) > 1 and not before)
        return
    pairs = [columns[k : k + 2] for k in range(0, len(columns), 2)]
    filled = [(k, pair) for k, pair in enumerate(pairs) if "".join(pair).strip()]
    column, pair = filled[0] if filled else (0, [""])
    first = Row(line, " ".join(pair), before, not before, column)
    yield first
    for column, pair in filled[1:]:
        yield replace(first, text=" ".join(pair), before=pair[0].strip() or " ", column=column, is_first=False)


def _systems(text: str) -> str:
    r"""Return a text in which \left\{ \begin{array} ... \end{array} \right. are systems of equations, as cases are."""
    pattern = re.compile(
        r"\\left\s*\\\{\s*\\begin\s*\{(array|aligned|matrix)\}(?:\s*\{[clr@{}|]*\})?((?:(?!\\begin|\\end).)*)"
        r"\\end\s*\{\1\}\s*\\right\s*\.",
        re.DOTALL,
    )
    return pattern.sub(lambda m: rf"\begin{{cases}}{m[2]}\end{{cases}}" if "=" in m[2] else m[0], text)
