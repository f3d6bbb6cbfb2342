"""Traversal of nested values (tuples, mappings, dataclasses) for the expressions in them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from itertools import chain
from typing import Any, TypeVar

from dhkit.description.named import Named
from dhkit.expressions import Expression, substitute

T = TypeVar("T")


def _with_expressions(value: T, change: Callable[[Expression], Expression]) -> T:
    """Return a value with every expression in it changed; parts without a change stay the same objects."""
    result: Any = value
    if isinstance(value, Expression):
        result = change(value)
    elif isinstance(value, tuple):
        result = tuple(_with_expressions(entry, change) for entry in value)
    elif isinstance(value, Named):
        result = Named({name: _with_expressions(entry, change) for name, entry in value.items()})
    elif is_dataclass(value) and not isinstance(value, type):
        entries = {item.name: getattr(value, item.name) for item in fields(value) if item.init}
        changed = {name: _with_expressions(entry, change) for name, entry in entries.items()}
        if any(changed[name] is not entry for name, entry in entries.items()):
            result = replace(value, **changed)
    return result if isinstance(value, Expression) or result != value else value


def with_values(value: T, values: Mapping[str, Expression]) -> T:
    """Return a value with parameters replaced by their values."""
    return _with_expressions(value, lambda expression: substitute(expression, values))


def expressions_in(value: object) -> Iterator[Expression]:
    """Yield every expression in a value."""
    if isinstance(value, Expression):
        yield value
        return
    entries: tuple[object, ...] = ()
    if isinstance(value, (tuple, Named)):
        entries = tuple(value.values()) if isinstance(value, Named) else value
    elif is_dataclass(value) and not isinstance(value, type):
        entries = tuple(getattr(value, item.name) for item in fields(value))
    for entry in entries:
        yield from expressions_in(entry)


def names_in(value: object) -> frozenset[str]:
    """Return the names of the parameters in a value."""
    return frozenset(
        chain.from_iterable(expression.symbols for expression in expressions_in(value))
    )
