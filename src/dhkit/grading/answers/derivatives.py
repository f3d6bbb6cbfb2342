"""Time derivatives of syntax trees: d/dt of what stands there, in the robot's own names."""

from __future__ import annotations

import re
from fractions import Fraction

from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Call, Name, Number, Power, Product, Sum, Tree

VARIABLE = re.compile(r"(q|qd|qdd)(\d+)")
MAX_NODES = 2_000
"""Nodes of a derivative: products of many factors grow by their number."""


def time_derivative(tree: Tree) -> Tree:
    """Return d/dt of a tree: joint variables become rates, rates accelerations, all other names are constant.

    Raises
    ------
    AnswerError
        An acceleration, a function without a derivative of ours, or too long.
    """
    derivative = _derivative(tree)
    if _size(derivative) > MAX_NODES:
        raise AnswerError(f"a time derivative of more than {MAX_NODES} terms and factors")
    return Number(Fraction(0), "0", 0) if derivative is None else derivative


def _size(tree: Tree | None) -> int:
    match tree:
        case Sum(parts) | Product(parts):
            return 1 + sum(_size(part) for _, part in parts)
        case Power(base, exponent):
            return 1 + _size(base) + _size(exponent)
        case Call(_, arguments):
            return 1 + sum(map(_size, arguments))
    return 1


def _derivative(tree: Tree) -> Tree | None:
    """Return d/dt of a tree; None where it is constant."""
    match tree:
        case Number():
            return None
        case Name(text, at):
            return _of_name(text, at)
        case Sum(terms):
            changing = [(added, change) for added, term in terms if (change := _derivative(term)) is not None]
            return Sum(tuple(changing)) if changing else None
        case Product(factors):
            return _of_product(factors)
        case Power(base, exponent, at):
            return _of_power(base, exponent, at)
        case Call(function, arguments, at):
            return _of_call(function, arguments, at)


def _of_name(text: str, at: int) -> Tree | None:
    match = VARIABLE.fullmatch(text)
    if match is None:
        return None
    if match[1] == "qdd":
        raise AnswerError(f"a time derivative of an acceleration, {text}")
    return Name(f"{match[1]}d{match[2]}", at)


def _of_product(factors: tuple[tuple[bool, Tree], ...]) -> Tree | None:
    """Differentiate one factor after the other; a divisor u adds -u'/u."""
    terms: list[tuple[bool, Tree]] = []
    for k, (multiplied, factor) in enumerate(factors):
        change = _derivative(factor)
        if change is None:
            continue
        if multiplied:
            terms.append((True, Product((*factors[:k], (True, change), *factors[k + 1 :]))))
        else:
            terms.append((False, Product((*factors, (True, change), (False, factor)))))
    return Sum(tuple(terms)) if terms else None


def _of_power(base: Tree, exponent: Tree, at: int) -> Tree | None:
    change = _derivative(base)
    if _derivative(exponent) is not None:
        raise AnswerError(f"a time derivative of a power with a changing exponent at position {at + 1}")
    if change is None:
        return None
    if isinstance(exponent, Number) and exponent.value == 2:
        return Product(((True, exponent), (True, base), (True, change)))
    lower = Power(base, Sum(((True, exponent), (False, _number(1, at)))), at)
    return Product(((True, exponent), (True, lower), (True, change)))


def _of_call(function: str, arguments: tuple[Tree, ...], at: int) -> Tree | None:
    if all(_derivative(argument) is None for argument in arguments):
        return None
    inner = arguments[0]
    change = _derivative(inner)
    outer: Tree
    match function:
        case "sin":
            outer = Call("cos", arguments, at)
        case "cos":
            outer = Sum(((False, Call("sin", arguments, at)),))
        case "tan":
            outer = Product(((True, _number(1, at)), (False, Power(Call("cos", arguments, at), _number(2, at), at))))
        case "exp":
            outer = Call("exp", arguments, at)
        case "sqrt":
            outer = Product(((True, _number(1, at)), (False, _number(2, at)), (False, Call("sqrt", (inner,), at))))
        case _:
            raise AnswerError(f"a time derivative of {function}() at position {at + 1}, which is not read")
    return None if change is None else Product(((True, outer), (True, change)))


def _number(value: int, at: int) -> Number:
    return Number(Fraction(value), str(value), at)
