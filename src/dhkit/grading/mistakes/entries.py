"""Errors in one entry: a factor, a mirror image, a slip in a term; or a description of its terms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

from dhkit.grading.catalogue import FACTORS, capitalize, hint_of
from dhkit.grading.judging.coordinates import ANGLE
from dhkit.grading.judging.findings import Finding, readable
from dhkit.grading.judging.quantities import Index, JudgedQuantity, place_of
from dhkit.grading.judging.quotients import varying
from dhkit.grading.judging.truth import Truth
from dhkit.grading.mistakes.bounds import BOUNDS
from dhkit.grading.mistakes.slips import Slip, kind_of_terms, slip_in
from dhkit.grading.mistakes.wording import diagnosis_of_slip
from dhkit.grading.report import Diagnosis, entry_name
from dhkit.symbolic import ExactArm
from dhkit.symbolic.equations import plain_text
from dhkit.symbolic.exact.compact import shortened_alike
from dhkit.symbolic.ring import Element

_MAX_NAMED_TERMS = 3
"""Largest number of terms of each kind that a description names."""


def slip_of(truth: Truth, quantity: JudgedQuantity, index: Index) -> Slip | None:
    """Return the slip in a term of a wrong entry; None if there is none, or more than one."""
    difference = quantity.findings[index].difference
    right = quantity.right(index)
    if difference is None or difference.is_zero or len(difference) > BOUNDS.compared_terms:
        return None
    arm = truth.arm(quantity.name)
    if quantity.name in ("V", "L"):  # they count from any zero
        difference, right = varying(difference), varying(right)
    if quantity.name == "g" and not right and _is_weight(truth, difference):
        return Slip("weight_on_vertical_axis", plain_text(readable(arm, difference)))
    return slip_between(truth, quantity.name, right + difference, right)


def slip_between(truth: Truth, name: str, answer: Element, right: Element) -> Slip | None:
    """Return the slip that turns the truth into an answer, in the student's own rates and angles."""
    own = truth.coordinates.in_own_rates
    slip = slip_in(truth.arm(name), own(answer), own(right))
    return (
        None
        if slip is None
        else replace(slip, detail=in_own_angles(truth, slip.detail), right=in_own_angles(truth, slip.right))
    )


def in_own_angles(truth: Truth, text: str) -> str:
    """Return a printed formula in the student's own angles."""
    if any(ANGLE.fullmatch(name) for name in truth.description.parameters):
        return text
    return truth.coordinates.in_own_angles(text)


def shown_in_own_angles(truth: Truth, quantity: str, finding: Finding) -> Finding:
    """Return a finding whose difference and state are written in the student's own angles and rates."""
    coordinates = truth.coordinates
    if coordinates.is_relative:
        return finding
    texts, witness = finding.texts, finding.witness
    if finding.difference is not None:
        own = readable(truth.arm(quantity), coordinates.in_own_rates(finding.difference))
        texts = in_own_angles(truth, plain_text(own)), ""
    if witness is not None:
        witness = replace(witness, state=coordinates.own_state(witness.state))
    return replace(finding, texts=texts, witness=witness)


def slip_of_C(truth: Truth, quantity: JudgedQuantity, index: Index) -> Slip | None:
    """Return the slip in the only entry of a row of C that differs from the Christoffel factorization; else None."""
    reader = truth.reader("C")
    right = truth.coordinates.in_y("C", truth.lagrangian.C)
    differing: list[tuple[Element, Element]] = []
    for given in quantity.given:
        if given.index[0] != index[0] or given.tree is None:
            continue
        answer = reader.element(given.tree)
        if answer is None:
            return None
        if answer != right[given.index]:
            differing.append((answer, right[given.index]))
    if len(differing) != 1:
        return None
    answer, entry = differing[0]
    names = (identity for identity, factor in FACTORS.items() if answer == entry * factor)
    identity = next(names, None)
    return slip_between(truth, "C", answer, entry) if identity is None or len(entry) == 1 else Slip(identity, "")


def _is_weight(truth: Truth, difference: Element) -> bool:
    """Whether a torque contains the parameter of the gravitational acceleration, if that is a parameter."""
    names = {name for x in truth.description.gravity for name in x.symbols}
    places = [k for k, g in enumerate(difference.ring.generators) if g.text in names]
    return not places or all(any(monomial[k] for k in places) for monomial in difference.terms)


def distinct(quantity: JudgedQuantity) -> list[Index]:
    """Return the indices of wrong entries; of C those of one entry in each wrong row."""
    wrong = quantity.wrong_indices
    if quantity.name != "C":
        return wrong
    rows = {place_of("C", index): index for index in reversed(wrong)}
    return sorted(rows.values())


def mirrored(quantity: JudgedQuantity, index: Index) -> Diagnosis | None:
    """Return the diagnosis of an entry of M whose mirror image is right; None for other entries."""
    if quantity.name != "M" or index[0] == index[1] or not quantity.findings[index[::-1]].verdict.passes:
        return None
    return diagnosis_of_slip(quantity, index, Slip("mass_matrix_not_symmetric", ""))


def whole_factor(quantity: JudgedQuantity, index: Index) -> Diagnosis | None:
    """Return the diagnosis of an entry that is the right one times -1, 1/2, 2 or 0; None for other entries."""
    difference = quantity.findings[index].difference
    right = quantity.right(index)
    if difference is None or not right:
        return None
    for name, factor in FACTORS.items():
        if difference == right * (factor - 1):
            return diagnosis_of_slip(quantity, index, Slip(name, ""))
    return None


def described(truth: Truth, quantity: JudgedQuantity, index: Index) -> Diagnosis:
    """Return a diagnosis without a mistake, which compares the terms of a wrong entry with the right ones."""
    finding = quantity.findings[index]
    right = quantity.right(index)
    entry = entry_name(quantity.name, index)
    terms = ""
    element = finding.answer.element() if finding.answer is not None else None
    if element is None:
        text = finding.statement
    elif len(element) > BOUNDS.described_terms:
        text = f"{len(element)} terms, where {len(right)} are right"
    else:
        own = truth.coordinates.in_own_rates
        text, terms = compare_terms(truth.arm(quantity.name), own(element), own(right))
    sentence = capitalize(f"{in_own_angles(truth, text)}.")
    return Diagnosis(None, sentence, entry, (entry,), hint_of(None), second_hint=in_own_angles(truth, terms))


def compare_terms(arm: ExactArm, answer: Element, truth: Element) -> tuple[str, str]:
    """Return in words how the terms of an answer differ from those of the truth, and what is right in their place.

    Parameters
    ----------
    arm
        Arm to whose ring the elements belong.
    answer, truth
        Elements of the ring.
    """
    # All three in the angles in which they differ least: c12 is one term, c1*c2 - s1*s2 are two.
    truth, answer, _ = shortened_alike(arm, [truth, answer, answer - truth])
    ours = truth.terms
    theirs = answer.terms
    ring = truth.ring

    def text(terms: dict[tuple[int, ...], Fraction]) -> str:
        return plain_text(ring.from_terms(terms))

    differences = {
        "missing": [text({m: c}) for m, c in ours.items() if m not in theirs],
        "too much": [text({m: c}) for m, c in theirs.items() if m not in ours],
        "another factor": [text({m: theirs[m]}) for m, c in ours.items() if m in theirs and theirs[m] != c],
    }
    right = [text({m: c}) for m, c in ours.items() if m not in theirs or theirs[m] != c]
    listed = {kind: _few(terms) for kind, terms in differences.items() if terms}
    missing = differences["missing"]
    parts = [f"{kind}: {terms}" for kind, terms in listed.items() if kind != "missing"]
    if missing:
        kind = kind_of_terms(arm, ring.from_terms({m: c for m, c in ours.items() if m not in theirs}))
        count = f"{len(missing)} terms are missing" if len(missing) > 1 else "a term is missing"
        parts.insert(0, f"{count}, with {kind}" if kind else count)
    return "; ".join(parts) or "the terms are the same", _few(right)


def _few(terms: Sequence[str]) -> str:
    more = f" and {len(terms) - _MAX_NAMED_TERMS} more" if len(terms) > _MAX_NAMED_TERMS else ""
    return ", ".join(terms[:_MAX_NAMED_TERMS]) + more
