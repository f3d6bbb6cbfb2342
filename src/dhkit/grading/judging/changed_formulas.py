"""Formulas with some parts replaced: names, calls of functions, equal parts; unchanged parts are shared."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

from dhkit.expressions.syntax import Call, Name, Number, Power, Product, Sum, Tree
from dhkit.grading.answers.given import POSE_NAMES
from dhkit.grading.judging.numeric import names_of, parts_of

MIN_LAW_TERMS = 3
"""Smallest number of terms of the numerator in a law of cosines: two squared links, and a squared distance."""
MIN_LAW_SQUARES = 2
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


def equal_parts(trees: Sequence[Tree]) -> dict[int, frozenset[int]]:
    """Return, by the id of each part of some formulas, the ids of all parts equal to it."""
    places: dict[str, list[int]] = defaultdict(list)
    for tree in trees:
        for part, text in _texts(tree):
            places[text].append(id(part))
    return {place: frozenset(same) for same in places.values() for place in same}


def replaced_everywhere(tree: Tree, places: frozenset[int], new: Tree) -> Tree:
    """Return a formula with the parts of the given ids replaced."""
    if id(tree) in places:
        return new
    return with_operands(tree, [replaced_everywhere(child, places, new) for child in operands(tree)])


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


def operands(tree: Tree) -> tuple[Tree, ...]:
    """Return the operands of a formula's outermost operation; none for a name or a number."""
    match tree:
        case Call(_, arguments):
            return arguments
        case Power(base, exponent):
            return base, exponent
        case Product(parts) | Sum(parts):
            return tuple(part for _, part in parts)
    return ()


def with_operands(tree: Tree, children: Sequence[Tree]) -> Tree:
    """Return a formula's outermost operation with other operands; the formula itself if they are the same."""
    if all(new is old for new, old in zip(children, operands(tree), strict=True)):
        return tree
    match tree:
        case Call():
            return replace(tree, arguments=tuple(children))
        case Power():
            return replace(tree, base=children[0], exponent=children[1])
        case Product(parts):
            return Product(tuple((is_factor, child) for (is_factor, _), child in zip(parts, children, strict=True)))
        case Sum(parts):
            return Sum(tuple((added, child) for (added, _), child in zip(parts, children, strict=True)))
    return tree


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
    return any(len(terms) >= MIN_LAW_TERMS and sum(map(_is_square, terms)) >= MIN_LAW_SQUARES for terms in sums)


def _terms(tree: Tree) -> list[Tree]:
    """Return the terms of a sum, with those of sums in it."""
    return [part for _, term in tree.terms for part in _terms(term)] if isinstance(tree, Sum) else [tree]


def _is_square(tree: Tree) -> bool:
    return isinstance(tree, Power) and isinstance(tree.exponent, Number) and tree.exponent.value == 2


def _texts(tree: Tree) -> Iterator[tuple[Tree, str]]:
    """Yield a formula's parts, the whole last, with texts that are equal for equal parts."""
    inner = []
    for child in operands(tree):
        parts_of_child = list(_texts(child))
        yield from parts_of_child
        inner.append(parts_of_child[-1][1])
    match tree:
        case Number(value=value):
            yield tree, str(value)
        case Name(text):
            yield tree, text
        case Call(function):
            yield tree, f"{function}({', '.join(inner)})"
        case Power():
            yield tree, f"({inner[0]})^({inner[1]})"
        case Product(parts):
            factors = (("*" if is_factor else "/") + text for (is_factor, _), text in zip(parts, inner, strict=True))
            yield tree, f"[{''.join(factors)}]"
        case Sum(parts):
            terms = (("+" if added else "-") + text for (added, _), text in zip(parts, inner, strict=True))
            yield tree, f"({''.join(terms)})"
