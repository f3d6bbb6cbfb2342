"""Which quantity, or which entry of one, a name such as M, M_12, g1 or A1_14 stands for on a given robot."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

from dhkit.description import Description
from dhkit.grading.answers.sheet import ALIASES, quantity_names, shape_of
from dhkit.grading.answers.vocabulary import Vocabulary, plain_name

SCALARS = ("K", "V", "L")
LONGEST = 40
"""Characters of a name that may be a quantity."""
ENTRY = re.compile(r"([A-Za-z]+?)(\d*)_?(\d+)(?:[_,](\d+))?", re.ASCII)
SMALL_HEADS = {"m": "M"}
"""Small letters in front of two numbers: m12 is an entry of M. c12 and s12 are cosines and sines."""


@dataclass(frozen=True)
class Target:
    """A quantity, or one of its entries.

    Attributes
    ----------
    quantity
        M, C, h, g, tau, K, V, L, A1 ... An, T or J.
    index
        Of an entry, from 0; None of the whole quantity.
    """

    quantity: str
    index: tuple[int, ...] | None = None

    def __str__(self) -> str:
        places = ",".join(str(k + 1) for k in self.index or ())
        return self.quantity + (f"({places})" if places else "")


class QuantityNames:
    """The names of a robot's quantities and of their entries.

    Parameters
    ----------
    description
        The robot. Its parameters are never quantities or entries, where a formula and not a matrix is assigned.
    """

    def __init__(self, description: Description) -> None:
        self.n = description.n
        self.parameters: Mapping[str, str] = {plain_name(name): name for name in description.parameters}
        self.vocabulary = Vocabulary(description)

    @cached_property
    def whole(self) -> frozenset[str]:
        """Names of whole quantities."""
        return frozenset(quantity_names(self.n))

    def shape(self, quantity: str) -> tuple[int, ...]:
        """Return a quantity's shape; () of a scalar."""
        return shape_of(quantity, self.n)

    def is_scalar(self, quantity: str) -> bool:
        """Whether a quantity has one entry, so that a formula without brackets gives it whole."""
        shape = self.shape(quantity)
        return all(length == 1 for length in shape)

    def quantity(self, name: str) -> str:
        """Return the quantity that a name stands for, by itself or as an alias; empty of another name."""
        plain = plain_name(name)
        if plain in self.whole:
            return plain
        alias = ALIASES.get(plain, "")
        return alias if alias in self.whole else ""

    def is_alias(self, name: str) -> bool:
        """Whether a name is another name of a quantity, such as U of V."""
        return plain_name(name) not in self.whole and bool(self.quantity(name))

    def is_parameter(self, name: str) -> bool:
        """Whether the robot's file has this parameter."""
        return plain_name(name) in self.parameters

    def entries(self, name: str) -> list[Target]:
        """Return the entries that a name may stand for: several where its digits can be read in two ways."""
        if len(name) > LONGEST or self.is_parameter(name):
            return []
        match = ENTRY.fullmatch(name.replace("{", "").replace("}", ""))
        if match is None:
            return []
        letters, digits, first, second = match.groups()
        return list(dict.fromkeys(self._readings(letters, digits, first, second)))

    def _readings(self, letters: str, digits: str, first: str, second: str | None) -> Iterable[Target]:
        if second is not None:
            pairs = [(digits, first, second)] if digits else [("", first, second)]
            pairs += [("", digits + first, second)] if digits else []
            for head, i, j in pairs:
                yield from self._matrix_entry(letters + head, i, j)
            return
        number = digits + first
        yield from self._vector_entry(letters, number)
        for k in range(1, len(number)):
            yield from self._matrix_entry(letters, number[:k], number[k:])
        for start in range(1, len(number) - 1):
            for end in range(start + 1, len(number)):
                yield from self._matrix_entry(letters + number[:start], number[start:end], number[end:])

    def _vector_entry(self, letters: str, number: str) -> Iterable[Target]:
        quantity = self.quantity(letters)
        if len(self.shape(quantity or "K")) == 1 and self._in(number, self.n):
            yield Target(quantity, (int(number) - 1,))

    def _matrix_entry(self, letters: str, i: str, j: str) -> Iterable[Target]:
        quantity = self.quantity(SMALL_HEADS.get(letters, letters))
        shape = self.shape(quantity or "K")
        if len(shape) == 2 and self._in(i, shape[0]) and self._in(j, shape[1]):
            yield Target(quantity, (int(i) - 1, int(j) - 1))

    @staticmethod
    def _in(number: str, largest: int) -> bool:
        return len(number) <= 3 and not number.startswith("0") and int(number) <= largest

    def index_in(self, quantity: str, index: tuple[int, ...]) -> tuple[int, ...] | None:
        """Return an index as the quantity has it: (i, 0) of a column is (i,); None of one that it does not have."""
        shape = self.shape(quantity)
        if len(shape) == 1 and len(index) == 2 and index[1] == 0:
            index = index[:1]
        inside = len(index) == len(shape) and all(0 <= k < length for k, length in zip(index, shape, strict=True))
        return index if inside else None
