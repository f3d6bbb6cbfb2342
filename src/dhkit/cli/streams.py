"""Output on pipes and terminals whose encoding lacks letters: such letters are written in plain ones."""

from __future__ import annotations

import codecs
import contextlib
import io
import os
import sys
import unicodedata
from pathlib import Path
from typing import Any, TextIO, cast

PLAIN = dict(zip("→←↑↓−–≤≥·…′", ("->", "<-", "^", "v", "-", "-", "<=", ">=", "*", "...", "'"), strict=True))
PLAIN |= {"°": " deg", "±": "+/-", "∓": "-/+"}
"""ASCII for signs whose decomposition has no ASCII letters."""


def replace_unknown_letters() -> None:
    """Make stdout and stderr replace letters that their encoding lacks, as cp1252 lacks theta, instead of failing."""
    codecs.register_error("dhkit.plain", _replace_letters)
    if sys.stdout is None:  # closed by the shell
        sys.stdout = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115 - to the end
    if sys.stderr is None:
        sys.stderr = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="dhkit.plain")
    sys.stderr = cast(TextIO, _MessageStream(sys.stderr))


class _MessageStream:
    """A stream for messages: one that cannot be written does not end the command."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        with contextlib.suppress(OSError):
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        with contextlib.suppress(OSError):
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


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
