"""Explanation of wrong answers: the mistakes that give them, or a description of their terms.

Mistakes that an answer shows by itself (``plain_causes.py``) come first. Then come mistakes that leave the sheet's
right answers right, in the order of how many quantities they explain and how frequent they are: mistakes of a
derivation, slips in single terms, changed parameters, pairs of mistakes. Entries that nothing explains are described by
their terms.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from dhkit.grading.catalogue import hint_of
from dhkit.grading.grade_report import Diagnosis, entry_name
from dhkit.grading.judging.findings import Comparison, equal, readable
from dhkit.grading.judging.numeric import doubles, general_state
from dhkit.grading.judging.quantities import Index, JudgedQuantity
from dhkit.grading.judging.rounding import has_decimals
from dhkit.grading.judging.truth import DYNAMICS, Truth
from dhkit.grading.mistakes import entries, plain_causes
from dhkit.grading.mistakes.bounds import BOUNDS
from dhkit.grading.mistakes.diagnosis import Differences
from dhkit.grading.mistakes.plain_causes import tables_of
from dhkit.grading.mistakes.variants import Variant
from dhkit.grading.mistakes.wording import diagnosis_of, diagnosis_of_slip, merge
from dhkit.symbolic.equations import plain_text
from dhkit.symbolic.ring import Element

_PARTS = {
    "M": "in the terms with accelerations",
    "h": "in the terms with products of rates",
    "g": "in the terms of gravity",
    "K": "in the kinetic energy",
    "V": "in the potential energy",
}
"""Parts of tau and of L in words, by the quantities to which they belong."""
_MAX_ENTRIES_ALONE = 2
"""Largest number of entries of which a sentence says that the mistake was made in them alone."""
_MAX_LIKELY_RARITY = 1
"""Largest rarity of mistakes that are tried before slips in single terms."""
_MIN_PAIR_TERMS = 3
"""Smallest number of differing terms for which pairs of mistakes are tried: with fewer terms a slip is likelier."""


def explain(
    truth: Truth,
    judged: Mapping[str, JudgedQuantity],
    digits: int = 4,
    follows: Mapping[str, Mapping[Index, str]] | None = None,
) -> list[Diagnosis]:
    """Return the diagnoses of wrong quantities; quantities that one mistake explains share a diagnosis.

    Parameters
    ----------
    truth
        The right answers.
    judged
        Quantities by name.
    digits
        Number of significant digits from which a decimal may have been rounded.
    follows
        Wrong entries of each quantity that follow from other wrong answers of the sheet, and are right in themselves.
    """
    left = {name: quantity for name, quantity in judged.items() if quantity.wrong}
    diagnoses: list[Diagnosis] = []

    # Quantities whose wrong entries all follow from other wrong answers.
    following: set[str] = set()
    for name, quantity in left.items():
        explained_entries = (follows or {}).get(name, {})
        if all(index in explained_entries for index in quantity.wrong_indices):
            following.add(name)

    # Mistakes that the answer shows by itself.
    _move(left, diagnoses, plain_causes.in_degrees(truth, left))
    _move(left, diagnoses, plain_causes.with_inverted_gears(truth, left))
    diagnoses += plain_causes.weights_on_vertical_axes(truth, left, following)
    diagnoses += plain_causes.one_entry_of_C(truth, left, following)
    _move(left, diagnoses, plain_causes.zeros(truth, left, following))
    _move(left, diagnoses, plain_causes.without_rates(left, following))
    _move(left, diagnoses, plain_causes.in_other_units(truth, left))

    # Single mistakes that explain whole quantities: first likely ones, then those that explain several quantities. One
    # that explains only answers which follow from wrong ones is not the sheet's first error.
    for allowed in (_is_likely, _explains_several):
        single = _single(truth, judged, left, allowed)
        _move(
            left,
            diagnoses,
            {names: one for names, one in single.items() if not following.issuperset(names)},
        )
    _move(left, diagnoses, _nearly(truth, left, digits))
    for name in following & left.keys():
        del left[name]

    # Quantities one by one, then entries one by one.
    for explained in (plain_causes.too_few_digits, _slips, _rare, _whole_factor, _parts, _pair):
        for name, quantity in list(left.items()):
            own = explained(truth, judged, quantity)
            if own:
                diagnoses += own
                del left[name]
    for quantity in left.values():
        diagnoses += _entries(truth, quantity)
    return merge(diagnoses)


def _move(
    left: dict[str, JudgedQuantity],
    diagnoses: list[Diagnosis],
    explained: Mapping[tuple[str, ...], Diagnosis],
) -> None:
    """Append diagnoses, and remove the quantities that they explain, by whose names they are, from ``left``."""
    for names, diagnosis in explained.items():
        diagnoses.append(diagnosis)
        for name in names:
            left.pop(name, None)


def _is_likely(names: tuple[str, ...], rarity: int) -> bool:
    return rarity <= _MAX_LIKELY_RARITY


def _is_rare(names: tuple[str, ...], rarity: int) -> bool:
    return rarity > _MAX_LIKELY_RARITY


def _explains_several(names: tuple[str, ...], rarity: int) -> bool:
    return len(names) > 1


# Mistakes that explain whole quantities


def _single(
    truth: Truth,
    judged: Mapping[str, JudgedQuantity],
    wrong: Mapping[str, JudgedQuantity],
    allowed: Callable[[tuple[str, ...], int], bool],
) -> dict[tuple[str, ...], Diagnosis]:
    """Return the diagnoses of mistakes that explain whole quantities, as many as possible each, by their names.

    No right answer contradicts these mistakes; ``allowed`` says of the names of quantities and the rarity of a mistake
    whether it is returned.
    """
    candidates: dict[str, list[Variant]] = {}
    for name, quantity in wrong.items():
        differences = quantity.differences
        if differences:
            whole = tables_of(truth, quantity).whole(name, differences)
            candidates[name] = [
                variant for variant in whole if not _contradicted(truth, judged, variant)
            ]

    diagnoses: dict[tuple[str, ...], Diagnosis] = {}
    for names, variants in _fewest(candidates).items():
        if allowed(names, variants[0].rarity):
            diagnoses[names] = diagnosis_of(variants, [wrong[name] for name in names])
    return diagnoses


def _contradicted(truth: Truth, judged: Mapping[str, JudgedQuantity], variant: Variant) -> bool:
    """Whether the sheet has a right answer that a mistake would have changed."""
    for name, quantity in judged.items():
        right = [index for index, finding in quantity.findings.items() if finding.verdict.passes]
        if quantity.wrong or not right or (name in DYNAMICS) == variant.is_kinematic:
            continue
        if not tables_of(truth, quantity).changes_none(variant, name, right):
            return True
    return False


def _fewest(candidates: Mapping[Any, list[Variant]]) -> dict[tuple[Any, ...], list[Variant]]:
    """Return a small set of mistakes that explains as much as possible, chosen greedily.

    Each mistake is the first in a list of those that explain the same names, which are the key of the list.
    """
    left = dict(candidates)
    chosen: dict[tuple[Any, ...], list[Variant]] = {}
    while any(left.values()):
        # Names that each mistake explains, and the mistake itself, by its identity and place.
        explains: dict[tuple[str, str], list[Any]] = {}
        listed: dict[tuple[str, str], Variant] = {}
        for name, variants in left.items():
            for variant in variants:
                key = (variant.identity, variant.place)
                explained = explains.setdefault(key, [])
                if name not in explained:  # a mistake may be made in several ways
                    explained.append(name)
                listed.setdefault(key, variant)

        # Most names first, then the more frequent mistake.
        rank = {key: (-len(explains[key]), variant.rarity) for key, variant in listed.items()}
        ranked = sorted(listed, key=rank.__getitem__)
        names = explains[ranked[0]]
        chosen[tuple(names)] = [listed[key] for key in ranked if explains[key] == names]
        left = {name: variants for name, variants in left.items() if name not in names}
    return chosen


def _nearly(
    truth: Truth, wrong: Mapping[str, JudgedQuantity], digits: int
) -> dict[tuple[str, ...], Diagnosis]:
    """Return the diagnoses of mistakes that explain quotients, and answers with rounded decimals, by quantities."""
    diagnoses: dict[tuple[str, ...], Diagnosis] = {}
    for name, quantity in wrong.items():
        given = [entry for entry in quantity.given if entry.tree is not None]
        is_in_ring = all(quantity.findings[entry.index].answer is not None for entry in given)
        is_rounded = any(
            entry.tree is not None and has_decimals(entry.tree, digits) for entry in given
        )
        if (
            name in ("C", "V", "L")
            or not is_in_ring
            or not (is_rounded or quantity.differences is None)
        ):
            continue
        by = Comparison(truth.arm(name), truth.reader(name), digits)
        likely = tables_of(truth, quantity).near(name, quantity.truth, _numbers(truth, quantity))
        variants = [variant for variant in likely if _explains_answer(truth, variant, quantity, by)]
        if variants:
            diagnoses[(name,)] = diagnosis_of(variants, [quantity])
    return diagnoses


def _numbers(truth: Truth, quantity: JudgedQuantity) -> Mapping[Index, float]:
    """Return an answer's values at the state that :meth:`Variants.near` uses, SI units."""
    arm = truth.arm(quantity.name)
    values = {**arm.description.numbers.values, **general_state(arm.n)}
    return {
        entry.index: float(doubles(entry.tree, values))
        for entry in quantity.given
        if entry.tree is not None
    }


def _explains_answer(
    truth: Truth, variant: Variant, quantity: JudgedQuantity, by: Comparison
) -> bool:
    """Whether a mistake gives an answer exactly, or within the rounding of its decimals."""
    change = tables_of(truth, quantity).change(variant, quantity.name)
    return all(
        equal(entry.tree, quantity.truth[entry.index] + change[entry.index], by)
        for entry in quantity.given
        if entry.tree is not None
    )


# Slips in single terms


def _slips(
    truth: Truth, judged: Mapping[str, JudgedQuantity], quantity: JudgedQuantity
) -> list[Diagnosis]:
    """Return the diagnoses of one slip in a term of each wrong entry; none if an entry has no slip."""
    slip_of = entries.slip_of_C if quantity.name == "C" else entries.slip_of
    diagnoses: list[Diagnosis] = []
    for index in entries.distinct(quantity):
        slip = slip_of(truth, quantity, index)
        if (
            slip is None
            or entries.mirrored(quantity, index)
            or entries.whole_factor(quantity, index)
        ):
            return []
        diagnoses.append(diagnosis_of_slip(quantity, index, slip))

    # One rare mistake is likelier than several different slips.
    if len({one.sentence for one in diagnoses}) > 1:
        rare = _rare(truth, judged, quantity)
        if rare:
            return rare
    return [replace(one, equivalent=plain_causes.equivalent(truth, quantity)) for one in diagnoses]


# Rarer mistakes


def _rare(
    truth: Truth, judged: Mapping[str, JudgedQuantity], quantity: JudgedQuantity
) -> list[Diagnosis]:
    """Return the diagnoses of single mistakes that are possible, but rare."""
    found = _single(truth, judged, {quantity.name: quantity}, _is_rare)
    return list(found.values())


def _whole_factor(
    truth: Truth, judged: Mapping[str, JudgedQuantity], quantity: JudgedQuantity
) -> list[Diagnosis]:
    """Return the diagnoses of a factor that all wrong entries share; none if they share none."""
    wrong = entries.distinct(quantity)
    if any(entries.mirrored(quantity, index) for index in wrong):
        return []
    factors: list[Diagnosis] = []
    for index in wrong:
        factor = entries.whole_factor(quantity, index)
        if factor is not None:
            factors.append(factor)
    is_shared = len(factors) == len(wrong) and len({one.mistake for one in factors}) == 1
    return factors if is_shared else []


def _parts(
    truth: Truth, judged: Mapping[str, JudgedQuantity], quantity: JudgedQuantity
) -> list[Diagnosis]:
    """Explain torques and the Lagrangian by parts: terms with accelerations, with products of rates, with neither."""
    differences = quantity.differences
    if quantity.name not in ("tau", "L") or not differences:
        return []
    tables = tables_of(truth, quantity)
    split = _split_in_parts(truth, quantity.name, differences)
    wrong: dict[str, Differences] = {}
    right: dict[str, Differences] = {}
    for part, whole in split.items():
        is_right = all(difference.is_zero for difference in whole.values())
        (right if is_right else wrong)[part] = whole

    def leaves_right_parts(variant: Variant) -> bool:
        unchanged = [
            tables.changes_none(variant, part, list(whole)) for part, whole in right.items()
        ]
        return all(unchanged)

    candidates: dict[str, list[Variant]] = {}
    for part, whole in wrong.items():
        candidates[part] = [
            variant for variant in tables.whole(part, whole) if leaves_right_parts(variant)
        ]
    explained = _fewest(candidates)
    diagnoses = [diagnosis_of(variants, [quantity]) for variants in explained.values()]
    if not diagnoses and not right:
        return []

    for part, whole in wrong.items():
        if not any(part in names for names in explained):
            diagnoses += _part_entries(truth, quantity, part, whole)
    return diagnoses


def _part_entries(
    truth: Truth, quantity: JudgedQuantity, part: str, whole: Differences
) -> list[Diagnosis]:
    """Explain the entries of a part one by one."""
    diagnoses = []
    for index, difference in whole.items():
        if difference.is_zero:
            continue
        place = index[: len(quantity.truth.shape)]
        entry = entry_name(quantity.name, place)
        right = truth.of(part)[index]
        slip = entries.slip_between(truth, part, right + difference, right)
        if slip is not None:
            diagnoses.append(diagnosis_of_slip(quantity, place, slip))
            continue
        difference = truth.coordinates.in_student_rates(difference)
        excess = entries.in_student_angles(
            truth, plain_text(readable(truth.arm(quantity.name), difference))
        )
        diagnoses.append(
            Diagnosis(None, f"Too much {_PARTS[part]}: {excess}.", entry, (entry,), hint_of(None))
        )
    return diagnoses


def _pair(
    truth: Truth, judged: Mapping[str, JudgedQuantity], quantity: JudgedQuantity
) -> list[Diagnosis]:
    """Return the diagnoses of two mistakes of a derivation that together explain a quantity; none if no two do."""
    differences = quantity.differences
    terms = sum(map(len, differences.values())) if differences else 0
    if not differences or not _MIN_PAIR_TERMS <= terms <= BOUNDS.pair_terms:
        return []
    pair = tables_of(truth, quantity).pair(quantity.name, differences)
    if pair is None or any(_contradicted(truth, judged, variant) for variant in pair):
        return []
    return [diagnosis_of([variant], [quantity]) for variant in pair]


def _split_in_parts(truth: Truth, name: str, differences: Differences) -> Mapping[str, Differences]:
    """Return the differences of tau or L, split by the factors of terms: accelerations, products of rates, or neither.

    Parts of tau are M, whose entries are the coefficients of accelerations, h and g; parts of L are K and V.
    """
    ring = next(iter(differences.values())).ring
    n = ring.n
    accelerations = [ring.place("acceleration", i) for i in range(n)]
    rates = [ring.place("rate", i) for i in range(n)]
    names = ("M", "h", "g") if name == "tau" else ("K", "V")
    parts: dict[str, dict[Index, Element]] = {part: {} for part in names}
    for index, element in differences.items():
        moving = {}
        resting = {}
        for monomial, coefficient in element.terms.items():
            if any(monomial[k] for k in rates):
                moving[monomial] = coefficient
            elif not any(monomial[k] for k in accelerations):
                resting[monomial] = coefficient
        if name == "L":
            # L = K - V
            parts["K"][index] = ring.from_terms(moving)
            parts["V"][index] = -ring.from_terms(resting)
            continue

        # tau_i = sum over j of M_ij ydd_j + h_i + g_i, where qdd = B ydd
        parts["h"][index] = ring.from_terms(moving)
        parts["g"][index] = ring.from_terms(resting)
        by_joint = [_coefficient(element, k) for k in accelerations]
        for j in range(n):
            parts["M"][*index, j] = ring.sum(
                by_joint[k] * int(truth.coordinates.B[k, j]) for k in range(n)
            )
    return parts


def _coefficient(element: Element, place: int) -> Element:
    """Return the coefficient of the acceleration at a place of the ring's generators."""
    terms = {(*m[:place], 0, *m[place + 1 :]): c for m, c in element.terms.items() if m[place] == 1}
    return element.ring.from_terms(terms)


# Entry by entry


def _entries(truth: Truth, quantity: JudgedQuantity) -> list[Diagnosis]:
    """Explain wrong entries one by one; entries that one mistake explains share a diagnosis."""
    diagnoses: list[Diagnosis] = []
    candidates: dict[Index, list[Variant]] = {}
    for index in entries.distinct(quantity):
        plain = entries.mirrored(quantity, index) or entries.whole_factor(quantity, index)
        slip = None if plain else entries.slip_of(truth, quantity, index)
        difference = quantity.findings[index].difference
        if plain is not None:
            diagnoses.append(plain)
        elif slip is not None:
            diagnoses.append(diagnosis_of_slip(quantity, index, slip))
        else:
            tables = tables_of(truth, quantity)
            candidates[index] = (
                tables.entry(quantity.name, index, difference) if difference is not None else []
            )

    # A single entry proves little: many entries of transforms look alike, and so do those of a confused answer.
    certain = quantity.name in DYNAMICS and all(candidates.values())
    for indices, variants in _fewest(candidates).items():
        if len(indices) == 1 and not certain:
            continue
        diagnosis = diagnosis_of(variants, [quantity], indices)
        if len(diagnosis.entries) <= _MAX_ENTRIES_ALONE:
            alone = f"{diagnosis.sentence[:-1]}, in {' and '.join(diagnosis.entries)} alone."
            diagnosis = replace(diagnosis, sentence=alone)
        diagnoses.append(diagnosis)
        candidates = {index: found for index, found in candidates.items() if index not in indices}
    return diagnoses + [entries.described(truth, quantity, index) for index in candidates]
