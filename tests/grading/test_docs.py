"""The instructors' page: its sheet, its rubric and its commands are run as they stand; its Python is a doctest."""

import re
import shlex
import tomllib
from decimal import Decimal
from pathlib import Path

import pytest

from dhkit.cli import main
from dhkit.description import library_robot
from dhkit.grading import Rubric
from dhkit.grading.answers.sheet import sheet_of
from dhkit.grading.sheet_judge import judge_sheet

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "grading.md").read_text("utf-8")
TASK, SHEET, STEPS, RUBRIC, LATE, VARIANTS = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
COMMANDS = re.findall(r"^\$ dhkit ([^#\n]*)", PAGE, re.MULTILINE)


def test_the_sheet_is_right():
    report = judge_sheet(
        library_robot("planar2r"), sheet_of(tomllib.loads(SHEET, parse_float=Decimal))
    )
    assert report.verdict.value == "correct", str(report)


def test_the_steps_are_right():
    data = {"robot": "planar2r", **tomllib.loads(STEPS, parse_float=Decimal)}
    report = judge_sheet(library_robot("planar2r"), sheet_of(data))
    assert report.verdict.value == "correct", str(report)


def test_the_rubric_is_one():
    assert Rubric.from_data(tomllib.loads(RUBRIC)).weights["M"] == 4
    assert Rubric.from_data(tomllib.loads(LATE)).late.at_most == 0.5


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_works(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "submissions" / "ada").mkdir(parents=True)
    for path in ("answer.toml", "submissions/ada/answer.toml", "submissions/bob.toml"):
        (tmp_path / path).write_text(SHEET)
    (tmp_path / "task.toml").write_text(TASK)
    (tmp_path / "variants.toml").write_text(VARIANTS)
    (tmp_path / "students.csv").write_text("student,email\nada,ada@x.org\nbob,bob@x.org\n")
    (tmp_path / "homework.m").write_text(
        "V = m1*g*l1*sin(q(1))/2 + m2*g*(l1*sin(q(1)) + l2*sin(q(1) + q(2))/2);\n"
    )
    (tmp_path / "homework.py").write_text(
        "V = sum(m*g*y for m, y in [(m1, l1*sin(q1)/2), (m2, l1*sin(q1) + l2*sin(q1 + q2)/2)])\n"
    )
    with pytest.raises(SystemExit) as exit:
        main(shlex.split(command))
    assert exit.value.code == 0, capsys.readouterr()


def test_marks_may_change_afterwards(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "submissions").mkdir()
    for name in ("ada", "bob"):
        (tmp_path / "submissions" / f"{name}.toml").write_text(SHEET)
    (tmp_path / "new.toml").write_text(RUBRIC)
    for command in ("grade submissions -o out", "grade --remark out --rubric new.toml -o out2"):
        with pytest.raises(SystemExit) as exit:
            main(shlex.split(command))
        assert exit.value.code == 0
    rows = [line.split(",") for line in (tmp_path / "out2" / "marks.csv").read_text().splitlines()]
    # Of M 4, C 2 and g 2 the sheet has no C.
    assert [row[:3] for row in rows] == [
        ["student", "points", "most"],
        ["ada", "15", "20"],
        ["bob", "15", "20"],
    ]
