"""Formulas in which calls of functions are changed: arguments exchanged, signs turned."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from dhkit.expressions.syntax import Call, Power, Product, Sum, Tree

__all__ = ["changed_calls", "exchanged", "negated"]


MOST = 16
"""Calls that are changed one by one."""


def exchanged(call: Call) -> Tree:
    """Return a call with its arguments the other way round."""
    return replace(call, arguments=call.arguments[::-1])


def negated(call: Call) -> Tree:
    """Return a call with a minus in front."""
    return Sum(((False, call),))


def changed_calls(tree: Tree, functions: Sequence[str], change: Callable[[Call], Tree]) -> Iterator[Tree]:
    """Yield a tree with one call of these functions changed, one after the other, and with all of them changed."""
    count = _Change(functions, change, None).count(tree)
    for which in range(min(count, MOST) if count > 1 else 0):
        yield _Change(functions, change, which).of(tree)
    if count:
        yield _Change(functions, change, None).of(tree)


class _Change:
    """One walk over a tree that changes calls: the ``which``-th of these functions, or all."""

    def __init__(self, functions: Sequence[str], change: Callable[[Call], Tree], which: int | None) -> None:
        self.functions = functions
        self.change = change
        self.which = which
        self.met = 0

    def count(self, tree: Tree) -> int:
        """Return how many calls there are."""
        self.of(tree)
        return self.met

    def of(self, tree: Tree) -> Tree:
        match tree:
            case Call(function, arguments):
                chosen = function in self.functions and self.which in (None, self.met)
                self.met += function in self.functions
                call = replace(tree, arguments=tuple(self.of(argument) for argument in arguments))
                return self.change(call) if chosen else call
            case Power(base, exponent):
                return replace(tree, base=self.of(base), exponent=self.of(exponent))
            case Sum(terms):
                return Sum(tuple((added, self.of(term)) for added, term in terms))
            case Product(factors):
                return Product(tuple((multiplied, self.of(factor)) for multiplied, factor in factors))
        return tree
