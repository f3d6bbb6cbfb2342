"""Syntax of entries of arrays, calls of functions and numbers in programming languages, for all code generators."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Syntax:
    """The parts of a language's syntax that generated code uses; operators are the same in all languages.

    Attributes
    ----------
    item
        An array's entry, from the array's name and the entry's index: ``{array}[{k}]``.
    first_index
        Index of an array's first entry.
    pi
        The number pi.
    functions
        Functions that have another name in the language.
    nan, infinity
        The values that no literal has.
    """

    item: str
    first_index: int
    pi: str
    functions: Mapping[str, str]
    nan: str
    infinity: str

    def entry(self, array: str, k: int) -> str:
        """Return entry k of an array, counted from 0."""
        return self.item.format(array=array, k=k + self.first_index)

    def call(self, function: str, arguments: Sequence[str]) -> str:
        """Return a call of a function of :data:`dhkit.expressions.FUNCTIONS` or of an operation of a graph."""
        return f"{self.functions.get(function, function)}({', '.join(arguments)})"

    def number(self, value: float) -> str:
        """Return a literal that is read as the same double."""
        if math.isnan(value):
            return self.nan
        if math.isinf(value):
            return self.infinity if value > 0 else f"-{self.infinity}"
        return repr(value)
