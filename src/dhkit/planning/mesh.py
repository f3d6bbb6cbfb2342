"""Mesh of a motion: the intervals of its legs, the polynomial degree of acceleration in them, and its integration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array

GRADING = 0.9
"""Grading of the mesh towards its ends, 0 (uniform) to 1: robots reach their speed in a small part of a motion."""
MIN_LEG_INTERVALS = 6
"""Smallest number of intervals of a leg."""


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
