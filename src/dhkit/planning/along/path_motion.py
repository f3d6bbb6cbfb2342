"""The best motion along a given joint path: optimization of the path parameter s(t)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

from dhkit.description import Description, Payload, takes_robot
from dhkit.kernels import check_whole
from dhkit.planning.along.checks import require_kept, require_path
from dhkit.planning.along.search import MAX_INTERVALS, solve_steps
from dhkit.planning.along.timing_task import TimingTask
from dhkit.planning.constraints import Constraint
from dhkit.planning.costs import cost_of
from dhkit.planning.objectives import Effort, Objective, ObjectiveLike, Time
from dhkit.planning.report import PlanReport
from dhkit.planning.request import checked_limits
from dhkit.planning.solver import ProgressCall
from dhkit.trajectories import JointPath, Limits, Trajectory
from dhkit.trajectories.timing import check_duration, default_limits

MIN_INTERVALS = 6
"""Smallest number of intervals."""


@takes_robot
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
    payload: Payload | None = None,
) -> Trajectory:
    """Return the best motion along a path, from rest to rest, which stays exactly on the path.

    With s(t) of piecewise constant acceleration the motion is q(s(t)). Its limits are checked at eight states of each
    interval, and by parabolas between them, with torques by Pinocchio if it is installed. Where limits are exceeded,
    the grid is refined and limits are tightened or, if a thousandth suffices, the motion is slowed down.

    Parameters
    ----------
    description
        The robot; torque limits and objectives of torque need a body on every link.
    path
        A path without corners, such as one of :func:`dhkit.trajectories.joint_path`.
    objective
        ``"time"``, ``"effort"``, or a sum such as ``Time() + 0.01 * Effort()``.
    duration
        Duration, s; required for objectives without time.
    limits
        Limits; the robot's own if not given. Jerk is infinite at the intervals' ends and cannot be limited.
    constraints
        Further constraints, such as :class:`dhkit.planning.ToolSpeed`.
    intervals
        Initial number of intervals of s, which take about the same time each.
    time_limit
        Time limit of all solutions together, s.
    progress
        Called once in each iteration.
    payload
        Payload of the tool.

    Returns
    -------
    Trajectory
        The motion; its ``report`` is a :class:`dhkit.planning.PlanReport`.

    Raises
    ------
    PlanningError
        The path leaves the joint limits, has a corner, stands still or is singular; the arm cannot hold itself
        somewhere on it; no motion keeps the limits, or none was found in time. Names the limit and the place.
    ValueError
        Another robot's path, an objective that needs a duration, or one of energy or jerk.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> path = JointPath.straight(arm, [0.2, 1.2], [0.7, 0.2])
    >>> motion = along_path(arm, path, intervals=50)
    >>> motion.report.certificate.ok
    True
    >>> slow = along_path(arm, path, objective="effort", duration=2 * motion.duration, intervals=50)
    >>> bool(abs(slow.q(slow.duration) - [0.7, 0.2]).max() < 1e-9)
    True
    """
    began = time.perf_counter()
    check_whole("intervals", intervals, MIN_INTERVALS)
    if intervals > MAX_INTERVALS:
        raise ValueError(f"intervals is {intervals!r}; expected a whole number from {MIN_INTERVALS} to {MAX_INTERVALS}")
    if path.description.n != description.n:
        raise ValueError(
            f"the path has {path.description.n} joints; expected {description.n}, those of {description.name}"
        )
    wanted = Objective.of(objective)
    _require_objective(wanted, duration)
    limits = checked_limits(description, limits or default_limits(description))
    loaded = description if payload is None else payload.carried(description)
    require_path(loaded, path, limits)
    task = TimingTask.of(loaded, path, wanted, duration, limits, tuple(constraints), intervals)
    require_kept(task)
    building = time.perf_counter()
    for step in task.steps:
        _ = step.program
    built = time.perf_counter() - building
    found, *before = solve_steps(task, began + time_limit, progress)
    cost = cost_of(wanted, found.trajectory, loaded)
    report = PlanReport(
        objective=str(wanted),
        cost=cost,
        duration=found.trajectory.duration,
        certificate=found.certificate,
        joints=tuple(joint.name for joint in description.joints),
        intervals=len(found.knots) - 1,
        iterations=found.iterations + sum(each.iterations for each in before),
        solves=found.solves + sum(each.solves for each in before),
        build_seconds=built,
        solve_seconds=time.perf_counter() - began - built,
        slow_down=found.slow_down,
        tightened=found.tightened,
        unlimited=limits.unlimited,
    )
    return replace(found.trajectory, description=description, report=report, payload=payload)


def _require_objective(objective: Objective, duration: float | None) -> None:
    check_duration(duration)
    if not all(isinstance(term, Time | Effort) for term in objective.terms):
        raise ValueError(f"objective is {objective}; expected time and effort along a path")
    if not objective.has_time and duration is None:
        raise ValueError(f"objective {objective} says nothing about time; expected duration=, or Time() + ...")
