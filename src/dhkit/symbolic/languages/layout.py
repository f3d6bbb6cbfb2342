"""Lines of generated code: expressions and comments that are longer than a line."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence

_WIDTH = 112
_COMMENT_WIDTH = 96


def wrapped(text: str, first: str, following: str, ending: str = "") -> str:
    """Break a long expression in front of plus and minus signs.

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
        What it says.
    first, following
        Beginning of the first line, and of the others.
    end
        Ending of the last line.
    """
    lines = textwrap.wrap(" ".join(sentences), _COMMENT_WIDTH)
    begun = [f"{first if k == 0 else following}{line}" for k, line in enumerate(lines)]
    return [*begun[:-1], begun[-1] + end]
