"""`dhkit grade`: what it prints and writes, with a judge that knows what it is to say."""

import csv
import json
import re
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from datetime import UTC, datetime

import pytest

from dhkit.cli import grade
from dhkit.cli.grade_output import Delivery
from dhkit.cli.judging_place import JudgingPlace
from dhkit.errors import AnswerError
from dhkit.grading.batch import judgement_key
from dhkit.grading.exports import Keep, opened_submissions
from dhkit.grading.grade_report import Entry, GradeReport, Verdict
from dhkit.grading.lateness import LateRule
from dhkit.grading.rubric import Credit, Rubric
from grading.judged import REPORT

RIGHT = GradeReport("planar2r", "abc123", "0.1.0", (Entry("V", (), Verdict.CORRECT, "m1*g*y"),))


class FakeJudge:
    """Judges a sheet by what it holds."""

    def __init__(self, rubric=None, prepare=lambda report: None):
        self.rubric = rubric or Rubric()
        self.prepare = prepare

    def __call__(self, path):
        text = path.read_text()
        if text == "broken":
            raise AnswerError(f"{path}: no TOML: line 1")
        return RIGHT if text == "right" else replace(REPORT, sheet=None, student="")

    def completed(self, report):
        return report


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A class of three in a folder, which is the one we are in."""
    monkeypatch.chdir(tmp_path)
    for name, text in {"ada": "wrong", "bob": "right", "cleo": "broken"}.items():
        (tmp_path / "class" / name).mkdir(parents=True)
        (tmp_path / "class" / name / "answer.toml").write_text(text)
    return tmp_path / "class"


@pytest.fixture
def dhkit(capsys):
    """Grade; return the status, stdout and stderr."""

    def run(*sheets, rubric=None, jobs=None, seconds=60.0, **delivery):
        if delivery.pop("json", False):
            delivery["form"] = "json"
        with opened_submissions(sheets) as submissions:
            status = grade.run(
                submissions,
                FakeJudge(rubric),
                Delivery(**delivery),
                place=JudgingPlace(jobs),
                seconds=seconds,
            )
        return status, *capsys.readouterr()

    return run


def test_one_sheet(dhkit, folder):
    status, out, err = dhkit(folder / "ada" / "answer.toml")
    assert (status, err) == (1, "")
    assert "wrong (62.5 of 100 points)" in out
    assert "g1: gravity has the wrong sign" in out


def test_the_status_says_the_worst(dhkit, folder):
    assert dhkit(folder / "bob" / "answer.toml")[0] == 0
    assert dhkit(folder / "ada" / "answer.toml", folder / "bob" / "answer.toml")[0] == 1
    assert dhkit(folder)[0] == 2


def test_a_sheet_that_cannot_be_read_is_a_line_on_stderr(dhkit, folder):
    path = folder / "cleo" / "answer.toml"
    assert dhkit(path) == (2, "", f"dhkit: {path}: no TOML: line 1\n")


def test_json_is_an_object_a_line(dhkit, folder):
    status, out, _ = dhkit(folder, json=True)
    ada, bob, cleo = map(json.loads, out.splitlines())
    assert status == 2
    assert [one["student"] for one in (ada, bob, cleo)] == ["ada", "bob", "cleo"]
    assert [one["verdict"] for one in (ada, bob, cleo)] == ["wrong", "correct", "unreadable"]
    assert ada["sheet"] == str(folder / "ada" / "answer.toml")
    assert (ada["points"], bob["points"], cleo["points"]) == (62.5, 100, 0)
    assert cleo["error"].endswith("no TOML: line 1")


def test_a_class_is_a_table_and_its_mistakes(dhkit, folder):
    _, out, err = dhkit(folder, jobs=2)
    assert err == ""
    assert re.search(r"^ada +wrong +62\.5 of 100 +\S*answer\.toml", out, re.MULTILINE)
    assert re.search(r"^gravity_sign +1", out, re.MULTILINE)


@pytest.mark.parametrize(
    ("form", "sign"),
    [("text", "wrong (62.5"), ("json", '"verdict"'), ("junit", "<testsuites"), ("html", "<math")],
)
def test_formats(dhkit, folder, tmp_path, form, sign):
    path = folder / "ada" / "answer.toml"
    assert sign in dhkit(path, form=form)[1]
    dhkit(path, form=form, output=tmp_path / "report")
    assert sign in (tmp_path / "report").read_text("utf-8")


def test_gradescope(dhkit, folder, tmp_path):
    dhkit(folder / "ada" / "answer.toml", form="gradescope", output=tmp_path / "results.json")
    assert json.loads((tmp_path / "results.json").read_text())["score"] == 62.5
    with pytest.raises(AnswerError, match="several sheets; expected one"):
        dhkit(folder, form="gradescope")


def test_several_sheets_in_a_file(dhkit, folder, tmp_path):
    dhkit(folder, form="junit", output=tmp_path / "class.xml")
    assert len(ET.parse(tmp_path / "class.xml").getroot()) == 3
    dhkit(folder, form="html", output=tmp_path / "class.html")
    assert 'href="#sheet-3"' in (tmp_path / "class.html").read_text("utf-8")


def test_an_output_folder(dhkit, folder, tmp_path):
    out = tmp_path / "out"
    status, printed, _ = dhkit(folder, output=out, feedback="hint")
    assert status == 2
    assert printed.endswith(f"wrote {out}\n")
    rows = list(csv.DictReader((out / "marks.csv").read_text("utf-8").splitlines()))
    assert [(row["student"], row["points"]) for row in rows] == [
        ("ada", "62.5"),
        ("bob", "100"),
        ("cleo", "0"),
    ]
    student, teacher = (
        (out / "students" / "ada.html").read_text("utf-8"),
        (out / "class.html").read_text("utf-8"),
    )
    assert "look at the sign of V" in student
    assert "wrong sign" not in student
    assert "wrong sign" in teacher
    assert sorted(path.name for path in (out / "records").iterdir()) == [
        "ada.json",
        "bob.json",
        "cleo.json",
    ]


def files_in(folder):
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*.*"))


def test_an_output_folder_holds_the_last_run_alone(dhkit, folder, tmp_path):
    out = tmp_path / "out"
    dhkit(folder, output=out)
    (folder / "bob" / "answer.toml").unlink()
    (folder / "bob").rmdir()
    (out / "students" / "remarks.html").write_text("the teacher's own")
    (out / "records" / "zoe.json").write_text(
        (out / "records" / "ada.json").read_text().replace("ada", "zoe")
    )
    _, _, err = dhkit(folder, output=out)
    assert files_in(out) == [
        "class.html",
        "marks.csv",
        *(f"records/{name}.json" for name in ("ada", "cleo", "zoe")),
        *(f"students/{name}.html" for name in ("ada", "cleo", "remarks")),
    ]
    removed, left = err.splitlines()
    assert removed.endswith("removed the results of an earlier run: bob")
    assert left.endswith("not results of this run, left: records/zoe.json, students/remarks.html")


def test_files_of_others_are_never_removed(dhkit, folder, tmp_path):
    """Without a table of marks, or with one of somebody else, no result is known to be an earlier run's."""
    out = tmp_path / "out"
    (out / "records").mkdir(parents=True)
    (out / "records" / "bob.txt").write_text("")
    (out / "records" / "dan.json").write_text("{}")
    (out / "marks.csv").write_text("student,points\ndan,3\n")
    dhkit(folder, output=out)
    assert {"records/bob.txt", "records/dan.json"} <= set(files_in(out))


def test_marking_again_into_the_same_folder(dhkit, folder, tmp_path, capsys):
    out = tmp_path / "out"
    dhkit(folder, output=out)
    before = files_in(out)
    assert grade.mark_again([out], Rubric(points=10), Delivery(output=out)) == 2
    assert files_in(out) == before
    assert capsys.readouterr().err == ""


def test_two_files_of_one_student_are_two_rows_and_are_told(dhkit, folder, tmp_path):
    (folder / "ada" / "second.toml").write_text("right")
    out = tmp_path / "out"
    _, printed, _ = dhkit(folder, output=out)
    words = "ada has 2 sheets (answer.toml, second.toml): each is judged and has a row of its own"
    assert words in " ".join(printed.split())
    assert words in (out / "class.html").read_text("utf-8")
    rows = list(csv.DictReader((out / "marks.csv").read_text("utf-8").splitlines()))
    assert [row["points"] for row in rows if row["student"] == "ada"] == ["62.5", "100"]
    assert {"ada.html", "ada-2.html"} <= {path.name for path in (out / "students").iterdir()}


def test_marking_again_without_judging(dhkit, folder, tmp_path, capsys):
    dhkit(folder, output=tmp_path / "out", feedback="verdict")
    kinder = Rubric(points=10, credit=Credit(mistakes={"gravity_sign": 1}, follow_on=1))
    assert grade.mark_again([tmp_path / "out"], kinder, Delivery("json")) == 2
    ada, bob, cleo = map(json.loads, capsys.readouterr().out.splitlines())
    assert (ada["points"], bob["points"], cleo["points"]) == (10, 10, 0)
    assert ada["verdict"] == "wrong"


def test_marking_again_takes_the_rubric_of_a_task(dhkit, folder, tmp_path, capsys):
    from dhkit.cli import main

    dhkit(folder, output=tmp_path / "out")
    task = tmp_path / "task.toml"
    task.write_text('robot = "planar2r"\n[rubric]\npoints = 10\n')
    with pytest.raises(SystemExit):
        main(["grade", "--remark", str(tmp_path / "out"), "--task", str(task), "--json"])
    assert {json.loads(line)["most"] for line in capsys.readouterr().out.splitlines()} == {10}


def test_marking_again_needs_reports(tmp_path):
    with pytest.raises(AnswerError, match="no reports"):
        grade.mark_again([tmp_path], Rubric())


def test_names_of_files_come_from_nobody(dhkit, tmp_path, monkeypatch):
    """Students whose names are paths, hidden, long or alike get files of their own, in the folder."""
    monkeypatch.setattr(
        FakeJudge,
        "__call__",
        lambda self, path: replace(RIGHT, student=path.read_text(encoding="utf-8")),
    )
    names = ["../../up", "..", "", "Ada", "ada", "x" * 300, "a/b\n", "Zoë", "con\x1b[31m"]
    for k, name in enumerate(names):
        (tmp_path / f"{k}.toml").write_text(name, encoding="utf-8")
    dhkit(*(tmp_path / f"{k}.toml" for k in range(len(names))), output=tmp_path / "out")
    written = list((tmp_path / "out" / "students").iterdir())
    assert len({path.name.casefold() for path in written}) == len(names)
    assert all(
        re.fullmatch(r"\w[\w.-]*\.html", path.name) and len(path.name) < 100 for path in written
    )


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"form": "pdf"}, "--format: found 'pdf'; expected text, json, gradescope, junit, html"),
        ({"feedback": "some"}, "--feedback: found 'some'; expected full, hint, verdict"),
        ({"output": "ada.toml"}, "would overwrite an answer sheet"),
        ({"output": "/dev/null/report", "form": "html"}, "/dev/null: a file; expected a folder"),
        ({"output": "marks.csv"}, "expected a folder for the reports of several sheets"),
    ],
)
def test_what_cannot_be_meant_is_refused_before_anything_is_judged(
    dhkit, folder, options, complaint
):
    if "output" in options:
        options = options | {"output": folder.parent / options["output"]}
    with pytest.raises(AnswerError, match=re.escape(complaint)):
        dhkit(folder, **options)


def test_the_bar_starts_no_thread(monkeypatch):
    """Sheets' processes are forked while it is shown."""
    import threading

    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    before = threading.active_count()
    with grade._progress(3) as progress:
        progress(1, 3)
        assert threading.active_count() == before


def test_a_sheet_alone_may_bring_its_rubric(tmp_path, capsys):
    path = tmp_path / "answer.toml"
    path.write_text(
        'robot = "planar2r"\n[rubric]\npoints = 7\n[answer]\nV = "m1*g*l1*s1/2 + m2*g*(l1*s1 + l2*s12/2)"\n'
    )
    assert grade.grade_files([path], None, None) == 0
    assert "7 of 7 points" in capsys.readouterr().out
    (tmp_path / "other.toml").write_text("points = 9\n")
    assert grade.grade_files([path], None, tmp_path / "other.toml") == 0
    assert "9 of 9 points" in capsys.readouterr().out
    (tmp_path / "class").mkdir()
    path.rename(tmp_path / "class" / "ada.toml")
    assert grade.grade_files([tmp_path / "class"], None, None) == 0
    assert "100 of 100" in capsys.readouterr().out


def test_an_output_that_cannot_be_meant_is_refused_before_anything_is_judged(tmp_path):
    (tmp_path / "report").write_text("")
    Delivery(output=tmp_path).check(several=True)
    Delivery("html", output=tmp_path / "report.html").check(several=True)
    Delivery(output=tmp_path / "report.txt").check(several=False)
    for name, form, several in (
        ("report", "text", True),
        ("a.txt", "text", True),
        ("ada.tex", "html", False),
    ):
        with pytest.raises(AnswerError, match="expected"):
            Delivery(form, output=tmp_path / name).check(several)


GRADESCOPE = """
submission_1:
  :submitters: [{":name": Ada, ":sid": ada}]
  :created_at: 2026-11-20 10:00:00 Z
submission_2:
  :submitters: [{":name": Ada, ":sid": ada}]
  :created_at: 2026-11-22 10:00:00 Z
submission_3:
  :submitters: [{":name": Bob, ":sid": bob}]
  :created_at: 2026-11-20 10:00:00 Z
"""


@pytest.fixture
def handed_in_again(folder):
    """Ada's first submission is right, and her second, which is late, is wrong."""
    files = {"submission_metadata.yml": GRADESCOPE, "submission_1/answer.toml": "right"}
    files |= {"submission_2/answer.toml": "wrong", "submission_3/answer.toml": "right"}
    for name, text in files.items():
        path = folder.parent / "export" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder.parent / "export"


def rows_of(out):
    rows = csv.DictReader((out / "marks.csv").read_text("utf-8").splitlines())
    return [(row["student"], row["points"]) for row in rows]


def test_the_best_submission_counts_and_the_others_keep_their_records(
    dhkit, handed_in_again, tmp_path
):
    out = tmp_path / "out"
    dhkit(handed_in_again, output=out)
    assert rows_of(out) == [("ada", "100"), ("ada", "62.5"), ("bob", "100")]
    dhkit(handed_in_again, output=out, keep=Keep.BEST)
    assert rows_of(out) == [("ada", "100"), ("bob", "100")]
    assert files_in(out / "records") == ["ada-2.json", "ada.json", "bob.json"]
    assert files_in(out / "students") == ["ada.html", "bob.html"]


def test_lateness_decides_which_is_the_best(dhkit, handed_in_again, tmp_path):
    due = datetime(2026, 11, 19, 10, 1, tzinfo=UTC)
    rubric = Rubric(late=LateRule(due, per_day=0.3))
    out = tmp_path / "out"
    _, printed, _ = dhkit(handed_in_again, rubric=rubric, output=out)
    assert rows_of(out) == [("ada", "70"), ("ada", "6.25"), ("bob", "70")]
    assert "70 of 100 (100 before; 1 day late: -30 %)" in re.sub(r"\s+", " ", printed)
    assert "70 of 100 points (100 before; 1 day late: -30 %)" in (
        out / "students" / "bob.html"
    ).read_text("utf-8")
    grade.mark_again([out], Rubric(), Delivery(output=tmp_path / "again", keep=Keep.BEST))
    assert rows_of(tmp_path / "again") == [("ada", "100"), ("bob", "100")]


def test_a_run_goes_on_where_it_was_stopped(folder, tmp_path, capsys):
    """Reports are taken up by their keys; errors, and sheets that have changed, are judged again."""
    out = tmp_path / "out"
    asked = []

    def run(key_of=lambda sheet: judgement_key(sheet, ["rules"])):
        asked.clear()
        with opened_submissions([folder]) as submissions:
            grade.run(
                submissions,
                FakeJudge(prepare=lambda report: asked.append(report.student)),
                Delivery(output=out),
                place=JudgingPlace(1),
                key_of=key_of,
            )
        return list(asked), capsys.readouterr().err

    assert run()[0] == ["ada", "bob"]
    for part in ("marks.csv", "class.html", "records/bob.json"):
        (out / part).unlink()
    judged, said = run()
    assert judged == ["bob"]
    assert "1 of 3 sheets were judged before, and are taken up" in said
    assert rows_of(out) == [("ada", "62.5"), ("bob", "100"), ("cleo", "0")]
    (folder / "ada" / "answer.toml").write_text("right")
    assert run()[0] == ["ada"]
    assert rows_of(out)[0] == ("ada", "100")
    assert run(lambda sheet: judgement_key(sheet, ["other rules"]))[0] == ["ada", "bob"]
    (out / "records" / "ada.json").write_text("{half")
    assert run(lambda sheet: judgement_key(sheet, ["other rules"]))[0] == ["ada"]


def test_ctrl_c_says_how_to_go_on(folder, tmp_path, capsys):
    def stop(report):
        raise KeyboardInterrupt

    with opened_submissions([folder]) as submissions, pytest.raises(KeyboardInterrupt):
        grade.run(
            submissions,
            FakeJudge(prepare=stop),
            Delivery(output=tmp_path / "out"),
            place=JudgingPlace(1),
            key_of=lambda sheet: judgement_key(sheet, []),
        )
    assert capsys.readouterr().err == (
        f"dhkit: stopped; the same command goes on with {tmp_path / 'out'}\n"
    )
    assert files_in(tmp_path / "out") == ["records/ada.json"]
