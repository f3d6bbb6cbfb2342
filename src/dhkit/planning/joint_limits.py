"""The limits of joints as constraints: position, velocity, acceleration, jerk and torque."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np

from dhkit.description import Array, Description
from dhkit.planning.constraints import Constraint
from dhkit.planning.point import Point
from dhkit.planning.states import States
from dhkit.trajectories import Limits

if TYPE_CHECKING:
    import casadi


class Limit(IntEnum):
    """Places of the limits that every motion has among its constraints; further constraints follow."""

    POSITION = 0
    VELOCITY = 1
    ACCELERATION = 2
    JERK = 3
    TORQUE = 4
    CLEARANCE = 5

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        return self.name.lower()


QUANTITIES = {Limit.VELOCITY: "qd", Limit.ACCELERATION: "qdd", Limit.JERK: "jerk", Limit.TORQUE: "tau"}
"""Attributes of points and states that are limited."""


@dataclass(frozen=True, eq=False)
class JointLimit(Constraint):
    """A limit of the magnitude of one quantity of each joint; its parameters are the reciprocals, 0 if unlimited."""

    kind: Limit
    limit: Array
    """Shape (n,), infinite where there is none."""
    two_sided = True
    of_joints = True

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        return self.kind.what

    @property
    def is_limiting(self) -> bool:
        """Whether any joint has this limit."""
        return bool(np.isfinite(self.limit).any())

    def size(self, description: Description) -> int:
        """Return the number of parameters."""
        return description.n

    def values(self, description: Description, T_start: Array) -> Array:
        """Return the reciprocals of the limits, shape (n,)."""
        return 1 / self.limit

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return the limited expressions, n x 1, without unit, 1 at the limit."""
        rows: casadi.SX = getattr(point, QUANTITIES[self.kind]) * parameters
        return rows

    def measured(self, states: States, parameters: Array) -> Array:
        """Return the limited quantity at samples, shape (N, n), without unit, 1 at the limit."""
        return np.asarray(getattr(states, QUANTITIES[self.kind]) * parameters)


@dataclass(frozen=True, eq=False)
class PositionLimit(Constraint):
    """The range of each joint; the rows are joint values."""

    limits: Limits
    moving = False
    of_joints = True

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        return Limit.POSITION.what

    @property
    def is_limiting(self) -> bool:
        """Whether any joint has a limit."""
        return bool((np.isfinite(self.limits.lower) | np.isfinite(self.limits.upper)).any())

    @property
    def sizes(self) -> Array:
        """Lengths that count as 1 outside the limits, shape (n,): the larger limit, at least 1 rad or m."""
        size = np.maximum(np.abs(self.limits.lower), np.abs(self.limits.upper))
        return np.where(np.isfinite(size) & (size > 0), size, 1.0)

    def measured(self, states: States, parameters: Array) -> Array:
        """Return 1 plus the distance outside the range in shares of :attr:`sizes`, shape (N, n); 0 if unlimited."""
        outside = np.maximum(self.limits.lower - states.q, states.q - self.limits.upper)
        return np.where(np.isfinite(outside), 1 + outside / self.sizes, 0.0)

    def bounds(self, parameters: Array, shares: Array) -> tuple[Array, Array]:
        """Return the bounds of joint values, shape (P, n) each, rad and m."""
        return self.limits.lower + shares * self.sizes, self.limits.upper - shares * self.sizes


def joint_limits(limits: Limits) -> tuple[Constraint, ...]:
    """Return the constraints of the joint limits, in the order of :class:`Limit`."""
    return (
        PositionLimit(limits),
        *(JointLimit(kind, getattr(limits, kind.what)) for kind in Limit if Limit.POSITION < kind <= Limit.TORQUE),
    )
