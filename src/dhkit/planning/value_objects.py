"""Constraints and terms of objectives as values: planners and programs are kept by them."""

from __future__ import annotations

from dataclasses import fields, is_dataclass


def require_value(thing: object) -> None:
    """Refuse a constraint or term that its fields do not determine: one with other values would be taken for it.

    Raises
    ------
    TypeError
        Attributes that are no fields of a frozen dataclass, or a field that cannot be hashed.
    """
    kind = type(thing).__name__
    known = {field.name for field in fields(thing)} if is_dataclass(thing) else set()
    if others := sorted({*getattr(thing, "__dict__", ())} - known):
        raise TypeError(
            f"{kind}.{others[0]} is no field; expected a class with @dataclass(frozen=True) and {others[0]}: ..."
        )
    try:
        hash(thing)
    except TypeError as error:
        raise TypeError(
            f"{kind}: {error}; expected @dataclass(frozen=True) with numbers and tuples as fields"
        ) from None
