"""Formulas that sympy prints over several lines, brought into one: fractions by bars, powers above, tall brackets.

Every character must be part of something: one that stands above or below the line without a bar or a bracket refuses
the answer, since a lost space would move an exponent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import NamedTuple

from dhkit.errors import AnswerError
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.tokens import quote

_MARKS = frozenset("⎛⎜⎝⎡⎢⎣─⋅")
_BAR = "─"
_DERIVATIVES = (("d", "dt"), ("d^(2)", "dt^(2)"))

_TALL_BRACKETS = {"⎛": "⎜⎝⎞⎟⎠", "⎡": "⎢⎣⎤⎥⎦"}
"""Pieces of a tall bracket by its upper hook: its side and lower hook, then hook, side and foot of the closing one."""


def is_pretty(text: str) -> bool:
    """Whether a text is a formula over several lines, as sympy's pretty printer writes it."""
    return "\n" in text.strip("\n") and not _MARKS.isdisjoint(text) and "\\" not in text


def in_one_line(text: str) -> str:
    r"""Return a formula over several lines in one; other text as it is.

    Raises
    ------
    AnswerError
        Characters that belong to nothing, or a root.

    Examples
    --------
    >>> in_one_line("  2   \nl₁ ⋅m₁\n──────\n  3   ")
    '((l₁^(2)⋅m₁)/(3))'
    """
    if not is_pretty(text):
        return text
    lines = text.strip("\n").splitlines()
    width = max(map(len, lines))
    if len(lines) > BOUNDS.pretty_lines or width > BOUNDS.pretty_columns:
        raise AnswerError(
            f"{quote(text)}: more than {BOUNDS.pretty_lines} lines or {BOUNDS.pretty_columns} columns"
        )
    if any(mark in text for mark in "√╲╱⌠⎮"):
        raise AnswerError(
            f"{quote(text)}: a root or an integral over several lines; print it with str()"
        )
    try:
        return _Block(tuple(line.ljust(width) for line in lines), 0).text()
    except _LostError as lost:
        raise AnswerError(
            f"{quote(text)}: {lost}; were spaces lost? print it in one line, with str()"
        ) from None


class _LostError(Exception):
    """A character that belongs to nothing."""


class _Piece(NamedTuple):
    """A tall bracket or a fraction inside a block, already in one line."""

    end: int
    """Column after its last one."""
    text: str
    """Its formula in one line."""
    rows: Sequence[int]
    """Rows that the line of the formula around it may be: those of the bracket, or that of the fraction's bar."""


@dataclass(frozen=True)
class _Block:
    """A rectangle of characters, with how deep it is nested."""

    lines: tuple[str, ...]
    depth: int

    def part(self, rows: slice, columns: slice = slice(None)) -> _Block:
        if self.depth >= BOUNDS.pretty_nesting:
            raise _LostError(f"nested more than {BOUNDS.pretty_nesting} deep")
        return _Block(tuple(line[columns] for line in self.lines[rows]), self.depth + 1)

    @property
    def width(self) -> int:
        return max(map(len, self.lines), default=0)

    def text(self) -> str:
        """Return the block's formula in one line."""
        pieces: dict[int, _Piece] = {}  # by their first column
        taken = [False] * self.width
        allowed = set(range(len(self.lines)))
        for column in range(self.width):
            piece = None if taken[column] else self._bracket(column) or self._fraction(column)
            if piece is not None:
                pieces[column] = piece
                taken[column : piece.end] = [True] * (piece.end - column)
                allowed &= set(piece.rows)
        if not allowed:
            raise _LostError("a fraction's bar that is not on the line of what stands beside it")
        free = set()
        for row, line in enumerate(self.lines):
            if any(x != " " and not is_taken for x, is_taken in zip(line, taken, strict=False)):
                free.add(row)
        # The line of the formula: powers alone stand above it, and nothing below.
        base = max(free & allowed, default=min(allowed))
        if any(row > base for row in free):
            raise _LostError("a character below the line")
        return self._join(pieces, base)

    def _join(self, pieces: dict[int, _Piece], base: int) -> str:
        """Return the line ``base``, with the pieces and the powers above it put in."""
        texts: list[str] = []
        column = 0
        while column < self.width:
            if column in pieces:
                texts.append(pieces[column].text)
                column = pieces[column].end
                continue
            if all(line[column] == " " for r, line in enumerate(self.lines) if r != base):
                texts.append(self.lines[base][column])
                column += 1
                continue
            end = column
            while (
                end < self.width
                and end not in pieces
                and self.lines[base][end] == " "
                and self._is_above(end, base)
            ):
                end += 1
            if end == column:
                raise _LostError("a character above or below another")
            texts.append(f"^({self.part(slice(base), slice(column, end)).text()})")
            column = end
        return "".join(texts).strip()

    def _is_above(self, column: int, base: int) -> bool:
        return any(line[column] != " " for line in self.lines[:base])

    def _bracket(self, column: int) -> _Piece | None:
        """Return the tall bracket that begins in a column; None if there is none."""
        top = next(
            (row for row, line in enumerate(self.lines) if line[column] in _TALL_BRACKETS), None
        )
        if top is None:
            return None
        line = self.lines[top]
        hook = self.lines[top][column]
        middle, foot, *side = list(_TALL_BRACKETS[hook])
        bottom = top + 1
        while bottom < len(self.lines) and self.lines[bottom][column] == middle:
            bottom += 1
        if bottom == len(self.lines) or self.lines[bottom][column] != foot:
            raise _LostError("a tall bracket without its foot")
        depth = 0
        end = column
        for end in range(column, len(line)):
            depth += (line[end] == hook) - (line[end] == side[0])
            if depth == 0:
                break
        rows = range(top, bottom + 1)
        if depth or any(self.lines[r][end] not in side for r in rows):
            raise _LostError("a tall bracket that does not close")
        if any(
            line[column : end + 1].strip() for r, line in enumerate(self.lines) if r not in rows
        ):
            raise _LostError("a character above or below a bracket")
        inner = self.part(slice(top, bottom + 1), slice(column + 1, end))
        text = inner.matrix() if hook == "⎡" else f"({inner.text()})"
        return _Piece(end + 1, text, rows)

    def _fraction(self, column: int) -> _Piece | None:
        """Return the fraction whose bar begins in a column, with the longest such bar; None if there is none."""
        bars = [
            (len(line) - len(line[column:].lstrip(_BAR)), row)
            for row, line in enumerate(self.lines)
            if line[column] == _BAR and (column == 0 or line[column - 1] != _BAR)
        ]
        if not bars:
            return None
        end, row = max(bars)
        above = self.part(slice(row), slice(column, end))
        below = self.part(slice(row + 1, None), slice(column, end))
        if not any(line.strip() for line in above.lines) or not any(
            line.strip() for line in below.lines
        ):
            raise _LostError("a bar without a numerator or a denominator")
        top = above.text()
        bottom = below.text()
        is_derivative = (top, bottom) in _DERIVATIVES
        text = f"{top}/{bottom}" if is_derivative else f"(({top})/({bottom}))"
        return _Piece(end, text, [row])

    def matrix(self) -> str:
        """Return the inside of a matrix as a list of rows: blank lines part rows, two blank columns entries."""
        rows = [block.split_columns() for block in self.split_rows()]
        if len({len(row) for row in rows}) != 1:
            raise _LostError("a matrix whose rows have different lengths")
        row_texts = []
        for row in rows:
            entries = ", ".join(entry.text() for entry in row)
            row_texts.append(f"[{entries}]")
        return f"[{', '.join(row_texts)}]"

    def split_rows(self) -> list[_Block]:
        groups = groupby(range(len(self.lines)), key=lambda row: bool(self.lines[row].strip()))
        filled = [list(rows) for is_filled, rows in groups if is_filled]
        return [self.part(slice(rows[0], rows[-1] + 1)) for rows in filled]

    def _is_blank(self, column: int) -> bool:
        return all(line[column] == " " for line in self.lines)

    def split_columns(self) -> list[_Block]:
        # Two blank columns are added, which end the last entry.
        blank = [self._is_blank(column) for column in range(self.width)] + [True, True]
        blocks: list[_Block] = []
        start = None
        for column, is_blank in enumerate(blank):
            if not is_blank and start is None:
                start = column
            if start is not None and is_blank and blank[column - 1]:
                blocks.append(self.part(slice(None), slice(start, column - 1)))
                start = None
        return blocks
