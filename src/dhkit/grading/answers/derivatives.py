"""Time derivatives of syntax trees, in the robot's own names, and small pieces of trees."""

from __future__ import annotations

import re
from fractions import Fraction

from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Call, Name, Number, Power, Product, Sum, Tree
from dhkit.expressions.trees import node_count
from dhkit.grading.answers.bounds import BOUNDS

_VARIABLE = re.compile(r"(q|qd|qdd)(\d+)")


def number(value: int, at: int) -> Number:
    """Return a whole number as a tree."""
    return Number(Fraction(value), str(value), at)


def product(*factors: Tree) -> Product:
    """Return a product as a tree."""
    return Product(tuple((True, factor) for factor in factors))


def quotient(numerator: Tree, *denominators: Tree) -> Product:
    """Return a quotient as a tree, divided by one denominator after the other."""
    return Product(((True, numerator), *((False, denominator) for denominator in denominators)))


def time_derivative(tree: Tree) -> Tree:
    """Return d/dt of a tree: joint variables become rates, rates accelerations, all other names are constant.

    Raises
    ------
    AnswerError
        An acceleration, a changing exponent, a function without a rule here, or more nodes than
        ``BOUNDS.derivative_nodes``.
    """
    derivative = _derivative(tree)
    if derivative is None:
        return number(0, 0)
    if node_count(derivative, BOUNDS.derivative_nodes) > BOUNDS.derivative_nodes:
        raise AnswerError(
            f"a time derivative of more than {BOUNDS.derivative_nodes} terms and factors"
        )
    return derivative


def _derivative(tree: Tree) -> Tree | None:
    """Return d/dt of a tree; None where it is constant."""
    match tree:
        case Number():
            return None
        case Name(text, at):
            match = _VARIABLE.fullmatch(text)
            if match and match[1] == "qdd":
                raise AnswerError(f"a time derivative of an acceleration, {text}")
            return Name(f"{match[1]}d{match[2]}", at) if match else None
        case Sum(terms):
            changes = [(added, _derivative(term)) for added, term in terms]
            changing = [(added, change) for added, change in changes if change is not None]
            return Sum(tuple(changing)) if changing else None
        case Product(factors):
            return _derivative_of_product(factors)
        case Power(base, exponent, at):
            return _derivative_of_power(base, exponent, at)
        case Call(function, arguments, at):
            return _derivative_of_call(function, arguments, at)


def _derivative_of_product(factors: tuple[tuple[bool, Tree], ...]) -> Tree | None:
    """Differentiate one factor after the other; a divisor u adds -u'/u."""
    terms: list[tuple[bool, Tree]] = []
    for k, (multiplied, factor) in enumerate(factors):
        change = _derivative(factor)
        if change is not None and multiplied:
            terms.append((True, Product((*factors[:k], (True, change), *factors[k + 1 :]))))
        elif change is not None:
            terms.append((False, Product((*factors, (True, change), (False, factor)))))
    return Sum(tuple(terms)) if terms else None


def _derivative_of_power(base: Tree, exponent: Tree, at: int) -> Tree | None:
    change = _derivative(base)
    if _derivative(exponent) is not None:
        raise AnswerError(
            f"a time derivative of a power with a changing exponent at position {at + 1}"
        )
    if change is None:
        return None
    if isinstance(exponent, Number) and exponent.value == 2:
        return product(exponent, base, change)
    return product(
        exponent, Power(base, Sum(((True, exponent), (False, number(1, at)))), at), change
    )


def _derivative_of_call(function: str, arguments: tuple[Tree, ...], at: int) -> Tree | None:
    changes = [_derivative(argument) for argument in arguments]
    if all(change is None for change in changes):
        return None
    outer: Tree
    match function:
        case "sin":
            outer = Call("cos", arguments, at)
        case "cos":
            outer = Sum(((False, Call("sin", arguments, at)),))
        case "tan":
            outer = quotient(number(1, at), Power(Call("cos", arguments, at), number(2, at), at))
        case "exp":
            outer = Call("exp", arguments, at)
        case "sqrt":
            outer = quotient(number(1, at), number(2, at), Call("sqrt", arguments[:1], at))
        case _:
            raise AnswerError(
                f"a time derivative of {function}() at position {at + 1}; expected sin, cos, tan, exp or sqrt"
            )
    return None if changes[0] is None else product(outer, changes[0])
