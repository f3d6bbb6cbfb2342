"""`dhkit plan`: the same motions as in Python, however a goal is given; no motion is 1, bad input 2, in one line."""

import json
import re

import numpy as np
import pytest
from PIL import Image

from acceptance import slow_if
from dhkit import Arm, Obstacle, Trajectory
from dhkit.cli import main
from dhkit.cli.arguments import objective
from dhkit.viewer import View
from dhkit.viewer.session import Slot
from viewer.messages import decode_animation, decode_obstacles

KEPT = 1e-6
"""Share of a limit that a certified motion may exceed it by."""
ENDS = 1e-9
"""rad and m: rounding of the ends, poses solved for by closed forms included."""
FLOAT32 = 1e-6
CLEAR = 1e-5
"""m: what may be missing between the certificate's states."""
COARSE = ("--intervals", "16")


@pytest.fixture
def plan(capsys):
    """Run `dhkit plan`; return its status, stdout and stderr."""

    def run(*arguments):
        with pytest.raises(SystemExit) as exit:
            main(("plan", *arguments))
        out, err = capsys.readouterr()
        return exit.value.code, out, err

    return run


@pytest.fixture
def facts(plan):
    """Run `dhkit plan --json` on a coarse mesh; return its status and what it says."""

    def run(*arguments):
        status, out, _ = plan(*arguments, *COARSE, "--json")
        return status, json.loads(out)

    return run


def watched(monkeypatch, slot):
    """Return a list that takes what every page is written with."""
    messages, save = [], View.save_html
    monkeypatch.setattr(
        View,
        "save_html",
        lambda view, path, **about: messages.append(view._state[slot]) or save(view, path, **about),
    )
    return messages


def words(values):
    return [repr(float(x)) for x in np.ravel(values)]


def test_the_puma_goes_from_ready_to_a_pose(facts):
    arm = Arm.load("puma560")
    status, said = facts(
        "puma560",
        "--xyz",
        "0.5",
        "0.2",
        "0.3",
        "--euler",
        "0",
        "90",
        "0",
        "--velocity",
        "100",
        "--degrees",
    )
    assert status == 0
    assert said["found"]
    assert said["certified"]
    assert said["violation"] <= KEPT
    assert np.radians(said["start_deg"]) == pytest.approx(
        arm.configurations["ready"].tolist(), abs=ENDS
    )
    assert np.abs(arm.fk(np.radians(said["goal_deg"]))[:3, 3] - [0.5, 0.2, 0.3]).max() < ENDS
    assert 0 < said["duration_s"] < said["classical_s"]["quintic"]
    assert (
        said["duration_s"] >= np.abs(np.subtract(said["goal_deg"], said["start_deg"])).max() / 100
    )
    assert said["files"] == []


def test_the_motion_is_the_one_of_python(facts):
    arm = Arm.load("planar2r")
    goal = [1.0, -0.5]
    _, said = facts("planar2r", "--from", "0", "0.5", "--to", *words(goal))
    assert said["duration_s"] == pytest.approx(
        arm.plan([0, 0.5], goal, intervals=16).duration, rel=1e-9
    )


@pytest.mark.parametrize("where", ["to", "like", slow_if(True, "matrix"), slow_if(True, "file")])
def test_a_goal_may_be_given_in_several_ways(where, facts, tmp_path):
    arm = Arm.load("planar2r")
    q = np.array([0.9, 0.6])
    T = arm.fk(q)
    (tmp_path / "pose.txt").write_text(" ".join(words(T)))
    given = {
        "to": ["--to", *words(q)],
        "like": ["--like", *words(q)],
        "matrix": ["--matrix", *words(T)],
        "file": ["--matrix", str(tmp_path / "pose.txt")],
    }
    status, said = facts("planar2r", *given[where])
    assert status == 0
    assert np.abs(arm.fk(said["goal_rad"]) - T).max() < ENDS
    # A pose leaves the choice between two branches.
    assert len(said["branches"]) == (0 if where == "to" else 2)


@pytest.mark.slow
def test_files_are_written_and_read_back(plan, tmp_path):
    arm = Arm.load("planar2r")
    files = [tmp_path / name for name in ("run.npz", "run.html", "run.png")]
    trajectory, page, figure = map(str, files)
    status, out, _ = plan(
        "planar2r",
        "--to",
        "1",
        "0.5",
        "-o",
        trajectory,
        "--html",
        page,
        "--figure",
        figure,
        *COARSE,
        "--json",
    )
    said = json.loads(out)
    assert (status, said["files"]) == (0, [trajectory, page, figure])
    motion = Trajectory.load(trajectory, arm.description)
    assert motion.duration == said["duration_s"]
    assert np.abs(motion.q(motion.duration) - [1.0, 0.5]).max() < ENDS
    assert np.abs(
        motion.tau(np.linspace(0, motion.duration, 999))
    ).max() <= arm.description.numbers.effort.max() * (1 + KEPT)
    with Image.open(figure) as picture:
        assert len(np.unique(np.asarray(picture.convert("L")))) > 50
    assert "planar2r" in files[1].read_text("utf-8")


@pytest.mark.parametrize("suffix", [".csv", slow_if(True, ".mat"), slow_if(True, ".yaml")])
def test_every_format_of_trajectories_is_written(suffix, plan, tmp_path):
    path = tmp_path / f"run{suffix}"
    status, out, _ = plan("planar2r", "--to", "1", "0.5", *COARSE, "-o", str(path))
    assert status == 0
    assert f"wrote {path}" in out
    arm = Arm.load("planar2r")
    motion = Trajectory.load(path, arm.description)
    assert np.abs(motion.q(motion.duration) - [1.0, 0.5]).max() < ENDS


@pytest.mark.slow
def test_what_people_read(plan):
    status, out, err = plan("puma560", "--to", "nominal", "--degrees", "--speed", "0.8", *COARSE)
    assert (status, err) == (0, "")
    assert "puma560: least time" in out
    assert "all limits kept" in out
    assert "by Pinocchio" in out
    for name in ("waist", "flange_roll", "best trapezoid", "quintic"):
        assert name in out
    assert "-180.0000  °" in out
    assert "-0.0000" not in out


@pytest.mark.slow
def test_a_payload_takes_time(facts):
    where = ("planar2r", "--from", "0.2", "0.4", "--to", "-1", "1", "--torque", "40", "12")
    _, empty = facts(*where)
    _, point = facts(*where, "--payload", "0.5")
    _, ahead = facts(*where, "--payload", "0.5 @ 0.2 0 0")
    assert empty["duration_s"] < point["duration_s"] < ahead["duration_s"]


@pytest.mark.slow
def test_an_objective_with_a_duration(facts):
    where = ("planar2r", "--to", "1", "0.5", "--duration", "1.5", "--objective")
    _, effort = facts(*where, "effort")
    _, jerk = facts(*where, "jerk")
    assert effort["duration_s"] == pytest.approx(1.5)
    assert jerk["duration_s"] == pytest.approx(1.5)
    assert effort["objective"] == "effort"


@pytest.mark.slow
def test_on_the_way_it_passes_where_it_is_told(plan, tmp_path):
    path = str(tmp_path / "run.npz")
    via = [[0.5, 1.2], [0.9, 0.1]]
    arguments = [word for place in via for word in ("--via", *words(place))]
    status, _, err = plan(
        "planar2r", "--to", "1.5", "0.5", *arguments, "--intervals", "24", "-o", path
    )
    assert (status, err) == (0, "")
    motion = Trajectory.load(path, Arm.load("planar2r").description)
    passed = motion.q(motion.breaks)
    assert all(np.abs(passed - place).max(axis=1).min() < ENDS for place in via)


@pytest.mark.slow
def test_limits_are_in_the_units_that_are_asked_for(facts):
    where = ("planar2r", "--to", "zero", "--from", "0.6", "0.6")
    _, radians = facts(*where, "--velocity", "0.5", "--acceleration", "2", "4")
    _, degrees = facts(
        *("planar2r", "--to", "0", "0", "--from", *words(np.degrees([0.6, 0.6])), "--degrees"),
        *("--velocity", *words(np.degrees(0.5)), "--acceleration", *words(np.degrees([2, 4]))),
    )
    assert radians["duration_s"] == pytest.approx(degrees["duration_s"], rel=1e-6)
    assert radians["duration_s"] > 0.6 / 0.5
    _, halved = facts(*where, "--velocity", "1", "--speed", "0.5", "--acceleration", "2", "4")
    assert halved["duration_s"] == pytest.approx(radians["duration_s"], rel=1e-9)


def test_the_tool_goes_straight(plan, tmp_path):
    arm = Arm.load("puma560")
    path = str(tmp_path / "run.npz")
    start = arm.configurations["nominal"]
    goal = arm.fk(start)
    goal[:3, 3] += [0.05, 0.2, -0.1]
    status, out, err = plan(
        *(
            "puma560",
            "--from",
            "nominal",
            "--matrix",
            *words(goal),
            "--line",
            "--tool-speed",
            "0.5",
            "-o",
            path,
        )
    )
    assert (status, err) == (0, "")
    assert "the tool along a straight line" in out
    motion = Trajectory.load(path, arm.description)
    t = np.linspace(0, motion.duration, 201)
    positions = arm.fk(motion.q(t))[:, :3, 3]
    along = (goal[:3, 3] - positions[0]) / np.linalg.norm(goal[:3, 3] - positions[0])
    way = positions - positions[0]
    assert np.abs(way - np.outer(way @ along, along)).max() < 1e-6
    assert np.abs(positions[-1] - goal[:3, 3]).max() < 1e-6
    speeds = np.linalg.norm(
        np.einsum("kij,kj->ki", arm.jacobian(motion.q(t))[:, :3], motion.qd(t)), axis=1
    )
    assert 0.49 < speeds.max() < 0.5 * (1 + 1e-4)


def test_a_load_is_carried_along_a_line(facts):
    where = (
        "planar2r",
        "--from",
        "0.2",
        "1.2",
        "--to",
        "0.8",
        "1.0",
        "--torque",
        "30",
        "10",
        "--line",
    )
    _, empty = facts(*where)
    status, loaded = facts(*where, "--payload", "0.5")
    assert status == 0
    assert empty["line"]
    assert empty["duration_s"] < loaded["duration_s"]


@pytest.mark.slow
def test_obstacles_are_kept_away_from_and_are_on_the_page(plan, tmp_path, monkeypatch):
    arm = Arm.load("planar3r")
    ball = Obstacle.sphere(0.1, (1.15, 0.0, 0.0))
    start, goal = np.array([0.9, 0.3, 0.3]), np.array([-0.9, -0.3, -0.3])
    direct = arm.plan(start, goal, intervals=16, compare=False)
    times = np.linspace(0, 1, 301)
    # It is in the way.
    assert arm.distance(direct.q(direct.duration * times), [ball]).distance.min() < 0
    drawn = watched(monkeypatch, Slot.OBSTACLES)
    files = str(tmp_path / "run.npz"), str(tmp_path / "run.html")
    ends = ("--from", *words(start), "--to", *words(goal))
    given = ("--sphere", "0.1", "@", "1.15", "0", "0", "--clearance", "0.03")
    status, _, err = plan("planar3r", *ends, *given, "-o", files[0], "--html", files[1], *COARSE)
    assert (status, err) == (0, "")
    motion = Trajectory.load(files[0], arm.description)
    assert arm.distance(motion.q(motion.duration * times), [ball]).distance.min() > 0.03 - CLEAR
    shown = decode_obstacles(drawn[0])
    assert shown.transforms[0, :, 3] == pytest.approx(ball.centre)
    assert shown.radii == pytest.approx([0.1])


@pytest.mark.parametrize(
    ("arguments", "status", "complaint"),
    [
        ("planar2r --xyz 9 0 0", 1, "is out of reach"),
        (
            "puma560 --to 9 0 0 0 0 0",
            1,
            "goal: joint waist is at 9 rad (1.43 turns; were degrees meant?), above its upper limit, 2.79",
        ),
        ("puma560 --to nominal --payload 90", 1, "cannot hold the arm there"),
        ("planar2r --to ready --from ready", 1, "start and goal are the same configuration"),
        ("planar2r --to 1 1 --sphere 0.1 @ 0.1 0.8 0", 1, "inside sphere"),
        (
            "planar2r --to 1 1 --duration 0.01 --objective effort",
            1,
            "a duration of 0.01 s is too short",
        ),
        ("puma560 --from ready --to nominal --line", 1, "the path meets a singularity at s = 0"),
        ("puma560 --to nowhere", 2, "puma560 has no configuration 'nowhere'; it has zero, ready"),
        ("puma560 --to 1 2", 2, "2 values of --to; expected 6 for puma560"),
        ("planar2r", 2, "no single goal; expected one of --to, --xyz, --matrix and --like"),
        ("planar2r --to 1 1 --xyz 1 1 0", 2, "no single goal; expected one of"),
        ("planar2r --to 1 1 --sphere 0.5", 2, "--sphere: found '0.5'; expected \"R @ X Y Z\", m"),
        ("planar2r --to 1 1 --sphere x @ 1 1 1", 2, "--sphere: "),
        (
            "planar2r --to 1 1 --sphere -1 @ 1 1 1",
            2,
            "sphere: radius is -1.0; expected a positive number",
        ),
        (
            "planar2r --to 1 1 --box 1 1 @ 1 1 1",
            2,
            "--box: found '1 1 @ 1 1 1'; expected \"SX SY SZ @ X Y Z\", m",
        ),
        ("planar2r --to 1 1 --floor low", 2, "--floor: "),
        ("planar2r --to 1 1 --payload -1", 2, "mass is -1 kg"),
        ("planar2r --to 1 1 --payload 1 @ 2", 2, "--payload: 1 values; expected 3"),
        (
            "planar2r --to 1 1 --objective speed",
            2,
            "--objective: found 'speed'; expected time, effort, energy, jerk",
        ),
        (
            "planar2r --to 1 1 --objective time + 0 effort",
            2,
            "--objective: found '0 effort'; expected a positive",
        ),
        ("planar2r --to 1 1 --velocity 1 2 3", 2, "--velocity: 3 values; expected 1 or 2"),
        (
            "planar2r --to 1 1 --velocity -1",
            2,
            "velocity of joint 1 is -1; expected a positive number",
        ),
        ("planar2r --to 1 1 --tool-speed -1", 2, "ToolSpeed: -1.0; expected positive"),
        ("planar2r --to 1 1 --line --via 0 1", 2, "--line: found --via too"),
        ("planar2r --to 1 1 --line --sphere 0.1 @ 0.1 0.8 0", 1, "the path at s = "),
        (
            "planar2r --to 1 1 -o run.txt",
            2,
            "run.txt: ends in '.txt'; expected .npz, .mat, .csv, .yaml",
        ),
        ("planar2r --to 1 1 --figure run.xyz", 2, "run.xyz: ends in '.xyz'; expected .png"),
        ("planar2r --to 1 1 --html /dev/null/run.html", 2, "/dev/null: a file; expected a folder"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(arguments, status, complaint, plan):
    found = plan(*arguments.split(), *COARSE)
    assert (found[0], found[1]) == (status, "")
    assert found[2].startswith("dhkit: ")
    assert found[2].count("\n") == 1
    assert complaint in found[2]


def test_a_file_that_cannot_be_written_is_named(plan, tmp_path):
    (tmp_path / "run.npz").mkdir()
    status, _, err = plan("planar2r", "--to", "1", "1", "-o", str(tmp_path / "run.npz"), *COARSE)
    assert status == 2
    assert err == f"dhkit: {tmp_path / 'run.npz'}: is a folder; expected a file's name\n"


def test_machines_are_told_that_there_is_no_motion(facts):
    status, said = facts("planar2r", "--xyz", "9", "0", "0")
    assert status == 1
    assert not said["found"]
    assert "out of reach" in said["reason"]


@pytest.mark.parametrize(
    "text",
    [
        "time",
        "energy",
        "effort + jerk",
        "1 time + 0.0001 effort",
        "2.5 jerk + 0.25 energy",
        "10000 effort + 3 time",
    ],
)
def test_an_objective_is_read_back(text):
    assert str(objective(text)) == text
    assert str(objective(text.replace(" + ", "+").replace(" ", "*"))) == text


def test_the_page_plays_the_motion_that_is_written(monkeypatch, plan, tmp_path):
    shown = watched(monkeypatch, Slot.MOTION)
    files = str(tmp_path / "run.npz"), str(tmp_path / "run.html")
    assert plan("planar2r", "--to", "1", "0.5", "-o", files[0], "--html", files[1], *COARSE)[0] == 0
    motion = Trajectory.load(files[0], Arm.load("planar2r").description)
    played = decode_animation(shown[0])
    assert np.abs(played.q - motion.q(played.times)).max() < FLOAT32


@pytest.mark.slow
@pytest.mark.usefixtures("bar_at_once")
def test_a_search_that_takes_long_says_how_far_it_is(plan):
    """The line is there from the start; what it said last is drawn when it ends, however fast the search was."""
    status, _, err = plan("planar2r", "--to", "1", "0.5", "--intervals", "48")
    assert status == 0
    assert re.search(r"iteration \d+: 0\.\d+ s, limits missed by \d\.\de[-+]\d+", err)


@pytest.mark.slow
def test_links_keep_away_from_each_other_and_from_the_floor(facts):
    where = ("planar3r", "--from", "0", "0.3", "0.3", "--to", "0.5", "1", "1")
    _, free = facts(*where)
    status, kept = facts(*where, "--self-collision", "--floor", "-0.5")
    assert (status, kept["certified"]) == (0, True)
    assert "clearance" in [limit["what"] for limit in kept["limits"]]
    # Nothing is in the way.
    assert kept["duration_s"] == pytest.approx(free["duration_s"], rel=0.01)
