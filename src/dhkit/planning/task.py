"""Task of one motion, and the bounds of a program's variables and rows that follow from it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from dhkit.description import Array, Description
from dhkit.planning.blocks import Block, BlockProgram, Indices, Rows
from dhkit.planning.certificate import Checker, position_sizes
from dhkit.planning.collision_avoidance import NO_AVOIDANCE, CollisionAvoidance
from dhkit.planning.mesh import Curve, Mesh
from dhkit.planning.objectives import Objective
from dhkit.planning.problem import Problem
from dhkit.planning.solver import Solution
from dhkit.symbolic import Friction
from dhkit.trajectories import Limits

MAX_SMALL_JOINTS = 3
"""Largest number of joints of arms whose programs are small."""
MIN_LIMIT_SHARE = 0.05
"""Smallest share of a limit that margins leave."""


@dataclass(frozen=True, eq=False)
class PlanTask:
    """A motion through given configurations, with its limits and constraints."""

    arm: Description
    """The robot."""
    description: Description
    """The robot with its payload."""
    points: Array
    """Configurations of start, via points and goal, shape (legs + 1, n), rad and m."""
    start_velocity: Array
    goal_velocity: Array
    duration: float | None
    """Duration, s; None if it is optimized."""
    limits: Limits
    checker: Checker
    load: Array | None = None
    """Parameters of the payload, shape (10,)."""
    parameters: tuple[Array, ...] = ()
    """Parameters of each constraint."""
    friction: Friction | None = None
    avoidance: CollisionAvoidance = NO_AVOIDANCE

    @property
    def without_obstacles(self) -> PlanTask:
        """The same motion in free space."""
        return replace(self, avoidance=NO_AVOIDANCE, checker=replace(self.checker, avoidance=NO_AVOIDANCE))

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
    """Margins by which limits are tightened for a program, by kind: shares of the limit, shape (intervals, rows).

    Limits are tightened only in intervals in which they were exceeded, so that the motion stays fast elsewhere.
    """

    mesh: Mesh
    shares: dict[str, Array] = field(default_factory=dict)

    def of(self, what: str, count: int) -> Array:
        """Return the margins of a kind in each interval, shape (intervals, count), without unit."""
        return self.shares.get(what, np.zeros((self.mesh.intervals, count)))

    def at_points(self, what: str, count: int, intervals: Indices) -> Array:
        """Return the margins at points, shape (P, count), without unit: the larger of the intervals on both sides.

        Parameters
        ----------
        intervals
            First and last interval of each point, shape (P, 2).
        """
        shares = self.of(what, count)
        return np.maximum(shares[intervals[:, 0]], shares[intervals[:, 1]])

    def at_knots(self, what: str, count: int) -> Array:
        """Return the margins at knots, shape (intervals + 1, count), without unit."""
        k = np.arange(self.mesh.intervals + 1)
        return self.at_points(what, count, np.stack([np.maximum(k - 1, 0), np.minimum(k, k[-1] - 1)], axis=1))

    def raised(self, what: str, excess: Array) -> Margins:
        """Return margins raised by an excess, shape (intervals, rows), without unit (shares of the limit)."""
        wider = np.minimum(self.of(what, excess.shape[1]) + np.maximum(excess, 0.0), 1 - MIN_LIMIT_SHARE)
        return Margins(self.mesh, {**self.shares, what: wider})


def x_bounds(task: PlanTask, problem: Problem, margins: Margins, shortest_leg: float) -> tuple[Array, Array]:
    """Return the lower and upper bounds of a program's variables, shape (variables,) each, SI units.

    Parameters
    ----------
    shortest_leg
        Shortest duration of a leg, s.
    """
    limits, mesh, at = task.limits, problem.mesh, problem.variables
    n, low, high = problem.n, np.full(at.count, -np.inf), np.full(at.count, np.inf)

    def set_bounds(indices: Indices, lower: Array, upper: Array) -> None:
        low[indices], high[indices] = lower, upper

    room = margins.at_knots("position", n).T * position_sizes(limits)[:, None]
    set_bounds(at.q, limits.lower[:, None] + room, limits.upper[:, None] - room)
    if at.middles[0].size:
        room = margins.of("position", n).T * position_sizes(limits)[:, None]
        set_bounds(at.middles[0], limits.lower[:, None] + room, limits.upper[:, None] - room)
    speed = limits.velocity[:, None] * (1 - margins.at_knots("velocity", n).T)
    set_bounds(at.qd, -speed, speed)
    set_bounds(at.qdd, -limits.acceleration[:, None], limits.acceleration[:, None])
    for k, point in zip((0, *mesh.ends), task.points, strict=True):
        set_bounds(at.q[:, k], point, point)
    for k, velocity in ((0, task.start_velocity), (-1, task.goal_velocity)):
        set_bounds(at.qd[:, k], velocity, velocity)
        if problem.jerk_counts:
            set_bounds(at.qdd[:, k], np.zeros(n), np.zeros(n))
    low[at.durations] = shortest_leg
    if task.duration is not None and len(mesh.legs) == 1:
        low[at.durations] = high[at.durations] = task.duration
    return low, high


def g_bounds(task: PlanTask, problem: Problem, program: BlockProgram, margins: Margins) -> tuple[Array, Array]:
    """Return the lower and upper bounds of a program's rows, shape (rows,) each, in the units of the rows."""
    lows, highs = [], []
    for block in program.blocks:
        each = [_row_bounds(task, problem, margins, block, rows) for rows in block.rows]
        low, high = (np.concatenate([np.zeros((block.points, 0)), *side], axis=1) for side in zip(*each, strict=True))
        if block.is_limited is not None:
            low[~block.is_limited], high[~block.is_limited] = -np.inf, np.inf
        lows.append(low.ravel())
        highs.append(high.ravel())
    return np.concatenate(lows), np.concatenate(highs)


def _row_bounds(task: PlanTask, problem: Problem, margins: Margins, block: Block, rows: Rows) -> tuple[Array, Array]:
    """Return the bounds of rows of one kind, shape (P, count) each."""
    limits, shape = task.limits, (block.points, rows.count)
    shares = np.zeros(shape)
    if block.intervals is not None and rows.what in margins.shares:
        shares = margins.at_points(rows.what, rows.count, block.intervals)
    low, high = np.broadcast_to(rows.low, shape), np.broadcast_to(rows.high, shape)
    most: Array
    match rows.what:
        case "position":
            room = shares * position_sizes(limits)
            return limits.lower + room, limits.upper - room
        case "duration":
            least, longest = (-np.inf, np.inf) if task.duration is None else (task.duration, task.duration)
            return np.full(shape, least), np.full(shape, longest)
        case "velocity":
            most = limits.velocity * (1 - shares)
        case "acceleration":
            most = limits.acceleration + 0 * shares
        case "jerk":
            most = limits.jerk + 0 * shares
        case "torque":
            most = limits.torque / problem.point.torque_scale * (1 - shares)
        case _:
            high = high - shares
            return np.where(rows.low == -rows.high, -high, low), high
    return -most, most


def worst_row(
    solution: Solution, problem: Problem, program: BlockProgram, bounds: tuple[Array, Array]
) -> tuple[str, int, float, float]:
    """Return the kind of row with the largest violation of bounds (rows,), its index, place (0 to 1), violation."""
    misses = np.maximum(bounds[0] - solution.g, solution.g - bounds[1])
    misses = np.where(np.isnan(misses), np.inf, misses)
    at, begin = int(np.argmax(misses)), 0
    for block in program.blocks:
        if at < begin + block.count:
            point, which = divmod(at - begin, block.function.count)
            share = (
                1.0 if block.intervals is None else block.intervals[point].mean() / max(problem.mesh.intervals - 1, 1)
            )
            for rows in block.rows:
                if which < rows.count:
                    return rows.what, which, float(share), float(misses[at])
                which -= rows.count
        begin += block.count
    raise AssertionError("a row of none")


def curves_for(n: int, objective: Objective, *, jerk_counts: bool, friction: bool) -> tuple[Curve, ...]:
    """Return the curves of accelerations that are tried in turn.

    Torques of time-optimal motions jump, and so do those of least energy without losses in windings and, with friction,
    where a joint turns back. Constant accelerations need twice as many intervals as linear ones, but are solved faster
    for arms of many joints. Smooth objectives are nearest to their optimum with parabolas; these exceed limits between
    their points where torques nearly jump, as in motions in little more than the least time, for which the second
    curve serves.
    """
    if objective.has_time:
        if jerk_counts:
            return (Curve.LINEAR,)
        return (Curve.JUMPING if n <= MAX_SMALL_JOINTS else Curve.CONSTANT,)
    if jerk_counts:
        return (Curve.QUADRATIC, Curve.LINEAR)
    return (Curve.QUADRATIC, Curve.CONSTANT) if objective.is_smooth and not friction else (Curve.CONSTANT,)
