"""The program of motions between configurations: starts, bounds, and the start of another solution."""

import numpy as np
import pytest

from dhkit.description import library_robot
from dhkit.planning import Planner
from dhkit.planning.certificate import NO_AVOIDANCE
from dhkit.planning.criteria import Limit
from dhkit.planning.program import Margins
from dhkit.planning.program.motion_program import DETOURS
from dhkit.planning.request import PlanRequest
from dhkit.trajectories import Limits


@pytest.fixture(scope="module", params=["planar2r", "puma560"])
def prepared(request):
    """A planner with the task and the program of one motion."""
    arm = library_robot(request.param)
    planner, still = Planner(arm, intervals=12), np.zeros(arm.n)
    wish = PlanRequest(Limits.of(arm), None, still, still, None, NO_AVOIDANCE)
    task = planner._task(wish, np.stack([still, still + 0.4]))
    return task, planner.program(task)[0]


def test_arms_of_few_joints_are_started_more_than_once(prepared):
    task, program = prepared
    starts = program.starts(task, None)
    assert starts.compared == (1 + DETOURS if task.arm.n == 2 else 0)
    for guess in starts.guesses:
        knots = guess()
        np.testing.assert_allclose(knots.q[[0, -1]], task.points, atol=1e-12)
        assert program.next_guess(knots, None) is knots


def test_margins_narrow_the_bounds_of_their_intervals(prepared):
    task, program = prepared
    guess = program.starts(task, None).guesses[0]()
    n, at = task.arm.n, program.problem.variables
    more = np.zeros((program.intervals, n))
    more[5, 0] = 0.25
    margins = Margins(program.intervals).raised({Limit.VELOCITY: more, Limit.POSITION: more})
    low, high = program.arguments(task, guess, margins).bounds
    speed = task.limits.velocity[0]
    np.testing.assert_allclose(high[at.qd[0, [4, 5, 6, 7]]], speed * np.array([1, 0.75, 0.75, 1]))
    assert (low[at.q[0, 5]] > task.limits.lower[0]) == bool(np.isfinite(task.limits.lower[0]))
    assert high[at.q[0, 4]] == task.limits.upper[0]
