"""Answer sheets of others: the verdicts that are right, and the mistake that was made."""

import json
from pathlib import Path

import pytest

from acceptance import slow_if
from dhkit.cli import main

SHEETS = Path(__file__).with_name("data") / "grading"
CASES = json.loads((SHEETS / "manifest.json").read_text())
SLOW = "b59_", "b55_", "b21_", "b51_", "b10_", "a49_", "a60_", "d72_"
TASKS = Path(__file__).with_name("data") / "public"


@pytest.fixture
def report(capsys, monkeypatch):
    """Run `dhkit grade` on files of a folder; return its report."""

    def run(folder, *arguments):
        monkeypatch.chdir(folder)
        with pytest.raises(SystemExit):
            main(("grade", *arguments, "--format", "json"))
        found = json.loads(capsys.readouterr().out)
        return found[0] if isinstance(found, list) else found

    return run


@pytest.mark.parametrize(
    "case",
    [slow_if(case["file"].startswith(SLOW), case) for case in CASES],
    ids=[case["file"].partition(".")[0] for case in CASES],
)
def test_verdict_and_mistake(report, case):
    found = report(SHEETS, case["file"], "--robot", case["robot"])
    assert found["verdict"] in case["accept"], case.get("cause")
    if found["verdict"] == "wrong" and "accept_names" in case:
        names = {diagnosis["mistake"] for diagnosis in found["diagnosis"]}
        assert names & set(case["accept_names"]), case.get("cause")


def test_a_tasks_names_in_a_matlab_file(report):
    assert (
        report(TASKS / "s01_task_names_in_matlab", "g.m", "--task", "task.toml")["verdict"]
        == "correct"
    )


@pytest.mark.slow
def test_a_product_of_the_file_is_judged(report):
    """T = A2*A1 is in the wrong order, and A1 and A2 are right."""
    found = report(TASKS / "s06_product_dropped_in_silence", "h.m", "--robot", "rr.toml")
    verdicts = {(one["quantity"], one["verdict"]) for one in found["entries"]}
    assert {("A1", "correct"), ("A2", "correct"), ("T", "wrong")} <= verdicts
    assert not verdicts & {("A1", "wrong"), ("A2", "wrong")}


@pytest.mark.parametrize(
    ("folder", "file"),
    [("s11_state_vector_matlab", "plant.m"), ("s13_input_torque_judged", "sim.m")],
)
def test_states_taken_apart_and_inputs(report, folder, file):
    assert report(TASKS / folder, file, "--robot", "rr.toml")["verdict"] == "correct"


@pytest.mark.parametrize(("file", "verdict"), [("good.m", "correct"), ("bad.m", "wrong")])
def test_vectors_of_parameters_in_matlab(report, file, verdict):
    folder = TASKS / "s16_matlab_vectors_of_parameters"
    assert report(folder, file, "--robot", "rr.toml")["verdict"] == verdict
