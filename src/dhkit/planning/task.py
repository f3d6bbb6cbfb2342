"""Task of one motion, and the bounds of a program's variables and rows that follow from it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dhkit.description import Array, Description
from dhkit.planning.certificate import Checker, position_sizes
from dhkit.planning.collision_avoidance import NO_AVOIDANCE, CollisionAvoidance
from dhkit.planning.mesh import Curve, Mesh
from dhkit.planning.problem import MIN_LEG_DURATION, Problem, Rows
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
    def is_loaded(self) -> bool:
        """Whether the tool carries a payload."""
        return self.load is not None

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

    def at_knots(self, what: str, count: int) -> Array:
        """Return the margins at knots, shape (intervals + 1, count), without unit: the larger of both sides."""
        shares = self.of(what, count)
        edge = np.zeros((1, count))
        return np.maximum(np.vstack([shares, edge]), np.vstack([edge, shares]))

    def at_points(self, what: str, count: int, points: int) -> Array:
        """Return the margins at a program's points, shape (points, count).

        Points are one or more in every interval, or the knots (all, or the inner ones) followed by the midpoints.
        """
        shares, K = self.of(what, count), self.mesh.intervals
        if points % K == 0:
            return np.tile(shares, (points // K, 1))
        knots = self.at_knots(what, count)
        return np.vstack([knots if points == 2 * K + 1 else knots[1:-1], shares])

    def raised(self, what: str, excess: Array) -> Margins:
        """Return margins raised by an excess, shape (intervals, rows), without unit (shares of the limit)."""
        wider = np.minimum(self.of(what, excess.shape[1]) + np.maximum(excess, 0.0), 1 - MIN_LIMIT_SHARE)
        return Margins(self.mesh, {**self.shares, what: wider})


def x_bounds(task: PlanTask, mesh: Mesh, margins: Margins, *, jerk_counts: bool) -> tuple[Array, Array]:
    """Return the lower and upper bounds of a program's variables, shape (variables,) each, SI units."""
    n, K, limits = len(task.start_velocity), mesh.intervals, task.limits
    room = margins.at_knots("position", n) * position_sizes(limits)
    q = limits.lower + room, limits.upper - room
    speed = limits.velocity * (1 - margins.at_knots("velocity", n))
    qd = -speed, speed.copy()
    columns = mesh.curve.columns(K)
    most = np.tile(limits.acceleration, (columns, 1))
    qdd = -most, most.copy()
    for k, point in zip((0, *mesh.ends), task.points, strict=True):
        for bound in q:
            bound[k] = point
    for k, velocity in ((0, task.start_velocity), (-1, task.goal_velocity)):
        for bound in qd:
            bound[k] = velocity
        if jerk_counts:
            for bound in qdd:
                bound[k] = 0.0
    legs = len(mesh.legs)
    low, high = (
        np.concatenate([np.full(legs, first), *(bounds[side].ravel() for bounds in (q, qd, qdd))])
        for side, first in enumerate((MIN_LEG_DURATION, np.inf))
    )
    if task.duration is not None and legs == 1:
        low[0] = high[0] = task.duration
    return low, high


def g_bounds(task: PlanTask, problem: Problem, rows: list[Rows], margins: Margins) -> tuple[Array, Array]:
    """Return the lower and upper bounds of a program's rows, shape (rows,) each, in the units of the rows."""
    limits, low, high = task.limits, [], []
    for row in rows:
        shares = margins.at_points(row.what, row.count, row.points) if row.what in margins.shares else 0.0
        a: Array = np.tile(row.low, (row.points, 1))
        b: Array = np.tile(row.high, (row.points, 1))
        match row.what:
            case "position":
                room = shares * position_sizes(limits)
                zeros = np.zeros_like(a)
                a, b = limits.lower + room + zeros, limits.upper - room + zeros
            case "velocity":
                b = limits.velocity * (1 - shares) + np.zeros_like(b)
                a = -b
            case "acceleration":
                b = limits.acceleration + np.zeros_like(b)
                a = -b
            case "jerk":
                b = limits.jerk + np.zeros_like(b)
                a = -b
            case "duration":
                if task.duration is not None:
                    a = b = np.full_like(a, task.duration)
            case "torque":
                b = limits.torque / problem.point.torque_scale * (1 - shares) + np.zeros_like(b)
                a = -b
            case _ if row.what in margins.shares:
                b = b - shares
                a = np.where(row.low == -row.high, -b, a)
        low.append(a.ravel())
        high.append(b.ravel())
    return np.concatenate(low), np.concatenate(high)


def worst_row(solution: Solution, rows: list[Rows], bounds: tuple[Array, Array]) -> tuple[Rows, int, float, float]:
    """Return the kind of row with the largest violation of bounds (rows,), its index, place (0 to 1), violation."""
    misses = np.maximum(bounds[0] - solution.g, solution.g - bounds[1])
    misses = np.where(np.isnan(misses), np.inf, misses)
    at, begin = int(np.argmax(misses)), 0
    for row in rows:
        size = row.count * row.points
        if at < begin + size:
            point, which = divmod(at - begin, row.count)
            return row, which, point / max(row.points - 1, 1), float(misses[at])
        begin += size
    raise AssertionError("a row of none")


def curve_for(n: int, has_time: bool, jerk_counts: bool) -> Curve:
    """Return the curve of accelerations with the fewest variables that comes near the optimum.

    Torques of time-optimal motions jump. Constant accelerations need twice as many intervals as linear ones, but are
    solved faster for arms of many joints.
    """
    if not has_time:
        return Curve.QUADRATIC
    if jerk_counts:
        return Curve.LINEAR
    return Curve.JUMPING if n <= MAX_SMALL_JOINTS else Curve.CONSTANT
