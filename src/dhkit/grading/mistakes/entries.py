"""Errors in one entry: a factor, a mirror image, a slip in a term; or a description of its terms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

from dhkit.grading.catalogue import FACTORS, capitalize, hint_of
from dhkit.grading.grade_report import Diagnosis, entry_name
from dhkit.grading.judging.coordinates import ANGLE
from dhkit.grading.judging.findings import Finding, readable
from dhkit.grading.judging.quantities import Index, JudgedQuantity, place_of
from dhkit.grading.judging.quotients import varying
from dhkit.grading.judging.truth import Truth
from dhkit.grading.mistakes.bounds import BOUNDS
from dhkit.grading.mistakes.slips import Slip, kind_of_terms, slip_in
from dhkit.grading.mistakes.wording import diagnosis_of_slip
from dhkit.symbolic import ExactArm
from dhkit.symbolic.equations import plain_text
from dhkit.symbolic.exact.compact import shortened_alike
from dhkit.symbolic.ring import Element, Monomial

_MAX_NAMED_TERMS = 3
"""Largest number of terms of each kind that a description names."""


def slip_of(truth: Truth, quantity: JudgedQuantity, index: Index) -> Slip | None:
    """Return the slip in a term of a wrong entry; None if there is none, or more than one."""
    difference = quantity.findings[index].difference
    right = quantity.right(index)
    if difference is None or difference.is_zero or len(difference) > BOUNDS.compared_terms:
        return None
    arm = truth.arm(quantity.name)
    if quantity.name in ("V", "L"):
        # Energies count from any zero.
        difference = varying(difference)
        right = varying(right)
    if quantity.name == "g" and not right and _is_weight(truth, difference):
        return Slip("weight_on_vertical_axis", plain_text(readable(arm, difference)))
    return slip_between(truth, quantity.name, right + difference, right)


def slip_between(truth: Truth, name: str, answer: Element, right: Element) -> Slip | None:
    """Return the slip that turns the truth into an answer, in the student's own rates and angles."""
    own = truth.coordinates.in_student_rates
    slip = slip_in(truth.arm(name), own(answer), own(right))
    if slip is None:
        return None
    return replace(
        slip,
        detail=in_student_angles(truth, slip.detail),
        right=in_student_angles(truth, slip.right),
    )


def in_student_angles(truth: Truth, text: str) -> str:
    """Return a printed formula in the student's own angles."""
    if any(ANGLE.fullmatch(name) for name in truth.description.parameters):
        return text
    return truth.coordinates.in_student_angles(text)


def shown_in_student_angles(truth: Truth, quantity: str, finding: Finding) -> Finding:
    """Return a finding whose difference and state are written in the student's own angles and rates."""
    coordinates = truth.coordinates
    if coordinates.is_relative:
        return finding
    texts = finding.texts
    if finding.difference is not None:
        own = readable(truth.arm(quantity), coordinates.in_student_rates(finding.difference))
        texts = (in_student_angles(truth, plain_text(own)), "")
    witness = finding.witness
    if witness is not None:
        witness = replace(witness, state=coordinates.student_state(witness.state))
    return replace(finding, texts=texts, witness=witness)


def slip_of_C(truth: Truth, quantity: JudgedQuantity, index: Index) -> Slip | None:
    """Return the slip in the only entry of a row of C that differs from the Christoffel factorization.

    None if several entries of the row differ, or if there is no slip.
    """
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
    factors = [identity for identity, factor in FACTORS.items() if answer == entry * factor]
    if factors and len(entry) != 1:
        return Slip(factors[0], "")
    return slip_between(truth, "C", answer, entry)


def _is_weight(truth: Truth, difference: Element) -> bool:
    """Whether all terms of a torque contain the gravitational acceleration; True if that is not a parameter."""
    names: set[str] = set()
    for component in truth.description.gravity:
        names |= component.symbols
    places = [
        k for k, generator in enumerate(difference.ring.generators) if generator.text in names
    ]
    if not places:
        return True

    def contains_gravity(monomial: Monomial) -> bool:
        return any(monomial[k] for k in places)

    return all(map(contains_gravity, difference.terms))


def distinct(quantity: JudgedQuantity) -> list[Index]:
    """Return the indices of wrong entries; of C those of one entry in each wrong row."""
    wrong = quantity.wrong_indices
    if quantity.name != "C":
        return wrong
    rows = {place_of("C", index): index for index in reversed(wrong)}
    return sorted(rows.values())


def mirrored(quantity: JudgedQuantity, index: Index) -> Diagnosis | None:
    """Return the diagnosis of an entry of M whose mirror image is right; None for other entries."""
    if quantity.name != "M" or index[0] == index[1]:
        return None
    mirror_image = quantity.findings[index[::-1]]
    if not mirror_image.verdict.passes:
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
        own = truth.coordinates.in_student_rates
        text, terms = compare_terms(truth.arm(quantity.name), own(element), own(right))
    sentence = capitalize(f"{in_student_angles(truth, text)}.")
    return Diagnosis(
        None, sentence, entry, (entry,), hint_of(None), second_hint=in_student_angles(truth, terms)
    )


def compare_terms(arm: ExactArm, answer: Element, truth: Element) -> tuple[str, str]:
    """Return the differences of an answer's terms from those of the truth in words, and the right terms instead.

    Parameters
    ----------
    arm
        Arm to whose ring the elements belong.
    answer, truth
        Elements of the ring.
    """
    # All three in the angles in which they differ least: c12 is one term, c1*c2 - s1*s2 are two.
    truth, answer, _ = shortened_alike(arm, [truth, answer, answer - truth])
    right = truth.terms
    given = answer.terms
    ring = truth.ring

    def texts(terms: dict[tuple[int, ...], Fraction]) -> list[str]:
        return [
            plain_text(ring.from_terms({monomial: coefficient}))
            for monomial, coefficient in terms.items()
        ]

    missing = {m: c for m, c in right.items() if m not in given}
    too_much = {m: c for m, c in given.items() if m not in right}
    with_other_factor = {m: given[m] for m, c in right.items() if m in given and given[m] != c}

    parts = []
    if missing:
        kind = kind_of_terms(arm, ring.from_terms(missing))
        count = f"{len(missing)} terms are missing" if len(missing) > 1 else "a term is missing"
        parts.append(f"{count}, with {kind}" if kind else count)
    if too_much:
        parts.append(f"too much: {_few(texts(too_much))}")
    if with_other_factor:
        parts.append(f"another factor: {_few(texts(with_other_factor))}")

    instead = {m: c for m, c in right.items() if m in missing or m in with_other_factor}
    return "; ".join(parts) or "the terms are the same", _few(texts(instead))


def _few(terms: Sequence[str]) -> str:
    """Return a list of the first terms, and the number of the others."""
    more = f" and {len(terms) - _MAX_NAMED_TERMS} more" if len(terms) > _MAX_NAMED_TERMS else ""
    return ", ".join(terms[:_MAX_NAMED_TERMS]) + more
