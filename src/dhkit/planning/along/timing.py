"""Timing of a path as a program in the squared path speed b = sd^2.

With b linear between the knots of a grid, sdd = b' / 2 is constant between them. The time-optimal program is convex in
b without friction: Verscheure et al. 2009, Time-optimal path tracking for robots, section III.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from dhkit.description import Array
from dhkit.planning.along.path_point import PathPoint
from dhkit.planning.along.path_states import PathStates
from dhkit.planning.blocks import Block, BlockProgram, Indices, LocalFunction, RowKind, Rows
from dhkit.planning.costs import size_of
from dhkit.planning.joint_limits import Limit
from dhkit.planning.program import Arguments, Program, Starts, limit_rows
from dhkit.planning.solver import Solver
from dhkit.planning.task import Margins, Task
from dhkit.trajectories import JointPath, Trajectory

MAX_INTERVALS = 2000
"""Largest number of requested intervals; after refinement there may be twice as many."""
MIN_SQUARED_SPEED = 1e-7
"""Smallest b at inner knots, relative to about the path's mean: Ipopt relaxes bounds by a tenth of it."""
TIME_TOLERANCE, SMOOTH_TOLERANCE = 1e-7, 1e-8
"""Ipopt's tolerances for time (scaled to 1) and for other objectives; each active limit costs a tenth of it."""
GUESS_SPEED_SHARE = 0.5
"""Squared speed of the initial guess as a share of the largest possible."""
REFINED = 4
"""Factor by which the excess inside an interval falls if the interval is halved."""


@dataclass(frozen=True, eq=False)
class Profile:
    """Speeds along a path."""

    s: Array
    """Path parameters of the knots, shape (K+1,)."""
    b: Array
    """Squared speeds at the knots, shape (K+1,), 1/s^2."""

    @property
    def times(self) -> Array:
        """Times of the knots, shape (K+1,), s."""
        speed = np.sqrt(self.b)
        return np.concatenate([[0.0], np.cumsum(2 * np.diff(self.s) / (speed[1:] + speed[:-1]))])

    @property
    def duration(self) -> float:
        """Duration, s."""
        return float(self.times[-1])

    def lasting(self, duration: float) -> Profile:
        """Return the same profile, slower or faster, with another duration, s."""
        return Profile(self.s, self.b * (self.duration / duration) ** 2)


class TimingProgram(Program[Profile]):
    """The program of one task along a path.

    The variables are the durations of the intervals and b at the inner knots. The rows of an interval are the time that
    it takes beyond its duration, and limits at its left and right end; the last row is the duration. For objectives
    other than time the program is not convex: slow motions stay longest where gravity torques are smallest, and
    logarithms of b cover their range of decades.

    Parameters
    ----------
    task
        The task, with its path.
    s
        Path parameters of the grid's knots, shape (K+1,).
    """

    small_step = 1e-3

    def __init__(self, task: Task, s: Array) -> None:
        import casadi

        path = cast("JointPath", task.path)
        self.task, self.path, self.s, self.intervals = task, path, s, len(s) - 1
        self.states = PathStates.of(task.loaded, path, s)
        self._logarithmic = not task.objective.only_time
        self._limited = [
            (k, constraint)
            for k, (constraint, _) in task.checker.limiting.items()
            if constraint.moving and k not in (Limit.VELOCITY, Limit.JERK)
        ]
        self._point = PathPoint(task.loaded, task.limits, task.friction)
        K, path_size = self.intervals, int(self._point.path.numel())
        self._sizes = [len(parameters) for _, parameters in task.checker.every]
        of_interval, of_all = 1 + 2 * path_size, sum(self._sizes) + 1
        step = np.arange(K)
        parameters = np.vstack(
            [
                of_interval * step + np.arange(of_interval)[:, None],
                np.tile((K * of_interval + np.arange(of_all))[:, None], K),
            ]
        )
        durations, inner = step[None], K + step[None, :-1]
        total, each = casadi.SX.sym("total", K), np.stack([step, step], axis=1)
        middle = np.vstack([durations[:, 1:-1], inner[:, :-1], inner[:, 1:]])
        first, last = np.vstack([durations[:, :1], inner[:, :1]]), np.vstack([durations[:, -1:], inner[:, -1:]])
        blocks = [
            Block(function, variables, parameters[:, part], rows, each[part])
            for (function, rows), variables, part in (
                (self._interval(first=True), first, slice(None, 1)),
                (self._interval(), middle, slice(1, -1)),
                (self._interval(last=True), last, slice(-1, None)),
            )
        ]
        duration = LocalFunction(total, casadi.SX(0, 1), casadi.sum1(total))
        kinds = (Rows(RowKind.DURATION, "duration", 1),)
        blocks.append(Block(duration, durations.T, np.zeros((0, 1), dtype=int), kinds))
        self.blocks = BlockProgram(2 * K - 1, K * of_interval + of_all, tuple(blocks))
        tolerance = TIME_TOLERANCE if task.objective.has_time else SMOOTH_TOLERANCE
        self.solver = Solver(self.blocks, K, tolerance=tolerance)

    def _interval(self, *, first: bool = False, last: bool = False) -> tuple[LocalFunction, tuple[Rows, ...]]:
        """Return the rows and the cost of an interval; the first begins at rest, the last ends there."""
        import casadi

        symbol, point = casadi.SX.sym, self._point
        duration, inner = symbol("duration"), symbol("b", 2 - first - last)
        step, left, right = symbol("step"), symbol("left", point.path.numel()), symbol("right", point.path.numel())
        given, scale = [symbol(f"p{k}", size) for k, size in enumerate(self._sizes)], symbol("scale")
        known = casadi.vertsplit(casadi.exp(inner) if self._logarithmic else inner)
        # At rest the speed is a constant: the square root has no derivative there.
        rest = [casadi.SX(0)]
        b = [*rest * first, *known, *rest * last]
        speed = [*rest * first, *(casadi.sqrt(part) for part in known), *rest * last]
        kinds = [Rows(RowKind.TIME, "duration of an interval", 1)]
        rows, rates = [2 * step / (speed[0] + speed[1]) - duration], []
        limits = limit_rows(self._limited, point, given)
        expressions = casadi.vertcat(casadi.SX(0, 1), *(row for _, row in limits))
        state = [point.sdd, point.b, point.speed, point.path]
        results = [expressions, self.task.objective.integrand(point)]
        at_state = casadi.Function("at_state", [*state, *given], results, {"cse": True})
        sdd = (b[1] - b[0]) / (2 * step)
        for x, v, coefficients in zip(b, speed, (left, right), strict=True):
            row, rate = at_state(sdd, x, v, coefficients, *given)
            rows.append(row)
            rates.append(rate)
            kinds += [kind for kind, _ in limits]
        cost = scale * duration * (self.task.objective.time_weight + (rates[0] + rates[1]) / 2)
        z, p = casadi.vertcat(duration, inner), casadi.vertcat(step, left, right, *given, scale)
        return LocalFunction(z, p, casadi.vertcat(*rows), cost), tuple(kinds)

    # Guesses

    def starts(self, task: Task, warm: Trajectory | None) -> Starts[Profile]:
        """Return a guess that is about half as fast as the limits allow."""
        return Starts([self.usual_profile])

    def usual_profile(self) -> Profile:
        """Return a guess: b = 4 beta s (1 - s), whose duration is pi / (2 sqrt beta)."""
        shape = 4 * self.s * (1 - self.s)
        return Profile(self.s, GUESS_SPEED_SHARE * self.states.largest(self.task.limits, shape) * shape)

    def again(self, guess: Profile, found: Profile) -> Profile:
        """Return the last solution on the grid, which may have become finer."""
        return Profile(self.s, np.interp(self.s, found.s, found.b))

    # Arguments

    def arguments(self, task: Task, guess: Profile, margins: Margins) -> Arguments:
        """Return the arguments of a solution; the unit of time is the guess's duration."""
        K, unit = self.intervals, guess.duration
        cost = unit
        if not task.objective.only_time:
            cost = size_of(task.objective, self.trajectory(task, guess), task.loaded, task.friction)
        path = np.concatenate([self.states.steps[:, None], *self.states.coefficients], axis=1)
        given = [parameters for _, parameters in task.checker.every]
        lowest = MIN_SQUARED_SPEED / unit**2
        shares = margins.of(Limit.VELOCITY, task.arm.n)
        high = np.maximum(self.states.fastest(task.limits, shares)[1:-1], 2 * lowest)
        scaling = self.blocks.unscaled
        scaling.unit[:K] = unit
        if self._logarithmic:
            scaling.offset[K:] = -2 * np.log(unit)
        else:
            scaling.unit[K:] = unit**-2
        per_interval = sum(kind.count for kind in self.blocks.blocks[1].rows)
        scaling.row_unit[: K * per_interval : per_interval] = unit
        scaling.row_unit[-1] = unit
        low = self._variables(np.zeros(K), np.full(K - 1, lowest))
        return Arguments(
            self._variables(np.diff(guess.times), np.maximum(guess.b[1:-1], lowest)),
            np.concatenate([path.ravel(), *given, [1 / cost]]),
            (low, self._variables(np.full(K, np.inf), high)),
            scaling,
        )

    def _variables(self, durations: Array, b: Array) -> Array:
        """Return the program's variables for durations of the intervals (K,) and b at the inner knots, (K-1,)."""
        return np.concatenate([durations, np.log(b) if self._logarithmic else b])

    # Solutions

    def iterate(self, x: Array) -> Profile:
        """Return the profile of variables, shape (variables,)."""
        inner = x[self.intervals :]
        inside = np.exp(inner) if self._logarithmic else np.maximum(inner, 0.0)
        return Profile(self.s, np.concatenate([[0.0], inside, [0.0]]))

    def trajectory(self, task: Task, found: Profile) -> Trajectory:
        """Return the motion along the path, with exactly the duration of the task if it has one."""
        speed, times = np.sqrt(found.b), found.times
        sdd = (speed[1:] - speed[:-1]) * (speed[1:] + speed[:-1]) / (2 * np.diff(found.s))
        trajectory = self.path.timed(times, np.stack([found.s[:-1], speed[:-1], sdd / 2], axis=1))
        return trajectory if task.duration is None else trajectory.slowed(task.duration / times[-1])

    def interval_of(self, trajectory: Trajectory, found: Profile) -> Indices:
        """Return the interval that each piece of a trajectory lies in: its breaks are between those of the grid."""
        ends, breaks = found.times / found.duration, trajectory.breaks / trajectory.duration
        interval: Indices = np.searchsorted(ends, (breaks[1:] + breaks[:-1]) / 2) - 1
        return np.clip(interval, 0, self.intervals - 1)

    def place(self, interval: float) -> str:
        """Return a place of the motion as text."""
        return f"s = {self.s[int(min(interval, self.intervals - 1))]:.4g}"

    def tightened(self, margins: Margins, more: dict[int, Array]) -> tuple[TimingProgram, Margins]:
        """Return the program with intervals halved where limits are exceeded most, and margins raised elsewhere."""
        is_refined = np.any([(share > self.small_step).any(axis=1) for share in more.values()], axis=0)
        if not is_refined.any() or self.intervals + is_refined.sum() > 2 * MAX_INTERVALS:
            return self, margins.raised(more)
        factor = np.where(is_refined, 1 / REFINED, 1.0)[:, None]
        margins = margins.raised({limit: factor * share for limit, share in more.items()})
        middles = ((self.s[1:] + self.s[:-1]) / 2)[is_refined]
        return TimingProgram(self.task, np.sort(np.append(self.s, middles))), margins.divided(1 + is_refined)
