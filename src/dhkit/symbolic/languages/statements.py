"""Statements of generated code, which a language's printer writes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Comment:
    """A comment, which begins a step."""

    text: str


@dataclass(frozen=True)
class Let:
    """A local variable, its expression, and a remark, which may be empty."""

    name: str
    expression: str
    remark: str = ""


@dataclass(frozen=True)
class Store:
    """Entries of an array that get one value.

    Attributes
    ----------
    array
        The array's name.
    places
        Index of each entry, from 0; () of a scalar.
    parts
        Expressions whose sum is the value.
    """

    array: str
    places: tuple[tuple[int, ...], ...]
    parts: tuple[str, ...]


@dataclass(frozen=True)
class Guard:
    """Continue with the next branch unless ``expression`` is at least ``least``."""

    expression: str
    least: str


@dataclass(frozen=True)
class Digit:
    """The next binary digit of the branch's index.

    Attributes
    ----------
    expressions
        The digit is 1 if an odd number of these is negative, else 0.
    is_inverted
        Whether the digits are exchanged.
    """

    expressions: tuple[str, ...]
    is_inverted: bool


Statement = Comment | Let | Store | Guard | Digit
