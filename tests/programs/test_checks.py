"""Scores of solutions as a teacher would give them, the joint that is wrong first named."""

import json
from pathlib import Path

import numpy as np
import pytest

from acceptance import slow_if
from dhkit import Arm
from dhkit.cli import main
from dhkit.execution.isolation import Isolation, Kind
from dhkit.programs import Program
from dhkit.programs.check_report import share_within
from dhkit.programs.checks import check
from dhkit.programs.rubric import CheckRubric
from programs.puma_solutions import EDITS, solution

EXPECTED = {
    "right": ((100, 60, 20, 10, 10), ""),
    "one branch": ((100, 60, 2.5, 10, 10), "never found"),
    "atan for atan2": ((100, (20, 45), (5, 15), (0, 10), (3, 8)), "joint 1 (waist) is wrong first"),
    "no shoulder offset": ((100, 0, 0, 0, 0), "joint 1 (waist) is wrong first"),
    "degrees": ((100, 0, 0, 0, 0), "in degrees; expected radians"),
    "fails at singular poses": ((100, 60, 20, (0, 8), 10), ""),
    "slow": ((100, 60, 20, 10, (1, 5)), ""),
    "sign of the elbow": ((100, 0, 0, 0, 0), "joint 3 (elbow) is wrong first"),
    "wrist transposed": ((100, 0, 0, 0, 0), "joint 4 (wrist_roll) is wrong first"),
    "raises out of reach": ((100, (50, 59), 20, (0, 10), 10), "math domain error"),
}
"""Points of fk and of the parts of ik, or between which they are; and what is said."""

SLOW = {
    "raises out of reach",
    "wrist transposed",
    "sign of the elbow",
    "no shoulder offset",
    "slow",
}


@pytest.fixture(scope="module")
def puma():
    return Arm.load("puma560")


PATIENT = CheckRubric.from_dict({"fk": {}, "ik": {"seconds": 10}})
"""Points for time do not depend on how busy the machine is."""


def checked(arm, text, tmp_path, isolation=None, **options):
    path = tmp_path / "student.py"
    path.write_text(text)
    with Program(path, isolation=isolation) as program:
        return check(arm, program, **({"seed": 1, "samples": 40} | options))


@pytest.mark.parametrize("name", [slow_if(name in SLOW, name) for name in EDITS])
def test_ten_solutions_are_scored_as_a_teacher_would(name, puma, tmp_path):
    rubric = CheckRubric() if name == "slow" else PATIENT
    report = checked(puma, solution(name), tmp_path, rubric=rubric)
    expected, said = EXPECTED[name]
    found = [part.points for parts in report.functions.values() for part in parts]
    assert len(found) == len(expected)
    for points, wanted in zip(found, expected, strict=True):
        low, high = wanted if isinstance(wanted, tuple) else (wanted - 1e-9, wanted + 1e-9)
        assert low <= points <= high, str(report)
    assert said in str(report)


FORWARD = {
    "theta's sign": (
        "link(i, q[i])",
        "link(i, -q[i])",
        "joint 1 (waist) is the first whose axis is wrong",
    ),
    "a3": (
        "a = [0, a2, a3, 0, 0, 0]",
        "a = [0, a2, -a3, 0, 0, 0]",
        "joint 4 (wrist_roll) is the first",
    ),
    "alpha1": ("alpha = [pi / 2, 0", "alpha = [-pi / 2, 0", "joint 2 (shoulder) is the first"),
    "d6": ("d = [d1, 0, d3, d4, 0, 0]", "d = [d1, 0, d3, d4, 0, 0.1]", "look at the last row"),
    "degrees": ("link(i, q[i])", "link(i, q[i] * pi / 180)", "given degrees"),
}


@pytest.mark.parametrize(
    "name", [slow_if(name in {"a3", "theta's sign"}, name) for name in FORWARD]
)
def test_a_wrong_row_is_found(name, puma, tmp_path):
    old, new, said = FORWARD[name]
    text = solution("right").replace(old, new).split("def ik")[0]
    report = checked(puma, text, tmp_path, samples=10)
    assert report.points < 100 and said in str(report)


@pytest.mark.parametrize(
    "name",
    [
        slow_if(name != "cobra600", name)
        for name in ("cobra600", "planar2r", "panda", "stanford", "ur5")
    ],
)
def test_our_own_kinematics_get_full_marks(name, tmp_path):
    text = (
        f"from dhkit import Arm\narm = Arm.load({name!r})\n"
        "def fk(q):\n    return arm.fk(q)\n"
        "def ik(T):\n    s = arm.ik(T) if arm.n < 7 else arm.ik_numeric(T, arm.configurations['ready'])\n"
        "    return s.q[s.valid]\n"
    )
    unprotected = Isolation(Kind.NONE, "to import dhkit")
    report = checked(Arm.load(name), text, tmp_path, unprotected, samples=20, rubric=PATIENT)
    assert report.functions["fk"][0].points == 100
    parts = {part.name: part for part in report.functions["ik"]}
    assert parts["closes"].points >= 0.9 * parts["closes"].most, str(report)
    if name != "panda":
        assert parts["branches"].points == parts["branches"].most, str(report)
    assert report.notes[0] == "student.py imports dhkit"


@pytest.mark.slow
def test_a_controller_is_scored_by_its_error(puma, tmp_path):
    text = (
        "import numpy as np\nKP = np.array([2500, 2500, 1500, 60, 40, 20.0])\n"
        "def controller(t, q, qd, setpoint):\n    return KP * (setpoint.q - q) + 0.1 * KP * (setpoint.qd - qd)\n"
    )
    rubric = CheckRubric.from_dict({"controller": {"duration": 1.0, "rate": 200.0, "bound": 0.5}})
    assert checked(puma, text, tmp_path, rubric=rubric).full
    strict = CheckRubric.from_dict({"controller": {"duration": 1.0, "rate": 200.0, "bound": 1e-4}})
    report = checked(puma, text, tmp_path, rubric=strict)
    assert report.points == 0 and "peak error" in str(report)
    broken = checked(puma, text.replace("return", "return 1 / 0 *"), tmp_path, rubric=rubric)
    assert broken.points == 0 and "line 4: ZeroDivisionError" in str(broken)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_report(puma, tmp_path):
    first, again = (
        checked(puma, solution("one branch"), tmp_path, samples=10, rubric=PATIENT)
        for _ in range(2)
    )
    assert [p.points for p in first.functions["ik"]] == [p.points for p in again.functions["ik"]]
    assert (
        checked(puma, solution("right"), tmp_path, seed=None, samples=1).seed
        != checked(puma, solution("right"), tmp_path, seed=None, samples=1).seed
    )


def test_the_command_and_its_status(tmp_path, capsys):
    (tmp_path / "right.py").write_text(solution("right"))
    (tmp_path / "degrees.py").write_text(solution("degrees"))
    (tmp_path / "broken.py").write_text("def fk(q)\n")
    (tmp_path / "rubric.toml").write_text(
        "[ik]\nbranches = 40\ncloses = 60\nsingular = 0\ntime = 0\n"
    )
    (tmp_path / "wrong.toml").write_text("[ik]\nbranch = 40\n")

    def run(*arguments):
        with pytest.raises(SystemExit) as ended:
            main(["check", "puma560", *arguments])
        return ended.value.code, *capsys.readouterr()

    status, out, _ = run(str(tmp_path / "right.py"), "--samples", "10", "--seed", "3")
    assert status == 0 and "200 of 200 points" in out and "seed 3" in out
    status, out, _ = run(
        str(tmp_path / "degrees.py"),
        "--samples",
        "10",
        "--json",
        "--rubric",
        str(tmp_path / "rubric.toml"),
    )
    report = json.loads(out)
    assert (
        status == 1
        and report["most"] == 100
        and report["points"] == 0
        and list(report["functions"]) == ["ik"]
    )
    status, _, err = run(str(tmp_path / "broken.py"))
    # Without bubblewrap, a line before it says that programs are not isolated.
    assert (
        status == 2
        and err.splitlines()[-1] == "dhkit: broken.py: line 1: SyntaxError: expected ':'"
    )
    status, _, err = run(str(tmp_path / "right.py"), "--rubric", str(tmp_path / "wrong.toml"))
    assert status == 2 and "ik.branch" in err and err.count("\n") == 1
    status, _, err = run(str(tmp_path / "missing.py"))
    assert status == 2 and "expected a file" in err


def test_a_rubric_that_asks_for_more_than_is_there(puma, tmp_path):
    rubric = CheckRubric.from_dict({"fk": {}, "controller": {}})
    report = checked(puma, solution("right"), tmp_path, rubric=rubric, samples=5)
    assert report.points == 100 and report.most == 200
    assert np.isclose(report.functions["controller"][0].points, 0.0)


@pytest.mark.slow
def test_a_controller_is_scored_on_an_arm_whose_configurations_are_one_state(tmp_path):
    arm = Arm.load("puma560_cao")
    assert np.array_equal(arm.configurations["ready"], np.zeros(6))
    source = tmp_path / "still.py"
    source.write_text(
        "import numpy as np\ndef controller(t, q, qd, setpoint):\n    return np.zeros(6)\n"
    )
    with Program(source) as program:
        (part,) = check(arm, program, seed=1).functions["controller"]
    assert part.points == 0
    assert "peak error" in part.text


def test_branches_are_counted_of_all_poses_and_not_of_those_that_were_tried(tmp_path):
    right = (Path(__file__).parents[2] / "docs/examples/puma_ik.py").read_text()
    source = tmp_path / "few.py"
    source.write_text(
        right.replace("def ik(T)", "def solved(T)")
        + "\ndef ik(T): return solved(T) if T[0][3] > 0.5 else []\n"
    )
    with Program(source) as program:
        _, branches, *_ = check(Arm.load("puma560"), program, seed=3, samples=40).functions["ik"]
    assert "of 320 solutions" in branches.text
    assert branches.points < 10


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        slow_if(
            True, "import numpy as np\ndef fk(q): return np.eye(4)\n", "the same pose for every q"
        ),
        (
            "def fk(q): return [[round(x, 4) for x in row] for row in right(q)]\n",
            "are its numbers rounded",
        ),
        (
            "def fk(q): return [[-r[0], *r[1:]] if k < 3 else r for k, r in enumerate(right(q))]\n",
            "is not a rotation",
        ),
        ("def fk(q): return [*right(q)[:3], [0, 0, 0, 2]]\n", "last row is not 0 0 0 1"),
    ],
)
def test_what_is_wrong_with_any_pose_is_said_before_an_axis_is_blamed(tmp_path, text, hint):
    own = (
        (Path(__file__).parents[2] / "docs/examples/puma_ik.py")
        .read_text()
        .replace("def fk(", "def right(")
    )
    (tmp_path / "fk.py").write_text(own.replace("def ik(", "def solved(") + "\n" + text)
    with Program(tmp_path / "fk.py") as program:
        (part,) = check(Arm.load("puma560"), program, seed=1, samples=20).functions["fk"]
    assert part.points == 0
    assert hint in " ".join(part.details)


def test_points_fall_from_the_bound_to_ten_times_it():
    assert [share_within(value, 0.1) for value in (0.0, 0.1, 1.0, 2.0, np.inf)] == [
        1.0,
        1.0,
        0.0,
        0.0,
        0.0,
    ]
    assert share_within(0.3, 0.1) == pytest.approx(1 - np.log10(3))


@pytest.mark.parametrize(
    ("unit", "factor"),
    [slow_if(True, "mm", 1000), slow_if(True, "cm", 100), ("inches", 1 / 0.0254)],
)
def test_other_units_of_length_are_named(unit, factor, tmp_path):
    arm = Arm.load("planar2r")
    l1, l2 = (factor * length for length in arm.description.numbers.a)
    text = (
        "from math import acos, atan2, cos, sin\n"
        f"l1, l2 = {l1}, {l2}\n"
        "def fk(q):\n"
        "    a, b = q[0], q[0] + q[1]\n"
        "    c, s = cos(b), sin(b)\n"
        "    x, y = l1 * cos(a) + l2 * c, l1 * sin(a) + l2 * s\n"
        "    return [[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, 0], [0, 0, 0, 1]]\n"
        "def ik(T):\n"
        "    x, y = T[0][3], T[1][3]\n"
        "    k = (x * x + y * y - l1**2 - l2**2) / (2 * l1 * l2)\n"
        "    if abs(k) > 1:\n        return []\n"
        "    return [[atan2(y, x) - atan2(l2 * sin(b), l1 + l2 * cos(b)), b] for b in (acos(k), -acos(k))]\n"
    )
    report = checked(arm, text, tmp_path, samples=10, rubric=PATIENT)
    assert f"its positions are in {unit}; expected m" in str(report)
    assert f"when their positions are given in {unit}; expected m" in str(report)
    assert "axis is wrong" not in str(report)
