"""Names of quantities and of their entries, such as M, M_12, g1 or A1_14, on a given robot."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, combinations

from dhkit.description import Description
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.sheet import ALIASES, quantity_names, shape_of
from dhkit.grading.answers.sheet_values import NO_NAMES, Names
from dhkit.grading.answers.vocabulary import Vocabulary, plain_name

_ENTRY = re.compile(r"([A-Za-z]+?)(\d*)_?(\d+)(?:[_,](\d+))?", re.ASCII)
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
        Index of the entry, from 0; None for the whole quantity.
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
    names
        The student's, or the task's, own names of the joint variables.
    """

    def __init__(self, description: Description, names: Names = NO_NAMES) -> None:
        self.n = description.n
        self.parameters: Mapping[str, str] = {
            plain_name(name): name for name in description.parameters
        }
        self.vocabulary = Vocabulary(description, q=names.q, qd=names.qd, qdd=names.qdd)

    @cached_property
    def whole(self) -> frozenset[str]:
        """Names of whole quantities."""
        return frozenset(quantity_names(self.n))

    def shape(self, quantity: str) -> tuple[int, ...]:
        """Return a quantity's shape; () of a scalar."""
        return shape_of(quantity, self.n)

    def is_scalar(self, quantity: str) -> bool:
        """Whether a quantity has one entry, so that a formula without brackets gives it whole."""
        return all(length == 1 for length in self.shape(quantity))

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
        match = (
            _ENTRY.fullmatch(re.sub(r"[{}]", "", name))
            if len(name) <= BOUNDS.entry_name_characters
            else None
        )
        if match is None or self.is_parameter(name):
            return []
        letters, digits, first, second = match.groups()
        number = digits + first
        readings: list[tuple[str, ...]]
        if second is not None:
            readings = [(letters + digits, first, second), (letters, number, second)]
        else:
            # Digits: one index; two indices; digits of the name, and then two indices.
            cuts = range(1, len(number))
            readings = [(letters, number)]
            readings += [(letters, number[:k], number[k:]) for k in cuts]
            readings += [
                (letters + number[:i], number[i:k], number[k:]) for i, k in combinations(cuts, 2)
            ]
        targets = chain.from_iterable(self._entry(*reading) for reading in readings)
        return list(dict.fromkeys(targets))

    def _entry(self, head: str, *numbers: str) -> Iterable[Target]:
        """Yield the entry of a vector with one number, or of a matrix with two, counted from 1."""
        quantity = self.quantity(SMALL_HEADS.get(head, head) if len(numbers) == 2 else head)
        shape = self.shape(quantity) if quantity else ()
        if shape and len(shape) == len(numbers) and all(map(_is_place, numbers, shape)):
            yield Target(quantity, tuple(int(number) - 1 for number in numbers))

    def index_in(self, quantity: str, index: tuple[int, ...]) -> tuple[int, ...] | None:
        """Return an index as the quantity has it: (i, 0) of a column is (i,); None of one that it does not have."""
        shape = self.shape(quantity)
        if len(shape) == 1 and len(index) == 2 and index[1] == 0:
            index = index[:1]
        inside = len(index) == len(shape) and all(
            0 <= k < length for k, length in zip(index, shape, strict=True)
        )
        return index if inside else None


def _is_place(number: str, length: int) -> bool:
    return len(number) <= 3 and not number.startswith("0") and int(number) <= length
