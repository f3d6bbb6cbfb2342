"""Every expression inside a value: replaced, or asked for its names."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from dhkit.description.named import Named
from dhkit.expressions import Expression, substitute

T = TypeVar("T")


def with_expressions(value: T, change: Callable[[Expression], Expression]) -> T:
    """Return a value with every expression in it changed; what holds none stays the same object."""
    result: Any = value
    if isinstance(value, Expression):
        result = change(value)
    elif isinstance(value, tuple):
        result = tuple(with_expressions(entry, change) for entry in value)
    elif isinstance(value, Named):
        result = Named({name: with_expressions(entry, change) for name, entry in value.items()})
    elif is_dataclass(value) and not isinstance(value, type):
        held = {item.name: getattr(value, item.name) for item in fields(value) if item.init}
        changed = {name: with_expressions(entry, change) for name, entry in held.items()}
        if any(changed[name] is not entry for name, entry in held.items()):
            result = replace(value, **changed)
    return result if isinstance(value, Expression) or result != value else value


def with_values(value: T, values: Mapping[str, Expression]) -> T:
    """Return a value with names replaced by what they stand for."""
    return with_expressions(value, lambda expression: substitute(expression, values))


def expressions_in(value: object) -> Iterator[Expression]:
    """Yield every expression in a value."""
    if isinstance(value, Expression):
        yield value
    elif isinstance(value, tuple):
        for entry in value:
            yield from expressions_in(entry)
    elif isinstance(value, Named):
        yield from expressions_in(tuple(value.values()))
    elif is_dataclass(value) and not isinstance(value, type):
        yield from expressions_in(tuple(getattr(value, item.name) for item in fields(value)))


def names_in(value: object) -> frozenset[str]:
    """Return the parameters that a value depends on."""
    return frozenset(name for expression in expressions_in(value) for name in expression.symbols)
