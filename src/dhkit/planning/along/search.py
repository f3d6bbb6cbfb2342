"""From a path to a certified motion along it: solve, check, slow down, or refine and tighten, solve again."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dhkit.description import Array
from dhkit.errors import PlanningError
from dhkit.planning.along.checks import refuse
from dhkit.planning.along.timing_task import TimingTask
from dhkit.planning.certificate import Certificate
from dhkit.planning.costs import cost_of
from dhkit.planning.search import FEASIBLE, SLACK, WIDER
from dhkit.planning.solver import Progress, ProgressCall, Solution, Stopped
from dhkit.planning.states import States
from dhkit.trajectories import Trajectory

MOST = 2000
"""Intervals that may be asked for; refined they may be twice as many."""
SMALL_STEP = 1e-3
"""A solution that needs less of a slow-down is slowed down; else its limits are tightened first."""
MOST_RESERVED = 0.95
"""Share of a limit that margins take at most."""
ROUNDS = 5
"""How often limits are tightened at most."""
LAST_STEP, TRIES = 1.0, 5
"""What a slow-down may cost after the last round, and how many it may take to find it."""
LONGER = 1.5
"""By what factor a motion of another objective is guessed to take longer than the quickest."""


@dataclass(frozen=True, eq=False)
class Found:
    """A certified motion, and what it took."""

    trajectory: Trajectory
    knots: Array
    """Shape (K+1,)."""
    b: Array
    """At the knots, 1/s^2."""
    certificate: Certificate
    slow_down: float
    tightened: tuple[str, ...]
    iterations: int
    solves: int


def solved(task: TimingTask, deadline: float, progress: ProgressCall | None) -> list[Found]:
    """Return what each step of a task has found, the last one first."""
    found: list[Found] = []
    for step in task.steps:
        found.insert(0, _certified(step, found[0] if found else None, deadline, progress))
        quickest = found[-1].trajectory.duration
        if task.duration is not None and quickest > task.duration * (1 + SLACK):
            raise PlanningError(
                f"{task.duration:.6g} s are too short: the limits allow the motion along the path in {quickest:.6g} s"
            )
    return found


def _certified(task: TimingTask, quickest: Found | None, deadline: float, progress: ProgressCall | None) -> Found:
    """Return a certified motion: where limits are missed between the grid's knots, it is refined or tightened."""
    if quickest is None:
        unit = task.usual_duration()
        b = (np.pi / unit) ** 2 * task.knots * (1 - task.knots)
    else:
        unit = task.duration or LONGER * quickest.trajectory.duration
        b = np.interp(task.knots, quickest.knots, quickest.b) * (quickest.trajectory.duration / unit) ** 2
    cost = 1.0 if task.terms is None else cost_of(task.objective, task.motion(b)[0], task.description)
    reserved: dict[str, Array] = {}
    tightened: list[str] = []
    iterations = 0

    def told(now: Progress) -> object:
        return progress and progress(replace(now, iteration=iterations + now.iteration, duration=now.duration * unit))

    for solves in range(1, ROUNDS + 1):
        solution = _solution(task, reserved, b, unit, cost, deadline, None if progress is None else told)
        iterations += solution.iterations
        b = task.program.squares(solution.x) / unit**2
        trajectory, ends = task.motion(b)
        made = _made_good(task, trajectory, LAST_STEP if solves == ROUNDS else SMALL_STEP)
        if made is not None:
            slower, certificate, c = made
            return Found(slower, task.knots, b / c**2, certificate, c, tuple(tightened), iterations, solves)
        states = task.checker.states(trajectory)
        excess = excesses(task, states, trajectory.breaks, ends)
        tightened += [what for what, share in excess.items() if (share > 0).any() and what not in tightened]
        knots = task.knots
        task, reserved = _wider(task, reserved, excess)
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
    """Solve a task's program from b at its knots, in units of a time and a cost."""
    program = task.program
    parameters = program.parameters(task.states, task.rows, unit, 1 / cost)
    durations = (0.0, np.inf) if task.duration is None else (1.0, 1.0)
    low, high = (program.numbers(*pair) for pair in zip(durations, task.b_bounds(reserved, unit), strict=True))
    rows = task.g_bounds(reserved)
    start = program.numbers(1.0, b[1:-1] * unit**2)
    try:
        solution = program.solver(start, parameters, (low, high), rows, deadline, progress)
    except Stopped:
        raise PlanningError("no motion along the path was found within the time limit") from None
    if not solution.converged or solution.infeasibility > FEASIBLE:
        refuse(task, solution, rows)
    return solution


def _made_good(task: TimingTask, trajectory: Trajectory, most: float) -> tuple[Trajectory, Certificate, float] | None:
    """Return a motion slowed down until it keeps its limits, its certificate and by what; None beyond ``most``."""
    c = 1.0
    for _ in range(TRIES):
        slower = trajectory if c == 1.0 else trajectory.slowed(c)
        states = task.checker.states(slower)
        over = max((float(use.max()) - 1 for _, use in task.checker.peaks(states)), default=0.0)
        if over <= SLACK:
            certificate = task.checker.check(slower, states)
            return (slower, certificate, c) if certificate.ok else None
        if task.duration is not None:
            return None
        step = task.checker.slow_down(states)
        c *= step * (1 + SLACK) if step > 1 else 1 + 2 * over
        if not c <= 1 + most:
            return None
    return None


def _wider(
    task: TimingTask, reserved: dict[str, Array], excess: dict[str, Array]
) -> tuple[TimingTask, dict[str, Array]]:
    """Return a task with intervals halved where limits are exceeded much, and what to keep in reserve elsewhere."""
    much = np.any([(share > SMALL_STEP).any(axis=1) for share in excess.values()], axis=0)
    if task.intervals + much.sum() > 2 * MOST:
        much[:] = False
    copies, wider = 1 + much, {}
    for what, share in excess.items():
        # What is missed inside an interval falls with its length squared.
        more = WIDER * share / np.where(much, 4, 1)[:, None]
        total = np.minimum(task.shares(reserved, what, share.shape[1]) + more, MOST_RESERVED)
        wider[what] = np.repeat(total, copies, axis=0)
    return task.halved(much) if much.any() else task, wider


def excesses(task: TimingTask, states: States, breaks: Array, ends: Array) -> dict[str, Array]:
    """Return by what share each kind of limit is exceeded in each interval of the grid, shape (K, rows)."""
    # Breaks of the path lie between those of the grid.
    interval = np.clip(np.searchsorted(ends, (breaks[1:] + breaks[:-1]) / 2) - 1, 0, task.intervals - 1)
    found = {}
    for what, use in task.checker.peaks(states):
        over = use.reshape(len(interval), -1, use.shape[1]).max(axis=1) - 1
        found[what] = np.zeros((task.intervals, use.shape[1]))
        np.maximum.at(found[what], interval, over)
    return found
