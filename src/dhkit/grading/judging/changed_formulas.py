"""Formulas with some parts replaced: names, calls of functions, equal parts; unchanged parts are shared."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

from dhkit.expressions.syntax import Call, Name, Number, Power, Product, Sum, Tree
from dhkit.expressions.trees import names_of, operands, parts_of, with_operands
from dhkit.grading.answers.given import POSE_NAMES

_MIN_LAW_TERMS = 3
"""Smallest number of terms of the numerator in a law of cosines: two squared links, and a squared distance."""
_MIN_LAW_SQUARES = 2
"""Smallest number of squares among them; a mistake may have removed one."""


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


def with_calls_changed(tree: Tree, functions: Sequence[str], change: Callable[[Call], Tree]) -> Tree:
    """Return a formula with all calls of the functions changed; the formula itself if it has none."""
    changed = with_operands(tree, [with_calls_changed(child, functions, change) for child in operands(tree)])
    return change(changed) if isinstance(changed, Call) and changed.function in functions else changed


def minus(tree: Tree) -> Tree:
    """Return a formula with a minus in front."""
    return Sum(((False, tree),))


def exchange_arguments(call: Call) -> Tree:
    """Return a call with its arguments in reverse order."""
    return replace(call, arguments=call.arguments[::-1])


def with_quadrant(call: Call) -> Call:
    """Return atan2(y, x) for atan(y/x); a call without a quotient as it is."""
    (argument,) = call.arguments
    if not isinstance(argument, Product) or all(is_factor for is_factor, _ in argument.factors):
        return call
    y, x = (
        product_of([(True, part) for is_factor, part in argument.factors if is_factor is wanted])
        for wanted in (True, False)
    )
    return Call("atan2", (y, x), 0)


def product_of(factors: Sequence[tuple[bool, Tree]]) -> Tree:
    """Return a product; 1 without factors."""
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
    """Whether a formula contains no entry of the pose and no joint."""
    return not any(name in POSE_NAMES or is_joint(name) for name in names_of(tree))


def is_law(tree: Tree) -> bool:
    """Whether a part looks like a law of cosines: a sum of three terms or more, with squares, over a product."""
    if not isinstance(tree, Product) or all(is_factor for is_factor, _ in tree.factors):
        return False
    sums = [_terms(part) for is_factor, part in tree.factors if is_factor]
    return any(len(terms) >= _MIN_LAW_TERMS and sum(map(_is_square, terms)) >= _MIN_LAW_SQUARES for terms in sums)


def _terms(tree: Tree) -> list[Tree]:
    """Return the terms of a sum, with those of sums in it."""
    return [part for _, term in tree.terms for part in _terms(term)] if isinstance(tree, Sum) else [tree]


def _is_square(tree: Tree) -> bool:
    return isinstance(tree, Power) and isinstance(tree.exponent, Number) and tree.exponent.value == 2
