r"""What Mathematica, Maple and Maxima print, brought to tokens of plain text.

Mathematica calls by square brackets and lists by braces (``Sin[q1[t]]``, ``{{a, b}, {c, d}}``, ``\[Theta]1'[t]``),
Maple counts indices from 1 (``theta[1](t)``), Maxima quotes what it does not evaluate (``'diff(q1, t)``, ``%pi``).
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from dhkit.expressions.syntax import Token
from dhkit.grading.answers.tokens import fail

MATHEMATICA = re.compile(
    r"\*\^|\b(?:Sin|Cos|Tan|Sec|Csc|Cot|Sqrt|ArcTan|ArcSin|ArcCos|Derivative|Subscript|Abs|Sign|D|Dt)\[|[A-Za-z0-9\]]'*\[t\]"
    r"|\\\[[A-Z][A-Za-z]*\]|^\s*\{[^\\]*\}\s*$",
    re.DOTALL,
)
OPENING, CLOSING = {"(": ")", "[": "]", "{": "}"}, frozenset(")]}")


def is_mathematica(text: str) -> bool:
    r"""Whether a text is Mathematica's: a function with square brackets, a list in braces, \[Theta]."""
    without_names = re.sub(r"\\\[[A-Z][A-Za-z]*\]", "", text)
    return "\\" not in without_names and "_{" not in text and "^{" not in text and bool(MATHEMATICA.search(text))


def from_mathematica(found: Sequence[Token], text: str) -> list[Token]:
    """Return tokens with round brackets for calls and square ones for lists."""
    found = _with_exponents(_with_names(list(found)))
    closes = _closing_places(found, text)
    made: list[Token] = []
    k = 0
    while k < len(found):
        token = found[k]
        calls = token.kind == "name" and k + 1 < len(found) and found[k + 1].text == "["
        if calls and token.text in ("Derivative", "Subscript"):
            read, k = (_derivative if token.text == "Derivative" else _subscript)(found, k, closes, text)
            made += read
        elif calls and token.text in ("D", "Dt"):
            made.append(Token("name", "diff", token.at))
            k += 1
        elif calls and token.text == "ArcTan" and (comma := _comma(found, k + 1, closes[k + 1])):
            # Mathematica's ArcTan[x, y] has the cosine first.
            end = closes[k + 1]
            x, y = found[k + 2 : comma], found[comma + 1 : end]
            inner = [*from_mathematica(y, text), found[comma], *from_mathematica(x, text)]
            made += [Token("name", "atan2", token.at), _sign("(", token), *inner, _sign(")", found[end])]
            k = end + 1
        else:
            made.append(Token("name", "pi", token.at) if token.text == "Pi" else token)
            k += 1
    return _with_brackets(made, text)


def _with_names(found: list[Token]) -> list[Token]:
    r"""Read \[Theta]1 as theta1."""
    made: list[Token] = []
    k = 0
    while k < len(found):
        if [x.text for x in found[k : k + 2]] == ["\\", "["] and k + 3 < len(found) and found[k + 3].text == "]":
            letter = found[k + 2].text.lower()
            following = found[k + 4] if k + 4 < len(found) else None
            k += 4
            if following is not None and following.kind == "number" and following.at == found[k - 1].at + 1:
                letter += following.text
                k += 1
            made.append(Token("name", letter, found[k - 1].at))
            continue
        made.append(found[k])
        k += 1
    return made


def _with_exponents(found: list[Token]) -> list[Token]:
    """Read 5*^-1 as 5e-1."""
    made: list[Token] = []
    k = 0
    while k < len(found):
        texts = [token.text for token in found[k : k + 5]]
        sign = "-" if texts[3:4] == ["-"] else ""
        exponent = found[k + 4] if sign and k + 4 < len(found) else found[k + 3] if k + 3 < len(found) else None
        if (
            found[k].kind == "number"
            and texts[1:3] == ["*", "^"]
            and exponent is not None
            and exponent.text.isdecimal()
        ):
            made.append(Token("number", f"{texts[0]}e{sign}{exponent.text}", found[k].at))
            k += 4 + bool(sign)
            continue
        made.append(found[k])
        k += 1
    return made


def _closing_places(found: Sequence[Token], text: str) -> dict[int, int]:
    """Return where each opening bracket closes."""
    places: dict[int, int] = {}
    opened: list[int] = []
    for k, token in enumerate(found):
        if token.kind != "sign":
            continue
        if token.text in OPENING:
            opened.append(k)
        elif token.text in CLOSING:
            if not opened or OPENING[found[opened[-1]].text] != token.text:
                fail(text, token.at, f"{token.text!r} without its opening bracket")
            places[opened.pop()] = k
    if opened:
        fail(text, found[opened[-1]].at, "a bracket that does not close")
    return places


def _comma(found: Sequence[Token], start: int, end: int) -> int:
    """Return where the one comma of a bracket's own level is; 0 without one."""
    depth, commas = 0, []
    for k in range(start + 1, end):
        depth += (found[k].text in OPENING) - (found[k].text in CLOSING)
        if depth == 0 and found[k].text == ",":
            commas.append(k)
    return commas[0] if len(commas) == 1 else 0


def _derivative(found: Sequence[Token], k: int, closes: dict[int, int], text: str) -> tuple[list[Token], int]:
    """Read Derivative[1][q1][t]."""
    order = found[k + 2].text
    second = closes[k + 1] + 1
    if order not in ("1", "2") or second >= len(found) or found[second].text != "[":
        fail(text, found[k].at, "a derivative other than by t")
    inner = list(found[second + 1 : closes[second]])
    end = closes[second] + 1
    if [x.text for x in found[end : end + 3]] == ["[", "t", "]"]:
        end += 3
    at = found[k].at
    for _ in range(int(order)):
        inner = [Token("function", "ddt", at), _sign("(", found[k]), *inner, _sign(")", found[k])]
    return inner, end


def _subscript(found: Sequence[Token], k: int, closes: dict[int, int], text: str) -> tuple[list[Token], int]:
    """Read Subscript[m, 1] as m1."""
    end = closes[k + 1]
    parts = [token.text for token in found[k + 2 : end] if token.text != ","]
    if not parts or not all(part.isalnum() for part in parts):
        fail(text, found[k].at, "a subscript that is no name")
    return [Token("name", "".join(parts), found[k].at)], end + 1


def _with_brackets(found: list[Token], text: str) -> list[Token]:
    """Write calls with round brackets, and lists with square ones; {t, 2} of a derivative with round ones."""
    closes = _closing_places(found, text)
    made = list(found)
    for start, end in closes.items():
        before = found[start - 1] if start else None
        is_call = (
            found[start].text == "["
            and before is not None
            and (before.kind in ("name", "function") or before.text == "'")
        )
        of_time = found[start].text == "{" and found[start + 1].text == "t"
        if is_call or of_time or found[start].text == "(":
            made[start], made[end] = _sign("(", found[start]), _sign(")", found[end])
        else:
            made[start], made[end] = _sign("[", found[start]), _sign("]", found[end])
    return made


def from_maxima(found: Sequence[Token]) -> list[Token]:
    """Return tokens without Maxima's quotes and percent signs: 'diff(q1, t) and %pi."""
    made: list[Token] = []
    for k, token in enumerate(found):
        following = found[k + 1].text if k + 1 < len(found) else ""
        quotes = token.text == "'" and following == "diff"
        constant = token.text == "%" and following == "pi"
        if not (quotes or constant):
            made.append(token)
    return made


def _sign(text: str, like: Token) -> Token:
    return Token("sign", text, like.at)
