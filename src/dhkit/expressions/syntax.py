"""Syntax tree of a text: a recursive-descent parser with a whitelist, bounded in length, depth and numbers.

The grammar is that of school algebra, with ``^`` and ``**`` for powers (right-associative, binding tighter than a
sign on their left: ``-2^2`` is -4)::

    sum     = product (("+" | "-") product)*
    product = signed (("*" | "/") signed)*
    signed  = ("+" | "-")* power
    power   = atom (("^" | "**") signed)?
    atom    = number | name | name "(" sum ("," sum)* ")" | "(" sum ")"

Sums and products are kept flat, so that a tree is no deeper than the brackets of its text.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction
from typing import NamedTuple, NoReturn, TypeAlias

from dhkit.errors import ExpressionError
from dhkit.expressions.bounds import BOUNDS

_TOKEN = re.compile(
    r"\s*(?:((?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|([A-Za-z_]\w*)|(\*\*|[-+*/^(),]))", re.ASCII
)


_DECIMAL_DIGITS = 4_096
"""Precision of printed decimals: more than any coefficient of an exact expression needs."""


class Token(NamedTuple):
    """A number, a name or a sign, with its position in the text, from 0."""

    kind: str
    text: str
    at: int


@dataclass(frozen=True)
class Number:
    """A decimal as a rational, and as it was written."""

    value: Fraction
    text: str
    at: int


@dataclass(frozen=True)
class Name:
    """A constant, parameter or variable."""

    text: str
    at: int


@dataclass(frozen=True)
class Call:
    """A function call; the grammar accepts any name."""

    function: str
    arguments: tuple[Tree, ...]
    at: int


@dataclass(frozen=True)
class Power:
    """``base ^ exponent``."""

    base: Tree
    exponent: Tree
    at: int


@dataclass(frozen=True)
class Product:
    """Factors, each multiplied (True) or divided by (False)."""

    factors: tuple[tuple[bool, Tree], ...]


@dataclass(frozen=True)
class Sum:
    """Terms, each added (True) or subtracted (False)."""

    terms: tuple[tuple[bool, Tree], ...]


Tree: TypeAlias = Number | Name | Call | Power | Product | Sum


def read(text: str) -> Tree:
    """Read an expression's syntax tree.

    Parameters
    ----------
    text
        Formula, such as ``"l1 + 3*mm"``.

    Returns
    -------
    Tree
        The tree; nothing is evaluated.

    Raises
    ------
    ExpressionError
        The text is not an expression, or is longer or deeper than the limits of this module.

    Examples
    --------
    >>> type(read("l1 + 3*mm")).__name__
    'Sum'
    """
    if len(text) > BOUNDS.characters:
        raise ExpressionError(
            f"an expression of {len(text)} characters; expected at most {BOUNDS.characters}"
        )
    return read_tokens(_tokens(text), text)


def read_tokens(tokens: Sequence[Token], text: str) -> Tree:
    """Read a syntax tree from tokens.

    Parameters
    ----------
    tokens
        Tokens of kind ``number``, ``name`` or ``sign``.
    text
        The text for messages; positions count from its beginning.

    Raises
    ------
    ExpressionError
        The tokens are not an expression, or nested deeper than ``BOUNDS.nesting``.
    """
    return _Parser(tokens, text).whole()


def decimal_fraction(text: str) -> Fraction:
    """Return the rational that a decimal number's text stands for.

    Parameters
    ----------
    text
        Decimal number, such as ``"0.1"`` or ``"2e-4"``.

    Returns
    -------
    Fraction
        Its value.

    Raises
    ------
    ExpressionError
        It has more digits, or a larger exponent, than any finite double.

    Examples
    --------
    >>> decimal_fraction("2.5e-2")
    Fraction(1, 40)
    """
    mantissa, _, exponent = text.lower().partition("e")
    shown = text if len(text) <= 20 else f"{text[:17]}..."
    if (
        len(mantissa) > BOUNDS.digits
        or len(exponent) > 6
        or abs(int(exponent or 0)) > BOUNDS.digits
    ):
        raise ExpressionError(f"{shown} is beyond the range of a double")
    value = Fraction(text)
    try:
        float(value)
    except OverflowError:
        raise ExpressionError(f"{shown} is beyond the range of a double") from None
    return value


def decimal_text(value: Fraction) -> str | None:
    """Return a rational as an exact decimal; None if its decimal does not end."""
    denominator = value.denominator
    for prime in (2, 5):
        while denominator % prime == 0:
            denominator //= prime
    if denominator != 1:
        return None
    digits = Context(prec=_DECIMAL_DIGITS)
    return str(digits.divide(Decimal(value.numerator), Decimal(value.denominator))).lower()


def _tokens(text: str) -> list[Token]:
    tokens = []
    at = 0
    end = len(text.rstrip())
    while at < end:
        match = _TOKEN.match(text, at)
        if match is None:
            at += len(text[at:]) - len(text[at:].lstrip())
            raise ExpressionError(
                f"{_shown(text)}: unexpected character {text[at]!r} at position {at + 1}"
            )
        kind = ("number", "name", "sign")[(match.lastindex or 1) - 1]
        tokens.append(
            Token(kind, match.group(match.lastindex or 1), match.start(match.lastindex or 1))
        )
        at = match.end()
    return tokens


def _shown(text: str) -> str:
    return repr(text if len(text) <= 60 else text[:57] + "...")


class _Parser:
    """One pass over the tokens of a text."""

    def __init__(self, tokens: Sequence[Token], text: str) -> None:
        self.tokens = tokens
        self.shown = _shown(text)
        self.depth = 0
        self.index = 0

    def _fail(self, expected: str) -> NoReturn:
        if self.index < len(self.tokens):
            kind, found, at = self.tokens[self.index]
            before = self.tokens[self.index - 1] if self.index else None
            # For "90 deg" the message asks for a sign between number and name.
            product = before is not None and before.kind == "number" and kind == "name"
            hint = f"; write {before.text}*{found}" if product and before is not None else ""
            raise ExpressionError(
                f"{self.shown}: found {found!r} at position {at + 1}, expected {expected}{hint}"
            )
        raise ExpressionError(f"{self.shown}: ends where {expected} was expected")

    def _peek(self) -> str:
        return self.tokens[self.index][1] if self.index < len(self.tokens) else ""

    def _take(self, *signs: str) -> str:
        """Consume the next token if it is one of these; '' otherwise."""
        found = self._peek()
        if found not in signs:
            return ""
        self.index += 1
        return found

    def _deeper(self) -> None:
        self.depth += 1
        if self.depth > BOUNDS.nesting:
            raise ExpressionError(f"{self.shown}: nested more than {BOUNDS.nesting} deep")

    def whole(self) -> Tree:
        tree = self.sum()
        if self.index < len(self.tokens):
            self._fail("an operator or the end")
        return tree

    def sum(self) -> Tree:
        terms = [(True, self.product())]
        while sign := self._take("+", "-"):
            terms.append((sign == "+", self.product()))
        return terms[0][1] if len(terms) == 1 else Sum(tuple(terms))

    def product(self) -> Tree:
        factors = [(True, self.signed())]
        while sign := self._take("*", "/"):
            factors.append((sign == "*", self.signed()))
        return factors[0][1] if len(factors) == 1 else Product(tuple(factors))

    def signed(self) -> Tree:
        positive = True
        while sign := self._take("+", "-"):
            positive ^= sign == "-"
        power = self.power()
        return power if positive else Sum(((False, power),))

    def power(self) -> Tree:
        base = self.atom()
        at = self.tokens[self.index][2] if self.index < len(self.tokens) else 0
        if not self._take("^", "**"):
            return base
        self._deeper()
        exponent = self.signed()
        self.depth -= 1
        return Power(base, exponent, at)

    def atom(self) -> Tree:
        if self.index == len(self.tokens):
            self._fail("a number, a name or a bracket")
        kind, text, at = self.tokens[self.index]
        if kind == "number":
            self.index += 1
            return Number(decimal_fraction(text), text, at)
        if kind == "name":
            self.index += 1
            return Call(text, self._arguments(), at) if self._peek() == "(" else Name(text, at)
        if text != "(":
            self._fail("a number, a name or a bracket")
        return self._arguments(most=1)[0]

    def _arguments(self, most: int = 2) -> tuple[Tree, ...]:
        """Read ``( sum, ... )``."""
        self.index += 1
        self._deeper()
        arguments = [self.sum()]
        while len(arguments) < most and self._take(","):
            arguments.append(self.sum())
        if not self._take(")"):
            self._fail("')'")
        self.depth -= 1
        return tuple(arguments)
