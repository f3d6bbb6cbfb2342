"""Mistakes as diagnoses: their sentences, where they are made, and which entries they explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from dhkit.grading.judging.quantities import JudgedQuantity
from dhkit.grading.mistakes.diagnosis import Index
from dhkit.grading.mistakes.library import LIBRARY, hint_of, sentence_of
from dhkit.grading.mistakes.slips import Slip
from dhkit.grading.mistakes.variants import Variant
from dhkit.grading.report import Diagnosis, Entry, Verdict

MAX_ALTERNATIVES = 3
"""Mistakes that give the same answers, the more frequent first, that are named in one sentence."""


CHRISTOFFEL = {
    "kinetic_gradient_omitted": "of the Christoffel symbols the term that is taken off, dM_ij/dq_k / 2",
    "kinetic_gradient_sign": "of the Christoffel symbols the term dM_ij/dq_k / 2 is added, and should be taken off",
    "mass_rate_omitted": "of the Christoffel symbols the two terms that are added",
    "velocity_torques_doubled": "the Christoffel symbols lack their factor 1/2",
}
"""What mistakes in Euler and Lagrange's equation are in the entries of C."""


def merged(found: Sequence[Diagnosis]) -> list[Diagnosis]:
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


def wrong_entries(quantity: JudgedQuantity) -> list[Index]:
    """Return where a quantity is wrong."""
    return [index for index, finding in quantity.findings.items() if finding.verdict is Verdict.WRONG]


def entry_names(quantity: JudgedQuantity, indices: Sequence[Index]) -> tuple[str, ...]:
    """Return entries as people write them: M12."""
    return tuple(Entry(quantity.name, index, Verdict.WRONG).name for index in indices)


def diagnosis_of(
    variants: Sequence[Variant], quantities: Sequence[JudgedQuantity], indices: Sequence[Index] = ()
) -> Diagnosis:
    """Return what is said of mistakes that all give the same answers, the likeliest first."""
    first = variants[0]
    quantities = list(dict.fromkeys(quantities))
    names = (name for quantity in quantities for name in entry_names(quantity, indices or wrong_entries(quantity)))
    entries = tuple(dict.fromkeys(names))
    places = [quantity.name for quantity in quantities] if not indices else entries
    where = ", ".join([*places, *([first.place] if first.place else [])])
    of_C = all(quantity.name == "C" for quantity in quantities)
    distinct: dict[str, Variant] = {}
    for variant in variants:
        if variant.rarity == first.rarity:
            distinct.setdefault(variant.identity, variant)
    if len(distinct) > 1:
        listed = "; or: ".join(_clause(variant, of_C) for variant in [*distinct.values()][:MAX_ALTERNATIVES])
        sentence = f"One of these: {listed}."
    else:
        sentence = sentence_of(first.identity, first.place, CHRISTOFFEL.get(first.identity, "") if of_C else "")
    equivalent = tuple(dict.fromkeys(v.called for v in variants if v.called != first.called))
    return Diagnosis(first.identity, sentence, where, entries, hint_of(first.identity), equivalent)


def _clause(variant: Variant, of_C: bool) -> str:
    sentence = LIBRARY[variant.identity].sentence
    if of_C and variant.identity in CHRISTOFFEL:
        sentence = f"{sentence}: {CHRISTOFFEL[variant.identity]}"
    return f"{variant.place}: {sentence}" if variant.place else sentence


def diagnosis_of_slip(quantity: JudgedQuantity, index: Index, slip: Slip) -> Diagnosis:
    """Return what is said of a slip in a term of one entry."""
    (entry,) = entry_names(quantity, [index])
    sentence = sentence_of(slip.identity, "", slip.detail)
    return Diagnosis(slip.identity, sentence, entry, (entry,), hint_of(slip.identity))


def diagnosis_of_identity(identity: str, quantity: JudgedQuantity, indices: Sequence[Index], where: str) -> Diagnosis:
    """Return what is said of a mistake that is made nowhere in particular."""
    return Diagnosis(identity, sentence_of(identity), where, entry_names(quantity, indices), hint_of(identity))
