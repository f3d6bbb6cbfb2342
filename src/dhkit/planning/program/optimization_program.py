"""The task of one motion, and a nonlinear program that solves tasks: guesses, arguments, and motions from solutions.

Margins tighten the limits of a task in the intervals of a program in which a solution has exceeded them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Generic, NamedTuple, TypeVar

import numpy as np

from dhkit.description import Array, Description
from dhkit.planning.certificate import NO_AVOIDANCE, Checker, CollisionAvoidance
from dhkit.planning.criteria import Constraint, LoadedArm, Objective, Point
from dhkit.planning.program.blocks import Block, BlockProgram, Indices, RowKind, Rows, Scaling
from dhkit.planning.program.solver import Solution, Solver
from dhkit.symbolic import Friction
from dhkit.trajectories import JointPath, Limits, Trajectory

if TYPE_CHECKING:
    import casadi

MIN_LIMIT_SHARE = 0.05
"""Smallest share of a limit that margins leave."""
Iterate = TypeVar("Iterate")
"""A motion as a program describes it: a guess or a solution."""


@dataclass(frozen=True, eq=False)
class Task:
    """A motion through given configurations or along a given path, with its objective, limits and constraints."""

    arm: Description
    loaded: LoadedArm
    """The arm with its payload."""
    objective: Objective
    points: Array
    """Configurations of start, via points and goal, shape (legs + 1, n), rad and m."""
    start_velocity: Array
    goal_velocity: Array
    duration: float | None
    """Duration, s; None if it is optimized."""
    checker: Checker
    """The limits and constraints."""
    load: Array | None = None
    """Parameters of the payload, shape (10,)."""
    path: JointPath | None = None
    """The path to follow; None for the best one."""

    @property
    def limits(self) -> Limits:
        """The limits of the joints."""
        return self.checker.limits

    @property
    def friction(self) -> Friction | None:
        """The friction of the joints."""
        return self.checker.friction

    @property
    def avoidance(self) -> CollisionAvoidance:
        """The obstacles."""
        return self.checker.avoidance

    def avoiding(self, avoidance: CollisionAvoidance) -> Task:
        """Return the same motion among other obstacles."""
        return replace(self, checker=replace(self.checker, avoidance=avoidance))

    @property
    def without_obstacles(self) -> Task:
        """The same motion in free space."""
        return self.avoiding(NO_AVOIDANCE)

    @property
    def is_loaded(self) -> bool:
        """Whether the tool carries a payload."""
        return self.load is not None

    @property
    def span(self) -> float:
        """Largest difference of a joint's values between the given configurations, rad or m."""
        return float(np.ptp(self.points, axis=0).max())

    @property
    def rests(self) -> bool:
        """Whether the motion begins and ends at rest, so that it can be slowed down."""
        return not (self.start_velocity.any() or self.goal_velocity.any())


@dataclass(frozen=True, eq=False)
class Margins:
    """Margins by which limits are tightened for a program: shares of the limit, shape (intervals, rows), by its place.

    Limits are tightened only in intervals in which they were exceeded, so that the motion stays fast elsewhere.
    """

    intervals: int
    shares: dict[int, Array] = field(default_factory=dict)

    def of(self, limit: int, count: int) -> Array:
        """Return the margins of a limit in each interval, shape (intervals, count), without unit."""
        return self.shares.get(limit, np.zeros((self.intervals, count)))

    def at_points(self, limit: int, count: int, intervals: Indices) -> Array:
        """Return the margins at points, shape (P, count), without unit: the larger of the intervals on both sides.

        Parameters
        ----------
        intervals
            First and last interval of each point, shape (P, 2).
        """
        shares = self.of(limit, count)
        return np.maximum(shares[intervals[:, 0]], shares[intervals[:, 1]])

    def at_knots(self, limit: int, count: int) -> Array:
        """Return the margins at knots, shape (intervals + 1, count), without unit."""
        # Knot k lies between the intervals k - 1 and k; the first and the last have one.
        k = np.arange(self.intervals + 1)
        before = np.maximum(k - 1, 0)
        after = np.minimum(k, self.intervals - 1)
        return self.at_points(limit, count, np.stack([before, after], axis=1))

    def raised(self, more: dict[int, Array]) -> Margins:
        """Return margins raised by shares of limits, shape (intervals, rows) each."""
        shares = dict(self.shares)
        for limit, share in more.items():
            shares[limit] = np.minimum(self.of(limit, share.shape[1]) + share, 1 - MIN_LIMIT_SHARE)
        return Margins(self.intervals, shares)

    def divided(self, copies: Indices) -> Margins:
        """Return the margins of a finer mesh: each interval is divided into ``copies`` (intervals,)."""
        shares = {limit: np.repeat(share, copies, axis=0) for limit, share in self.shares.items()}
        return Margins(int(copies.sum()), shares)


@dataclass(frozen=True, eq=False)
class Arguments:
    """Arguments of a program."""

    x: Array
    """Variables of the guess, shape (variables,), SI units."""
    parameters: Array
    """Parameters of the program, shape (parameters,)."""
    bounds: tuple[Array, Array]
    """Lower and upper bounds of the variables, shape (variables,) each, SI units."""
    scaling: Scaling


@dataclass(frozen=True, eq=False)
class Starts(Generic[Iterate]):
    """Guesses from which a program is solved in turn, until one leads to a motion."""

    guesses: Sequence[Callable[[], Iterate]]
    compared: int = 0
    """Number of the first guesses that are all solved, of which the best solution is taken first."""


class OptimizationProgram(ABC, Generic[Iterate]):
    """A nonlinear program whose solutions are motions of tasks."""

    blocks: BlockProgram
    solver: Solver
    intervals: int
    """Number of intervals of its mesh."""
    small_step: float
    """Relative slow-down up to which a solution is slowed down; beyond it, exceeded limits are tightened."""

    @abstractmethod
    def starts(self, task: Task, warm: Trajectory | None) -> Starts[Iterate]:
        """Return guesses for a task; ``warm`` is a similar motion."""

    @abstractmethod
    def arguments(self, task: Task, guess: Iterate, margins: Margins) -> Arguments:
        """Return the arguments of a solution."""

    @abstractmethod
    def iterate(self, x: Array) -> Iterate:
        """Return the motion of variables, shape (variables,), SI units."""

    @abstractmethod
    def trajectory(self, task: Task, found: Iterate) -> Trajectory:
        """Return a solution as a trajectory."""

    @abstractmethod
    def interval_of(self, trajectory: Trajectory, found: Iterate) -> Indices:
        """Return the interval of the mesh that each piece of a solution's trajectory lies in, shape (pieces,)."""

    @abstractmethod
    def next_guess(self, guess: Iterate, found: Iterate) -> Iterate:
        """Return the guess for another solution with tightened limits, after one from ``guess``."""

    @abstractmethod
    def place(self, interval: float) -> str:
        """Return a place of the motion as text, given by the index of an interval."""

    def tightened(
        self, margins: Margins, more: dict[int, Array]
    ) -> tuple[OptimizationProgram[Iterate], Margins]:
        """Return the program and the margins for another solution; ``more`` are margins to add, (intervals, rows)."""
        return self, margins.raised(more)


def row_bounds(task: Task, blocks: BlockProgram, margins: Margins) -> tuple[Array, Array]:
    """Return the lower and upper bounds of a program's rows, shape (rows,) each, in the units of the rows."""
    lows = [np.zeros(0)]
    highs = [np.zeros(0)]
    for block in blocks.blocks:
        if not block.rows:
            continue
        each = [_bounds(task, margins, block, rows) for rows in block.rows]
        lows.append(np.concatenate([low for low, _ in each], axis=1).ravel())
        highs.append(np.concatenate([high for _, high in each], axis=1).ravel())
    return np.concatenate(lows), np.concatenate(highs)


def _bounds(task: Task, margins: Margins, block: Block, rows: Rows) -> tuple[Array, Array]:
    """Return the bounds of rows of one kind, shape (P, count) each."""
    shape = (block.points, rows.count)
    none = np.full(shape, np.inf)
    zero = np.zeros(shape)
    match rows.kind:
        case RowKind.LIMIT:
            constraint, parameters = task.checker.every[rows.limit]
            shares = zero
            if block.intervals is not None and rows.limit in margins.shares:
                shares = margins.at_points(rows.limit, rows.count, block.intervals)
            low, high = constraint.bounds(parameters, shares)
            if block.is_limited is None:
                return low, high
            limited = block.is_limited[:, None]
            return np.where(limited, low, -none), np.where(limited, high, none)
        case RowKind.DURATION if task.duration is not None:
            return zero + task.duration, zero + task.duration
        case RowKind.DURATION:
            return -none, none
        case RowKind.PLANE | RowKind.POSITIVE_PART:
            return zero, none
        case RowKind.TIME:
            # For least time intervals may take less than their durations, which keeps the program convex.
            return -none if task.objective.only_time else zero, zero
    return zero, zero


class RowViolation(NamedTuple):
    """A row that misses its bounds."""

    rows: Rows
    """The rows of one kind to which it belongs."""
    place: int
    """Its index in them."""
    interval: float
    """The mean of the mesh's intervals to which its point belongs; infinite for the whole motion."""
    violation: float
    """Distance from its bounds, in the unit of the row; infinite if the row is not a number."""


def worst_row(
    solution: Solution, blocks: BlockProgram, bounds: tuple[Array, Array]
) -> RowViolation:
    """Return the row with the largest violation of bounds (rows,)."""
    lower, upper = bounds
    misses = np.maximum(lower - solution.g, solution.g - upper)
    misses = np.where(np.isnan(misses), np.inf, misses)
    worst = int(np.argmax(misses))

    # Rows are in the order of blocks, of their points, and of their kinds.
    ends = np.cumsum([block.count for block in blocks.blocks])
    k = int(np.searchsorted(ends, worst, side="right"))
    block = blocks.blocks[k]
    point, row = divmod(worst - int(ends[k] - block.count), block.function.count)
    interval = np.inf if block.intervals is None else block.intervals[point].mean()

    ends = np.cumsum([rows.count for rows in block.rows])
    kind = int(np.searchsorted(ends, row, side="right"))
    rows = block.rows[kind]
    return RowViolation(
        rows, row - int(ends[kind] - rows.count), float(interval), float(misses[worst])
    )


def limit_rows(
    constraints: Iterable[tuple[int, Constraint]], point: Point, parameters: Sequence[casadi.SX]
) -> list[tuple[Rows, casadi.SX]]:
    """Return the rows of constraints, given with their places, in a state of a motion."""
    rows = []
    for k, constraint in constraints:
        expression = constraint.checked_rows(point, parameters[k])
        kind = Rows(
            RowKind.LIMIT, constraint.what, expression.numel(), k, of_joints=constraint.of_joints
        )
        rows.append((kind, expression))
    return rows
