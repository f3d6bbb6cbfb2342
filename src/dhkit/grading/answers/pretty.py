"""Formulas that sympy prints over several lines, brought into one: fractions by bars, powers above, tall brackets.

Every character must be part of something: one that stands above or below the line without a bar or a bracket refuses
the answer, since a lost space would move an exponent.
"""

from __future__ import annotations

from dataclasses import dataclass

from dhkit.errors import AnswerError
from dhkit.grading.answers.tokens import shown

MARKS = frozenset("⎛⎜⎝⎡⎢⎣─⋅")
BAR = "─"
DERIVATIVES = (("d", "dt"), ("d^(2)", "dt^(2)"))
TOPS = {"⎛": ("⎜", "⎝", "⎞"), "⎡": ("⎢", "⎣", "⎤")}
"""Upper hooks of tall brackets: what continues them, what ends them, and the closing bracket's upper hook."""
CLOSING_SIDES = {"⎛": "⎞⎟⎠", "⎡": "⎤⎥⎦"}
MAX_LINES, MAX_COLUMNS, MAX_DEPTH = 200, 2_000, 30


def is_pretty(text: str) -> bool:
    """Whether a text is a formula over several lines, as sympy's pretty printer writes it."""
    return "\n" in text.strip("\n") and not MARKS.isdisjoint(text) and "\\" not in text


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
    if len(lines) > MAX_LINES or max(map(len, lines)) > MAX_COLUMNS:
        raise AnswerError(f"{shown(text)}: more than {MAX_LINES} lines or {MAX_COLUMNS} columns")
    if any(mark in text for mark in "√╲╱⌠⎮"):
        raise AnswerError(f"{shown(text)}: a root or an integral over several lines; print it with str()")
    width = max(map(len, lines))
    block = _Block(tuple(line.ljust(width) for line in lines), 0)
    try:
        return block.text()
    except _LostError as lost:
        raise AnswerError(f"{shown(text)}: {lost}; were spaces lost? print it in one line, with str()") from None


class _LostError(Exception):
    """A character that belongs to nothing."""


@dataclass(frozen=True)
class _Block:
    """A rectangle of characters, with how deep it is nested."""

    lines: tuple[str, ...]
    depth: int

    def part(self, rows: slice, columns: slice) -> _Block:
        if self.depth >= MAX_DEPTH:
            raise _LostError(f"nested more than {MAX_DEPTH} deep")
        return _Block(tuple(line[columns] for line in self.lines[rows]), self.depth + 1)

    @property
    def width(self) -> int:
        return max(map(len, self.lines), default=0)

    def text(self) -> str:
        """Return the block's formula in one line."""
        pieces: dict[int, tuple[int, str]] = {}
        """Where brackets and fractions begin: where they end, and their text."""
        taken = [False] * self.width
        allowed = set(range(len(self.lines)))
        for column in range(self.width):
            if taken[column]:
                continue
            found = self._bracket(column) or self._fraction(column)
            if found is None:
                continue
            end, text, rows = found
            pieces[column] = (end, text)
            taken[column:end] = [True] * (end - column)
            allowed &= set(rows)
        if not allowed:
            raise _LostError("a fraction's bar that is not on the line of what stands beside it")
        free = {r for r, line in enumerate(self.lines) for c, x in enumerate(line) if x != " " and not taken[c]}
        # The line of the formula: powers alone stand above it, and nothing below.
        base = max(free & allowed, default=min(allowed))
        if any(row > base for row in free):
            raise _LostError("a character below the line")
        return self._joined(pieces, base)

    def _joined(self, pieces: dict[int, tuple[int, str]], base: int) -> str:
        out: list[str] = []
        column = 0
        while column < self.width:
            if column in pieces:
                column, text = pieces[column]
                out.append(text)
                continue
            above = [r for r, line in enumerate(self.lines) if r != base and line[column] != " "]
            if not above:
                out.append(self.lines[base][column])
                column += 1
                continue
            end = column
            while (
                end < self.width and end not in pieces and self.lines[base][end] == " " and self._has_above(end, base)
            ):
                end += 1
            if end == column:
                raise _LostError("a character above or below another")
            out.append(f"^({self.part(slice(0, base), slice(column, end)).text()})")
            column = end
        return "".join(out).strip()

    def _has_above(self, column: int, base: int) -> bool:
        return any(line[column] != " " for line in self.lines[:base])

    def _bracket(self, column: int) -> tuple[int, str, range] | None:
        """Return a tall bracket that begins in a column: where it ends, its text, and its rows."""
        for top, line in enumerate(self.lines):
            hook = line[column]
            if hook not in TOPS:
                continue
            middle, foot, closing = TOPS[hook]
            bottom = top + 1
            while bottom < len(self.lines) and self.lines[bottom][column] == middle:
                bottom += 1
            if bottom == len(self.lines) or self.lines[bottom][column] != foot:
                raise _LostError("a tall bracket without its foot")
            depth, end = 0, column
            for end in range(column, len(line)):
                depth += (line[end] == hook) - (line[end] == closing)
                if depth == 0:
                    break
            side = CLOSING_SIDES[hook]
            rows = range(top, bottom + 1)
            if depth or any(self.lines[r][end] not in side for r in rows):
                raise _LostError("a tall bracket that does not close")
            outside = [r for r in range(len(self.lines)) if r not in rows]
            if any(self.lines[r][column : end + 1].strip() for r in outside):
                raise _LostError("a character above or below a bracket")
            inner = self.part(slice(top, bottom + 1), slice(column + 1, end))
            return end + 1, inner.matrix() if hook == "⎡" else f"({inner.text()})", rows
        return None

    def _fraction(self, column: int) -> tuple[int, str, range] | None:
        """Return a fraction whose bar begins in a column, the longest of those that do: its end, text, and row."""
        bars = []
        for row, line in enumerate(self.lines):
            if line[column] == BAR and (column == 0 or line[column - 1] != BAR):
                end = column
                while end < len(line) and line[end] == BAR:
                    end += 1
                bars.append((end, row))
        if not bars:
            return None
        end, row = max(bars)
        above = self.part(slice(0, row), slice(column, end))
        below = self.part(slice(row + 1, len(self.lines)), slice(column, end))
        if not (above.is_filled and below.is_filled):
            raise _LostError("a bar without a numerator or a denominator")
        top, bottom = above.text(), below.text()
        if (top, bottom) in DERIVATIVES:
            return end, f"{top}/{bottom}", range(row, row + 1)
        return end, f"(({top})/({bottom}))", range(row, row + 1)

    @property
    def is_filled(self) -> bool:
        return any(line.strip() for line in self.lines)

    def matrix(self) -> str:
        """Return the inside of a matrix as a list of rows: blank lines part rows, two blank columns entries."""
        rows = [block.parted_columns() for block in self.parted_rows()]
        if len({len(row) for row in rows}) != 1:
            raise _LostError("a matrix whose rows have different lengths")
        return "[" + ", ".join("[" + ", ".join(entry.text() for entry in row) + "]" for row in rows) + "]"

    def parted_rows(self) -> list[_Block]:
        found: list[_Block] = []
        start = None
        for row, line in enumerate((*self.lines, "")):
            if line.strip() and start is None:
                start = row
            elif not line.strip() and start is not None:
                found.append(self.part(slice(start, row), slice(0, self.width)))
                start = None
        return found

    def parted_columns(self) -> list[_Block]:
        blank = [all(line[c] == " " for line in self.lines) for c in range(self.width)]
        found: list[_Block] = []
        start, gap = None, 0
        for column in range(self.width + 2):
            is_blank = column >= self.width or blank[column]
            gap = gap + 1 if is_blank else 0
            if not is_blank and start is None:
                start = column
            if start is not None and gap == 2:
                found.append(self.part(slice(0, len(self.lines)), slice(start, column - 1)))
                start = None
        return found
