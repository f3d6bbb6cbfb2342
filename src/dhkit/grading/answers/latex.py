r"""LaTeX read as tokens of plain text: \frac{1}{2} m_1 \dot\theta_1^2, c_{12}, matrices between & and \\."""

from __future__ import annotations

import re
from collections.abc import Callable

from dhkit.expressions.syntax import Token
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.tokens import (
    closing_bracket,
    derivative_by_time,
    fail,
    in_brackets,
    rate_name,
    sign,
    word_set,
)
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES
from dhkit.symbolic.equations.latex_names import GREEK as LETTERS

_PIECE = re.compile(
    r"\s*(?:\\(?P<macro>[A-Za-z]+|.)|(?P<number>\d+\.?\d*|\.\d+)|(?P<letters>[A-Za-z]+)|(?P<sign>\S))",
    re.ASCII | re.DOTALL,
)
r"""One piece of a formula: a macro such as \theta or \, (without the backslash), a number, letters or a sign."""

_MIXED = re.compile(r"(?<![\w.{^])(\d+)\s*$", re.ASCII)
"""A number in front of a fraction, which is not a subscript or exponent."""
SPACE_NAMES = word_set(
    "quad qquad displaystyle textstyle limits nolimits nonumber notag thinspace enspace space middle it rm bf sf"
)
_SPACES = SPACE_NAMES | frozenset(",;:!> \n")
"""Macros for spacing and fonts, which are ignored."""
SIZES = word_set("left right big Big bigg Bigg bigl bigr Bigl Bigr biggl biggr Biggl Biggr")
FRACTIONS = frozenset(("frac", "tfrac", "dfrac", "cfrac"))
STYLE_MACROS = word_set(
    "mathrm mathit mathbf mathsf mathcal text textrm operatorname boldsymbol bm vec hat bar mathnormal"
)
SYMBOL_MACROS = {"cdot": "*", "times": "*", "ast": "*", "div": "/", "pi": "pi", "ell": "l"}
DOT_MACROS = ("dot", "ddot")
GREEK = LETTERS - {"pi", "Pi"} | {"varepsilon", "vartheta", "varrho", "varphi"}
_OVER = "\\over"
_MATRICES = frozenset(["matrix", "bmatrix", "pmatrix", "Bmatrix", "smallmatrix", "array"])


_WORD = re.compile(r"[A-Za-z][A-Za-z0-9]*", re.ASCII)

_OPERAND_ENDS = re.compile(
    r"(?:\s|~|\$|\\[,;:! ]|\\q?quad\b)*(?:$|[-+)\]},;&=.|]|\\\\|\\(?:right|cr|end)\b|\\[bB]igg?r?\s*[)\]]"
    r"|\{?\s*(?:\\left)?\s*\(\s*t\s*(?:\\right)?\s*\))"
)
r"""End of the operand of \frac{d}{dt}: a sign of a sum, the end, or (t)."""


def is_latex(text: str) -> bool:
    """Whether a text is LaTeX rather than what programs read."""
    return "\\" in text or "{" in text or "_{" in text or "^{" in text


def latex_tokens(text: str, knows: Callable[[str], bool]) -> list[Token]:
    """Return tokens of plain text: names without underscores, brackets for groups, no macros.

    Parameters
    ----------
    text
        LaTeX without a preamble; dollars around it are ignored.
    knows
        Whether several letters are one name.

    Raises
    ------
    AnswerError
        A macro that is not mathematics, or brackets that do not match.
    """
    return _LatexReader(text, knows).tokens()


class _LatexReader:
    """One pass over a LaTeX formula; ``at`` is where it stands in the text, and ``depth`` counts nested arguments."""

    def __init__(self, text: str, knows: Callable[[str], bool]) -> None:
        self.text = text
        self.knows = knows
        self.at = 0
        self.depth = 0

    def tokens(self) -> list[Token]:
        tokens = self._until("")
        if self.at < len(self.text.rstrip()):
            fail(self.text, self.at, "a closing brace without an opening one")
        return tokens

    # Pieces of the text

    def _peek(self) -> re.Match[str] | None:
        return _PIECE.match(self.text, self.at)

    def _next_is(self, sign: str) -> bool:
        """Whether the next piece is this sign."""
        piece = self._peek()
        return piece is not None and piece["sign"] == sign

    def _until(self, closing: str) -> list[Token]:
        """Read up to a closing brace, or to the end."""
        tokens: list[Token] = []
        while (piece := self._peek()) is not None and piece["sign"] != "}":
            continues_sum = self._continues_sum(piece, tokens)
            item = self._item(piece)
            tokens += item[1:-1] if continues_sum else item
        if closing:
            if not self._next_is(closing):
                fail(self.text, min(self.at, len(self.text) - 1), f"expected {closing!r}")
            self.at = self.text.index(closing, self.at) + 1
        return self._over(tokens)

    def _continues_sum(self, piece: re.Match[str], before: list[Token]) -> bool:
        """Whether a group in braces begins with a sign after an operand: a {+ b} is set as a + b, not as a product."""
        if piece["sign"] != "{" or not before or before[-1].text in FUNCTION_NAMES:
            return False
        is_after_operand = before[-1].kind in ("name", "number") or before[-1].text in (")", "]")
        return is_after_operand and self.text[piece.end() :].lstrip()[:1] in ("+", "-")

    def _over(self, tokens: list[Token]) -> list[Token]:
        r"""Read {a \over b} as \frac{a}{b}."""
        places = [k for k, token in enumerate(tokens) if token.text == _OVER]
        if not places:
            return tokens
        if len(places) > 1:
            fail(self.text, tokens[places[1]].at, "two \\over in one group")
        at = tokens[places[0]].at
        above = tokens[: places[0]]
        below = tokens[places[0] + 1 :]
        return self._fraction(in_brackets(above, at), in_brackets(below, at), at)

    def _item(self, piece: re.Match[str]) -> list[Token]:
        """Read one item with its subscript."""
        at = piece.start(piece.lastgroup or 0)
        self.at = piece.end()
        if piece["macro"] is not None:
            return self._command(piece["macro"], at - 1)
        if piece["number"] is not None:
            return [Token("number", piece["number"], at)]
        if piece["letters"] is not None:
            return self._letters(piece["letters"], at)
        character = piece["sign"]
        if character == "{":
            self.at = at
            return self._grouped(at)
        if character == "^":
            return [sign("^", at), *self._bracketed(at)]
        if character in "$~":
            return []
        if character in "+-*/(),;[]&<>='.|":
            return [sign(character, at)]
        return fail(self.text, at, f"unexpected {character!r}")

    def _grouped(self, at: int) -> list[Token]:
        r"""Read a group: {l_1}, or {\dot\theta}_1, whose subscript belongs to the name inside."""
        inner = self._argument(at)
        if len(inner) == 1 and inner[0].kind == "name":
            return self._name(inner[0].text, at)
        if inner and inner[0].text == "(" and closing_bracket(inner, 0) == len(inner) - 1:
            return inner
        return in_brackets(inner, at) if inner else []

    def _argument(self, at: int) -> list[Token]:
        """Read the argument of a macro: a group in braces, or one symbol."""
        self.depth += 1
        if self.depth > BOUNDS.nesting:
            fail(self.text, at, f"nested more than {BOUNDS.nesting} deep")
        piece = self._peek()
        if piece is None:
            fail(self.text, at, "ends where an argument was expected")
        if piece["sign"] == "{":
            self.at = piece.end()
            inner = self._until("}")
        elif piece["number"] is not None:
            # \frac12 is 1/2: one digit each.
            self.at = piece.start("number") + 1
            inner = [Token("number", piece["number"][0], piece.start("number"))]
        elif piece["letters"] is not None:
            self.at = piece.start("letters") + 1
            inner = [Token("name", piece["letters"][0], piece.start("letters"))]
        elif piece["macro"] is not None:
            self.at = piece.end()
            inner = self._command(piece["macro"], piece.start("macro") - 1, takes_subscript=False)
        else:
            fail(self.text, piece.start(), "expected an argument")
        self.depth -= 1
        return inner

    def _bracketed(self, at: int) -> list[Token]:
        return in_brackets(self._argument(at), at)

    # Names

    def _name(self, name: str, at: int, takes_subscript: bool = True) -> list[Token]:
        r"""Return a name, with the subscript after it unless that belongs to something that encloses the name.

        In ``\dot\theta_1`` the subscript belongs to the dotted name: it is read after the dots.
        """
        return [Token("name", name + self._subscript() if takes_subscript else name, at)]

    def _letters(self, letters: str, at: int) -> list[Token]:
        """Read letters: a known name, a function's, or one name each, the last with its subscript."""
        if len(letters) > BOUNDS.letters:
            fail(self.text, at, f"{len(letters)} letters in a row")
        digits = re.compile(r"\d+", re.ASCII).match(self.text, self.at)
        run = _WORD.match(self.text, at)
        if digits and run and run.end() > digits.end() and self.knows(run[0]):
            self.at = run.end()  # I2x
            return [Token("name", run[0], at)]
        if digits and self.knows(letters + digits[0]):
            self.at = digits.end()  # m1 as programs write it
            return [Token("name", letters + digits[0], at)]
        below = self._subscript()
        if letters in FUNCTION_NAMES and not below:
            return [Token("name", letters, at)]
        return [Token("name", name, at) for name in self._names(letters, below)]

    def _names(self, letters: str, below: str) -> list[str]:
        """Split letters in a row into names; the subscript ``below`` belongs to the last one.

        A known name at the end is preferred: ``mlc1`` with a known ``lc1`` is m times lc1. Otherwise every letter is a
        name, as LaTeX sets it.
        """
        if len(letters) == 1 or self.knows(letters + below) or (letters == "dt" and not below):
            return [letters + below]
        for k in range(1, len(letters)):
            if self.knows(letters[k:] + below) and (k == 1 or self.knows(letters[:k])):
                return [*self._names(letters[:k], ""), letters[k:] + below]
        return [*self._names(letters[:-1], ""), letters[-1] + below]

    def _subscript(self) -> str:
        """Read _{12}, _1 or _{c1}: the characters that belong to the name."""
        if not self._next_is("_"):
            return ""
        at = self.at
        if careless := re.compile(r"_(\d)(\d+)", re.ASCII).match(self.text, at):
            first, rest = careless.groups()
            fail(
                self.text,
                at,
                f"{careless[0]} is _{first} followed by {rest} in LaTeX; write _{{{first}{rest}}}",
            )
        self.at = self.text.index("_", at) + 1
        inner = self._argument(at)
        word = "".join({"+": "p", "-": "m", ",": ""}.get(token.text, token.text) for token in inner)
        if not re.fullmatch(r"\w*", word, re.ASCII):
            fail(self.text, at, "a subscript that is not a name")
        return word

    # Macros

    def _command(self, name: str, at: int, takes_subscript: bool = True) -> list[Token]:
        if name in _SPACES:
            return []
        if name in ("\\", "cr"):
            spacing = re.compile(r"\s*\[-?\d*\.?\d+(?:pt|em|ex|mm|cm)\]", re.ASCII).match(
                self.text, self.at
            )
            self.at = spacing.end() if spacing else self.at
            return [sign("\\\\", at)]
        if name == "partial":
            return [Token("name", "d", at)]
        if name in SIZES:
            return self._delimiter(at)
        if name in FRACTIONS:
            return self._fraction(self._bracketed(at), self._bracketed(at), at)
        if name == "over":
            return [sign(_OVER, at)]
        if name == "sqrt":
            if self._next_is("["):
                fail(self.text, at, "a root other than the square root")
            return [Token("name", "sqrt", at), *self._bracketed(at)]
        if name in DOT_MACROS:
            return self._dotted(name, at, takes_subscript)
        if name in STYLE_MACROS:
            return self._upright(at, takes_subscript)
        if name in ("begin", "end"):
            return self._environment(name, at)
        if name in FUNCTION_NAMES or name == "top":
            return [Token("name", name, at)]
        if name in ("pi", "ell") or name in GREEK:
            return self._name(SYMBOL_MACROS.get(name, name), at, takes_subscript)
        if name in SYMBOL_MACROS:
            return [sign(SYMBOL_MACROS[name], at)]
        if name in "{}":
            return [sign("(" if name == "{" else ")", at)]
        return fail(self.text, at, f"the macro \\{name}, which is not read,")

    def _fraction(self, above: list[Token], below: list[Token], at: int) -> list[Token]:
        """Return a fraction of two bracketed parts, or the time derivative that it is.

        Two numbers directly after a number are refused: they may be a mixed number.
        """
        bottom = "".join(token.text for token in below[1:-1] if token.text not in "()")
        if order := {"dt": 1, "dt^2": 2}.get(bottom, 0):
            while above and above[0].text == "(" and closing_bracket(above, 0) == len(above) - 1:
                above = above[1:-1]
            return self._derivative(above, order, at)
        number = _MIXED.search(self.text[:at])
        if number and [token.kind for token in above[1:-1]] == ["number"] == [
            token.kind for token in below[1:-1]
        ]:
            part = f"{above[1].text}/{below[1].text}"
            both = f"{number[1]} + {part} or {number[1]}*{part}"
            fail(self.text, at, f"{number[1]} {part} may be {both}; write one of them")
        return in_brackets([*above, sign("/", at), *below], at)

    def _derivative(self, above: list[Token], order: int, at: int) -> list[Token]:
        r"""Read \frac{d}{d t} \theta_{1}{\left(t \right)}, as sympy prints it, and \frac{d (5 \theta_1)}{dt}."""
        inner = _without_d(above, order)
        if inner is None:
            fail(self.text, at, "a fraction over dt that is not a derivative by t")
        return derivative_by_time(inner or self._operand_of_derivative(at), order, at)

    def _operand_of_derivative(self, at: int) -> list[Token]:
        r"""Read what \frac{d}{dt} stands in front of: brackets, a function of something, or a name without a power."""
        tokens = self._one_item()
        if tokens and tokens[0].text == "(":
            while closing_bracket(tokens, 0) != len(tokens) - 1:
                tokens += self._one_item() or fail(self.text, at, "a bracket that does not close")
            return tokens
        if tokens and tokens[0].kind == "name" and tokens[0].text in FUNCTION_NAMES:
            tokens += self._function_argument()
        elif len(tokens) != 1 or tokens[0].kind != "name":
            tokens = []
        if not tokens or not _OPERAND_ENDS.match(self.text, self.at):
            fail(
                self.text,
                at,
                "a derivative that may reach further than the name after it; put brackets around what",
            )
        return tokens

    def _one_item(self) -> list[Token]:
        """Read one thing that is not a space; nothing at the end of a group."""
        while (piece := self._peek()) is not None and piece["sign"] != "}":
            if item := self._item(piece):
                return item
        return []

    def _function_argument(self) -> list[Token]:
        """Read the argument of a function, with a power in front of it: up to a name, or a closing bracket."""
        tokens: list[Token] = []
        while item := self._one_item():
            tokens += item
            # The bracket of an exponent, as in sin^(2)(x), does not enclose the argument.
            brackets = [
                k
                for k, token in enumerate(tokens)
                if token.text == "(" and tokens[max(k - 1, 0)].text != "^"
            ]
            if brackets:
                is_complete = closing_bracket(tokens, brackets[0]) == len(tokens) - 1
            else:
                is_complete = tokens[-1].kind == "name"
            if is_complete:
                break
        return tokens

    def _delimiter(self, at: int) -> list[Token]:
        piece = self._peek()
        if piece is None:
            fail(self.text, at, "ends where a bracket was expected")
        self.at = piece.end()
        bracket = piece["macro"] or piece["sign"]
        if bracket == ".":
            return []
        if bracket in ("(", ")", "[", "]", "{", "}"):
            return [sign("(" if bracket in "([{" else ")", at)]
        return fail(self.text, at, "expected a bracket")

    def _dotted(self, dots: str, at: int, takes_subscript: bool) -> list[Token]:
        r"""Read \dot\theta_1, \dot{\theta}_1 and \dot{\theta_1}."""
        inner = self._argument(at)
        if len(inner) != 1 or inner[0].kind != "name":
            fail(self.text, at, "dots on something that is not a name")
        return self._name(rate_name(inner[0].text, dots), at, takes_subscript)

    def _upright(self, at: int, takes_subscript: bool) -> list[Token]:
        inner = self._argument(at)
        if not all(token.kind in ("name", "number") for token in inner):
            if any(token.text in ("+", "-", "=", "<", ">", ",") for token in inner):
                fail(self.text, at, "a sign inside text,")
            return in_brackets(inner, at)
        name = "".join(token.text for token in inner)
        if not name:
            return []
        is_function = name in FUNCTION_NAMES and not self._next_is("_")
        return self._name(name, at, takes_subscript and not is_function)

    def _environment(self, name: str, at: int) -> list[Token]:
        match = re.compile(r"\s*\{(\w+)\*?\}(?:\{[clr|]*\})?", re.ASCII).match(self.text, self.at)
        if match is None or match[1] not in _MATRICES:
            fail(self.text, at, "an environment that is not a matrix")
        self.at = match.end()
        return [sign("[" if name == "begin" else "]", at)]


def _without_d(above: list[Token], order: int) -> list[Token] | None:
    """Return the expression that a derivative's numerator differentiates: empty for d alone, None where it has no d."""
    texts = [token.text for token in above]
    power = [] if order == 1 else ["^", "(", "2", ")"]
    if texts[: 1 + len(power)] == ["d", *power]:
        return above[1 + len(power) :]
    first = above[0] if above else None
    if (
        first is not None
        and order == 1
        and first.kind == "name"
        and len(first.text) > 1
        and first.text[0] == "d"
    ):
        return [Token("name", first.text[1:], first.at), *above[1:]]
    return None
