"""Random poses that formulas of inverse kinematics are tried on, with the solutions that are known of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Description, world_to_tool
from dhkit.grading.answers.given import POSE_NAMES
from dhkit.kinematics import classify, inverse_kinematics

__all__ = ["CLOSES", "MATCHES", "Mask", "Poses"]

CLOSES = 1e-9
"""rad, and share of the reach: how near to a pose joint values have to bring the tool."""
MATCHES = 1e-6
"""rad, and share of the reach: joint values this near to a solution's are its: poses near singular ones widen gaps."""

Mask: TypeAlias = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Poses:
    """Random poses, with the solutions that are known of them."""

    description: Description
    q: Array
    """Joint values that the poses come from, shape (S, n)."""
    T: Array
    """Shape (S, 4, 4)."""
    solutions: Array
    """Shape (S, B, n), NaN where a branch does not reach; B = 0 without a closed form."""
    met: tuple[str, ...]

    @classmethod
    def random(cls, description: Description, samples: int, seed: int) -> Poses:
        """Return poses of random joint values inside the limits; a turn or a metre without."""
        numbers = description.numbers
        width = np.where(numbers.prismatic, 1.0, 2 * np.pi)
        limited = np.isfinite(numbers.lower) & np.isfinite(numbers.upper)
        middle = np.where(np.isfinite(numbers.lower), numbers.lower + width / 2, 0.0)
        middle = np.where(np.isfinite(numbers.upper) & ~limited, numbers.upper - width / 2, middle)
        lower = np.where(limited, numbers.lower, middle - width / 2)
        upper = np.where(limited, numbers.upper, middle + width / 2)
        q = np.random.default_rng(seed).uniform(lower, upper, (samples, description.n))
        T = world_to_tool(description, q)
        if classify(description).family is None:
            return cls(description, q, T, np.empty((samples, 0, description.n)), ())
        found = inverse_kinematics(description, T)
        return cls(description, q, T, np.where(found.valid[..., None], found.q, np.nan), found.met)

    @property
    def full(self) -> bool:
        """Whether the whole pose is asked for: a yaw with all positions is all that the arm leaves open."""
        return not self.met or len(self.met) == 6 or "yaw" in self.met

    @cached_property
    def scale(self) -> float:
        """The reach, m; 1 where there is none."""
        reach = self.description.reach
        return reach if np.isfinite(reach) and reach > 0 else 1.0

    @cached_property
    def values(self) -> dict[str, Array | float]:
        """Values by name: of the poses, shape (S,), and of parameters."""
        entries = [*np.moveaxis(self.T[:, :3, 3], -1, 0), *self.T[:, :3, :3].reshape(-1, 9).T]
        return {**self.description.numbers.values, **dict(zip(POSE_NAMES, entries, strict=True))}

    @cached_property
    def truths(self) -> Array:
        """All solutions known, the joint values that a pose comes from last, shape (S, B + 1, n)."""
        return np.concatenate([self.solutions, self.q[:, None]], axis=1)

    def closes(self, q: Array) -> Mask:
        """Return which poses joint values of shape (S, n) bring the tool to."""
        gap = np.abs(world_to_tool(self.description, np.where(np.isfinite(q), q, np.nan)) - self.T)
        near: Mask = np.max(gap[:, :3, 3], axis=1) <= CLOSES * self.scale
        if self.full:
            near &= np.max(gap[:, :3, :3], axis=(1, 2)) <= CLOSES
            return near
        axis = next((word[-6] for word in self.met if word.startswith("pitch")), "")
        if axis:
            near &= np.max(gap[:, :3, "xyz".index(axis)], axis=1) <= CLOSES
        return near

    def gaps(self, a: Array, b: Array, joint: int | slice = slice(None)) -> Array:
        """Return how far joint values are apart: angles the short way round, slides over the reach."""
        prismatic = self.description.numbers.prismatic[joint]
        with np.errstate(invalid="ignore"):
            turned = np.abs(np.remainder(a - b + np.pi, 2 * np.pi) - np.pi)
            return np.where(prismatic, np.abs(a - b) / self.scale, turned)

    def matches(self, q: Array, solutions: Array) -> Mask:
        """Return which solutions, shape (S, B, n), joint values of shape (S, n) are."""
        near: Mask = np.all(self.gaps(q[:, None], solutions) < MATCHES, axis=-1)
        return near

    def same(self, a: Array, b: Array) -> bool:
        """Return whether two branches give the same joint values wherever both have some."""
        both = np.all(np.isfinite(a) & np.isfinite(b), axis=1)
        return bool(np.any(both) and np.all(self.gaps(a[both], b[both]) < MATCHES))
