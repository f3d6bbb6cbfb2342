"""Motions in the benchmark: contenders are asked the same, and none is praised for breaking its limits."""

import json

import numpy as np
import pytest
from benchmarks import planning as motions
from benchmarks.planning import compare_motions, holdable_pairs
from benchmarks.planning_cases import measure_cases
from benchmarks.scenes import SceneKind, compare_scenes, scenes

from acceptance import only_accepting
from dhkit.bench.contenders import UnavailableError
from dhkit.description import library_robot
from dhkit.dynamics import gravity_torque
from dhkit.planning import distance

PUMA = library_robot("puma560")
KEPT = 1e-4
"""By what share of a limit toppra's motions may exceed it between points."""


@pytest.fixture(autouse=True)
def once(monkeypatch):
    """No figure is judged here."""
    monkeypatch.setattr(motions, "BUILDS", 1)


@only_accepting
@pytest.mark.slow
def test_a_report_has_all_contenders_at_both_speeds():
    pytest.importorskip("toppra")
    told = []
    report = compare_motions(PUMA, 1, meshes=(8,), intervals=12, progress=told.append)
    assert not report.missing
    assert not report.interrupted
    for speed in (1.0, 3.0):
        rows = {row.contender: row for row in report.rows if row.speed == speed}
        assert len(rows) == 6
        assert all(row.found == row.pairs == 1 and row.excess < KEPT for row in rows.values())
        fine = rows.pop("dhkit, 48 intervals, fine")
        assert fine.mean == fine.most == 1
        assert all(row.most > 1 for row in rows.values())
        assert (
            rows["quintic"].mean
            > rows["best trapezoid"].mean
            > rows["toppra, straight joint path"].mean
        )
    assert [build.intervals for build in report.builds] == [8, 12, 48]
    assert any("pair 1 of 1" in line for line in told)
    assert json.loads(json.dumps(report.json(), allow_nan=False)) == report.json()
    for text in (str(report), report.markdown()):
        assert "dhkit, 12 intervals, its usual mesh" in text
        assert report.machine.packages["toppra"] in text


@pytest.mark.slow
def test_without_toppra_it_goes_on(monkeypatch):
    def missing(description):
        raise UnavailableError("not installed")

    monkeypatch.setattr(motions, "StraightTiming", missing)
    report = compare_motions(library_robot("planar2r"), 1, meshes=(), intervals=6, speeds=(1.0,))
    assert [gap.reason for gap in report.missing] == ["not installed"]
    assert "not installed" in report.markdown()
    assert len(report.rows) == 4


@pytest.mark.slow
def test_an_interrupted_run_reports_what_it_has_seen():
    def stop(line):
        if "pair 2" in line:
            raise KeyboardInterrupt

    report = compare_motions(
        library_robot("planar2r"), 2, meshes=(), intervals=6, speeds=(1.0,), progress=stop
    )
    assert report.interrupted
    assert "(interrupted)" in report.markdown()
    assert all(row.pairs == 1 for row in report.rows)


def test_pairs_are_inside_the_limits_and_can_be_held():
    pairs = holdable_pairs(PUMA, 20, seed=3)
    numbers = PUMA.numbers
    assert pairs.shape == (20, 2, 6)
    assert ((pairs >= numbers.lower) & (pairs <= numbers.upper)).all()
    assert (np.abs(gravity_torque(PUMA, pairs)) < numbers.effort).all()
    np.testing.assert_array_equal(pairs, holdable_pairs(PUMA, 20, seed=3))


def test_hard_cases_are_measured_and_reported():
    report = measure_cases(pairs=1, only="cobra600, jerk")
    assert [row.case for row in report.rows] == ["cobra600, jerk", "cobra600, jerk, friction"]
    assert all(row.met and row.found == row.motions == 1 for row in report.rows)
    assert "none fails" in str(report) and report.json()["rows"][0]["wanted"] == "none fails"
    assert "| cobra600, jerk |" in report.markdown()


@pytest.mark.slow
def test_scenes_are_the_same_again_and_their_straight_way_collides():
    kind = SceneKind("ur5")
    first, again = next(scenes(kind, 3)), next(scenes(kind, 3))
    assert (first.start == again.start).all() and 3 <= len(first.obstacles) <= 10
    arm = library_robot("ur5")
    ends = distance(arm, np.stack([first.start, first.goal]), first.obstacles).distance
    assert ends.min() > 0.03
    way = first.start + np.linspace(0, 1, 200)[:, None] * (first.goal - first.start)
    assert distance(arm, way, first.obstacles).distance.min() < 0.02


@only_accepting
@pytest.mark.slow
def test_motions_in_scenes_that_ompl_solves():
    pytest.importorskip("ompl")
    report = compare_scenes(2, kinds=[SceneKind("ur5")], compared=1, starts=1)
    assert all(
        np.isfinite(result.duration) and result.shortfall < 1e-6 > result.excess
        for result in report.results
    )
    assert "2 of 2" in str(report)
