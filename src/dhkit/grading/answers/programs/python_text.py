"""The text of Python expressions: one line of it for each expression, with the place of every node in that line."""

from __future__ import annotations

import ast
import io
import tokenize
from collections.abc import Callable
from itertools import accumulate

from dhkit.errors import AnswerError
from dhkit.grading.answers.tokens import to_ascii


class PythonText:
    r"""The text of one program.

    Parameters
    ----------
    text
        The program, with ``\n`` alone between lines.
    """

    def __init__(self, text: str) -> None:
        self.lines = text.split("\n")
        self._encoded = [None if line.isascii() else line.encode() for line in self.lines]
        self._columns: dict[int, list[int]] = {}
        """Column of each byte of the one line that was asked for last."""

    def _column(self, line: int, offset: int) -> int:
        """Return a column in characters, from 0, where the parser counts bytes; lines count from 1."""
        encoded = self._encoded[line - 1]
        if encoded is None:
            return offset
        if line not in self._columns:
            begins_character = ((byte & 0xC0) != 0x80 for byte in encoded)
            self._columns = {line: [0, *accumulate(begins_character)]}
        return self._columns[line][offset]

    def segment(self, node: ast.expr) -> str:
        """Return an expression's text in one line: no comments, no line breaks, characters where they were."""
        end_line, end_offset = node.end_lineno or node.lineno, node.end_col_offset or 0
        first, last = self._column(node.lineno, node.col_offset), self._column(end_line, end_offset)
        if node.lineno == end_line:
            return self.lines[node.lineno - 1][first:last]
        lines = [self.lines[node.lineno - 1][first:], *self.lines[node.lineno : end_line - 1]]
        return _one_line([*lines, self.lines[end_line - 1][:last]])

    def spans(self, root: ast.expr) -> Callable[[ast.expr], tuple[int, int]]:
        """Return a function from a node inside an expression to where it begins and ends in the :meth:`segment`."""
        start = self._column(root.lineno, root.col_offset)
        offsets = {root.lineno: -start}
        at = len(self.lines[root.lineno - 1]) - start + 1
        for line in range(root.lineno + 1, (root.end_lineno or root.lineno) + 1):
            offsets[line] = at
            at += len(self.lines[line - 1]) + 1

        def span(node: ast.expr) -> tuple[int, int]:
            end_line = node.end_lineno or node.lineno
            return (
                offsets[node.lineno] + self._column(node.lineno, node.col_offset),
                offsets[end_line] + self._column(end_line, node.end_col_offset or 0),
            )

        return span


def ascii_name(name: str) -> str:
    """Return an identifier in ASCII: Greek letters by their names, as the reader of formulas has them."""
    if name.isascii():
        return name
    try:
        plain, _ = to_ascii(name)
    except AnswerError:
        plain = ""
    return plain if plain.isidentifier() and plain.isascii() else "u" + name.encode("unicode_escape").hex()


def _one_line(lines: list[str]) -> str:
    """Return several lines as one, with spaces for comments, continuation signs and line breaks."""
    text = "\n".join(lines)
    if "#" in text:
        starts: dict[int, int] = {}
        try:
            for token in tokenize.generate_tokens(io.StringIO(f"({text}\n)").readline):
                if token.type == tokenize.COMMENT:
                    starts[token.start[0] - 1] = token.start[1] - (token.start[0] == 1)
        except (tokenize.TokenError, SyntaxError, IndentationError):
            pass  # the expression ends inside brackets: its comments were found
        for line, column in starts.items():
            if line < len(lines):
                lines[line] = lines[line][:column] + " " * (len(lines[line]) - column)
    joined = " ".join(f"{line[:-1]} " if line.endswith("\\") else line for line in lines)
    return joined.replace("\t", " ").replace("\f", " ")
