"""Work on syntax trees: their parts and names, trees with other parts, and values in any arithmetic by one fold."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Generic, TypeVar

from dhkit.expressions.syntax import Call, Name, Number, Power, Product, Sum, Tree

T = TypeVar("T")


class Algebra(ABC, Generic[T]):
    """Arithmetic in which trees are evaluated: of numbers, intervals, elements of a ring, or text.

    A subclass says what each operation gives; :meth:`of` applies them to a tree. A part that occurs more than once is
    evaluated once, since the trees of CasADi's graphs share parts. Values are kept by the ``id`` of their part: the
    caller keeps the trees alive as long as the algebra.
    """

    def __init__(self) -> None:
        self.shared: dict[int, T] = {}
        """Values of the parts evaluated so far, by their ids."""

    def of(self, tree: Tree) -> T:
        """Return the value of a tree, worked out from its parts to the whole."""
        key = id(tree)
        if key not in self.shared:
            self.shared[key] = self._value(tree)
        return self.shared[key]

    def _value(self, tree: Tree) -> T:
        match tree:
            case Number():
                return self.number(tree)
            case Name():
                return self.name(tree)
            case Call():
                return self.call(tree)
            case Power():
                return self.power(tree)
            case Product(factors):
                return self.product([(is_multiplied, self.of(x)) for is_multiplied, x in factors])
            case Sum(terms):
                return self.sum([(is_added, self.of(x)) for is_added, x in terms])

    @abstractmethod
    def number(self, tree: Number) -> T:
        """Return the value of a number."""

    @abstractmethod
    def name(self, tree: Name) -> T:
        """Return the value of a name."""

    @abstractmethod
    def call(self, tree: Call) -> T:
        """Return the value of a call, whose arguments' values :meth:`of` gives."""

    @abstractmethod
    def power(self, tree: Power) -> T:
        """Return the value of a power, whose base's value :meth:`of` gives; algebras may restrict the exponent."""

    @abstractmethod
    def product(self, factors: Sequence[tuple[bool, T]]) -> T:
        """Return the product of values, each multiplied (True) or divided by (False)."""

    @abstractmethod
    def sum(self, terms: Sequence[tuple[bool, T]]) -> T:
        """Return the sum of values, each added (True) or subtracted (False)."""


def operands(tree: Tree) -> tuple[Tree, ...]:
    """Return the operands of a tree's outermost operation; none for a name or a number."""
    match tree:
        case Call(_, arguments):
            return arguments
        case Power(base, exponent):
            return base, exponent
        case Product(parts) | Sum(parts):
            return tuple(part for _, part in parts)
    return ()


def with_operands(tree: Tree, children: Sequence[Tree]) -> Tree:
    """Return a tree's outermost operation with other operands; the tree itself if they are the same."""
    if all(new is old for new, old in zip(children, operands(tree), strict=True)):
        return tree
    match tree:
        case Call():
            return replace(tree, arguments=tuple(children))
        case Power():
            return replace(tree, base=children[0], exponent=children[1])
        case Product(parts):
            # A factor is multiplied (True) or divided by (False), a term is added or subtracted: that stays.
            is_multiplied = [sign for sign, _ in parts]
            return Product(tuple(zip(is_multiplied, children, strict=True)))
        case Sum(parts):
            is_added = [sign for sign, _ in parts]
            return Sum(tuple(zip(is_added, children, strict=True)))
    return tree


def parts_of(tree: Tree, coefficients: bool = False) -> Iterator[Tree]:
    """Yield every node of a tree once, also those that CasADi's graphs share.

    Parameters
    ----------
    tree
        Any tree.
    coefficients
        Whether to leave out arguments of functions and exponents.
    """
    seen: set[int] = set()
    left = [tree]
    while left:
        part = left.pop()
        if id(part) in seen:
            continue
        seen.add(id(part))
        yield part
        if coefficients and isinstance(part, Power):
            left.append(part.base)
        elif not (coefficients and isinstance(part, Call)):
            left += operands(part)


def names_of(tree: Tree) -> set[str]:
    """Return the names that occur in a tree."""
    return {part.text for part in parts_of(tree) if isinstance(part, Name)}


def node_count(tree: Tree, limit: int) -> int:
    """Return how many nodes a tree has, those that are shared each time; counting ends beyond a limit."""
    count = 0
    waiting = [tree]
    while waiting and count <= limit:
        count += 1
        waiting += operands(waiting.pop())
    return count


# Equal parts


def equal_parts(trees: Sequence[Tree]) -> dict[int, frozenset[int]]:
    """Return, by the id of each part of some formulas, the ids of all parts equal to it."""
    places: dict[str, list[int]] = defaultdict(list)
    texts = _Texts()
    for tree in trees:
        for part in parts_of(tree):
            places[texts.of(part)].append(id(part))
    equal_places: dict[int, frozenset[int]] = {}
    for same in places.values():
        equal_places |= dict.fromkeys(same, frozenset(same))
    return equal_places


def replaced_everywhere(tree: Tree, places: frozenset[int], new: Tree) -> Tree:
    """Return a formula with the parts of the given ids replaced."""
    if id(tree) in places:
        return new
    return with_operands(
        tree, [replaced_everywhere(child, places, new) for child in operands(tree)]
    )


class _Texts(Algebra[str]):
    """Texts that are equal for equal parts."""

    def number(self, tree: Number) -> str:
        return str(tree.value)

    def name(self, tree: Name) -> str:
        return tree.text

    def call(self, tree: Call) -> str:
        return f"{tree.function}({', '.join(map(self.of, tree.arguments))})"

    def power(self, tree: Power) -> str:
        return f"({self.of(tree.base)})^({self.of(tree.exponent)})"

    def product(self, factors: Sequence[tuple[bool, str]]) -> str:
        return f"[{''.join(('*' if is_factor else '/') + text for is_factor, text in factors)}]"

    def sum(self, terms: Sequence[tuple[bool, str]]) -> str:
        return f"({''.join(('+' if added else '-') + text for added, text in terms)})"
