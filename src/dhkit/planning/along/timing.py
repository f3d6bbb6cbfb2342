"""Timing of a path as a program in the squared path speed b = sd^2.

With b linear between the knots of a grid, sdd = b' / 2 is constant between them. The time-optimal program is convex in
b without friction: Verscheure et al. 2009, Time-optimal path tracking for robots, section III.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dhkit.description import Array
from dhkit.planning.along.path_program import PathProgram
from dhkit.planning.criteria import Limit
from dhkit.planning.program import Arguments, LocalFunction, Margins, RowKind, Rows, Solver, Starts, Task
from dhkit.trajectories import Trajectory

END_SHARE = 0.01
"""Share of the path at each end in which a guess of even speed speeds up or slows down."""
MIN_SQUARED_SPEED = 1e-7
"""Smallest b at inner knots, relative to about the path's mean: Ipopt relaxes bounds by a tenth of it."""
TIME_TOLERANCE, SMOOTH_TOLERANCE = 1e-7, 1e-8
"""Ipopt's tolerances for time (scaled to 1) and for other objectives; each active limit costs a tenth of it."""
GUESS_SPEED_SHARE = 0.5
"""Squared speed of the initial guess as a share of the largest possible."""


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


class TimingProgram(PathProgram[Profile]):
    """The program of one task along a path, without limits of jerk.

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

    def __init__(self, task: Task, s: Array) -> None:
        super().__init__(task, s)
        self._logarithmic = not task.objective.only_time
        K = self.intervals
        self.blocks = self.program(self._interval, K + np.arange(K - 1)[None], 2 * K - 1)
        tolerance = TIME_TOLERANCE if task.objective.has_time else SMOOTH_TOLERANCE
        self.solver = Solver(self.blocks, K, tolerance=tolerance)

    def _interval(self, *, first: bool = False, last: bool = False) -> tuple[LocalFunction, tuple[Rows, ...]]:
        """Return the rows and the cost of an interval; the first begins at rest, the last ends there."""
        import casadi

        duration, inner = casadi.SX.sym("duration"), casadi.SX.sym("b", 2 - first - last)
        parts = [casadi.SX.sym(f"parts{k}", self.powers) for k in range(2)]
        step, left, right, given, scale = self.symbols()
        known = casadi.vertsplit(casadi.exp(inner) if self._logarithmic else inner)
        # At rest the speed is a constant: the square root has no derivative there.
        rest = [casadi.SX(0)]
        b = [*rest * first, *known, *rest * last]
        speed = [*rest * first, *(casadi.sqrt(part) for part in known), *rest * last]
        kinds = [Rows(RowKind.TIME, "duration of an interval", 1)]
        rows, rates = [2 * step / (speed[0] + speed[1]) - duration], []
        at_state, limits = self.at_state(given)
        sdd = (b[1] - b[0]) / (2 * step)
        for x, v, coefficients, part in zip(b, speed, (left, right), parts, strict=True):
            row, rate = at_state(sdd, x, v, coefficients, part, *given)
            rows.append(row)
            rates.append(rate)
            kinds += limits
        cost = scale * duration * (self.task.objective.time_weight + (rates[0] + rates[1]) / 2)
        z, p = casadi.vertcat(duration, *parts, inner), casadi.vertcat(step, left, right, *given, scale)
        return LocalFunction(z, p, casadi.vertcat(*rows), cost), tuple(kinds)

    # Guesses

    def starts(self, task: Task, warm: Trajectory | None) -> Starts[Profile]:
        """Return guesses: about half as fast as the limits allow, or of even speed where a duration is given."""
        duration = task.duration
        if duration is None:
            return Starts([self.usual_profile])
        ends = np.minimum(1.0, np.minimum(self.s, 1 - self.s) / END_SHARE)
        return Starts([lambda: Profile(self.s, np.square(ends / duration)), self.usual_profile])

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
        lowest = MIN_SQUARED_SPEED / unit**2
        shares = margins.of(Limit.VELOCITY, task.arm.n)
        high = np.maximum(self.states.fastest(task.limits, shares)[1:-1], 2 * lowest)
        cost, speed = self.cost_unit(task, guess), np.sqrt(guess.b)
        scaling = self.scaling(unit, cost / unit)
        if self._logarithmic:
            scaling.offset[K : 2 * K - 1] = -2 * np.log(unit)
        else:
            scaling.unit[K : 2 * K - 1] = unit**-2
        sdd, most = np.diff(guess.b) / (2 * np.diff(self.s)), np.full(self.positive_parts.shape, np.inf)
        powers = self.positive_powers(speed, sdd, sdd)
        low = self._variables(np.zeros(K), np.full(K - 1, lowest), 0 * powers)
        return Arguments(
            self._variables(np.diff(guess.times), np.maximum(guess.b[1:-1], lowest), powers),
            self.parameters(task, cost),
            (low, self._variables(np.full(K, np.inf), high, most)),
            scaling,
        )

    def _variables(self, durations: Array, b: Array, powers: Array) -> Array:
        """Return the program's variables.

        Parameters
        ----------
        durations
            Of the intervals, shape (K,), s.
        b
            At the inner knots, shape (K-1,), 1/s^2.
        powers
            Positive parts of powers at the ends of the intervals, shape (2 powers, K).
        """
        return np.concatenate([durations, np.log(b) if self._logarithmic else b, powers.ravel()])

    # Solutions

    def iterate(self, x: Array) -> Profile:
        """Return the profile of variables, shape (variables,)."""
        inner = x[self.intervals : 2 * self.intervals - 1]
        inside = np.exp(inner) if self._logarithmic else np.maximum(inner, 0.0)
        return Profile(self.s, np.concatenate([[0.0], inside, [0.0]]))

    def law(self, found: Profile) -> tuple[Array, Array]:
        """Return s(t): its breaks (K+1,), s, and ascending coefficients, shape (K, 3)."""
        speed = np.sqrt(found.b)
        sdd = (speed[1:] - speed[:-1]) * (speed[1:] + speed[:-1]) / (2 * np.diff(found.s))
        return found.times, np.stack([found.s[:-1], speed[:-1], sdd / 2], axis=1)
