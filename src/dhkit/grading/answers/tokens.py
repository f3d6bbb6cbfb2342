"""From what a student typed to tokens: ASCII or the mathematical characters that keyboards and editors insert."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from typing import NoReturn

from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Token

MAX_LENGTH = 200_000
"""Characters of one entry: a PUMA's first, multiplied out in numbers, has 30,000."""

MAX_DEPTH = 50

TOKEN = re.compile(
    r"\s*(?:((?:\d+(?:\.(?![*/^'])\d*)?|\.\d+)(?:[eE][+-]?\d+)?)|([A-Za-z_]\w*)"
    r"|(\*\*|\.\*|\./|\.\^|\.'|\\\\|<=|>=|==|[-+*/^(),;\[\]&'.<>=:]))",
    re.ASCII,
)
SAME = {".*": "*", "./": "/", ".^": "^", "**": "^"}
"""Signs of MATLAB and Python that mean one thing between numbers."""

_FOLDED = {
    **dict.fromkeys("·×∗⋅∙•", "*"),
    **dict.fromkeys("−–—‐‑﹣", "-"),
    **dict.fromkeys("÷∕⁄", "/"),
    **dict.fromkeys("\u00a0\u2009\u202f\u2002\u2003\u200a\u2061\u2062", " "),
    **dict.fromkeys("′’‘", "'"),
    **{subscript: str(k) for k, subscript in enumerate("₀₁₂₃₄₅₆₇₈₉")},
    "½": "(1/2)",
    "⅓": "(1/3)",
    "¼": "(1/4)",
    "¾": "(3/4)",
    "⅔": "(2/3)",
    "√": " sqrt ",
    "ℓ": "l",
    "\u0307": "dot",
    "\u0308": "ddot",
}
_VULGAR = "½⅓¼¾⅔"
_RAISED = {raised: str(k) for k, raised in enumerate("⁰¹²³⁴⁵⁶⁷⁸⁹")} | {"⁻": "-", "⁺": "+"}


def shown(text: str) -> str:
    """Return text as messages show it: short, and with nothing that a terminal would obey."""
    return repr(text if len(text) <= 60 else text[:57] + "...")


def fail(text: str, at: int, problem: str) -> NoReturn:
    """Refuse an answer, with the place.

    Raises
    ------
    AnswerError
        Always.
    """
    raise AnswerError(f"{shown(text)}: {problem} at position {at + 1}")


def folded(text: str) -> tuple[str, list[int]]:
    """Return text in ASCII, and where each of its characters stood.

    Greek letters become their names, raised digits powers, dots above a letter ``dot``. A letter of another alphabet
    that merely looks like one of ours is refused.

    Raises
    ------
    AnswerError
        A character that no formula has, or too many characters.
    """
    if len(text) > MAX_LENGTH:
        raise AnswerError(f"an entry of {len(text)} characters; expected at most {MAX_LENGTH}")
    if text.isascii():
        return text, list(range(len(text)))
    pieces: list[str] = []
    places: list[int] = []
    before_raised = False
    for at, character in enumerate(unicodedata.normalize("NFD", text)):
        piece, raised = character, character in _RAISED
        if character in _VULGAR and pieces and pieces[-1][-1:].isdigit():
            whole, part = pieces[-1][-1], _FOLDED[character]
            fail(text, at, f"{whole}{character} may be {whole} + {part} or {whole}*{part}; write one of them")
        if raised:
            piece = ("" if before_raised else "^") + _RAISED[character]
        elif not character.isascii():
            piece = _FOLDED.get(character) or _greek(character) or fail(text, at, _described(character))
        before_raised = raised
        pieces.append(piece)
        places += [at] * len(piece)
    return "".join(pieces), places


def tokens(text: str, places: list[int], original: str, allowed: str = "") -> list[Token]:
    """Split ASCII text into tokens.

    Parameters
    ----------
    text, places
        What :func:`folded` returns.
    original
        What messages show.
    allowed
        Further characters that are signs.

    Raises
    ------
    AnswerError
        A character that no formula has.
    """
    found, at, end = [], 0, len(text.rstrip())
    while at < end:
        match = TOKEN.match(text, at)
        if match is None:
            at += len(text[at:]) - len(text[at:].lstrip())
            if text[at] not in allowed:
                fail(original, places[at], f"unexpected character {text[at]!r}")
            found.append(Token("sign", text[at], places[at]))
            at += 1
            continue
        which = match.lastindex or 1
        word = match.group(which)
        found.append(Token(("number", "name", "sign")[which - 1], SAME.get(word, word), places[match.start(which)]))
        at = match.end()
    return found


def nesting(text: str) -> int:
    """Return by how much a token changes the depth of round and square brackets: 1, -1 or 0."""
    return {"(": 1, "[": 1, ")": -1, "]": -1}.get(text, 0)


def check_depth(found: Sequence[Token], text: str) -> None:
    """Refuse tokens whose brackets are nested deeper than :data:`MAX_DEPTH`.

    Raises
    ------
    AnswerError
        They are; with the place.
    """
    depth = 0
    for token in found:
        depth += nesting(token.text)
        if depth > MAX_DEPTH:
            fail(text, token.at, f"brackets nested more than {MAX_DEPTH} deep")


def closing_bracket(found: Sequence[Token], k: int) -> int:
    """Return where the bracket at k closes; the number of tokens where it does not."""
    depth = 0
    for end in range(k, len(found)):
        depth += nesting(found[end].text)
        if depth == 0:
            return end
    return len(found)


def dotted(name: str, dots: str) -> str:
    """Return the name of a derivative by time, its number last: theta1 and dot are thetadot1."""
    letters = name.rstrip("0123456789")
    return f"{letters}{dots}{name[len(letters) :]}"


def _greek(character: str) -> str:
    """Return a Greek letter's name, apart from what comes before it: theta, omega, Sigma."""
    name = unicodedata.name(character, "")
    match = re.fullmatch(r"GREEK (SMALL|CAPITAL) LETTER ([A-Z]+)|GREEK (PHI|THETA|EPSILON|RHO) SYMBOL", name)
    if match is None:
        return ""
    letter = (match[2] or match[3]).lower()
    return letter.capitalize() if match[1] == "CAPITAL" else {"lamda": "lambda"}.get(letter, letter)


def _described(character: str) -> str:
    return f"character U+{ord(character):04X} ({unicodedata.name(character, 'unnamed')}), which formulas do not have,"
