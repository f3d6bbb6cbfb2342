"""A person's own program beside the arm: loaded anew when it is saved, and never in the way of the lab."""

import time
from contextlib import suppress

import numpy as np
import psutil
import pytest

from acceptance import in_time
from dhkit import Arm
from dhkit.lab import Lab
from dhkit.lab.control_panel import CONTROL_RATE, FRAME_RATE
from dhkit.viewer.session import Slot
from lab.test_requests import states
from programs.puma_solutions import solution
from viewer.messages import decode_ghosts
from waiting import wait_for

CONTROLLER = "def controller(t, q, qd, setpoint):\n    return 300 * (setpoint.q - q) - 30 * qd\n"


@pytest.fixture
def beside(tmp_path):
    """Return what opens a lab with a program of a text, and its file; no process is left at the end."""
    opened = []

    def make(text, robot="puma560"):
        file = tmp_path / "mine.py"
        file.write_text(text)
        lab = Lab(Arm.load(robot), own=file)
        opened.append(lab)
        wait_for(lambda: (states(lab)["own"] or {}).get("loading") is False)
        return lab, file

    yield make
    for lab in opened:
        lab.close()
    wait_for(lambda: not runners(), "the end of its processes")


def runners():
    """Return the processes of this one that run programs."""
    found = []
    for child in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):
            command = " ".join(child.cmdline())
            found += [command] * ("runner" in command or "supervisor" in command)
    return found


def own(lab):
    return states(lab)["own"]


@pytest.mark.slow
def test_it_is_compared_where_the_arm_is_and_scored(beside):
    lab, _ = beside(solution("sign of the elbow"))
    lab.answer("joints.set", {"q": [0.2, 0.3, -0.3, 0.4, 0.7, 0.2]})
    # The first comparison may be of the state where the lab began, whose elbow's sign does not matter.
    wait_for(
        lambda: (own(lab).get("ik", {}).get("count"), own(lab).get("ik", {}).get("right")) == (8, 0)
    )
    assert own(lab)["fk"]["distance"] < 1e-12
    wait_for(lambda: own(lab).get("report"))
    assert own(lab)["report"]["points"] == 100 and "joint 3 (elbow)" in str(own(lab)["report"])
    lab.answer("own.ghosts", {"on": True})
    wait_for(lambda: Slot.GHOSTS in lab.view._state)
    assert len(decode_ghosts(lab.view._state[Slot.GHOSTS]).transforms) == 8
    lab.answer("own.ghosts", {"on": False})


@pytest.mark.slow
def test_it_is_loaded_anew_when_it_is_saved(beside):
    lab, file = beside("def fk(q)\n")
    assert own(lab)["error"] == "line 1: SyntaxError: expected ':'"
    file.write_text("def fk(q):\n    print('here')\n    return 1 / 0\n")
    wait_for(lambda: own(lab).get("fk"))
    assert own(lab)["fk"]["error"] == "line 3: ZeroDivisionError: division by zero"
    wait_for(lambda: "here" in own(lab).get("output", ""))
    file.write_text(solution("right"))
    wait_for(lambda: (own(lab).get("report") or {}).get("points") == 200)
    file.unlink()
    wait_for(lambda: "expected a file" in (own(lab).get("error") or ""))
    lab.answer("joints.set", {"q": [0.1] * 6})
    assert states(lab)["joints"]["q"] == [0.1] * 6


LOOPS = "def fk(q):\n    while True:\n        pass\n"
DIES = "import os\ndef fk(q):\n    os._exit(1)\n"
NEVER_LOADED = "while True:\n    pass\n"


@pytest.mark.parametrize("text", [LOOPS, DIES, NEVER_LOADED])
def test_a_program_that_dawdles_or_dies_keeps_nobody_waiting(text, tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(text)
    with Lab(Arm.load("puma560"), own=file) as lab:
        wait_for(lambda: text == DIES or runners(), "its process")
        for k in range(20):
            begin = time.monotonic()
            lab.answer("joints.set", {"q": [0.01 * k] * 6})
            in_time(time.monotonic() - begin, 0.5)
        begin = time.monotonic()
    in_time(time.monotonic() - begin, 8.0)


def test_its_controller_is_in_the_list_and_drives_the_arm(beside):
    lab, file = beside(CONTROLLER, "planar2r")
    wait_for(lambda: "own" in [one["name"] for one in states(lab)["control"]["controllers"]])
    lab.answer("control.start", {"controller": "own", "reference": "sine"})
    begin = lab.desk.q.copy()
    wait_for(lambda: np.abs(lab.desk.q - begin).max() > 0.02)
    assert states(lab)["control"]["error"] is None
    lab.answer("control.stop", {})
    file.write_text(CONTROLLER.replace("300", "1 / 0") + "def fk(q):\n    return 1.0\n")
    wait_for(lambda: own(lab).get("functions") == ["fk", "controller"])
    lab.answer("control.start", {"controller": "own"})
    wait_for(lambda: states(lab)["control"]["error"])
    assert "line 2: ZeroDivisionError" in states(lab)["control"]["error"]
    assert lab.view._ghosts == ()


@pytest.mark.slow
def test_the_simulated_time_is_that_of_the_frames(open_lab, monkeypatch):
    lab, steps = open_lab("planar2r"), []
    simulate = lab._control._simulate_frame
    monkeypatch.setattr(
        lab._control, "_simulate_frame", lambda live, n: steps.append(n) or simulate(live, n)
    )
    lab.answer("control.start", {"reference": "hold", "controller": "pd-gravity"})
    wait_for(lambda: len(steps) > 40)
    lab.answer("control.stop", {})
    simulated = np.cumsum(steps) / CONTROL_RATE
    assert np.abs(simulated - np.arange(1, len(steps) + 1) / FRAME_RATE).max() <= 0.5 / CONTROL_RATE


def test_without_one_there_is_nothing_of_it(open_lab):
    lab = open_lab("planar2r")
    assert states(lab)["own"] is None
    for request, data in (("own.score", {}), ("control.start", {"controller": "own"})):
        with pytest.raises(ValueError, match="--mine FILE"):
            lab.answer(request, data)


def test_a_score_is_about_the_arm_on_show_alone(tmp_path):
    source = tmp_path / "mine.py"
    source.write_text(
        "def fk(q):\n    return [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n"
    )
    with Lab(Arm.load("planar2r"), own=source) as lab:
        wait_for(lambda: lab._own._state.get("report"))
        lab.answer("table.edit", {"row": 0, "column": "a", "text": "0.7"})
        assert lab._own._state["report"] is None
        assert lab._own._state["edited"]
        lab.answer("own.score", {})
        lab.answer("table.reset", {})  # before the score of the edited arm is there
        wait_for(lambda: lab._own._scores._thread is None)
        assert lab._own._state["report"] is None


def test_an_unstable_controller_stops_early_with_the_reason(beside):
    lab, _ = beside(
        "def controller(t, q, qd, setpoint):\n    return 300 * (setpoint.q - q) - 1e5 * qd\n"
    )
    wait_for(lambda: "own" in [one["name"] for one in states(lab)["control"]["controllers"]])
    lab.answer("control.start", {"controller": "own", "reference": "sine"})
    wait_for(lambda: states(lab)["control"]["error"])
    assert "changes its sign at every sample" in states(lab)["control"]["error"]
    assert not states(lab)["control"]["running"]
