"""Task of one motion, between configurations or along a path, and the margins by which its limits are tightened."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from dhkit.description import Array, Description
from dhkit.planning.certificate import NO_AVOIDANCE, Checker, CollisionAvoidance
from dhkit.planning.criteria import LoadedArm, Objective
from dhkit.planning.program.blocks import Indices
from dhkit.symbolic import Friction
from dhkit.trajectories import JointPath, Limits

MIN_LIMIT_SHARE = 0.05
"""Smallest share of a limit that margins leave."""


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
        k = np.arange(self.intervals + 1)
        return self.at_points(limit, count, np.stack([np.maximum(k - 1, 0), np.minimum(k, k[-1] - 1)], axis=1))

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
