"""The best motion along a given joint path: only when it is where remains to be found."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from dhkit.description import Array, Description
from dhkit.errors import PlanningError
from dhkit.planning.certificate import Certificate, Checker
from dhkit.planning.constraints import Constraint, ToolAcceleration, ToolSpeed
from dhkit.planning.costs import cost_of
from dhkit.planning.feasibility import require_bounded, require_holdable
from dhkit.planning.mesh import graded
from dhkit.planning.objectives import Objective, ObjectiveLike
from dhkit.planning.report import PlanReport
from dhkit.planning.solver import Progress, ProgressCall, Solution, Stopped
from dhkit.planning.states import States
from dhkit.planning.timing_program import (
    SMALLEST,
    PathStates,
    Terms,
    TimingProgram,
    TimingRows,
    speed_bounds,
    timing_program,
)
from dhkit.trajectories import JointPath, Limits, Trajectory
from dhkit.trajectories.timing import default_limits

__all__ = ["along_path"]

FEASIBLE = 1e-5
"""What a solution's rows may miss at most to be taken: the certificate decides about the rest."""
SMALL_STEP = 1e-3
"""A solution that needs less of a slow-down is slowed down; else its limits are tightened first."""
WIDER = 1.1
"""What an excess is multiplied by to be the next margin."""
MOST_RESERVED = 0.95
"""Share of a limit that margins take at most."""
ROUNDS = 5
"""How often limits are tightened at most."""
SLACK = 2e-7
"""What a slow-down adds, for what lies between the certificate's states."""
POINTS = 8
"""States an interval by which a motion is certified: intervals are many."""
CORNER = 1e-6
"""Share of the largest derivative by which it may jump: rounding."""
STANDS_STILL, TOO_STEEP = 1e-6, 1e4
"""Of the path's mean derivative: below the one the path stands still, above the other it is singular."""
OUTSIDE = 1e-9
"""rad and m: how far rounding may lead out of the joint limits."""
ROOM = 0.5
"""Share of the greatest speed at which a guess goes along its path."""


def along_path(
    description: Description,
    path: JointPath,
    *,
    objective: ObjectiveLike = "time",
    duration: float | None = None,
    limits: Limits | None = None,
    constraints: Sequence[Constraint] = (),
    intervals: int = 200,
    time_limit: float = 10.0,
    progress: ProgressCall | None = None,
) -> Trajectory:
    """Return the best motion along a path, from rest to rest; it stays on the path exactly.

    With s(t) of piecewise constant acceleration the motion is q(s(t)). Its limits are checked at eight states of each
    interval by Pinocchio, where that is installed; ``report`` says how near it comes to them.

    Parameters
    ----------
    description
        The robot; torque limits and objectives of torque need a body on every link.
    path
        Of :func:`dhkit.trajectories.joint_path`, say. It must not have corners.
    objective
        ``"time"``, ``"effort"``, ``"energy"``, a term such as ``Time()``, or a sum such as
        ``Time() + 0.01 * Effort()``.
    duration
        In s; needed where the time does not count.
    limits
        The robot's own if not given. Jerk is infinite at the intervals' ends and cannot be limited.
    constraints
        What else must be kept: :class:`dhkit.planning.ToolSpeed` and the like.
    intervals
        Of s; they are finer at the path's ends.
    time_limit
        For all solutions together, s.
    progress
        Called once an iteration.

    Returns
    -------
    Trajectory
        Its ``report`` is a :class:`dhkit.planning.PlanReport`.

    Raises
    ------
    PlanningError
        The path leaves the joint limits, has a corner, stands still or is singular; the arm cannot hold itself
        somewhere on it; no motion keeps the limits, or none was found in time. Names the limit and the place.
    ValueError
        Another robot's path, an objective that needs a duration, or one of jerk.
    """
    began = time.perf_counter()
    if isinstance(intervals, bool) or not isinstance(intervals, int) or not 6 <= intervals <= 2000:
        raise ValueError(f"intervals is {intervals!r}; expected a whole number from 6 to 2000")
    if path.description.n != description.n:
        raise ValueError(f"the path has {path.description.n} joints; expected {description.n}, those of {description.name}")
    wanted = Objective.of(objective)
    _require_objective(wanted, duration)
    task = _Task.of(description, path, wanted, duration, limits or default_limits(description), tuple(constraints), intervals)
    task.require()
    built = time.perf_counter()
    program = timing_program(len(task.knots) - 1, sum(row.rest.shape[-1] for row in task.rows), task.terms)
    ready = time.perf_counter()
    found = _certified(task, program, began + time_limit, progress)
    report = PlanReport(
        objective=str(wanted),
        cost=cost_of(wanted, found.trajectory, description),
        duration=found.trajectory.duration,
        certificate=found.certificate,
        joints=tuple(joint.name for joint in description.joints),
        intervals=program.intervals,
        iterations=found.iterations,
        solves=found.solves,
        build_seconds=ready - built,
        solve_seconds=time.perf_counter() - began - (ready - built),
        slow_down=found.slow_down,
        tightened=found.tightened,
    )
    return replace(found.trajectory, report=report)


@dataclass(frozen=True, eq=False)
class _Task:
    """A path, what its motion must keep, and both on a grid."""

    description: Description
    path: JointPath
    objective: Objective
    duration: float | None
    limits: Limits
    constraints: tuple[Constraint, ...]
    checker: Checker
    knots: Array
    states: PathStates
    rows: list[TimingRows]
    terms: Terms | None

    @classmethod
    def of(
        cls,
        description: Description,
        path: JointPath,
        objective: Objective,
        duration: float | None,
        limits: Limits,
        constraints: tuple[Constraint, ...],
        intervals: int,
    ) -> _Task:
        """Work a path out on a grid."""
        others = tuple(c for c in constraints if c.moving and not isinstance(c, ToolSpeed))
        needs_torque = objective.needs_torque or any(c.needs_torque for c in constraints)
        knots = _knots(path, intervals)
        states = PathStates.of(
            description,
            path,
            knots,
            torque=bool(np.isfinite(limits.torque).any()) or needs_torque,
            tool=any(isinstance(c, ToolSpeed | ToolAcceleration) for c in constraints),
        )
        rows = [
            TimingRows.of("torque", states, states.m, states.c, states.g, limits.torque),
            TimingRows.of("acceleration", states, states.qs, states.qss, 0 * states.q, limits.acceleration),
        ]
        start = States(description, np.zeros(1), *(np.reshape(x, (1, -1)) for x in (path.q(0.0), still, still)))
        T_start = start.T_world_tool[0] if constraints else np.eye(4)
        parameters = tuple(constraint.values(description, T_start) for constraint in constraints)
        checker = Checker(description, limits, constraints, parameters)
        terms = Terms.of(description, objective, others, limits)
        return cls(description, path, objective, duration, limits, constraints, checker, knots, states, rows, terms)
