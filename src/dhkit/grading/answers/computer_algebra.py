r"""Output of Mathematica, Maple and Maxima, rewritten as tokens of plain text.

Mathematica calls by square brackets and lists by braces (``Sin[q1[t]]``, ``{{a, b}, {c, d}}``, ``\[Theta]1'[t]``),
Maple counts indices from 1 (``theta[1](t)``), Maxima quotes what it does not evaluate (``'diff(q1, t)``, ``%pi``).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import accumulate

from dhkit.expressions.syntax import Token
from dhkit.grading.answers.tokens import begins_with, derivative_by_time, fail, replace_runs, sign

_MATHEMATICA = re.compile(
    r"\*\^|\b(?:Sin|Cos|Tan|Sec|Csc|Cot|Sqrt|ArcTan|ArcSin|ArcCos|Derivative|Subscript|Abs|Sign|D|Dt)\[|[A-Za-z0-9\]]'*\[t\]"
    r"|\\\[[A-Z][A-Za-z]*\]|^\s*\{[^\\]*\}\s*$",
    re.DOTALL,
)
_OPENING = {"(": ")", "[": "]", "{": "}"}
_CLOSING = frozenset(")]}")


def is_mathematica(text: str) -> bool:
    r"""Whether a text is Mathematica's: a function with square brackets, a list in braces, \[Theta]."""
    without_names = re.sub(r"\\\[[A-Z][A-Za-z]*\]", "", text)
    return (
        "\\" not in without_names
        and "_{" not in text
        and "^{" not in text
        and bool(_MATHEMATICA.search(text))
    )


def from_mathematica(tokens: Sequence[Token], text: str) -> list[Token]:
    """Return tokens with round brackets for calls and square ones for lists.

    Raises
    ------
    AnswerError
        Brackets that do not match, a derivative other than by t, or a subscript that is not a name.
    """
    tokens = replace_runs(tokens, partial(_letter, tokens))
    tokens = replace_runs(tokens, partial(_exponent, tokens))
    closing = _closing_places(tokens, text)
    return _with_plain_brackets(
        replace_runs(tokens, lambda k: _name(tokens, k, closing, text)), text
    )


def _letter(tokens: Sequence[Token], k: int) -> tuple[list[Token], int] | None:
    r"""Read \[Theta]1 as theta1."""
    if not begins_with(tokens, k, "\\", "[") or not begins_with(tokens, k + 3, "]"):
        return None
    letter = tokens[k + 2].text.lower()
    end = k + 4
    if (
        end < len(tokens)
        and tokens[end].kind == "number"
        and tokens[end].at == tokens[end - 1].at + 1
    ):
        letter += tokens[end].text
        end += 1
    return [Token("name", letter, tokens[end - 1].at)], end


def _exponent(tokens: Sequence[Token], k: int) -> tuple[list[Token], int] | None:
    """Read 5*^-1 as 5e-1."""
    if tokens[k].kind != "number" or not begins_with(tokens, k + 1, "*", "^"):
        return None
    minus = "-" if begins_with(tokens, k + 3, "-") else ""
    end = k + 4 + len(minus)
    exponent = tokens[end - 1].text if end <= len(tokens) else ""
    return (
        ([Token("number", f"{tokens[k].text}e{minus}{exponent}", tokens[k].at)], end)
        if exponent.isdecimal()
        else None
    )


def _name(
    tokens: Sequence[Token], k: int, closing: Mapping[int, int], text: str
) -> tuple[list[Token], int] | None:
    """Read a name that Mathematica has in another way: Pi, D[...], Derivative[...], Subscript[...], ArcTan[x, y]."""
    token = tokens[k]
    if token.kind != "name" or not begins_with(tokens, k + 1, "["):
        return ([Token("name", "pi", token.at)], k + 1) if token.text == "Pi" else None
    end = closing[k + 1]
    match token.text:
        case "Pi":
            return [Token("name", "pi", token.at)], k + 1
        case "D" | "Dt":
            return [Token("name", "diff", token.at)], k + 1
        case "Derivative":
            return _derivative(tokens, k, closing, text)
        case "Subscript":
            parts = [part.text for part in tokens[k + 2 : end] if part.text != ","]
            if not parts or not all(part.isalnum() for part in parts):
                fail(text, token.at, "a subscript that is not a name")
            return [Token("name", "".join(parts), token.at)], end + 1
        case "ArcTan" if comma := _only_comma(tokens, k + 1, end):  # the cosine comes first
            x = from_mathematica(tokens[k + 2 : comma], text)
            y = from_mathematica(tokens[comma + 1 : end], text)
            arguments = [sign("(", token.at), *y, tokens[comma], *x, sign(")", tokens[end].at)]
            return [Token("name", "atan2", token.at), *arguments], end + 1
    return None


def _closing_places(tokens: Sequence[Token], text: str) -> dict[int, int]:
    """Return where each opening bracket closes."""
    places: dict[int, int] = {}
    opened: list[int] = []
    for k, token in enumerate(tokens):
        if token.kind == "sign" and token.text in _OPENING:
            opened.append(k)
        elif token.kind == "sign" and token.text in _CLOSING:
            if not opened or _OPENING[tokens[opened[-1]].text] != token.text:
                fail(text, token.at, f"{token.text!r} without its opening bracket")
            places[opened.pop()] = k
    if opened:
        fail(text, tokens[opened[-1]].at, "a bracket that does not close")
    return places


def _only_comma(tokens: Sequence[Token], start: int, end: int) -> int:
    """Return where the one comma of a bracket's own level is; 0 where there is none, or more than one."""
    depths = accumulate(
        (token.text in _OPENING) - (token.text in _CLOSING) for token in tokens[start + 1 : end]
    )
    commas = [
        k for k, depth in enumerate(depths, start + 1) if depth == 0 and tokens[k].text == ","
    ]
    return commas[0] if len(commas) == 1 else 0


def _derivative(
    tokens: Sequence[Token], k: int, closing: Mapping[int, int], text: str
) -> tuple[list[Token], int]:
    """Read Derivative[1][q1][t]."""
    order = tokens[k + 2].text
    second = closing[k + 1] + 1
    at = tokens[k].at
    if order not in ("1", "2") or not begins_with(tokens, second, "["):
        fail(text, at, "a derivative other than by t")
    end = closing[second] + 1
    inner = tokens[second + 1 : end - 1]
    return derivative_by_time(inner, int(order), at), end + 3 if begins_with(
        tokens, end, "[", "t", "]"
    ) else end


def _with_plain_brackets(tokens: list[Token], text: str) -> list[Token]:
    """Write calls with round brackets, and lists with square ones; {t, 2} of a derivative with round ones."""
    result = list(tokens)
    for start, end in _closing_places(tokens, text).items():
        before = tokens[start - 1] if start else sign("", 0)
        is_call = tokens[start].text == "[" and (
            before.kind in ("name", "function") or before.text == "'"
        )
        is_time = begins_with(tokens, start, "{", "t")
        pair = "()" if is_call or is_time or tokens[start].text == "(" else "[]"
        result[start] = sign(pair[0], tokens[start].at)
        result[end] = sign(pair[1], tokens[end].at)
    return result


def from_maxima(tokens: Sequence[Token]) -> list[Token]:
    """Return tokens without Maxima's quotes and percent signs: 'diff(q1, t) and %pi."""
    return [
        token
        for k, token in enumerate(tokens)
        if not (begins_with(tokens, k, "'", "diff") or begins_with(tokens, k, "%", "pi"))
    ]
