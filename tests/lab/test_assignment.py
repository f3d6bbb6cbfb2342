"""Assignments: files that are right or refused in one line, and goals that are met by what a person does."""

import json
import re
import tomllib
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from bad_assignments import BAD, GOOD, HEAD, JOINTS, POSE, ROBOT, SCORE, STEP
from dhkit import Arm
from dhkit.cli import main
from dhkit.description import pose_parts, write_robot
from dhkit.errors import DescriptionError
from dhkit.execution.isolation import Isolation, Kind
from dhkit.lab import Assignment, Lab, serve
from dhkit.lab.assignment import JointsAt, MotionBetween, OwnScore, ToolAt, is_assignment
from dhkit.lab.assignment_form import PANELS, AssignmentForm, assignment_schema
from dhkit.viewer.page import page_files
from lab.test_requests import states
from waiting import wait_for

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((ROOT / "docs" / "examples").glob("assignment_*.toml"))
# One validator: `jsonschema.validate` checks the schema itself anew at each call.
SCHEMA = jsonschema.Draft202012Validator(assignment_schema())
OFFSET = 6e-4
"""rad by which joint values are missed on purpose: below every tolerance."""
OWN = """from dhkit import Arm
arm = Arm.load("puma560_cao")
def fk(q):
    return arm.fk(q)
def ik(T):
    found = arm.ik(T)
    return found.q[found.valid]
"""
UNPROTECTED = Isolation(Kind.NONE, "to import dhkit")


def goals(assignment):
    return [goal for step in assignment.steps for goal in step.goals]


def met(lab):
    return [goal["met"] for step in states(lab)["task"]["steps"] for goal in step["goals"]]


# Examples


def test_the_examples_ship():
    assert [file.stem for file in EXAMPLES] == ["assignment_planar2r", "assignment_puma"]
    assert len(Assignment.read(EXAMPLES[1]).steps) == 4


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
@pytest.mark.slow
def test_an_example_can_be_done(file, begin, tmp_path):
    assignment = Assignment.read(file)
    wants_program = any(isinstance(goal.condition, OwnScore) for goal in goals(assignment))
    program = tmp_path / "mine.py"
    program.write_text(OWN)
    lab = begin(assignment, own=program if wants_program else None, isolation=UNPROTECTED)
    assert states(lab)["task"]["note"] is None
    for goal in goals(assignment):
        attempt(lab, goal.condition)
    if wants_program:
        wait_for(lambda: states(lab)["own"].get("report"))
    wait_for(lambda: all(met(lab)))
    task = states(lab)["task"]
    assert task["points"] == task["most"] == assignment.points > 0


def attempt(lab, condition):
    """Do what a condition asks for, as a person does it in the panels."""
    if isinstance(condition, ToolAt):
        found = lab.desk.arm.ik(condition.T)
        assert np.any(found.valid & found.allowed)
        xyz, euler = pose_parts(condition.T)
        assert lab.answer("tool.pose", {"xyz": xyz.tolist(), "euler": euler.tolist()})["reached"]
    elif isinstance(condition, JointsAt):
        lab.answer("joints.set", {"q": (condition.q + OFFSET).tolist()})
    elif isinstance(condition, MotionBetween):
        lab.answer("joints.set", {"q": condition.begin.tolist()})
        lab.answer("motion.plan", {"kind": "trapezoidal", "goal": {"q": condition.end.tolist()}})
        assert states(lab)["motion"]["excess"] is None


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_the_schema_accepts_an_example(file):
    jsonschema.Draft202012Validator.check_schema(SCHEMA.schema)
    SCHEMA.validate(tomllib.loads(file.read_text("utf-8")))


def test_the_two_shoulders_of_the_puma_reach_one_pose():
    right, left = (goal.condition.q for goal in Assignment.read(EXAMPLES[1]).steps[2].goals[1:3])
    arm = Arm.load("puma560_cao")
    T = arm.fk(right)
    assert np.abs(T - arm.fk(left)).max() < 1e-4  # joint values rounded to 0.001 degrees
    xyz, euler = pose_parts(T, degrees=True)
    assert np.abs(xyz - [0.35, -0.3, 0.1]).max() < 1e-4
    assert np.abs(np.abs(euler) - [180, 0, 90]).max() < 0.01


def test_the_documents_format_is_one(read):
    text = (ROOT / "docs" / "lab.md").read_text("utf-8")
    shown = next(
        block for block in re.findall(r"```toml\n(.*?)```", text, re.DOTALL) if "kind" in block
    )
    assignment = read(shown)
    assert [type(goal.condition) for goal in goals(assignment)] == [
        ToolAt,
        JointsAt,
        MotionBetween,
        OwnScore,
    ]
    SCHEMA.validate(tomllib.loads(shown))


def test_names_of_panels_are_those_that_the_page_shows(read):
    """``answers`` is Answers; it was ``submit`` once, which is still read."""
    source = (ROOT / "src/dhkit/viewer/static/lab/panels.js").read_text("utf-8")
    shown = dict(re.findall(r'^ +\["(\w+)", "([^"]+)", \w+\]', source, re.MULTILINE))
    shown |= dict(re.findall(r'\[\["(\w+)", "([^"]+)", \w+\]\]', source))
    assert shown.pop("task") == "Task"  # shown with every assignment
    assert set(shown) == set(PANELS)
    others = {name: title for name, title in shown.items() if title.lower() != name}
    assert others == {"table": "DH table", "own": "My code"}
    page = (ROOT / "docs" / "lab.md").read_text("utf-8")
    assert '"table" is DH table, "own" My code' in page
    assert "submit" not in PANELS
    earlier = GOOD.replace('"joints", "motion"', '"submit", "joints"')
    assert read(earlier).panels == ("answers", "joints")


def test_panels_are_those_of_the_page():
    assert {"joints", "tool", "table", "motion", "control", "own"} <= set(PANELS)
    assert "task" not in PANELS and "lab/task.js" in page_files()


# Files


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_in_one_line(name, read, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text, complaint = BAD[name]
    assert text != GOOD
    with pytest.raises(DescriptionError) as caught:
        read(text)
    line = str(caught.value)
    assert complaint in line and line.startswith(str(tmp_path / "task.toml"))
    assert "\n" not in line and len(line) < 400 + len(str(tmp_path)) and line.isprintable()
    assert not (tmp_path / "hacked").exists()


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    for path, complaint in (
        (tmp_path / "none.toml", "no such file"),
        (tmp_path, "not a regular file"),
    ):
        with pytest.raises(DescriptionError, match=complaint):
            Assignment.read(path)


def test_a_robot_file_beside_it_is_read_and_a_link_that_leads_away_is_not(read, tmp_path):
    folder = tmp_path / "arms"
    folder.mkdir()
    write_robot(Arm.load("planar2r").description, folder / "arm.toml")
    assert read(GOOD.replace(ROBOT, 'robot = "arms/arm.toml"')).arm.n == 2
    elsewhere = tmp_path.parent / f"{tmp_path.name}-elsewhere.toml"
    elsewhere.write_text((folder / "arm.toml").read_text())
    (tmp_path / "link.toml").symlink_to(elsewhere)
    (tmp_path / "loop.toml").symlink_to(tmp_path / "loop.toml")
    for name in ("link.toml", "loop.toml"):
        with pytest.raises(DescriptionError):
            read(GOOD.replace(ROBOT, f'robot = "{name}"'))
    elsewhere.unlink()


def test_a_pose_that_a_six_axis_arm_cannot_take_is_refused(read):
    # In reach, but only with joint values beyond the limits; and beyond the wrist's sphere.
    head = HEAD.replace("planar2r", "puma560_cao") + STEP
    for xyz, complaint in (
        ("[-0.6, 0, 0.4]", "outside the joint limits"),
        ("[0.05, 0, 0]", "out of reach"),
    ):
        goal = POSE.replace("[0.5, 0.4, 0.0]", f'{xyz}, euler = ["pi", 0.3, 0]')
        with pytest.raises(DescriptionError, match=f"step 1: goal 1: pose: .*{complaint}"):
            read(head + goal)


def test_what_is_an_assignment(tmp_path):
    files = {
        "task": GOOD,
        "broken": 'kind = "assignment"\n[[step]]\n',
        "answer": 'kind = "sheet"\n',
        "bad": "kind = \n",
    }
    for name, text in files.items():
        (tmp_path / f"{name}.toml").write_text(text)
    found = {name for name in files if is_assignment(tmp_path / f"{name}.toml")}
    assert found == {"task", "broken"}
    assert (
        not is_assignment("puma560")
        and not is_assignment(tmp_path / "none.toml")
        and not is_assignment(tmp_path)
    )


# Goals


def test_goals_are_met_by_what_is_done_in_the_panels_and_stay_met(begin, read):
    lab = begin(read(GOOD))
    assert np.array_equal(lab.desk.q, lab.desk.arm.configurations["ready"])
    task = states(lab)["task"]
    assert (task["title"], task["panels"], task["points"], task["most"]) == (
        "T",
        ["joints", "motion"],
        0,
        5,
    )
    assert "--mine FILE" in task["note"]
    lab.answer("joints.set", {"q": [np.pi / 2 + 0.009, -0.009]})
    assert met(lab) == [True, False, False, False] and states(lab)["task"]["points"] == 1
    lab.answer("joints.set", {"q": [0.3, 0.3]})
    lab.answer("tool.pose", {"xyz": [0.5, 0.4, 0.0], "euler": [0.0, 0.0, 1.0]})
    assert met(lab) == [True, True, False, False] and states(lab)["task"]["points"] == 3
    lab.answer("joints.named", {"name": "ready"})
    plan = {"kind": "trapezoidal", "goal": {"q": [0.0, 0.0]}}
    lab.answer("motion.plan", plan | {"duration": 1.5})
    assert not met(lab)[2]
    lab.answer("motion.plan", plan | {"duration": 0.1})
    assert states(lab)["motion"]["excess"] and not met(lab)[2]
    lab.answer("motion.plan", plan | {"duration": 0.9})
    assert met(lab) == [True, True, True, False]
    lab.answer("task.reset", {})
    assert met(lab) == [False] * 4 and states(lab)["task"]["points"] == 0
    lab.answer("joints.set", {"q": [np.pi / 2, 0.0]})
    assert met(lab) == [True, False, False, False]
    for data in ({"all": True}, {"q": []}):
        with pytest.raises(ValueError, match=r"task\.reset: found field"):
            lab.answer("task.reset", data)


@pytest.mark.parametrize(
    ("q", "there"),
    [
        ([0, np.pi / 2], True),
        ([0.01, np.pi / 2], False),
        ([0, np.pi / 2 + 0.01], False),
        ([0, -np.pi / 2], False),
    ],
)
def test_a_position_has_its_tolerance(begin, read, q, there):
    lab = begin(read(HEAD + STEP + POSE.replace("points = 2", "tolerance = { position = 0.001 }")))
    lab.answer("joints.set", {"q": q})
    assert met(lab) == [there]


@pytest.mark.parametrize(
    ("angle", "there"), [(0.0, True), (0.019, True), (0.021, False), (3.0, False)]
)
def test_a_rotation_has_its_tolerance(angle, there):
    T, turned = np.eye(4), np.eye(4)
    turned[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    assert ToolAt(T, True, 0.005, 0.02).is_reached(turned) is there
    assert ToolAt(T, False, 0.005, 0.02).is_reached(turned)


def test_a_goal_that_the_arm_begins_in_has_to_be_left_first(begin, read):
    lab = begin(read(HEAD + STEP + JOINTS.replace('["pi/2", 0]', '"ready"')))
    lab.answer("joints.named", {"name": "ready"})
    assert met(lab) == [False]
    lab.answer("joints.named", {"name": "zero"})
    lab.answer("joints.named", {"name": "ready"})
    assert met(lab) == [True]
    lab.answer("task.reset", {})
    assert met(lab) == [False]


def test_an_edited_table_does_not_count(begin, read):
    lab = begin(read(GOOD))
    lab.answer("table.edit", {"row": 0, "column": "a", "text": "0.6"})
    assert "table was edited" in states(lab)["task"]["note"]
    lab.answer("joints.set", {"q": [np.pi / 2, 0.0]})
    assert met(lab) == [False] * 4
    lab.answer("table.reset", {})
    assert "--mine" in states(lab)["task"]["note"]
    lab.answer("joints.set", {"q": [0.0, 0.0]})
    lab.answer("joints.set", {"q": [np.pi / 2, 0.0]})
    assert met(lab)[0]


def test_assumed_masses_change_nothing(begin, read, tmp_path):
    write_robot(Arm.from_dh([(0, 0, 0.5, 0), (0, 0, 0.4, 0)]).description, tmp_path / "bare.toml")
    lab = begin(
        read(HEAD.replace("planar2r", "bare.toml").replace("ready", "zero") + STEP + JOINTS)
    )
    lab.answer("bodies.assume", {})
    assert states(lab)["arm"]["assumed_bodies"] and states(lab)["task"]["note"] is None
    lab.answer("joints.set", {"q": [np.pi / 2, 0.0]})
    assert met(lab) == [True]


def test_a_controller_that_moves_the_arm_there_counts(begin, read):
    lab = begin(read(HEAD + STEP + JOINTS))
    lab.answer("control.start", {"controller": "computed-torque", "reference": "hold"})
    lab.answer("joints.set", {"q": [np.pi / 2, 0.0]})
    wait_for(lambda: met(lab) == [True])
    lab.answer("control.stop", {})


@pytest.mark.slow
def test_the_share_of_a_score(begin, read, tmp_path):
    program = tmp_path / "mine.py"
    program.write_text(
        "def fk(q):\n    return [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n"
    )
    lab = begin(read(HEAD + STEP + SCORE), own=program, isolation=UNPROTECTED)
    wait_for(lambda: states(lab)["own"].get("report"))
    assert met(lab) == [False] and states(lab)["task"]["note"] is None
    program.write_text(OWN.replace("puma560_cao", "planar2r"))
    wait_for(lambda: met(lab) == [True])
    report = states(lab)["own"]["report"]
    assert OwnScore("fk", 1.0).is_reached(report)
    assert not OwnScore("controller", 0.1).is_reached(report) and not OwnScore(
        "fk", 0.1
    ).is_reached({"error": "it died"})


def test_a_lab_without_one_and_a_lab_of_another_robot(open_lab, read, tmp_path):
    lab = open_lab("planar2r")
    assert states(lab)["task"] is None
    with pytest.raises(ValueError, match="there is no assignment"):
        lab.answer("task.reset", {})
    with pytest.raises(DescriptionError, match="found puma560; expected planar2r"):
        Lab(Arm.load("puma560"), assignment=read(GOOD))
    with serve(
        Arm.load("planar2r"), assignment=tmp_path / "task.toml", block=False, open_browser=False
    ) as lab:
        assert states(lab)["task"]["title"] == "T"


def test_the_largest_assignment_is_published(begin, read):
    goal = JOINTS.replace('"a"', f'"{75 * "é"}"').replace('["pi/2", 0]', '"ready"')
    text = HEAD + 20 * (STEP.replace("some words", 800 * "x") + 20 * goal)
    assert 90_000 < len(text.encode()) <= 100_000
    lab = begin(read(text))
    for k in range(50):
        lab.answer("joints.set", {"q": [0.01 * k, 0.0]})
    assert len(met(lab)) == 400
    json.dumps(states(lab)["task"], allow_nan=False)


# Commands


def run(arguments, monkeypatch, capsys):
    def press_ctrl_c(seconds):
        raise KeyboardInterrupt

    monkeypatch.setattr("webbrowser.open", lambda url: True)
    monkeypatch.setattr("dhkit.cli.browser.time.sleep", press_ctrl_c)
    with pytest.raises(SystemExit) as left:
        main(arguments)
    return left.value.code, *capsys.readouterr()


def test_the_command_opens_it_and_prints_the_schema(tmp_path, monkeypatch, capsys):
    code, out, _ = run(["lab", str(EXAMPLES[0])], monkeypatch, capsys)
    assert code == 0 and out.startswith("Two links in a plane: the lab at http://127.0.0.1:")
    bad = tmp_path / "bad.toml"
    bad.write_text(GOOD.replace("points", "point"))
    code, _, error = run(["lab", str(bad)], monkeypatch, capsys)
    assert (
        code == 2
        and error == f"dhkit: {bad}: step 1: goal 2: unknown key 'point'; did you mean 'points'?\n"
    )
    code, out, _ = run(["schema", "assignment"], monkeypatch, capsys)
    schema = json.loads(out)
    printed = jsonschema.Draft202012Validator(schema)
    assert code == 0 and schema["title"] == "dhkit assignment, format 1"
    assert set(schema["properties"]) == set(AssignmentForm.__dataclass_fields__)
    for name in ("mistyped key", "two conditions", "unknown panel", "21 steps", "order of angles"):
        with pytest.raises(jsonschema.ValidationError):
            printed.validate(tomllib.loads(BAD[name][0]))
