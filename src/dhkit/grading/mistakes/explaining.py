"""From wrong answers to sentences: which mistakes give them, or what their terms show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from dhkit.errors import AnswerError
from dhkit.grading.capitals import capitalised
from dhkit.grading.judging.findings import Comparison, equal, readable
from dhkit.grading.judging.numeric import doubles, general_state
from dhkit.grading.judging.quantities import JudgedQuantity
from dhkit.grading.judging.quotients import OutsideTheRingError, Reading, decimals_in
from dhkit.grading.judging.truth import DYNAMICS, Truth
from dhkit.grading.mistakes.diagnosis import Differences, Variants, variants_of
from dhkit.grading.mistakes.library import hint_of, sentence_of
from dhkit.grading.mistakes.terms import describe
from dhkit.grading.mistakes.variants import Variant
from dhkit.grading.report import Diagnosis, Entry, Verdict
from dhkit.symbolic.equations import plain_text
from dhkit.symbolic.ring import Element

__all__ = ["explain"]

Index = tuple[int, ...]
FACTORS = {"entry_sign": Fraction(-2), "entry_halved": Fraction(-1, 2), "entry_doubled": Fraction(1)}
"""Of the truth, what the difference then is."""
PARTS = {
    "M": "in the terms with accelerations",
    "h": "in the terms with products of rates",
    "g": "in the terms of gravity",
    "K": "in the kinetic energy",
    "V": "in the potential energy",
}
IN_DEGREES = (Fraction(1, 180), Fraction(180))


def explain(
    truth: Truth, judged: Mapping[str, JudgedQuantity], digits: int = 4, seconds: float = 0.4
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
    seconds
        Time for pairs of mistakes, for each quantity.
    """
    wrong = {name: quantity for name, quantity in judged.items() if quantity.wrong}
    found: list[Diagnosis] = []
    left = dict(wrong)
    _take(left, found, _degrees(truth, wrong))
    _take(left, found, _single(truth, left))
    _take(left, found, _nearly(truth, left, digits))
    for name, quantity in list(left.items()):
        explained = _parts(truth, quantity) or _pair(truth, quantity, seconds)
        if explained:
            found += explained
            del left[name]
    for quantity in left.values():
        found += _entries(truth, quantity)
    return _merged(found)


def _merged(found: Sequence[Diagnosis]) -> list[Diagnosis]:
    """Return diagnoses, those that say the same of several quantities as one."""
    same: dict[tuple[str | None, str], list[Diagnosis]] = {}
    for diagnosis in found:
        same.setdefault((diagnosis.mistake, diagnosis.sentence), []).append(diagnosis)
    merged = []
    for first, *others in same.values():
        places = [place for one in (first, *others) for place in one.where.split(", ")]
        entries = tuple(dict.fromkeys(entry for one in (first, *others) for entry in one.entries))
        # What is no quantity, a link or a parameter, comes last.
        ordered = sorted(dict.fromkeys(places), key=lambda place: not place[:1].isalpha() or " " in place)
        merged.append(replace(first, where=", ".join(ordered), entries=entries) if others else first)
    return merged


def _take(
    left: dict[str, JudgedQuantity], found: list[Diagnosis], explained: Mapping[tuple[str, ...], Diagnosis]
) -> None:
    for names, diagnosis in explained.items():
        found.append(diagnosis)
        for name in names:
            left.pop(name, None)


def _wrong_entries(quantity: JudgedQuantity) -> list[Index]:
    return [index for index, finding in quantity.findings.items() if finding.verdict is Verdict.WRONG]


def _names(quantity: JudgedQuantity, indices: Sequence[Index]) -> tuple[str, ...]:
    return tuple(Entry(quantity.name, index, Verdict.WRONG).name for index in indices)


def _diagnosis(
    variant: Variant,
    quantities: Sequence[JudgedQuantity],
    others: Sequence[Variant] = (),
    indices: Sequence[Index] = (),
) -> Diagnosis:
    entries = tuple(name for quantity in quantities for name in _names(quantity, indices or _wrong_entries(quantity)))
    name = variant.name.partition("@")[0]
    places = [quantity.name for quantity in quantities] if not indices else entries
    where = ", ".join([*places, *([variant.where] if variant.where else [])])
    equivalent = tuple(dict.fromkeys(_called(other) for other in others if _called(other) != _called(variant)))
    return Diagnosis(name, sentence_of(name, variant.where), where, entries, hint_of(name), equivalent)


def _called(variant: Variant) -> str:
    name = variant.name.partition("@")[0]
    return f"{name} ({variant.where})" if variant.where else name


# Degrees


def _degrees(truth: Truth, wrong: Mapping[str, JudgedQuantity]) -> dict[tuple[str, ...], Diagnosis]:
    """Find answers that are right once their angles are no longer multiplied by pi/180 or 180/pi."""
    found: dict[tuple[str, ...], Diagnosis] = {}
    for name, quantity in wrong.items():
        if name != "C" and any(_is_right_in(truth, quantity, factor) for factor in IN_DEGREES):
            mistake = "degrees_for_radians"
            entries = _names(quantity, _wrong_entries(quantity))
            found[(name,)] = Diagnosis(mistake, sentence_of(mistake), name, entries, hint_of(mistake))
    return found


def _is_right_in(truth: Truth, quantity: JudgedQuantity, factor: Fraction) -> bool:
    reading = Reading(truth.arm(quantity.name).ring, degrees=factor)
    for entry in quantity.given:
        if quantity.findings[entry.index].verdict is not Verdict.WRONG:
            continue
        try:
            if entry.tree is None or not reading.read(entry.tree).less(quantity.right(entry.index)).is_zero:
                return False
        except (OutsideTheRingError, AnswerError):
            return False
    return True


# Mistakes that explain whole quantities


def _tables(truth: Truth, quantity: JudgedQuantity) -> Variants:
    return variants_of(truth, quantity.numbers)


def _single(truth: Truth, wrong: Mapping[str, JudgedQuantity]) -> dict[tuple[str, ...], Diagnosis]:
    """Find mistakes that explain quantities entirely, each as many of them as it can."""
    candidates: dict[str, list[Variant]] = {}
    for name, quantity in wrong.items():
        differences = quantity.differences
        if differences is not None:
            candidates[name] = _tables(truth, quantity).whole(name, differences)
    return {
        names: _diagnosis(variants[0], [wrong[name] for name in names], variants)
        for names, variants in _greedily(candidates).items()
    }


def _greedily(candidates: Mapping[Any, list[Variant]]) -> dict[tuple[Any, ...], list[Variant]]:
    """Return the fewest mistakes that explain all that can be, each with what it explains and what is equivalent."""
    left, found = dict(candidates), {}
    while any(left.values()):
        explains: dict[tuple[str, str], list[Any]] = {}
        listed: dict[tuple[str, str], Variant] = {}
        for name, variants in left.items():
            for variant in variants:
                explains.setdefault((variant.name, variant.where), []).append(name)
                listed[variant.name, variant.where] = variant
        best = max(explains, key=lambda key: len(explains[key]))
        names = explains[best]
        found[tuple(names)] = [listed[key] for key in explains if explains[key] == names]
        left = {name: variants for name, variants in left.items() if name not in names}
    return found


def _nearly(truth: Truth, wrong: Mapping[str, JudgedQuantity], digits: int) -> dict[tuple[str, ...], Diagnosis]:
    """Find mistakes that explain quotients, and answers whose decimals were rounded besides."""
    found: dict[tuple[str, ...], Diagnosis] = {}
    for name, quantity in wrong.items():
        in_ring = all(finding.answer is not None for finding in quantity.findings.values())
        rounded = any(entry.tree is not None and decimals_in(entry.tree, digits) for entry in quantity.given)
        if name in ("C", "V", "L") or not in_ring or not (rounded or quantity.differences is None):
            continue
        by = Comparison(truth.arm(name), Reading(truth.arm(name).ring), digits)
        likely = _tables(truth, quantity).near(name, quantity.truth, _numbers(truth, quantity))
        variants = [variant for variant in likely if _gives(truth, variant, quantity, by)]
        if variants:
            found[(name,)] = _diagnosis(variants[0], [quantity], variants)
    return found


def _numbers(truth: Truth, quantity: JudgedQuantity) -> Mapping[Index, float]:
    """Return a wrong answer's values at the state that :meth:`Variants.near` looks at; NaN where it has none."""
    arm = truth.arm(quantity.name)
    return {
        entry.index: float(doubles(entry.tree, {**arm.parameters, **general_state(arm.n)}))
        if entry.tree
        else float("nan")
        for entry in quantity.given
    }


def _gives(truth: Truth, variant: Variant, quantity: JudgedQuantity, by: Comparison) -> bool:
    """Whether a mistake gives an answer exactly, or within the rounding of its decimals."""
    change = _tables(truth, quantity).change(variant, quantity.name)
    return all(
        entry.tree is not None and equal(entry.tree, quantity.truth[entry.index] + change[entry.index], by)
        for entry in quantity.given
    )


def _parts(truth: Truth, quantity: JudgedQuantity) -> list[Diagnosis]:
    """Explain torques, and the Lagrangian, part by part: those of accelerations, of rates, and of neither."""
    differences = quantity.differences
    if quantity.name not in ("tau", "L") or differences is None:
        return []
    tables = _tables(truth, quantity)
    parts = {
        part: whole
        for part, whole in _split(truth, quantity.name, differences).items()
        if not all(element.is_zero for element in whole.values())
    }
    candidates = {part: tables.whole(part, whole) for part, whole in parts.items()}
    explained = _greedily(candidates)
    found = [_diagnosis(variants[0], [quantity], variants) for variants in explained.values()]
    left = [part for part in parts if not any(part in names for names in explained)]
    for part in list(left):
        pair = tables.pair(part, parts[part])
        if pair:
            found += [_diagnosis(variant, [quantity]) for variant in pair]
            left.remove(part)
    if not found:
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
        variants = _tables(truth, quantity).entry(part, index, difference)
        if variants:
            found.append(_diagnosis(variants[0], [quantity], variants, [index[: len(quantity.truth.shape)]]))
            continue
        (entry,) = _names(quantity, [index[: len(quantity.truth.shape)]])
        excess = plain_text(readable(truth.arm(quantity.name), difference))
        sentence = f"Too much {PARTS[part]}: {excess}."
        found.append(Diagnosis(None, sentence, entry, (entry,), hint_of(None)))
    return found


def _split(truth: Truth, name: str, differences: Differences) -> dict[str, Differences]:
    """Split by what the terms are multiplied by; torques of accelerations give M's entries."""
    ring = next(iter(differences.values())).ring
    n = ring.n
    accelerations = [ring.place("acceleration", i) for i in range(n)]
    rates = [ring.place("rate", i) for i in range(n)]
    parts: dict[str, dict[Index, Element]] = {"M": {}, "h": {}, "g": {}} if name == "tau" else {"K": {}, "V": {}}
    for index, element in differences.items():
        moving = {m: c for m, c in element.terms.items() if any(m[k] for k in rates)}
        resting = {m: c for m, c in element.terms.items() if not any(m[k] for k in (*rates, *accelerations))}
        if name == "L":
            parts["K"][index], parts["V"][index] = ring.from_terms(moving), -ring.from_terms(resting)
            continue
        parts["h"][index], parts["g"][index] = ring.from_terms(moving), ring.from_terms(resting)
        by_joint = [_coefficient(element, k) for k in accelerations]
        for j in range(n):
            parts["M"][*index, j] = ring.sum(by_joint[k] * int(truth.coordinates.B[k, j]) for k in range(n))
    return parts  # type: ignore[return-value]


def _coefficient(element: Element, place: int) -> Element:
    """Return what an acceleration is multiplied by."""
    terms = {(*m[:place], 0, *m[place + 1 :]): c for m, c in element.terms.items() if m[place] == 1}
    return element.ring.from_terms(terms)


def _pair(truth: Truth, quantity: JudgedQuantity, seconds: float) -> list[Diagnosis]:
    differences = quantity.differences
    pair = None if differences is None else _tables(truth, quantity).pair(quantity.name, differences, seconds)
    return [_diagnosis(variant, [quantity]) for variant in pair or ()]


# Entry by entry


def _entries(truth: Truth, quantity: JudgedQuantity) -> list[Diagnosis]:
    """Explain wrong entries one by one; those that one mistake explains go together."""
    found: list[Diagnosis] = []
    candidates: dict[Index, list[Variant]] = {}
    for index in _distinct(quantity):
        plain = _mirrored(quantity, index) or _factor(quantity, index)
        difference = quantity.findings[index].difference
        if plain is not None:
            found.append(plain)
        elif difference is not None:
            candidates[index] = _tables(truth, quantity).entry(quantity.name, index, difference)
        else:
            candidates[index] = []
    for indices, variants in _greedily(candidates).items():
        if len(indices) == 1 and quantity.name not in DYNAMICS:
            continue  # of transforms' entries many look alike
        diagnosis = _diagnosis(variants[0], [quantity], variants, indices)
        alone = f"{diagnosis.sentence[:-1]}, in {' and '.join(diagnosis.entries)} alone."
        found.append(replace(diagnosis, sentence=alone))
        candidates = {index: v for index, v in candidates.items() if index not in indices}
    return found + [_described(truth, quantity, index) for index in candidates]


def _distinct(quantity: JudgedQuantity) -> list[Index]:
    """Return wrong entries, of C one a row."""
    wrong = _wrong_entries(quantity)
    return [index for index in wrong if index[1] == 0] or wrong[:1] if quantity.name == "C" else wrong


def _mirrored(quantity: JudgedQuantity, index: Index) -> Diagnosis | None:
    if quantity.name != "M" or index[0] == index[1] or not quantity.findings[index[::-1]].verdict.passes:
        return None
    name = "mass_matrix_not_symmetric"
    (entry,) = _names(quantity, [index])
    return Diagnosis(name, sentence_of(name), entry, (entry,), hint_of(name))


def _factor(quantity: JudgedQuantity, index: Index) -> Diagnosis | None:
    difference, right = quantity.findings[index].difference, quantity.right(index)
    if difference is None or not right:
        return None
    for name, factor in FACTORS.items():
        if difference == right * factor:
            (entry,) = _names(quantity, [index])
            return Diagnosis(name, sentence_of(name), entry, (entry,), hint_of(name))
    return None


def _described(truth: Truth, quantity: JudgedQuantity, index: Index) -> Diagnosis:
    finding, right = quantity.findings[index], quantity.right(index)
    (entry,) = _names(quantity, [index])
    tree = next((given.tree for given in quantity.given if given.index == index), None)
    ring = truth.arm(quantity.name).ring
    by = Comparison(truth.arm(quantity.name), Reading(ring), 1)
    is_rounded = tree is not None and quantity.name not in ("C", "V", "L") and bool(decimals_in(tree, 1))
    if is_rounded and tree is not None and equal(tree, right, by):
        name = "too_few_digits"
        return Diagnosis(name, sentence_of(name), entry, (entry,), hint_of(name))
    element = finding.answer.element() if finding.answer is not None else None
    words = describe(truth.arm(quantity.name), element, right) if element is not None else finding.statement
    return Diagnosis(None, capitalised(f"{words}."), entry, (entry,), hint_of(None))
