"""Exact value of a text: the syntax tree evaluated with the names that the caller allows."""

from __future__ import annotations

import difflib
from collections.abc import Collection
from fractions import Fraction

from dhkit.errors import ExpressionError
from dhkit.expressions.budget import budgeted
from dhkit.expressions.exact import PI, Expression
from dhkit.expressions.functions import call, sqrt
from dhkit.expressions.syntax import Call, Name, Number, Power, Product, Sum, Tree, read

CONSTANTS = {
    "pi": PI,
    "deg": PI / 180,
    "mm": Expression.number(Fraction(1, 1000)),
    "cm": Expression.number(Fraction(1, 100)),
    "inch": Expression.number(Fraction(254, 10_000)),
}
"""Names with a fixed value, in metres and radians."""


def parse(text: str, names: Collection[str] = ()) -> Expression:
    """Read an expression: decimals, the given names, :data:`CONSTANTS`, the known functions and ``+ - * / ** ^``.

    Nothing is evaluated as code. Decimals are rationals, so that ``0.1 + 0.2`` is 0.3. The work is bounded by the
    :class:`Budget` in force, or a fresh one.

    Parameters
    ----------
    text
        The text of the expression.
    names
        The parameters or variables that may occur.

    Returns
    -------
    Expression
        The value; parameters stay symbols.

    Raises
    ------
    ExpressionError
        Not an expression, an unknown name or function, no finite value, or more than the limits allow.

    Examples
    --------
    >>> float(parse("2*(17 + 3/10)*inch"))
    0.87884
    >>> parse("l1 + 3*mm", names=["l1"]).symbols
    frozenset({'l1'})
    """
    with budgeted():
        return value_of(read(text), names).as_written(text.strip())


def value_of(tree: Tree, names: Collection[str]) -> Expression:
    """Return the value of a syntax tree."""
    match tree:
        case Number(value=decimal):
            return Expression.number(decimal)
        case Name(text):
            return _named(text, names)
        case Call(function, arguments):
            return call(function, *(value_of(argument, names) for argument in arguments))
        case Power(base, exponent):
            return _power(value_of(base, names), value_of(exponent, names))
        case Sum(terms):
            values = ((added, value_of(term, names)) for added, term in terms)
            return Expression.sum(value if added else -value for added, value in values)
        case Product(factors):
            product = Expression.number(1)
            for multiplied, factor in factors:
                if not multiplied and isinstance(factor, Power):
                    # 1/(a + b)^2 is (1/(a + b))^2: a sum in a denominator is not multiplied out.
                    product = product * _power(
                        value_of(factor.base, names), -value_of(factor.exponent, names)
                    )
                    continue
                value = value_of(factor, names)
                product = product * value if multiplied else product / value
            return product


def _named(text: str, names: Collection[str]) -> Expression:
    if text in names:
        return Expression.symbol(text)
    if text in CONSTANTS:
        return CONSTANTS[text]
    close = difflib.get_close_matches(text, [*names, *CONSTANTS], n=1)
    hint = (
        f"did you mean {close[0]!r}?"
        if close
        else f"known are {', '.join([*names, *CONSTANTS][:12])}"
    )
    raise ExpressionError(f"unknown name {text[:80]!r}; {hint}")


def _power(base: Expression, exponent: Expression) -> Expression:
    """Raise to a whole or half-whole power."""
    number = exponent.rational
    if number is None or number.denominator > 2:
        raise ExpressionError(
            f"an exponent of {exponent.text}; expected a whole number or half of one"
        )
    return (base if number.denominator == 1 else sqrt(base)) ** number.numerator
