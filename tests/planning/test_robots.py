"""The planner on the library's arms: slides, arms of two to seven joints, tables of both conventions."""

import numpy as np
import pytest

from dhkit.description import library_robot, robots
from dhkit.planning import Planner
from dhkit.trajectories import Limits, quintic
from planning_reference import random_pairs, worst_excess

FEW = ("planar2r", "cobra600", "panda")
"""In every run: the smallest, one with a slide, one with seven joints."""


@pytest.mark.slow
@pytest.mark.parametrize("name", robots())
def test_every_robot(law, name):
    arm = library_robot(name)
    samples = law.samples(20)
    if samples < 20 and name not in FEW:
        pytest.skip("in make accept")
    limits, planner = Limits.of(arm), Planner(arm)
    for k, (start, goal) in enumerate(random_pairs(arm, samples if samples == 20 else 1)):
        motion = planner.solve(start, goal)
        for what, excess in worst_excess(arm, motion, limits).items():
            law.holds(f"{what} above its limit", excess, 1e-6, k)
        assert np.abs(motion.q(motion.duration) - goal).max() < 1e-9
        law.holds(
            "duration over the quintic's",
            motion.duration / quintic(arm, start, goal).duration,
            1.0,
            k,
        )
