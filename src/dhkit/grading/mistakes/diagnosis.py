"""Search for the mistakes that give exactly a student's answers: differences are looked up by their normal forms."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property, lru_cache, partial
from itertools import combinations, islice
from typing import Any, TypeAlias

import numpy as np

from dhkit.description import Array
from dhkit.grading.judging.coordinates import Coordinates
from dhkit.grading.judging.numeric import general_state, state_arrays
from dhkit.grading.judging.quantities import Index, place_of
from dhkit.grading.judging.quotients import varying
from dhkit.grading.judging.truth import DYNAMICS, Truth, kinematic_quantity
from dhkit.grading.mistakes.bounds import BOUNDS
from dhkit.grading.mistakes.energy_variants import energy_variants, table_variants
from dhkit.grading.mistakes.equation_variants import equation_variants, lagrangian_sum
from dhkit.grading.mistakes.parameter_variants import parameter_variants
from dhkit.grading.mistakes.sums_of_angles import derivatives_of_cosines, sums_of_angles
from dhkit.grading.mistakes.variants import Addition, Variant
from dhkit.symbolic.mistakes import MISTAKES, MadeAt
from dhkit.symbolic.ring import Element, Elements, element_array
from dhkit.symbolic.textbook import derive
from dhkit.symbolic.textbook_kinematics import (
    JACOBIAN_MISTAKES,
    KINEMATIC_MISTAKES,
    LINK_MISTAKES,
    POSE_MISTAKES,
    derive_kinematics,
)

Differences: TypeAlias = Mapping[Index, Element]
"""Answer less truth of a quantity's entries, zero for right ones; without entries that were not handed in."""
_Key: TypeAlias = frozenset[Any]
"""Hashable normal form of an element: its terms; empty for zero."""
_TEXTBOOK = {*MISTAKES, *KINEMATIC_MISTAKES}
"""Mistakes that derivations of the textbook can make."""
_ROUNDED_DECIMALS = 2e-3
"""Largest difference of an answer in rounded decimals from the exact one, relative to the largest entry of the right
one: numbers of four decimals, multiplied and added, stay below it."""


@dataclass(frozen=True)
class _Subject:
    """All that the possible mistakes on a robot depend on, which is not the numbers of its parameters.

    Mistakes are derived in the ring whose symbols are the parameters. Arms that differ in their numbers alone, such as
    those of a task's variants, have equal rings and equal derivations: these are shared.

    Attributes
    ----------
    shape
        The fields of the robot's description in which mistakes may be made, without the numbers of its parameters.
    coordinates, friction
        As those of the truth.
    truth
        The truth of one of the arms, from which the mistakes are derived.
    """

    shape: tuple[object, ...]
    coordinates: Coordinates
    friction: bool
    truth: Truth = field(compare=False)

    @classmethod
    def of(cls, truth: Truth) -> _Subject:
        arm = truth.description
        # A parameter that is defined by others is part of the shape; one that is a number is a symbol.
        parameters = tuple(
            (name, value if value.symbols else None) for name, value in arm.parameters.items()
        )
        shape = (
            arm.convention,
            arm.joints,
            parameters,
            arm.gravity,
            arm.base,
            arm.tool,
            arm.couplings,
        )
        return cls(shape, truth.coordinates, truth.friction, truth)


@lru_cache(maxsize=32)
def _mistakes_of(subject: _Subject) -> _Mistakes:
    return _Mistakes(subject.truth)


@dataclass(frozen=True, eq=False)
class _Mistakes:
    """Possible mistakes on all arms that have the symbols of one; none of them has a number of its parameters."""

    truth: Truth

    @cached_property
    def dynamic(self) -> list[Variant]:
        """Possible mistakes in the robot's equations, the most common first."""
        variants = [
            lagrangian_sum(self.truth),
            *energy_variants(self.truth),
            *equation_variants(self.truth),
            *parameter_variants(self.truth),
            *table_variants(self.truth),
        ]
        return sorted(variants, key=lambda variant: variant.rarity)

    @cached_property
    def kinematic(self) -> list[Variant]:
        """Possible mistakes in the robot's transforms and Jacobian."""
        n = self.truth.description.n
        truth = self.truth

        # Mistakes in the Jacobian first: if it alone is wrong, they are likelier than mistakes in the transforms.
        names = [*JACOBIAN_MISTAKES, *LINK_MISTAKES, *POSE_MISTAKES]
        made = [(MadeAt(name), "") for name in names]
        if n > 1:
            for name in LINK_MISTAKES:
                made += [(MadeAt(name, i), f"link {i}") for i in range(1, n + 1)]
        made.append((MadeAt("translations_unrotated", n + 1), "tool"))
        of_derivation = [
            Variant(at, _kinematic_change(truth, at), place, is_kinematic=True)
            for at, place in made
        ]

        right = partial(kinematic_quantity, truth.kinematics)
        return [
            derivatives_of_cosines(truth),
            *of_derivation,
            *_columns_exchanged(truth),
            *sums_of_angles(truth.kinematics.arm, right, is_kinematic=True),
        ]


class Variants:
    """Mistakes on one robot with the changes that they cause; computed quantity by quantity when first asked for.

    Parameters
    ----------
    truth
        The right answers.
    numbers
        Names of the parameters that this student replaced by their numbers in the file.
    """

    def __init__(self, truth: Truth, numbers: frozenset[str]) -> None:
        self.truth = truth
        self.numbers = numbers
        self._changes: dict[str, list[_Changed]] = {}
        self._by_entry: dict[str, dict[tuple[Index, _Key], list[_Changed]]] = {}
        self._pairs: dict[str, _Pairs] = {}
        self._values: dict[str, list[Array]] = {}

    @cached_property
    def _mistakes(self) -> _Mistakes:
        return _mistakes_of(_Subject.of(self.truth))

    @property
    def dynamic(self) -> list[Variant]:
        """Possible mistakes in the robot's equations, the most common first."""
        return self._mistakes.dynamic

    @property
    def kinematic(self) -> list[Variant]:
        """Possible mistakes in the robot's transforms and Jacobian."""
        return self._mistakes.kinematic

    def change(self, variant: Variant, quantity: str) -> Elements:
        """Return the change of a quantity by a mistake, with the file's numbers for the parameters in ``numbers``."""
        change = variant.adds_to(_judged_by(quantity), self.truth.coordinates)
        return self.in_numbers(quantity, change)

    def in_numbers(self, quantity: str, array: Elements) -> Elements:
        """Return elements with the file's numbers instead of the parameters that answers have as numbers."""
        return self.truth.with_numbers(quantity, array, self.numbers) if self.numbers else array

    # Tables

    def prepare(self, quantity: str) -> None:
        """Compute the changes of a quantity by all mistakes."""
        if quantity in self._changes:
            return
        changes: list[_Changed] = []
        by_entry: dict[tuple[Index, _Key], list[_Changed]] = {}
        variants = self.dynamic if quantity in DYNAMICS else self.kinematic
        for variant in variants:
            keys = {
                place: _key_of(quantity, x)
                for place, x in np.ndenumerate(self.change(variant, quantity))
            }
            if not any(keys.values()):
                continue
            changed = _Changed(variant, keys)
            changes.append(changed)
            for place, key in keys.items():
                if key:
                    by_entry.setdefault((place, key), []).append(changed)
        # Stored when complete: a derivation that is too long raises RingError.
        self._changes[quantity] = changes
        self._by_entry[quantity] = by_entry

    def whole(self, quantity: str, differences: Differences) -> list[Variant]:
        """Return the mistakes that cause exactly the differences of all entries that were handed in."""
        self.prepare(quantity)
        wanted = _keys_of(quantity, differences)
        wrong = [(place, key) for place, key in wanted.items() if key]
        if not wrong:
            return []

        # Only mistakes that cause the difference of the entry with the fewest such mistakes are compared.
        candidates = min((self._by_entry[quantity].get(entry, []) for entry in wrong), key=len)
        return [changed.variant for changed in candidates if _fits(changed.keys, wanted)]

    def changes_none(self, variant: Variant, quantity: str, places: Sequence[Index]) -> bool:
        """Whether a mistake leaves some entries of a quantity unchanged."""
        change = self.change(variant, quantity)
        judged_places = {place_of(quantity, index) for index in places}
        return not any(_key_of(quantity, change[place]) for place in judged_places)

    def entry(self, quantity: str, index: Index, difference: Element) -> list[Variant]:
        """Return the mistakes that cause exactly the difference of one entry."""
        self.prepare(quantity)
        key = (place_of(quantity, index), _key_of(quantity, difference))
        return [changed.variant for changed in self._by_entry[quantity].get(key, [])]

    def near(self, quantity: str, truth: Elements, answer: Mapping[Index, float]) -> list[Variant]:
        """Return the mistakes whose results are near an answer at one state, as candidates for an exact comparison.

        Parameters
        ----------
        quantity
            Name of the quantity.
        truth
            Its right value.
        answer
            Values of the entries that were handed in, at :func:`general_state` with the file's parameters, SI units.
        """
        self.prepare(quantity)
        arm = self.truth.arm(quantity)
        q, qd, qdd = state_arrays(general_state(arm.n), arm.n)
        if quantity not in self._values:
            changes = [
                self.change(changed.variant, quantity) for changed in self._changes[quantity]
            ]
            self._values[quantity] = [arm.evaluate(change, q, qd, qdd) for change in changes]
        right = arm.evaluate(truth, q, qd, qdd)
        tolerance = _ROUNDED_DECIMALS * np.max(np.abs(right), initial=0.0)

        near: list[Variant] = []
        for changed, change in zip(self._changes[quantity], self._values[quantity], strict=True):
            wrong = right + change
            if all(abs(wrong[index] - value) <= tolerance for index, value in answer.items()):
                near.append(changed.variant)
        return near

    def pair(self, quantity: str, differences: Differences) -> tuple[Variant, Variant] | None:
        """Return two of the textbook's mistakes that together cause exactly the differences; None if no two do."""
        self.prepare(quantity)
        return self._pairs.setdefault(quantity, _Pairs(self, quantity)).find(differences)

    def textbook(self, quantity: str) -> list[Variant]:
        """Return the textbook's mistakes that change a quantity, one for each different change."""
        self.prepare(quantity)
        distinct: dict[tuple[Any, ...], Variant] = {}
        for changed in self._changes[quantity]:
            if changed.variant.identity in _TEXTBOOK:
                distinct.setdefault(tuple(changed.keys.items()), changed.variant)
        return list(distinct.values())


@dataclass(frozen=True, eq=False)
class _Changed:
    """Mistake with the normal forms of its changes of a quantity's entries, which are empty for unchanged entries."""

    variant: Variant
    keys: Mapping[Index, _Key]


def _kinematic_change(truth: Truth, made: MadeAt) -> Addition:
    """Return the function that gives a mistake's change of A1 ... An, T and J, derived when first called."""
    wrong = cache(lambda: derive_kinematics(truth.description, {made}))
    return lambda quantity: (
        kinematic_quantity(wrong(), quantity) - kinematic_quantity(truth.kinematics, quantity)
    )


def _columns_exchanged(truth: Truth) -> Iterator[Variant]:
    """Yield exchanges of two columns of the Jacobian."""
    for i, j in combinations(range(truth.description.n), 2):
        order = list(range(truth.description.n))
        order[i] = j
        order[j] = i
        change = partial(_with_columns, truth, order)
        yield Variant(
            MadeAt("columns_exchanged"),
            change,
            f"columns {i + 1} and {j + 1}",
            1,
            is_kinematic=True,
        )


def _with_columns(truth: Truth, order: list[int], quantity: str) -> Elements:
    """Return the change of a quantity if the columns of the Jacobian have another order; zero for the transforms."""
    right = kinematic_quantity(truth.kinematics, quantity)
    return right[:, order] - right if quantity == "J" else right * 0


@dataclass(eq=False)
class _Pairs:
    """Pairs of the textbook's mistakes. At two links their changes add up; at one link they are derived together."""

    tables: Variants
    quantity: str
    derived_pairs: dict[tuple[Any, ...], tuple[Variant, Variant]] = field(default_factory=dict)

    def find(self, differences: Differences) -> tuple[Variant, Variant] | None:
        wanted = _keys_of(self.quantity, differences)
        return self._summed(differences, wanted) or self._derived(wanted)

    def _summed(
        self, differences: Differences, wanted: Mapping[Index, _Key]
    ) -> tuple[Variant, Variant] | None:
        """Return a pair whose second mistake explains the differences that the first leaves."""
        for first in self.tables.textbook(self.quantity):
            change = self.tables.change(first, self.quantity)
            rest: dict[Index, Element] = {}
            for index, difference in differences.items():
                rest[index] = difference - change[place_of(self.quantity, index)]
            for second in self.tables.whole(self.quantity, rest):
                if second.identity in _TEXTBOOK and _fits(self._both(first, second), wanted):
                    return first, second
        return None

    def _both(self, first: Variant, second: Variant) -> dict[Index, _Key]:
        """Return the changes by a derivation with both mistakes."""
        truth = self.tables.truth
        judged = _judged_by(self.quantity)
        made = {first.made, second.made}
        array: Elements
        if self.quantity in DYNAMICS:
            array = element_array(getattr(derive(truth.description, made), judged))
        else:
            array = kinematic_quantity(derive_kinematics(truth.description, made), judged)
        change = element_array(truth.coordinates.in_y(judged, array) - truth.of(judged))
        change = element_array(self.tables.in_numbers(self.quantity, change))
        return {place: _key_of(self.quantity, x) for place, x in np.ndenumerate(change)}

    @cached_property
    def _todo(self) -> Iterator[tuple[Variant, Variant]]:
        """Pairs that are not derived yet: those whose changes do not add up."""
        is_additive = self.quantity in DYNAMICS
        pairs = combinations(self.tables.textbook(self.quantity), 2)
        derived = ((a, b) for a, b in pairs if not (is_additive and _apart(a.made, b.made)))
        return islice(derived, BOUNDS.derived_pairs)

    def _derived(self, wanted: Mapping[Index, _Key]) -> tuple[Variant, Variant] | None:
        """Return a pair whose derivation gives the wanted changes; pairs are derived as far as needed."""
        for keys, pair in self.derived_pairs.items():
            if _fits(dict(keys), wanted):
                return pair
        for following in self._todo:
            keys_of_both = self._both(*following)
            self.derived_pairs.setdefault(tuple(keys_of_both.items()), following)
            if _fits(keys_of_both, wanted):
                return following
        return None


@lru_cache(maxsize=32)
# Without a default, which has a key of its own.
def variants_of(truth: Truth, numbers: frozenset[str]) -> Variants:
    """Return the mistakes on a robot; the same object each time, so that nothing is derived twice."""
    return Variants(truth, numbers)


def _judged_by(quantity: str) -> str:
    """Return the quantity that is compared with the truth: h = C qd for C."""
    return "h" if quantity == "C" else quantity


def _keys_of(quantity: str, differences: Differences) -> dict[Index, _Key]:
    """Return the normal forms of a quantity's differences; those of C by rows."""
    return {
        place_of(quantity, index): _key_of(quantity, element)
        for index, element in differences.items()
    }


def _key_of(quantity: str, element: Element) -> _Key:
    """Return the hashable normal form of an element; of an energy without the terms that do not depend on the state."""
    if quantity in ("V", "L"):
        element = varying(element)
    return frozenset(element.terms.items())


def _fits(keys: Mapping[Index, _Key], wanted: Mapping[Index, _Key]) -> bool:
    """Whether the changes of the entries that were handed in are the wanted ones."""
    return all(keys[place] == key for place, key in wanted.items())


def _apart(a: MadeAt, b: MadeAt) -> bool:
    """Whether two mistakes are made at different links or bodies, so that their changes add up."""
    if a.link is None or b.link is None:
        return False
    are_other_bodies = a.body is not None and b.body is not None and a.body != b.body
    return a.link != b.link or are_other_bodies
