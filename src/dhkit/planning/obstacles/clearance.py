"""Exact distances of an arm from obstacles, and between its links."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import Array, Box, Description, joint_array, takes_robot
from dhkit.display import counted, repr_line
from dhkit.model.shapes import links_without_shapes, missing_shapes
from dhkit.planning.obstacles.capsules import LinkCapsule, link_capsules, link_name, world_axes
from dhkit.planning.obstacles.pairs import (
    Pair,
    capsules_beside,
    ends_above,
    link_pairs,
    pair_text,
    standing,
)
from dhkit.planning.obstacles.scene import Floor, Obstacle, Scene, Solids, check_obstacles
from dhkit.planning.obstacles.solids import (
    Bounds,
    axis_bounds,
    capsule_distances,
    obstacle_distances,
    segment_distances,
    shape_distances,
)

EQUAL_BOUNDS = 1e-7
"""Difference of bounds (m) that counts as equal: coal's distances are accurate to about 1e-9."""

Nearest = tuple[Array, NDArray[np.int_]]
"""Smallest distances, shape (N,), m, and the index of the candidate of each."""


@dataclass(frozen=True, eq=False)
class Distances:
    """Distances of the capsules around an arm's links from obstacles and from each other."""

    distance: Array
    """Smallest distance, shape (...), m; negative in a penetration, inf if there is nothing to check."""
    pair: tuple[str, str] | None
    """Names of the closest pair in the worst state: a link and an obstacle, or two links; None without a state."""
    per_obstacle: Array
    """Smallest distance from each obstacle, in the given order, shape (..., K), m."""
    itself: Array
    """Smallest distance between two links, shape (...), m; inf unless requested."""
    not_checked: tuple[str, ...] = ()
    """Distances that are not included: of links without a shape, of links that overlap in all sampled
    configurations, and of parts whose distance no motion changes."""

    def __repr__(self) -> str:
        if self.pair is None:
            least = "nothing to check" if np.isinf(self.distance).all() else "no finite state"
        else:
            least = f"least {np.nanmin(self.distance):.4g} m, {self.pair[0]} and {self.pair[1]}"
        if self.not_checked:
            least += f", not checked: {'; '.join(self.not_checked)}"
        return repr_line("Distances", counted(self.distance.size, "state"), least)


@takes_robot
def distance(
    description: Description, q: ArrayLike, obstacles: Scene = (), self_collision: bool = False
) -> Distances:
    """Return exact distances of an arm's capsules from obstacles, and from each other.

    Distances that no motion changes are left out, see :class:`dhkit.planning.obstacles.pairs.CheckedPairs`: those of
    the base, for example, and of the foot of an arm on the floor. Links whose capsules are too wide are measured by
    their shapes.

    Parameters
    ----------
    description
        The robot.
    q
        Joint values, shape (..., n), rad and m.
    obstacles
        K obstacles, of which at most one is a :class:`Floor`.
    self_collision
        Whether distances between links are included.

    Returns
    -------
    Distances
        Distances of shape (...), m; NaN where q is not finite.

    Raises
    ------
    ModelError
        coal is not installed, or a mesh cannot be read.
    ValueError, TypeError
        Another shape of q, or of a scene.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> puma = library_robot("puma560")
    >>> found = distance(puma, [0, 0, 0, 0, 0, 0], [Obstacle.sphere(0.1, (0.4, 0.2, 0.9), name="ball")])
    >>> found.pair
    ('link 3', 'ball')
    >>> round(float(found.distance), 3)
    0.169
    """
    obstacles = check_obstacles(obstacles)
    q = joint_array(description, q)
    rows = q.reshape(-1, description.n)
    finite = np.all(np.isfinite(rows), axis=1)
    capsules = link_capsules(description)
    axes = world_axes(description, rows[finite])
    found: list[Nearest] = []
    names: list[list[tuple[str, str]]] = []
    for obstacle in obstacles:
        found.append(_from_one(description, capsules, axes, obstacle))
        names.append(_pair_names(description, capsules, obstacle))
    itself = np.full(len(axes), np.inf)
    if self_collision:
        pairs = link_pairs(description)
        found.append(_from_itself(capsules, axes, pairs.capsules))
        names.append([(capsules[i].name, capsules[j].name) for i, j in pairs.capsules])
        for a, b in pairs.shapes:
            gaps = shape_distances(description, rows[finite], (a, b))
            found.append((gaps, np.zeros(len(gaps), dtype=int)))
            names.append([(a.name, b.name)])
        itself = np.min([gaps for gaps, _ in found[len(obstacles) :]], axis=0)
    every = (
        np.stack([gaps for gaps, _ in found], axis=-1) if found else np.full((len(axes), 1), np.inf)
    )

    def whole(values: Array) -> Array:
        result = np.full((len(rows), *values.shape[1:]), np.nan)
        result[finite] = values
        return result.reshape((*q.shape[:-1], *values.shape[1:]))

    return Distances(
        distance=whole(every.min(axis=-1)),
        pair=_worst(every, found, names),
        per_obstacle=whole(every[:, : len(obstacles)] if found else every[:, :0]),
        itself=whole(itself),
        not_checked=_not_checked_beside(description, obstacles, self_collision, every)
        if found
        else (),
    )


def _not_checked_beside(
    description: Description,
    obstacles: Sequence[Obstacle | Floor],
    self_collision: bool,
    found: Array,
) -> tuple[str, ...]:
    """Return the parts of an arm left out of distances (N, m), if they may be nearer than the smallest of these."""
    finite = found[np.isfinite(found)]
    return not_checked(description, obstacles, self_collision, float(finite.min(initial=np.inf)))


def not_checked(
    description: Description,
    obstacles: Sequence[Obstacle | Floor],
    self_collision: bool,
    nearer_than: float,
) -> tuple[str, ...]:
    """Return the parts of an arm that are left out of its distances, in words.

    Parameters
    ----------
    description, obstacles, self_collision
        As for :func:`distance`.
    nearer_than
        Parts of links whose distance from an obstacle or a link no motion changes are named if it is below this, m.
    """
    bare = [link_name(link) for link in links_without_shapes(description)]
    words = [f"{', '.join(bare)} without a shape"] if bare else []
    words += missing_shapes(description)
    for obstacle in obstacles:
        for link, gap in standing(description, obstacle):
            if gap < nearer_than:
                state = (
                    f"{1000 * gap:.3g} mm apart in all"
                    if gap > 0
                    else "which overlap in all sampled"
                )
                words.append(
                    f"part of {link_name(link)} and {obstacle.name}, {state} configurations"
                )
    for a, b, gap in link_pairs(description).steady if self_collision else ():
        if gap < nearer_than:
            words.append(
                f"parts of {pair_text(a, b)}, {1000 * gap:.3g} mm apart in all configurations"
            )
    overlapping = link_pairs(description).unchecked_text if self_collision else ""
    if overlapping:
        words.append(f"{overlapping}, which overlap in all sampled configurations")
    return tuple(words)


def smallest_distances(
    description: Description,
    q: Array,
    obstacles: Sequence[Obstacle | Floor],
    self_collision: bool,
    without: Collection[Pair],
) -> Array:
    """Return the smallest exact distance at finite states q (N, n), shape (N,), m, without those of some pairs.

    As :func:`distance`, in less time: only the pairs that can be the nearest in a state are measured.
    """
    capsules = link_capsules(description)
    axes = world_axes(description, q)
    left_out = {(pair.capsule, pair.obstacle, pair.other) for pair in without}
    least = np.full(len(axes), np.inf)
    for k, item in enumerate(obstacles):
        if isinstance(item, Floor):
            heights = _heights(
                description, capsules, axes, item, {i for i, j, _ in left_out if j == k}
            )
            least = np.minimum(least, heights.min(axis=1, initial=np.inf))
    if self_collision:
        pairs = tuple(
            (i, j) for i, j in link_pairs(description).capsules if (i, None, j) not in left_out
        )
        least = np.minimum(least, _from_itself(capsules, axes, pairs)[0])
    solids = [(k, item) for k, item in enumerate(obstacles) if isinstance(item, Obstacle)]
    for is_box in (False, True):
        beside: list[tuple[int, Obstacle]] = []
        for k, solid in solids:
            if isinstance(solid.geometry, Box) == is_box:
                capsules_of = capsules_beside(description, solid)
                beside += [(i, solid) for i in capsules_of if (i, k, None) not in left_out]
        if beside:
            least = _nearer(capsules, axes, beside, least)
    return least


def _nearer(
    capsules: tuple[LinkCapsule, ...],
    axes: Array,
    beside: Sequence[tuple[int, Obstacle]],
    least: Array,
) -> Array:
    """Return the smaller of ``least`` (N,), m, and the distances of capsules from obstacles, all boxes or none."""
    which = np.array([i for i, _ in beside])
    solids = Solids.of([item for _, item in beside])
    radii = np.array([capsules[i].radius for i in which])
    half_lengths = np.array([capsules[i].length / 2 for i in which])
    away = np.empty((len(axes), len(which)))
    for p, (i, centre) in enumerate(zip(which, solids.centres, strict=True)):
        away[:, p] = np.linalg.norm(axes[:, i].mean(axis=1) - centre, axis=1)

    # With the distance D of the middles, the radii r, half the length l of the capsule's axis, and the radius R of the
    # ball around the obstacle, the distance d of a pair is
    #   D - r_1 - l - R <= d <= D - r_1 - r_2.
    # Pairs whose lower bound is above the smallest upper bound in a state are not the nearest there.
    bound = np.minimum(least, (away - radii - solids.radii).min(axis=1))
    low = away - radii - half_lengths - solids.bounds
    rows, pairs = np.nonzero(low <= bound[:, None] + EQUAL_BOUNDS)

    # The same with closer bounds.
    lower, upper = axis_bounds(solids[pairs], axes[rows, which[pairs]])
    low = lower - radii[pairs]
    high = upper - radii[pairs]
    np.minimum.at(bound, rows, high)
    is_candidate = low <= bound[rows] + EQUAL_BOUNDS
    rows = rows[is_candidate]
    pairs = pairs[is_candidate]
    result = least.copy()
    for pair in np.unique(pairs):
        at = rows[pairs == pair]
        i, item = beside[pair]
        result[at] = np.minimum(result[at], obstacle_distances(radii[pair], axes[at, i], item))
    return result


def pair_distances(
    description: Description, q: Array, obstacles: Sequence[Obstacle | Floor], pair: Pair
) -> Array:
    """Return the exact distances of one pair at states q (N, n), shape (N,), m."""
    capsules = link_capsules(description)
    axes = world_axes(description, q)
    first = axes[:, pair.capsule]
    radius = capsules[pair.capsule].radius
    if pair.other is not None:
        return capsule_distances((radius, capsules[pair.other].radius), first, axes[:, pair.other])
    obstacle = obstacles[pair.obstacle or 0]
    if isinstance(obstacle, Floor):
        heights: Array = first[:, list(pair.ends), 2].min(axis=1) - radius - obstacle.height
        return heights
    return obstacle_distances(radius, first, obstacle)


def _from_one(
    description: Description,
    capsules: tuple[LinkCapsule, ...],
    axes: Array,
    obstacle: Obstacle | Floor,
) -> Nearest:
    """Return the distances from one obstacle; the candidates are those of `_pair_names`."""
    if isinstance(obstacle, Floor):
        return _smallest(_heights(description, capsules, axes, obstacle, ()))
    beside = capsules_beside(description, obstacle)
    radii = np.array([capsules[i].radius for i in beside])
    moving = axes[:, list(beside)]
    low, high = axis_bounds(Solids.of([obstacle] * len(beside)), moving)
    return _exact(
        (low - radii, high - radii),
        lambda i, rows: obstacle_distances(radii[i], moving[rows, i], obstacle),
    )


def _heights(
    description: Description,
    capsules: tuple[LinkCapsule, ...],
    axes: Array,
    floor: Floor,
    without: Collection[int],
) -> Array:
    """Return the heights of the checked ends of capsules above a floor, shape (N, m), m; inf for those left out."""
    ends = ends_above(description, floor.height)
    heights = np.full((len(axes), len(ends)), np.inf)
    for k, (i, end) in enumerate(ends):
        if i not in without:
            heights[:, k] = axes[:, i, end, 2] - capsules[i].radius - floor.height
    return heights


def _from_itself(
    capsules: tuple[LinkCapsule, ...], axes: Array, pairs: tuple[tuple[int, int], ...]
) -> Nearest:
    """Return the distances between links; the candidates are the pairs."""
    first = [i for i, _ in pairs]
    second = [j for _, j in pairs]
    radii = [(capsules[i].radius, capsules[j].radius) for i, j in pairs]
    gaps = segment_distances(axes[:, first], axes[:, second]) - np.array(radii).reshape(-1, 2).sum(
        axis=1
    )
    return _exact(
        (gaps, gaps),
        lambda k, rows: capsule_distances(radii[k], axes[rows, first[k]], axes[rows, second[k]]),
    )


def _exact(bounds: Bounds, measure: Callable[[int, NDArray[np.int_]], Array]) -> Nearest:
    """Return the smallest distances, measured for candidates that their bounds, shape (N, m), do not exclude."""
    low, high = bounds
    distances = np.full(low.shape, np.inf)
    least = np.min(high, axis=1, initial=np.inf)
    for k in range(low.shape[1]):
        rows = np.flatnonzero(np.isfinite(low[:, k]) & (low[:, k] <= least + EQUAL_BOUNDS))
        if len(rows):
            distances[rows, k] = measure(k, rows)
    return _smallest(distances)


def _smallest(distances: Array) -> Nearest:
    """Return the smallest of distances (N, m) in each state, infinite without candidates."""
    if not distances.shape[1]:
        return np.full(len(distances), np.inf), np.zeros(len(distances), dtype=int)
    return distances.min(axis=1), distances.argmin(axis=1)


def _pair_names(
    description: Description, capsules: tuple[LinkCapsule, ...], obstacle: Obstacle | Floor
) -> list[tuple[str, str]]:
    if isinstance(obstacle, Floor):
        ends = tuple(i for i, _ in ends_above(description, obstacle.height))
    else:
        ends = capsules_beside(description, obstacle)
    return [(capsules[i].name, obstacle.name) for i in ends]


def _worst(
    every: Array, found: list[Nearest], names: list[list[tuple[str, str]]]
) -> tuple[str, str] | None:
    if not every.size or not np.isfinite(every.min()):
        return None
    state, k = (int(x) for x in np.unravel_index(np.argmin(every), every.shape))
    return names[k][int(found[k][1][state])]
