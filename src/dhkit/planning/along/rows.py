"""Limits along a path that are linear in b = sd^2, and bounds of b.

With b linear between the ends of an interval, sdd = b' / 2 is constant in it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dhkit.description import Array
from dhkit.planning.along.path_states import PathStates
from dhkit.planning.constraints import Constraint
from dhkit.planning.tool_constraints import ToolSpeed
from dhkit.trajectories import Limits


@dataclass(frozen=True, eq=False)
class TimingRows:
    """Rows of one kind, linear in b: low <= left b_k + right b_(k+1) <= high, scaled so that the limit is 1."""

    what: str
    limited: Array
    """Joints that have such a limit, shape (n,): one row for each."""
    left: Array
    """Coefficients of b at the left end, shape (2, K, rows)."""
    right: Array
    rest: Array
    """Use of the limit at rest, shape (2, K, rows)."""

    @classmethod
    def of(cls, what: str, states: PathStates, by_sdd: Array, by_b: Array, rest: Array, limit: Array) -> TimingRows:
        """Return the rows |by_sdd sdd + by_b b + rest| <= limit of limited joints; arrays (2, K, n), SI units."""
        limited = np.isfinite(limit)
        by_sdd, by_b, rest = (array[..., limited] / limit[limited] for array in (by_sdd, by_b, rest))
        slope = by_sdd / (2 * states.steps[:, None])
        left, right = np.stack([by_b[0] - slope[0], -slope[1]]), np.stack([slope[0], by_b[1] + slope[1]])
        return cls(what, limited, left, right, rest)

    def bounds(self, shares: Array) -> tuple[Array, Array]:
        """Return bounds of ``left b_k + right b_(k+1)``, shape (2, K, rows), 1/s^2, with reserved shares (K, n)."""
        most = 1 - shares[:, self.limited]
        return -most - self.rest, most - self.rest

    def largest(self, shape: Array) -> float:
        """Return the largest factor of b (K+1,), 1/s^2, with which the rows are kept that are kept at rest."""
        return float(self._most(self.left * shape[:-1, None] + self.right * shape[1:, None]).min())

    @property
    def even(self) -> Array:
        """Largest constant b that keeps the rows, shape (2, K), 1/s^2."""
        return self._most(self.left + self.right)

    def _most(self, used: Array) -> Array:
        spare = 1 - np.sign(used) * self.rest
        with np.errstate(divide="ignore", invalid="ignore"):
            most = np.where((spare > 0) & (used != 0), spare / np.abs(used), np.inf)
        smallest: Array = most.min(axis=2, initial=np.inf)
        return smallest


def timing_rows(states: PathStates, limits: Limits) -> list[TimingRows]:
    """Return the rows of the limits of torque and acceleration along a path."""
    return [
        TimingRows.of("torque", states, states.m, states.c, states.g, limits.torque),
        TimingRows.of("acceleration", states, states.qs, states.qss, 0 * states.q, limits.acceleration),
    ]


def tool_speeds(constraints: tuple[Constraint, ...]) -> list[ToolSpeed]:
    """Return the constraints that bound b."""
    return [constraint for constraint in constraints if isinstance(constraint, ToolSpeed)]


def speed_bounds(
    states: PathStates, limits: Limits, shares: Array, constraints: list[tuple[ToolSpeed, Array]]
) -> Array:
    """Return the largest b at each knot by limits of speed, shape (K+1,), 1/s^2.

    Parameters
    ----------
    shares
        Reserved shares of each joint's speed limit, shape (K, n).
    constraints
        Limits of the tool's speed, with the reserved shares of their squares, shape (K, 1).
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        joints = ((1 - shares) * limits.velocity / np.abs(states.qs)) ** 2
        most = np.where(np.isnan(joints), np.inf, joints).min(axis=2)
        for constraint, share in constraints:
            most = np.minimum(most, constraint.limit**2 * (1 - share[:, 0]) / np.sum(states.ps**2, axis=2))
    bounds = np.full(most.shape[1] + 1, np.inf)
    bounds[:-1] = most[0]
    bounds[1:] = np.minimum(bounds[1:], most[1])
    return bounds
