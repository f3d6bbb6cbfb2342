"""A class that hands in sheets and records of a lab: one table of marks, and each student's sum."""

import csv
import json
import os
import pickle
import shutil
import zipfile
from pathlib import Path

import pytest

from dhkit.cli import main
from dhkit.cli.grade import record_judge
from dhkit.grading.batch import GIGABYTE, grade_all
from dhkit.grading.class_judge import ClassJudge
from dhkit.grading.grade_report import Verdict
from dhkit.grading.judge_process import JudgeTask, judged_elsewhere
from dhkit.grading.marks import marks
from dhkit.grading.reports import marks_csv, report_of
from dhkit.grading.rubric import Rubric
from dhkit.grading.sheets import Sheet
from dhkit.lab import Assignment
from dhkit.lab.assignment import Place
from dhkit.lab.record import Reached, Record
from grading.class_of_variants import write_class as write_variants

TASK = """
robot = "planar2r"
[task]
asked = ["g"]
[rubric]
points = 20
[rubric.late]
due = 2026-11-20T23:59:00Z
per_day = 0.1
"""
LAB = """
kind = "assignment"
format = 1
title = "Two links"
robot = "planar2r"
[[step]]
title = "States"
[[step.goal]]
text = "Straight up"
joints = ["pi/2", 0]
points = 3
[[step.goal]]
text = "Largest reach, m"
number = { value = 2.0, tolerance = 0.001 }
points = 2
[[step]]
title = "Equations"
[[step.goal]]
text = "Gravity torque of joint 2"
answer = { name = "g2" }
points = 5
"""
UP = {"q": [1.5707963267948966, 0.0]}
REACH = {"number": 2.0}
RIGHT = (
    "g1 = 9.81*((m1/2 + m2)*l1*cos(q1) + m2*l2*cos(q1 + q2)/2)\ng2 = 9.81*m2*l2*cos(q1 + q2)/2\n"
)
HALF = RIGHT.replace("g2 = ", "g2 = -")


@pytest.fixture(autouse=True)
def course(tmp_path, monkeypatch):
    """Work in a folder with a task and an assignment."""
    monkeypatch.chdir(tmp_path)
    Path("task.toml").write_text(TASK)
    Path("lab.toml").write_text(LAB)


def record(name, *evidence, minute=0, digest=""):
    """Return a record's text: the goals in their order, as far as there is evidence; None for one that is missing."""
    places = (Place(0, 0), Place(0, 1), Place(1, 0))
    reached = {
        place: Reached(f"2026-11-19T10:{minute + k:02}:00+00:00", shown)
        for k, (place, shown) in enumerate(zip(places, evidence, strict=False))
        if shown is not None
    }
    file = Path("made.lab.json")
    digest = digest or Assignment.read("lab.toml").digest
    Record(digest, name, f"2026-11-19T09:{minute:02}:00+00:00", reached).write(file)
    text = file.read_text()
    file.unlink()
    return text


def write(folder, **files):
    for name, content in files.items():
        path = Path(folder, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)


def grade(*arguments):
    """Run `dhkit grade` with the task and the lab; return its status."""
    with pytest.raises(SystemExit) as exit:
        main(["grade", *map(str, arguments), "--task", "task.toml", "--lab", "lab.toml"])
    return exit.value.code


def rows(out="out", table="marks.csv"):
    return list(csv.DictReader(Path(out, table).read_text().splitlines()))


def cells(*names):
    return [tuple(row[name] for name in names) for row in rows()]


def write_class():
    """Three students: a sheet and a record, a sheet alone, a record alone with another name in it."""
    write(
        "class",
        **{
            "ada/answer.py": RIGHT,
            "ada/lab.lab.json": record("Ada Lovelace", UP, REACH, {"answer": "g2 = ..."}),
            "ben.py": HALF,
            "cy/lab.lab (1).json": record("Bob", {"q": [0.0, 0.0]}, REACH, minute=20),
            "cy/notes.json": "{}",
        },
    )


def test_sheets_and_records_are_one_table(capsys):
    write_class()
    assert grade("class", "-o", "out") == 1
    assert cells("student", "points", "most", "kind", "verdict") == [
        ("ada", "20", "20", "py", "correct"),
        ("ada", "10", "10", "lab", "taken from the record"),
        ("ben", "10", "20", "py", "wrong"),
        ("cy", "2", "10", "lab", "wrong"),
    ]
    lab, other = (row for row in rows() if row["kind"] == "lab")
    assert [lab[f"goal{name}"] for name in ("1.1", "1.2", "2.1")] == ["3", "2", "5"]
    assert (lab["last goal"], lab["not checked again"]) == ("2026-11-19T10:02:00+00:00", "1")
    assert (lab["notes"], lab["missing"]) == ("", "")
    assert (other["missing"], other["left out"]) == ("goal2.1", "not read: notes.json")
    assert other["notes"] == "the name typed in the lab is 'Bob', which is not the student's"
    assert rows(table="totals.csv") == [
        {"student": "ada", "points": "30", "most": "30"},
        {"student": "ben", "points": "10", "most": "30"},
        {"student": "cy", "points": "2", "most": "30"},
    ]
    assert sorted(path.name for path in Path("out/students").iterdir()) == [
        "ada-2.html",
        "ada.html",
        "ben.html",
        "cy.html",
    ]
    assert "Straight up" in Path("out/students/ada-2.html").read_text()
    assert "none is preferred" not in capsys.readouterr().out


def test_the_page_of_the_class_has_the_records(capsys):
    write_class()
    write("class", **{"dan/lab.lab.json": "{}"})
    write("elsewhere", **{"eve.lab.json": record("Eve", UP)})
    Path("class/eve.lab.json").symlink_to(Path("elsewhere/eve.lab.json").absolute())
    assert grade("class", "-o", "out") == 2
    page = Path("out/class.html").read_text()
    order = [
        "2 sheets: 1 correct, 1 wrong.",
        "4 lab records: 1 taken from the record, 1 wrong, 2 unreadable.",
        "totals.csv",
        "Points of sheets",
        "Points of lab records",
        "Could not be read",
        "no record of a lab",
        "evidence does not show",
        "Another name was typed",
        "cannot be checked again",
        'id="marks"',
    ]
    places = [page.index(text) for text in order]
    assert places == sorted(places)
    # A file that could not be judged has the points of its kind too.
    assert [row["most"] for row in rows()] == ["20", "10", "20", "10", "10", "10"]
    assert {row["kind"] for row in rows()} == {"py", "lab"}


def test_records_are_late_by_the_same_rule_and_known_by_the_export(capsys):
    metadata = ""
    for number, (name, sid, day) in enumerate([("Ada Lovelace", "a1", 19), ("Bob", "b2", 22)], 1):
        metadata += (
            f'submission_{number}:\n  :submitters: [{{":name": {name}, ":sid": {sid}}}]\n'
            f"  :created_at: 2026-11-{day} 10:00:00 Z\n"
        )
        text = record("ada  lovelace", UP, REACH, minute=number)
        write(f"class/submission_{number}", **{"answer.py": RIGHT, "work.lab.json": text})
    Path("class/submission_metadata.yml").write_text(metadata)
    shutil.make_archive("class", "zip", "class")
    assert grade("class.zip", "-o", "out") == 1
    assert cells("student", "kind", "points", "before", "late") == [
        ("a1", "py", "20", "20", ""),
        ("a1", "lab", "5", "5", ""),
        ("b2", "py", "16", "20", "2 days late: -20 %"),
        ("b2", "lab", "4", "5", "2 days late: -20 %"),
    ]
    assert [row["notes"] for row in rows() if row["kind"] == "lab"] == [
        "",
        "the name typed in the lab is 'ada lovelace', which is not the student's",
    ]
    Path("students.csv").write_text("student,id\nada,a1\nbob,b2\n")
    assert grade("class.zip", "-o", "out", "--students", "students.csv") == 1
    assert [row["student"] for row in rows()] == ["ada", "ada", "bob", "bob"]


def test_a_list_of_students_has_the_names_that_are_typed():
    with zipfile.ZipFile("class.zip", "w") as archive:
        archive.writestr("x_101_1_work.lab.json", record("Ada Lovelace", UP))
        archive.writestr("x_101_2_work.lab-1.json", record("Ada Lovelace", UP, REACH))
        archive.writestr("y_102_3_work.lab.json", record("Eve", UP, minute=9))
    Path("students.csv").write_text('student,ID,name\nada,101,"Lovelace, Ada"\nben,102,Ben\n')
    assert grade("class.zip", "--students", "students.csv", "-o", "out") == 1
    # Canvas's number of a copy stands before the last suffix; the last attempt counts.
    assert cells("student", "points") == [("ada", "5"), ("ben", "3")]
    assert [bool(row["notes"]) for row in rows()] == [False, True]


def test_the_best_sheet_and_the_best_record_count():
    write(
        "class",
        **{
            "ada/a.py": HALF,
            "ada/b.py": RIGHT,
            "ada/a.lab.json": record("Ada", UP, REACH),
            "ada/b.lab.json": record("Ada", UP),
        },
    )
    assert grade("class", "--keep", "best", "-o", "out") == 1
    assert cells("points", "kind") == [("5", "lab"), ("20", "py")]
    assert rows(table="totals.csv") == [{"student": "ada", "points": "25", "most": "30"}]


def test_a_run_goes_on_where_it_was_stopped(capsys):
    write_class()
    assert grade("class", "-o", "out") == 1
    first = Path("out/marks.csv").read_text()
    Path("out/marks.csv").unlink()
    capsys.readouterr()
    assert grade("class", "-o", "out", "--jobs", "2") == 1
    assert "4 of 4 sheets were judged before" in capsys.readouterr().err
    assert Path("out/marks.csv").read_text() == first
    # Another assignment concerns the records alone.
    Path("lab.toml").write_text(LAB.replace("Straight up", "Upright"))
    capsys.readouterr()
    assert grade("class", "-o", "out") == 2
    assert "2 of 4 sheets were judged before, and are taken up" in capsys.readouterr().err
    errors = [row["error"] for row in rows() if row["kind"] == "lab"]
    assert len(errors) == 2
    assert all("another assignment, or another version of this one" in error for error in errors)


def test_reports_are_json_and_can_be_marked_again(capsys):
    write_class()
    assert grade("class", "--json") == 1
    lines = capsys.readouterr().out.splitlines()
    reports = [report_of(line) for line in lines]
    assert [report.is_lab_record for report in reports] == [False, True, False, True]
    assert [json.loads(line)["points"] for line in lines] == [20, 10, 10, 2]
    again = [marks(report, Rubric(points=5)).points for report in reports]
    assert again == [5, 10, 2.5, 2]
    assert marks_csv(reports[:1], [marks(reports[0], Rubric())]).count("notes") == 0


def test_each_student_has_a_variant_and_all_have_one_lab():
    write_variants(Path(), 2, 1)
    for name in ("student000", "student001"):
        write(
            f"class/{name}", **{"work.lab.json": record(name, UP, REACH, {}, minute=int(name[-1]))}
        )
    with zipfile.ZipFile("class.zip") as archive:
        for name in archive.namelist():
            write(f"class/{name.partition('_')[0]}", **{name: archive.read(name).decode()})
    with pytest.raises(SystemExit):
        main(["grade", "class", "--task", "key", "--lab", "lab.toml", "-o", "out"])
    assert [row["points"] for row in rows() if row["kind"] == "lab"] == ["10", "10"]
    assert [row["student"] for row in rows()] == ["student000"] * 2 + ["student001"] * 2


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no os.fork")
def test_a_record_is_judged_on_another_machine_as_here():
    Path("ada.lab.json").write_text(record("Ada", UP, REACH, {}))
    judge = ClassJudge(others={".lab.json": record_judge(Path("lab.toml"))})
    sheet = Sheet(Path("ada.lab.json"), "ada")
    [here] = grade_all([sheet], judge)
    task = pickle.loads(pickle.dumps(JudgeTask.of(sheet, judge, 60.0, GIGABYTE)))
    assert report_of(judged_elsewhere(task)) == here
    assert here.verdict is Verdict.RECORDED
    # A sheet does not carry the assignment along.
    Path("ada.py").write_text(RIGHT)
    assert not JudgeTask.of(Sheet(Path("ada.py")), judge, 60.0, GIGABYTE).judge.others


def test_equal_records_of_two_students_are_named(capsys):
    copied = record("Ada", UP)
    write("class", **{"ada.lab.json": copied, "eve.lab.json": copied})
    assert grade("class", "-o", "out") == 1
    said = " ".join(capsys.readouterr().out.split())
    assert "the lab records of ada and eve began and ended at the same seconds" in said
    assert rows()[1]["notes"].endswith("began and ended at the same seconds as class/ada.lab.json")


def test_totals_count_one_sheet_and_one_record_of_a_student():
    text = record("Dora", UP, REACH)
    write("class", **{"dora/a.lab.json": text, "dora/b.lab.json": text, "dora/answer.py": RIGHT})
    write("class", **{"dora/answer.m": HALF.replace("\n", ";\n")})
    grade("class", "-o", "out")
    assert rows(table="totals.csv") == [{"student": "dora", "points": "25", "most": "30"}]


def test_totals_of_a_run_with_a_lab_do_not_stay_after_one_without():
    write_class()
    assert grade("class", "-o", "out") == 1
    assert Path("out/totals.csv").exists()
    shutil.rmtree("class/cy")
    with pytest.raises(SystemExit):
        main(["grade", "class", "--task", "task.toml", "-o", "out"])
    assert not Path("out/totals.csv").exists()
    assert "goal1.1" not in rows()[0]
    Path("out/totals.csv").write_text("mine\n")
    with pytest.raises(SystemExit):
        main(["grade", "class", "--task", "task.toml", "-o", "out"])
    assert Path("out/totals.csv").read_text() == "mine\n"


def test_a_single_record_is_its_own_name(capsys):
    write("", **{"work.lab.json": record("Ada Lovelace", UP, REACH, {})})
    assert grade("work.lab.json", "--json") == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["student"], report["points"], report["verdict"]) == (
        "Ada Lovelace",
        10,
        "taken from the record",
    )
    assert grade("work.lab.json", "--json", "-o", "work.lab.json") == 2
    assert "would overwrite" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"lab.toml": TASK}, "lab.toml"),
        ({"lab.toml": LAB.split("[[step]]")[0]}, "lab.toml"),
        ({"lab.toml": LAB.split("[[step.goal]]")[0]}, "an assignment without goals"),
    ],
)
def test_what_is_not_an_assignment_with_goals_is_refused(change, line, capsys):
    write_class()
    write("", **change)
    assert grade("class") == 2
    said = capsys.readouterr().err
    assert line in said and said.count("\n") == 1


def test_records_alone_need_no_task(capsys):
    write("class", **{"ada.lab.json": record("Ada", UP, REACH, {})})
    with pytest.raises(SystemExit) as exit:
        main(["grade", "class", "--lab", "lab.toml", "--json"])
    assert exit.value.code == 0
    assert json.loads(capsys.readouterr().out)["points"] == 10
    with pytest.raises(SystemExit) as exit:
        main(["grade", "class", "--lab", "lab.toml", "--remark"])
    assert exit.value.code == 2
    assert "--remark: found --lab too" in capsys.readouterr().err
