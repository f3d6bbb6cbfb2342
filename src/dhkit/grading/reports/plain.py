"""Text of a stranger's making it safe to print: one line, nothing that commands a terminal."""

from __future__ import annotations

from dhkit import display

MOST = 4000
"""Characters of one text that a report shows: an answer may be a megabyte."""


def plain(text: str, most: int = MOST) -> str:
    """Return text as one line of printable characters; see :func:`dhkit.display.plain`."""
    return display.plain(text, most)


def points(number: float) -> str:
    """Return points as people write them, two decimals at most."""
    return f"{number:.2f}".rstrip("0").rstrip(".")
