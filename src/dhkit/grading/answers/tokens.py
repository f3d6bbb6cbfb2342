"""Text that a student typed as tokens: ASCII or the mathematical characters that keyboards and editors insert."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Iterable, Sequence
from itertools import accumulate
from typing import NoReturn

from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Token
from dhkit.grading.answers.bounds import BOUNDS

_TOKEN = re.compile(
    r"\s*(?:((?:\d+(?:\.(?![*/^'])\d*)?|\.\d+)(?:[eE][+-]?\d+)?)|([A-Za-z_]\w*)"
    r"|(\*\*|\.\*|\./|\.\^|\.'|\\\\|<=|>=|==|[-+*/^(),;\[\]&'.<>=:]))",
    re.ASCII,
)
_SAME = {".*": "*", "./": "/", ".^": "^", "**": "^"}
"""Signs of MATLAB and Python that mean one thing between numbers."""

_VULGAR_FRACTIONS = {"½": "(1/2)", "⅓": "(1/3)", "¼": "(1/4)", "¾": "(3/4)", "⅔": "(2/3)"}

_ASCII_TEXTS = {
    **dict.fromkeys("·×∗⋅∙•", "*"),
    **dict.fromkeys("−–—‐‑﹣", "-"),
    **dict.fromkeys("÷∕⁄", "/"),
    **dict.fromkeys("\u00a0\u2009\u202f\u2002\u2003\u200a\u2061\u2062", " "),
    **dict.fromkeys("′’‘", "'"),
    **{subscript: str(k) for k, subscript in enumerate("₀₁₂₃₄₅₆₇₈₉")},
    **_VULGAR_FRACTIONS,
    **dict(zip("√ℓ\u0307\u0308", (" sqrt ", "l", "dot", "ddot"), strict=True)),
}
"""ASCII text of characters; Greek letters and raised digits are told apart from these."""

_RAISED = {raised: str(k) for k, raised in enumerate("⁰¹²³⁴⁵⁶⁷⁸⁹")} | {"⁻": "-", "⁺": "+"}


def word_set(text: str) -> frozenset[str]:
    """Return the words of a text as a set, for long tables of words."""
    return frozenset(text.split())


def quote(text: str) -> str:
    """Return text as messages show it: short, and with control characters escaped."""
    return repr(text if len(text) <= 60 else text[:57] + "...")


def fail(text: str, at: int, problem: str) -> NoReturn:
    """Refuse an answer, with the place.

    Raises
    ------
    AnswerError
        Always.
    """
    raise AnswerError(f"{quote(text)}: {problem} at position {at + 1}")


def to_ascii(text: str) -> tuple[str, list[int]]:
    """Return text in ASCII, and where each of its characters stood.

    Greek letters become their names, raised digits powers, dots above a letter ``dot``. A letter of another alphabet
    that merely looks like one of ours is refused.

    Raises
    ------
    AnswerError
        A character that no formula has, or too many characters.
    """
    if len(text) > BOUNDS.entry_characters:
        raise AnswerError(
            f"an entry of {len(text)} characters; expected at most {BOUNDS.entry_characters}"
        )
    if text.isascii():
        return text, list(range(len(text)))
    pieces: list[str] = []
    places: list[int] = []
    before_raised = False
    for at, character in enumerate(unicodedata.normalize("NFD", text)):
        piece = character
        raised = character in _RAISED
        if character in _VULGAR_FRACTIONS and pieces and pieces[-1][-1:].isdigit():
            whole = pieces[-1][-1]
            part = _ASCII_TEXTS[character]
            fail(
                text,
                at,
                f"{whole}{character} may be {whole} + {part} or {whole}*{part}; write one of them",
            )
        if raised:
            piece = ("" if before_raised else "^") + _RAISED[character]
        elif not character.isascii():
            piece = (
                _ASCII_TEXTS.get(character)
                or _greek(character)
                or fail(text, at, _described(character))
            )
        before_raised = raised
        pieces.append(piece)
        places += [at] * len(piece)
    return "".join(pieces), places


def split_tokens(text: str, places: list[int], original: str, allowed: str = "") -> list[Token]:
    """Split ASCII text into tokens.

    Parameters
    ----------
    text, places
        What :func:`to_ascii` returns.
    original
        What messages show.
    allowed
        Further characters that are signs.

    Raises
    ------
    AnswerError
        A character that no formula has.
    """
    tokens: list[Token] = []
    at = 0
    end = len(text.rstrip())
    while at < end:
        if match := _TOKEN.match(text, at):
            group = match.lastindex or 1
            word = _SAME.get(match[group], match[group])
            tokens.append(
                Token(("number", "name", "sign")[group - 1], word, places[match.start(group)])
            )
            at = match.end()
            continue
        at += len(text[at:]) - len(text[at:].lstrip())
        if text[at] not in allowed:
            fail(original, places[at], f"unexpected character {text[at]!r}")
        tokens.append(sign(text[at], places[at]))
        at += 1
    return tokens


def nesting(text: str) -> int:
    """Return by how much a token changes the depth of round and square brackets: 1, -1 or 0."""
    return {"(": 1, "[": 1, ")": -1, "]": -1}.get(text, 0)


def check_depth(tokens: Sequence[Token], text: str) -> None:
    """Refuse tokens whose brackets are nested deeper than ``BOUNDS.nesting``.

    Raises
    ------
    AnswerError
        They are; with the place.
    """
    depth = 0
    for token in tokens:
        depth += nesting(token.text)
        if depth > BOUNDS.nesting:
            fail(text, token.at, f"brackets nested more than {BOUNDS.nesting} deep")


def closing_bracket(tokens: Sequence[Token], k: int) -> int:
    """Return where the bracket at k closes; the number of tokens where it does not."""
    depth = 0
    for end in range(k, len(tokens)):
        depth += nesting(tokens[end].text)
        if depth == 0:
            return end
    return len(tokens)


def places_outside_brackets(tokens: Sequence[Token], *texts: str) -> list[int]:
    """Return where tokens of some texts stand outside all brackets."""
    depths = accumulate(nesting(token.text) for token in tokens)
    return [k for k, depth in enumerate(depths) if depth == 0 and tokens[k].text in texts]


def sign(text: str, at: int) -> Token:
    """Return the token of a sign."""
    return Token("sign", text, at)


def in_brackets(inner: Iterable[Token], at: int) -> list[Token]:
    """Return tokens in round brackets."""
    return [sign("(", at), *inner, sign(")", at)]


def derivative_by_time(inner: Iterable[Token], order: int, at: int) -> list[Token]:
    """Return the first or second time derivative of what tokens say: ddt(...)."""
    derivative = list(inner)
    for _ in range(order):
        derivative = [Token("function", "ddt", at), *in_brackets(derivative, at)]
    return derivative


def begins_with(tokens: Sequence[Token], k: int, *texts: str) -> bool:
    """Whether the tokens from place k on have some texts."""
    if k >= len(tokens) or tokens[k].text != texts[0]:  # most often, and fast
        return False
    return [token.text for token in tokens[k : k + len(texts)]] == list(texts)


def replace_runs(
    tokens: Sequence[Token], read_run: Callable[[int], tuple[Sequence[Token], int] | None]
) -> list[Token]:
    """Return tokens with some runs of them replaced.

    Parameters
    ----------
    tokens
        The tokens.
    read_run
        Function from a place to the tokens that replace the run that begins there, and to the place after the run;
        None where no such run begins.
    """
    result: list[Token] = []
    k = 0
    while k < len(tokens):
        replacement, k = read_run(k) or ([tokens[k]], k + 1)
        result += replacement
    return result


def rate_name(name: str, dots: str) -> str:
    """Return the name of a derivative by time, its number last: theta1 and dot are thetadot1."""
    letters = name.rstrip("0123456789")
    return f"{letters}{dots}{name[len(letters) :]}"


def _greek(character: str) -> str:
    """Return a Greek letter's name, apart from what comes before it: theta, omega, Sigma."""
    name = unicodedata.name(character, "")
    match = re.fullmatch(
        r"GREEK (SMALL|CAPITAL) LETTER ([A-Z]+)|GREEK (PHI|THETA|EPSILON|RHO) SYMBOL", name
    )
    if match is None:
        return ""
    letter = (match[2] or match[3]).lower()
    return letter.capitalize() if match[1] == "CAPITAL" else {"lamda": "lambda"}.get(letter, letter)


def _described(character: str) -> str:
    return f"character U+{ord(character):04X} ({unicodedata.name(character, 'unnamed')}), which formulas do not have,"
