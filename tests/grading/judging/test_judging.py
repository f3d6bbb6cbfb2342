"""Laws of the parts of judging: each module that compares answers with the truth, by itself."""

from fractions import Fraction

import mpmath
import numpy as np
import pytest

from dhkit.description import Convention, library_robot, link_transforms
from dhkit.expressions import read
from dhkit.grading.answers.sheet import sheet_of
from dhkit.grading.grade_report import Verdict
from dhkit.grading.isolation import WorkerLimits, result_of
from dhkit.grading.judging import changed_formulas
from dhkit.grading.judging.consistency import Consistency
from dhkit.grading.judging.coordinates import Coordinates
from dhkit.grading.judging.enclosures import LostDigitsError, TooLargeError, enclosed
from dhkit.grading.judging.findings import Comparison, compare
from dhkit.grading.judging.frame_changes import Change, frame_changes, joint_changes
from dhkit.grading.judging.inverse_branch import Branch, joint_order
from dhkit.grading.judging.inverse_edits import ORDER, Lengths, edits
from dhkit.grading.judging.inverse_mistakes import MistakeSearch
from dhkit.grading.judging.inverse_poses import Poses
from dhkit.grading.judging.numeric import doubles
from dhkit.grading.judging.quantities import place_of
from dhkit.grading.judging.quotients import RingReader, multiple_angle, sum_of_angles
from dhkit.grading.judging.rounding import rounding_share
from dhkit.grading.judging.same_arm import overlaid
from dhkit.grading.judging.sampling import differ, element_value, samples
from dhkit.grading.judging.table_arms import TableArm, link_in_doubles
from dhkit.grading.judging.table_rows import Answer, TableRows, other_convention
from dhkit.grading.judging.truth import truth_of
from dhkit.grading.sheet_judge import judge_sheet
from dhkit.symbolic import exact_arm

ARM = library_robot("planar2r")
POLAR = library_robot("polar_rp")
CLOSE = 1e-12  # doubles of a few operations, relative to numbers of size 1


def ring():
    return exact_arm(ARM, "file").ring


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("sin(q1)^2 + cos(q1)^2", "1"),
        ("(1 + l1)/(1 + l1)", "1"),
        ("sin(3*q1)", "3*sin(q1) - 4*sin(q1)^3"),
    ],
)
def test_equal_texts_are_one_quotient(text, value):
    reader = RingReader(ring())
    assert reader.read(read(text)).equals(reader.read(read(value)))


def test_divisors_are_noted_unless_they_are_numbers():
    reader = RingReader(ring())
    reader.read(read("qd1/2 + 1/cos(q1)"))
    assert [str(divisor) for divisor in reader.divisors] == ["c1"]


@pytest.mark.parametrize("times", [-3, -1, 1, 2, 5])
def test_a_multiple_of_an_angle_is_a_sum_of_angles(times):
    single = (ring().cosine(0), ring().sine(0) * (1 if times > 0 else -1))
    assert multiple_angle(ring(), 0, times) == sum_of_angles(ring(), [single] * abs(times))


def test_an_interval_has_the_digits_that_are_needed():
    value, digits = enclosed(read("(10^250 + 1) - 10^250"), 5, {}, mpmath.mpf("1e-20"))
    assert value == 1
    assert digits == 250
    with pytest.raises(TooLargeError):
        enclosed(read("exp(exp(exp(10)))"), 4, {}, mpmath.mpf("1e-20"))
    with pytest.raises(LostDigitsError):
        enclosed(read("sqrt(sin(pi)^2 - sin(pi)^2)"), 9, {}, mpmath.mpf("1e-20"))


def test_a_sample_gives_an_element_and_its_text_one_value():
    arm, text = exact_arm(ARM, "file"), "l1*cos(q1) - l2*sin(q1 + q2)*qd1^2"
    element = RingReader(arm.ring).read(read(text)).element()
    with mpmath.workdps(50):
        for sample in samples(arm, frozenset(), seed=3, count=9):
            value, _ = enclosed(read(text), 12, sample.names, mpmath.mpf("1e-30"))
            assert not differ(element_value(element, sample), value)


@pytest.mark.parametrize(
    ("text", "verdict"),
    [
        ("l1*cos(q1)", Verdict.CORRECT),
        ("l1*sin(q1)", Verdict.WRONG),
        ("l1*sqrt(1 - sin(q1)^2)", Verdict.WRONG),
    ],
)
def test_a_wrong_entry_has_a_witness(text, verdict):
    arm = exact_arm(ARM, "file")
    truth = RingReader(arm.ring).read(read("l1*cos(q1)")).element()
    finding = compare(read(text), truth, Comparison(arm, RingReader(arm.ring), seed=1))
    assert finding.verdict is verdict
    assert (finding.witness is None) == (verdict is Verdict.CORRECT)
    if finding.witness is not None:
        assert doubles(read(text), finding.witness.state) == pytest.approx(finding.witness.answer)


@pytest.mark.parametrize(
    ("text", "passes"),
    [("0.3333*l1", True), ("0.3335*l1", False), ("0.3333*l1 + 0.00001*l2", False)],
)
def test_rounding_is_judged_coefficient_by_coefficient(text, passes):
    reader = RingReader(ring())
    truth = reader.read(read("l1/3")).element()
    share = rounding_share(
        read(text), truth, reader, lambda answer, x: [answer.numerator_of_difference(x)], 4
    )
    assert (share is not None) == passes


def test_coordinates_are_inverse_and_relative_ones_change_nothing():
    absolute = Coordinates.absolute(exact_arm(ARM, "file"))
    assert np.array_equal(absolute.B @ absolute.S, np.eye(2))
    assert absolute.sums == ((0,), (0, 1))
    assert Coordinates.relative(2).in_student_angles("c12") == "c12"
    assert absolute.in_student_angles("c12 + s2") == "cos(q2) + sin(q2 - q1)"


def test_c_is_judged_by_rows():
    assert place_of("C", (1, 0)) == (1,)
    assert place_of("M", (1, 0)) == (1, 0)


def test_what_follows_from_a_wrong_answer_is_told():
    truth = truth_of(ARM)
    wrong = {"V": f"2*({truth.of('V')[()]})", "g": [f"2*({x})" for x in truth.of("g")]}
    report = judge_sheet(ARM, sheet_of({"answer": wrong}), seed=1)
    assert {entry.follows for entry in report.of("g")} == {"V"}
    assert Consistency(truth, {}).notes() == []


def test_parts_of_formulas_are_replaced():
    tree = read("atan2(py, px) + q1")
    names = {"px": read("py"), "py": read("px")}
    values = {"px": 0.2, "py": 0.7, "q1": 1.0}
    swapped = changed_formulas.renamed(tree, names)
    turned = changed_formulas.with_calls_changed(
        tree, ("atan2",), changed_formulas.exchange_arguments
    )
    assert (
        doubles(swapped, values)
        == doubles(turned, values)
        == pytest.approx(np.arctan2(0.2, 0.7) + 1)
    )
    assert changed_formulas.renamed(tree, {}) is tree


@pytest.mark.parametrize("name", ["planar2r", "puma560", "puma560_cao"])
def test_link_transforms_are_the_descriptions(name):
    description = library_robot(name)
    q = np.linspace(-0.7, 1.1, description.n)
    numbers = description.numbers
    theta = np.arctan2(numbers.sin_theta, numbers.cos_theta) + np.where(numbers.prismatic, 0, q)
    d = numbers.d + np.where(numbers.prismatic, q, 0)
    alpha = np.arctan2(numbers.sin_alpha, numbers.cos_alpha)
    A = link_in_doubles(description.convention, theta, d, numbers.a, alpha)
    assert np.max(np.abs(A - link_transforms(description, q))) < CLOSE


def test_an_arm_is_itself_and_other_frames_are_named():
    entries = np.array([[0.0, 0.0, 0.5, 0.0], [0.0, 0.0, 0.4, 0.0]])
    truth = TableArm(Convention.STANDARD, "RR", entries, np.ones(2))
    assert overlaid(truth, truth, strict=True).changes == ()
    other = TableArm(
        Convention.STANDARD, "RR", entries + np.array([[0, 0.1, 0, 0], [0, -0.1, 0, 0]]), np.ones(2)
    )
    assert {change.change for change in overlaid(other, truth, strict=True).changes} == {
        Change.FRAME_SLID
    }
    longer = TableArm(
        Convention.STANDARD, "RR", entries + np.array([[0, 0, 0.1, 0], [0, 0, 0, 0]]), np.ones(2)
    )
    assert overlaid(longer, truth, strict=True) is None


def test_changes_of_frames_and_joints():
    assert list(frame_changes(1, np.eye(4), 1e-9)) == []
    assert [change.change for change in frame_changes(1, np.diag([-1.0, 1, -1, 1]), 1e-9)] == [
        Change.Z_REVERSED,
        Change.X_REVERSED,
    ]
    assert [str(change) for change in joint_changes(2, True, -1, np.pi, 1e-9)] == [
        "q2 is counted the other way round",
        "q2 is counted from the other end: by 180 degrees",
    ]


def test_a_row_is_proved_or_differs():
    trees = [
        [read(entry) for entry in row] for row in (("q1", "0", "l1", "0"), ("q2", "0", "l1", "0"))
    ]
    table = TableRows(ARM, Answer.of(ARM, trees), ARM.convention)
    assert [table.row(i).verdict for i in range(2)] == [Verdict.CORRECT, Verdict.WRONG]
    assert other_convention(other_convention(ARM.convention)) is ARM.convention


def test_a_wrong_quadrant_is_found_and_put_right():
    poses = Poses.random(POLAR, 50, 0)
    right = Branch(poses, (read("atan2(py, px)"), read("sqrt(px^2 + py^2)")))
    wrong = right.with_tree(0, read("atan2(px, py)"))
    assert right.is_right
    assert not wrong.is_right
    assert [found.mistake for found in MistakeSearch(POLAR).explanations(wrong)] == [
        "atan2_arguments"
    ]
    assert joint_order([read("q2"), read("px")]) == (1, 0)


def test_edits_come_in_their_order():
    found = edits(
        read("acos((px^2 + py^2 - l1^2)/(2*l1))"), True, (), (), Lengths(("l1",), (read("l1"),))
    )
    ranks = [ORDER.index(edit.mistake) for edit in found]
    assert ranks == sorted(ranks)
    assert {"elbow_sign", "cosine_law_sign", "joint_sign"} <= {edit.mistake for edit in found}


def test_work_in_a_process_of_its_own_ends():
    limits = WorkerLimits(seconds=5.0, memory=2**30)
    assert result_of(lambda: b"result", limits) == b"result"
    with pytest.raises(TimeoutError, match=r"took longer than 0\.2 s"):
        result_of(lambda: bytes(iter(lambda: 0, 1)), WorkerLimits(0.2, 2**30))
    with pytest.raises(ChildProcessError):
        result_of(lambda: exit(3), limits)


def test_fractions_of_numbers_are_exact():
    assert truth_of(ARM).reader("M").read(read("1/3")).element().terms.popitem()[1] == Fraction(
        1, 3
    )
