"""Which of an arm's capsules are worth checking against what."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from pathlib import Path

import numpy as np

from dhkit.description import Array, Description
from dhkit.planning.obstacles.capsules import link_capsules, world_axes
from dhkit.planning.obstacles.segments import segment_distances

SAMPLES = 4000
"""Random configurations that the choice is made from."""
SEED = 0
STILL = 1e-3
"""A distance that changes by less than this in all of them, m, is taken not to change."""
MOSTLY = 0.4
"""Two capsules that overlap in more than this share of them are neighbours, or too crude for their links."""
FAR = 0.05
"""Two capsules that never come this near, of the reach, cost an optimizer more than they are worth."""


@dataclass(frozen=True)
class CheckedPairs:
    """What is checked, as indices of ``link_capsules(description)``; what motion cannot change is left out.

    Decided in 4,000 random configurations within the limits (unlimited joints: pi, or the reach, each way):

    - obstacles: capsules with an end that travels by more than the radius, along some axis of the world; so never the
      base's, nor a shoulder that turns about itself: what touches these, no motion mends;
    - floor: ends that rise and fall by more than the radius: an arm may stand on the floor, close above or in it;
    - itself: capsules of links that do not meet in a joint, unless their distance does not change or they overlap in
      more than 40 % of the configurations, as those of a spherical wrist do, or of a slider and its bar.
    """

    moving: tuple[int, ...]
    """Capsules that are checked against obstacles."""
    heights: tuple[tuple[int, int], ...]
    """A capsule and which of its ends (0 or 1) is checked against the floor."""
    itself: tuple[tuple[int, int], ...]
    """Pairs of capsules that are checked against each other."""
    near: tuple[tuple[int, int], ...]
    """Those of them that came nearer than 5 % of the reach: what an optimizer looks at."""


def checked_pairs(description: Description) -> CheckedPairs:
    """Return what is checked for an arm."""
    return _checked_pairs(description, description.mesh_folder)


@lru_cache(maxsize=64)
def _checked_pairs(description: Description, mesh_folder: Path | None) -> CheckedPairs:
    capsules = link_capsules(description)
    axes = world_axes(description, _configurations(description))
    radii = np.array([capsule.radius for capsule in capsules])
    travels = np.ptp(axes, axis=0)  # of each end of each capsule along x, y and z
    heights = np.argwhere(travels[:, :, 2] > radii[:, None]).tolist()
    apart = [(i, j) for i, j in combinations(range(len(capsules)), 2) if capsules[j].link - capsules[i].link > 1]
    gaps = {(i, j): segment_distances(axes[:, i], axes[:, j]) - radii[i] - radii[j] for i, j in apart}
    itself = [pair for pair, gap in gaps.items() if np.ptp(gap) > STILL and np.mean(gap < 0) <= MOSTLY]
    return CheckedPairs(
        moving=tuple(int(i) for i in np.flatnonzero(travels.max(axis=(1, 2)) > radii)),
        heights=tuple((i, end) for i, end in heights),
        itself=tuple(itself),
        near=tuple(pair for pair in itself if gaps[pair].min() < FAR * description.reach),
    )


def _configurations(description: Description) -> Array:
    numbers = description.numbers
    span = np.where(numbers.prismatic, max(description.reach, 1.0), np.pi)
    lower = np.where(np.isfinite(numbers.lower), numbers.lower, -span)
    upper = np.where(np.isfinite(numbers.upper), numbers.upper, span)
    low, high = np.minimum(lower, upper), np.maximum(lower, upper)
    return np.random.default_rng(SEED).uniform(low, high, (SAMPLES, description.n))
