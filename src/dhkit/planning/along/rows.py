"""Limits along a path that are linear in b = sd^2, and those that bound it.

With b at the ends of intervals and linear between them, sdd = b' / 2 is constant inside an interval.
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
    """Rows of one kind that are linear in b: low <= left b_k + right b_(k+1) <= high; scaled so that 1 is a limit."""

    what: str
    limited: Array
    """Which joints have such a limit, shape (n,): one row for each of those."""
    left: Array
    """Shape (2, K, rows)."""
    right: Array
    rest: Array
    """What is used already where nothing moves."""

    @classmethod
    def of(cls, what: str, states: PathStates, by_sdd: Array, by_b: Array, rest: Array, limit: Array) -> TimingRows:
        """Return the rows |by_sdd sdd + by_b b + rest| <= limit of those joints that have one."""
        limited = np.isfinite(limit)
        by_sdd, by_b, rest = (array[..., limited] / limit[limited] for array in (by_sdd, by_b, rest))
        slope = by_sdd / (2 * states.steps[:, None])
        left, right = np.stack([by_b[0] - slope[0], -slope[1]]), np.stack([slope[0], by_b[1] + slope[1]])
        return cls(what, limited, left, right, rest)

    def bounds(self, shares: Array) -> tuple[Array, Array]:
        """Return bounds of ``left b_k + right b_(k+1)``, shape (2, K, rows), that keep shares (K, n) in reserve."""
        most = 1 - shares[:, self.limited]
        return -most - self.rest, most - self.rest

    def largest(self, shape: Array) -> float:
        """Return by what b of a shape (K+1,) may be multiplied to keep the rows where standing still keeps them."""
        return float(self._most(self.left * shape[:-1, None] + self.right * shape[1:, None]).min())

    @property
    def even(self) -> Array:
        """The largest b that keeps the rows where it does not change, shape (2, K)."""
        return self._most(self.left + self.right)

    def _most(self, used: Array) -> Array:
        spare = 1 - np.sign(used) * self.rest
        with np.errstate(divide="ignore", invalid="ignore"):
            most = np.where((spare > 0) & (used != 0), spare / np.abs(used), np.inf)
        smallest: Array = most.min(axis=2, initial=np.inf)
        return smallest


def timing_rows(states: PathStates, limits: Limits) -> list[TimingRows]:
    """Return the rows of a path's limits of torque and of acceleration."""
    return [
        TimingRows.of("torque", states, states.m, states.c, states.g, limits.torque),
        TimingRows.of("acceleration", states, states.qs, states.qss, 0 * states.q, limits.acceleration),
    ]


def tool_speeds(constraints: tuple[Constraint, ...]) -> list[ToolSpeed]:
    """Return those of the constraints that bound b."""
    return [constraint for constraint in constraints if isinstance(constraint, ToolSpeed)]


def speed_bounds(
    states: PathStates, limits: Limits, shares: Array, constraints: list[tuple[ToolSpeed, Array]]
) -> Array:
    """Return the largest b of each knot by limits of speed, shape (K+1,).

    Parameters
    ----------
    shares
        Of each joint's velocity kept in reserve, shape (K, n).
    constraints
        Speeds of the tool, with the shares of their squares kept in reserve, shape (K, 1).
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
