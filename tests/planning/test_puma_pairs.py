"""A PUMA between random configurations: certified, near to the best, faster than the straight path's best timing."""

import numpy as np
import pytest

from acceptance import only_accepting
from dhkit.description import library_robot
from dhkit.planning import Planner
from dhkit.trajectories import Limits
from planning_reference import random_pairs, toppra_duration, worst_excess

PUMA = library_robot("puma560")
FINER = 4
ALLOWED = 1e-6
"""Of a limit."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("speed", "near"), [(1.0, 0.005), pytest.param(3.0, 0.01, marks=only_accepting)]
)
def test_pairs(law, speed, near):
    pairs = random_pairs(PUMA, law.samples(100, quick=3), seed=int(speed))
    limits = Limits.of(PUMA).scaled(velocity=speed)
    planner = Planner(PUMA, limits=limits)
    fine = Planner(PUMA, limits=limits, intervals=FINER * planner.intervals)
    seconds, gains = [], []
    for k, (start, goal) in enumerate(pairs):
        motion = planner.solve(start, goal)
        if not k:
            law.takes(f"seconds to build, speeds x {speed:g}", motion.report.build_seconds, 1.5)
        seconds.append(motion.report.solve_seconds)
        assert np.abs(motion.q(0.0) - start).max() == 0
        assert np.abs(motion.q(motion.duration) - goal).max() < 1e-9
        for what, excess in worst_excess(PUMA, motion, limits).items():
            law.holds(f"{what} above its limit, speeds x {speed:g}", excess, ALLOWED, k)
        best = fine.solve(start, goal, warm=motion).duration
        law.holds(
            f"duration over that of a mesh {FINER} times finer, speeds x {speed:g}",
            motion.duration / best - 1,
            near,
            k,
        )
        straight = toppra_duration(PUMA, start, goal, limits)
        law.holds(
            f"duration over toppra's along the straight path, speeds x {speed:g}",
            motion.duration / straight,
            1.005,
            k,
        )
        gains.append(straight / motion.duration - 1)
    law.takes(f"median seconds a solve, speeds x {speed:g}", np.median(seconds), 0.2)
    law.takes(f"95 % of solves, seconds, speeds x {speed:g}", np.quantile(seconds, 0.95), 0.5)
    print(
        f"\n  toppra takes {100 * np.mean(gains):.2f} % longer on average, {100 * max(gains):.1f} % at most",
        end="",
    )


@only_accepting
@pytest.mark.slow
def test_a_mesh_counts_for_little():
    start, goal = random_pairs(PUMA, 1, seed=7)[0]
    motion = Planner(PUMA).solve(start, goal, compare=True)
    intervals, cost = motion.report.coarse
    assert intervals == 24
    assert 0 <= motion.report.sensitivity < 0.01
    assert cost >= motion.duration
