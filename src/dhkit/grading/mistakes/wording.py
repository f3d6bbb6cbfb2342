"""Diagnoses of mistakes: their sentences, places, and the entries that they explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from dhkit.grading.catalogue import LIBRARY, hint_of, sentence_of
from dhkit.grading.grade_report import Diagnosis, entry_name
from dhkit.grading.judging.quantities import Index, JudgedQuantity
from dhkit.grading.mistakes.slips import Slip
from dhkit.grading.mistakes.variants import Variant

_MAX_ALTERNATIVES = 3
"""Largest number of mistakes with the same answers that one sentence names."""

_CHRISTOFFEL = {
    "kinetic_gradient_omitted": "of the Christoffel symbols the subtracted term dM_jk/dq_i / 2 is missing",
    "kinetic_gradient_sign": "of the Christoffel symbols the term dM_jk/dq_i / 2 is added, and should be subtracted",
    "mass_rate_omitted": "of the Christoffel symbols the two terms that are added",
    "velocity_torques_doubled": "the Christoffel symbols lack their factor 1/2",
}
"""Effect on the entries of C of mistakes in Euler and Lagrange's equation, by the mistakes."""


def merge(diagnoses: Sequence[Diagnosis]) -> list[Diagnosis]:
    """Return diagnoses, with those of the same mistake in several quantities merged."""
    same: dict[tuple[str | None, str], list[Diagnosis]] = {}
    for diagnosis in diagnoses:
        same.setdefault((diagnosis.mistake, diagnosis.sentence), []).append(diagnosis)
    merged = []
    for group in same.values():
        first = group[0]
        if len(group) == 1:
            merged.append(first)
            continue
        places: list[str] = []
        entries: list[str] = []
        for diagnosis in group:
            places += diagnosis.where.split(", ")
            entries += diagnosis.entries
        ordered = sorted(dict.fromkeys(places), key=_is_after_quantities)
        merged.append(
            replace(first, where=", ".join(ordered), entries=tuple(dict.fromkeys(entries)))
        )
    return merged


def _is_after_quantities(place: str) -> bool:
    """Whether a place is a link or a parameter, which are listed after the quantities."""
    return not place[:1].isalpha() or " " in place


def _entry_names(quantity: JudgedQuantity, indices: Sequence[Index]) -> tuple[str, ...]:
    """Return the names of entries, such as M12."""
    return tuple(entry_name(quantity.name, index) for index in indices)


def diagnosis_of(
    variants: Sequence[Variant], quantities: Sequence[JudgedQuantity], indices: Sequence[Index] = ()
) -> Diagnosis:
    """Return the diagnosis of mistakes that all give the same answers, the likeliest first."""
    first = variants[0]
    quantities = list(dict.fromkeys(quantities))

    # The entries, and the places: quantities or entries, then the link.
    names: list[str] = []
    for quantity in quantities:
        names += _entry_names(quantity, indices or quantity.wrong_indices)
    entries = tuple(dict.fromkeys(names))
    places = list(entries) if indices else [quantity.name for quantity in quantities]
    if first.place:
        places.append(first.place)

    # The sentence: mistakes that are as frequent as the first are alternatives.
    of_C = all(quantity.name == "C" for quantity in quantities)
    distinct: dict[str, Variant] = {}
    for variant in variants:
        if variant.rarity == first.rarity:
            distinct.setdefault(variant.identity, variant)
    if len(distinct) > 1:
        alternatives = list(distinct.values())[:_MAX_ALTERNATIVES]
        listed = "; or: ".join(_clause(variant, of_C) for variant in alternatives)
        sentence = f"One of these: {listed}."
    else:
        detail = _CHRISTOFFEL.get(first.identity, "") if of_C else ""
        sentence = sentence_of(first.identity, first.place, detail)

    equivalent = tuple(
        dict.fromkeys(variant.name for variant in variants if variant.name != first.name)
    )
    return Diagnosis(
        first.identity, sentence, ", ".join(places), entries, hint_of(first.identity), equivalent
    )


def _clause(variant: Variant, of_C: bool) -> str:
    """Return the sentence of a mistake as a clause, with its place."""
    sentence = LIBRARY[variant.identity].sentence
    if of_C and variant.identity in _CHRISTOFFEL:
        sentence = f"{sentence}: {_CHRISTOFFEL[variant.identity]}"
    return f"{variant.place}: {sentence}" if variant.place else sentence


def diagnosis_of_slip(quantity: JudgedQuantity, index: Index, slip: Slip) -> Diagnosis:
    """Return the diagnosis of a slip in one entry."""
    entry = entry_name(quantity.name, index)
    if slip.identity != "term_missing":
        sentence = sentence_of(slip.identity, detail=slip.detail)
        return Diagnosis(
            slip.identity, sentence, entry, (entry,), hint_of(slip.identity), second_hint=slip.right
        )
    # The right term would be the answer: the first hint says only where it comes from.
    sentence = sentence_of(slip.identity, detail=f"one with {slip.kind}" if slip.kind else "")
    hint = (
        f"Look again at the terms with {slip.kind}: is each there?"
        if slip.kind
        else hint_of(slip.identity)
    )
    return Diagnosis(slip.identity, sentence, entry, (entry,), hint, second_hint=slip.detail)


def diagnosis_of_whole(quantity: JudgedQuantity, identity: str) -> Diagnosis:
    """Return the diagnosis of a mistake in all wrong entries of a quantity, which is made at no particular link."""
    entries = _entry_names(quantity, quantity.wrong_indices)
    return Diagnosis(identity, sentence_of(identity), quantity.name, entries, hint_of(identity))
