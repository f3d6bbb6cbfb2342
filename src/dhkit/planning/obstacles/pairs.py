"""Pairs of capsules and obstacles that are checked for an arm."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dhkit.description import Array, Description
from dhkit.planning.obstacles.capsules import link_capsules, world_axes
from dhkit.planning.obstacles.scene import Obstacle
from dhkit.planning.obstacles.segments import segment_distances
from dhkit.planning.obstacles.solids import obstacle_distances

SAMPLES = 4000
"""Number of random configurations from which the pairs are chosen."""
SEED = 0
CONSTANT_DISTANCE = 1e-3
"""Largest change of a distance over all configurations (m) with which it counts as constant."""
OVERLAP_SHARE = 0.4
"""Share of configurations with an overlap from which two capsules are not checked: neighbours, or crude capsules."""
STILL = 1e-9
"""Largest travel, as a share of the reach, that is rounding."""
STANDING_SAMPLES = 400
"""Number of configurations in which an arm that stands in an obstacle overlaps it."""
NEAR_SHARE = 0.05
"""Smallest distance over all configurations, as a share of the reach, beyond which an optimizer ignores a pair."""
MAX_OBSTACLES = 65_536
"""Number of obstacles whose capsules are remembered; of more, every call would find them anew."""


@dataclass(frozen=True)
class CheckedPairs:
    """Checked pairs, as indices of ``link_capsules(description)``, without those whose distance cannot change.

    Determined from 4,000 random configurations within the limits (unlimited joints: pi, or the reach, each way):

    - obstacles: capsules with an end that moves; so never the base's, nor a shoulder's that turns about its own axis;
    - floor: ends whose height changes;
    - itself: capsules of links that no joint connects, unless their distance does not change or they overlap in
      more than 40 % of the configurations, as those of a spherical wrist do, or of a slider and its bar.
    """

    moving: tuple[int, ...]
    """Indices of capsules that are checked against obstacles, see :func:`capsules_beside`."""
    heights: tuple[tuple[int, int], ...]
    """Capsules and their ends (0 or 1) that are checked against the floor, see :func:`ends_above`."""
    itself: tuple[tuple[int, int], ...]
    """Pairs of capsules that are checked against each other."""
    near: tuple[tuple[int, int], ...]
    """The pairs of ``itself`` that came nearer than 5 % of the reach, which an optimizer includes."""

    size: float
    """Largest edge of the box around all axes of capsules in these configurations, m."""


class Pair(NamedTuple):
    """A capsule of the arm, by its index, and what it must stay away from."""

    capsule: int
    obstacle: int | None
    """Index of an obstacle, or None for another capsule."""
    other: int | None = None
    """Index of the other capsule."""
    ends: tuple[int, ...] = (0, 1)
    """Ends of the capsule's axis that are checked: of the floor, those whose height changes."""


def checked_pairs(description: Description) -> CheckedPairs:
    """Return the checked pairs of an arm."""
    return _checked_pairs(description, description.mesh_folder)


@lru_cache(maxsize=64)
def _checked_pairs(description: Description, mesh_folder: Path | None) -> CheckedPairs:
    capsules = link_capsules(description)
    axes = world_axes(description, _configurations(description))
    radii = np.array([capsule.radius for capsule in capsules])
    travels = np.ptp(axes, axis=0)  # of each end of each capsule along x, y and z
    moves = travels > STILL * max(description.reach, STILL)
    heights = np.argwhere(moves[:, :, 2]).tolist()
    apart = [(i, j) for i, j in combinations(range(len(capsules)), 2) if capsules[j].link - capsules[i].link > 1]
    gaps = {(i, j): segment_distances(axes[:, i], axes[:, j]) - radii[i] - radii[j] for i, j in apart}
    itself = [
        pair for pair, gap in gaps.items() if np.ptp(gap) > CONSTANT_DISTANCE and np.mean(gap < 0) <= OVERLAP_SHARE
    ]
    return CheckedPairs(
        size=float(np.ptp(axes.reshape(-1, 3), axis=0).max()) if axes.size else 0.0,
        moving=tuple(int(i) for i in np.flatnonzero(moves.any(axis=(1, 2)))),
        heights=tuple((i, end) for i, end in heights),
        itself=tuple(itself),
        near=tuple(pair for pair in itself if gaps[pair].min() < NEAR_SHARE * description.reach),
    )


def capsules_beside(description: Description, obstacle: Obstacle) -> tuple[int, ...]:
    """Return the indices of the capsules that are checked against an obstacle.

    They are those that move, without those that travel by no more than their radius and overlap the obstacle in all
    configurations: a foot in the box or table that the arm stands on, which no motion changes.
    """
    return _capsules_beside(description, description.mesh_folder, obstacle)


@lru_cache(maxsize=MAX_OBSTACLES)
def _capsules_beside(description: Description, mesh_folder: Path | None, obstacle: Obstacle) -> tuple[int, ...]:
    capsules = link_capsules(description)
    axes = world_axes(description, _configurations(description)[:STANDING_SAMPLES])

    def stands_in(i: int) -> bool:
        radius = capsules[i].radius
        if np.ptp(axes[:, i], axis=0).max() > radius or not overlaps(axes[:1, i], radius):
            return False
        return overlaps(axes[:, i], radius)

    def overlaps(states: Array, radius: float) -> bool:
        return bool((obstacle_distances(radius, states, obstacle) < 0).all())

    return tuple(i for i in checked_pairs(description).moving if not stands_in(i))


def ends_above(description: Description, height: float) -> tuple[tuple[int, int], ...]:
    """Return the capsules and their ends (0 or 1) that are checked against a floor at a height, m.

    They are those whose height changes, without those that change it by no more than their radius and are below the
    floor in all configurations: an arm may stand in it.
    """
    return _ends_above(description, description.mesh_folder, height)


@lru_cache(maxsize=256)
def _ends_above(description: Description, mesh_folder: Path | None, height: float) -> tuple[tuple[int, int], ...]:
    capsules = link_capsules(description)
    axes = world_axes(description, _configurations(description)[:STANDING_SAMPLES])

    def stands_in(i: int, end: int) -> bool:
        radius, lowest = capsules[i].radius, axes[:, i, end, 2]
        return bool(np.ptp(lowest) <= radius and (lowest < radius + height).all())

    return tuple((i, end) for i, end in checked_pairs(description).heights if not stands_in(i, end))


def _configurations(description: Description) -> Array:
    numbers = description.numbers
    span = np.where(numbers.prismatic, max(description.reach, 1.0), np.pi)
    lower = np.where(np.isfinite(numbers.lower), numbers.lower, -span)
    upper = np.where(np.isfinite(numbers.upper), numbers.upper, span)
    low, high = np.minimum(lower, upper), np.maximum(lower, upper)
    return np.random.default_rng(SEED).uniform(low, high, (SAMPLES, description.n))
