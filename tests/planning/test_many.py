"""Many motions over processes: those of one planner, one after the other."""

import multiprocessing
import os
import pickle
from dataclasses import dataclass

import numpy as np
import pytest

from dhkit.description import library_robot
from dhkit.errors import PlanningError
from dhkit.planning import Constraint, Planner, ToolSpeed

ARM = library_robot("planar2r")
STARTS, GOALS = np.zeros((4, 2)), np.array([[0.5, 0.2], [0.3, -0.4], [9.0, 0.0], [0.4, 0.4]])


def planner(**options):
    return Planner(ARM, intervals=12, **options)


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.slow
def test_motions_and_errors_come_in_order(workers):
    calls = []
    made = planner(constraints=[ToolSpeed(5.0)])
    found = made.solve_many(
        STARTS, GOALS, workers=workers, progress=lambda *done: calls.append(done)
    )
    assert isinstance(found[2], PlanningError) and "goal: joint" in str(found[2])
    for k in (0, 1, 3):
        alone = made.solve(STARTS[k], GOALS[k])
        assert found[k].duration == pytest.approx(alone.duration, rel=1e-9)
        assert found[k].report.certificate.ok
    assert calls == [(k, 4) for k in range(1, 5)]


def test_one_start_serves_all_goals_and_options_are_those_of_solve():
    found = planner(objective="effort").solve_many([0, 0], GOALS[:2], workers=1, duration=2.0)
    assert [motion.duration for motion in found] == [pytest.approx(2.0)] * 2
    poses = np.stack([np.eye(4)] * 2)
    poses[:, :3, 3] = [1.5, 0.3, 0], [1.2, 0.5, 0]
    assert len(planner().solve_many([0, 0.3], poses, workers=1)) == 2


@pytest.mark.slow
def test_each_pair_may_begin_from_a_similar_motion():
    made = planner()
    first = made.solve_many(STARTS, GOALS, workers=1)
    again = made.solve_many(STARTS, GOALS + 1e-3, workers=1, warm=first)
    for cold, warm in zip(made.solve_many(STARTS, GOALS + 1e-3, workers=1), again, strict=True):
        assert isinstance(cold, PlanningError) == isinstance(warm, PlanningError)
        if not isinstance(cold, PlanningError):
            assert warm.duration == pytest.approx(cold.duration, rel=1e-3)
    assert len(made.solve_many(STARTS, GOALS[:1], workers=1, warm=first[0])) == 4
    with pytest.raises(ValueError, match="warm has 2 motions; expected one, or 4"):
        made.solve_many(STARTS, GOALS, workers=1, warm=first[:2])
    with pytest.raises(TypeError, match="warm is str; expected a Trajectory"):
        made.solve_many(STARTS, GOALS, workers=1, warm="ready")


@pytest.mark.parametrize(
    ("starts", "goals", "options", "message"),
    [
        (np.zeros((3, 2)), np.zeros((2, 2)), {}, "goals has 2 places; expected 1 or 3"),
        (np.zeros((3, 3)), np.zeros((3, 2)), {}, r"starts has shape \(3, 3\); expected \(..., 2\)"),
        (np.zeros((0, 2)), np.zeros((0, 2)), {}, r"starts has shape \(0, 2\)"),
        (np.zeros((1, 2)), np.zeros((1, 2)), {"workers": 0}, "workers"),
    ],
)
def test_other_shapes_are_refused(starts, goals, options, message):
    with pytest.raises(ValueError, match=message):
        planner().solve_many(starts, goals, **options)
    with pytest.raises(TypeError, match=r"starts: found .* expected numbers, shape \(..., 2\)"):
        planner().solve_many("ready", goals)


@dataclass(frozen=True)
class Dies(ToolSpeed):
    """A constraint that ends the process that another one started."""

    def rows(self, point, parameters):
        if multiprocessing.parent_process() is not None:
            os._exit(1)
        return super().rows(point, parameters)


@pytest.mark.slow
def test_what_can_go_wrong_with_processes_is_said():
    found = planner(constraints=[Dies(5.0)]).solve_many(STARTS[:2], GOALS[:2], workers=2)
    assert (
        all("its process ended: for want of memory perhaps" in str(error) for error in found)
        and len(found) == 2
    )

    @dataclass(frozen=True)
    class Local(ToolSpeed):
        pass

    with pytest.raises(TypeError, match=r"cannot be sent to other processes .*Local"):
        planner(constraints=[Local(5.0)]).solve_many(STARTS, GOALS, workers=2)
    with pytest.raises(TypeError, match="progress is int; expected a function"):
        planner().solve_many(STARTS, GOALS, workers=1, progress=5)
    bad = GOALS.copy()
    bad[2, 1] = np.nan
    with pytest.raises(ValueError, match=r"goals\[2\] has values that are not finite"):
        planner().solve_many(STARTS, bad, workers=1)


@pytest.mark.slow
def test_an_exception_in_progress_ends_the_rest():
    calls = []

    def stop(done, total):
        calls.append(done)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        planner().solve_many(
            np.zeros((200, 2)), np.tile([[0.5, 0.2]], (200, 1)), workers=2, progress=stop
        )
    assert calls == [1]


def test_an_error_of_a_callers_constraint_is_not_swallowed():
    with pytest.raises(NotImplementedError, match="has no method rows"):
        planner(constraints=[Unfinished()]).solve_many(STARTS[:2], GOALS[:2], workers=1)


class Unfinished(Constraint):
    pass


@pytest.mark.slow
def test_a_planner_is_pickled_without_its_programs():
    made = planner(constraints=[ToolSpeed(5.0)], friction=True)
    made.solve([0, 0], [0.3, 0.1])
    again = pickle.loads(pickle.dumps(made))
    assert (again.intervals, again.friction, again.constraints) == (
        made.intervals,
        made.friction,
        made.constraints,
    )
    assert again.solve([0, 0], [0.3, 0.1]).duration == made.solve([0, 0], [0.3, 0.1]).duration
