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
"""Number of least-squares corrections of a solution: the second removes the rounding error of the first."""


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

    @property
    def is_continuous(self) -> bool:
        """Whether neighbouring intervals share the acceleration at their common knot."""
        return self in (Curve.LINEAR, Curve.QUADRATIC)

    @property
    def stride(self) -> int:
        """Number of columns, acceleration variables of each joint, from one interval to the next."""
        return 2 if self in (Curve.JUMPING, Curve.QUADRATIC) else 1

    def columns(self, intervals: int) -> int:
        """Return the number of acceleration variables of each joint."""
        return self.stride * intervals + (1 if self.is_continuous else 0)

    def columns_of(self, interval: int) -> tuple[int, ...]:
        """Return the columns of acceleration variables that an interval depends on, in order of time."""
        first = self.stride * interval
        return tuple(range(first, first + len(self.column_weights)))

    @property
    def column_weights(self) -> tuple[float, ...]:
        """Weights of an interval's columns in its change of velocity, as shares of h; their sum is 1."""
        # (qd_end - qd) / h = int_0^1 qdd dx
        match self:
            case Curve.CONSTANT:
                return (1.0,)
            case Curve.JUMPING | Curve.LINEAR:
                return (1 / 2, 1 / 2)
            case Curve.QUADRATIC:
                return (1 / 6, 2 / 3, 1 / 6)

    @property
    def position_weights(self) -> tuple[float, ...]:
        """Weights of an interval's columns in its change of position, as shares of h^2; their sum is 1/2."""
        # (q_end - q - h qd) / h^2 = int_0^1 (1 - x) qdd dx
        match self:
            case Curve.CONSTANT:
                return (1 / 2,)
            case Curve.JUMPING | Curve.LINEAR:
                return (1 / 3, 1 / 6)
            case Curve.QUADRATIC:
                return (1 / 6, 1 / 3, 0.0)

    def abc(self, columns: Sequence[Any]) -> tuple[Any, Any, Any]:
        """Return the accelerations at the beginning, the middle and the end of an interval, from its columns."""
        match self:
            case Curve.CONSTANT:
                return columns[0], columns[0], columns[0]
            case Curve.JUMPING | Curve.LINEAR:
                return columns[0], (columns[0] + columns[1]) / 2, columns[1]
            case Curve.QUADRATIC:
                return columns[0], columns[1], columns[2]

    def values(self, qdd: Array) -> tuple[Array, Array, Array]:
        """Return the same of all intervals, shape (intervals, n) each, from all columns, shape (columns, n)."""
        # Column k of interval i is row k + stride i.
        step = self.stride
        end = len(qdd) - 1 if self.is_continuous else len(qdd)
        return self.abc([qdd[k : k + end : step] for k in range(len(self.column_weights))])


@dataclass(frozen=True)
class Mesh:
    """Intervals of consecutive legs; a leg leads from one given configuration to the next."""

    legs: tuple[int, ...]
    """Number of intervals of each leg."""
    curve: Curve

    @classmethod
    def of(cls, intervals: int, legs: int, curve: Curve) -> Mesh:
        """Return a mesh that divides intervals among legs, at least ``MIN_LEG_INTERVALS`` for each."""
        rounded_up = -(-intervals // legs)
        each = max(MIN_LEG_INTERVALS, rounded_up)
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
    """Return knots from 0 to 1 that are closer together at the ends, shape (intervals + 1,).

    They blend uniform knots x_k = k / K with those of Chebyshev's points, (1 - cos(pi x_k)) / 2.
    """
    x = np.linspace(0.0, 1.0, intervals + 1)
    chebyshev = (1 - np.cos(np.pi * x)) / 2
    knots: Array = (1 - GRADING) * x + GRADING * chebyshev
    return knots


class Interval(NamedTuple):
    """One interval of a motion: its duration h (s), the state at its beginning, and the acceleration in it.

    The acceleration is at most quadratic, given by its values a, b and c at the beginning, the middle and the end. With
    x = t / h it is Lagrange's polynomial through them,

        qdd(x) = a + (-3 a + 4 b - c) x + 2 (a - 2 b + c) x^2,

    of which all properties are integrals or derivatives. A linear one has b = (a + c) / 2, a constant one a = b = c.
    All fields may be arrays or CasADi's symbols.
    """

    h: Any
    q: Any
    qd: Any
    a: Any
    b: Any
    c: Any

    @property
    def q_end(self) -> Any:
        """Joint values at the end, rad and m: those at x = 1."""
        return self.q + self.h * self.qd + self.h**2 * (self.a / 6 + self.b / 3)

    @property
    def qd_end(self) -> Any:
        """Joint rates at the end, rad/s and m/s: Simpson's rule, exact for quadratic accelerations."""
        return self.qd + self.h * (self.a + 4 * self.b + self.c) / 6

    @property
    def q_middle(self) -> Any:
        """Joint values halfway in time, rad and m: those at x = 1/2."""
        return self.q + self.h / 2 * self.qd + self.h**2 * (7 * self.a + 6 * self.b - self.c) / 96

    @property
    def qd_middle(self) -> Any:
        """Joint rates halfway in time, rad/s and m/s: those at x = 1/2."""
        return self.qd + self.h * (5 * self.a + 8 * self.b - self.c) / 24

    @property
    def jerks(self) -> tuple[Any, Any]:
        """Jerks at both ends, rad/s^3 and m/s^3; the jerk is linear between them."""
        at_begin = (-3 * self.a + 4 * self.b - self.c) / self.h
        at_end = (self.a - 4 * self.b + 3 * self.c) / self.h
        return at_begin, at_end


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


def assemble_trajectory(
    description: Description, mesh: Mesh, knots: Knots, *, fixed_ends: bool
) -> Trajectory:
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
    """Return the polynomials of a motion with the gaps at legs' ends closed, shape (K, p+1, columns), ascending powers.

    With accelerations A, shape (columns, n), and rows W_k and U_k of weights, the motion is

        v_(k+1) = v_k + h_k W_k A,    q_(k+1) = q_k + h_k v_k + h_k^2 U_k A.

    The states at the legs' ends are affine in A. The correction dA is the one of least norm for which they are the
    given ones: S dA = gap, where S holds the sums of these weights up to each end, and positions are divided by the
    motion's duration so that both have the unit of a velocity.

    Parameters
    ----------
    h
        Durations of the K intervals, shape (K,), s.
    ends
        Indices of the knots at which legs end.
    """
    W, U = _weights(curve, len(h))
    A = knots.qdd.copy()
    free = slice(1, -1) if fixed_ends else slice(None)

    # Influence of A on v and q at the end of interval k, shape (K, columns) each: that of knot k + 1 above.
    #   dv_k = sum_(j<=k) h_j W_j,    dq_k = sum_(j<=k) (h_j dv_(j-1) + h_j^2 U_j).
    dv = np.cumsum(h[:, None] * W, axis=0)
    dv_before = np.vstack([np.zeros(W.shape[1]), dv[:-1]])
    dq = np.cumsum(h[:, None] * dv_before + (h**2)[:, None] * U, axis=0)

    duration = max(float(h.sum()), 1e-12)
    S = np.vstack([dq[ends - 1] / duration, dv[ends - 1]])[:, free]
    for _ in range(ROUNDS):
        q, qd = _integrated(knots, A, h, W, U)
        gap = np.vstack([(knots.q[ends] - q[ends]) / duration, knots.qd[ends] - qd[ends]])
        A[free] += np.linalg.lstsq(S, gap, rcond=None)[0]
    q, qd = _integrated(knots, A, h, W, U)

    # q(t) = q + qd t + a t^2 / 2 + j0 t^3 / 6 + (j1 - j0) / h t^4 / 24, with a jerk from j0 to j1.
    interval = Interval(h[:, None], q[:-1], qd[:-1], *curve.values(A))
    j0, j1 = interval.jerks
    coefficients = np.stack(
        [q[:-1], qd[:-1], interval.a / 2, j0 / 6, (j1 - j0) / (24 * interval.h)], axis=1
    )
    degree = len(curve.column_weights) + 1
    return coefficients[:, : degree + 1]


def _integrated(knots: Knots, A: Array, h: Array, W: Array, U: Array) -> tuple[Array, Array]:
    """Return joint values and rates at the knots, shape (K+1, n) each, of accelerations A from the first knot's state.

    The sums are those of :func:`corrected`.
    """
    gained = h[:, None] * (W @ A)
    qd = np.vstack([knots.qd[:1], knots.qd[0] + np.cumsum(gained, axis=0)])
    moved = h[:, None] * qd[:-1] + (h**2)[:, None] * (U @ A)
    q = np.vstack([knots.q[:1], knots.q[0] + np.cumsum(moved, axis=0)])
    return q, qd


@lru_cache(maxsize=32)
def _weights(curve: Curve, intervals: int) -> tuple[Array, Array]:
    """Return the weights W and U of accelerations in an interval's changes of velocity (/ h) and position (/ h^2).

    Shape (K, columns) each.
    """
    W = np.zeros((intervals, curve.columns(intervals)))
    U = np.zeros_like(W)
    for k in range(intervals):
        columns = curve.columns_of(k)
        W[k, columns] = curve.column_weights
        U[k, columns] = curve.position_weights
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
            # Columns alternate: the acceleration after a knot, and that before the next.
            both = [trajectory.qdd(t[:-1], "right"), trajectory.qdd(t[1:], "left")]
            qdd = np.stack(both, axis=1).reshape(-1, trajectory.n)
        case Curve.LINEAR:
            qdd = trajectory.qdd(t)
        case Curve.QUADRATIC:
            qdd = np.empty((2 * len(middle) + 1, trajectory.n))
            qdd[0::2] = trajectory.qdd(t)
            qdd[1::2] = trajectory.qdd(middle)
    return Knots(durations, trajectory.q(t), trajectory.qd(t), qdd)
