"""Output on pipes and terminals that do not know every letter: what they lack is written in plain letters."""

from __future__ import annotations

import codecs
import io
import sys
import unicodedata

__all__ = ["accept_every_letter"]

PLAIN = dict(zip("→←↑↓−–≤≥·…′", ("->", "<-", "^", "v", "-", "-", "<=", ">=", "*", "...", "'"), strict=True))
"""Signs whose decomposition has no ASCII letters."""


def accept_every_letter() -> None:
    """Have stdout and stderr replace letters that their encoding lacks, as cp1252 lacks theta, in place of failing."""
    codecs.register_error("dhkit.plain", _replaced)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="dhkit.plain")


def _replaced(error: UnicodeError) -> tuple[str, int]:
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
