"""What a search needs of a nonlinear program: guesses, its arguments, and motions from its solutions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from dhkit.description import Array
from dhkit.planning.criteria import Constraint, Point
from dhkit.planning.program.blocks import Block, BlockProgram, Indices, RowKind, Rows, Scaling
from dhkit.planning.program.solver import Solution, Solver
from dhkit.planning.program.task import Margins, Task
from dhkit.trajectories import Trajectory

if TYPE_CHECKING:
    import casadi

Iterate = TypeVar("Iterate")
"""A motion as a program describes it: a guess or a solution."""


@dataclass(frozen=True, eq=False)
class Arguments:
    """Arguments of a program."""

    x: Array
    """Variables of the guess, shape (variables,), SI units."""
    parameters: Array
    """Shape (parameters,)."""
    bounds: tuple[Array, Array]
    """Lower and upper bounds of the variables, shape (variables,) each, SI units."""
    scaling: Scaling


@dataclass(frozen=True, eq=False)
class Starts(Generic[Iterate]):
    """Guesses from which a program is solved in turn, until one leads to a motion."""

    guesses: Sequence[Callable[[], Iterate]]
    compared: int = 0
    """Number of the first guesses that are all solved, of which the best solution is taken first."""


class Program(ABC, Generic[Iterate]):
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
    def again(self, guess: Iterate, found: Iterate) -> Iterate:
        """Return the guess for another solution with tightened limits, after one from ``guess``."""

    @abstractmethod
    def place(self, interval: float) -> str:
        """Return a place of the motion as text, given by the index of an interval."""

    def tightened(self, margins: Margins, more: dict[int, Array]) -> tuple[Program[Iterate], Margins]:
        """Return the program and the margins for another solution; ``more`` are margins to add, (intervals, rows)."""
        return self, margins.raised(more)


def row_bounds(task: Task, blocks: BlockProgram, margins: Margins) -> tuple[Array, Array]:
    """Return the lower and upper bounds of a program's rows, shape (rows,) each, in the units of the rows."""
    lows, highs = [np.zeros(0)], [np.zeros(0)]
    for block in blocks.blocks:
        if not block.rows:
            continue
        each = [_bounds(task, margins, block, rows) for rows in block.rows]
        low, high = (np.concatenate(side, axis=1) for side in zip(*each, strict=True))
        lows.append(low.ravel())
        highs.append(high.ravel())
    return np.concatenate(lows), np.concatenate(highs)


def _bounds(task: Task, margins: Margins, block: Block, rows: Rows) -> tuple[Array, Array]:
    """Return the bounds of rows of one kind, shape (P, count) each."""
    shape = (block.points, rows.count)
    none, zero = np.full(shape, np.inf), np.zeros(shape)
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


def worst_row(solution: Solution, blocks: BlockProgram, bounds: tuple[Array, Array]) -> tuple[Rows, int, float, float]:
    """Return the rows with the largest violation of bounds (rows,), its index in them, its interval, the violation."""
    misses = np.maximum(bounds[0] - solution.g, solution.g - bounds[1])
    misses = np.where(np.isnan(misses), np.inf, misses)
    at, begin = int(np.argmax(misses)), 0
    for block in blocks.blocks:
        if at < begin + block.count:
            point, which = divmod(at - begin, block.function.count)
            interval = np.inf if block.intervals is None else block.intervals[point].mean()
            for rows in block.rows:
                if which < rows.count:
                    return rows, which, float(interval), float(misses[at])
                which -= rows.count
        begin += block.count
    raise AssertionError("a row of none")


def limit_rows(
    constraints: Iterable[tuple[int, Constraint]], point: Point, parameters: Sequence[casadi.SX]
) -> list[tuple[Rows, casadi.SX]]:
    """Return the rows of constraints, given with their places, in a state of a motion."""
    rows = []
    for k, constraint in constraints:
        expression = constraint.checked_rows(point, parameters[k])
        kind = Rows(RowKind.LIMIT, constraint.what, expression.numel(), k, of_joints=constraint.of_joints)
        rows.append((kind, expression))
    return rows
