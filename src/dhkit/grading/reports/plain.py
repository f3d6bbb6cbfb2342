"""Text of a stranger's making it safe to print: one line, nothing that commands a terminal."""

from __future__ import annotations

__all__ = ["plain", "points"]

MOST = 4000
"""Characters of one text that a report shows: an answer may be a megabyte."""


def plain(text: str, most: int = MOST) -> str:
    """Return text as one line of printable characters: no escapes, no controls, nothing that turns its direction."""
    line = " ".join(text[: 2 * most].split())
    line = "".join(character if character.isprintable() else "?" for character in line)
    return line if len(line) <= most and len(text) <= 2 * most else f"{line[: most - 1]}…"


def points(number: float) -> str:
    """Return points as people write them, two decimals at most."""
    return f"{number:.2f}".rstrip("0").rstrip(".")
