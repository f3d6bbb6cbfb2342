"""Timing of a path under limits of jerk, as a program in the speed and the acceleration along it.

sdd is continuous, and linear in time between the knots of a grid: joint jerks are q' sddd + 3 q'' sd sdd + q''' sd^3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dhkit.description import Array
from dhkit.planning.along.path_program import PathProgram
from dhkit.planning.criteria import Limit
from dhkit.planning.program import (
    Arguments,
    Curve,
    Knots,
    LocalFunction,
    Margins,
    RowKind,
    Rows,
    Solver,
    Starts,
    Task,
    corrected,
)
from dhkit.trajectories import Trajectory

TOLERANCE = 1e-8
"""Ipopt's tolerance."""
SAMPLES = 2000
"""Number of times of a quintic from which a guess is interpolated."""
MIN_STEP = 1e-6
"""Shortest duration of an interval, relative to that of the guess."""


@dataclass(frozen=True, eq=False)
class SmoothProfile:
    """Speeds and accelerations along a path."""

    s: Array
    """Path parameters of the knots, shape (K+1,)."""
    durations: Array
    """Of the intervals, shape (K,), s."""
    sd: Array
    """Speeds at the knots, shape (K+1,), 1/s."""
    sdd: Array
    """Accelerations at the knots, shape (K+1,), 1/s^2."""

    @property
    def times(self) -> Array:
        """Times of the knots, shape (K+1,), s."""
        return np.concatenate([[0.0], np.cumsum(self.durations)])

    def lasting(self, duration: float) -> SmoothProfile:
        """Return the same profile, slower or faster, with another duration, s."""
        c = duration / float(self.times[-1])
        return SmoothProfile(self.s, c * self.durations, self.sd / c, self.sdd / c**2)

    @classmethod
    def quintic(cls, s: Array, duration: float) -> SmoothProfile:
        """Return the profile of s = 10 x^3 - 15 x^4 + 6 x^5, x = t / duration, s."""
        x = np.linspace(0.0, 1.0, SAMPLES)
        x = np.interp(s, x**3 * (10 - 15 * x + 6 * x * x), x)
        sd, sdd = 30 * x**2 * (1 - x) ** 2 / duration, 60 * x * (1 - x) * (1 - 2 * x) / duration**2
        return cls(s, duration * np.diff(x), sd, sdd)


class SmoothTimingProgram(PathProgram[SmoothProfile]):
    """The program of one task along a path under limits of jerk.

    The variables are the durations of the intervals, and the speeds and accelerations at the inner knots; the motion
    begins and ends with neither. The rows of an interval are its continuity, and limits at its left and right end; the
    last row is the duration.
    """

    def __init__(self, task: Task, s: Array) -> None:
        super().__init__(task, s)
        K = self.intervals
        self._sd, self._sdd = K + np.arange(K - 1), 2 * K - 1 + np.arange(K - 1)
        self.blocks = self.program(self._interval, np.stack([self._sd, self._sdd]), 3 * K - 2)
        self.solver = Solver(self.blocks, K, tolerance=TOLERANCE)

    def _interval(self, *, first: bool = False, last: bool = False) -> tuple[LocalFunction, tuple[Rows, ...]]:
        """Return the rows and the cost of an interval; the first begins at rest, the last ends there."""
        import casadi

        h, known = casadi.SX.sym("duration"), [casadi.SX.sym(f"state{k}", 2) for k in range(2 - first - last)]
        parts = [casadi.SX.sym(f"parts{k}", self.powers) for k in range(2)]
        step, left, right, given, scale = self.symbols()
        rest = [casadi.SX(2, 1)]
        begin, end = [*rest * first, *known, *rest * last]
        at_state, limits = self.at_state(given)
        n, reciprocals = self.task.arm.n, given[Limit.JERK]
        kinds = [Rows(RowKind.CONTINUITY, "continuity along the path", 2)]
        moved, gained = h * begin[0] + h * h * (2 * begin[1] + end[1]) / 6, h * (begin[1] + end[1]) / 2
        rows, rates = [casadi.vertcat(moved / step - 1, begin[0] + gained - end[0])], []
        for state, path, part in zip((begin, end), (left, right), parts, strict=True):
            v, a = casadi.vertsplit(state)
            row, rate = at_state(a, v * v, v, path, part, *given)
            qs, qss, qsss = path[n : 2 * n], path[2 * n : 3 * n], path[-n:]
            jerk = qs * (end[1] - begin[1]) / h + 3 * qss * v * a + qsss * v**3
            rows += [row, jerk * reciprocals]
            rates.append(rate)
            kinds += [*limits, Rows(RowKind.LIMIT, Limit.JERK.what, n, Limit.JERK, of_joints=True)]
        cost = scale * h * (self.task.objective.time_weight + (rates[0] + rates[1]) / 2)
        z, p = casadi.vertcat(h, *parts, *known), casadi.vertcat(step, left, right, *given, scale)
        return LocalFunction(z, p, casadi.vertcat(*rows), cost), tuple(kinds)

    # Guesses

    def starts(self, task: Task, warm: Trajectory | None) -> Starts[SmoothProfile]:
        """Return a quintic law that keeps the limits."""
        return Starts([self._quintic])

    def _quintic(self) -> SmoothProfile:
        task = self.task
        shape = 4 * self.s * (1 - self.s)
        least = np.pi / (2 * np.sqrt(self.states.largest(task.limits, shape)))
        profile = SmoothProfile.quintic(self.s, task.duration or float(least))
        if task.duration is not None:
            return profile
        checker = task.checker
        c = checker.slow_down(checker.states(self.trajectory(task, profile)))
        return SmoothProfile.quintic(self.s, c * float(least)) if np.isfinite(c) else profile

    def again(self, guess: SmoothProfile, found: SmoothProfile) -> SmoothProfile:
        """Return the last solution on the grid, which may have become finer."""
        times = np.interp(self.s, found.s, found.times)
        sd, sdd = (np.interp(self.s, found.s, values) for values in (found.sd, found.sdd))
        return SmoothProfile(self.s, np.diff(times), sd, sdd)

    # Arguments

    def arguments(self, task: Task, guess: SmoothProfile, margins: Margins) -> Arguments:
        """Return the arguments of a solution; the unit of time is the guess's duration."""
        K, unit = self.intervals, float(guess.times[-1])
        cost = self.cost_unit(task, guess)
        scaling = self.scaling(unit, cost / unit)
        scaling.unit[self._sd], scaling.unit[self._sdd] = 1 / unit, unit**-2
        per_interval = sum(kind.count for kind in self.blocks.blocks[1].rows)
        scaling.row_unit[1 : K * per_interval : per_interval] = 1 / unit
        low, high = np.full(self.blocks.variables, -np.inf), np.full(self.blocks.variables, np.inf)
        shares = margins.of(Limit.VELOCITY, task.arm.n)
        low[:K], low[self._sd], low[self.positive_parts] = MIN_STEP * unit / K, 0.0, 0.0
        high[self._sd] = np.sqrt(self.states.fastest(task.limits, shares)[1:-1])
        powers = self.positive_powers(guess.sd, guess.sdd[:-1], guess.sdd[1:])
        x = np.concatenate([guess.durations, guess.sd[1:-1], guess.sdd[1:-1], powers.ravel()])
        return Arguments(x, self.parameters(task, cost), (low, high), scaling)

    # Solutions

    def iterate(self, x: Array) -> SmoothProfile:
        """Return the profile of variables, shape (variables,)."""
        sd, sdd = (np.concatenate([[0.0], x[indices], [0.0]]) for indices in (self._sd, self._sdd))
        return SmoothProfile(self.s, x[: self.intervals], sd, sdd)

    def law(self, found: SmoothProfile) -> tuple[Array, Array]:
        """Return s(t): its breaks (K+1,), s, and ascending coefficients, shape (K, 4); exactly from 0 to 1."""
        columns = (values[:, None] for values in (found.s, found.sd, found.sdd))
        knots = Knots(np.array([found.times[-1]]), *columns)
        ends = np.array([self.intervals])
        coefficients = corrected(Curve.LINEAR, found.durations, ends, knots, fixed_ends=True)
        return found.times, coefficients[..., 0]
