r"""Filter of stdout and stderr: no control characters from others, and no letters that the encoding lacks.

Names of files, of robots and of students come from others. Sequences in them that clear a screen, set a title or turn
the direction of text are written as ``\x1b``. Our own styles go past that: :func:`styled`.
"""

from __future__ import annotations

import codecs
import contextlib
import io
import os
import re
import sys
import unicodedata
from pathlib import Path
from typing import Any, TextIO, cast

PLAIN = dict(
    zip("→←↑↓−–≤≥·…′", ("->", "<-", "^", "v", "-", "-", "<=", ">=", "*", "...", "'"), strict=True)
)
PLAIN |= {"°": " deg", "±": "+/-", "∓": "-/+"}
"""ASCII for signs whose decomposition has no ASCII letters."""


UNSAFE = re.compile(
    r"\r(?!\n)|[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)
"""Control characters but tabs and ends of lines, marks of direction, separators of lines, and parts of characters."""


def visible(text: str) -> str:
    r"""Return text with unsafe characters written as escapes.

    Examples
    --------
    >>> visible("\x1b[2Jname.toml")
    '\\x1b[2Jname.toml'
    """
    return UNSAFE.sub(lambda match: match[0].encode("unicode_escape").decode("ascii"), text)


def styled(stream: TextIO) -> TextIO:
    """Return the stream below a clean one, for our own styles and movements of the cursor."""
    return stream.below if isinstance(stream, _CleanStream) else stream


def clean_streams() -> None:
    """Make stdout and stderr write unsafe characters as escapes, and letters that they lack as plain ones.

    An encoding such as cp1252 lacks theta.
    """
    codecs.register_error("dhkit.plain", _replace_letters)
    if sys.stdout is None:  # closed by the shell
        sys.stdout = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115 - to the end
    if sys.stderr is None:
        sys.stderr = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="dhkit.plain")
    if not isinstance(sys.stdout, _CleanStream):
        sys.stdout = cast(TextIO, _CleanStream(sys.stdout))
    if not isinstance(sys.stderr, _CleanStream):
        sys.stderr = cast(TextIO, _CleanStream(cast(TextIO, _MessageStream(sys.stderr))))


class _Stream:
    """A stream on another one, ``below``."""

    def __init__(self, below: TextIO) -> None:
        self.below = below

    def __getattr__(self, name: str) -> Any:
        return getattr(self.below, name)


class _CleanStream(_Stream):
    """A stream that writes unsafe characters as escapes."""

    def write(self, text: str) -> int:
        self.below.write(visible(text))
        return len(text)


class _MessageStream(_Stream):
    """A stream for messages: one that cannot be written does not end the command."""

    def write(self, text: str) -> int:
        with contextlib.suppress(OSError):
            self.below.write(text)
        return len(text)

    def flush(self) -> None:
        with contextlib.suppress(OSError):
            self.below.flush()


def _replace_letters(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(_plain, error.object[error.start : error.end])), error.end


def _plain(letter: str) -> str:
    """Return ASCII for a letter: theta for a Greek one, the digit of a superscript, a question mark for the rest."""
    if letter in PLAIN:
        return PLAIN[letter]
    if letters := unicodedata.normalize("NFKD", letter).encode("ascii", "ignore").decode():
        return letters
    name = unicodedata.name(letter, "")
    if name.startswith("GREEK "):
        word = name.split(" WITH ")[0].split()[-1]
        return word.capitalize() if "CAPITAL" in name else word.lower()
    if name.startswith("BOX DRAWINGS"):
        return "|" if "VERTICAL" in name else "-"
    return "?"
