"""From wrong answers to sentences: which mistakes give them, or what their terms show.

What explains most quantities comes first, then what leaves the sheet's right answers right, then what is made more
often: mistakes of a derivation, slips in single terms, changed parameters, pairs of mistakes. What nothing explains is
described by its terms.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import Any

from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Name, Number, Product, Tree
from dhkit.grading.capitals import capitalised
from dhkit.grading.judging.changed_formulas import renamed
from dhkit.grading.judging.coordinates import ANGLE
from dhkit.grading.judging.findings import Comparison, equal, readable
from dhkit.grading.judging.numeric import doubles, general_state, names_of
from dhkit.grading.judging.quantities import JudgedQuantity
from dhkit.grading.judging.quotients import OutsideTheRingError, Reading
from dhkit.grading.judging.rounding import has_decimals
from dhkit.grading.judging.truth import DYNAMICS, Truth, exact_number, substituted
from dhkit.grading.mistakes.diagnosis import Differences, Index, Variants, place_of, variants_of, varying
from dhkit.grading.mistakes.library import FACTORS, UNITS, hint_of
from dhkit.grading.mistakes.parameter_variants import lengths_of
from dhkit.grading.mistakes.parts import split_in_parts
from dhkit.grading.mistakes.slips import Slip, slip_in
from dhkit.grading.mistakes.terms import describe
from dhkit.grading.mistakes.variants import Variant
from dhkit.grading.mistakes.wording import (
    diagnosis_of,
    diagnosis_of_identity,
    diagnosis_of_slip,
    entry_names,
    merged,
    wrong_entries,
)
from dhkit.grading.report import Diagnosis, Verdict
from dhkit.symbolic.equations import plain_text
from dhkit.symbolic.ring import Element, Elements

__all__ = ["explain"]

PARTS = {
    "M": "in the terms with accelerations",
    "h": "in the terms with products of rates",
    "g": "in the terms of gravity",
    "K": "in the kinetic energy",
    "V": "in the potential energy",
}
IN_DEGREES = (Fraction(1, 180), Fraction(180))
LIKELY = 1
"""The largest rarity of a mistake that is named before slips in single terms are looked for."""
ZEROS = {"h": "velocity_torques_missing", "C": "velocity_torques_missing", "g": "gravity_torques_missing"}
"""What is missing where all of a quantity is zero."""
LEAST_DIGITS = 2
"""Significant digits of decimals that are told to be too few rather than wrong."""
LEAST_TERMS_OF_A_PAIR, MOST_TERMS_OF_A_PAIR = 3, 600
"""Terms in which an answer differs: of fewer a slip is likelier than two mistakes at once, of more it is not worth the
search."""
MAX_TERMS = 150
"""Terms in which an entry may differ for a slip in one of them to be looked for."""
MAX_DESCRIBED = 600
"""Terms of an entry that is described term by term."""


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
    _take(left, found, _degrees(truth, left))
    _take(left, found, _gears(truth, left))
    found += _weights(truth, left, following)
    found += _one_of_C(truth, left, following)
    _take(left, found, _zeros(truth, left, following))
    _take(left, found, _units(truth, left))
    # What only explains answers that follow from other wrong ones is not where the sheet went wrong.
    for allowed in (lambda names, rarity: rarity <= LIKELY, lambda names, rarity: len(names) > 1):
        single = _single(truth, judged, left, allowed)
        _take(left, found, {names: one for names, one in single.items() if not following.issuperset(names)})
    _take(left, found, _nearly(truth, left, digits))
    for name in following & left.keys():
        del left[name]
    for explained in (_too_few_digits, _slips, _rare, _whole_factor, _parts, _pair):
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


# Degrees


def _degrees(truth: Truth, wrong: Mapping[str, JudgedQuantity]) -> dict[tuple[str, ...], Diagnosis]:
    """Find answers that are right once their angles are no longer multiplied by pi/180 or 180/pi."""
    found: dict[tuple[str, ...], Diagnosis] = {}
    for name, quantity in wrong.items():
        if name != "C" and any(_is_right_in(truth, quantity, factor) for factor in IN_DEGREES):
            found[(name,)] = diagnosis_of_identity("degrees_for_radians", quantity, wrong_entries(quantity), name)
    return found


def _is_right_in(truth: Truth, quantity: JudgedQuantity, degrees: Fraction) -> bool:
    return _is_right(quantity, Reading(truth.arm(quantity.name).ring, degrees=degrees))


def _is_right(quantity: JudgedQuantity, reading: Reading, change: Callable[[Tree], Tree] = lambda tree: tree) -> bool:
    """Whether the wrong entries are right once they are changed, or read in another way."""
    for entry in quantity.given:
        if quantity.findings[entry.index].verdict is not Verdict.WRONG:
            continue
        try:
            right = quantity.right(entry.index)
            if entry.tree is None or not reading.read(change(entry.tree)).numerator_of_difference(right).is_zero:
                return False
        except (OutsideTheRingError, AnswerError):
            return False
    return True


def _gears(truth: Truth, wrong: Mapping[str, JudgedQuantity]) -> dict[tuple[str, ...], Diagnosis]:
    """Find answers that are right once gear ratios are inverted in them; numbers are inverted by the variants."""
    gears = {name for joint in truth.description.joints if joint.drive for name in joint.drive.gear.symbols}
    one = Number(Fraction(1), "1", 0)
    inverse: dict[str, Tree] = {name: Product(((True, one), (False, Name(name, 0)))) for name in gears}
    return {
        (name,): diagnosis_of_identity("gear_inverted", quantity, wrong_entries(quantity), name)
        for name, quantity in wrong.items()
        if gears
        and name in ("M", "K", "tau")
        and _is_right(quantity, Reading(truth.arm(name).ring), partial(renamed, change=inverse))
    }


def _weights(truth: Truth, left: dict[str, JudgedQuantity], following: set[str]) -> list[Diagnosis]:
    """Take gravity torques out that stand where there are none, if no other one is wrong."""
    g = left.get("g")
    if g is None or "g" in following or any(g.right(index) for index in wrong_entries(g)):
        return []
    slips = {index: _slip(truth, g, index) for index in wrong_entries(g)}
    if any(slip is None or slip.identity != "weight_on_vertical_axis" for slip in slips.values()):
        return []
    del left["g"]
    return [diagnosis_of_slip(g, index, slip) for index, slip in slips.items() if slip is not None]


def _one_of_C(truth: Truth, left: dict[str, JudgedQuantity], following: set[str]) -> list[Diagnosis]:
    """Take C out if one entry of it is not the Christoffel factorization's, and say what is wrong in that."""
    C = left.get("C")
    wrong = wrong_entries(C) if C is not None else []
    if C is None or "C" in following or len(wrong) != 1 or len(C.given) < C.truth.size**2:
        return []
    slip = _slip_in_C(truth, C, wrong[0])
    if slip is None:
        return []
    del left["C"]
    return [replace(diagnosis_of_slip(C, wrong[0], slip), equivalent=_equivalent(truth, C))]


def _zeros(truth: Truth, left: Mapping[str, JudgedQuantity], following: set[str]) -> dict[tuple[str, ...], Diagnosis]:
    """Find quantities that are handed in as zero."""
    found: dict[tuple[str, ...], Diagnosis] = {}
    for name, quantity in left.items():
        wrong = wrong_entries(quantity)
        if name in following or not quantity.is_zero or any(_mirrored(quantity, index) for index in wrong):
            continue
        identity = ZEROS.get(name, "entry_zero") if len(quantity.given) > 1 else "entry_zero"
        one = diagnosis_of_identity(identity, quantity, wrong, name)
        found[(name,)] = replace(one, equivalent=_equivalent(truth, quantity))
    return found


def _equivalent(truth: Truth, quantity: JudgedQuantity) -> tuple[str, ...]:
    """Return what the mistakes are called that give a whole quantity."""
    differences = quantity.differences
    variants = _tables(truth, quantity).whole(quantity.name, differences) if differences else []
    return tuple(dict.fromkeys(variant.called for variant in variants))


def _units(truth: Truth, left: Mapping[str, JudgedQuantity]) -> dict[tuple[str, ...], Diagnosis]:
    """Find quantities with lengths as numbers in another unit, where other parameters stand as symbols."""
    found: dict[tuple[str, ...], Diagnosis] = {}
    lengths = lengths_of(truth.description)
    for name, quantity in left.items():
        there = [entry.tree for entry in quantity.given if entry.tree is not None]
        absent = [p for p in lengths if not any(p in names_of(tree) for tree in there)]
        ring = truth.arm(name).ring
        if name not in DYNAMICS or not absent or not set(absent) <= set(ring.constants):
            continue
        for identity, factor in UNITS.items():
            values = {p: ring.number(exact_number(truth.description, p) * factor) for p in absent}
            expected = substituted(truth.of("h" if name == "C" else name), values, ring)
            if name != "C" and _has_answers(quantity, expected):
                found[(name,)] = diagnosis_of_identity(identity, quantity, wrong_entries(quantity), name)
    return found


def _has_answers(quantity: JudgedQuantity, expected: Elements) -> bool:
    """Whether all wrong entries are what is expected."""
    answers = [(index, quantity.findings[index].answer) for index in wrong_entries(quantity)]
    return all(
        answer is not None and answer.numerator_of_difference(expected[index]).is_zero for index, answer in answers
    )


# Mistakes that explain whole quantities


def _tables(truth: Truth, quantity: JudgedQuantity) -> Variants:
    return variants_of(truth, quantity.numbers)


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
            whole = _tables(truth, quantity).whole(name, differences)
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
        if not _tables(truth, quantity).changes_none(variant, name, right):
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
        likely = _tables(truth, quantity).near(name, quantity.truth, _numbers(truth, quantity))
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
    change = _tables(truth, quantity).change(variant, quantity.name)
    return all(
        equal(entry.tree, quantity.truth[entry.index] + change[entry.index], by)
        for entry in quantity.given
        if entry.tree is not None
    )


def _too_few_digits(truth: Truth, judged: Mapping[str, JudgedQuantity], quantity: JudgedQuantity) -> list[Diagnosis]:
    """Find decimals that would be right within rounding if fewer digits were allowed."""
    name = quantity.name
    if name in ("C", "V", "L"):
        return []
    by = Comparison(truth.arm(name), Reading(truth.arm(name).ring, others=truth.others(name)), LEAST_DIGITS)
    wrong = set(wrong_entries(quantity))
    for entry in quantity.given:
        if entry.index in wrong:
            if entry.tree is None or not has_decimals(entry.tree, LEAST_DIGITS):
                return []
            if not equal(entry.tree, quantity.truth[entry.index], by):
                return []
    return [diagnosis_of_identity("too_few_digits", quantity, sorted(wrong), name)]


# Slips in single terms


def _slips(truth: Truth, judged: Mapping[str, JudgedQuantity], quantity: JudgedQuantity) -> list[Diagnosis]:
    """Find the one slip in a term of each wrong entry; nothing where an entry has none."""
    found: list[Diagnosis] = []
    for index in _distinct(quantity):
        slip = _slip_in_C(truth, quantity, index) if quantity.name == "C" else _slip(truth, quantity, index)
        if slip is None or _mirrored(quantity, index) or _factor(quantity, index):
            return []
        found.append(diagnosis_of_slip(quantity, index, slip))
    if len({one.sentence for one in found}) > 1 and (rare := _rare(truth, judged, quantity)):
        return rare
    return [replace(one, equivalent=_equivalent(truth, quantity)) for one in found]


def _slip(truth: Truth, quantity: JudgedQuantity, index: Index) -> Slip | None:
    difference, right = quantity.findings[index].difference, quantity.right(index)
    if difference is None or difference.is_zero or len(difference) > MAX_TERMS:
        return None
    arm = truth.arm(quantity.name)
    if quantity.name in ("V", "L"):  # they count from any zero
        difference, right = varying(difference), varying(right)
    if quantity.name == "g" and not right and _is_weight(truth, difference):
        return Slip("weight_on_vertical_axis", plain_text(readable(arm, difference)))
    return _slip_shown(truth, quantity.name, right + difference, right)


def _slip_shown(truth: Truth, name: str, answer: Element, right: Element) -> Slip | None:
    """Return the slip that makes an answer of the truth, in the student's own rates and angles."""
    own = truth.coordinates.in_own_rates
    slip = slip_in(truth.arm(name), own(answer), own(right))
    return None if slip is None else Slip(slip.identity, _shown(truth, slip.detail))


def _shown(truth: Truth, text: str) -> str:
    """Return a formula's text in the student's own angles."""
    if any(ANGLE.fullmatch(name) for name in truth.description.parameters):
        return text
    return truth.coordinates.in_own_angles(text)


def _slip_in_C(truth: Truth, quantity: JudgedQuantity, index: Index) -> Slip | None:
    """Return the slip in the one entry of a row of C that is not the Christoffel factorization's."""
    arm = truth.arm("C")
    reading = Reading(arm.ring, others=truth.others("C"))
    right = truth.coordinates.in_y("C", truth.lagrangian.C)
    differing: list[tuple[Element, Element]] = []
    for given in quantity.given:
        if given.index[0] != index[0] or given.tree is None:
            continue
        try:
            answer = reading.read(given.tree).element()
        except (OutsideTheRingError, AnswerError):
            return None
        if answer is None:
            return None
        if answer != right[given.index]:
            differing.append((answer, right[given.index]))
    if len(differing) != 1:
        return None
    answer, entry = differing[0]
    names = (identity for identity, factor in FACTORS.items() if answer == entry * factor)
    identity = next(names, None)
    return _slip_shown(truth, "C", answer, entry) if identity is None or len(entry) == 1 else Slip(identity, "")


def _is_weight(truth: Truth, difference: Element) -> bool:
    """Whether a torque holds the parameter that gravity is given by, or there is none."""
    names = {name for x in truth.description.gravity for name in x.symbols}
    places = [k for k, g in enumerate(difference.ring.generators) if g.text in names]
    return not places or all(any(monomial[k] for k in places) for monomial in difference.terms)


# Rarer mistakes


def _rare(truth: Truth, judged: Mapping[str, JudgedQuantity], quantity: JudgedQuantity) -> list[Diagnosis]:
    """Find the single mistakes that are possible, and seldom made."""
    return list(_single(truth, judged, {quantity.name: quantity}, lambda names, rarity: rarity > LIKELY).values())


def _whole_factor(truth: Truth, judged: Mapping[str, JudgedQuantity], quantity: JudgedQuantity) -> list[Diagnosis]:
    """Find a factor that all entries, all of them wrong, share."""
    wrong = _distinct(quantity)
    if any(_mirrored(quantity, index) for index in wrong):
        return []
    found = [_factor(quantity, index) for index in wrong]
    names = {one.mistake for one in found if one is not None}
    if None in found or len(names) != 1:
        return []
    return [one for one in found if one is not None]


def _parts(truth: Truth, judged: Mapping[str, JudgedQuantity], quantity: JudgedQuantity) -> list[Diagnosis]:
    """Explain torques, and the Lagrangian, part by part: those of accelerations, of rates, and of neither."""
    differences = quantity.differences
    if quantity.name not in ("tau", "L") or not differences:
        return []
    tables = _tables(truth, quantity)
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
        slip = _slip_shown(truth, part, right + difference, right)
        if slip is not None:
            found.append(diagnosis_of_slip(quantity, place, slip))
            continue
        difference = truth.coordinates.in_own_rates(difference)
        excess = _shown(truth, plain_text(readable(truth.arm(quantity.name), difference)))
        found.append(Diagnosis(None, f"Too much {PARTS[part]}: {excess}.", entry, (entry,), hint_of(None)))
    return found


def _pair(truth: Truth, judged: Mapping[str, JudgedQuantity], quantity: JudgedQuantity) -> list[Diagnosis]:
    """Find two of a derivation's mistakes that together explain what no single one does."""
    differences = quantity.differences
    terms = sum(map(len, differences.values())) if differences else 0
    if not differences or not LEAST_TERMS_OF_A_PAIR <= terms <= MOST_TERMS_OF_A_PAIR:
        return []
    pair = _tables(truth, quantity).pair(quantity.name, differences)
    if pair is None or any(_contradicted(truth, judged, variant) for variant in pair):
        return []
    return [diagnosis_of([variant], [quantity]) for variant in pair]


# Entry by entry


def _entries(truth: Truth, quantity: JudgedQuantity) -> list[Diagnosis]:
    """Explain wrong entries one by one; those that one mistake explains go together."""
    found: list[Diagnosis] = []
    candidates: dict[Index, list[Variant]] = {}
    for index in _distinct(quantity):
        plain = _mirrored(quantity, index) or _factor(quantity, index)
        slip = None if plain else _slip(truth, quantity, index)
        difference = quantity.findings[index].difference
        if plain is not None:
            found.append(plain)
        elif slip is not None:
            found.append(diagnosis_of_slip(quantity, index, slip))
        elif difference is not None:
            candidates[index] = _tables(truth, quantity).entry(quantity.name, index, difference)
        else:
            candidates[index] = []
    # One entry alone proves little: of transforms' entries many look alike, and so do those of a muddle.
    certain = quantity.name in DYNAMICS and all(candidates.values())
    for indices, variants in _greedily(candidates).items():
        if len(indices) == 1 and not certain:
            continue
        diagnosis = diagnosis_of(variants, [quantity], indices)
        alone = f"{diagnosis.sentence[:-1]}, in {' and '.join(diagnosis.entries)} alone."
        found.append(replace(diagnosis, sentence=alone))
        candidates = {index: v for index, v in candidates.items() if index not in indices}
    return found + [_described(truth, quantity, index) for index in candidates]


def _distinct(quantity: JudgedQuantity) -> list[Index]:
    """Return wrong entries, of C one a row."""
    wrong = wrong_entries(quantity)
    if quantity.name != "C":
        return wrong
    rows = {place_of("C", index): index for index in reversed(wrong)}
    return sorted(rows.values())


def _mirrored(quantity: JudgedQuantity, index: Index) -> Diagnosis | None:
    if quantity.name != "M" or index[0] == index[1] or not quantity.findings[index[::-1]].verdict.passes:
        return None
    (entry,) = entry_names(quantity, [index])
    return diagnosis_of_identity("mass_matrix_not_symmetric", quantity, [index], entry)


def _factor(quantity: JudgedQuantity, index: Index) -> Diagnosis | None:
    difference, right = quantity.findings[index].difference, quantity.right(index)
    if difference is None or not right:
        return None
    for name, factor in FACTORS.items():
        if difference == right * (factor - 1):
            (entry,) = entry_names(quantity, [index])
            return diagnosis_of_identity(name, quantity, [index], entry)
    return None


def _described(truth: Truth, quantity: JudgedQuantity, index: Index) -> Diagnosis:
    finding, right = quantity.findings[index], quantity.right(index)
    (entry,) = entry_names(quantity, [index])
    element = finding.answer.element() if finding.answer is not None else None
    if element is None:
        words = finding.statement
    elif len(element) > MAX_DESCRIBED:
        words = f"{len(element)} terms, where {len(right)} are right"
    else:
        own = truth.coordinates.in_own_rates
        words = _shown(truth, describe(truth.arm(quantity.name), own(element), own(right)))
    return Diagnosis(None, capitalised(f"{words}."), entry, (entry,), hint_of(None))
