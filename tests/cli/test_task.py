"""`dhkit task variants` and `dhkit grade` with its key: what is written for whom, and what is judged by what."""

import csv
import json
import os
import tomllib
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import pytest

from dhkit import Arm
from dhkit.cli import main, task as task_command, task_folder
from dhkit.description import read_robot, with_parameters
from dhkit.errors import MissingPackageError
from dhkit.grading import grade
from dhkit.symbolic import lagrangian

TASK = """robot = "planar2r"
[task]
asked = ["M", "g"]
[rubric]
points = 20
[variants.parameters]
l1 = [0.3, 0.6]
l2 = [0.3, 0.6]
m1 = [1.0, 3.0]
m2 = [1.0, 3.0]
"""
CLASS = [f"s{k}" for k in range(12)]
FILES = ["picture.png", "robot.toml", "sheet.toml", "statement.html"]
PRINTED = ["statement.pdf"] if find_spec("typst") else []
"""The extra ``report`` may be missing."""


@pytest.fixture
def course(tmp_path, monkeypatch):
    """A folder with a task and a list of students, which is the one we are in."""
    monkeypatch.chdir(tmp_path)
    Path("task.toml").write_text(TASK)
    Path("students.txt").write_text("\n".join(CLASS[:3]))
    return tmp_path


@pytest.fixture
def quick(monkeypatch):
    """Write statements without pictures, which take most of the time."""
    monkeypatch.setattr(task_folder, "student_files", lambda variant, task: {"sheet.toml": b"x"})


@pytest.fixture
def dhkit(capsys):
    """Run a command; return the status, stdout and stderr."""

    def run(*words):
        with pytest.raises(SystemExit) as exit:
            main(list(words))
        return exit.value.code, *capsys.readouterr()

    return run


def variants(*more):
    return ("task", "variants", "task.toml", "--students", "students.txt", "--seed", "1", *more)


def files(folder):
    return {path.relative_to(folder): path.read_bytes() for path in Path(folder).rglob("*.*")}


def answer(values):
    """Return M and g of two rods in numbers, by the formulas of a textbook rather than by dhkit's derivation."""
    l1, l2, m1, m2 = (float(values[name]) for name in ("l1", "l2", "m1", "m2"))
    g = 9.81
    c = m2 * l1 * l2
    d = m2 * l2**2 / 3
    M11 = f"{m1 * l1**2 / 3 + m2 * l1**2 + d:.12g} + {c:.12g}*cos(q2)"
    M12 = f"{d:.12g} + {c / 2:.12g}*cos(q2)"
    g2 = f"{m2 * g * l2 / 2:.12g}*cos(q1 + q2)"
    g1 = f"{(m1 / 2 + m2) * g * l1:.12g}*cos(q1) + {g2}"
    return {"M": [[M11, M12], [M12, f"{d:.12g}"]], "g": [g1, g2]}


def marks(folder):
    """Return the rows of a folder's table of marks."""
    text = Path(folder, "marks.csv").read_text("utf-8")
    return list(csv.DictReader(text.splitlines()))


def hand_in(folder, student, sheet, values):
    """Fill a student's sheet in."""
    for name, formulas in answer(values).items():
        (line,) = (line for line in sheet.splitlines() if line.startswith(f"{name} ="))
        sheet = sheet.replace(line, f"{name} = {json.dumps(formulas)}")
    (folder / student).mkdir(parents=True)
    (folder / student / "sheet.toml").write_text(sheet)


@pytest.mark.slow
def test_a_class_is_judged_by_its_own_arms(course, dhkit):
    Path("students.txt").write_text("\n".join(CLASS))
    status, out, _ = dhkit(*variants("-o", "hw"))
    assert status == 0 and "wrote hw: 12 students" in out
    key = json.loads(Path("hw/key/variants.json").read_text())["students"]
    sheets = {student: Path("hw/students", student, "sheet.toml").read_text() for student in CLASS}
    for student, neighbour in zip(CLASS, [*CLASS[1:], CLASS[0]], strict=True):
        hand_in(course / "right", student, sheets[student], key[student]["values"])
        hand_in(course / "copied", student, sheets[student], key[neighbour]["values"])
        # The neighbour's robot file beside the sheet would make the copied answer right.
        robot = Path("hw/students", neighbour, "robot.toml").read_text()
        (course / "copied" / student / "robot.toml").write_text(robot)

    status, out, err = dhkit("grade", "right", "--task", "hw/key", "-o", "out")
    assert status == 0, (out, err)
    rows = marks("out")
    assert {row["student"]: row["points"] for row in rows} == dict.fromkeys(CLASS, "20")
    status, out, err = dhkit("grade", "copied", "--task", "hw/key/variants.json", "-o", "copies")
    assert status == 1, (out, err)
    rows = marks("copies")
    assert {row["verdict"] for row in rows} == {"wrong"} and len(rows) == len(CLASS)
    assert grade("copied/s0/sheet.toml", Arm(read_robot("copied/s0/robot.toml"))), "right elsewhere"


def test_what_a_student_gets(course, dhkit):
    assert dhkit(*variants("-o", "hw"))[0] == 0
    assert sorted(path.name for path in Path("hw").iterdir()) == ["key", "students"]
    for student in CLASS[:3]:
        folder = Path("hw/students", student)
        assert sorted(path.name for path in folder.iterdir()) == FILES + PRINTED
        robot = read_robot(folder / "robot.toml")
        judged = read_robot(Path("hw/key/robots", f"{student}.toml"))
        # Notes may say what is asked.
        assert robot == replace(judged, notes="") and judged.notes
        sheet = tomllib.loads((folder / "sheet.toml").read_text())
        assert (sheet["robot"], sheet["student"]) == ("robot.toml", student)
        assert sheet["answer"] == {"M": [["", ""], ["", ""]], "g": ["", ""]}
        page = (folder / "statement.html").read_text("utf-8")
        for name in ("l1", "l2", "m1", "m2"):
            assert f"{float(robot.parameters[name]):g}" in page
        for text in (f"Student: {student}", "Mass matrix", "data:image/png", "standard (distal)"):
            assert text in page
        for printed in PRINTED:
            assert (folder / printed).read_bytes().startswith(b"%PDF")
    key = json.loads(Path("hw/key/variants.json").read_text())
    assert key["seed"] == 1 and len(key["task_sha256"]) == 64
    assert Path("hw/key/task.toml").read_text() == TASK
    handed_out = b"".join(files("hw/students").values())
    assert b"[rubric]" not in handed_out and b"task_sha256" not in handed_out


def test_the_truth_of_a_variant_is_that_of_its_numbers(course, dhkit):
    dhkit(*variants("-o", "hw"))
    values = json.loads(Path("hw/key/variants.json").read_text())["students"]["s0"]["values"]
    own = with_parameters(Arm.load("planar2r").description, **values)
    judged = read_robot("hw/key/robots/s0.toml")
    assert judged == own
    assert lagrangian(judged).text() == lagrangian(own).text()


def test_a_late_student_changes_nobody(course, dhkit, quick):
    dhkit(*variants("-o", "hw"))
    before = files("hw/key/robots")
    Path("students.txt").write_text("\n".join(["late", *reversed(CLASS[:3])]))
    status, out, _ = dhkit(*variants("-o", "hw", "--force"))
    assert status == 0 and "other variants than before" not in out
    after = files("hw/key/robots")
    assert before.items() < after.items() and len(after) == len(before) + 1
    Path("task.toml").write_text(TASK.replace("[1.0, 3.0]", "[2.0, 4.0]"))
    _, out, _ = dhkit(*variants("-o", "hw", "--force"))
    assert "hw: other variants than before: late, s2, s1, s0" in out


def test_students_who_are_not_in_the_key_are_named_and_not_judged(course, dhkit, quick):
    dhkit(*variants("-o", "hw"))
    sheet = 'format = 1\nrobot = "planar2r"\nstudent = "s1"\n[answer]\nM = ["", ""]\ng = ["", ""]\n'
    values = json.loads(Path("hw/key/variants.json").read_text())["students"]["s1"]["values"]
    for student in ("s1", "mallory"):
        hand_in(course / "class", student, sheet, values)
    status, _, _ = dhkit("grade", "class", "--task", "hw/key", "-o", "out")
    assert status == 2
    mallory, own = marks("out")
    assert (mallory["student"], mallory["points"]) == ("mallory", "0")
    assert mallory["error"] == "student 'mallory' has no variant in hw/key; not judged"
    assert own["points"] == "20"
    # A single file goes by its folder's name, and not by the name that is signed in it.
    assert dhkit("grade", "class/s1/sheet.toml", "--task", "hw/key")[0] == 0
    status, _, err = dhkit("grade", "class/mallory/sheet.toml", "--task", "hw/key")
    assert status == 2 and "has no variant" in err
    # A student's name may be that of the file.
    Path("s1.toml").write_text(Path("class/s1/sheet.toml").read_text())
    assert dhkit("grade", "s1.toml", "--task", "hw/key")[0] == 0


def test_marks_of_variants_may_change_afterwards(course, dhkit, quick):
    dhkit(*variants("-o", "hw"))
    key = json.loads(Path("hw/key/variants.json").read_text())["students"]
    for student in ("s0", "s1"):
        sheet = '[answer]\nM = ["", ""]\ng = ["", ""]\n'
        hand_in(course / "class", student, sheet, key[student]["values"])
    assert dhkit("grade", "class", "--task", "hw/key", "-o", "out")[0] == 0
    Path("rubric.toml").write_text("points = 7")
    assert dhkit("grade", "--remark", "out", "--rubric", "rubric.toml", "-o", "again")[0] == 0
    assert dhkit("grade", "--remark", "out", "--task", "hw/key", "-o", "third")[0] == 0
    for folder, points in (("again", "7"), ("third", "20")):
        assert [row["points"] for row in marks(folder)] == [points] * 2


def test_a_task_with_variants_is_judged_by_its_key_alone(course, dhkit, quick):
    dhkit(*variants("-o", "hw"))
    Path("s0.toml").write_text('[answer]\ng = ["0", "0"]\n')
    status, _, err = dhkit("grade", "s0.toml", "--task", "task.toml")
    assert status == 2 and "task.toml: has variants; expected the folder key" in err
    status, _, err = dhkit("grade", "s0.toml", "--task", "hw/key", "--robot", "planar2r")
    assert status == 2 and "--robot planar2r: hw/key has a robot for each student" in err
    status, _, err = dhkit("grade", "s0.toml", "--task", "hw")
    assert status == 2 and "hw/variants.json: no such file" in err


@pytest.mark.parametrize(
    "student", ["../x", "..", "/tmp/x", "a/../../x", "key/../../x", "a\\b", ".ssh", "C:x"]
)
def test_unsafe_ids_write_nothing(course, dhkit, student):
    Path("students.txt").write_text(f"ada\n{student}\n")
    before = files(course)
    status, out, err = dhkit(*variants("-o", "hw"))
    assert (status, out) == (2, "") and "students.txt, line 2: student" in err
    assert files(course) == before and not Path("hw").exists()


def test_names_of_other_scripts_are_folders(course, dhkit):
    Path("students.csv").write_text(
        'Name,Username\n"L, A",Zoë O\'Brien\nx,李雷 "q"\n'.replace(' "q"', "")
    )
    words = ["students.csv" if word == "students.txt" else word for word in variants("-o", "hw")]
    status, out, _ = dhkit(*words)
    assert status == 0 and "ids are those of the column 'Username'" in out
    assert {path.name for path in Path("hw/students").iterdir()} == {"Zoë O'Brien", "李雷"}
    sheet = tomllib.loads(Path("hw/students/Zoë O'Brien/sheet.toml").read_text("utf-8"))
    assert sheet["student"] == "Zoë O'Brien"
    assert dhkit("grade", "hw/students", "--task", "hw/key")[0] == 2  # empty, and each is known
    assert "Student: 李雷" in Path("hw/students/李雷/statement.html").read_text("utf-8")


def test_a_folder_is_not_overwritten(course, dhkit, quick):
    assert dhkit(*variants("-o", "hw"))[0] == 0
    before = files("hw")
    status, _, err = dhkit(*variants("-o", "hw"))
    assert status == 2 and "hw: has variants already; expected a new folder, or --force" in err
    Path("hw/notes.txt").write_text("mine")
    status, _, err = dhkit(*variants("-o", "hw", "--force"))
    assert status == 2 and "hw: has files that are not variants" in err
    Path("hw/notes.txt").unlink()
    assert files("hw") == before
    assert dhkit(*variants("-o", "hw", "--force"))[0] == 0
    assert files("hw") == before
    for place in (".", "task.toml"):
        assert dhkit(*variants("-o", place, "--force"))[0] == 2
    Path("empty").mkdir()
    assert dhkit(*variants("-o", "empty"))[0] == 0
    assert files("empty") == before


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError(28, "No space left on device")])
def test_an_interrupted_run_leaves_the_folder_as_it_was(course, dhkit, quick, monkeypatch, error):
    dhkit(*variants("-o", "hw"))
    before = files(course)

    def interrupted(variant, task):
        if variant.student == "s1":
            raise error
        return {"sheet.toml": b"new"}

    monkeypatch.setattr(task_folder, "student_files", interrupted)
    assert dhkit(*variants("-o", "hw", "--force"))[0] in (2, 130)
    assert dhkit(*variants("-o", "new"))[0] in (2, 130)
    assert files(course) == before and not Path("new").exists()
    assert sorted(os.listdir(course)) == ["hw", "students.txt", "task.toml"]  # noqa: PTH208


def test_equal_variants_are_refused_unless_they_are_allowed(course, dhkit, quick):
    Path("task.toml").write_text('robot = "planar2r"\n[variants.parameters]\nl1 = [0.43, 0.44]\n')
    status, _, err = dhkit(*variants("-o", "hw"))
    assert status == 2 and not Path("hw").exists()
    assert "3 students, and the ranges have 2 distinct variants" in err and "--shared" in err
    status, out, _ = dhkit(*variants("-o", "hw", "--shared"))
    assert status == 0 and "the same variant: s" in out

    Path("task.toml").write_text('robot = "planar2r"\n[variants.parameters]\nl1 = [0.43, 0.49]\n')
    seeds = {}
    for seed in range(20):
        words = [*variants("-o", f"hw{seed}")]
        words[words.index("--seed") + 1] = str(seed)
        status, _, err = dhkit(*words)
        seeds[status] = err
    assert set(seeds) == {0, 2}
    assert "would belong to several students, such as s" in seeds[2] and "--seed" in seeds[2]


def test_unequal_work_is_said(course, dhkit, quick):
    Path("task.toml").write_text(
        '[variants]\nrobots = ["planar2r", "planar3r"]\n[variants.parameters]\nl1 = [0.3, 0.6]\n'
    )
    status, out, _ = dhkit(*variants("-o", "hw"))
    assert status == 0
    assert "answers of different size, in terms: planar2r, standard DH: " in out
    status, out, _ = dhkit(*variants("-o", "json", "--json"))
    data = json.loads(out)
    assert data["students"] == 3 and len(data["sizes"]) == 2 and data["same"] == []


def test_what_makes_variants_useless_is_said(course, dhkit, quick):
    Path("task.toml").write_text(TASK.replace("[task]\n", "[task]\nvalues = false\n"))
    assert "all students have one answer" in dhkit(*variants("-o", "hw"))[1]
    Path("task.toml").write_text(TASK.replace('["M", "g"]', '["dh"]'))
    assert "the table that is asked for stands in the robot file" in dhkit(*variants("-o", "dh"))[1]


def test_without_typst_there_is_a_page_and_no_pdf(course, dhkit, monkeypatch):
    def missing():
        raise MissingPackageError("no typst")

    monkeypatch.setattr(task_folder, "require_typst", missing)
    Path("students.txt").write_text("ada")
    status, out, _ = dhkit(*variants("-o", "hw"))
    assert status == 0 and "no statement.pdf: the package typst is not installed" in out
    assert sorted(path.name for path in Path("hw/students/ada").iterdir()) == FILES


def test_progress_is_shown_on_a_terminal(course, dhkit, quick, bar_at_once):
    _, _, err = dhkit(*variants("-o", "hw"))
    assert "writing statements" in err


def test_the_group_has_help(dhkit):
    status, out, _ = dhkit("task", "variants", "--help")
    assert status == 0 and "--students" in out and "--seed" in out
    assert task_command.task.__doc__
    status, _, err = dhkit("task", "variants", "task.toml")
    assert status == 2 and "--students" in err
