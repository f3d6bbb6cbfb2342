"""Lines of generated code: expressions and comments that are longer than a line."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence

_WIDTH = 112
"""Longest line of an expression, in characters; it leaves room for an ending."""
_COMMENT_WIDTH = 96
"""Longest line of a comment's text, in characters."""


def wrapped(text: str, first: str, following: str, ending: str = "") -> str:
    """Break a long expression into lines before plus and minus signs.

    Parameters
    ----------
    text
        The expression.
    first
        Text in front of the expression.
    following
        Beginning of the following lines.
    ending
        Ending of all lines but the last.
    """
    lines: list[str] = []
    line = first
    for piece in re.split(r"(?= [+-] )", text):
        if len(line) + len(piece) > _WIDTH and line != first:
            lines.append(line + ending)
            line = following + piece.lstrip()
        else:
            line += piece
    return "\n".join([*lines, line])


def comment_block(sentences: Sequence[str], first: str, following: str, end: str) -> list[str]:
    """Return sentences as the lines of a comment.

    Parameters
    ----------
    sentences
        The text.
    first, following
        Beginning of the first line, and of the others.
    end
        Ending of the last line.
    """
    texts = textwrap.wrap(" ".join(sentences), _COMMENT_WIDTH)
    lines = [first + texts[0]]
    lines += [following + text for text in texts[1:]]
    lines[-1] += end
    return lines
