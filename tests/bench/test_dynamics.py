"""Dynamics in the benchmark: peers are asked the same, derivations are timed, operations are counted."""

from __future__ import annotations

import json

import numpy as np
import pytest
from benchmarks.targets import targets

from dhkit import Arm
from dhkit.bench import BenchReport, Derivation, Machine, derivations, run
from dhkit.bench.benchmark_report import BATCH
from dhkit.bench.contenders import Workload
from dhkit.bench.derivations import CASADI, INVERSE_DYNAMICS, PEER, operations
from dhkit.bench.peers import dhkit_arm, pinocchio
from dhkit.bench.peers.sympy_mechanics import lagranges_equations

pytestmark = pytest.mark.slow

DYNAMICS = ("inverse_dynamics", "mass_matrix", "forward_dynamics")
QUICK = (*dhkit_arm.contenders(), *pinocchio.contenders(), *dhkit_arm.casadi_contenders())


@pytest.mark.parametrize("name", ["cart_pendulum", "puma560"])
def test_peers_agree(name):
    report = run(Arm.load(name), DYNAMICS, batch=40, repeats=1, probes=False, contenders=QUICK)
    assert not report.missing
    assert len(report.rows) == len([c for c in QUICK if c.quantity in DYNAMICS])
    assert all(row.verdict.ok for row in report.rows)
    assert json.loads(json.dumps(report.json(), allow_nan=False)) == report.json()


def test_a_peer_that_is_off_by_a_part_in_a_million_disagrees(monkeypatch):
    arm = Arm.load("planar2r")
    workload = Workload.of(arm, 8, 1, 0)
    wrong = arm.inverse_dynamics(workload.q, workload.qd, workload.qdd) * (1 + 1e-6)
    from dhkit.bench.agreement import judge
    from dhkit.bench.contenders import Task

    task = Task(lambda items: lambda: None, lambda k: list(wrong[:k]))
    assert not judge(workload, "inverse_dynamics", task).ok


def test_derivations_are_timed_and_cut_off():
    found = derivations.derivations(Arm.load("planar2r"), limit=60.0)
    assert {line.what for line in found} >= {CASADI, PEER}
    assert all(line.seconds is not None and line.seconds > 0 for line in found)
    assert Derivation("a", "b", None, 60.0).cells == ("a", "b", "not within 60 s")


def test_the_peers_equations_are_ours():
    arm = Arm.load("cart_pendulum")
    method = lagranges_equations(arm.description)
    values = dict(zip(method.q, [0.3, 0.7], strict=True))
    M = np.array(method.mass_matrix.subs(values).evalf(), dtype=float)
    assert np.abs(M - arm.mass_matrix([0.3, 0.7])).max() < 1e-14


def test_operations_are_counted():
    counted = operations(Arm.load("puma560"))
    (inverse,) = (line for line in counted if line.program == INVERSE_DYNAMICS)
    assert inverse.total == inverse.additions + inverse.multiplications <= 305
    (asked,) = (
        line
        for line in targets(
            BenchReport(
                "puma560",
                BATCH,
                1,
                0,
                (),
                (),
                (),
                (),
                (),
                (),
                Machine.here(),
                operations=tuple(counted),
            )
        )
        if line.what == "additions and multiplications"
    )
    assert asked.met
