"""Which mistakes give exactly a student's answers: differences from the truth, looked up by their normal forms."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import combinations
from typing import Any, TypeAlias

import numpy as np

from dhkit.description import Array
from dhkit.grading.judging.numeric import general_state, state_arrays
from dhkit.grading.judging.truth import DYNAMICS, Truth, exact_number, kinematic_quantity, substituted
from dhkit.grading.mistakes.variants import Variant, kinematic_variants, variants
from dhkit.symbolic.mistakes import MISTAKES
from dhkit.symbolic.ring import Element, Elements, element_array
from dhkit.symbolic.textbook import derive
from dhkit.symbolic.textbook_kinematics import KINEMATIC_MISTAKES, derive_kinematics

__all__ = ["Differences", "Variants", "variants_of"]

Index: TypeAlias = tuple[int, ...]
Differences: TypeAlias = Mapping[Index, Element]
"""Of a quantity's entries answer less truth; zero where it is right."""
Key: TypeAlias = tuple[Any, ...]
TEXTBOOK = {*MISTAKES, *KINEMATIC_MISTAKES}
NEAR = 2e-3
"""Share of the largest entry: decimals of four digits are off by less."""
PAIR_SECONDS = 0.4
"""Time for pairs of mistakes at one link, for a quantity."""


class Variants:
    """What every mistake changes on one robot, found by normal forms; made quantity by quantity when first asked for.

    Parameters
    ----------
    truth
        The right answers.
    numbers
        Parameters that stand for their numbers.
    """

    def __init__(self, truth: Truth, numbers: frozenset[str] = frozenset()) -> None:
        self.truth = truth
        self.numbers = numbers
        self._wholes: dict[str, dict[Key, list[Variant]]] = {}
        self._entries: dict[str, dict[tuple[Index, Any], list[Variant]]] = {}
        self._pairs: dict[str, _Pairs] = {}
        self._values: dict[str, list[Array]] = {}

    @cached_property
    def dynamic(self) -> list[Variant]:
        """The mistakes that there are in the robot's equations."""
        return variants(self.truth)

    @cached_property
    def kinematic(self) -> list[Variant]:
        """The mistakes that there are in the robot's transforms."""
        return kinematic_variants(self.truth)

    def change(self, variant: Variant, quantity: str) -> Elements:
        """Return what a mistake adds to a quantity, with numbers in place of parameters."""
        return self.in_numbers(quantity, variant.adds_to(_judged(quantity), self.truth.coordinates))

    def in_numbers(self, quantity: str, array: Elements) -> Elements:
        """Put the file's numbers in place of the parameters that answers have as numbers."""
        if not self.numbers:
            return array
        arm = self.truth.arm(quantity)
        values = {name: arm.ring.number(exact_number(self.truth.description, name)) for name in self.numbers}
        return substituted(array, values, arm.ring)

    # Tables

    def prepare(self, quantity: str) -> None:
        """Make a quantity's tables."""
        if quantity in self._wholes:
            return
        whole: dict[Key, list[Variant]] = {}
        entries: dict[tuple[Index, Any], list[Variant]] = {}
        for variant in self.dynamic if quantity in DYNAMICS else self.kinematic:
            change = self.change(variant, quantity)
            keys = {place: _key(quantity, element) for place, element in np.ndenumerate(change)}
            if not any(keys.values()):
                continue
            whole.setdefault(tuple(keys.values()), []).append(variant)
            for place, key in keys.items():
                if key:
                    entries.setdefault((place, key), []).append(variant)
        self._wholes[quantity], self._entries[quantity] = whole, entries

    def whole(self, quantity: str, differences: Differences) -> list[Variant]:
        """Return the mistakes that change a quantity exactly so."""
        self.prepare(quantity)
        return self._wholes[quantity].get(_keys(quantity, differences), [])

    def entry(self, quantity: str, index: Index, difference: Element) -> list[Variant]:
        """Return the mistakes that change an entry exactly so."""
        self.prepare(quantity)
        place = index[:1] if quantity == "C" else index
        return self._entries[quantity].get((place, _key(quantity, difference)), [])

    def near(self, quantity: str, right: Elements, answer: Mapping[Index, float]) -> list[Variant]:
        """Return the mistakes whose results are near an answer in one state: those worth an exact look.

        Parameters
        ----------
        quantity
            Which.
        right
            Its truth.
        answer
            The answer's values at :func:`general_state`, parameters as in the file.
        """
        self.prepare(quantity)
        arm = self.truth.arm(quantity)
        q, qd, qdd = state_arrays(general_state(arm.n), arm.n)
        if quantity not in self._values:
            changes = [self.change(found[0], quantity) for found in self._wholes[quantity].values()]
            self._values[quantity] = [arm.evaluate(change, q, qd, qdd).ravel() for change in changes]
        wanted = np.array([answer[index] for index in np.ndindex(right.shape)])
        truth = arm.evaluate(right, q, qd, qdd).ravel()
        tolerance = NEAR * np.max(np.abs(truth), initial=0.0)
        return [
            variant
            for variants, change in zip(self._wholes[quantity].values(), self._values[quantity], strict=True)
            if np.all(np.abs(truth + change - wanted) <= tolerance)
            for variant in variants
        ]

    def pair(
        self, quantity: str, differences: Differences, seconds: float = PAIR_SECONDS
    ) -> tuple[Variant, Variant] | None:
        """Return two mistakes that together change a quantity exactly so."""
        self.prepare(quantity)
        if quantity not in self._pairs:
            self._pairs[quantity] = _Pairs(self, quantity)
        return self._pairs[quantity].find(differences, seconds)


@dataclass(eq=False)
class _Pairs:
    """Pairs of the textbook's mistakes: at two links their changes add up, at one link they are derived together."""

    tables: Variants
    quantity: str
    found: dict[Key, tuple[Variant, Variant]] = field(default_factory=dict)

    def find(self, differences: Differences, seconds: float) -> tuple[Variant, Variant] | None:
        return self._summed(differences) or self._derived(differences, seconds)

    def _summed(self, differences: Differences) -> tuple[Variant, Variant] | None:
        """Look up what a mistake leaves of the difference."""
        for whole in list(self.tables._wholes[self.quantity].values()):
            first = whole[0]
            if not _is_textbook(first):
                continue
            change = self.tables.change(first, self.quantity)
            rest = {place: element - change[_place(self.quantity, place)] for place, element in differences.items()}
            for second in self.tables.whole(self.quantity, rest):
                if _is_textbook(second) and self._together(first, second, differences):
                    return first, second
        return None

    def _together(self, first: Variant, second: Variant, differences: Differences) -> bool:
        return self._both(first, second) == _keys(self.quantity, differences)

    def _both(self, first: Variant, second: Variant) -> Key:
        """Derive with two mistakes, and return what both change together."""
        truth, judged, names = self.tables.truth, _judged(self.quantity), {first.name, second.name}
        array: Elements
        if self.quantity in DYNAMICS:
            array = element_array(getattr(derive(truth.description, names), judged))
        else:
            array = kinematic_quantity(derive_kinematics(truth.description, names), judged)
        change = element_array(truth.coordinates.in_y(judged, array) - truth.of(judged))
        change = self.tables.in_numbers(self.quantity, change)
        return tuple(_key(self.quantity, element) for element in element_array(change).flat)

    @cached_property
    def _todo(self) -> Iterator[tuple[Variant, Variant]]:
        textbook = [whole[0] for whole in self.tables._wholes[self.quantity].values() if _is_textbook(whole[0])]
        additive = self.quantity in DYNAMICS
        return ((a, b) for a, b in combinations(textbook, 2) if not (additive and _apart(a, b)))

    def _derived(self, differences: Differences, seconds: float) -> tuple[Variant, Variant] | None:
        wanted, until = _keys(self.quantity, differences), time.monotonic() + seconds
        while wanted not in self.found and time.monotonic() < until:
            pair = next(self._todo, None)
            if pair is None:
                break
            self.found.setdefault(self._both(*pair), pair)
        return self.found.get(wanted)


@lru_cache(maxsize=32)
def variants_of(truth: Truth, numbers: frozenset[str] = frozenset()) -> Variants:
    """Return a robot's variants; the same object each time, so that nothing is derived twice."""
    return Variants(truth, numbers)


def _judged(quantity: str) -> str:
    """Return what a quantity is judged by: C by C qd."""
    return "h" if quantity == "C" else quantity


def _place(quantity: str, index: Index) -> Index:
    return index[:1] if quantity == "C" else index


def _keys(quantity: str, differences: Differences) -> Key:
    """Return the normal forms of a quantity's differences, of C's row by row."""
    rows = {_place(quantity, index): element for index, element in sorted(differences.items())}
    return tuple(_key(quantity, element) for element in rows.values())


def _key(quantity: str, element: Element) -> Any:
    """Return a normal form to be looked up by; of energies without what does not depend on the state."""
    terms = element.terms
    if quantity in ("V", "L"):
        constant = [g.kind == "constant" for g in element.ring.generators]
        terms = {m: c for m, c in terms.items() if any(e and not is_it for e, is_it in zip(m, constant, strict=True))}
    return frozenset(terms.items())


def _is_textbook(variant: Variant) -> bool:
    return variant.name.partition("@")[0] in TEXTBOOK


def _apart(a: Variant, b: Variant) -> bool:
    """Whether two mistakes are at different links, so that their changes add up."""
    return "@" in a.name and "@" in b.name and a.name.partition("@")[2] != b.name.partition("@")[2]
