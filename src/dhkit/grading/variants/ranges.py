"""Numbers that a parameter may have, and which of them do not coincide with others by chance."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal
from fractions import Fraction

MOST_VALUES = 1_000_000
"""Largest number of values of a range."""
_SPECIAL_RATIOS = frozenset(
    ratio for whole in (2, 3, 4) for ratio in (Fraction(whole), Fraction(1, whole))
)
"""Ratios of two parameters at which usual mistakes give the right number: factors 1/2 of a rod's centre, and 1/3 and
1/4 between its moments of inertia. A ratio of 1 is found as an equal sum."""


@dataclass(frozen=True)
class Range:
    """The multiples of a step from a lowest to a highest number.

    Attributes
    ----------
    low, high
        Bounds, SI units and rad; both belong to the range.
    step
        Distance of neighbouring values, above 0.
    """

    low: Decimal
    high: Decimal
    step: Decimal

    def __len__(self) -> int:
        return max(0, self._multiple(self.high, ROUND_FLOOR) - self._first + 1)

    def __getitem__(self, index: int) -> Decimal:
        """Return a value by its place in the range, from 0."""
        if not 0 <= index < len(self):
            raise IndexError(index)
        return (self._first + index) * self.step

    def __iter__(self) -> Iterator[Decimal]:
        return (self[index] for index in range(len(self)))

    @property
    def _first(self) -> int:
        return self._multiple(self.low, ROUND_CEILING)

    def _multiple(self, bound: Decimal, rounding: str) -> int:
        return int((bound / self.step).to_integral_value(rounding))


def step_of(low: Decimal, high: Decimal, digits: int) -> Decimal:
    """Return the step at which the larger bound has a number of significant digits: 0.01 for [0.3, 0.6] and 2."""
    largest = max(abs(low), abs(high))
    return Decimal(1).scaleb(largest.adjusted() + 1 - digits)


def is_generic(values: Mapping[str, Fraction], drawn: Collection[str]) -> bool:
    """Return whether no wrong formula gives a right number by chance.

    A drawn value is not 0. Two sums x + y of two values, or of a value and 0, differ, and so do two products x y of two
    values, or of a value and 1. So no value is 1, no two are equal, none is twice another or the sum or the product of
    two others. Neither a value nor the ratio of two values is 2, 3, 4, or the inverse of one of these. Signs do not
    count. Relations between values that are not drawn are the robot file's own and are ignored.

    Parameters
    ----------
    values
        Values of all parameters, by name.
    drawn
        Names of those that were drawn.

    Examples
    --------
    >>> is_generic({"l1": Fraction("0.45"), "l2": Fraction("0.37")}, ("l1", "l2"))
    True
    >>> is_generic({"l1": Fraction("0.6"), "l2": Fraction("0.3")}, ("l1", "l2"))
    False
    """
    own = [abs(values[name]) for name in drawn]
    given = [abs(value) for name, value in values.items() if name not in drawn and value]
    if not all(own):
        return False
    for value, other in itertools.chain(
        itertools.combinations([Fraction(1), *own], 2), itertools.product(own, given)
    ):
        if value / other in _SPECIAL_RATIOS:
            return False
    return _are_distinct(own, given, Fraction(0)) and _are_distinct(own, given, Fraction(1))


def _are_distinct(own: list[Fraction], given: list[Fraction], neutral: Fraction) -> bool:
    """Return whether pairs with a drawn value have results of their own.

    Parameters
    ----------
    own
        Drawn values.
    given
        Other values.
    neutral
        0 for sums of pairs, 1 for products.
    """
    operation = sum if neutral == 0 else math.prod
    others = dict.fromkeys([neutral, *given])
    found = {operation(pair) for pair in itertools.combinations_with_replacement(others, 2)}
    pairs = itertools.chain(
        itertools.combinations_with_replacement(own, 2), itertools.product(own, others)
    )
    for pair in pairs:
        result = operation(pair)
        if result in found:
            return False
        found.add(result)
    return True
