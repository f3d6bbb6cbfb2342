"""Rubrics: what is refused, what answers are worth by them, and what of a report is told."""

import math
from dataclasses import fields, replace

import pytest
from hypothesis import given, strategies as st

from dhkit.description import library_robot
from dhkit.errors import AnswerError
from dhkit.grading import grade_answers
from dhkit.grading.answers.sheet import RUBRIC_KEYS, read_task
from dhkit.grading.grade_report import Diagnosis, GradeReport, Verdict
from dhkit.grading.marks import marks
from dhkit.grading.reports import with_feedback
from dhkit.grading.rubric import Credit, Rubric
from grading.judged import REPORT, reports

RUBRIC = """
points = 60
digits = 5
feedback = "hint"
[weights]
M = 4
g = 2
M12 = 0
[credit]
rounding = 0.9
mistakes = { gravity_sign = 0.25 }
"""


@pytest.fixture
def rubric(tmp_path):
    path = tmp_path / "rubric.toml"
    path.write_text(RUBRIC)
    return Rubric.read(path)


def test_a_file(rubric):
    assert rubric == Rubric(
        points=60.0,
        weights={"M": 4.0, "g": 2.0, "M12": 0.0},
        credit=Credit(rounding=0.9, mistakes={"gravity_sign": 0.25}),
        digits=5,
        feedback="hint",
    )


def test_points_by_weights_and_rules(rubric):
    """60 points: 40 on three entries of M, M12 counts nothing; 20 on g, a quarter of one half and half of the other."""
    given = marks(REPORT, rubric)
    assert [(mark.name, round(mark.points, 9), round(mark.most, 9)) for mark in given.entries] == [
        ("M11", 13.333333333, 13.333333333),
        ("M12", 0, 0),
        ("M21", 13.333333333, 13.333333333),
        ("M22", 13.333333333, 13.333333333),
        ("g1", 2.5, 10),
        ("g2", 5, 10),
    ]
    assert [mark.rule for mark in given.entries] == [
        "correct",
        "counts nothing",
        "undecided",
        "correct",
        "gravity_sign: 25 %",
        "follows from V: 50 %",
    ]
    assert (given.points, given.most) == (47.5, 60)
    assert [(mark.name, mark.points, mark.most) for mark in given.quantities] == [
        ("M", 40, 40),
        ("g", 7.5, 20),
    ]


def test_entries_are_weighed_however_their_names_are_written():
    written = {
        "M_12": 0,
        "M1_10": 0,
        "A1_14": 0,
        "A114": 0,
        "A1014": 0,
        "tau_2": 0,
        "g10": 0,
        "M_1_10": 0,
        "A12": 1,
    }
    found = [next(iter(Rubric.from_data({"weights": {name: 0}}).weights)) for name in written]
    assert found == ["M12", "M1_10", "A114", "A114", "A1014", "tau2", "g10", "M1_10", "A12"]
    one, other = (
        marks(REPORT, Rubric.from_data({"weights": {"M": 4, name: 0}})) for name in ("M12", "M_12")
    )
    assert one == other


def test_what_is_asked_for_and_missing_gets_nothing_and_what_is_not_counts_nothing():
    given = marks(REPORT, Rubric(points=10, weights={"M": 1, "V": 1}))
    assert given.points == 5
    assert [(mark.name, mark.most, mark.rule) for mark in given.quantities] == [
        ("M", 5, ""),
        ("g", 0, ""),
        ("V", 5, "not on the sheet"),
    ]


def test_a_weight_of_nothing_alone_leaves_the_others_equal():
    assert marks(REPORT, Rubric(weights={"g": 0})).points == 100


@pytest.mark.parametrize(
    ("found", "credit", "share"),
    [
        ((), Credit(), 0),
        ((Diagnosis("gravity_sign", "", "g", ("g1",)),), Credit(diagnosed=0.3), 0.3),
        (
            (Diagnosis("gravity_sign", "", "g", ("g1",)),),
            Credit(diagnosed=0.3, mistakes={"gravity_sign": 0.1}),
            0.1,
        ),
        (
            (Diagnosis("gravity_sign (link 2)", "", "g", ("g1",)),),
            Credit(mistakes={"gravity_sign": 0.1}),
            0.1,
        ),
        (
            (Diagnosis("a", "", "g", ("g1",), equivalent=("gravity_sign",)),),
            Credit(diagnosed=0.3, mistakes={"gravity_sign": 0.6}),
            0.6,
        ),
        (
            (Diagnosis("a", "", "", ("g1",)), Diagnosis("b", "", "", ("g1",))),
            Credit(diagnosed=1),
            0,
        ),
        (
            (Diagnosis("a", "", "", ("g1",)), Diagnosis("b", "", "", ("g1",))),
            Credit(mistakes={"a": 0.7, "b": 0.4}),
            0.4,
        ),
        ((Diagnosis("other_frames", "", "", ("g1",)),), Credit(), 0.5),
        ((Diagnosis(None, "the sign of the first term", "g", ("g1",)),), Credit(diagnosed=1), 0),
        ((Diagnosis("gravity_sign", "", "g", ("g2",)),), Credit(diagnosed=1), 0),
    ],
)
def test_the_share_of_a_wrong_entry(found, credit, share):
    report = replace(REPORT, entries=REPORT.entries[4:5], diagnosis=found)
    assert marks(report, Rubric(points=1, credit=credit)).points == share


def test_a_sheet_that_could_not_be_judged_gets_nothing():
    assert marks(GradeReport(error="no TOML"), Rubric()).points == 0
    assert marks(replace(REPORT, error="crashed"), Rubric()).points == 0


weights = st.dictionaries(
    st.sampled_from(("M", "g", "K", "M11", "g1", "V")), st.floats(0, 10), max_size=4
)


@given(reports(), weights, st.floats(0.5, 1000))
def test_marks_add_up_and_stay_within_bounds(report, weights, points):
    given = marks(report, Rubric(points=points, weights=weights))
    assert 0 <= given.points <= given.most == points
    assert all(0 <= mark.points <= mark.most for mark in (*given.entries, *given.quantities))
    for part in (given.entries, given.quantities):
        # floats of exact shares: their sum is off by no more than their own rounding
        assert math.isclose(sum(mark.points for mark in part), given.points, abs_tol=1e-12 * points)


@given(reports(), st.floats(0.1, 1000))
def test_what_is_right_throughout_gets_all_points_exactly(report, points):
    right = replace(
        report,
        error="",
        entries=tuple(replace(entry, verdict=Verdict.CORRECT) for entry in report.entries),
    )
    assert marks(right, Rubric(points=points)).points == (points if report.entries else 0)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("ponts = 1", "unknown key 'ponts'; did you mean 'points'?"),
        ("points = 'many'", "points: found 'many'; expected a number"),
        ("points = nan", "points: found nan; expected a finite number"),
        ("points = true", "points: found True; expected a number"),
        ("digits = 2", "digits: found 2; expected greater than or equal to 3"),
        ("feedback = 'some'", "feedback: found 'some'; expected 'full', 'hint' or 'verdict'"),
        ("[credit]\nroundign = 1", "credit: unknown key 'roundign'; did you mean 'rounding'?"),
        (
            "[credit.mistakes]\na = 2",
            "credit.mistakes.a: found 2; expected less than or equal to 1",
        ),
        ("[weights]\nG = 1", "weights: no quantity 'G'; did you mean 'g'?"),
        ("[weights]\nK1 = 1", "weights: no quantity 'K1'; did you mean 'K'?"),
        ("[weights]\nM0 = 1", "weights: no quantity 'M0'; did you mean 'M'?"),
        ("[weights]\nM12 = 1\nM_12 = 0", "weights: M_12 is there twice, as M12"),
        ("weights = 3", "weights: found 3; expected a table"),
        ("[weights]\nM = -1", "weights.M: found -1; expected greater than or equal to 0"),
        (
            "[rubric.late]\nper_day = 1",
            "unknown key 'rubric'; expected its keys at the top: [late]",
        ),
        ("points = ", "no TOML: "),
        ("notes = '" + 100_000 * "x" + "'", "more than 0.1 MB; expected a rubric"),
    ],
)
def test_what_is_refused_is_said_in_one_line(tmp_path, text, complaint):
    path = tmp_path / "rubric.toml"
    path.write_text(text)
    with pytest.raises(AnswerError) as error:
        Rubric.read(path)
    assert str(error.value).startswith(f"{path}: {complaint}")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("[late]\nper_day = 0.1", "unknown key 'late'; it belongs to the rubric: expected it in [rubric.late]"),
        ("points = 5", "unknown key 'points'; it belongs to the rubric: expected it in [rubric]"),
        ("[task]\nlate = {}", "unknown key task.'late'; it belongs to the rubric: expected it in [rubric.late]"),
    ],
)  # fmt: skip
def test_a_key_of_the_rubric_beside_its_table_in_a_task_is_told_its_place(tmp_path, text, line):
    path = tmp_path / "task.toml"
    path.write_text(text)
    with pytest.raises(AnswerError) as error:
        read_task(path)
    assert str(error.value) == f"{path}: {line}"


def test_keys_of_the_rubric_are_its_fields():
    assert set(RUBRIC_KEYS) == {field.name for field in fields(Rubric)}


def test_a_share_for_no_mistake_is_refused():
    rubric = Rubric(credit=Credit(mistakes={"gravity_sine": 1}))
    with pytest.raises(AnswerError, match="no mistake 'gravity_sine'; did you mean 'gravity_sign'"):
        rubric.require_mistakes({"gravity_sign", "half_forgotten"})


def test_hints_say_where_to_look_and_not_what_is_wrong():
    told = str(with_feedback(REPORT, "hint"))
    assert "look at the sign of V" in told
    assert not any(secret in told for secret in ("gravity_sign", "wrong sign", "2*m1*g", "8.6"))


def test_verdicts_alone():
    told = with_feedback(REPORT, "verdict")
    assert [entry.verdict for entry in told.entries] == [entry.verdict for entry in REPORT.entries]
    assert (
        told.diagnosis,
        {entry.latex + entry.statement + entry.follows for entry in told.entries},
    ) == ((), {""})
    assert "look at" not in str(told)


ZEROS = [["0"] * 4, ["0"] * 4, ["0"] * 4, ["0", "0", "0", "1"]]


def test_the_last_row_of_a_pose_counts_nothing_unless_it_has_a_weight():
    report = grade_answers(library_robot("puma560"), {"T": ZEROS}, explain=False)
    assert marks(report, Rubric(points=12)).points == 0
    assert marks(report, Rubric(points=12, weights={"T": 1, "T44": 1})).points > 0


def test_zeros_that_follow_from_zeros_get_nothing():
    arm = library_robot("polar_rp")
    zeros = {"M": [["0", "0"], ["0", "0"]], "C": [["0", "0"], ["0", "0"]]}
    report = grade_answers(arm, zeros)
    given = {mark.name: mark for mark in marks(report, Rubric()).entries}
    assert not any("follows" in mark.rule for mark in given.values())
    assert [name for name, mark in given.items() if mark.points] == ["M12", "M21"]
