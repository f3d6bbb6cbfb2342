"""The best motion along a given joint path: only when it is where remains to be found."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dhkit.description import Array, Description, world_to_tool
from dhkit.errors import PlanningError
from dhkit.kernels import check_whole
from dhkit.planning.certificate import Certificate, Checker
from dhkit.planning.constraints import Constraint
from dhkit.planning.costs import cost_of
from dhkit.planning.feasibility import require_holdable, unit_of
from dhkit.planning.objectives import Effort, Objective, ObjectiveLike, Time
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
from dhkit.planning.tool_constraints import ToolAcceleration, ToolSpeed
from dhkit.trajectories import JointPath, Limits, Trajectory
from dhkit.trajectories.timing import check_duration, default_limits

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
LAST_STEP, TRIES = 1.0, 5
"""What a slow-down may cost after the last round, and how many it may take to find it."""
SLACK = 2e-7
"""By what share of a limit a motion may exceed it, and what a slow-down adds."""
POINTS = 8
"""States an interval by which a motion is certified: intervals are many."""
CORNER = 1e-6
"""Share of the largest derivative by which it may jump: rounding."""
STANDS_STILL, TOO_STEEP = 1e-6, 1e4
"""Of the path's mean derivative: below the one the path stands still, above the other it is singular."""
EVENLY, TINY = 0.3, 1e-12
"""Share of knots that lie evenly, and a time that nothing takes, s."""
FEWEST, MOST = 6, 2000
"""Intervals."""
OUTSIDE = 1e-9
"""rad and m: how far rounding may lead out of the joint limits."""
QUICKEST = Objective.of("time")
LONGER = 1.5
"""By what factor a motion of another objective is guessed to take longer than the quickest."""
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
    interval, and by parabolas between them, with torques by Pinocchio where that is installed; where they are missed
    the grid is refined, limits are tightened or, for less than a thousandth, the motion is slowed down.

    Parameters
    ----------
    description
        The robot; torque limits and objectives of torque need a body on every link.
    path
        Of :func:`dhkit.trajectories.joint_path`, say. It must not have corners.
    objective
        ``"time"``, ``"effort"``, or a sum such as ``Time() + 0.01 * Effort()``.
    duration
        In s; needed where the time does not count.
    limits
        The robot's own if not given. Jerk is infinite at the intervals' ends and cannot be limited.
    constraints
        What else must be kept: :class:`dhkit.planning.ToolSpeed` and the like.
    intervals
        Of s, at first; they take about the same time each.
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
        Another robot's path, an objective that needs a duration, or one of energy or jerk.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> path = JointPath(arm, [0, 1], [[[0.2, 1.2], [0.5, -1.0]]])
    >>> motion = along_path(arm, path, intervals=50)
    >>> motion.report.certificate.ok
    True
    >>> slow = along_path(arm, path, objective="effort", duration=2 * motion.duration, intervals=50)
    >>> bool(abs(slow.q(slow.duration) - [0.7, 0.2]).max() < 1e-9)
    True
    """
    began = time.perf_counter()
    check_whole("intervals", intervals, FEWEST)
    if intervals > MOST:
        raise ValueError(f"intervals is {intervals!r}; expected a whole number from {FEWEST} to {MOST}")
    if path.description.n != description.n:
        raise ValueError(
            f"the path has {path.description.n} joints; expected {description.n}, those of {description.name}"
        )
    wanted = Objective.of(objective)
    _require_objective(wanted, duration)
    limits = limits or default_limits(description)
    task = _Task.of(description, path, wanted, duration, limits, tuple(constraints), intervals)
    _require_kept(task)
    building = time.perf_counter()
    for step in task.steps:
        _ = step.program
    built = time.perf_counter() - building
    found, *before = _solved(task, began + time_limit, progress)
    cost = cost_of(wanted, found.trajectory, description)
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
    checker: Checker
    needs: dict[str, bool]
    """What is asked of :class:`PathStates`."""
    states: PathStates
    rows: list[TimingRows]
    terms: Terms | None
    quickest_terms: Terms | None
    """Those of the constraints alone."""

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
        """Work a path out on a grid, where there can be a motion along it."""
        _require_path(description, path, limits)
        needed = (objective.needs_torque, *(constraint.needs_torque for constraint in constraints))
        torque = any((*needed, *np.isfinite(limits.torque)))
        tool = any(isinstance(constraint, ToolSpeed | ToolAcceleration) for constraint in constraints)
        needs = {"torque": torque, "tool": tool}
        rough = np.union1d(np.linspace(0.0, 1.0, intervals + 1), path.breaks)
        states = PathStates.of(description, path, rough, **needs)
        knots = _knots(path, intervals, rough, _even_speeds(states, limits, constraints))
        states = PathStates.of(description, path, knots, **needs)
        rows = _rows(states, limits)
        T_start = world_to_tool(description, path.q(0.0)) if constraints else np.eye(4)
        parameters = tuple(constraint.values(description, T_start) for constraint in constraints)
        others = tuple(c for c in constraints if c.moving and not isinstance(c, ToolSpeed))
        checker = Checker(description, limits, constraints, parameters)
        terms, quickest = (Terms.of(description, wanted, others, limits) for wanted in (objective, QUICKEST))
        return cls(description, path, objective, duration, limits, checker, needs, states, rows, terms, quickest)

    @property
    def intervals(self) -> int:
        """Of the grid."""
        return len(self.states.steps)

    @property
    def knots(self) -> Array:
        """Where the grid's intervals end, shape (K+1,)."""
        return np.append(self.states.s[0], 1.0)

    @property
    def still(self) -> States:
        """The arm at rest at the grid's ends of intervals."""
        q = self.states.q.reshape(-1, self.description.n)
        return States(self.description, self.states.s.ravel(), q, 0 * q, 0 * q)

    def shares(self, reserved: dict[str, Array], what: str, count: int) -> Array:
        """Return what is kept in reserve of a limit in each interval, shape (K, count)."""
        return reserved.get(what, np.zeros((self.intervals, count)))

    def largest_b(self, reserved: dict[str, Array]) -> Array:
        """Return the bounds of b by limits of speed, shape (K+1,)."""
        tools = [(tool, self.shares(reserved, tool.what, 1)) for tool in _tool_speeds(self.checker.constraints)]
        return speed_bounds(self.states, self.limits, self.shares(reserved, "velocity", self.description.n), tools)

    @property
    def program(self) -> TimingProgram:
        """The program that it asks for; made once."""
        return timing_program(self.intervals, sum(int(row.limited.sum()) for row in self.rows), self.terms)

    def halved(self, which: Array) -> _Task:
        """Return the task on a grid some of whose intervals (K,) are halved."""
        middles = (self.knots[1:] + self.knots[:-1])[which] / 2
        knots = np.sort(np.concatenate([self.knots, middles]))
        states = PathStates.of(self.description, self.path, knots, **self.needs)
        return replace(self, states=states, rows=_rows(states, self.limits))

    @property
    def steps(self) -> list[_Task]:
        """The tasks that are solved one after another: the quickest motion is where others start from."""
        if self.objective.only_time and self.duration is None:
            return [self]
        return [replace(self, objective=QUICKEST, duration=None, terms=self.quickest_terms), self]

    def usual_duration(self) -> float:
        """Return about how long the motion takes, s: that of b = beta 4 s (1 - s), pi / (2 sqrt beta)."""
        shape = 4 * self.knots * (1 - self.knots)
        with np.errstate(divide="ignore"):
            beta = min(float(np.min(self.largest_b({}) / shape)), *(row.largest(shape) for row in self.rows))
        return float(np.pi / (2 * np.sqrt(ROOM * beta)))

    def b_bounds(self, reserved: dict[str, Array], unit: float) -> tuple[Array, Array]:
        """Return the bounds of b at the knots inside, in units of a time, shape (K-1,)."""
        high = np.maximum(self.largest_b(reserved)[1:-1] * unit**2, 2 * SMALLEST)
        return np.full_like(high, SMALLEST), high

    def g_bounds(self, reserved: dict[str, Array]) -> tuple[Array, Array]:
        """Return the bounds of the program's rows."""
        n = self.description.n
        linear = [row.bounds(self.shares(reserved, row.what, n)) for row in self.rows]
        parts = [[np.concatenate(side, axis=-1).ravel() for side in zip(*linear, strict=True)]]
        if self.terms is not None:
            low: list[Array] = []
            high: list[Array] = []
            for constraint, count in zip(self.terms.constraints, self.terms.counts, strict=True):
                most = np.tile(1 - self.shares(reserved, constraint.what, count), (2, 1, 1))
                high.append(most)
                low.append(-most if constraint.low == -1 else np.full_like(most, constraint.low))
            if high:
                parts.append([np.concatenate(side, axis=-1).ravel() for side in (low, high)])
        # In least time the intervals may as well take less than the duration, which keeps the program convex.
        parts.append([np.array([-np.inf if self.objective.only_time else 0.0]), np.zeros(1)])
        bounds = [np.concatenate(side) for side in zip(*parts, strict=True)]
        return bounds[0], bounds[1]

    def motion(self, b: Array) -> tuple[Trajectory, Array]:
        """Return the motion with b at all knots, shape (K+1,), 1/s^2, and when its intervals end, likewise, s."""
        speed, steps = np.sqrt(b), self.states.steps
        sdd = (speed[1:] - speed[:-1]) * (speed[1:] + speed[:-1]) / (2 * steps)
        ends = np.concatenate([[0.0], np.cumsum(2 * steps / (speed[1:] + speed[:-1]))])
        law = np.stack([self.knots[:-1], speed[:-1], sdd / 2], axis=1)
        trajectory = self.path.timed(ends, law)
        if self.duration is not None:
            c = self.duration / ends[-1]
            return trajectory.slowed(c), ends * c
        return trajectory, ends


@dataclass(frozen=True, eq=False)
class _Found:
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


def _solved(task: _Task, deadline: float, progress: ProgressCall | None) -> list[_Found]:
    """Return what each step of a task has found, the last one first."""
    found: list[_Found] = []
    for step in task.steps:
        found.insert(0, _certified(step, found[0] if found else None, deadline, progress))
        quickest = found[-1].trajectory.duration
        if task.duration is not None and quickest > task.duration * (1 + SLACK):
            raise PlanningError(
                f"{task.duration:.6g} s are too short: the limits allow the motion along the path in {quickest:.6g} s"
            )
    return found


def _certified(task: _Task, quickest: _Found | None, deadline: float, progress: ProgressCall | None) -> _Found:
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
            return _Found(slower, task.knots, b / c**2, certificate, c, tuple(tightened), iterations, solves)
        states = task.checker.states(trajectory, POINTS)
        excess = _excess(task, states, trajectory.breaks, ends)
        tightened += [what for what, share in excess.items() if (share > 0).any() and what not in tightened]
        knots = task.knots
        task, reserved = _wider(task, reserved, excess)
        b = np.interp(task.knots, knots, b)
    worst = task.checker.check(trajectory, states).worst
    raise PlanningError(f"{worst.what} stays exceeded by {100 * worst.excess:.2g} % at {worst.time:.4g} s")


def _solution(
    task: _Task,
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
        raise _not_converged(task, solution, rows)
    return solution


def _made_good(task: _Task, trajectory: Trajectory, most: float) -> tuple[Trajectory, Certificate, float] | None:
    """Return a motion slowed down until it keeps its limits, its certificate and by what; None beyond ``most``."""
    c = 1.0
    for _ in range(TRIES):
        slower = trajectory if c == 1.0 else trajectory.slowed(c)
        states = task.checker.states(slower, POINTS)
        over = max((float(peak.max()) for _, peak in _peaks(task, states)), default=0.0)
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


def _peaks(task: _Task, states: States) -> list[tuple[str, Array]]:
    """Return each kind of limit with by what share it is exceeded, shape (intervals, POINTS, rows).

    Between states a use is as high as the parabola through three of them.
    """
    found = []
    for what, use in task.checker.measured(states):
        values = use.reshape(-1, POINTS, use.shape[1])
        slope, bend = (values[:, 2:] - values[:, :-2]) / 2, np.diff(values, 2, axis=1)
        inside = (bend < 0) & (np.abs(slope) < np.abs(bend))
        rise = np.divide(slope**2, -2 * bend, out=np.zeros_like(bend), where=inside)
        found.append((what, values + np.pad(rise, ((0, 0), (1, 1), (0, 0))) - 1))
    return found


def _excess(task: _Task, states: States, breaks: Array, ends: Array) -> dict[str, Array]:
    """Return by what share each kind of limit is exceeded in each interval of the grid, shape (K, rows)."""
    # Breaks of the path lie between those of the grid.
    interval = np.clip(np.searchsorted(ends, (breaks[1:] + breaks[:-1]) / 2) - 1, 0, task.intervals - 1)
    found = {}
    for what, peaks in _peaks(task, states):
        found[what] = np.zeros((task.intervals, peaks.shape[2]))
        np.maximum.at(found[what], interval, peaks.max(axis=1))
    return found


def _wider(task: _Task, reserved: dict[str, Array], excess: dict[str, Array]) -> tuple[_Task, dict[str, Array]]:
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


def _not_converged(task: _Task, solution: Solution, bounds: tuple[Array, Array]) -> PlanningError:
    """Say what stands in the way: a joint that cannot hold the arm, or else the row that misses its bounds most."""
    names = [joint.name for joint in task.description.joints]
    use = np.abs(task.states.g) / task.limits.torque
    if use.max() > 1:
        end, k, i = np.unravel_index(int(np.argmax(use)), use.shape)
        unit = "N" if task.description.numbers.prismatic[i] else "N m"
        return PlanningError(
            f"joint {names[i]} cannot hold the arm at s = {task.states.s[end, k]:.4g}: it takes "
            f"{abs(task.states.g[end, k, i]):.5g} {unit}, its limit is {task.limits.torque[i]:.5g} {unit}"
        )
    rows = [(row.what, names[i]) for row in task.rows for i in np.flatnonzero(row.limited)]
    misses = np.maximum(bounds[0] - solution.g, solution.g - bounds[1])
    misses = np.where(np.isnan(misses), np.inf, misses)[: 2 * task.intervals * len(rows)]
    where = ""
    if misses.size and misses.max() > FEASIBLE:
        end, k, i = np.unravel_index(int(np.argmax(misses)), (2, task.intervals, len(rows)))
        what, joint = rows[i]
        where = f": {what} of joint {joint} misses its limit by {misses.max():.2g} at s = {task.states.s[end, k]:.4g}"
    return PlanningError(f"not converged ({solution.status} after {solution.iterations} iterations){where}")


def _require_objective(objective: Objective, duration: float | None) -> None:
    check_duration(duration)
    if not all(isinstance(term, Time | Effort) for term in objective.terms):
        raise ValueError(f"objective is {objective}; expected time and effort along a path")
    if not objective.has_time and duration is None:
        raise ValueError(f"objective {objective} says nothing about time; expected duration=, or Time() + ...")


def _require_path(description: Description, path: JointPath, limits: Limits) -> None:
    """Refuse a path that no motion can follow from rest to rest without stopping."""
    names = [joint.name for joint in description.joints]
    if np.isfinite(limits.jerk).any():
        raise PlanningError("jerk is limited: along a path accelerations jump; give limits without those of jerk")
    _require_inside(path, limits)
    jumps = np.abs(_jumps(path, 1))
    if jumps.size and jumps.max() > CORNER * np.abs(path.qs(path.breaks)).max():
        k, i = np.unravel_index(int(np.argmax(jumps)), jumps.shape)
        raise PlanningError(
            f"the path has a corner at s = {path.breaks[k + 1]:.4g}, where joint {names[i]} turns suddenly: "
            "plan to it and on from it"
        )
    s, slopes = path.pieces.derivative.inside(POINTS)
    steepness = np.abs(slopes).max(axis=2)
    mean = float(np.sum(steepness.mean(axis=1) * np.diff(path.breaks)))
    if not steepness.min() > STANDS_STILL * mean:
        raise PlanningError(
            f"the path stands still at s = {s.flat[int(np.argmin(steepness))]:.4g}: no joint moves there"
        )
    if steepness.max() > TOO_STEEP * mean:
        k, j, i = np.unravel_index(int(np.argmax(np.abs(slopes))), slopes.shape)
        raise PlanningError(f"the path is singular at s = {s[k, j]:.4g}: joint {names[i]} turns ever faster there")
    for where, q in (("the path's beginning", path.q(0.0)), ("the path's end", path.q(1.0))):
        require_holdable(description, limits, q, where)


def _require_inside(path: JointPath, limits: Limits) -> None:
    """Refuse a path that leaves the joint limits."""
    s, q = (array.reshape(-1, path.description.n) for array in path.pieces.turning())
    excess = np.maximum(limits.lower - q, q - limits.upper)
    if excess.max() <= OUTSIDE:
        return
    k, i = np.unravel_index(int(np.argmax(excess)), excess.shape)
    side, limit = ("lower", limits.lower[i]) if q[k, i] < limits.lower[i] else ("upper", limits.upper[i])
    raise PlanningError(
        f"{path.description.joints[i].name} leaves its {side} limit, {limit:.6g} {unit_of(path.description, int(i))}, "
        f"along the path: it comes to {q[k, i]:.6g} at s = {s[k, i]:.4g}"
    )


def _require_kept(task: _Task) -> None:
    """Refuse a path that breaks a constraint at any speed, and one that nothing keeps from being jumped along."""
    resting = {constraint.what for constraint in task.checker.constraints if not constraint.moving}
    for what, use in task.checker.measured(task.still) if resting else []:
        if what in resting and use.max() > 1 + CORNER:
            s = task.states.s.flat[int(np.argmax(use.max(axis=1)))]
            raise PlanningError(f"{what} is exceeded by {100 * (use.max() - 1):.2g} % at s = {s:.4g}, at any speed")
    moves = np.abs(task.states.qs).max(axis=(0, 1)) > 0
    limited = np.isfinite(task.limits.torque) | np.isfinite(task.limits.acceleration)
    if task.objective.only_time and not (moves & limited).any():
        raise PlanningError(
            "nothing limits acceleration along the path: no joint that moves has a limit of it or of torque"
        )


def _jumps(path: JointPath, order: int) -> Array:
    """Return by how much a derivative jumps at each inner break, shape (K-1, n)."""
    pieces, inside = path.pieces.differentiated(order), path.breaks[1:-1]
    jumps: Array = pieces(inside) - pieces(inside, "left")
    return jumps


def _rows(states: PathStates, limits: Limits) -> list[TimingRows]:
    return [
        TimingRows.of("torque", states, states.m, states.c, states.g, limits.torque),
        TimingRows.of("acceleration", states, states.qs, states.qss, 0 * states.q, limits.acceleration),
    ]


def _tool_speeds(constraints: tuple[Constraint, ...]) -> list[ToolSpeed]:
    """Return those of the constraints that bound b."""
    return [constraint for constraint in constraints if isinstance(constraint, ToolSpeed)]


def _even_speeds(states: PathStates, limits: Limits, constraints: tuple[Constraint, ...]) -> Array:
    """Return the greatest even speed along the path in each interval, shape (K,), 1/s."""
    nothing = np.zeros((len(states.steps), 1))
    bounds = speed_bounds(states, limits, nothing, [(tool, nothing) for tool in _tool_speeds(constraints)])
    most = np.minimum(bounds[:-1], bounds[1:])
    for row in _rows(states, limits):
        most = np.minimum(most, row.even.min(axis=0))
    return np.sqrt(most)


def _knots(path: JointPath, intervals: int, rough: Array, speeds: Array) -> Array:
    """Return a grid with steps that take about the same time, and knots where the path's curvature jumps.

    From rest s grows as t^2 and so do the first knots; where the joints have to go slowly, near singularities, the
    grid is finer.

    Parameters
    ----------
    rough, speeds
        A first grid, shape (K+1,), and the greatest even speed in its intervals, shape (K,).
    """
    steps = np.diff(rough)
    times = steps / speeds
    share = (1 - EVENLY) * times / max(float(times.sum()), TINY) + EVENLY * steps
    x = (1 - np.cos(np.linspace(0.0, np.pi, intervals + 1))) / 2
    knots, taken = np.interp(x, np.concatenate([[0.0], np.cumsum(share) / share.sum()]), rough), set()
    jumps = np.abs(_jumps(path, 2)).max(axis=1)
    for s in path.breaks[1:-1][jumps > CORNER * np.abs(path.qss(path.breaks)).max()]:
        k = int(np.argmin(np.abs(knots[1:-1] - s))) + 1
        if knots[k] in taken:
            knots = np.insert(knots, np.searchsorted(knots, s), s)
        else:
            knots[k] = s
        taken.add(s)
    return knots
