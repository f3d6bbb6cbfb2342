"""Empty sheets: a line for each quantity, or those that a task asks for."""

import pytest

from dhkit.cli import main
from dhkit.description import library_robot
from dhkit.errors import AnswerError
from dhkit.grading import Rubric, Verdict, grade
from dhkit.grading.answers.sheet import quantity_names, read_sheet, read_task
from dhkit.grading.empty_sheet import template
from dhkit.grading.marks import marks

TASK = """
robot = "planar2r"
[task]
asked = ["T", "J", "h", "ik"]
friction = true
values = false
proof = "required"
J_rows = ["vx", "wz"]
[names]
q = ["a", "b"]
angles = "absolute"
parameters = { lc1 = "l1/2" }
[rubric]
points = 7
"""


def run(command, capsys):
    """Run a command; return its status, stdout and stderr."""
    with pytest.raises(SystemExit) as ended:
        main(command)
    return ended.value.code, *capsys.readouterr()


@pytest.mark.parametrize("name", ["planar2r", "puma560"])
def test_every_quantity_has_a_line(name):
    robot = library_robot(name)
    lines = template(robot).splitlines()
    for quantity in quantity_names(robot.n):
        assert [line for line in lines if line.removeprefix("# ").startswith(f"{quantity} = ")]


def test_a_sheet_follows_the_task(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "task.toml").write_text(TASK)
    command = ["grade", "--template", "planar2r", "--task", "task.toml", "-o", "sheet.toml"]
    assert run(command, capsys)[0] == 0
    sheet = read_sheet(tmp_path / "sheet.toml")
    task = read_task(tmp_path / "task.toml")
    assert (sheet.names, sheet.task, sheet.robot) == (task.names, task.task, task.robot)
    assert set(sheet.answers) == {"T", "J", "h"}
    assert "steps" in (tmp_path / "sheet.toml").read_text()


def test_what_a_task_asks_for_is_missing_on_its_empty_sheet(tmp_path):
    task = tmp_path / "task.toml"
    task.write_text('robot = "planar2r"\n[task]\nasked = ["V", "dh", "g"]\n')
    text = template(library_robot("planar2r"), task=read_task(task))
    assert "[answer.dh]" in text
    sheet = tmp_path / "sheet.toml"
    sheet.write_text(text)
    with pytest.raises(AnswerError, match="every entry is empty"):
        grade(sheet)
    sheet.write_text(text.replace('V = ""', 'V = "m1*g*l1*s1/2 + m2*g*(l1*s1 + l2*s12/2)"'))
    report = grade(sheet)
    assert report.verdict is Verdict.INCOMPLETE
    assert marks(report, Rubric()).points == pytest.approx(100 / 3, abs=0.5)


def test_a_task_about_another_robot_or_of_a_lab_has_no_such_sheet(tmp_path, capsys):
    task = tmp_path / "task.toml"
    task.write_text(TASK)
    status, _, err = run(["grade", "--template", "puma560", "--task", str(task)], capsys)
    assert (status, err.count("\n")) == (2, 1)
    assert "is about another robot; expected planar2r" in err
    task.write_text('kind = "assignment"\n')
    status, _, err = run(["grade", "--template", "planar2r", "--task", str(task)], capsys)
    assert status == 2
    assert "a lab's assignment" in err


@pytest.mark.parametrize(
    ("options", "found"),
    [
        ("--template planar2r --rubric r.toml", "--rubric"),
        ("--template planar2r sheet.toml", "answer sheets"),
        ("--explain planar2r --task t.toml", "--task"),
        ("out --remark --robot planar2r", "--robot"),
    ],
)
def test_no_option_is_ignored_in_silence(options, found, capsys):
    status, _, err = run(["grade", *options.split()], capsys)
    assert status == 2
    assert f"found {found} too" in err
    assert err.count("\n") == 1
