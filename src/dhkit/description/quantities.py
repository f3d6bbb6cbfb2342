"""Text of a quantity in a table with units."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import TypeVar

from dhkit.description.values import ONE
from dhkit.errors import ExpressionError
from dhkit.expressions import CONSTANTS, Expression, parse

NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,4})?", re.ASCII)
"""A decimal, as files have it."""
_JOINT_VARIABLE = re.compile(r"\s*q_?([0-9]{1,2})\s*([+-].*)?", re.ASCII | re.DOTALL)
"""A joint variable and the constant added to it."""

Entry = TypeVar("Entry")


def is_plain_number(text: str) -> bool:
    """Return whether text is a number and nothing else but spaces around it."""
    return NUMBER.fullmatch(text.strip()) is not None


def has_numbers_alone(text: str) -> bool:
    """Return whether an expression has no name, and no brackets around everything."""
    if re.search(r"[A-Za-z_]", re.sub(r"(?<=[0-9.])[eE](?=[+-]?[0-9])", "", text)):
        return False
    inner = text.strip()
    depth = 0
    for place, character in enumerate(inner):
        depth += (character == "(") - (character == ")")
        if depth == 0:
            return not (inner.startswith("(") and place == len(inner) - 1)
    return True


def parse_quantity(text: str, names: Collection[str], unit: Expression = ONE) -> Expression:
    """Return the value of an expression, which is in metres and radians; it may use these names.

    Numbers alone as text, "243.3" or "486.6/2" in a table of mm, are refused: they may mean either unit. "(0.2433)", in
    brackets, is an expression.

    Raises
    ------
    ExpressionError
        Not an expression, or a number as text where ``unit``, that of numbers, is another one.
    """
    value = parse(text, names)
    if unit != ONE and not value.is_zero and has_numbers_alone(text):
        written = text.strip()
        product = written if is_plain_number(written) else f"({written})"
        name = next((name for name, constant in CONSTANTS.items() if constant == unit), "its unit")
        raise ExpressionError(
            f"{written!r} is text without a unit; expected the number {written}, or an expression such as"
            f" {product}*{name}; in parentheses it is in m or rad"
        )
    return value


def without_variable(entry: Entry, number: int) -> Entry | str | int:
    """Return an entry of a table's row without that row's joint variable before its offset: of "q1 + pi/2" the offset.

    Tables are printed so, and books print them so; the variable itself is added to theta, or to d, of every row.
    """
    if (
        isinstance(entry, str)
        and (match := _JOINT_VARIABLE.fullmatch(entry))
        and int(match[1]) == number
    ):
        offset: str | None = match[2]
        return offset or 0
    return entry
