"""Common part of the programs along a path: the grid, the path's coefficients, and the limits of a state."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, Protocol, Self, TypeVar, cast

import numpy as np

from dhkit.description import Array
from dhkit.planning.along.path_states import PathPoint, PathStates
from dhkit.planning.criteria import Limit, size_of
from dhkit.planning.program import (
    Block,
    BlockProgram,
    Indices,
    LocalFunction,
    Margins,
    OptimizationProgram,
    RowKind,
    Rows,
    Scaling,
    Task,
    limit_rows,
)
from dhkit.trajectories import JointPath, Trajectory

if TYPE_CHECKING:
    import casadi

MAX_INTERVALS = 2000
"""Largest number of requested intervals; after refinement there may be twice as many."""
REFINED = 4
"""Factor by which the excess inside an interval falls if the interval is halved: it grows with the length squared."""


class Timed(Protocol):
    """A motion along a path on a grid."""

    @property
    def times(self) -> Array:
        """Times of the knots, shape (K+1,), s."""
        ...

    def lasting(self, duration: float) -> Self:
        """Return the same motion, slower or faster, with another duration, s."""
        ...


Profile = TypeVar("Profile", bound=Timed)


class IntervalSymbols(NamedTuple):
    """Symbols of an interval's parameters."""

    step: casadi.SX
    """Its length in s."""
    left: casadi.SX
    """The path's coefficients at its left end, see :class:`PathStates`."""
    right: casadi.SX
    """The path's coefficients at its right end."""
    given: list[casadi.SX]
    """Parameters of each constraint of the motion."""
    scale: casadi.SX
    """Scale of the cost."""

    @property
    def vector(self) -> casadi.SX:
        """All of them, in the order of the program's parameters."""
        import casadi

        return casadi.vertcat(self.step, self.left, self.right, *self.given, self.scale)


class PathProgram(OptimizationProgram[Profile]):
    """A program of one task along a path.

    Its parameters are, for each interval, the length in s and the path's coefficients at both ends; then those of all
    constraints, and the scale of the cost.

    Parameters
    ----------
    task
        The task, with its path.
    s
        Path parameters of the grid's knots, shape (K+1,).
    """

    small_step = 1e-3

    def __init__(self, task: Task, s: Array) -> None:
        self.task = task
        self.path = cast("JointPath", task.path)
        self.s = s
        self.intervals = len(s) - 1
        self.states = PathStates.of(task.loaded, self.path, s)
        self.point = PathPoint(task.loaded, task.limits, task.friction)
        self._limited = [
            (k, constraint)
            for k, (constraint, _) in task.checker.limiting.items()
            if constraint.moving and k not in (Limit.VELOCITY, Limit.JERK)
        ]
        K = self.intervals
        of_interval = 1 + 2 * int(self.point.path.numel())
        self.sizes = [len(parameters) for _, parameters in task.checker.every]
        of_all = sum(self.sizes) + 1
        self._power = task.objective.positive_parts(self.point)
        self.powers = int(self._power.numel())
        """Number of quantities of a state whose positive parts are in the objective."""
        own = of_interval * np.arange(K) + np.arange(of_interval)[:, None]
        common = K * of_interval + np.arange(of_all)
        self.parameters_at: Indices = np.vstack([own, np.tile(common[:, None], K)])
        """Indices of each interval's parameters, shape (parameters, K)."""
        self.parameter_count = K * of_interval + of_all

    def symbols(self) -> IntervalSymbols:
        """Return symbols of an interval's parameters."""
        import casadi

        symbol = casadi.SX.sym
        size = int(self.point.path.numel())
        given = [symbol(f"p{k}", count) for k, count in enumerate(self.sizes)]
        return IntervalSymbols(
            symbol("step"), symbol("left", size), symbol("right", size), given, symbol("scale")
        )

    def at_state(self, given: list[casadi.SX]) -> tuple[casadi.Function, list[Rows]]:
        """Return a state's rows and integrand as a function, and the kinds of the rows.

        The function's arguments are sdd, sd^2, sd, the path's coefficients, positive parts of powers, and ``given``.

        Parameters
        ----------
        given
            Parameters of all constraints.
        """
        import casadi

        point = self.point
        limits = limit_rows(self._limited, self.point, given)

        # A positive part max(0, P) is a variable u >= 0 with the row u - P >= 0.
        u = casadi.SX.sym("parts", self.powers)
        rows = casadi.vertcat(casadi.SX(0, 1), *(row for _, row in limits), u - self._power)
        integrand = self.task.objective.integrand(point) + casadi.sum1(u)
        inputs = [point.sdd, point.b, point.speed, point.path, u, *given]
        results = [rows, integrand]
        kinds = [
            *(kind for kind, _ in limits),
            Rows(RowKind.POSITIVE_PART, "positive power", self.powers),
        ]
        return casadi.Function("at_state", inputs, results, {"cse": True}), kinds

    def program(
        self,
        interval: Callable[..., tuple[LocalFunction, tuple[Rows, ...]]],
        inner: Indices,
        variables: int,
    ) -> BlockProgram:
        """Return the program of the intervals, and of the duration as its last row.

        Parameters
        ----------
        interval
            Returns the rows and the cost of an interval, with ``first=True`` or ``last=True`` of one at an end. Its
            variables are its duration, the positive parts at both its ends, and those of its knots that are inside the
            path.
        inner
            Indices of the variables at the inner knots, shape (k, K-1); those of the durations come before them.
        variables
            Number of variables besides positive parts, which come last.
        """
        import casadi

        K = self.intervals
        step = np.arange(K)
        self.positive_parts: Indices = variables + np.arange(2 * self.powers * K).reshape(
            2 * self.powers, K
        )
        """Indices of the positive parts at the left and the right end of each interval, shape (2 powers, K)."""
        own = np.vstack([step[None], self.positive_parts])
        each = np.stack([step, step], axis=1)

        # The first interval has an inner knot on its right only, the last one on its left only.
        of_first = np.vstack([own[:, :1], inner[:, :1]])
        of_last = np.vstack([own[:, -1:], inner[:, -1:]])
        between = np.vstack([own[:, 1:-1], inner[:, :-1], inner[:, 1:]])
        blocks = []
        for (function, rows), indices, part in (
            (interval(first=True), of_first, slice(None, 1)),
            (interval(), between, slice(1, -1)),
            (interval(last=True), of_last, slice(-1, None)),
        ):
            blocks.append(Block(function, indices, self.parameters_at[:, part], rows, each[part]))

        durations = casadi.SX.sym("total", K)
        duration = LocalFunction(durations, casadi.SX(0, 1), casadi.sum1(durations))
        kinds = (Rows(RowKind.DURATION, "duration", 1),)
        blocks.append(Block(duration, step[:, None], np.zeros((0, 1), dtype=int), kinds))
        return BlockProgram(
            variables + self.positive_parts.size, self.parameter_count, tuple(blocks)
        )

    def positive_powers(self, sd: Array, left: Array, right: Array) -> Array:
        """Return positive parts of powers at both ends of each interval, shape (2 powers, K).

        Parameters
        ----------
        sd
            Speeds at the knots, shape (K+1,), 1/s.
        left, right
            Accelerations at the ends of the intervals, shape (K,), 1/s^2.
        """
        of_left, of_right = self.states.coefficients
        begin = sd[:-1]
        end = sd[1:]
        at_left = self._powers(left[None], (begin * begin)[None], begin[None], of_left.T).toarray()
        at_right = self._powers(right[None], (end * end)[None], end[None], of_right.T).toarray()
        positive: Array = np.maximum(np.vstack([at_left, at_right]), 0.0)
        return positive

    @cached_property
    def _powers(self) -> casadi.Function:
        """The quantities whose positive parts are in the objective, as a function of states and coefficients."""
        import casadi

        point = self.point
        inputs = [point.sdd, point.b, point.speed, point.path]
        return casadi.Function("powers", inputs, [self._power], {"cse": True})

    def cost_unit(self, task: Task, guess: Profile) -> float:
        """Return the size of a guess's cost, the unit of the cost."""
        if task.objective.only_time:
            return float(guess.times[-1])
        return size_of(task.objective, self.trajectory(task, guess), task.loaded, task.friction)

    def scaling(self, unit: float, rate: float) -> Scaling:
        """Return units of durations, s, and of positive parts of powers; 1 for all others."""
        scaling = self.blocks.unscaled
        scaling.unit[: self.intervals] = unit
        scaling.unit[self.positive_parts] = rate
        units = {RowKind.TIME: unit, RowKind.DURATION: unit, RowKind.POSITIVE_PART: rate}
        row_units = self.blocks.row_units(lambda rows: units.get(rows.kind, 1.0))
        return Scaling(scaling.offset, scaling.unit, row_units)

    def parameters(self, task: Task, cost: float) -> Array:
        """Return the parameters, shape (parameters,), with a unit of the cost."""
        path = np.concatenate([self.states.steps[:, None], *self.states.coefficients], axis=1)
        given = [parameters for _, parameters in task.checker.every]
        return np.concatenate([path.ravel(), *given, [1 / cost]])

    @abstractmethod
    def law(self, found: Profile) -> tuple[Array, Array]:
        """Return s(t): its breaks (K+1,), s, and ascending coefficients, shape (K, p+1)."""

    def trajectory(self, task: Task, found: Profile) -> Trajectory:
        """Return the motion along the path, with exactly the duration of the task if it has one."""
        times, coefficients = self.law(found)
        trajectory = self.path.timed(times, coefficients)
        return trajectory if task.duration is None else trajectory.slowed(task.duration / times[-1])

    def interval_of(self, trajectory: Trajectory, found: Profile) -> Indices:
        """Return the interval that each piece of a trajectory lies in: its breaks are between those of the grid."""
        ends = found.times / found.times[-1]
        breaks = trajectory.breaks / trajectory.duration
        interval: Indices = np.searchsorted(ends, (breaks[1:] + breaks[:-1]) / 2) - 1
        return np.clip(interval, 0, self.intervals - 1)

    def place(self, interval: float) -> str:
        """Return a place of the motion as text."""
        return f"s = {self.s[int(min(interval, self.intervals - 1))]:.4g}"

    def tightened(self, margins: Margins, more: dict[int, Array]) -> tuple[Self, Margins]:
        """Return the program with intervals halved where limits are exceeded most, and margins raised elsewhere."""
        is_refined = np.any(
            [(share > self.small_step).any(axis=1) for share in more.values()], axis=0
        )
        if not is_refined.any() or self.intervals + is_refined.sum() > 2 * MAX_INTERVALS:
            return self, margins.raised(more)

        # Halving an interval leaves a quarter of its excess, for which the margin is raised.
        factor = np.where(is_refined, 1 / REFINED, 1.0)[:, None]
        margins = margins.raised({limit: factor * share for limit, share in more.items()})
        middles = ((self.s[1:] + self.s[:-1]) / 2)[is_refined]
        return type(self)(self.task, np.sort(np.append(self.s, middles))), margins.divided(
            1 + is_refined
        )
