"""Late submissions: the points that they lose, and mistakes in the rule."""

import json
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from dhkit.errors import AnswerError
from dhkit.grading.grade_report import GradeReport
from dhkit.grading.lateness import LateRule
from dhkit.grading.marks import marks
from dhkit.grading.reports import json_report, marks_csv, report_of
from dhkit.grading.reports.sentences import lateness_of
from dhkit.grading.rubric import Rubric
from grading.judged import REPORT

DUE = datetime(2026, 11, 20, 23, 59, tzinfo=UTC)
RULE = LateRule(DUE, per_day=0.1, grace="10 min", at_most=0.5)
TEXT = """
points = 20
[late]
due = 2026-11-20T23:59:00+01:00
grace = "10 min"
per_day = 0.1
at_most = 0.5
"""


def report(delay):
    return replace(REPORT, handed_in=(DUE + delay).isoformat())


@pytest.mark.parametrize(
    ("delay", "share"),
    [
        (-timedelta(days=3), 0.0),
        (timedelta(0), 0.0),
        (timedelta(minutes=10), 0.0),
        (timedelta(minutes=10, seconds=1), 0.1),
        (timedelta(days=1), 0.1),
        (timedelta(days=1, seconds=1), 0.2),
        (timedelta(days=4, hours=5), 0.5),
        (timedelta(days=400), 0.5),
    ],
)
def test_points_are_lost_by_days_begun(delay, share):
    rubric = Rubric(points=20)
    full = marks(REPORT, rubric).points
    late = marks(report(delay), replace(rubric, late=RULE))
    assert late.points == pytest.approx(full * (1 - share), rel=1e-15)
    assert late.before == pytest.approx(full, rel=1e-15)
    assert (late.late == "") == (share == 0)
    # What a quantity is worth does not depend on the time.
    assert sum(mark.points for mark in late.quantities) == pytest.approx(full)


def test_without_a_time_or_a_rule_nothing_is_late():
    assert marks(REPORT, Rubric(late=RULE)) == marks(REPORT, Rubric())
    assert marks(report(timedelta(days=9)), Rubric()) == marks(REPORT, Rubric())


@pytest.mark.parametrize("unit", ["600 s", "10 min", "10min", "0.5 h", "1 d"])
def test_units_of_the_grace(unit):
    rule = replace(RULE, grace=unit)
    assert rule.lateness(DUE + timedelta(seconds=600)).days == 0
    assert rule.lateness(DUE + timedelta(days=1, seconds=1)).days == 2


def test_a_file_is_read(tmp_path):
    (tmp_path / "rubric.toml").write_text(TEXT)
    rule = Rubric.read(tmp_path / "rubric.toml").late
    assert rule.due.utcoffset() == timedelta(hours=1)
    assert replace(rule, due=DUE) == RULE


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("2026-11-20T23:59:00+01:00", "2026-11-20T23:59:00", "late.due: found 2026-11-20T23:59:00; expected a time"),
        ("2026-11-20T23:59:00+01:00", "2026-11-20", "late.due: found 2026-11-20; expected a time with its zone"),
        ("2026-11-20T23:59:00+01:00", '"Friday"', "late.due: found 'Friday'; expected a time with its zone"),
        ("due = 2026-11-20T23:59:00+01:00", "", "late.due: missing"),
        ('"10 min"', '"a while"', "late.grace: found 'a while'; expected a duration, such as '10 min'"),
        ('"10 min"', "10", "late.grace: found 10; expected"),
        ("per_day = 0.1", "per_day = 10", "late.per_day: found 10; expected less than or equal to 1"),
        ("per_day = 0.1", "per_dya = 0.1", "late: unknown key 'per_dya'; did you mean 'per_day'?"),
        ("at_most = 0.5", "at_most = -1", "late.at_most: found -1; expected greater than or equal to 0"),
        (TEXT, "late = 3", "late: found 3; expected a table"),
    ],
)  # fmt: skip
def test_a_mistake_is_a_line(tmp_path, old, new, line):
    path = tmp_path / "rubric.toml"
    path.write_text(TEXT.replace(old, new))
    with pytest.raises(AnswerError) as caught:
        Rubric.read(path)
    assert str(caught.value).startswith(f"{path}: {line}")
    assert "\n" not in str(caught.value)


def test_reports_keep_the_time_so_that_they_can_be_marked_again():
    late = report(timedelta(days=2))
    rubric = Rubric(points=20, late=RULE)
    read = report_of(json.dumps(json_report(late, marks(late, rubric))))
    assert marks(read, rubric) == marks(late, rubric)
    for wrong in ("yesterday", "2026-11-20T23:59:00"):
        with pytest.raises(ValueError, match="handed_in"):
            GradeReport.from_data(late.data() | {"handed_in": wrong})


def test_marks_show_points_before_and_after():
    late = report(timedelta(days=2))
    rubric = Rubric(points=20, late=RULE)
    lines = marks_csv([late, REPORT], [marks(late, rubric), marks(REPORT, rubric)]).splitlines()
    assert lines[0].startswith("student,points,most,handed in,before,late,")
    assert lines[1].startswith("ada,10,20,2026-11-22T23:59:00+00:00,12.5,2 days late: -20 %,")
    assert lines[2].startswith("ada,12.5,20,,12.5,,")
    assert lateness_of(marks(late, rubric)) == " (12.5 before; 2 days late: -20 %)"
