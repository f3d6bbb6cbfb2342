"""Search for a certified motion along a path: solve, check, slow down or refine and tighten, solve again."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dhkit.description import Array
from dhkit.errors import PlanningError
from dhkit.planning.along.checks import refuse
from dhkit.planning.along.timing_task import TimingTask
from dhkit.planning.certificate import Certificate
from dhkit.planning.costs import cost_of
from dhkit.planning.search import FEASIBILITY_TOLERANCE, MARGIN_FACTOR, TIME_SCALING_MARGIN
from dhkit.planning.solver import Progress, ProgressCall, Solution, Stopped
from dhkit.planning.states import States
from dhkit.trajectories import Trajectory

MAX_INTERVALS = 2000
"""Largest number of requested intervals; after refinement there may be twice as many."""
SMALL_STEP = 1e-3
"""Relative slow-down up to which a solution is slowed down; beyond it, its limits are tightened."""
MAX_RESERVED_SHARE = 0.95
"""Largest share of a limit that margins reserve."""
MAX_ROUNDS = 5
"""Largest number of solutions."""
LAST_STEP, MAX_SLOW_DOWNS = 1.0, 5
"""Largest relative slow-down after the last round, and largest number of steps to determine a slow-down."""
DURATION_FACTOR = 1.5
"""Factor of the duration of other objectives over the fastest motion, for the initial guess."""


@dataclass(frozen=True, eq=False)
class TimedMotion:
    """A certified motion along a path, with its cost and the work of finding it."""

    trajectory: Trajectory
    knots: Array
    """Path parameters of the grid, shape (K+1,)."""
    b: Array
    """Squared path speeds at the knots, shape (K+1,), 1/s^2."""
    certificate: Certificate
    slow_down: float
    tightened: tuple[str, ...]
    iterations: int
    solves: int


def solve_steps(task: TimingTask, deadline: float, progress: ProgressCall | None) -> list[TimedMotion]:
    """Return the motions of a task's steps, the last one first."""
    found: list[TimedMotion] = []
    for step in task.steps:
        found.insert(0, _solve_step(step, found[0] if found else None, deadline, progress))
        quickest = found[-1].trajectory.duration
        if task.duration is not None and quickest > task.duration * (1 + TIME_SCALING_MARGIN):
            raise PlanningError(
                f"{task.duration:.6g} s are too short: the limits allow the motion along the path in {quickest:.6g} s"
            )
    return found


def _solve_step(
    task: TimingTask, quickest: TimedMotion | None, deadline: float, progress: ProgressCall | None
) -> TimedMotion:
    """Return a certified motion; where limits are exceeded between knots, the grid is refined or limits tightened."""
    if quickest is None:
        unit = task.usual_duration()
        b = (np.pi / unit) ** 2 * task.knots * (1 - task.knots)
    else:
        unit = task.duration or DURATION_FACTOR * quickest.trajectory.duration
        b = np.interp(task.knots, quickest.knots, quickest.b) * (quickest.trajectory.duration / unit) ** 2
    cost = 1.0 if task.terms is None else cost_of(task.objective, task.motion(b)[0], task.description)
    reserved: dict[str, Array] = {}
    tightened: list[str] = []
    iterations = 0

    def report_progress(now: Progress) -> object:
        return progress and progress(replace(now, iteration=iterations + now.iteration, duration=now.duration * unit))

    for solves in range(1, MAX_ROUNDS + 1):
        solution = _solution(task, reserved, b, unit, cost, deadline, None if progress is None else report_progress)
        iterations += solution.iterations
        b = task.program.squares(solution.x) / unit**2
        trajectory, ends = task.motion(b)
        slowed_motion = _slow_down_to_limits(task, trajectory, LAST_STEP if solves == MAX_ROUNDS else SMALL_STEP)
        if slowed_motion is not None:
            slower, certificate, c = slowed_motion
            return TimedMotion(slower, task.knots, b / c**2, certificate, c, tuple(tightened), iterations, solves)
        states = task.checker.states(trajectory)
        excess = excesses(task, states, trajectory.breaks, ends)
        tightened += [what for what, share in excess.items() if (share > 0).any() and what not in tightened]
        knots = task.knots
        task, reserved = _refine_or_reserve(task, reserved, excess)
        b = np.interp(task.knots, knots, b)
    worst = max(task.checker.check(trajectory, states).checks, key=lambda check: check.excess)
    raise PlanningError(f"{worst.what} stays exceeded by {100 * worst.excess:.2g} % at {worst.time:.4g} s")


def _solution(
    task: TimingTask,
    reserved: dict[str, Array],
    b: Array,
    unit: float,
    cost: float,
    deadline: float,
    progress: ProgressCall | None,
) -> Solution:
    """Return the solution of a task's program from b at its knots, scaled by a unit of time (s) and a cost."""
    program = task.program
    parameters = program.parameters(task.states, task.rows, unit, 1 / cost)
    durations = (0.0, np.inf)
    low, high = (program.numbers(*pair) for pair in zip(durations, task.b_bounds(reserved, unit), strict=True))
    rows = task.g_bounds(reserved)
    speed = np.sqrt(b) * unit
    start = program.numbers(2 * task.states.steps / (speed[:-1] + speed[1:]), b[1:-1] * unit**2)
    try:
        solution = program.solver(start, parameters, (low, high), rows, deadline, progress)
    except Stopped:
        raise PlanningError("no motion along the path was found within the time limit") from None
    if not solution.converged or solution.infeasibility > FEASIBILITY_TOLERANCE:
        refuse(task, solution, rows)
    return solution


def _slow_down_to_limits(
    task: TimingTask, trajectory: Trajectory, max_slow_down: float
) -> tuple[Trajectory, Certificate, float] | None:
    """Return a motion slowed down to its limits, its certificate and factor; None beyond 1 + ``max_slow_down``."""
    c = 1.0
    for _ in range(MAX_SLOW_DOWNS):
        slower = trajectory if c == 1.0 else trajectory.slowed(c)
        states = task.checker.states(slower)
        over = max((float(use.max()) - 1 for _, use in task.checker.peaks(states)), default=0.0)
        if over <= TIME_SCALING_MARGIN:
            certificate = task.checker.check(slower, states)
            return (slower, certificate, c) if certificate.ok else None
        if task.duration is not None:
            return None
        step = task.checker.slow_down(states)
        c *= step * (1 + TIME_SCALING_MARGIN) if step > 1 else 1 + 2 * over
        if not c <= 1 + max_slow_down:
            return None
    return None


def _refine_or_reserve(
    task: TimingTask, reserved: dict[str, Array], excess: dict[str, Array]
) -> tuple[TimingTask, dict[str, Array]]:
    """Return a task with intervals halved where limits are exceeded most, and the reserved shares elsewhere."""
    is_refined = np.any([(share > SMALL_STEP).any(axis=1) for share in excess.values()], axis=0)
    if task.intervals + is_refined.sum() > 2 * MAX_INTERVALS:
        is_refined[:] = False
    copies, reserved_shares = 1 + is_refined, {}
    for what, share in excess.items():
        # The excess inside an interval is proportional to the square of its length.
        more = MARGIN_FACTOR * share / np.where(is_refined, 4, 1)[:, None]
        total = np.minimum(task.shares(reserved, what, share.shape[1]) + more, MAX_RESERVED_SHARE)
        reserved_shares[what] = np.repeat(total, copies, axis=0)
    return task.halved(is_refined) if is_refined.any() else task, reserved_shares


def excesses(task: TimingTask, states: States, breaks: Array, ends: Array) -> dict[str, Array]:
    """Return the excess of each kind of limit in each interval, shape (K, rows), without unit (over the limit)."""
    # Breaks of the trajectory lie between those of the grid.
    interval = np.clip(np.searchsorted(ends, (breaks[1:] + breaks[:-1]) / 2) - 1, 0, task.intervals - 1)
    found = {}
    for what, use in task.checker.peaks(states):
        over = use.reshape(len(interval), -1, use.shape[1]).max(axis=1) - 1
        found[what] = np.zeros((task.intervals, use.shape[1]))
        np.maximum.at(found[what], interval, over)
    return found
