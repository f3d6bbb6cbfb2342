"""Students' notations in one grammar: shorthand, derivatives, products without a sign, functions without brackets."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NoReturn

from dhkit.expressions.syntax import Token
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.indices import without_indices
from dhkit.grading.answers.tokens import (
    begins_with,
    check_depth,
    closing_bracket,
    derivative_by_time,
    fail,
    in_brackets,
    places_outside_brackets,
    replace_runs,
    sign,
    word_set,
)
from dhkit.grading.answers.vocabulary import FUNCTION_NAMES, Vocabulary, plain_name

_TRIGONOMETRIC = ("sin", "cos", "tan")
_SHORTHAND = ("c", "s")
CALLED = frozenset(FUNCTION_NAMES.values())
MODULES = word_set("np numpy math sp sympy sym ca cs casadi cmath mpmath mp cas")
_ATTRIBUTES = frozenset((*FUNCTION_NAMES, "pi"))
DERIVATIVES = frozenset(("diff", "Derivative"))

_ORDERS = {"t": 1, "t,t": 2, "t,2": 2, "(t,2)": 2, "(t,1)": 1, "t,1": 1}
"""Orders of derivatives, by the text after the expression that is differentiated."""

MATLAB = re.compile(r"\.[*/^']")
"""Signs that are MATLAB's alone."""

_BY_TIME = re.compile(r"\w+\s*(?:\(\s*t\s*\)|\[\s*t\s*\])")
_AMBIGUOUS = re.compile(r"(sin|cos|tan|[sScC](?=\d+[A-Za-z]))(\d+)([A-Za-z]\w*)?", re.ASCII)


_SQUARED = (("^", "2"), ("^", "(", "2", ")"))
_OVER_TIME = (("/", "dt"), ("/", "d", "t"), ("/", "(", "dt", ")"))


def to_plain_grammar(tokens: Sequence[Token], vocabulary: Vocabulary, text: str) -> list[Token]:
    """Return tokens of the plain grammar, in the robot's own names.

    Raises
    ------
    AnswerError
        An unknown name, an attribute, or brackets that do not match.
    """
    return _Rewriting(vocabulary, text).to_plain_grammar(tokens)


class _Rewriting:
    """The steps from a student's notation to the plain grammar, each from tokens to tokens."""

    def __init__(self, vocabulary: Vocabulary, text: str) -> None:
        self.vocabulary = vocabulary
        self.text = text

    def to_plain_grammar(self, tokens: Sequence[Token]) -> list[Token]:
        check_depth(tokens, self.text)
        tokens = self._without_modules(_without_methods(tokens))
        tokens = without_indices(self._without_primes(tokens), self.vocabulary, self.text)
        tokens = self._without_time(tokens)
        # Square brackets that are left stand for round ones.
        plain = {"[": "(", "]": ")"}
        tokens = [sign(plain.get(x.text, x.text), x.at) if x.kind == "sign" else x for x in tokens]
        tokens = self._fractions_by_time(self._derivatives(tokens))
        return _with_product_signs(self._functions(self._names(tokens)))

    def _fail(self, token: Token, problem: str) -> NoReturn:
        fail(self.text, token.at, problem)

    def _without_modules(self, tokens: Sequence[Token]) -> list[Token]:
        """Take np. off np.sin; no other attribute is read."""
        plain: list[Token] = []
        for token in tokens:
            if (
                len(plain) > 1
                and plain[-1].text == "."
                and token.kind == "name"
                and token.text in _ATTRIBUTES
            ):
                module = plain[-2]
                if module.kind != "name" or module.text not in MODULES:
                    self._fail(module, f"an attribute of {module.text!r}, which is not read,")
                del plain[-2:]
            plain.append(token)
        for token in plain:
            if token.text == ".":
                self._fail(token, "an attribute, which is not read,")
        return plain

    def _without_primes(self, tokens: Sequence[Token]) -> list[Token]:
        """Read Lagrange's prime after a joint's variable as a rate, and drop MATLAB's transpose.

        A prime after anything but a matrix is refused where nothing else is MATLAB's: it may be a derivative.
        """
        plain: list[Token] = []
        for token in tokens:
            if (
                token.text not in ("'", ".'")
                or not plain
                or (plain[-1].kind == "sign" and plain[-1].text not in ")]")
            ):
                plain.append(token)
                continue
            name = plain[-1].text if plain[-1].kind == "name" else ""
            if token.text == "'" and self.vocabulary.is_position(name):
                plain[-1] = Token("name", f"{name}dot", plain[-1].at)
            elif token.text == "'" and self.vocabulary.is_position(name.removesuffix("dot")):
                plain[-1] = Token("name", f"{name.removesuffix('dot')}ddot", plain[-1].at)
            elif token.text == "'" and plain[-1].text != "]" and not MATLAB.search(self.text):
                self._fail(token, "a prime that belongs to no joint variable,")
        return plain

    def _without_time(self, tokens: Sequence[Token]) -> list[Token]:
        """Read theta1(t), and Mathematica's theta1[t], as theta1; refuse them where the robot has a parameter t."""

        def read_run(k: int) -> tuple[Sequence[Token], int] | None:
            token = tokens[k]
            is_operand = (
                token.kind == "name" and token.text not in FUNCTION_NAMES
            ) or token.text in (")", "}")
            is_of_time = begins_with(tokens, k + 1, "(", "t", ")") or begins_with(
                tokens, k + 1, "[", "t", "]"
            )
            if not is_operand or not is_of_time:
                return None
            if self.vocabulary.is_exactly("t"):
                self._fail(
                    token,
                    f"{token.text}(t) may be a function of time, or a product; t is a parameter",
                )
            return [token], k + 4

        return replace_runs(tokens, read_run)

    # Derivatives

    def _derivatives(self, tokens: Sequence[Token]) -> list[Token]:
        """Read diff(theta1, t) and Derivative(l1*theta1(t), (t, 2)) as time derivatives of their first argument."""

        def read_run(k: int) -> tuple[Sequence[Token], int] | None:
            token = tokens[k]
            if token.text not in DERIVATIVES or not begins_with(tokens, k + 1, "("):
                return None
            end = self._closing(tokens, k + 1)
            inner = tokens[k + 2 : end]
            comma = next(iter(places_outside_brackets(inner, ",")), 0)
            order = _ORDERS.get("".join(x.text for x in inner[comma + 1 :]), 0)
            if not comma or not order:
                self._fail(token, "a derivative other than by t")
            return derivative_by_time(self._derivatives(inner[:comma]), order, token.at), end + 1

        return replace_runs(tokens, read_run)

    def _fractions_by_time(self, tokens: Sequence[Token]) -> list[Token]:
        """Read dtheta1/dt, d(5 theta1)/dt, d/dt(theta1/2) and d^2 theta1/dt^2 as time derivatives."""

        def read_run(k: int) -> tuple[Sequence[Token], int] | None:
            token = tokens[k]
            if token.kind != "name" or token.text[0] != "d":
                return None
            run = self._fraction_by_time(tokens, k) if "d" not in self.vocabulary.own else None
            if run is None and token.text == "dt" and not self.vocabulary.is_own("dt"):
                self._fail(token, "dt that belongs to no derivative")
            return run

        return replace_runs(tokens, read_run)

    def _fraction_by_time(self, tokens: Sequence[Token], k: int) -> tuple[list[Token], int] | None:
        """Return the derivative that begins with the d at k, and where it ends; None where there is none."""
        token = tokens[k]
        order = 1
        at = k + 1
        if token.text == "d":
            square = next(
                (len(square) for square in _SQUARED if begins_with(tokens, at, *square)), 0
            )
            order = 1 + bool(square)
            at = at + square
            if end := _end_of_over_time(tokens, at, order):
                stop = self._operand(tokens, end)
                self._refuse_unclear_end(tokens, k, end, stop)
                return derivative_by_time(tokens[end:stop], order, token.at), stop
            stop = self._operand(tokens, at)
            end = _end_of_over_time(tokens, stop, order) if stop > at else 0
            return (derivative_by_time(tokens[at:stop], order, token.at), end) if end else None
        squared = re.fullmatch(r"d[2d](\w+)", token.text, re.ASCII)
        if (
            squared
            and self.vocabulary.is_position(squared[1])
            and begins_with(tokens, k + 1, "/", "dt2")
        ):
            return derivative_by_time([Token("name", squared[1], token.at)], 2, token.at), k + 3
        name = token.text[1:]
        end = _end_of_over_time(tokens, k + 1, 1)
        if end and self.vocabulary.is_state(name):
            return derivative_by_time([Token("name", name, token.at)], 1, token.at), end
        return None

    def _refuse_unclear_end(self, tokens: Sequence[Token], k: int, start: int, stop: int) -> None:
        """Refuse d/dt at k in front of an operand, from start to stop, that may go on after it."""
        is_enclosed = start < len(tokens) and (
            tokens[start].text == "(" or _BY_TIME.match(self.text, tokens[start].at) is not None
        )
        following = tokens[stop] if stop < len(tokens) else sign("", 0)
        goes_on = following.kind != "sign" or following.text in ("(", "*", "/")
        if stop == start or following.text == "^" or (goes_on and not is_enclosed):
            self._fail(
                tokens[k],
                "a derivative that may reach further than the name after it; put brackets around what",
            )

    # Names

    def _names(self, tokens: Sequence[Token]) -> list[Token]:
        """Put in what names stand for."""
        plain: list[Token] = []
        for k, token in enumerate(tokens):
            if len(plain) > BOUNDS.tokens:
                self._fail(token, f"more than {BOUNDS.tokens} signs, names written out,")
            if token.kind != "name":
                plain.append(token)
                continue
            following = tokens[k + 1].text if k + 1 < len(tokens) else ""
            meaning = self.vocabulary.find(token.text)
            self._refuse_ambiguous(tokens, k)
            self._refuse_shorthand(tokens, k)
            is_known = token.text in self.vocabulary.own or token.text in self.vocabulary.symbols
            is_called = following == "(" or (following == "^" and not is_known)
            is_refused = plain_name(token.text) in self.vocabulary.refused
            if token.text in FUNCTION_NAMES and (meaning is None or is_called) and not is_refused:
                plain.append(Token("function", FUNCTION_NAMES[token.text], token.at))
            elif meaning is not None:
                plain += _written_out(meaning, token.at)
            else:
                plain += self._split(token, following in ("(", "^"))
        return plain

    def _refuse_shorthand(self, tokens: Sequence[Token], k: int) -> None:
        """Refuse c (...) where c is a parameter or the cosine, c W where W is not an angle, and q1(0)."""
        name = tokens[k].text
        vocabulary = self.vocabulary
        following = [token.text for token in tokens[k + 1 : k + 4]]
        is_exact = vocabulary.is_exactly(name)
        if name in FUNCTION_NAMES and is_exact and following[:1] == ["("]:
            problem = f"{name} (...) may be the parameter {name} times the brackets, or a function; write {name}*(...)"
            self._fail(tokens[k], problem)
        is_shorthand = (
            name in _SHORTHAND
            and not is_exact
            and k + 1 < len(tokens)
            and tokens[k + 1].kind == "name"
        )
        if (
            is_shorthand
            and not vocabulary.is_position(following[0])
            and vocabulary.is_exactly(following[0])
        ):
            self._fail(tokens[k], f"{name} before {following[0][:40]}, which is not an angle,")
        is_number_in_brackets = (
            len(following) == 3
            and following[0] == "("
            and following[2] == ")"
            and following[1].isdecimal()
        )
        if vocabulary.is_state(name) and is_number_in_brackets:
            self._fail(
                tokens[k],
                f"{name}({following[1][:20]}) may be a value at a time, or a product; write which",
            )

    def _refuse_ambiguous(self, tokens: Sequence[Token], k: int) -> None:
        """Refuse sin2q1, s2q1 and sin2(q1): the sine of q2 times q1, the sine of 2 q1, or a square."""
        match = _AMBIGUOUS.fullmatch(tokens[k].text)
        if match is None or tokens[k].text in self.vocabulary.own:
            return
        function, number, rest = match.groups()
        following = tokens[k + 1] if k + 1 < len(tokens) else sign("", 0)
        if rest is None and following.text == "(":
            problem = f"{function}{number}(...) may be {function}(...)^{number} or {function} of {number}(...)"
            self._fail(tokens[k], problem)
        if rest is None and following.kind == "name":
            rest = following.text
        if rest is not None and self.vocabulary.is_position(rest):
            both = f"{function}({number}*{rest}) or {function}(q{number})*{rest}"
            self._fail(tokens[k], f"{tokens[k].text} may be {both}; put brackets")

    def _split(self, token: Token, is_called: bool) -> list[Token]:
        """Read names that are run together: m2l1, sintheta1, and in front of a bracket l2cos."""
        vocabulary = self.vocabulary
        at = token.at
        name = plain_name(token.text)
        for function in _TRIGONOMETRIC:
            if is_called and name.endswith(function):
                before = name.removesuffix(function)
                factors = (
                    [*self._split(Token("name", before, at), False), sign("*", at)]
                    if before
                    else []
                )
                return [*factors, Token("function", function, at)]
            if name.startswith(function) and vocabulary.is_position(name.removeprefix(function)):
                angle = vocabulary.find(name.removeprefix(function)) or ()
                return [Token("function", function, at), *_written_out(angle, at)]
        if meaning := vocabulary.find(token.text):
            return _written_out(meaning, at)
        pieces = vocabulary.split(name)
        if pieces is None:
            nearest = vocabulary.nearest(token.text[:60])
            return fail(self.text, at, f"unknown name {token.text[:60]!r} ({nearest})")
        vocabulary.taken_for[token.text] = " ".join(pieces)
        words: list[str] = []
        for piece in pieces:
            words += ["*", *(vocabulary.find(piece) or ())]
        return _written_out(words[1:], at)

    # Functions

    def _functions(self, tokens: Sequence[Token]) -> list[Token]:
        """Give functions their brackets, sin q1 and sin 2 q1, and put powers of functions after them, sin^2(q1)."""
        return replace_runs(
            tokens, lambda k: self._function(tokens, k) if tokens[k].kind == "function" else None
        )

    def _function(self, tokens: Sequence[Token], k: int) -> tuple[list[Token], int]:
        """Return the call of the function at k, and where it ends."""
        token = tokens[k]
        name = tokens[k].text
        start = k + 1
        power: list[Token] = []
        if begins_with(tokens, start, "^"):
            end = self._operand(tokens, start + 1)
            power = list(tokens[start:end])
            start = end
            if "".join(x.text for x in power).strip("^()") == "-1":
                if name in ("sec", "csc", "cot"):
                    self._fail(token, f"{name}^-1 may be the inverse function or 1/{name}")
                if name in _TRIGONOMETRIC:
                    # cos^-1 is the arc cosine
                    name = f"a{name}"
                    power = []
        end = self._operand(tokens, start, is_product=True)
        if name == "sqrt" and end - start > 1 and tokens[start].kind == "number":
            both = " ".join(x.text for x in tokens[start:end])
            problem = f"sqrt {both} may be sqrt({both}) or sqrt({tokens[start].text}) times the rest; put brackets"
            self._fail(token, problem)
        argument = self._functions(tokens[start:end])
        if not argument:
            self._fail(token, f"{name} without an argument")
        following = tokens[end] if end < len(tokens) else sign("", token.at)
        goes_on = following.kind in ("name", "function") or (
            argument[-1].text != ")" and following.text == "/"
        )
        if (
            name in _TRIGONOMETRIC
            and goes_on
            and all(x.kind in ("number", "sign") for x in argument)
        ):
            self._fail(token, f"{name} of a number, or of more; put its argument in brackets")
        if argument[0].text != "(" or self._closing(argument, 0) != len(argument) - 1:
            argument = in_brackets(argument, token.at)
        return [Token("call", name, token.at), *argument, *power], end

    def _operand(self, tokens: Sequence[Token], k: int, is_product: bool = False) -> int:
        """Return where the operand ends that begins at k.

        An operand is what stands in brackets, or a name or a number after signs; in a product, numbers may stand
        in front of the brackets or the name.
        """
        if begins_with(tokens, k, "("):
            return self._closing(tokens, k) + 1
        while k < len(tokens) and (
            tokens[k].kind == "number" if is_product else tokens[k].text in "+-"
        ):
            k += 1
        if is_product and begins_with(tokens, k, "("):
            return self._closing(tokens, k) + 1
        return k + 1 if k < len(tokens) and tokens[k].kind in ("name", "number") else k

    def _closing(self, tokens: Sequence[Token], k: int) -> int:
        """Return where the bracket at k closes."""
        end = closing_bracket(tokens, k)
        return (
            end
            if end < len(tokens)
            else fail(self.text, tokens[k].at, "a bracket that does not close")
        )


def _without_methods(tokens: Sequence[Token]) -> list[Token]:
    """Read q1.diff(t) as diff(q1, t)."""

    def read_run(k: int) -> tuple[Sequence[Token], int] | None:
        if tokens[k].kind != "name" or not begins_with(tokens, k + 1, ".", "diff", "("):
            return None
        name, dot, method, bracket = tokens[k : k + 4]
        return [method, bracket, name, sign(",", dot.at)], k + 4

    return replace_runs(tokens, read_run)


def _end_of_over_time(tokens: Sequence[Token], k: int, order: int) -> int:
    """Return where / dt, or / dt^2 for order 2, ends that begins at k; 0 where something else stands there."""
    over = next((len(over) for over in _OVER_TIME if begins_with(tokens, k, *over)), 0)
    if not over or order == 1:
        return k + over if over else 0
    square = next((len(square) for square in _SQUARED if begins_with(tokens, k + over, *square)), 0)
    return k + over + square if square else 0


def _written_out(words: Sequence[str], at: int) -> list[Token]:
    """Return the tokens of the meaning of a name."""
    return [Token(_kind(word), word, at) for word in words]


def _kind(word: str) -> str:
    if word[0] in "0123456789.":
        return "number"
    if word in CALLED:
        return "function"
    return "name" if word[0].isalpha() else "sign"


def _with_product_signs(tokens: Sequence[Token]) -> list[Token]:
    """Put in the signs of products that stand without one."""
    result: list[Token] = []
    for token in tokens:
        if result:
            before = result[-1]
            ends = before.kind in ("name", "number") or before.text == ")"
            begins = token.kind in ("name", "number", "call") or token.text == "("
            if ends and begins and not (before.kind == "number" == token.kind):
                result.append(sign("*", token.at))
        result.append(token)
    return [
        Token("name", token.text, token.at) if token.kind == "call" else token for token in result
    ]
