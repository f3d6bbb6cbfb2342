"""Inverse kinematics handed in step by step: equations proved, solutions tried, mistakes named, others' not blamed."""

import pytest

import dhkit
from dhkit.description import library_robot
from dhkit.errors import AnswerError
from dhkit.grading import Verdict
from dhkit.grading.answers.sheet import sheet_of
from dhkit.grading.sheet_judge import judge_sheet
from grading.inverse_steps_corpus import ARMS, MISTAKES, PUMA, RIGHT, with_change


def judged(steps, robot="puma560", **document):
    data = {"robot": robot, "answer": {"ik": {"steps": steps}}, **document}
    return judge_sheet(library_robot(robot), sheet_of(data), seed=1)


@pytest.mark.parametrize("robot", ARMS)
def test_steps_from_books_are_right_and_their_equations_proved(robot):
    report = judged(ARMS[robot], robot)
    for entry in report.entries[: len(ARMS[robot])]:
        assert entry.verdict is Verdict.CORRECT, (entry.name, entry.statement)
        assert (
            "equation: proved: an identity of the arm, whatever its lengths are" in entry.statement
        )
        assert "given the joints before; tried, not proved" in entry.statement
    assert not report.diagnosis
    assert (report.verdict is Verdict.INCOMPLETE) == (robot in ("ur5", "stanford"))


@pytest.mark.parametrize(
    "case", RIGHT, ids=lambda case: f"{case[0]} {case[1]} {str(case[-1])[:40]}"
)
def test_other_notations_and_other_right_answers(case):
    robot, k, *change = case
    # A step is judged given the joints before it: the later ones are left out.
    entry = judged(with_change(robot, k, *change)[: k + 1], robot).entries[k]
    assert entry.verdict in (Verdict.CORRECT, Verdict.UNDECIDED), (entry.verdict, entry.statement)


@pytest.mark.slow
def test_labelled_mistakes_are_wrong_and_named():
    named = 0
    for robot, k, key, old, new, labels in MISTAKES:
        report = judged(with_change(robot, k, key, old, new), robot)
        entry = report.entries[k]
        where = robot, k, key, old, new
        assert entry.verdict is Verdict.WRONG, (where, entry.statement)
        others = [
            one for j, one in enumerate(report.entries) if j != k and one.verdict is Verdict.WRONG
        ]
        assert not others, (where, [one.statement for one in others])
        found = [diagnosis for diagnosis in report.diagnosis if diagnosis.entries == (entry.name,)]
        assert len(found) == 1 and found[0].where == f"ik, step {k + 1}, q{ARMS[robot][k]['joint']}"
        assert "of the worked solution" in found[0].hint
        named += found[0].mistake in labels.split("|")
    assert len(MISTAKES) >= 50 and named >= 0.9 * len(MISTAKES), f"{named} of {len(MISTAKES)}"


@pytest.mark.parametrize(
    ("equation", "words"),
    [
        ("s1^2 + c1^2 = 1", "it says nothing"),
        ("q1 = q1", "it says nothing"),
        ("r11^2 + r21^2 + r31^2 = 1", "it says nothing"),
        ("r11*r12 + r21*r22 + r31*r32 = 0", "it says nothing"),
        (
            "px^2 + py^2 + (pz-d1)^2 = d3^2 + a2^2 + a3^2 + d4^2 + 2*a2*(a3*c3 - d4*s3)",
            "does not contain q1",
        ),
        (
            "px*c1 + py*s1 = a2*c2 + a3*c23 - d4*s23",
            "does not determine q1, as q2, q3 are not known yet",
        ),
    ],
)
def test_true_equations_that_determine_nothing_earn_nothing(equation, words):
    entry = judged([{"joint": 1, "equation": equation}]).entries[0]
    assert entry.verdict is Verdict.INCOMPLETE and words in entry.statement


def test_two_equations_may_determine_a_joint_together():
    steps = [dict(step) for step in PUMA[:3]]
    pair = ["s5*c4 = -(c23*(c1*r13 + s1*r23) + s23*r33)", "s5*s4 = -(c1*r23 - s1*r13)"]
    assert judged([*steps, {"joint": 4, "equation": pair}]).entries[3].verdict is Verdict.CORRECT
    one = judged([*steps, {"joint": 4, "equation": pair[0]}]).entries[3]
    assert (
        one.verdict is Verdict.INCOMPLETE
        and "does not determine q4, as q5 is not known yet" in one.statement
    )


@pytest.mark.slow
def test_a_joint_that_is_right_in_terms_of_a_wrong_one_is_right_and_says_so():
    report = judged(with_change("puma560", 0, "solution", None, ["atan2(py,px)", "atan2(-py,-px)"]))
    assert [entry.verdict for entry in report.entries] == [Verdict.WRONG, *[Verdict.CORRECT] * 5]
    assert "right in terms of q1, which is wrong" in report.entries[2].statement


@pytest.mark.slow
def test_a_lost_root_is_noted_and_an_arc_cosine_for_both_roots_is_wrong():
    one = judged(with_change("puma560", 0, "solution", None, [PUMA[0]["solution"][0]]))
    assert one.entries[0].verdict is Verdict.CORRECT
    assert [note.values for note in one.notes if note.quantity == "ik1"] == [("1", "2")]
    both = judged(
        with_change("puma560", 4, "solution", None, "acos(c23*r33 - s23*(c1*r13+s1*r23))")
    )
    assert both.entries[4].verdict is Verdict.WRONG
    assert [diagnosis.mistake for diagnosis in both.diagnosis] == ["sign_lost"]


def test_lengths_in_equations_are_letters():
    # Corke's a2 and d4 are both 0.4318 m.
    entry = judged(
        with_change("puma560", 1, "equation", "- a2^2 - a3^2 - d4^2", "- d4^2 - a3^2 - d4^2")
    ).entries[1]
    assert entry.verdict is Verdict.WRONG


def test_offsets_base_and_tool_belong_to_the_arm():
    """theta = q + offset: the joint value, not the table's angle, is asked for."""
    arm = dhkit.Arm.load("kuka_kr30_3").description
    steps = [{"joint": 1, "equation": "(py - d6*r23)*c1 = (px - d6*r13)*s1"}]
    data = {"robot": "kuka_kr30_3", "answer": {"ik": {"steps": steps}}}
    assert judge_sheet(arm, sheet_of(data), seed=0).entries[0].verdict is Verdict.CORRECT


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        ([{"joint": 9, "equation": "c1 = 1"}], "ik, step 1: joint 9; expected 1 to 6"),
    ],
)
def test_steps_that_cannot_be(steps, message):
    with pytest.raises(AnswerError, match=message):
        judged(steps)


def test_a_second_step_of_a_joint_is_not_read_and_the_others_are():
    entries = judged([*PUMA[:2], PUMA[0], *PUMA[2:]]).entries
    assert [entry.verdict for entry in entries] == [
        *[Verdict.CORRECT] * 2,
        Verdict.UNREADABLE,
        *[Verdict.CORRECT] * 4,
    ]
    assert "joint 1 has a step already; expected all of its formulas in one" in entries[2].statement


def test_a_solution_of_a_later_joint_is_incomplete():
    entry = judged([{"joint": 1, "solution": "q2"}]).entries[0]
    assert (
        entry.verdict is Verdict.INCOMPLETE
        and "uses q2, which no earlier step finds" in entry.statement
    )


def test_a_mistake_beside_lost_quadrants_is_named():
    """atan(y/x) loses a quadrant everywhere; sine and cosine are exchanged in one place besides."""
    second = {"joint": 2, "solution": "acos((px^2 + py^2 - l1^2 - l2^2)/(2*l1*l2))"}
    first = {"joint": 1, "solution": "atan(py/px) - atan((l2*sin(q2))/(l1 + l2*sin(q2)))"}
    report = judged([second, first], "planar2r")
    assert [one.mistake for one in report.diagnosis] == ["term_function"]
