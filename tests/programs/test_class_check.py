"""Programs of a class: a row each, what fails first, and a run that goes on after a stop."""

import csv
import json
import shutil

import pytest

from dhkit import Arm
from dhkit.cli import main
from dhkit.errors import DhkitError
from dhkit.execution.isolation import find_isolation
from dhkit.programs.class_check import CheckRow, check_csv, check_page

RIGHT = """
from math import cos, sin
def fk(q):
    a, b = q[0], q[0] + q[1]
    x, y = L1 * cos(a) + L2 * cos(b), L1 * sin(a) + L2 * sin(b)
    return [[cos(b), -sin(b), 0, x], [sin(b), cos(b), 0, y], [0, 0, 1, 0], [0, 0, 0, 1]]
"""
FORGOTTEN = """
right = fk
def fk(q):
    return right([q[0], 0.0])
"""
FILES = {
    "Lovelace Ada_1_assignsubmission_file_/fk.py": "RIGHT",
    "Babbage Charles_2_assignsubmission_file_/fk.py": "RIGHT" + FORGOTTEN,
    "Euler Leonhard_3_assignsubmission_file_/fk.py": "def fk(q) return",
    "Noether Emmy_4_assignsubmission_file_/fk.pdf": "",
}


def is_isolated():
    try:
        find_isolation(required=True)
    except DhkitError:
        return False
    return True


pytestmark = pytest.mark.skipif(not is_isolated(), reason="programs cannot be isolated here")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A class as Moodle exports it, packed, in the folder that we are in."""
    monkeypatch.chdir(tmp_path)
    lengths = Arm.load("planar2r").description.parameters
    right = RIGHT.replace("L1", lengths["l1"].text).replace("L2", lengths["l2"].text)
    for name, text in FILES.items():
        path = tmp_path / "files" / name
        path.parent.mkdir(parents=True)
        path.write_text(text.replace("RIGHT", right))
    shutil.make_archive("class", "zip", "files")
    return tmp_path


def check(capsys, *options):
    with pytest.raises(SystemExit) as exit:
        main(["check", "planar2r", "class.zip", "--seed", "1", "--samples", "5", *options])
    return exit.value.code, *capsys.readouterr()


def test_a_class_is_a_table_with_what_fails_first(folder, capsys):
    status, printed, said = check(capsys, "-o", "out", "--jobs", "2")
    assert status == 2
    assert "class.zip: read as a Moodle export: 4 students" in said
    assert "Lovelace Ada_1" in printed
    table = (folder / "out" / "marks.csv").read_text("utf-8")
    rows = {row["student"]: row for row in csv.DictReader(table.splitlines())}
    assert {name: (row["points"], row["most"]) for name, row in rows.items()} == {
        "Lovelace Ada_1": ("100", "100"),
        "Babbage Charles_2": ("0", "100"),
        "Euler Leonhard_3": ("0", "100"),
        "Noether Emmy_4": ("0", "100"),
    }
    babbage = rows["Babbage Charles_2"]
    assert babbage["first failure"] == "fk agrees"
    assert "0 of 5 poses agree" in babbage["what is said"]
    assert "SyntaxError" in rows["Euler Leonhard_3"]["what is said"]
    assert rows["Noether Emmy_4"]["what is said"] == "not read: .pdf; expected .m, .py"
    page = (folder / "out" / "class.html").read_text("utf-8")
    assert "4 programs against planar2r: 1 with all points." in page
    assert "Where programs fail first" in page
    assert page.count('<tr id="row-') == 4
    assert "/tmp/" not in page.replace(str(folder), "")


def test_a_run_goes_on_and_the_number_of_jobs_does_not_count(folder, capsys):
    check(capsys, "-o", "one", "--jobs", "1")
    check(capsys, "-o", "two", "--jobs", "4")
    for name in ("marks.csv", "class.html"):
        assert (folder / "one" / name).read_text() == (folder / "two" / name).read_text()
    for path in (folder / "one" / "records").iterdir():
        assert path.read_text() == (folder / "two" / "records" / path.name).read_text()
    (folder / "one" / "marks.csv").unlink()
    (folder / "one" / "records" / "Lovelace_Ada_1.json").unlink()
    _, _, said = check(capsys, "-o", "one")
    assert "1 of 4 programs were scored before, and are taken up" in said
    assert (folder / "one" / "marks.csv").read_text() == (folder / "two" / "marks.csv").read_text()


def test_rows_as_json(folder, capsys):
    _, printed, _ = check(capsys, "--json")
    rows = [CheckRow.from_json(line) for line in printed.splitlines()]
    assert [row.student for row in rows] == sorted(row.student for row in rows)
    assert json.loads(printed.splitlines()[-1])["error"].startswith("not read")


def test_the_last_the_best_or_all_programs_of_a_student_count(folder, capsys):
    texts = {"ada_9_1_a.py": "RIGHT", "ada_9_2_a-1.py": "RIGHT" + FORGOTTEN}
    lengths = Arm.load("planar2r").description.parameters
    right = RIGHT.replace("L1", lengths["l1"].text).replace("L2", lengths["l2"].text)
    shutil.rmtree("files")
    for name, text in texts.items():
        path = folder / "files" / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text.replace("RIGHT", right))
    shutil.make_archive("class", "zip", "files")
    counting = {}
    for keep in ("last", "best", "all"):
        check(capsys, "--keep", keep, "-o", keep)
        rows = csv.DictReader((folder / keep / "marks.csv").read_text("utf-8").splitlines())
        counting[keep] = [row["points"] for row in rows]
    assert counting == {"last": ["0"], "best": ["100"], "all": ["100", "0"]}
    assert len(list((folder / "best" / "records").iterdir())) == 2
    assert check(capsys)[1] == check(capsys, "--keep", "last")[1]


@pytest.mark.parametrize("options", [("-o", "out"), ("--keep", "best"), ("--export", "canvas")])
def test_options_of_a_class_are_refused_for_one_program(folder, capsys, options):
    path = next(folder.rglob("fk.py"))
    with pytest.raises(SystemExit) as exit:
        main(["check", "planar2r", str(path), *options])
    assert exit.value.code == 2
    assert "are for the programs of a class" in capsys.readouterr().err


def test_texts_of_students_do_nothing():
    rows = [CheckRow("=1+1", "<script>.py", error="<img src=x>")]
    assert "'=1+1" in check_csv(rows)
    page = check_page(rows, "planar2r", "marks.csv")
    assert "<script>" not in page
    assert "<img" not in page
