"""Which mistakes give exactly a student's answers: differences from the truth, looked up by their normal forms."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache, partial
from itertools import combinations
from typing import Any, TypeAlias

import numpy as np

from dhkit.description import Array
from dhkit.grading.judging.numeric import general_state, state_arrays
from dhkit.grading.judging.truth import DYNAMICS, Truth, exact_number, kinematic_quantity, substituted
from dhkit.grading.mistakes.energy_variants import energy_variants
from dhkit.grading.mistakes.equation_variants import equation_variants, lagrangian_sum
from dhkit.grading.mistakes.parameter_variants import parameter_variants
from dhkit.grading.mistakes.sums_of_angles import derivatives_of_cosines, sums_of_angles
from dhkit.grading.mistakes.variants import Variant
from dhkit.symbolic.mistakes import MISTAKES, MadeAt
from dhkit.symbolic.ring import Element, Elements, element_array
from dhkit.symbolic.textbook import derive
from dhkit.symbolic.textbook_kinematics import (
    JACOBIAN_MISTAKES,
    KINEMATIC_MISTAKES,
    LINK_MISTAKES,
    POSE_MISTAKES,
    TextbookKinematics,
    derive_kinematics,
)

Index: TypeAlias = tuple[int, ...]
Differences: TypeAlias = Mapping[Index, Element]
"""Of a quantity's entries answer less truth, zero where it is right; entries that were not handed in are left out."""
Key: TypeAlias = frozenset[Any]
TEXTBOOK = {*MISTAKES, *KINEMATIC_MISTAKES}
NEAR = 2e-3
"""Share of the largest entry: decimals of four digits are off by less."""
MAX_DERIVED_PAIRS = 150
"""Pairs of mistakes at one link that are derived for a quantity: their effects do not add up."""


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
        self._changes: dict[str, list[_Changed]] = {}
        self._by_entry: dict[str, dict[tuple[Index, Key], list[_Changed]]] = {}
        self._pairs: dict[str, _Pairs] = {}
        self._values: dict[str, list[Array]] = {}

    @cached_property
    def dynamic(self) -> list[Variant]:
        """The mistakes that there are in the robot's equations, the least rare first."""
        found = [
            lagrangian_sum(self.truth),
            *energy_variants(self.truth),
            *equation_variants(self.truth),
            *parameter_variants(self.truth),
        ]
        return sorted(found, key=lambda variant: variant.rarity)

    @cached_property
    def kinematic(self) -> list[Variant]:
        """The mistakes that there are in the robot's transforms and Jacobian."""
        n, truth = self.truth.description.n, self.truth
        # Those of the Jacobian first: of it alone they are likelier than one in the transforms behind it.
        names = [*JACOBIAN_MISTAKES, *LINK_MISTAKES, *POSE_MISTAKES]
        made = [(MadeAt(name), "") for name in names]
        if n > 1:
            made += [(MadeAt(name, i), f"link {i}") for name in LINK_MISTAKES for i in range(1, n + 1)]
        right = partial(kinematic_quantity, truth.kinematics)
        return [
            derivatives_of_cosines(truth),
            *(Variant(at, _KinematicChange(truth, at), place, is_kinematic=True) for at, place in made),
            *sums_of_angles(truth.kinematics.arm, right, is_kinematic=True),
        ]

    def change(self, variant: Variant, quantity: str) -> Elements:
        """Return what a mistake adds to a quantity, with numbers in place of parameters."""
        return self.in_numbers(quantity, variant.adds_to(judged_by(quantity), self.truth.coordinates))

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
        if quantity in self._changes:
            return
        changes: list[_Changed] = []
        by_entry: dict[tuple[Index, Key], list[_Changed]] = {}
        for variant in self.dynamic if quantity in DYNAMICS else self.kinematic:
            keys = {place: key_of(quantity, x) for place, x in np.ndenumerate(self.change(variant, quantity))}
            if not any(keys.values()):
                continue
            changed = _Changed(variant, keys)
            changes.append(changed)
            for place, key in keys.items():
                if key:
                    by_entry.setdefault((place, key), []).append(changed)
        self._changes[quantity], self._by_entry[quantity] = changes, by_entry

    def whole(self, quantity: str, differences: Differences) -> list[Variant]:
        """Return the mistakes that change the entries of a quantity that are there exactly so."""
        self.prepare(quantity)
        wanted = keys_of(quantity, differences)
        wrong = [(place, key) for place, key in wanted.items() if key]
        if not wrong:
            return []
        candidates = min((self._by_entry[quantity].get(one, []) for one in wrong), key=len)
        return [
            changed.variant
            for changed in candidates
            if all(changed.keys[place] == key for place, key in wanted.items())
        ]

    def changes_none(self, variant: Variant, quantity: str, places: Sequence[Index]) -> bool:
        """Whether a mistake leaves entries as they are."""
        change = self.change(variant, quantity)
        return all(not key_of(quantity, change[place]) for place in {place_of(quantity, index) for index in places})

    def entry(self, quantity: str, index: Index, difference: Element) -> list[Variant]:
        """Return the mistakes that change an entry exactly so."""
        self.prepare(quantity)
        found = self._by_entry[quantity].get((place_of(quantity, index), key_of(quantity, difference)), [])
        return [changed.variant for changed in found]

    def near(self, quantity: str, truth: Elements, answer: Mapping[Index, float]) -> list[Variant]:
        """Return the mistakes whose results are near an answer in one state: those worth an exact look.

        Parameters
        ----------
        quantity
            Which.
        truth
            Its right value.
        answer
            The answer's values at :func:`general_state`, parameters as in the file, of the entries that are there.
        """
        self.prepare(quantity)
        arm = self.truth.arm(quantity)
        q, qd, qdd = state_arrays(general_state(arm.n), arm.n)
        if quantity not in self._values:
            changes = [self.change(changed.variant, quantity) for changed in self._changes[quantity]]
            self._values[quantity] = [arm.evaluate(change, q, qd, qdd) for change in changes]
        here = arm.evaluate(truth, q, qd, qdd)
        tolerance = NEAR * np.max(np.abs(here), initial=0.0)
        return [
            changed.variant
            for changed, values in zip(self._changes[quantity], self._values[quantity], strict=True)
            if all(abs(here[index] + values[index] - value) <= tolerance for index, value in answer.items())
        ]

    def pair(self, quantity: str, differences: Differences) -> tuple[Variant, Variant] | None:
        """Return two of the textbook's mistakes that together change a quantity exactly so."""
        self.prepare(quantity)
        if quantity not in self._pairs:
            self._pairs[quantity] = _Pairs(self, quantity)
        return self._pairs[quantity].find(differences)

    def textbook(self, quantity: str) -> list[Variant]:
        """Return the textbook's mistakes that change a quantity, one of those that change it alike."""
        self.prepare(quantity)
        distinct: dict[tuple[Any, ...], Variant] = {}
        for changed in self._changes[quantity]:
            if changed.variant.identity in TEXTBOOK:
                distinct.setdefault(tuple(changed.keys.items()), changed.variant)
        return list(distinct.values())


@dataclass(frozen=True, eq=False)
class _Changed:
    """A mistake with the normal forms of what it adds to each entry of a quantity; empty where it adds nothing."""

    variant: Variant
    keys: Mapping[Index, Key]


@dataclass(eq=False)
class _KinematicChange:
    """What a mistake adds to A1 ... An, T and J."""

    truth: Truth
    made: MadeAt
    _wrong: TextbookKinematics | None = None

    def __call__(self, quantity: str) -> Elements:
        if self._wrong is None:
            self._wrong = derive_kinematics(self.truth.description, {self.made})
        return kinematic_quantity(self._wrong, quantity) - kinematic_quantity(self.truth.kinematics, quantity)


@dataclass(eq=False)
class _Pairs:
    """Pairs of the textbook's mistakes: at two links their changes add up, at one link they are derived together."""

    tables: Variants
    quantity: str
    found: dict[tuple[Any, ...], tuple[Variant, Variant]] = field(default_factory=dict)
    derived: int = 0

    def find(self, differences: Differences) -> tuple[Variant, Variant] | None:
        wanted = keys_of(self.quantity, differences)
        return self._summed(differences, wanted) or self._derived(wanted)

    def _summed(self, differences: Differences, wanted: Mapping[Index, Key]) -> tuple[Variant, Variant] | None:
        """Look up what a mistake leaves of the difference."""
        for first in self.tables.textbook(self.quantity):
            change = self.tables.change(first, self.quantity)
            rest = {index: x - change[place_of(self.quantity, index)] for index, x in differences.items()}
            for second in self.tables.whole(self.quantity, rest):
                if second.identity in TEXTBOOK and _fits(self._both(first, second), wanted):
                    return first, second
        return None

    def _both(self, first: Variant, second: Variant) -> dict[Index, Key]:
        """Derive with two mistakes, and return what both change together."""
        truth, judged, made = self.tables.truth, judged_by(self.quantity), {first.made, second.made}
        array: Elements
        if self.quantity in DYNAMICS:
            array = element_array(getattr(derive(truth.description, made), judged))
        else:
            array = kinematic_quantity(derive_kinematics(truth.description, made), judged)
        change = element_array(truth.coordinates.in_y(judged, array) - truth.of(judged))
        change = element_array(self.tables.in_numbers(self.quantity, change))
        return {place: key_of(self.quantity, x) for place, x in np.ndenumerate(change)}

    @cached_property
    def _todo(self) -> Iterator[tuple[Variant, Variant]]:
        additive = self.quantity in DYNAMICS
        pairs = combinations(self.tables.textbook(self.quantity), 2)
        return ((a, b) for a, b in pairs if not (additive and _apart(a.made, b.made)))

    def _derived(self, wanted: Mapping[Index, Key]) -> tuple[Variant, Variant] | None:
        for keys, pair in self.found.items():
            if _fits(dict(keys), wanted):
                return pair
        while self.derived < MAX_DERIVED_PAIRS:
            following = next(self._todo, None)
            if following is None:
                break
            self.derived += 1
            keys_of_both = self._both(*following)
            self.found.setdefault(tuple(keys_of_both.items()), following)
            if _fits(keys_of_both, wanted):
                return following
        return None


def variants_of(truth: Truth, numbers: frozenset[str] = frozenset()) -> Variants:
    """Return a robot's variants; the same object each time, so that nothing is derived twice."""
    return _variants_of(truth, numbers)


@lru_cache(maxsize=32)
def _variants_of(truth: Truth, numbers: frozenset[str]) -> Variants:
    return Variants(truth, numbers)


def judged_by(quantity: str) -> str:
    """Return what a quantity is judged by: C by C qd."""
    return "h" if quantity == "C" else quantity


def place_of(quantity: str, index: Index) -> Index:
    """Return where an entry's difference stands in what the quantity is judged by."""
    return index[:1] if quantity == "C" else index


def keys_of(quantity: str, differences: Differences) -> dict[Index, Key]:
    """Return the normal forms of a quantity's differences, of C's row by row."""
    return {place_of(quantity, index): key_of(quantity, element) for index, element in differences.items()}


def key_of(quantity: str, element: Element) -> Key:
    """Return a normal form to be looked up by; of energies without what does not depend on the state."""
    return frozenset((varying(element) if quantity in ("V", "L") else element).terms.items())


def varying(element: Element) -> Element:
    """Return an element without its terms that do not depend on the state."""
    ring = element.ring
    constant = [g.kind == "constant" for g in ring.generators]
    return ring.from_terms(
        {m: c for m, c in element.terms.items() if any(e and not is_it for e, is_it in zip(m, constant, strict=True))}
    )


def _fits(keys: Mapping[Index, Key], wanted: Mapping[Index, Key]) -> bool:
    """Whether a change is what is wanted, of the entries that are there."""
    return all(keys[place] == key for place, key in wanted.items())


def _apart(a: MadeAt, b: MadeAt) -> bool:
    """Whether two mistakes are at different links or bodies, so that their changes add up."""
    bodies = a.body is not None and b.body is not None and a.body != b.body
    return a.link is not None and b.link is not None and (a.link != b.link or bodies)
