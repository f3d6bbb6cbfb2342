"""Laws of the search for mistakes: each catalogue of variants, slips in terms, and what a report says of them."""

from itertools import chain, islice

import pytest

from dhkit.description import library_robot
from dhkit.expressions import read
from dhkit.grading.answers.sheet import sheet_of
from dhkit.grading.catalogue import LIBRARY
from dhkit.grading.grade_report import Diagnosis, Entry, GradeReport, Verdict
from dhkit.grading.judging.quotients import RingReader
from dhkit.grading.judging.truth import right_value, truth_of
from dhkit.grading.marks import marks
from dhkit.grading.mistakes import entries, plain_causes
from dhkit.grading.mistakes.energy_variants import energy_variants
from dhkit.grading.mistakes.equation_variants import equation_variants, lagrangian_sum
from dhkit.grading.mistakes.explaining import explain
from dhkit.grading.mistakes.parameter_variants import lengths_of, parameter_variants
from dhkit.grading.mistakes.slips import slip_in
from dhkit.grading.mistakes.sums_of_angles import derivatives_of_cosines
from dhkit.grading.mistakes.variants import Change
from dhkit.grading.mistakes.wording import merge
from dhkit.grading.reports.html import html_report
from dhkit.grading.reports.json import report_of
from dhkit.grading.reports.sentences import diagnosis_lines, plain, points
from dhkit.grading.reports.terminal import terminal_report
from dhkit.grading.rubric import Rubric
from dhkit.grading.sheet_judge import judge_sheet

ARM = library_robot("planar2r")


def truth():
    return truth_of(ARM)


def test_every_variant_is_a_mistake_of_the_library():
    variants = [
        *energy_variants(truth()),
        *equation_variants(truth()),
        *parameter_variants(truth()),
    ]
    assert {variant.identity for variant in variants} <= LIBRARY.keys()
    assert derivatives_of_cosines(truth()).identity in LIBRARY
    assert {variant.rarity for variant in variants} == {0, 1, 2}


def test_torques_change_by_the_sum_of_their_parts():
    """The equations are linear in the energies: so are the changes that a variant makes."""
    lag = truth().lagrangian
    rates = [lag.arm.ring.acceleration(i) for i in range(2)]
    for variant in islice(chain([lagrangian_sum(truth())], energy_variants(truth())), 1, 12):
        parts = variant.adds("M") @ rates + variant.adds("h") + variant.adds("g")
        assert all(difference == 0 for difference in parts - variant.adds("tau"))


def test_the_change_of_all_energy_is_all_of_the_equation():
    lag = truth().lagrangian
    change = Change(lag.K, lag.V)
    for quantity in ("M", "h", "g", "tau", "K", "V", "L"):
        assert all(
            a == b
            for a, b in zip(change.of(quantity).flat, right_value(lag, quantity).flat, strict=True)
        )


@pytest.mark.parametrize(
    ("answer", "right", "identity"),
    [
        ("m1*l1 - m2*l2", "m1*l1 + m2*l2", "term_sign"),
        ("m1*l1", "m1*l1 + m2*l2", "term_missing"),
        ("m1*l1 + 2*m2*l2", "m1*l1 + m2*l2", "term_factor"),
        ("m1*l2 + m2*l2", "m1*l1 + m2*l2", "term_parameter"),
        ("m1*sin(q1) + m2", "m1*cos(q1) + m2", "term_function"),
    ],
)
def test_a_slip_in_a_term(answer, right, identity):
    arm = truth().arm("M")
    reader = RingReader(arm.ring)
    elements = [reader.read(read(text)).element() for text in (answer, right)]
    assert slip_in(arm, *elements).identity == identity
    assert entries.compare_terms(arm, *elements)


def test_lengths_are_known_by_their_use():
    assert {"l1", "l2"} <= set(lengths_of(ARM))


def test_zeros_show_by_themselves_and_nothing_wrong_is_explained_by_nothing():
    zeros = {"h": ["0", "0"]}
    assert (
        judge_sheet(ARM, sheet_of({"answer": zeros}), seed=1).diagnosis[0].mistake
        == "velocity_torques_missing"
    )
    assert explain(truth(), {}) == []
    assert plain_causes.zeros(truth(), {}, set()) == {}


def test_one_sentence_for_one_mistake():
    said = [
        Diagnosis("x", "It is wrong.", "M", ("M11",)),
        Diagnosis("x", "It is wrong.", "g", ("g1",)),
    ]
    (one,) = merge(said)
    assert (one.where, one.entries) == ("M, g", ("M11", "g1"))


def test_a_report_is_the_same_in_every_form():
    report = GradeReport(
        "arm",
        entries=(Entry("V", (), Verdict.WRONG, "1"),),
        diagnosis=(Diagnosis("x", "So.", "V"),),
    )
    sheet = marks(report, Rubric())
    assert report_of(report.to_json()) == report
    assert list(diagnosis_lines(report)) == ["V: So."]
    assert "V: So." in html_report(report, sheet)
    assert terminal_report(report, sheet)
    assert (plain("a\n b"), points(2.50)) == ("a b", "2.5")
