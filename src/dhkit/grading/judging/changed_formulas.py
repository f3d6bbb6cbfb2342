"""Formulas with some parts replaced: names, calls of functions, equal parts; unchanged parts are shared."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import TypeGuard

from dhkit.expressions.syntax import Call, Name, Number, Power, Product, Sum, Tree
from dhkit.expressions.trees import names_of, operands, parts_of, with_operands
from dhkit.grading.answers.given import POSE_NAMES

_MIN_LAW_TERMS = 3
"""Smallest number of terms of the numerator in a law of cosines: two squared links, and a squared distance."""
_MIN_LAW_SQUARES = 2
"""Smallest number of squares among the terms of the numerator; a mistake may have removed one of the three."""


def renamed(tree: Tree, change: Mapping[str, Tree]) -> Tree:
    """Return a formula with names and numbers replaced at once; keys of ``change`` are those of :func:`leaf_text`."""
    if isinstance(tree, Name | Number):
        return change.get(leaf_text(tree), tree)
    return with_operands(tree, [renamed(child, change) for child in operands(tree)])


def leaf_text(leaf: Name | Number) -> str:
    """Return the key of a name or number, which does not depend on how a number was written."""
    return leaf.text if isinstance(leaf, Name) else str(leaf.value)


def is_joint(name: str) -> bool:
    """Whether a name is that of a joint's value: q1."""
    return name[:1] == "q" and name[1:].isdecimal()


def has_call(tree: Tree, functions: Sequence[str]) -> bool:
    """Whether a formula calls one of the functions."""
    return any(isinstance(part, Call) and part.function in functions for part in parts_of(tree))


def with_calls_changed(
    tree: Tree, functions: Sequence[str], change: Callable[[Call], Tree]
) -> Tree:
    """Return a formula with all calls of the functions changed; the formula itself if it has none."""
    changed = with_operands(
        tree, [with_calls_changed(child, functions, change) for child in operands(tree)]
    )
    return (
        change(changed) if isinstance(changed, Call) and changed.function in functions else changed
    )


def minus(tree: Tree) -> Tree:
    """Return a formula with a minus in front."""
    return Sum(((False, tree),))


def with_term(tree: Tree, added: bool, term: Tree) -> Tree:
    """Return a formula with one more term, added or subtracted."""
    return Sum(((True, tree), (added, term)))


def exchange_arguments(call: Call) -> Tree:
    """Return a call with its arguments in reverse order."""
    return replace(call, arguments=call.arguments[::-1])


def with_quadrant(call: Call) -> Call:
    """Return atan2(y, x) for atan(y/x); a call without a quotient as it is."""
    (argument,) = call.arguments
    if not _is_quotient(argument):
        return call
    y = product_of([(True, part) for is_factor, part in argument.factors if is_factor])
    x = product_of([(True, part) for is_factor, part in argument.factors if not is_factor])
    return Call("atan2", (y, x), 0)


def product_of(factors: Sequence[tuple[bool, Tree]]) -> Tree:
    """Return a product of factors (True) and divisors (False); 1 if there are none."""
    return Product(tuple(factors)) if factors else Number(Fraction(1), "1", 0)


def times(tree: Tree, factor: Tree) -> Tree:
    """Return a formula times another."""
    return Product(((True, tree), (True, factor)))


def square_of(tree: Tree) -> Tree:
    """Return a formula's square."""
    return Power(tree, Number(Fraction(2), "2", 0), 0)


def applied(function: str, argument: Tree) -> Tree:
    """Return a function of a formula."""
    return Call(function, (argument,), 0)


def is_constant(tree: Tree) -> bool:
    """Whether a formula contains no entry of the pose and no joint value."""
    return not any(name in POSE_NAMES or is_joint(name) for name in names_of(tree))


def is_law(tree: Tree) -> bool:
    """Whether a part looks like a law of cosines: a quotient whose numerator is a sum of three or more terms.

    cos q = (d^2 - a^2 - b^2) / (2 a b), with the links a and b beside joint q, and the distance d of their ends.
    """
    if not _is_quotient(tree):
        return False
    for is_factor, part in tree.factors:
        terms = _terms(part) if is_factor else []
        squares = sum(map(_is_square, terms))
        if len(terms) >= _MIN_LAW_TERMS and squares >= _MIN_LAW_SQUARES:
            return True
    return False


def _is_quotient(tree: Tree) -> TypeGuard[Product]:
    """Whether a formula is a product in which something is divided by."""
    return isinstance(tree, Product) and not all(is_factor for is_factor, _ in tree.factors)


def _terms(tree: Tree) -> list[Tree]:
    """Return the terms of a sum, with those of the sums in it; a formula that is not a sum is its own term."""
    if not isinstance(tree, Sum):
        return [tree]
    terms: list[Tree] = []
    for _, term in tree.terms:
        terms += _terms(term)
    return terms


def _is_square(tree: Tree) -> bool:
    return (
        isinstance(tree, Power) and isinstance(tree.exponent, Number) and tree.exponent.value == 2
    )
