"""Timing of a path as two programs: in the squared path speed, and under limits of jerk.

The first is in the squared path speed b = sd^2. From db/dt = 2 sd sdd = b' sd follows sdd = b' / 2. With b linear
between the knots of a grid, sdd is constant between them, and an interval of length ds takes

    2 ds / (sqrt b_k + sqrt b_(k+1)).

The time-optimal program is convex in b without friction: Verscheure et al. 2009, Time-optimal path tracking for robots,
section III.

The second is in the speed and the acceleration along the path. sdd is continuous, and linear in time between the knots
of a grid: joint jerks are q' sddd + 3 q'' sd sdd + q''' sd^3.
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

END_SHARE = 0.01
"""Share of the path at each end in which a guess of even speed speeds up or slows down."""
MIN_SQUARED_SPEED = 1e-7
"""Smallest b at inner knots, relative to about the path's mean: Ipopt relaxes bounds by a tenth of it."""
TIME_TOLERANCE = 1e-7
"""Ipopt's tolerance for least time, scaled to 1; each active limit costs a tenth of it."""
SMOOTH_TOLERANCE = 1e-8
"""Ipopt's tolerance for other objectives, which are flatter near their optimum."""
GUESS_SPEED_SHARE = 0.5
"""Squared speed of the initial guess as a share of the largest possible."""
JERK_LIMITED_TOLERANCE = 1e-8
"""Ipopt's tolerance under limits of jerk, with costs scaled to 1."""
SAMPLES = 2000
"""Number of times of a quintic from which a guess is interpolated."""
MIN_STEP = 1e-6
"""Shortest duration of an interval, relative to that of the guess."""


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
        # An interval with constant sdd has the mean speed (sd_k + sd_(k+1)) / 2.
        speed = np.sqrt(self.b)
        return np.concatenate([[0.0], np.cumsum(2 * np.diff(self.s) / (speed[1:] + speed[:-1]))])

    @property
    def duration(self) -> float:
        """Duration, s."""
        return float(self.times[-1])

    def lasting(self, duration: float) -> Profile:
        """Return the same profile, slower or faster, with another duration, s."""
        # A motion that lasts c times as long has sd / c, and b / c^2.
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

    def _interval(
        self, *, first: bool = False, last: bool = False
    ) -> tuple[LocalFunction, tuple[Rows, ...]]:
        """Return the rows and the cost of an interval; the first begins at rest, the last ends there."""
        import casadi

        duration = casadi.SX.sym("duration")
        inner = casadi.SX.sym("b", 2 - first - last)
        parts = [casadi.SX.sym(f"parts{k}", self.powers) for k in range(2)]
        symbols = self.symbols()
        ds = symbols.step

        # b and the speed sqrt b at both ends. At rest the speed is a constant: the square root has no derivative there.
        b = casadi.vertsplit(casadi.exp(inner) if self._logarithmic else inner)
        speed = [casadi.sqrt(part) for part in b]
        if first:
            b = [casadi.SX(0), *b]
            speed = [casadi.SX(0), *speed]
        if last:
            b = [*b, casadi.SX(0)]
            speed = [*speed, casadi.SX(0)]

        b_begin, b_end = b
        sd_begin, sd_end = speed

        # The time that the interval takes, and sdd = b' / 2.
        time = 2 * ds / (sd_begin + sd_end)
        sdd = (b_end - b_begin) / (2 * ds)
        kinds = [Rows(RowKind.TIME, "duration of an interval", 1)]
        rows = [time - duration]

        # The limits at both ends, and the integral of the rates by the trapezoidal rule.
        at_state, limits = self.at_state(symbols.given)
        rates = []
        for x, v, coefficients, part in zip(
            b, speed, (symbols.left, symbols.right), parts, strict=True
        ):
            row, rate = at_state(sdd, x, v, coefficients, part, *symbols.given)
            rows.append(row)
            rates.append(rate)
            kinds += limits
        rate_begin, rate_end = rates
        cost = (
            symbols.scale
            * duration
            * (self.task.objective.time_weight + (rate_begin + rate_end) / 2)
        )

        z = casadi.vertcat(duration, *parts, inner)
        return LocalFunction(z, symbols.vector, casadi.vertcat(*rows), cost), tuple(kinds)

    # Guesses

    def starts(self, task: Task, warm: Trajectory | None) -> Starts[Profile]:
        """Return guesses: about half as fast as the limits allow, or of even speed where a duration is given."""
        duration = task.duration
        if duration is None:
            return Starts([self.usual_profile])
        ends = np.minimum(1.0, np.minimum(self.s, 1 - self.s) / END_SHARE)
        return Starts([lambda: Profile(self.s, np.square(ends / duration)), self.usual_profile])

    def usual_profile(self) -> Profile:
        """Return a guess: b = 4 beta s (1 - s), s = sin(sqrt(beta) t)^2, which takes pi / (2 sqrt beta)."""
        shape = 4 * self.s * (1 - self.s)
        return Profile(
            self.s, GUESS_SPEED_SHARE * self.states.largest(self.task.limits, shape) * shape
        )

    def next_guess(self, guess: Profile, found: Profile) -> Profile:
        """Return the last solution on the grid, which may have become finer."""
        return Profile(self.s, np.interp(self.s, found.s, found.b))

    # Arguments

    def arguments(self, task: Task, guess: Profile, margins: Margins) -> Arguments:
        """Return the arguments of a solution; the unit of time is the guess's duration."""
        K = self.intervals
        unit = guess.duration
        cost = self.cost_unit(task, guess)

        # Bounds of b at the inner knots.
        lowest = MIN_SQUARED_SPEED / unit**2
        shares = margins.of(Limit.VELOCITY, task.arm.n)
        highest = np.maximum(self.states.fastest(task.limits, shares)[1:-1], 2 * lowest)

        sdd = np.diff(guess.b) / (2 * np.diff(self.s))
        powers = self.positive_powers(np.sqrt(guess.b), sdd, sdd)
        x = self._variables(np.diff(guess.times), np.maximum(guess.b[1:-1], lowest), powers)
        low = self._variables(np.zeros(K), np.full(K - 1, lowest), np.zeros_like(powers))
        high = self._variables(np.full(K, np.inf), highest, np.full_like(powers, np.inf))

        # b has the unit 1 / unit^2: a factor of b is an offset of its logarithm.
        scaling = self.scaling(unit, cost / unit)
        if self._logarithmic:
            scaling.offset[K : 2 * K - 1] = -2 * np.log(unit)
        else:
            scaling.unit[K : 2 * K - 1] = unit**-2
        return Arguments(x, self.parameters(task, cost), (low, high), scaling)

    def _variables(self, durations: Array, b: Array, powers: Array) -> Array:
        """Return the program's variables.

        Parameters
        ----------
        durations
            Durations of the intervals, shape (K,), s.
        b
            Squared speeds at the inner knots, shape (K-1,), 1/s^2.
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
        """Return s(t): its breaks (K+1,), s, and ascending coefficients, shape (K, 3): s + sd t + sdd t^2 / 2."""
        # sdd = (b_(k+1) - b_k) / (2 ds) as a product: with h_k = 2 ds / (sd_k + sd_(k+1)) of ``times`` the speed at the
        # end of an interval, sd_k + sdd h_k, is then sd_(k+1) to rounding, however small ds is.
        sd = np.sqrt(found.b)
        sdd = (sd[1:] - sd[:-1]) * (sd[1:] + sd[:-1]) / (2 * np.diff(found.s))
        return found.times, np.stack([found.s[:-1], sd[:-1], sdd / 2], axis=1)


@dataclass(frozen=True, eq=False)
class SmoothProfile:
    """Speeds and accelerations along a path."""

    s: Array
    """Path parameters of the knots, shape (K+1,)."""
    durations: Array
    """Durations of the intervals, shape (K,), s."""
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
        """Return the profile of s = 10 x^3 - 15 x^4 + 6 x^5, x = t / duration, s.

        x at the knots is interpolated; ds/dx = 30 x^2 (1 - x)^2 and d2s/dx2 = 60 x (1 - x) (1 - 2 x).
        """
        sampled = np.linspace(0.0, 1.0, SAMPLES)
        x = np.interp(s, sampled**3 * (10 - 15 * sampled + 6 * sampled * sampled), sampled)
        sd = 30 * x**2 * (1 - x) ** 2 / duration
        sdd = 60 * x * (1 - x) * (1 - 2 * x) / duration**2
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
        self._sd = K + np.arange(K - 1)
        self._sdd = 2 * K - 1 + np.arange(K - 1)
        self.blocks = self.program(self._interval, np.stack([self._sd, self._sdd]), 3 * K - 2)
        self.solver = Solver(self.blocks, K, tolerance=JERK_LIMITED_TOLERANCE)

    def _interval(
        self, *, first: bool = False, last: bool = False
    ) -> tuple[LocalFunction, tuple[Rows, ...]]:
        """Return the rows and the cost of an interval; the first begins at rest, the last ends there."""
        import casadi

        h = casadi.SX.sym("duration")
        known = [casadi.SX.sym(f"state{k}", 2) for k in range(2 - first - last)]
        parts = [casadi.SX.sym(f"parts{k}", self.powers) for k in range(2)]
        symbols = self.symbols()
        states = known
        if first:
            states = [casadi.SX(2, 1), *states]
        if last:
            states = [*states, casadi.SX(2, 1)]
        begin, end = states

        # Continuity, with sdd linear in time from a0 to a1:
        #   ds = h v0 + h^2 (2 a0 + a1) / 6,    v1 = v0 + h (a0 + a1) / 2.
        v0 = begin[0]
        v1 = end[0]
        a0 = begin[1]
        a1 = end[1]
        moved = h * v0 + h * h * (2 * a0 + a1) / 6
        gained = h * (a0 + a1) / 2
        kinds = [Rows(RowKind.CONTINUITY, "continuity along the path", 2)]
        rows = [casadi.vertcat(moved / symbols.step - 1, v0 + gained - v1)]

        # The limits at both ends, jerks q' sddd + 3 q'' sd sdd + q''' sd^3 as shares of their limits, and the integral
        # of the rates by the trapezoidal rule.
        n = self.task.arm.n
        reciprocals = symbols.given[Limit.JERK]
        at_state, limits = self.at_state(symbols.given)
        rates = []
        for state, path, part in zip(
            (begin, end), (symbols.left, symbols.right), parts, strict=True
        ):
            v, a = casadi.vertsplit(state)
            row, rate = at_state(a, v * v, v, path, part, *symbols.given)
            qs = path[n : 2 * n]
            qss = path[2 * n : 3 * n]
            qsss = path[-n:]
            jerk = qs * (a1 - a0) / h + 3 * qss * v * a + qsss * v**3
            rows += [row, jerk * reciprocals]
            rates.append(rate)
            kinds += [*limits, Rows(RowKind.LIMIT, Limit.JERK.what, n, Limit.JERK, of_joints=True)]
        rate_begin, rate_end = rates
        cost = symbols.scale * h * (self.task.objective.time_weight + (rate_begin + rate_end) / 2)

        z = casadi.vertcat(h, *parts, *known)
        return LocalFunction(z, symbols.vector, casadi.vertcat(*rows), cost), tuple(kinds)

    # Guesses

    def starts(self, task: Task, warm: Trajectory | None) -> Starts[SmoothProfile]:
        """Return a quintic law that keeps the limits."""
        return Starts([self._quintic])

    def _quintic(self) -> SmoothProfile:
        """Return a quintic law of the given duration, or one that is slow enough for the limits.

        Without limits of jerk, b = 4 beta s (1 - s) takes at least pi / (2 sqrt beta): its duration is slowed down.
        """
        task = self.task
        shape = 4 * self.s * (1 - self.s)
        beta = self.states.largest(task.limits, shape)
        least = np.pi / (2 * np.sqrt(beta))
        profile = SmoothProfile.quintic(self.s, task.duration or float(least))
        if task.duration is not None:
            return profile
        checker = task.checker
        c = checker.slow_down(checker.states(self.trajectory(task, profile)))
        return SmoothProfile.quintic(self.s, c * float(least)) if np.isfinite(c) else profile

    def next_guess(self, guess: SmoothProfile, found: SmoothProfile) -> SmoothProfile:
        """Return the last solution on the grid, which may have become finer."""
        times = np.interp(self.s, found.s, found.times)
        sd = np.interp(self.s, found.s, found.sd)
        sdd = np.interp(self.s, found.s, found.sdd)
        return SmoothProfile(self.s, np.diff(times), sd, sdd)

    # Arguments

    def arguments(self, task: Task, guess: SmoothProfile, margins: Margins) -> Arguments:
        """Return the arguments of a solution; the unit of time is the guess's duration."""
        K = self.intervals
        unit = float(guess.times[-1])
        cost = self.cost_unit(task, guess)

        low = np.full(self.blocks.variables, -np.inf)
        high = np.full(self.blocks.variables, np.inf)
        low[:K] = MIN_STEP * unit / K
        low[self._sd] = 0.0
        low[self.positive_parts] = 0.0
        shares = margins.of(Limit.VELOCITY, task.arm.n)
        high[self._sd] = np.sqrt(self.states.fastest(task.limits, shares)[1:-1])

        powers = self.positive_powers(guess.sd, guess.sdd[:-1], guess.sdd[1:])
        x = np.concatenate([guess.durations, guess.sd[1:-1], guess.sdd[1:-1], powers.ravel()])

        # Speeds have the unit 1 / unit, as has the second row of each interval: the continuity of the speed.
        scaling = self.scaling(unit, cost / unit)
        scaling.unit[self._sd] = 1 / unit
        scaling.unit[self._sdd] = unit**-2
        per_interval = sum(kind.count for kind in self.blocks.blocks[1].rows)
        scaling.row_unit[1 : K * per_interval : per_interval] = 1 / unit
        return Arguments(x, self.parameters(task, cost), (low, high), scaling)

    # Solutions

    def iterate(self, x: Array) -> SmoothProfile:
        """Return the profile of variables, shape (variables,)."""
        sd = np.concatenate([[0.0], x[self._sd], [0.0]])
        sdd = np.concatenate([[0.0], x[self._sdd], [0.0]])
        return SmoothProfile(self.s, x[: self.intervals], sd, sdd)

    def law(self, found: SmoothProfile) -> tuple[Array, Array]:
        """Return s(t): its breaks (K+1,), s, and ascending coefficients, shape (K, 4); exactly from 0 to 1."""
        duration = np.array([found.times[-1]])
        knots = Knots(duration, found.s[:, None], found.sd[:, None], found.sdd[:, None])
        ends = np.array([self.intervals])
        coefficients = corrected(Curve.LINEAR, found.durations, ends, knots, fixed_ends=True)
        return found.times, coefficients[..., 0]
