"""Simulation in the benchmark: contenders solve the same problem, and say so where they are missing."""

import json

import numpy as np
import pytest
from benchmarks import control as simulations
from benchmarks.control import SimulationSizes, compare_simulations
from benchmarks.peers.aba_loop import AbaLoop, default_swing

from dhkit import Arm
from dhkit.bench.contenders import UnavailableError
from dhkit.control import PDGravity

TINY = SimulationSizes(single=0.02, arms=3, batch=0.05, swing=0.1, controlled=0.1, repeats=2)
SAME = 1e-12
"""Of last states and of accelerations over their largest: the same steps, added up in another order."""
DEFAULT_ERROR = 1e-3
"""rad that SciPy's default tolerance of 1e-3 is off after 0.1 s, or much less."""


def without_toolbox(monkeypatch):
    def missing(*arguments):
        raise UnavailableError("not installed")

    monkeypatch.setattr(simulations, "Fdyn", missing)


@pytest.mark.slow
def test_a_report_is_complete_without_the_toolbox(monkeypatch):
    without_toolbox(monkeypatch)
    told = []
    report = compare_simulations(Arm.load("planar2r"), TINY, progress=told.append)
    assert told == [
        "compiling",
        "one arm",
        "3 arms",
        "models",
        "a passive swing",
        "a continuous controller",
    ]
    assert not report.interrupted
    assert {gap.reason for gap in report.missing} == {"not installed"}
    (single,) = report.single
    assert single.steps == 20
    assert single.integration_error < SAME
    assert [row.arms for row in report.batch] == [3, 3, 3, 3, 3]
    loop = report.batch[-1]
    assert loop.difference < SAME
    assert all(row.difference is None for row in report.batch[:-1])
    assert all(
        row.timing.lower <= row.timing.seconds <= row.timing.upper for row in report.integration
    )
    swing = {row.contender: row for row in report.integration if "swing" in row.problem}
    assert swing["dhkit, RK4 at 4 kHz"].joint_error < SAME
    assert swing["dhkit, RK4 at 4 kHz"].drift < SAME
    assert SAME < swing["solve_ivp over pin.aba, RK45, its defaults"].joint_error < DEFAULT_ERROR
    for line in report.requirements:
        assert line.measured is not None
        assert line.met is None  # asked of the PUMA, for longer
    assert json.loads(json.dumps(report.json(), allow_nan=False)) == report.json()
    for text in (str(report), report.markdown()):
        assert "loop over pin.aba" in text
        assert "not installed" in text
        assert "asked at puma560, 10 s, and 10000 arms for 1 s" in text


@pytest.mark.slow
def test_the_toolbox_simulates_the_same_arm():
    pytest.importorskip("roboticstoolbox")
    report = compare_simulations(Arm.load("puma560"), TINY)
    assert not report.missing
    assert len(report.models) == 2
    assert all(check.difference < SAME for check in report.models)
    errors = {(row.problem, row.contender): row.joint_error for row in report.integration}
    for problem in dict.fromkeys(problem for problem, _ in errors):
        tight = errors[problem, "roboticstoolbox fdyn, RK45, rtol 1e-10"]
        assert tight < 1e-9
        assert tight < errors[problem, "roboticstoolbox fdyn, RK45, its defaults"] < DEFAULT_ERROR


def test_an_interrupted_run_reports_what_it_has_seen():
    def stop(line):
        if line == "models":
            raise KeyboardInterrupt

    report = compare_simulations(Arm.load("planar2r"), TINY, progress=stop)
    assert report.interrupted
    assert "(interrupted)" in report.markdown()
    assert report.batch
    assert not report.integration


def test_arms_of_the_batch_still_move_when_they_are_compared():
    arm = Arm.load("puma560")
    controller = PDGravity.tuned(arm, simulations.BANDWIDTH)
    loop = AbaLoop(arm.description, controller, np.zeros(6), 1 / simulations.RATE)
    assert np.abs(loop(np.full(6, simulations.SPREAD), 1000)[6:]).min() > 1e-3


def test_a_default_swing_begins_at_rest_where_it_is_told():
    arm = Arm.load("planar2r")
    q, qd = default_swing(arm.description, np.array([0.3, -0.2]), 0.1)
    np.testing.assert_array_equal(q[0], [0.3, -0.2])
    np.testing.assert_array_equal(qd[0], 0.0)
    assert q.shape == qd.shape
