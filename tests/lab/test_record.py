"""Work on an assignment is recorded, taken up again, handed in, and collected into marks."""

import base64
import csv
import json
import shutil

import numpy as np
import pytest

import dhkit
from dhkit.cli import main
from dhkit.errors import AnswerError, DescriptionError
from dhkit.lab import Assignment
from dhkit.lab.assignment import Place
from dhkit.lab.marks import find_records, lab_mark
from dhkit.lab.record import Record, _seal
from lab.test_requests import states
from waiting import wait_for

ASSIGNMENT = """
kind = "assignment"
format = 1
title = "Two links"
robot = "planar2r"
start = [0.3, 0.3]
[[step]]
title = "States"
[[step.goal]]
text = "Straight up"
joints = ["pi/2", 0]
points = 2
[[step.goal]]
text = "x 0.4, y 0.4"
pose = { xyz = [0.4, 0.4, 0] }
[[step.goal]]
text = "A motion"
motion = { from = [0, 0], to = [1, 1], duration = 30 }
[[step]]
title = "Numbers and equations"
[[step.goal]]
text = "Largest reach, m"
number = { value = 2.0, tolerance = 0.001 }
[[step.goal]]
text = "Gravity torque of joint 2"
answer = { name = "g2" }
[[step]]
title = "Control"
[[step.goal]]
text = "Follow the sine"
control = { error = 0.05, seconds = 0.3, controller = "computed-torque" }
"""


@pytest.fixture
def dhkit_command(capsys):
    """Return what runs the command: exit status, stdout, stderr."""

    def run(*arguments):
        with pytest.raises(SystemExit) as end:
            main([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        return end.value.code, out, err

    return run


@pytest.fixture
def task(tmp_path):
    file = tmp_path / "two.toml"
    file.write_text(ASSIGNMENT)
    return file


def begin(task, folder):
    arm = Assignment.read(task).arm
    return dhkit.lab.serve(arm, block=False, open_browser=False, assignment=task, record=folder)


def met(lab):
    return [goal["met"] for step in states(lab)["task"]["steps"] for goal in step["goals"]]


def work(lab):
    """Reach all goals as a person does."""
    arm = lab.desk.arm
    lab.answer("task.name", {"name": "  Ada   Lovelace "})
    lab.answer("joints.set", {"q": [np.pi / 2, 0.0]})
    q = arm.ik(dhkit.pose([0.4, 0.4, 0.0])).q[0]
    lab.answer("joints.set", {"q": q.tolist()})
    lab.answer("joints.set", {"q": [0.0, 0.0]})
    lab.answer("motion.plan", {"kind": "quintic", "goal": {"q": [1.0, 1.0]}, "duration": 20})
    assert lab.answer("task.number", {"step": 1, "goal": 0, "text": "1.9"}) == {"right": False}
    assert lab.answer("task.number", {"step": 1, "goal": 0, "text": "4/2"}) == {"right": True}


def test_work_is_recorded_taken_up_again_and_collected(task, tmp_path):
    folder = tmp_path / "work"
    file = folder / "two.lab.json"
    with begin(task, folder) as lab:
        work(lab)
        assert met(lab) == [True, True, True, True, False, False]
        assert states(lab)["task"]["file"] == str(file)
    record = Record.read(file)
    assert record.student == "Ada Lovelace"
    assert set(record.reached) == {Place(0, 0), Place(0, 1), Place(0, 2), Place(1, 0)}

    # The lab is closed and opened again: points stay; the controller and the equation are added.
    with begin(task, folder) as lab:
        assert met(lab) == [True, True, True, True, False, False]
        assert states(lab)["task"]["student"] == "Ada Lovelace"
        lab.answer("answers.grade", {"kind": "lines", "text": "g2 = m2*g*l2*cos(q1 + q2)/2"})
        wait_for(lambda: met(lab)[4])
        lab.answer("control.start", {"controller": "computed-torque", "reference": "sine"})
        wait_for(lambda: all(met(lab)))
    mark = lab_mark(file, Assignment.read(task))
    assert (mark.student, mark.points, mark.most, mark.unchecked, mark.notes) == (
        "Ada Lovelace",
        7.0,
        7.0,
        2,
        (),
    )


def recorded(task, folder):
    with begin(task, folder) as lab:
        work(lab)
    return folder / "two.lab.json"


def edited(file, change, *, sealed):
    """Change a record; with the seal made anew where ``sealed``, as somebody does who reads the source."""
    content = json.loads(file.read_text())
    del content["seal"]
    change(content)
    seal = _seal(content) if sealed else json.loads(file.read_text())["seal"]
    file.write_text(json.dumps(content | {"seal": seal}))


def test_an_edited_record_is_refused(task, tmp_path):
    file = recorded(task, tmp_path / "work")
    edited(file, lambda content: content.update(student="Charles"), sealed=False)
    with pytest.raises(AnswerError, match="the seal does not fit"):
        Record.read(file)
    mark = lab_mark(file, Assignment.read(task))
    assert mark.points == 0 and "the seal does not fit" in mark.notes[0]
    with pytest.raises(AnswerError, match="the seal does not fit"):
        begin(task, tmp_path / "work")


SURROGATE = (
    '{"seal": "\\ud800", "kind": "lab record", "format": 1, "assignment": "", "student": "", '
    '"begun": "", "goals": []}'
)
INFINITE = (
    '{"seal": "", "kind": "lab record", "format": 1, '
    '"goals": [{"step": 1e999, "goal": 1, "time": "", "evidence": {}}]}'
)
FORGED = {
    "a goal with the evidence of another": lambda goals: goals[0]["evidence"].update(q=[0.0, 0.0]),
    "joint values of another arm": lambda goals: goals[0]["evidence"].update(q=[0.0] * 6),
    "no evidence": lambda goals: goals[0]["evidence"].clear(),
    "a huge integer": lambda goals: goals[0]["evidence"].update(q=[10**400, 0]),
    "words": lambda goals: goals[0]["evidence"].update(q="here"),
    "not finite": lambda goals: goals[0]["evidence"].update(q=[1e400, 0.0]),
}


@pytest.mark.parametrize("name", FORGED)
def test_goals_are_checked_again_from_their_evidence(task, tmp_path, name):
    file = recorded(task, tmp_path / "work")
    edited(file, lambda content: FORGED[name](content["goals"]), sealed=True)
    mark = lab_mark(file, Assignment.read(task))
    assert mark.points == 3.0
    assert mark.notes == ("step 1, goal 1: the evidence does not show it",)


def test_a_forged_motion_and_number_are_found(task, tmp_path):
    file = recorded(task, tmp_path / "work")

    def change(content):
        motion, number = (goal["evidence"] for goal in content["goals"][2:4])
        motion["breaks"] = [0.0, 1e-3]
        motion["coefficients"] = motion["coefficients"][:1]
        number["number"] = 1.5

    edited(file, change, sealed=True)
    mark = lab_mark(file, Assignment.read(task))
    assert mark.goals == (2.0, 1.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    "content",
    [
        "",
        "[]",
        "{}",
        '{"kind": 1}',
        "null",
        "\xff",
        '{"seal": 1}' + " " * 2_000_001,
        "[" * 100_000,
        SURROGATE,
        INFINITE,
    ],
)
def test_what_is_no_record_is_said_in_a_line(tmp_path, content):
    file = tmp_path / "x.lab.json"
    file.write_text(content, "latin-1")
    with pytest.raises(AnswerError) as error:
        Record.read(file)
    assert "\n" not in str(error.value) and str(file) in str(error.value)


def test_a_record_of_another_assignment_is_not_taken_up(task, tmp_path):
    file = recorded(task, tmp_path / "work")
    task.write_text(ASSIGNMENT.replace("Straight up", "Upright"))
    with pytest.raises(DescriptionError, match="a record of another assignment"):
        begin(task, tmp_path / "work")
    assert "another assignment" in lab_mark(file, Assignment.read(task)).notes[0]


def test_marks_of_a_class(task, tmp_path, dhkit_command):
    for name in ("ada", "ben"):
        recorded(task, tmp_path / "class" / name)
    (tmp_path / "class" / "cy").mkdir()
    (tmp_path / "class" / "cy" / "two.lab.json").write_text("=1+1")
    status, out, _ = dhkit_command("grade", tmp_path / "class", "--task", task)
    assert status == 2
    assert out.count("Ada Lovelace") == 2 and "no record of a lab" in out
    status, _, _ = dhkit_command(
        "grade", tmp_path / "class", "--task", task, "-o", tmp_path / "marks.csv"
    )
    rows = list(csv.DictReader((tmp_path / "marks.csv").read_text().splitlines()))
    assert [row["points"] for row in rows] == ["5", "5", "0"]
    assert rows[0]["1.1"] == "2"
    status, out, _ = dhkit_command("grade", tmp_path / "class" / "ada", "--task", task, "--json")
    assert status == 1
    assert json.loads(out)[0]["points"] == 5.0
    shutil.make_archive(tmp_path / "class", "zip", tmp_path / "class")
    _, out, _ = dhkit_command("grade", tmp_path / "class.zip", "--task", task, "--json")
    packed = [(row["points"], row["file"]) for row in json.loads(out)]
    expected = [(5.0, "ada"), (5.0, "ben"), (0.0, "cy")]
    assert packed == [
        (points, str(tmp_path / "class.zip" / name / "two.lab.json")) for points, name in expected
    ]
    with pytest.raises(AnswerError, match="no record of a lab"):
        (tmp_path / "empty").mkdir()
        find_records([tmp_path / "empty"])


def test_record_without_an_assignment_is_refused(dhkit_command, tmp_path):
    status, _, err = dhkit_command("lab", "planar2r", "--record", tmp_path, "--no-browser")
    assert status == 2 and "is not an assignment" in err
    with pytest.raises(ValueError, match="without the file of an assignment"):
        dhkit.lab.serve(
            dhkit.Arm.load("planar2r"), block=False, open_browser=False, record=tmp_path
        )


def test_places_out_of_range_count_nowhere(task, tmp_path):
    file = recorded(task, tmp_path / "work")

    def change(content):
        for step, goal in ((9, 9), (1, 99)):
            content["goals"].append(
                {"step": step, "goal": goal, "time": "2099-01-01T00:00:00+00:00", "evidence": {}}
            )

    edited(file, change, sealed=True)
    with begin(task, tmp_path / "work") as lab:
        assert states(lab)["task"]["points"] == 5.0
    mark = lab_mark(file, Assignment.read(task))
    assert mark.points == 5.0 and not mark.last.startswith("2099")


def test_two_labs_on_one_record_lose_nothing_and_what_is_recorded_is_not_reset(task, tmp_path):
    with begin(task, tmp_path / "work") as first, begin(task, tmp_path / "work") as second:
        first.answer("task.number", {"step": 1, "goal": 0, "text": "2"})
        second.answer("joints.set", {"q": [np.pi / 2, 0.0]})
        mark = lab_mark(tmp_path / "work" / "two.lab.json", Assignment.read(task))
        assert mark.goals == (2.0, 0.0, 0.0, 1.0, 0.0, 0.0)
        with pytest.raises(ValueError, match="the work is recorded"):
            second.answer("task.reset", {})


def test_a_motion_that_jumps_between_samples_is_not_one(task, tmp_path):
    arm = Assignment.read(task).arm
    d = 0.1
    breaks = np.array([0.0, d * 200.1 / 400, d * 200.9 / 400, d])
    coefficients = np.zeros((3, 6, 2))
    h = breaks[2] - breaks[1]
    coefficients[1, 3:] = (np.array([10, -15, 6]) / h ** np.array([3, 4, 5]))[:, None]
    coefficients[2, 0] = 1.0
    dhkit.Trajectory(arm.description, breaks, coefficients).save(tmp_path / "jump.npz")
    content = base64.b64encode((tmp_path / "jump.npz").read_bytes()).decode()
    with begin(task, tmp_path / "work") as lab:
        lab.answer("motion.file", {"name": "jump.npz", "content": content})
        assert states(lab)["motion"]["excess"] is not None
        assert met(lab)[2] is False


def test_a_copied_record_is_noted(task, tmp_path, dhkit_command):
    file = recorded(task, tmp_path / "class" / "ada")
    (tmp_path / "class" / "bob").mkdir()
    (tmp_path / "class" / "bob" / "two.lab.json").write_bytes(file.read_bytes())
    with begin(task, tmp_path / "class" / "bob") as lab:
        lab.answer("task.name", {"name": "Bob"})
    _, out, _ = dhkit_command("grade", tmp_path / "class", "--task", task, "--json")
    ada, bob = json.loads(out)
    assert (ada["student"], bob["student"]) == ("Ada Lovelace", "Bob")
    assert not ada["notes"] and "begun and ended at the same seconds" in bob["notes"][0]


@pytest.mark.slow
def test_a_run_of_locked_joints_or_that_stands_still_is_none(task, tmp_path):
    six = ASSIGNMENT.replace("planar2r", "puma560").split("[[step]]")
    task.write_text(
        six[0].replace("[0.3, 0.3]", '"ready"')
        + "[[step]]"
        + six[3].replace("0.3,", '0.3, reference = "motion",')
    )
    with begin(task, tmp_path / "work") as lab:
        q = lab.desk.q
        lab.answer(
            "motion.plan", {"kind": "quintic", "goal": {"q": (q + 1e-4).tolist()}, "duration": 2}
        )
        lab.answer("control.start", {"controller": "computed-torque", "reference": "motion"})
        wait_for(lambda: states(lab)["control"]["time"] > 1.0)
        assert met(lab) == [False]
        lab.answer(
            "motion.plan", {"kind": "quintic", "goal": {"q": (q + 0.5).tolist()}, "duration": 3}
        )
        lab.answer("control.start", {"controller": "computed-torque", "reference": "motion"})
        wait_for(lambda: met(lab) == [True])


def test_a_goal_names_a_controller_that_the_lab_has(task):
    task.write_text(ASSIGNMENT.replace('"computed-torque"', '"bang-bang"'))
    with pytest.raises(
        DescriptionError,
        match=r"control.controller: found 'bang-bang'; expected one of pd, .*, own",
    ):
        Assignment.read(task)
