"""Problems with known answers: their numbers by two more ways, and the scores of solvers."""

import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pinocchio
import pytest
from benchmarks.problem_files import ExactArm, apart

from dhkit import Arm
from dhkit.bench import Contender, Mode, Task
from dhkit.bench.problems import KINDS, Problems, files_in, run_problems
from dhkit.cli import main
from dhkit.errors import DescriptionError

FOLDER = Path(__file__).parents[2] / "benchmarks" / "problems"
FILES = files_in(FOLDER)
QUICK = ("puma560",)
"""Arms that are solved in every run: one in closed form. By elimination each takes 10 s."""


def content(file):
    return json.loads(file.read_text())


def test_there_are_ten_arms():
    assert len(FILES) == 10


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_file_has_its_schema_and_every_kind_of_pose(file):
    data = content(file)
    jsonschema.validate(data, json.loads((FOLDER / "schema.json").read_text()))
    kinds = {pose["kind"] for pose in data["inverse_kinematics"]}
    # A slide without limits reaches as far as one likes.
    assert kinds == set(KINDS[:3] if data["arm"]["name"] == "stanford" else KINDS)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_solutions_reach_their_poses_with_fifty_digits(file):
    data = content(file)
    exact = ExactArm(Arm.load(file.stem).description)
    for pose in data["inverse_kinematics"][::7]:
        for q in pose["solutions"]:
            T = np.array(exact.rounded(exact.pose(q)))
            assert np.abs(T - pose["T"]).max() < 1e-14
        for k, q in enumerate(pose["solutions"]):
            for other in pose["solutions"][:k]:
                assert apart(np.array(q), np.array(other)) > 1e-6


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_states_are_pinocchios(file):
    data = content(file)
    model = Arm.load(file.stem).model
    frame = model.getFrameId("tool") if model.existFrame("tool") else model.nframes - 1
    numbers = model.createData()
    for state in data["forward_kinematics"]:
        pinocchio.framesForwardKinematics(model, numbers, np.array(state["q"]))
        assert np.abs(numbers.oMf[frame].homogeneous - state["T"]).max() < 1e-12
    for state in data["dynamics"]["states"]:
        q, qd, qdd = (np.array(state[name]) for name in ("q", "qd", "qdd"))
        tau = pinocchio.rnea(model, numbers, q, qd, qdd)
        assert np.abs(tau - state["tau"]).max() < 1e-12 * max(1.0, np.abs(tau).max())


@pytest.mark.parametrize(
    "file",
    [
        pytest.param(file, marks=() if file.stem in QUICK else pytest.mark.slow, id=file.stem)
        for file in FILES
    ],
)
def test_dhkit_finds_all_and_invents_nothing(file, monkeypatch):
    from dhkit.bench import problems
    from dhkit.bench.peers import dhkit_arm

    monkeypatch.setattr(problems, "all_contenders", dhkit_arm.contenders)
    report = run_problems([file])
    assert {row.robot for row in report.rows} == {file.stem}
    assert [row for row in report.rows if not row.is_right] == []
    assert max(row.error for row in report.rows) < 1e-9


def solver_that(answer):
    """Return a contender that answers each pose so."""

    def setup(workload):
        return Task(lambda count: lambda: None, lambda k: [answer(T) for T in workload.T[:k]])

    return Contender("a solver", "ik", Mode.SINGLE, setup)


@pytest.mark.slow
def test_what_is_missed_and_invented_is_counted(monkeypatch):
    from dhkit.bench import problems

    file = FOLDER / "puma560.json"
    read = Problems.read(file)
    half = solver_that(lambda T: read.arm.ik(T).q[:4])
    wrong = solver_that(lambda T: np.zeros((1, 6)))
    monkeypatch.setattr(
        problems, "all_contenders", lambda: (half, replace(wrong, name="a wrong one"))
    )
    report = run_problems([file])
    some, none = report.rows
    assert sum(some.found.values()) == sum(some.missed.values()) == some.known / 2
    assert not some.is_right and some.invented == 0
    assert none.invented == none.poses
    assert sum(none.found.values()) == 0
    assert "a solver" in str(report)
    assert r"\toprule" in report.latex()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{}", "no problems: KeyError: 'format'"),
        ('{"format": 2}', "format 2; expected 1"),
        ("[", "no problems"),
    ],
)
def test_a_bad_file_is_refused_in_one_line(tmp_path, text, message):
    file = tmp_path / "bad.json"
    file.write_text(text)
    with pytest.raises(DescriptionError, match=message) as caught:
        Problems.read(file)
    assert "\n" not in str(caught.value)
    with pytest.raises(DescriptionError, match="no files of problems"):
        files_in(tmp_path / "nowhere")


@pytest.mark.slow
def test_the_command_writes_a_table_in_latex(tmp_path, monkeypatch, capsys):
    from dhkit.bench import problems
    from dhkit.bench.peers import dhkit_arm

    monkeypatch.setattr(problems, "all_contenders", dhkit_arm.contenders)
    output = tmp_path / "scores.tex"
    with pytest.raises(SystemExit) as end:
        main(["bench", "--problems", str(FOLDER / "ur5.json"), "-o", str(output)])
    assert end.value.code == 0
    assert "ur5" in capsys.readouterr().out
    assert r"\begin{tabular}" in output.read_text()
    assert json.loads((tmp_path / "scores.json").read_text())["rows"][0]["robot"] == "ur5"
