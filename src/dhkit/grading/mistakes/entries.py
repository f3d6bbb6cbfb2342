"""What is wrong in one entry: its factor, its mirror image, a slip in one of its terms, or its terms in words."""

from __future__ import annotations

from dhkit.errors import AnswerError
from dhkit.grading.capitals import capitalised
from dhkit.grading.judging.coordinates import ANGLE
from dhkit.grading.judging.findings import readable
from dhkit.grading.judging.quantities import JudgedQuantity
from dhkit.grading.judging.quotients import OutsideTheRingError, Reading
from dhkit.grading.judging.truth import Truth
from dhkit.grading.mistakes.diagnosis import Index, place_of, varying
from dhkit.grading.mistakes.library import FACTORS, hint_of
from dhkit.grading.mistakes.slips import Slip, slip_in
from dhkit.grading.mistakes.terms import describe
from dhkit.grading.mistakes.wording import diagnosis_of_identity, entry_names, wrong_entries
from dhkit.grading.report import Diagnosis
from dhkit.symbolic.equations import plain_text
from dhkit.symbolic.ring import Element

MAX_TERMS = 150
"""Terms in which an entry may differ for a slip in one of them to be looked for."""
MAX_DESCRIBED = 600
"""Terms of an entry that is described term by term."""


def slip_of(truth: Truth, quantity: JudgedQuantity, index: Index) -> Slip | None:
    """Return the one slip in a term of a wrong entry; None where there is none, or more."""
    difference, right = quantity.findings[index].difference, quantity.right(index)
    if difference is None or difference.is_zero or len(difference) > MAX_TERMS:
        return None
    arm = truth.arm(quantity.name)
    if quantity.name in ("V", "L"):  # they count from any zero
        difference, right = varying(difference), varying(right)
    if quantity.name == "g" and not right and _is_weight(truth, difference):
        return Slip("weight_on_vertical_axis", plain_text(readable(arm, difference)))
    return slip_shown(truth, quantity.name, right + difference, right)


def slip_shown(truth: Truth, name: str, answer: Element, right: Element) -> Slip | None:
    """Return the slip that makes an answer of the truth, in the student's own rates and angles."""
    own = truth.coordinates.in_own_rates
    slip = slip_in(truth.arm(name), own(answer), own(right))
    return None if slip is None else Slip(slip.identity, in_own_angles(truth, slip.detail))


def in_own_angles(truth: Truth, text: str) -> str:
    """Return a formula's text in the student's own angles."""
    if any(ANGLE.fullmatch(name) for name in truth.description.parameters):
        return text
    return truth.coordinates.in_own_angles(text)


def slip_of_C(truth: Truth, quantity: JudgedQuantity, index: Index) -> Slip | None:
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
    return slip_shown(truth, "C", answer, entry) if identity is None or len(entry) == 1 else Slip(identity, "")


def _is_weight(truth: Truth, difference: Element) -> bool:
    """Whether a torque holds the parameter that gravity is given by, or there is none."""
    names = {name for x in truth.description.gravity for name in x.symbols}
    places = [k for k, g in enumerate(difference.ring.generators) if g.text in names]
    return not places or all(any(monomial[k] for k in places) for monomial in difference.terms)


def distinct(quantity: JudgedQuantity) -> list[Index]:
    """Return wrong entries, of C one a row."""
    wrong = wrong_entries(quantity)
    if quantity.name != "C":
        return wrong
    rows = {place_of("C", index): index for index in reversed(wrong)}
    return sorted(rows.values())


def mirrored(quantity: JudgedQuantity, index: Index) -> Diagnosis | None:
    """Return what is said of an entry of M whose mirror image is right; None of any other."""
    if quantity.name != "M" or index[0] == index[1] or not quantity.findings[index[::-1]].verdict.passes:
        return None
    (entry,) = entry_names(quantity, [index])
    return diagnosis_of_identity("mass_matrix_not_symmetric", quantity, [index], entry)


def whole_factor(quantity: JudgedQuantity, index: Index) -> Diagnosis | None:
    """Return what is said of an entry that is the right one times -1, 1/2, 2 or 0; None of any other."""
    difference, right = quantity.findings[index].difference, quantity.right(index)
    if difference is None or not right:
        return None
    for name, factor in FACTORS.items():
        if difference == right * (factor - 1):
            (entry,) = entry_names(quantity, [index])
            return diagnosis_of_identity(name, quantity, [index], entry)
    return None


def described(truth: Truth, quantity: JudgedQuantity, index: Index) -> Diagnosis:
    """Return what the terms of a wrong entry show where no mistake is known."""
    finding, right = quantity.findings[index], quantity.right(index)
    (entry,) = entry_names(quantity, [index])
    element = finding.answer.element() if finding.answer is not None else None
    if element is None:
        words = finding.statement
    elif len(element) > MAX_DESCRIBED:
        words = f"{len(element)} terms, where {len(right)} are right"
    else:
        own = truth.coordinates.in_own_rates
        words = in_own_angles(truth, describe(truth.arm(quantity.name), own(element), own(right)))
    return Diagnosis(None, capitalised(f"{words}."), entry, (entry,), hint_of(None))
