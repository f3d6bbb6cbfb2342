"""How fast along a given path, as a program: its squares of speed, and limits that are linear in them.

With b = sd^2 at the ends of intervals and linear between them, sdd = b' / 2 is constant inside an interval, and torques
are tau = m sdd + c sd^2 + g (Bobrow, Dubowsky and Gibson 1985; in b convex: Verscheure et al. 2009, Time-optimal path
tracking for robots, section III).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from dhkit import dynamics, kinematics
from dhkit.description import Array, Description
from dhkit.planning.constraints import Constraint
from dhkit.planning.objectives import Objective, Time
from dhkit.planning.point import LOAD, Point
from dhkit.planning.solver import Solver
from dhkit.planning.tool_constraints import ToolSpeed
from dhkit.trajectories import JointPath, Limits
from dhkit.trajectories.pieces import Side

if TYPE_CHECKING:
    import casadi

__all__ = ["PathPoint", "PathStates", "Terms", "TimingProgram", "TimingRows"]

SMALLEST = 1e-7
"""The smallest b inside, where 1 is about the path's mean: ipopt widens bounds by a tenth of it."""
LEAST_TIME, SMOOTH = 1e-7, 1e-8
"""Ipopt's tolerances where time counts, which is then 1, and for other objectives; each limit that is reached costs a
tenth of it."""


@dataclass(frozen=True, eq=False)
class PathStates:
    """A path and its arm's mechanics at both ends of K intervals: shapes (2, K, ...), left ends first."""

    s: Array
    """Shape (2, K)."""
    q: Array
    """Shape (2, K, n), rad and m."""
    qs: Array
    """Their derivatives by s."""
    qss: Array
    m: Array
    """Torque for each sdd, shape (2, K, n); zeros without bodies."""
    c: Array
    """Torque for each sd^2."""
    g: Array
    """Torque that holds the arm."""
    ps: Array
    """The tool's derivatives by s, shape (2, K, 3), m; zeros where they are not asked for."""
    pss: Array

    @classmethod
    def of(cls, description: Description, path: JointPath, knots: Array, *, torque: bool, tool: bool) -> PathStates:
        """Work a path out on a grid; where it bends suddenly, each interval has its own side."""
        first, second = path.pieces.derivative, path.pieces.derivative.derivative
        ends: tuple[tuple[Array, Side], ...] = ((knots[:-1], "right"), (knots[1:], "left"))
        q, qs, qss = (np.stack([piece(s, side) for s, side in ends]) for piece in (path.pieces, first, second))
        still = np.zeros_like(q)
        m = c = g = still
        if torque:
            g = dynamics.inverse_dynamics(description, q, still, still)
            m = dynamics.inverse_dynamics(description, q, still, qs) - g
            c = dynamics.inverse_dynamics(description, q, qs, qss) - g
        ps = pss = np.zeros((*q.shape[:2], 3))
        if tool:
            J, Jd = kinematics.jacobian(description, q), kinematics.jacobian_dot(description, q, qs)
            ps = np.einsum("...ij,...j->...i", J[..., :3, :], qs)
            pss = np.einsum("...ij,...j->...i", J[..., :3, :], qss) + np.einsum("...ij,...j->...i", Jd[..., :3, :], qs)
        return cls(np.stack([knots[:-1], knots[1:]]), q, qs, qss, m, c, g, ps, pss)

    @property
    def steps(self) -> Array:
        """The intervals' lengths, shape (K,)."""
        steps: Array = self.s[1] - self.s[0]
        return steps

    @property
    def coefficients(self) -> Array:
        """What :class:`PathPoint` takes, a column for each end, shape (6 n + 6, 2 K)."""
        parts = (self.q, self.qs, self.qss, self.m, self.c, self.g, self.ps, self.pss)
        both = np.concatenate(parts, axis=-1)
        return both.reshape(-1, both.shape[-1]).T


class PathPoint(Point):
    """A state on a path as symbols: constraints and objectives are written in it as in any other."""

    def __init__(self, description: Description, limits: Limits) -> None:
        import casadi

        n = description.n
        self.description, self.limits, self.n = description, limits, n
        self.b, self.speed, self.sdd = (casadi.SX.sym(name) for name in ("b", "speed", "sdd"))
        self.path = casadi.SX.sym("path", 6 * n + 6)
        q, qs, qss, m, c, g, ps, pss = casadi.vertsplit(self.path, [*range(0, 6 * n + 1, n), 6 * n + 3, 6 * n + 6])
        self.q, self.qd, self.qdd = q, qs * self.speed, qs * self.sdd + qss * self.b
        self.load = casadi.SX(LOAD, 0)
        self._tau = m * self.sdd + c * self.b + g
        self._tool = ps * self.speed, ps * self.sdd + pss * self.b

    @cached_property
    def tau(self) -> casadi.SX:
        """Joint torques, n x 1, N m and N."""
        return self._tau

    @cached_property
    def tool_velocity(self) -> casadi.SX:
        """The velocity of the tool's origin, 3 x 1, m/s."""
        return self._tool[0]

    @cached_property
    def tool_acceleration(self) -> casadi.SX:
        """Its acceleration, 3 x 1, m/s^2."""
        return self._tool[1]


@dataclass(frozen=True, eq=False)
class TimingRows:
    """Rows of one kind that are linear in b: low <= left b_k + right b_(k+1) <= high; scaled so that 1 is a limit."""

    what: str
    limited: Array
    """Which joints have such a limit, shape (n,): one row for each of those."""
    left: Array
    """Shape (2, K, rows)."""
    right: Array
    rest: Array
    """What is used already where nothing moves."""

    @classmethod
    def of(cls, what: str, states: PathStates, by_sdd: Array, by_b: Array, rest: Array, limit: Array) -> TimingRows:
        """Return the rows |by_sdd sdd + by_b b + rest| <= limit of those joints that have one."""
        limited = np.isfinite(limit)
        by_sdd, by_b, rest = (array[..., limited] / limit[limited] for array in (by_sdd, by_b, rest))
        slope = by_sdd / (2 * states.steps[:, None])
        left, right = np.stack([by_b[0] - slope[0], -slope[1]]), np.stack([slope[0], by_b[1] + slope[1]])
        return cls(what, limited, left, right, rest)

    def bounds(self, shares: Array) -> tuple[Array, Array]:
        """Return bounds of ``left b_k + right b_(k+1)``, shape (2, K, rows), that keep shares (K, n) in reserve."""
        most = 1 - shares[:, self.limited]
        return -most - self.rest, most - self.rest

    def largest(self, shape: Array) -> float:
        """Return by what b of a shape (K+1,) may be multiplied to keep the rows where standing still keeps them."""
        return float(self._most(self.left * shape[:-1, None] + self.right * shape[1:, None]).min())

    @property
    def even(self) -> Array:
        """The largest b that keeps the rows where it does not change, shape (2, K)."""
        return self._most(self.left + self.right)

    def _most(self, used: Array) -> Array:
        spare = 1 - np.sign(used) * self.rest
        with np.errstate(divide="ignore", invalid="ignore"):
            most = np.where((spare > 0) & (used != 0), spare / np.abs(used), np.inf)
        smallest: Array = most.min(axis=2, initial=np.inf)
        return smallest


@dataclass(frozen=True)
class Terms:
    """What is not linear in b, written in a :class:`PathPoint`."""

    description: Description
    objective: Objective
    constraints: tuple[Constraint, ...]
    torque: tuple[float, ...]
    velocity: tuple[float, ...]
    """Limits, by which they are measured."""

    @classmethod
    def of(
        cls, description: Description, objective: Objective, constraints: tuple[Constraint, ...], limits: Limits
    ) -> Terms | None:
        """Return an objective's and constraints' terms, None where all of them are linear."""
        if objective.only_time and not constraints:
            return None
        return cls(description, objective, constraints, tuple(limits.torque.tolist()), tuple(limits.velocity.tolist()))

    @cached_property
    def point(self) -> PathPoint:
        """Their symbols."""
        limits = Limits.of(self.description, torque=self.torque, velocity=self.velocity)
        return PathPoint(self.description, limits)

    @cached_property
    def rows(self) -> list[casadi.SX]:
        """Each constraint's rows."""
        import casadi

        return [constraint.rows(self.point, casadi.SX(0, 1)) for constraint in self.constraints]

    @property
    def counts(self) -> tuple[int, ...]:
        """How many rows each constraint has."""
        return tuple(int(row.numel()) for row in self.rows)

    @cached_property
    def function(self) -> casadi.Function:
        """From sdd, b, speed and a path's numbers to rows and the cost of each second."""
        import casadi

        point = self.point
        cost = casadi.SX(0)
        for term in self.objective.terms:
            integrand = term.integrand(point)
            if integrand is not None:
                cost += term.weight * integrand
        inputs = [point.sdd, point.b, point.speed, point.path]
        return casadi.Function("on_path", inputs, [casadi.vertcat(*self.rows), cost], {"cse": True})


class TimingProgram:
    """A program for K intervals with so many linear rows at each end; made once for each combination.

    Its numbers are the duration and b at the knots inside, in units of a time that its caller chooses; its rows are
    the linear ones, (2, K, rows) flattened; those of ``terms``, a column of rows for each end, left ends first; and by
    how much the intervals take longer than the duration. In least time it is convex. Other objectives are not: slow
    motions linger where gravity is least, and logarithms of b follow them over their decades.
    """

    def __init__(self, intervals: int, rows: int, terms: Terms | None) -> None:
        import casadi

        K = intervals
        self.intervals, self.rows, self.terms = intervals, rows, terms
        x, steps = casadi.MX.sym("x", K), casadi.MX.sym("steps", 1, K)
        left, right = casadi.MX.sym("left", rows, 2 * K), casadi.MX.sym("right", rows, 2 * K)
        path = casadi.MX.sym("path", terms.function.numel_in(3) if terms else 0, 2 * K)
        rate, scale = casadi.MX.sym("rate"), casadi.MX.sym("scale")
        self.logarithmic = terms is not None and not terms.objective.only_time
        inside = casadi.exp(x[1:]).T if self.logarithmic else x[1:].T
        duration, rest = x[0], casadi.DM(1, 1)
        b, speed = casadi.horzcat(rest, inside, rest), casadi.horzcat(rest, casadi.sqrt(inside), rest)
        # Written as a sum of speeds: at rest the square root has no derivative, and there it is a constant.
        times = 2 * steps / (speed[:-1] + speed[1:])
        b0, b1 = (casadi.repmat(casadi.horzcat(part, part), rows, 1) for part in (b[:-1], b[1:]))
        g, f = [casadi.vec(left * b0 + right * b1)], scale * duration
        if terms is not None:
            sdd = (b[1:] - b[:-1]) / (2 * steps)
            both = [casadi.horzcat(*pair) for pair in ((sdd, sdd), (b[:-1], b[1:]), (speed[:-1], speed[1:]))]
            values = terms.function.map("along", "serial", 2 * K, [], [])(
                both[0] * rate**2, both[1] * rate**2, both[2] * rate, path
            )
            g.append(casadi.vec(values[0]))
            weight = sum(term.weight for term in terms.objective.terms if isinstance(term, Time))
            f = scale / rate * (weight * duration + casadi.dot(casadi.horzcat(times, times) / 2, values[1]))
        g.append(casadi.sum2(times) - duration)
        p = casadi.vertcat(*(casadi.vec(part) for part in (steps, left, right, path, rate, scale)))
        tolerance = LEAST_TIME if terms is None or terms.objective.has_time else SMOOTH
        program = {"x": x, "p": p, "f": f, "g": casadi.vertcat(*g)}
        self.solver = Solver(program, 1, tolerance=tolerance, expand=False)

    def numbers(self, duration: float, b: Array) -> Array:
        """Return the program's numbers for b at the knots inside, shape (K-1,)."""
        with np.errstate(divide="ignore"):
            return np.concatenate([[duration], np.log(b) if self.logarithmic else b])

    def squares(self, x: Array) -> Array:
        """Return b at all knots, shape (K+1,), of the program's numbers."""
        inside = np.exp(x[1:]) if self.logarithmic else np.maximum(x[1:], 0.0)
        return np.concatenate([[0.0], inside, [0.0]])

    def parameters(self, states: PathStates, rows: list[TimingRows], unit: float, scale: float) -> Array:
        """Return the program's parameters; ``unit``: its time, s."""
        left, right = (self._side(rows, side) / unit**2 for side in ("left", "right"))
        path = states.coefficients.ravel(order="F") if self.terms else np.zeros(0)
        return np.concatenate([states.steps, left.ravel(), right.ravel(), path, [1 / unit, scale]])

    def _side(self, rows: list[TimingRows], side: str) -> Array:
        arrays = [getattr(row, side) for row in rows]
        return np.concatenate(arrays, axis=-1) if arrays else np.zeros((2, self.intervals, 0))


@lru_cache(maxsize=16)
def timing_program(intervals: int, rows: int, terms: Terms | None) -> TimingProgram:
    """Return a program, made when it is first asked for."""
    return TimingProgram(intervals, rows, terms)


def speed_bounds(
    states: PathStates, limits: Limits, shares: Array, constraints: list[tuple[ToolSpeed, Array]]
) -> Array:
    """Return the largest b of each knot by limits of speed, shape (K+1,).

    Parameters
    ----------
    shares
        Of each joint's velocity kept in reserve, shape (K, n).
    constraints
        Speeds of the tool, with the shares of their squares kept in reserve, shape (K, 1).
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        joints = ((1 - shares) * limits.velocity / np.abs(states.qs)) ** 2
        most = np.where(np.isnan(joints), np.inf, joints).min(axis=2)
        for constraint, share in constraints:
            most = np.minimum(most, constraint.limit**2 * (1 - share[:, 0]) / np.sum(states.ps**2, axis=2))
    bounds = np.full(most.shape[1] + 1, np.inf)
    bounds[:-1] = most[0]
    bounds[1:] = np.minimum(bounds[1:], most[1])
    return bounds
