"""From wrong answers to sentences: which mistakes give them, or what their terms show.

First what an answer shows by itself (``plain_causes.py``). Then mistakes that leave the sheet's right answers right,
those first that explain most quantities and that are made more often: mistakes of a derivation, slips in single terms,
changed parameters, pairs of mistakes. What nothing explains is described by its terms.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from dhkit.grading.judging.findings import Comparison, equal, readable
from dhkit.grading.judging.numeric import doubles, general_state
from dhkit.grading.judging.quantities import JudgedQuantity
from dhkit.grading.judging.quotients import Reading
from dhkit.grading.judging.rounding import has_decimals
from dhkit.grading.judging.truth import DYNAMICS, Truth
from dhkit.grading.mistakes.diagnosis import Differences, Index
from dhkit.grading.mistakes.entries import (
    described,
    distinct,
    in_own_angles,
    mirrored,
    slip_of,
    slip_of_C,
    slip_shown,
    whole_factor,
)
from dhkit.grading.mistakes.library import hint_of
from dhkit.grading.mistakes.parts import split_in_parts
from dhkit.grading.mistakes.plain_causes import (
    equivalent,
    in_degrees,
    in_other_units,
    one_entry_of_C,
    tables_of,
    too_few_digits,
    weights_on_vertical_axes,
    with_inverted_gears,
    zeros,
)
from dhkit.grading.mistakes.variants import Variant
from dhkit.grading.mistakes.wording import (
    diagnosis_of,
    diagnosis_of_slip,
    entry_names,
    merged,
    wrong_entries,
)
from dhkit.grading.report import Diagnosis
from dhkit.symbolic.equations import plain_text

PARTS = {
    "M": "in the terms with accelerations",
    "h": "in the terms with products of rates",
    "g": "in the terms of gravity",
    "K": "in the kinetic energy",
    "V": "in the potential energy",
}
FEW_ENTRIES = 2
"""Entries that a sentence says a mistake is made in alone."""
LIKELY = 1
"""The largest rarity of a mistake that is named before slips in single terms are looked for."""
LEAST_TERMS_OF_A_PAIR, MOST_TERMS_OF_A_PAIR = 3, 600
"""Terms in which an answer differs: of fewer a slip is likelier than two mistakes at once, of more it is not worth the
search."""


def explain(
    truth: Truth,
    judged: Mapping[str, JudgedQuantity],
    digits: int = 4,
    follows: Mapping[str, Mapping[Index, str]] | None = None,
) -> list[Diagnosis]:
    """Return what went wrong in quantities, those that one mistake explains together.

    Parameters
    ----------
    truth
        The right answers.
    judged
        Quantities by name.
    digits
        Significant digits from which a decimal may have been rounded.
    follows
        Of each quantity the wrong entries that follow from other answers of the sheet: nothing else is wrong in them.
    """
    left = {name: quantity for name, quantity in judged.items() if quantity.wrong}
    found: list[Diagnosis] = []
    following = {
        name for name in left if all(index in (follows or {}).get(name, {}) for index in wrong_entries(left[name]))
    }
    _take(left, found, in_degrees(truth, left))
    _take(left, found, with_inverted_gears(truth, left))
    found += weights_on_vertical_axes(truth, left, following)
    found += one_entry_of_C(truth, left, following)
    _take(left, found, zeros(truth, left, following))
    _take(left, found, in_other_units(truth, left))
    # What only explains answers that follow from other wrong ones is not where the sheet went wrong.
    for allowed in (lambda names, rarity: rarity <= LIKELY, lambda names, rarity: len(names) > 1):
        single = _single(truth, judged, left, allowed)
        _take(left, found, {names: one for names, one in single.items() if not following.issuperset(names)})
    _take(left, found, _nearly(truth, left, digits))
    for name in following & left.keys():
        del left[name]
    for explained in (too_few_digits, _slips, _rare, _whole_factor, _parts, _pair):
        for name, quantity in list(left.items()):
            diagnoses = explained(truth, judged, quantity)
            if diagnoses:
                found += diagnoses
                del left[name]
    for quantity in left.values():
        found += _entries(truth, quantity)
    return merged(found)


def _take(
    left: dict[str, JudgedQuantity], found: list[Diagnosis], explained: Mapping[tuple[str, ...], Diagnosis]
) -> None:
    for names, diagnosis in explained.items():
        found.append(diagnosis)
        for name in names:
            left.pop(name, None)


# Mistakes that explain whole quantities


def _single(
    truth: Truth,
    judged: Mapping[str, JudgedQuantity],
    wrong: Mapping[str, JudgedQuantity],
    allowed: Callable[[tuple[str, ...], int], bool],
) -> dict[tuple[str, ...], Diagnosis]:
    """Find mistakes that explain quantities entirely, each as many of them as it can, and that no right one denies."""
    candidates: dict[str, list[Variant]] = {}
    for name, quantity in wrong.items():
        differences = quantity.differences
        if differences:
            whole = tables_of(truth, quantity).whole(name, differences)
            candidates[name] = [variant for variant in whole if not _contradicted(truth, judged, variant)]
    ranked = _greedily(candidates)
    return {
        names: diagnosis_of(variants, [wrong[name] for name in names])
        for names, variants in ranked.items()
        if allowed(names, variants[0].rarity)
    }


def _contradicted(truth: Truth, judged: Mapping[str, JudgedQuantity], variant: Variant) -> bool:
    """Whether a quantity is right on the sheet that a mistake would have changed."""
    for name, quantity in judged.items():
        right = [index for index, finding in quantity.findings.items() if finding.verdict.passes]
        if quantity.wrong or not right or (name in DYNAMICS) == variant.is_kinematic:
            continue
        if not tables_of(truth, quantity).changes_none(variant, name, right):
            return True
    return False


def _greedily(candidates: Mapping[Any, list[Variant]]) -> dict[tuple[Any, ...], list[Variant]]:
    """Return the fewest mistakes that explain all that can be, each with what it explains and what is equivalent."""
    left, found = dict(candidates), dict[tuple[Any, ...], list[Variant]]()
    while any(left.values()):
        explains: dict[tuple[str, str], list[Any]] = {}
        listed: dict[tuple[str, str], Variant] = {}
        for name, variants in left.items():
            for variant in variants:
                key = (variant.identity, variant.place)
                explained = explains.setdefault(key, [])
                if name not in explained:  # one mistake may be made in several ways
                    explained.append(name)
                listed.setdefault(key, variant)
        ranked = sorted(listed, key=lambda key: (-len(explains[key]), listed[key].rarity))
        names = explains[ranked[0]]
        found[tuple(names)] = [listed[key] for key in ranked if explains[key] == names]
        left = {name: variants for name, variants in left.items() if name not in names}
    return found


def _nearly(truth: Truth, wrong: Mapping[str, JudgedQuantity], digits: int) -> dict[tuple[str, ...], Diagnosis]:
    """Find mistakes that explain quotients, and answers whose decimals were rounded besides."""
    found: dict[tuple[str, ...], Diagnosis] = {}
    for name, quantity in wrong.items():
        there = [entry for entry in quantity.given if entry.tree is not None]
        in_ring = all(quantity.findings[entry.index].answer is not None for entry in there)
        rounded = any(entry.tree is not None and has_decimals(entry.tree, digits) for entry in there)
        if name in ("C", "V", "L") or not in_ring or not (rounded or quantity.differences is None):
            continue
        by = Comparison(truth.arm(name), Reading(truth.arm(name).ring, others=truth.others(name)), digits)
        likely = tables_of(truth, quantity).near(name, quantity.truth, _numbers(truth, quantity))
        variants = [variant for variant in likely if _gives(truth, variant, quantity, by)]
        if variants:
            found[(name,)] = diagnosis_of(variants, [quantity])
    return found


def _numbers(truth: Truth, quantity: JudgedQuantity) -> Mapping[Index, float]:
    """Return an answer's values at the state that :meth:`Variants.near` looks at."""
    arm = truth.arm(quantity.name)
    values = {**arm.description.numbers.values, **general_state(arm.n)}
    return {entry.index: float(doubles(entry.tree, values)) for entry in quantity.given if entry.tree is not None}


def _gives(truth: Truth, variant: Variant, quantity: JudgedQuantity, by: Comparison) -> bool:
    """Whether a mistake gives an answer exactly, or within the rounding of its decimals."""
    change = tables_of(truth, quantity).change(variant, quantity.name)
    return all(
        equal(entry.tree, quantity.truth[entry.index] + change[entry.index], by)
        for entry in quantity.given
        if entry.tree is not None
    )


# Slips in single terms


def _slips(truth: Truth, judged: Mapping[str, JudgedQuantity], quantity: JudgedQuantity) -> list[Diagnosis]:
    """Find the one slip in a term of each wrong entry; nothing where an entry has none."""
    found: list[Diagnosis] = []
    for index in distinct(quantity):
        slip = slip_of_C(truth, quantity, index) if quantity.name == "C" else slip_of(truth, quantity, index)
        if slip is None or mirrored(quantity, index) or whole_factor(quantity, index):
            return []
        found.append(diagnosis_of_slip(quantity, index, slip))
    if len({one.sentence for one in found}) > 1 and (rare := _rare(truth, judged, quantity)):
        return rare
    return [replace(one, equivalent=equivalent(truth, quantity)) for one in found]


# Rarer mistakes


def _rare(truth: Truth, judged: Mapping[str, JudgedQuantity], quantity: JudgedQuantity) -> list[Diagnosis]:
    """Find the single mistakes that are possible, and seldom made."""
    return list(_single(truth, judged, {quantity.name: quantity}, lambda names, rarity: rarity > LIKELY).values())


def _whole_factor(truth: Truth, judged: Mapping[str, JudgedQuantity], quantity: JudgedQuantity) -> list[Diagnosis]:
    """Find a factor that all entries, all of them wrong, share."""
    wrong = distinct(quantity)
    if any(mirrored(quantity, index) for index in wrong):
        return []
    found = [whole_factor(quantity, index) for index in wrong]
    names = {one.mistake for one in found if one is not None}
    if None in found or len(names) != 1:
        return []
    return [one for one in found if one is not None]


def _parts(truth: Truth, judged: Mapping[str, JudgedQuantity], quantity: JudgedQuantity) -> list[Diagnosis]:
    """Explain torques, and the Lagrangian, part by part: those of accelerations, of rates, and of neither."""
    differences = quantity.differences
    if quantity.name not in ("tau", "L") or not differences:
        return []
    tables = tables_of(truth, quantity)
    split = split_in_parts(truth, quantity.name, differences)
    parts = {part: whole for part, whole in split.items() if not all(x.is_zero for x in whole.values())}
    right = {part: whole for part, whole in split.items() if part not in parts}

    def leaves_the_rest(variant: Variant) -> int:
        return sum(not tables.changes_none(variant, part, list(whole)) for part, whole in right.items())

    candidates = {
        part: [variant for variant in tables.whole(part, whole) if not leaves_the_rest(variant)]
        for part, whole in parts.items()
    }
    explained = _greedily(candidates)
    found = [diagnosis_of(variants, [quantity]) for variants in explained.values()]
    left = [part for part in parts if not any(part in names for names in explained)]
    if not found and len(parts) == len(split):
        return []
    for part in left:
        found += _part_entries(truth, quantity, part, parts[part])
    return found


def _part_entries(truth: Truth, quantity: JudgedQuantity, part: str, whole: Differences) -> list[Diagnosis]:
    """Explain a part's entries one by one."""
    found = []
    for index, difference in whole.items():
        if difference.is_zero:
            continue
        place = index[: len(quantity.truth.shape)]
        (entry,) = entry_names(quantity, [place])
        right = truth.of(part)[index]
        slip = slip_shown(truth, part, right + difference, right)
        if slip is not None:
            found.append(diagnosis_of_slip(quantity, place, slip))
            continue
        difference = truth.coordinates.in_own_rates(difference)
        excess = in_own_angles(truth, plain_text(readable(truth.arm(quantity.name), difference)))
        found.append(Diagnosis(None, f"Too much {PARTS[part]}: {excess}.", entry, (entry,), hint_of(None)))
    return found


def _pair(truth: Truth, judged: Mapping[str, JudgedQuantity], quantity: JudgedQuantity) -> list[Diagnosis]:
    """Find two of a derivation's mistakes that together explain what no single one does."""
    differences = quantity.differences
    terms = sum(map(len, differences.values())) if differences else 0
    if not differences or not LEAST_TERMS_OF_A_PAIR <= terms <= MOST_TERMS_OF_A_PAIR:
        return []
    pair = tables_of(truth, quantity).pair(quantity.name, differences)
    if pair is None or any(_contradicted(truth, judged, variant) for variant in pair):
        return []
    return [diagnosis_of([variant], [quantity]) for variant in pair]


# Entry by entry


def _entries(truth: Truth, quantity: JudgedQuantity) -> list[Diagnosis]:
    """Explain wrong entries one by one; those that one mistake explains go together."""
    found: list[Diagnosis] = []
    candidates: dict[Index, list[Variant]] = {}
    for index in distinct(quantity):
        plain = mirrored(quantity, index) or whole_factor(quantity, index)
        slip = None if plain else slip_of(truth, quantity, index)
        difference = quantity.findings[index].difference
        if plain is not None:
            found.append(plain)
        elif slip is not None:
            found.append(diagnosis_of_slip(quantity, index, slip))
        elif difference is not None:
            candidates[index] = tables_of(truth, quantity).entry(quantity.name, index, difference)
        else:
            candidates[index] = []
    # One entry alone proves little: of transforms' entries many look alike, and so do those of a muddle.
    certain = quantity.name in DYNAMICS and all(candidates.values())
    for indices, variants in _greedily(candidates).items():
        if len(indices) == 1 and not certain:
            continue
        diagnosis = diagnosis_of(variants, [quantity], indices)
        few = len(diagnosis.entries) <= FEW_ENTRIES
        alone = f"{diagnosis.sentence[:-1]}, in {' and '.join(diagnosis.entries)} alone."
        found.append(replace(diagnosis, sentence=alone) if few else diagnosis)
        candidates = {index: v for index, v in candidates.items() if index not in indices}
    return found + [described(truth, quantity, index) for index in candidates]
