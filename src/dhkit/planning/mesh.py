"""Where a motion's intervals end, and how acceleration runs inside them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from dhkit.description import Array

GRADED = 0.9
"""How much finer the mesh is at its ends: robots reach their speed in a small part of a motion."""
LEAST = 6
"""Intervals between two given configurations, at least."""


class Curve(Enum):
    """How acceleration runs: the fewest columns of numbers that serve a problem."""

    CONSTANT = 0
    """With jumps at the knots."""
    JUMPING = 1
    """Linear, with jumps at the knots: an interval's two ends have accelerations of their own."""
    LINEAR = 2
    """Linear and continuous, with constant jerk."""
    QUADRATIC = 3
    """Continuous, given at knots and midpoints: smooth objectives converge fast."""

    def columns(self, intervals: int) -> int:
        """Return how many accelerations of each joint a mesh has."""
        return (intervals, 2 * intervals, intervals + 1, 2 * intervals + 1)[self.value]


@dataclass(frozen=True)
class Mesh:
    """Intervals of legs one after another; a leg leads from one given configuration to the next."""

    legs: tuple[int, ...]
    """Intervals of each."""
    curve: Curve

    @classmethod
    def of(cls, intervals: int, legs: int, curve: Curve) -> Mesh:
        """Share intervals among legs, ``LEAST`` for each at least."""
        each = max(LEAST, -(-intervals // legs))
        return cls((each,) * legs, curve)

    @property
    def intervals(self) -> int:
        """Of all legs."""
        return sum(self.legs)

    @property
    def ends(self) -> tuple[int, ...]:
        """The knots at which legs end, the last one included."""
        return tuple(np.cumsum(self.legs).tolist())

    @property
    def leg(self) -> Array:
        """The leg of each interval, shape (intervals,), whole numbers."""
        return np.repeat(np.arange(len(self.legs)), self.legs)

    @property
    def shares(self) -> Array:
        """Each interval's share of its leg's duration, shape (intervals,)."""
        return np.concatenate([np.diff(graded(count)) for count in self.legs])

    def times(self, durations: Array) -> Array:
        """Return the knots' times, shape (intervals + 1,), s, for the legs' durations (legs,), s."""
        return np.concatenate([[0.0], np.cumsum(self.shares * durations[self.leg])])


def graded(intervals: int) -> Array:
    """Return knots from 0 to 1 that lie closer at the ends, shape (intervals + 1,)."""
    x = np.linspace(0.0, 1.0, intervals + 1)
    knots: Array = (1 - GRADED) * x + GRADED * (1 - np.cos(np.pi * x)) / 2
    return knots
