"""The best motion along a given joint path: optimization of the path parameter s(t)."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Unpack, cast

import numpy as np

from dhkit.description import Array, Description, takes_robot
from dhkit.description.frames import world_to_tool
from dhkit.errors import PlanningError
from dhkit.kernels import check_whole
from dhkit.planning.along.checks import require_holdable_along, require_kept, require_path
from dhkit.planning.along.path_program import MAX_INTERVALS, PathProgram, Profile
from dhkit.planning.along.path_states import PathStates, knots_of
from dhkit.planning.along.timing import SmoothTimingProgram, TimingProgram
from dhkit.planning.certificate import Checker
from dhkit.planning.criteria import Constraint, Objective, ObjectiveLike, loaded
from dhkit.planning.plan_report import report_of
from dhkit.planning.program import ProgressCall, Starts, Task, Work
from dhkit.planning.request import (
    PathKeywords,
    PathOptions,
    checked_constraints,
    checked_limits,
    smoothed,
)
from dhkit.planning.search import TIME_SCALING_MARGIN, MotionSearch, PlannedMotion
from dhkit.symbolic import Friction
from dhkit.trajectories import JointPath, Trajectory
from dhkit.trajectories.timing import check_duration, default_limits

MIN_INTERVALS = 6
"""Smallest number of intervals of a path."""
DEFAULT_INTERVALS = 200
"""Default number of intervals of a path."""
QUICKEST = Objective.of("time")
"""Objective of the fastest motion, from which motions with other objectives start."""
POINTS = 8
"""Number of states in an interval for the certificate; few, because there are many intervals."""
DURATION_FACTOR = 1.5
"""Factor of the duration of other objectives over the fastest motion, for the initial guess."""


@takes_robot
def along_path(
    description: Description,
    path: JointPath,
    *,
    objective: ObjectiveLike = "time",
    constraints: Constraint | Sequence[Constraint] = (),
    intervals: int = DEFAULT_INTERVALS,
    friction: bool | Friction = False,
    options: PathOptions | None = None,
    **keywords: Unpack[PathKeywords],
) -> Trajectory:
    """Return the best motion along a path, from rest to rest, which stays exactly on the path.

    With s(t) of piecewise constant acceleration, or of piecewise linear acceleration under limits of jerk, the motion
    is q(s(t)). Its limits are checked at eight states of each interval, and by parabolas between them, with torques by
    Pinocchio if it is installed. Where limits are exceeded, the grid is refined and limits are tightened or, if a
    thousandth suffices, the motion is slowed down.

    Parameters
    ----------
    description
        The robot; torque limits and objectives of torque need a body on every link.
    path
        A path without corners, such as one of :func:`dhkit.trajectories.joint_path`.
    objective
        ``"time"``, ``"effort"``, ``"energy"``, or a sum such as ``Time() + 0.01 * Effort()``.
    constraints
        Further constraints, such as :class:`dhkit.planning.ToolSpeed`.
    intervals
        Initial number of intervals of s, which take about the same time each.
    friction
        Friction of the joints, as for inverse dynamics; a step is smoothed over 0.01 rad/s.
    options, **keywords
        Fields of :class:`PathOptions`, as one value or one by one: ``duration``, ``limits``, ``payload``,
        ``obstacles``, ``clearance``, ``self_collision``, ``max_iterations``, ``time_limit``, ``progress``.

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
        Another robot's path, an objective that needs a duration, or one of jerk.

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
    chosen = PathOptions.of(options, keywords)
    work = chosen.work()
    check_whole("intervals", intervals, MIN_INTERVALS)
    if intervals > MAX_INTERVALS:
        raise ValueError(
            f"intervals is {intervals!r}; expected a whole number from {MIN_INTERVALS} to {MAX_INTERVALS}"
        )
    if path.description.n != description.n:
        raise ValueError(
            f"the path has {path.description.n} joints; expected {description.n}, those of {description.name}"
        )
    wanted = Objective.of(objective)
    _require_objective(wanted, chosen.duration)
    arm = loaded(description, chosen.payload)
    limits = checked_limits(description, chosen.limits or default_limits(description))
    require_path(arm, path, limits)
    constraints = checked_constraints(constraints)
    avoidance = chosen.avoidance()
    if avoidance:
        avoidance = avoidance.between(description, path.q(0.0), path.q(1.0))
    T_start = world_to_tool(description, path.q(0.0))
    parameters = tuple(constraint.values(description, T_start) for constraint in constraints)
    smooth = smoothed(Friction.chosen(friction))
    still = np.zeros(description.n)
    checker = Checker(arm, limits, constraints, parameters, smooth, avoidance, points=POINTS)
    task = Task(
        description,
        arm,
        wanted,
        path.q([0.0, 1.0]),
        still,
        still,
        chosen.duration,
        checker,
        path=path,
    )
    found = _best_timing(task, intervals, work, chosen.progress)
    report = report_of(task, found, work)
    return replace(
        found.trajectory,
        description=description,
        report=report,
        payload=chosen.payload,
        friction=smooth,
    )


def _best_timing(
    task: Task, intervals: int, work: Work, progress: ProgressCall | None
) -> PlannedMotion:
    """Return the best motion; objectives other than time start from the fastest one."""
    path = cast("JointPath", task.path)
    limits = task.limits
    rough = np.union1d(np.linspace(0.0, 1.0, intervals + 1), path.breaks)
    states = PathStates.of(task.loaded, path, rough)
    s = knots_of(path, intervals, rough, states.even_speeds(limits))

    def searched(
        task: Task, program: PathProgram[Profile], start: Profile | None
    ) -> tuple[PlannedMotion, Profile]:
        search = MotionSearch(task, program, work, progress)
        starts = program.starts(task, None)
        if start is not None:
            starts = Starts([lambda: program.next_guess(start, start), *starts.guesses])
        found = search(starts=starts)
        return found, cast("Profile", search.found)

    def best(kind: Callable[[Task, Array], PathProgram[Profile]]) -> PlannedMotion:
        is_quick = task.objective.only_time and task.duration is None
        quick = task if is_quick else replace(task, objective=QUICKEST, duration=None)
        program = made(kind, quick)
        require_kept(program)
        try:
            found, profile = searched(quick, program, None)
            if is_quick:
                return found
            quickest = found.trajectory.duration
            if task.duration is not None and quickest > task.duration * (1 + TIME_SCALING_MARGIN):
                raise PlanningError(
                    f"{task.duration:.6g} s are too short: the limits allow the motion along the path in "
                    f"{quickest:.6g} s"
                )
            start = profile.lasting(task.duration or DURATION_FACTOR * quickest)
            return searched(task, made(kind, task), start)[0]
        except PlanningError:
            require_holdable_along(program)
            raise

    def made(
        kind: Callable[[Task, Array], PathProgram[Profile]], task: Task
    ) -> PathProgram[Profile]:
        building = time.perf_counter()
        program = kind(task, s)
        work.build_seconds += time.perf_counter() - building
        return program

    return best(SmoothTimingProgram) if np.isfinite(limits.jerk).any() else best(TimingProgram)


def _require_objective(objective: Objective, duration: float | None) -> None:
    check_duration(duration)
    if objective.has_jerk:
        raise ValueError(f"objective is {objective}; expected time, effort or energy along a path")
    if not objective.has_time and duration is None:
        raise ValueError(
            f"objective {objective} says nothing about time; expected duration=, or Time() + ..."
        )
