"""Mistakes that an answer shows by itself: degrees, other units, inverted gears, zeros, too few digits."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from fractions import Fraction
from functools import partial

from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Name, Number, Product, Tree
from dhkit.expressions.trees import names_of
from dhkit.grading.catalogue import UNITS
from dhkit.grading.grade_report import Diagnosis, Verdict
from dhkit.grading.judging.changed_formulas import renamed
from dhkit.grading.judging.findings import Comparison, equal
from dhkit.grading.judging.quantities import JudgedQuantity
from dhkit.grading.judging.quotients import OutsideTheRingError, RingReader
from dhkit.grading.judging.rounding import has_decimals
from dhkit.grading.judging.truth import DYNAMICS, Truth, exact_number, substituted
from dhkit.grading.mistakes.diagnosis import Variants, variants_of
from dhkit.grading.mistakes.entries import mirrored, slip_of, slip_of_C
from dhkit.grading.mistakes.parameter_variants import lengths_of
from dhkit.grading.mistakes.wording import diagnosis_of_slip, diagnosis_of_whole
from dhkit.symbolic.ring import Elements

_DEGREE_FACTORS = (Fraction(1, 180), Fraction(180))
"""Factors, besides pi and 1/pi, of angles in which degrees and radians are confused."""
_ZEROS = {
    "h": "velocity_torques_missing",
    "C": "velocity_torques_missing",
    "g": "gravity_torques_missing",
}
"""Mistake if all entries of a quantity are zero, by the quantity; ``entry_zero`` for others."""
_RATE = re.compile(r"qd\d+")
"""Names of rates."""
_MIN_DIGITS = 2
"""Smallest number of significant digits of decimals that count as too short rather than wrong."""


def in_degrees(
    truth: Truth, wrong: Mapping[str, JudgedQuantity]
) -> dict[tuple[str, ...], Diagnosis]:
    """Return the diagnoses of quantities that are right without the factors pi/180 or 180/pi of their angles."""
    diagnoses: dict[tuple[str, ...], Diagnosis] = {}
    for name, quantity in wrong.items():
        readers = [
            RingReader(truth.arm(name).ring, angle_factor=factor) for factor in _DEGREE_FACTORS
        ]
        if name != "C" and any(_is_right(quantity, reader) for reader in readers):
            diagnoses[(name,)] = diagnosis_of_whole(quantity, "degrees_for_radians")
    return diagnoses


def _is_right(
    quantity: JudgedQuantity, reader: RingReader, change: Callable[[Tree], Tree] = lambda tree: tree
) -> bool:
    """Whether all wrong entries are right after a change, or with another reader."""
    for entry in quantity.given:
        if quantity.findings[entry.index].verdict is not Verdict.WRONG:
            continue
        if entry.tree is None:
            return False
        try:
            answer = reader.read(change(entry.tree))
            if not answer.numerator_of_difference(quantity.right(entry.index)).is_zero:
                return False
        except (OutsideTheRingError, AnswerError):
            return False
    return True


def with_inverted_gears(
    truth: Truth, wrong: Mapping[str, JudgedQuantity]
) -> dict[tuple[str, ...], Diagnosis]:
    """Return the diagnoses of quantities that are right if the gear ratios in them are inverted.

    They are ratios in letters; for ratios in numbers there are variants.
    """
    gears: set[str] = set()
    for joint in truth.description.joints:
        if joint.drive:
            gears |= joint.drive.gear.symbols
    if not gears:
        return {}

    one = Number(Fraction(1), "1", 0)
    inverses: dict[str, Tree] = {
        name: Product(((True, one), (False, Name(name, 0)))) for name in gears
    }
    invert = partial(renamed, change=inverses)
    diagnoses: dict[tuple[str, ...], Diagnosis] = {}
    for name, quantity in wrong.items():
        if name in ("M", "K", "tau") and _is_right(
            quantity, RingReader(truth.arm(name).ring), invert
        ):
            diagnoses[(name,)] = diagnosis_of_whole(quantity, "gear_inverted")
    return diagnoses


def weights_on_vertical_axes(
    truth: Truth, left: dict[str, JudgedQuantity], following: set[str]
) -> list[Diagnosis]:
    """Remove g from ``left`` if its only errors are torques at joints that have none; return their diagnoses."""
    g = left.get("g")
    if g is None or "g" in following or any(g.right(index) for index in g.wrong_indices):
        return []
    slips = [slip_of(truth, g, index) for index in g.wrong_indices]
    weights = [
        slip for slip in slips if slip is not None and slip.identity == "weight_on_vertical_axis"
    ]
    if len(weights) < len(slips):
        return []
    del left["g"]
    alike = equivalent(truth, g)
    pairs = zip(g.wrong_indices, weights, strict=True)
    return [replace(diagnosis_of_slip(g, index, slip), equivalent=alike) for index, slip in pairs]


def one_entry_of_C(
    truth: Truth, left: dict[str, JudgedQuantity], following: set[str]
) -> list[Diagnosis]:
    """Remove C from ``left`` if a single entry is not the Christoffel factorization's; return its diagnosis."""
    C = left.get("C")
    wrong = C.wrong_indices if C is not None else []
    if C is None or "C" in following or len(wrong) != 1 or len(C.given) < C.truth.size**2:
        return []
    slip = slip_of_C(truth, C, wrong[0])
    if slip is None:
        return []
    del left["C"]
    return [replace(diagnosis_of_slip(C, wrong[0], slip), equivalent=equivalent(truth, C))]


def zeros(
    truth: Truth, left: Mapping[str, JudgedQuantity], following: set[str]
) -> dict[tuple[str, ...], Diagnosis]:
    """Return the diagnoses of quantities that were handed in as zero."""
    diagnoses: dict[tuple[str, ...], Diagnosis] = {}
    for name, quantity in left.items():
        wrong = quantity.wrong_indices
        if (
            name in following
            or not quantity.is_zero
            or any(mirrored(quantity, index) for index in wrong)
        ):
            continue
        identity = _ZEROS.get(name, "entry_zero") if len(quantity.given) > 1 else "entry_zero"
        diagnoses[(name,)] = replace(
            diagnosis_of_whole(quantity, identity), equivalent=equivalent(truth, quantity)
        )
    return diagnoses


def without_rates(
    left: Mapping[str, JudgedQuantity], following: set[str]
) -> dict[tuple[str, ...], Diagnosis]:
    """Return the diagnoses of C and h if they are not zero and contain no rate."""
    diagnoses: dict[tuple[str, ...], Diagnosis] = {}
    for name in ("C", "h"):
        quantity = left.get(name)
        if quantity is None or name in following or quantity.is_zero:
            continue
        trees = [entry.tree for entry in quantity.given if entry.tree is not None]
        names = set().union(*map(names_of, trees))
        if trees and not any(map(_RATE.fullmatch, names)):
            diagnoses[(name,)] = diagnosis_of_whole(quantity, "rates_missing")
    return diagnoses


def in_other_units(
    truth: Truth, left: Mapping[str, JudgedQuantity]
) -> dict[tuple[str, ...], Diagnosis]:
    """Return the diagnoses of quantities with lengths as numbers in another unit; other parameters may be symbols."""
    diagnoses: dict[tuple[str, ...], Diagnosis] = {}
    lengths = lengths_of(truth.description)
    for name, quantity in left.items():
        trees = [entry.tree for entry in quantity.given if entry.tree is not None]
        names = set().union(*map(names_of, trees))
        absent = [parameter for parameter in lengths if parameter not in names]
        ring = truth.arm(name).ring
        if (
            name not in DYNAMICS
            or name == "C"
            or not absent
            or not set(absent) <= set(ring.constants)
        ):
            continue
        for identity, factor in UNITS.items():
            values = {p: ring.number(exact_number(truth.description, p) * factor) for p in absent}
            if _has_answers(quantity, substituted(truth.of(name), values, ring)):
                diagnoses[(name,)] = diagnosis_of_whole(quantity, identity)
    return diagnoses


def _has_answers(quantity: JudgedQuantity, expected: Elements) -> bool:
    """Whether all wrong entries equal the expected ones."""
    answers = [(index, quantity.findings[index].answer) for index in quantity.wrong_indices]
    return all(
        answer is not None and answer.numerator_of_difference(expected[index]).is_zero
        for index, answer in answers
    )


def too_few_digits(
    truth: Truth, judged: Mapping[str, JudgedQuantity], quantity: JudgedQuantity
) -> list[Diagnosis]:
    """Return the diagnosis of decimals that would be right within rounding if fewer digits were enough."""
    name = quantity.name
    if name in ("C", "V", "L"):
        return []
    by = Comparison(truth.arm(name), truth.reader(name), _MIN_DIGITS)
    wrong = quantity.wrong_indices
    for entry in quantity.given:
        if entry.index in wrong:
            if entry.tree is None or not has_decimals(entry.tree, _MIN_DIGITS):
                return []
            if not equal(entry.tree, quantity.truth[entry.index], by):
                return []
    return [diagnosis_of_whole(quantity, "too_few_digits")]


def equivalent(truth: Truth, quantity: JudgedQuantity) -> tuple[str, ...]:
    """Return the names of the mistakes that give a whole quantity."""
    differences = quantity.differences
    variants = tables_of(truth, quantity).whole(quantity.name, differences) if differences else []
    return tuple(dict.fromkeys(variant.name for variant in variants))


def tables_of(truth: Truth, quantity: JudgedQuantity) -> Variants:
    """Return the mistakes on the robot, with the numbers that an answer has for parameters."""
    return variants_of(truth, quantity.numbers)
