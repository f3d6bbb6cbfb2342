"""`dhkit ik`: the same solutions as in Python, however the pose is given; bad input in one line."""

import json

import numpy as np
import pytest

from dhkit import Arm, pose, robots
from dhkit.cli import main

CLOSES = 1e-12


@pytest.fixture
def ik(capsys):
    """Run `dhkit ik`; return its status, stdout and stderr."""

    def run(*arguments):
        with pytest.raises(SystemExit) as exit:
            main(("ik", *arguments))
        out, err = capsys.readouterr()
        return exit.value.code, out, err

    return run


@pytest.fixture
def facts(ik):
    """Run `dhkit ik --json`; return its status and what it says."""

    def run(*arguments):
        status, out, err = ik(*arguments, "--json")
        assert err == ""
        return status, json.loads(out)

    return run


def joints(said):
    rows = [
        branch["q_rad"] if "q_rad" in branch else np.radians(branch["q_deg"])
        for branch in said["branches"]
    ]
    return np.array(rows)


@pytest.mark.parametrize("name", [name for name in robots() if name not in ("jaco", "panda")])
def test_every_branch_of_every_robot_closes(facts, name):
    arm = Arm.load(name)
    q = arm.configurations["ready"] + 0.1
    status, said = facts(name, "--like", " ".join(f"{x:.17g}" for x in q))
    expected = arm.ik(arm.fk(q))
    assert status == 0
    assert said["inverse_kinematics"] == str(arm.family)
    assert said["method"] == "closed form"
    assert [branch["name"] for branch in said["branches"]] == [
        name for name, valid in zip(expected.branches, expected.valid, strict=True) if valid
    ]
    numbers = arm.description.numbers
    for branch in said["branches"]:
        values = np.array(branch["q_rad"])
        if "x" in said["met"]:
            assert np.abs(arm.fk(values)[:3, 3] - arm.fk(q)[:3, 3]).max() < CLOSES
        if len(said["met"]) == 6:
            assert np.abs(arm.fk(values) - arm.fk(q)).max() < CLOSES
        inside = np.all((values >= numbers.lower - 1e-9) & (values <= numbers.upper + 1e-9))
        assert inside == branch["within_limits"]


def test_euler_angles_that_may_be_degrees_are_asked_about(ik):
    pose_of_degrees = ("puma560", "--xyz", "0.4", "0.1", "0.8", "--euler", "0", "-180", "0")
    assert "--euler: found -180 rad (28.6 turns; were degrees meant?)" in ik(*pose_of_degrees)[2]
    for silent in ((*pose_of_degrees, "--degrees"), (*pose_of_degrees[:-2], "180*deg", "0")):
        assert not ik(*silent)[2]


def test_all_ways_to_give_a_pose_agree(facts, tmp_path):
    T = pose((0.4318, -0.1, 0.2), euler=(0, 90, -45), degrees=True)
    numbers = [f"{x:.17g}" for x in T.ravel()]
    np.savetxt(tmp_path / "pose.txt", T)
    (tmp_path / "rows.txt").write_text(repr(T[:3].tolist()))
    answers = [
        facts("puma560", "--xyz", "17*inch", "-0.1", "0.2", "--euler", "0", "pi/2", "-pi/4"),
        facts(
            "puma560", "--euler", "0", "90", "-45", "--degrees", "--xyz", "0.4318", "-100*mm", "0.2"
        ),
        facts("puma560", "--xyz=0.4318,-0.1,0.2", "--euler=0,90,-45", "--degrees"),
        facts(
            "--xyz",
            "0.4318",
            "-.1",
            "0.2",
            "--euler",
            "-45",
            "90",
            "0",
            "--order",
            "zyx",
            "--degrees",
            "puma560",
        ),
        facts("puma560", "--matrix", *numbers),
        facts("puma560", "--matrix", *numbers[:12]),
        facts("puma560", "--matrix", str(tmp_path / "pose.txt")),
        facts("puma560", "--matrix", str(tmp_path / "rows.txt")),
        facts(
            "puma560",
            "--like",
            *(f"{x:.17g}" for x in Arm.load("puma560").ik(T).branch("right up no-flip")),
        ),
    ]
    for status, said in answers:
        assert status == 0
        assert np.abs(np.array(said["T"]) - T).max() < 1e-14
        assert len(said["branches"]) == 8
        assert np.abs(np.exp(1j * joints(said)) - np.exp(1j * joints(answers[0][1]))).max() < 1e-9


def test_people_see_the_family_the_pose_and_every_branch(ik):
    arm = Arm.load("puma560")
    status, out, err = ik(
        "puma560", "--like", "nominal", "--degrees", "--near", "0", "45", "180", "0", "45", "0"
    )
    assert (status, err) == (0, "")
    assert str(arm.family) in out
    assert "pose: x y z 0.596303 -0.15005 0.657476 m, XYZ 0 90 0 °" in out
    assert all(branch in out for branch in arm.ik(np.eye(4)).branches)
    assert "outside: q2, q4" in out
    assert "8 of 8 branches reach the pose, 3 inside the limits; → nearest: right down flip" in out
    (marked,) = [line for line in out.splitlines() if line.startswith("→")]
    assert "right down flip" in marked
    assert "-47.6253" in marked


def test_near_chooses_windings_and_the_free_joint_and_marks_the_nearest(facts):
    arm = Arm.load("ur5")
    near = [*np.degrees(arm.configurations["nominal"])[:5], 350]
    words = [str(x) for x in near]
    status, said = facts("ur5", "--like", "nominal", "--near", *words, "--degrees")
    chosen = next(branch for branch in said["branches"] if branch["name"] == said["nearest"])
    assert status == 0
    assert chosen["q_deg"][5] == pytest.approx(360)
    assert chosen["q_deg"][:5] == pytest.approx(near[:5], abs=1e-6)
    # The wrist is straight at zero: joint 4 is free and takes the value asked for.
    status, said = facts("puma560", "--like", "zero", "--near", "0 0 0 0.3 0 0")
    chosen = next(branch for branch in said["branches"] if branch["name"] == said["nearest"])
    assert chosen["flags"] == ["wrist"]
    assert np.allclose(chosen["q_rad"], [0, 0, 0, 0.3, 0, -0.3], atol=1e-9)
    assert said["status"] == "singular"


def test_only_branches_inside_the_limits_are_shown_on_request(facts, ik):
    arm = Arm.load("puma560")
    within = arm.ik(arm.fk(arm.configurations["nominal"])).allowed
    status, said = facts("puma560", "--like", "nominal", "--limits")
    assert status == 0
    assert len(said["branches"]) == within.sum() == 3
    assert all(branch["within_limits"] for branch in said["branches"])
    # A pose that is reached outside the limits alone.
    arguments = ("puma560", "--xyz", "0.4", "0", "-0.1")
    assert facts(*arguments)[0] == 0
    status, out, err = ik(*arguments, "--limits")
    assert (status, err) == (1, "")
    assert "reached, but by no branch inside the joint limits" in out


def test_out_of_reach_says_by_how_much(ik, facts):
    status, out, err = ik("planar2r", "--xyz", "1", "0", "0")  # links of 0.5 m and 0.4 m
    assert (status, err) == (1, "")
    assert "out of reach by 0.1 m" in out
    status, said = facts("planar2r", "--xyz", "1", "0", "0")
    assert (status, said["branches"], said["status"]) == (1, [], "out_of_reach")
    assert said["distance_m"] == pytest.approx(0.1)


def test_iteration_finds_one_solution_for_any_arm(facts, ik):
    arm = Arm.load("panda")
    status, said = facts("panda", "--like", "ready", "--numeric", "--near", "ready")
    assert (status, said["method"], len(said["branches"])) == (0, "numeric", 1)
    assert said["branches"][0]["within_limits"]
    assert np.abs(arm.fk(joints(said)[0]) - np.array(said["T"])).max() < 1e-11
    status, out, _ = ik("panda", "--xyz", "5", "0", "0", "--numeric")
    assert status == 1
    assert "out of reach: the best try misses the position by 4." in out
    status, out, _ = ik("panda", "--xyz", "0.9", "0", "0.333", "--numeric")
    assert status == 1
    assert "no solution found by iteration: the best try misses the position by 0." in out


def test_an_arm_near_a_family_is_solved_from_its_neighbour(facts, ik, tmp_path):
    rows = [(0, 0.3, 0, "pi/2"), (0, 0, 0.4, 1e-6), (0, 0.1, 0.05, "-pi/2"), (0, 0.4, 0, "pi/2")]
    arm = Arm.from_dh([*rows, (0, 0, 0, "-pi/2"), (0, 0.1, 0, 0)], name="tilted")
    file = str(tmp_path / "tilted.toml")
    arm.save(file)
    status, said = facts(file, "--like", "0.3", "0.5", "-1.2", "0.4", "0.9", "-0.2")
    assert (status, said["method"], len(said["branches"])) == (
        0,
        "iteration from an arm of the family",
        8,
    )
    assert all(branch["flags"] == ["refined"] for branch in said["branches"])
    assert np.abs(arm.fk(joints(said)) - np.array(said["T"])).max() < 1e-9
    _, out, _ = ik(file, "--like", "0.3", "0.5", "-1.2", "0.4", "0.9", "-0.2")
    assert "8 solutions found by iteration from an arm of the family" in out
    for xyz, refusal in (
        (
            ("0", "0", "0.3"),
            "no solution found by iteration from an arm of the family, which does not prove",
        ),
        (("9", "0", "0"), "out of reach: no joint values reach this pose"),
    ):
        status, out, _ = ik(file, "--xyz", *xyz)
        assert status == 1 and refusal in out


def test_an_arm_of_seven_joints_is_solved_at_a_redundancy(facts, ik):
    status, said = facts("panda", "--like", "ready", "--redundancy", "0.5")
    assert (status, said["method"], said["redundancy_rad"]) == (0, "closed form", 0.5)
    assert len(said["branches"]) == 8
    assert np.abs(joints(said)[:, 6] - 0.5).max() < 1e-12
    status, out, _ = ik("panda", "--like", "ready", "--redundancy", "45", "--degrees")
    assert status == 0 and "at joint 7 = 45 °" in out
    status, out, _ = ik("panda", "--xyz", "3", "0", "0")
    assert status == 1 and "out of reach: no joint values reach this pose" in out
    status, out, _ = ik("panda", "--like", "ready", "--redundancy", "2.5")
    assert status == 1 and "no solution found: joint 7 = 2.5 rad" in out
    status, _, err = ik("puma560", "--like", "nominal", "--redundancy", "0.5")
    assert status == 2 and "redundancy is given, but puma560 has 6 joints" in err


def test_an_arm_without_closed_form_is_solved_by_elimination(facts, ik):
    status, said = facts("jaco", "--like", "0.1 0.2 0.3 0.4 0.5 0.6")
    assert (status, said["method"], len(said["branches"])) == (0, "elimination", 8)
    status, out, _ = ik("jaco", "--like", "0.1 0.2 0.3 0.4 0.5 0.6")
    assert status == 0 and "8 solutions found by elimination" in out


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["puma560"], "expected one of --xyz, --matrix and --like"),
        (
            ["puma560", "--xyz", "1", "0", "0", "--like", "ready"],
            "expected one of --xyz, --matrix and --like",
        ),
        (["puma560", "--xyz", "1", "2"], "--xyz: 2 values; expected 3"),
        (["puma560", "--xyz", "1", "2", "three"], "--xyz: unknown name 'three'"),
        (["puma560", "--xyz", "1", "2", "3", "4"], "unexpected extra argument"),
        (["puma560", "--xyz"], "--xyz: no values"),
        (["puma560", "--xyz", "1", "2", "3", "--euler", "1", "2"], "--euler: 2 values; expected 3"),
        (["puma560", "--xyz", "1", "2", "3", "--order", "XXY"], "order is 'XXY'"),
        (["puma560", "--xzy", "1", "2", "3"], "No such option: --xzy"),
        (
            ["puma560", "--like", "raedy"],
            "no configuration 'raedy'; it has zero, ready, nominal, stretched",
        ),
        (["puma560", "--like", "1", "2"], "2 values of --like; expected 6"),
        (["puma560", "--like", "ready", "--near", "1", "2"], "2 values of --near; expected 6"),
        (["puma560", "--matrix", "1", "2", "3"], "--matrix: 3 values; expected 16 or 12"),
        (["puma560", "--matrix", "1 0 0 0 0 1 0 0 0 0 2 0"], "rotation must be orthonormal"),
        (["puma560", "--matrix", "none.txt"], "found 'none.txt'; expected 16 or 12 numbers"),
        (["puma560", "--matrix", "huge.txt"], "more than 10000 bytes"),
        (["puma560", "--matrix", "binary.txt"], "not text"),
        (["puma560", "--matrix", "short.txt"], "--matrix: 2 values; expected 16 or 12"),
        (["pume560", "--like", "ready"], "did you mean 'puma560'?"),
    ],
)
def test_bad_input_is_one_line_and_status_2(ik, arguments, complaint, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "huge.txt").write_text("1 " * 6000)
    (tmp_path / "binary.txt").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "short.txt").write_text("1 2")
    status, out, err = ik(*arguments)
    assert (status, out) == (2, "")
    assert err.startswith("dhkit: ")
    assert err.count("\n") == 1
    assert complaint in err
