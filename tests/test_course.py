"""The course: solutions are right, planted mistakes are named, lab assignments can be solved, notebooks run."""

import re
import time
from pathlib import Path

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient

import dhkit
from dhkit import Arm
from dhkit.grading import GradeOptions, Verdict, grade, marks
from dhkit.grading.answers.sheet import read_sheet, read_task
from dhkit.grading.empty_sheet import template
from dhkit.lab import Assignment
from dhkit.lab.assignment import (
    AnswerRight,
    ControlWithin,
    JointsAt,
    MotionBetween,
    NumberIs,
    ToolAt,
)
from dhkit.lab.marks import lab_mark
from dhkit.platforms.contents import Task
from lab.test_requests import states
from waiting import wait_for

COURSE = Path(__file__).parents[1] / "course"
WEEKS = sorted(path for path in COURSE.glob("week*") if path.is_dir())
OF_SHEETS = [week for week in WEEKS if (week / "task.toml").exists()]
BANDWIDTH = 50.0
"""rad/s, with which PID follows the sine of week 8."""
PLANTED = [path for week in OF_SHEETS for path in sorted((week / "mistakes").glob("*.toml"))]


def name_of(path):
    return "-".join(path.relative_to(COURSE).with_suffix("").parts)


def judged(sheet, week):
    task = Task.read(week / "task.toml")
    report = grade(
        sheet, task.description, task.rubric, options=GradeOptions(task=task.sheet, seed=1)
    )
    return report, marks(report, task.rubric)


def test_it_has_eight_weeks_with_all_their_files():
    assert [week.name for week in WEEKS] == [f"week{k}" for k in range(1, 9)]
    for week in WEEKS:
        for file in ("statement.md", "solution.md", "lab.toml", "lecture.ipynb"):
            assert (week / file).exists(), week / file
    assert all(len(list((week / "mistakes").glob("*.toml"))) == 6 for week in OF_SHEETS)


@pytest.mark.parametrize("week", OF_SHEETS, ids=name_of)
def test_the_solution_is_right(week):
    report, given = judged(week / "solution.toml", week)
    assert report.verdict is Verdict.CORRECT
    assert report.missing == ()
    assert given.points == given.most


@pytest.mark.parametrize("planted", PLANTED, ids=name_of)
def test_a_planted_mistake_is_named(planted):
    report, given = judged(planted, planted.parents[1])
    assert report.verdict is Verdict.WRONG
    assert given.points < given.most
    named = {name for one in report.diagnosis for name in (one.mistake, *one.equivalent)}
    # Without the place that a name may have, as in "parameter_forgotten (I2)".
    assert planted.stem in {re.sub(r" \(.*\)", "", name) for name in named}


@pytest.mark.parametrize("week", OF_SHEETS, ids=name_of)
def test_the_empty_sheet_is_that_of_the_task(week):
    task = read_task(week / "task.toml")
    assert (week / "sheet.toml").read_text() == template(
        Arm.load(task.robot).description, task=task
    )
    assert read_sheet(week / "sheet.toml").robot == task.robot


def solve(lab, assignment, week):
    """Reach all goals as a person does who knows the solution."""
    arm = lab.desk.arm
    lab.answer("task.name", {"name": "Ada Lovelace"})
    for i, step in enumerate(assignment.steps):
        for k, goal in enumerate(step.goals):
            reach(lab, arm, goal, (i, k), week)
            wait_for(lambda i=i, k=k: states(lab)["task"]["steps"][i]["goals"][k]["met"])


def reach(lab, arm, goal, place, week):
    match goal.condition:
        case JointsAt(q=q):
            lab.answer("joints.set", {"q": q.tolist()})
        case NumberIs(value=number):
            fields = {"step": place[0], "goal": place[1], "text": str(number)}
            assert lab.answer("task.number", fields) == {"right": True}
        case ToolAt(T=T):
            found = arm.ik(T)
            lab.answer("joints.set", {"q": found.q[np.flatnonzero(found.valid)[0]].tolist()})
        case AnswerRight(name=name):
            text = entry(read_sheet(week / "solution.toml").answers, name)
            lab.answer("answers.grade", {"kind": "lines", "text": f"{name} = {text}"})
        case MotionBetween(begin=begin, end=end):
            lab.answer("joints.set", {"q": begin.tolist()})
            lab.answer("motion.plan", {"kind": "least-time", "goal": {"q": end.tolist()}})
        case ControlWithin(controller=controller):
            lab.answer("control.change", {"bandwidth": BANDWIDTH})
            lab.answer("control.start", {"controller": controller, "reference": "sine"})


def entry(answers, name):
    """Return an entry of a sheet, such as M12, as text."""
    quantity, indices = re.fullmatch(r"([a-zA-Z]+)(\d+)", name).groups()
    value = answers[quantity]
    for index in indices:
        value = value[int(index) - 1]
    return value


@pytest.mark.slow
@pytest.mark.parametrize("week", WEEKS, ids=name_of)
def test_the_lab_assignment_can_be_solved_and_is_marked(week, tmp_path):
    assignment = Assignment.read(week / "lab.toml")
    with dhkit.lab.serve(
        assignment.arm,
        block=False,
        open_browser=False,
        assignment=week / "lab.toml",
        record=tmp_path,
    ) as lab:
        solve(lab, assignment, week)
        time.sleep(0.1)
    mark = lab_mark(tmp_path / "lab.lab.json", assignment)
    assert (mark.student, mark.points, mark.notes) == ("Ada Lovelace", assignment.points, ())


@pytest.mark.slow
@pytest.mark.parametrize("week", WEEKS, ids=name_of)
def test_the_lecture_runs(week):
    notebook = nbformat.read(week / "lecture.ipynb", as_version=4)
    nbformat.validate(notebook)
    NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(week)}}).execute()
