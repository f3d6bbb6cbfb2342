"""Motions on a mesh: the intervals of legs, the shape of acceleration in them, and trajectories to and from them.

A program's solution becomes a trajectory that passes exactly through the given configurations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Description
from dhkit.planning.program.blocks import Indices
from dhkit.trajectories import Trajectory

GRADING = 0.9
"""Grading of the mesh towards its ends, 0 (uniform) to 1: robots reach their speed in a small part of a motion."""
MIN_LEG_INTERVALS = 6
"""Smallest number of intervals of a leg."""
ROUNDS = 2
"""Number of corrections: the second removes the rounding error of the first."""


class Curve(Enum):
    """Shape of the acceleration in an interval."""

    CONSTANT = 0
    """Constant, with jumps at the knots."""
    JUMPING = 1
    """Linear, with jumps at the knots: each end of an interval has its own acceleration."""
    LINEAR = 2
    """Linear and continuous, with constant jerk."""
    QUADRATIC = 3
    """Quadratic and continuous, given at knots and midpoints: smooth objectives converge fast."""

    def columns(self, intervals: int) -> int:
        """Return the number of acceleration variables of each joint."""
        return (intervals, 2 * intervals, intervals + 1, 2 * intervals + 1)[self.value]

    def columns_of(self, interval: int) -> tuple[int, ...]:
        """Return the columns of acceleration variables that an interval depends on, in order of time."""
        k = interval
        return ((k,), (2 * k, 2 * k + 1), (k, k + 1), (2 * k, 2 * k + 1, 2 * k + 2))[self.value]

    @property
    def column_weights(self) -> tuple[float, ...]:
        """Weights of an interval's columns in a sum over all columns, by their shares of time."""
        return ((1.0,), (1 / 2, 1 / 2), (1 / 2, 1 / 2), (1 / 6, 2 / 3, 1 / 6))[self.value]

    def abc(self, columns: Sequence[Any]) -> tuple[Any, Any, Any]:
        """Return the accelerations at the beginning, the middle and the end of an interval, from its columns."""
        if self is Curve.CONSTANT:
            return columns[0], columns[0], columns[0]
        if self is Curve.QUADRATIC:
            return columns[0], columns[1], columns[2]
        return columns[0], (columns[0] + columns[1]) / 2, columns[1]

    def values(self, qdd: Array) -> tuple[Array, Array, Array]:
        """Return the same of all intervals, shape (intervals, n) each, from all columns, shape (columns, n)."""
        step = (1, 2, 1, 2)[self.value]
        count = (len(qdd) // step) if self in (Curve.CONSTANT, Curve.JUMPING) else (len(qdd) - 1) // step
        return self.abc([qdd[k : k + step * count : step] for k in range(len(self.columns_of(0)))])


@dataclass(frozen=True)
class Mesh:
    """Intervals of consecutive legs; a leg leads from one given configuration to the next."""

    legs: tuple[int, ...]
    """Number of intervals of each leg."""
    curve: Curve

    @classmethod
    def of(cls, intervals: int, legs: int, curve: Curve) -> Mesh:
        """Return a mesh that divides intervals among legs, at least ``MIN_LEG_INTERVALS`` for each."""
        each = max(MIN_LEG_INTERVALS, -(-intervals // legs))
        return cls((each,) * legs, curve)

    @property
    def intervals(self) -> int:
        """Number of intervals of all legs."""
        return sum(self.legs)

    @property
    def ends(self) -> tuple[int, ...]:
        """Indices of the knots at which legs end, with the last one."""
        return tuple(np.cumsum(self.legs).tolist())

    @property
    def leg(self) -> NDArray[np.int_]:
        """Index of the leg of each interval, without unit, shape (intervals,)."""
        return np.repeat(np.arange(len(self.legs)), self.legs)

    @property
    def shares(self) -> Array:
        """Share of each interval in its leg's duration, shape (intervals,)."""
        return np.concatenate([np.diff(graded(count)) for count in self.legs])

    def times(self, durations: Array) -> Array:
        """Return the times of the knots, shape (intervals + 1,), s, for durations of the legs, shape (legs,), s."""
        return np.concatenate([[0.0], np.cumsum(self.shares * durations[self.leg])])


def graded(intervals: int) -> Array:
    """Return knots from 0 to 1 that are closer together at the ends, shape (intervals + 1,)."""
    x = np.linspace(0.0, 1.0, intervals + 1)
    knots: Array = (1 - GRADING) * x + GRADING * (1 - np.cos(np.pi * x)) / 2
    return knots


class Interval(NamedTuple):
    """One interval of a motion: its duration h (s), the state at its beginning, and the acceleration in it.

    The acceleration is at most quadratic, given by its values a, b and c at the beginning, the middle and the end; a
    linear one has b = (a + c) / 2, a constant one a = b = c. All may be arrays or CasADi's symbols.
    """

    h: Any
    q: Any
    qd: Any
    a: Any
    b: Any
    c: Any

    @property
    def q_end(self) -> Any:
        """Joint values at the end, rad and m."""
        return self.q + self.h * self.qd + self.h**2 * (self.a / 6 + self.b / 3)

    @property
    def qd_end(self) -> Any:
        """Joint rates at the end, rad/s and m/s."""
        return self.qd + self.h * (self.a + 4 * self.b + self.c) / 6

    @property
    def q_middle(self) -> Any:
        """Joint values halfway in time."""
        return self.q + self.h / 2 * self.qd + self.h**2 * (7 * self.a + 6 * self.b - self.c) / 96

    @property
    def qd_middle(self) -> Any:
        """Joint rates halfway in time."""
        return self.qd + self.h * (5 * self.a + 8 * self.b - self.c) / 24

    @property
    def jerks(self) -> tuple[Any, Any]:
        """Jerks at both ends, rad/s^3 and m/s^3; the jerk is linear between them."""
        return (-3 * self.a + 4 * self.b - self.c) / self.h, (self.a - 4 * self.b + 3 * self.c) / self.h


@dataclass(frozen=True, eq=False)
class Knots:
    """A motion on a mesh."""

    durations: Array
    """Durations of the legs, shape (legs,), s."""
    q: Array
    """Joint values at the knots, shape (intervals + 1, n), rad and m."""
    qd: Array
    """Joint rates at the knots, shape (intervals + 1, n), rad/s and m/s."""
    qdd: Array
    """Accelerations, shape (columns, n), rad/s^2 and m/s^2; see :class:`Curve`."""

    def intervals(self, mesh: Mesh) -> Interval:
        """Return all intervals at once, arrays of shape (intervals, n)."""
        h = (mesh.shares * self.durations[mesh.leg])[:, None]
        return Interval(h, self.q[:-1], self.qd[:-1], *mesh.curve.values(self.qdd))


def assemble_trajectory(description: Description, mesh: Mesh, knots: Knots, *, fixed_ends: bool) -> Trajectory:
    """Return the motion of a program's accelerations.

    Ipopt leaves gaps of about 1e-8 between intervals, which would add up at the goal. The accelerations are therefore
    changed by the least squares correction that makes the motion pass exactly through the end of every leg.

    Parameters
    ----------
    fixed_ends
        Whether the first and the last acceleration must not be changed.
    """
    h = mesh.shares * knots.durations[mesh.leg]
    coefficients = corrected(mesh.curve, h, np.array(mesh.ends), knots, fixed_ends=fixed_ends)
    return Trajectory(description, np.concatenate([[0.0], np.cumsum(h)]), coefficients)


def corrected(curve: Curve, h: Array, ends: Indices, knots: Knots, *, fixed_ends: bool) -> Array:
    """Return a motion's polynomials after that correction, shape (K, p+1, columns), ascending powers.

    Parameters
    ----------
    h
        Durations of the K intervals, shape (K,), s.
    ends
        Indices of the knots at which legs end.
    """
    W, U = _weights(curve, len(h))
    qdd = knots.qdd.copy()
    free = slice(1, -1) if fixed_ends else slice(None)
    # The state at the legs' ends is linear in the accelerations: v = v0 + sum h W a, q = q0 + sum (h v + h^2 U a).
    velocity = np.cumsum(h[:, None] * W, axis=0)
    before = np.vstack([np.zeros(W.shape[1]), velocity[:-1]])
    position = np.cumsum(h[:, None] * before + (h**2)[:, None] * U, axis=0)
    length = max(float(h.sum()), 1e-12)
    influence = np.vstack([position[ends - 1] / length, velocity[ends - 1]])[:, free]
    for _ in range(ROUNDS):
        q, qd = _integrated(knots, qdd, h, W, U)
        gap = np.vstack([(knots.q[ends] - q[ends]) / length, knots.qd[ends] - qd[ends]])
        qdd[free] += np.linalg.lstsq(influence, gap, rcond=None)[0]
    q, qd = _integrated(knots, qdd, h, W, U)
    interval = Interval(h[:, None], q[:-1], qd[:-1], *curve.values(qdd))
    first, last = interval.jerks
    coefficients = np.stack([q[:-1], qd[:-1], interval.a / 2, first / 6, (last - first) / (24 * interval.h)], axis=1)
    degree = (2, 3, 3, 4)[curve.value]
    return coefficients[:, : degree + 1]


def _integrated(knots: Knots, qdd: Array, h: Array, W: Array, U: Array) -> tuple[Array, Array]:
    steps = h[:, None] * (W @ qdd)
    qd = np.vstack([knots.qd[:1], knots.qd[0] + np.cumsum(steps, axis=0)])
    moves = h[:, None] * qd[:-1] + (h**2)[:, None] * (U @ qdd)
    return np.vstack([knots.q[:1], knots.q[0] + np.cumsum(moves, axis=0)]), qd


@lru_cache(maxsize=32)
def _weights(curve: Curve, intervals: int) -> tuple[Array, Array]:
    """Return the weights of accelerations in an interval's changes of velocity (times h) and position (times h^2).

    Shape (K, columns) each.
    """
    step = (1, 2, 1, 2)[curve.value]
    w = ((1.0,), (1 / 2, 1 / 2), (1 / 2, 1 / 2), (1 / 6, 4 / 6, 1 / 6))[curve.value]
    u = ((1 / 2,), (1 / 3, 1 / 6), (1 / 3, 1 / 6), (1 / 6, 1 / 3, 0.0))[curve.value]
    W, U = np.zeros((2, intervals, curve.columns(intervals)))
    for k in range(intervals):
        W[k, step * k : step * k + len(w)] = w
        U[k, step * k : step * k + len(u)] = u
    return W, U


def knots_along(trajectory: Trajectory, mesh: Mesh, ends: Array) -> Knots:
    """Return the values of a trajectory on a mesh, as the start of a solution.

    Parameters
    ----------
    ends
        Times at which its legs end, shape (legs,), s.
    """
    durations = np.diff(np.concatenate([[0.0], ends]))
    t = mesh.times(durations)
    middle = (t[1:] + t[:-1]) / 2
    match mesh.curve:
        case Curve.CONSTANT:
            qdd = trajectory.qdd(middle)
        case Curve.JUMPING:
            both = [trajectory.qdd(t[:-1], "right"), trajectory.qdd(t[1:], "left")]
            qdd = np.stack(both, axis=1).reshape(-1, trajectory.n)
        case Curve.LINEAR:
            qdd = trajectory.qdd(t)
        case Curve.QUADRATIC:
            qdd = np.empty((2 * len(middle) + 1, trajectory.n))
            qdd[0::2], qdd[1::2] = trajectory.qdd(t), trajectory.qdd(middle)
    return Knots(durations, trajectory.q(t), trajectory.qd(t), qdd)
