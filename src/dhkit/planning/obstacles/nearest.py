"""The two nearest links of an arm, and the nearest link and obstacle, measured between their shapes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from operator import itemgetter
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, joint_vector, takes_robot, world_to_frames
from dhkit.planning.obstacles.capsules import LinkBody, link_capsules, world_axes
from dhkit.planning.obstacles.pairs import capsules_beside, ends_above, link_pairs
from dhkit.planning.obstacles.scene import Floor, Obstacle, Scene, Solids, check_obstacles
from dhkit.planning.obstacles.solids import (
    axis_bounds,
    nearest_of_bodies,
    nearest_to_obstacle,
    segment_distances,
)

Pair = TypeVar("Pair")
"""Two bodies of links, or a body and an obstacle."""


class NearestLinks(NamedTuple):
    """The two links of an arm that are nearest to each other, or penetrate each other deepest."""

    first: LinkBody
    second: LinkBody
    distance: float
    """Signed distance of their shapes, m; a mesh counts as its convex hull."""
    points: Array
    """The nearest points of the first and of the second, shape (2, 3), m, world; the deepest ones of a penetration."""


@takes_robot
def nearest_links(description: Description, q: ArrayLike) -> NearestLinks | None:
    """Return the two links nearest to each other in one state, of those that planning checks; None if there are none.

    Links whose shapes overlap in all configurations are left out, see :class:`LinkPairs`. Capsules contain the shapes,
    so that their distance is a lower bound: pairs of links are measured in the order of their bounds, until the next
    bound is larger than the smallest distance found.

    Parameters
    ----------
    q
        Joint values, shape (n,), rad and m.

    Raises
    ------
    ModelError
        coal is not installed, or a mesh cannot be read.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> found = nearest_links(library_robot("puma560"), [0, 0, 2.7, 0, 0, 0])
    >>> found.first.name, found.second.name
    ('link 3', 'link 5')
    """
    q = joint_vector(description, q)
    bounds = _lower_bounds(description, q)
    frames = world_to_frames(description, q)
    found = _nearest_in_order(bounds, partial(nearest_of_bodies, description, frames))
    return None if found is None else NearestLinks(*found.pair, found.distance, found.points)


class NearestObstacle(NamedTuple):
    """The link and the obstacle that are nearest to each other, or penetrate each other deepest."""

    link: LinkBody
    obstacle: Obstacle | Floor
    distance: float
    """Signed distance of the link's shapes from the obstacle, m; a mesh counts as its convex hull."""
    points: Array
    """The nearest points of the link and of the obstacle, shape (2, 3), m, world."""


@takes_robot
def nearest_obstacle(
    description: Description, q: ArrayLike, obstacles: Scene
) -> NearestObstacle | None:
    """Return the link and the obstacle nearest to each other in one state; None if there are none.

    The links are those of which planning checks some part against an obstacle: not the base, and not a foot that stands
    in a table. As in :func:`nearest_links`, they are measured in the order of the lower bounds by their capsules.

    Parameters
    ----------
    q
        Joint values, shape (n,), rad and m.
    obstacles
        Obstacles, of which at most one is a floor.

    Raises
    ------
    ModelError
        coal is not installed, or a mesh cannot be read.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> ball = Obstacle.sphere(0.1, (0.4, 0.2, 0.9), name="ball")
    >>> found = nearest_obstacle(library_robot("puma560"), [0, 0, 0, 0, 0, 0], [ball])
    >>> found.link.name, found.obstacle.name
    ('link 3', 'ball')
    """
    q = joint_vector(description, q)
    frames = world_to_frames(description, q)
    axes = world_axes(description, q[None])[0]
    bounds: list[tuple[float, tuple[LinkBody, Obstacle | Floor]]] = []
    for obstacle in check_obstacles(obstacles):
        for body, bound in _bounds_beside(description, axes, obstacle).items():
            bounds.append((bound, (body, obstacle)))

    def measure(
        pair: tuple[LinkBody, Obstacle | Floor], enough: float
    ) -> tuple[float, Array] | None:
        return nearest_to_obstacle(description, frames, *pair, enough)

    found = _nearest_in_order(bounds, measure)
    return None if found is None else NearestObstacle(*found.pair, found.distance, found.points)


@dataclass(frozen=True)
class _Nearest(Generic[Pair]):
    pair: Pair
    distance: float
    """m"""
    points: Array
    """Shape (2, 3), m, world."""


def _nearest_in_order(
    bounds: Sequence[tuple[float, Pair]],
    measure: Callable[[Pair, float], tuple[float, Array] | None],
) -> _Nearest[Pair] | None:
    """Return the nearest of pairs, each given with a lower bound of its distance, m.

    Pairs are measured in the order of their bounds. The search ends where the next bound is not below the smallest
    distance found. ``measure`` gets a pair and that smallest distance; it returns None for a pair that is not nearer.
    """
    nearest: _Nearest[Pair] | None = None
    enough = np.inf
    for bound, pair in sorted(bounds, key=itemgetter(0)):
        if nearest is not None and bound >= enough:
            break
        found = measure(pair, enough)
        if found is not None and found[0] < enough:
            nearest = _Nearest(pair, *found)
            enough = nearest.distance
    return nearest


def _bounds_beside(
    description: Description, axes: Array, obstacle: Obstacle | Floor
) -> dict[LinkBody, float]:
    """Return lower bounds of the distances of bodies from an obstacle, m: those of all their capsules with ``axes``."""
    capsules = link_capsules(description)
    if isinstance(obstacle, Floor):
        checked = {capsules[i].body for i, _ in ends_above(description, obstacle.height)}
        lowest = axes[:, :, 2].min(axis=1) - obstacle.height
    else:
        checked = {capsules[i].body for i in capsules_beside(description, obstacle)}
        lowest = axis_bounds(Solids.of([obstacle] * len(capsules)), axes)[0]
    bounds: dict[LinkBody, float] = {}
    for capsule, axis_distance in zip(capsules, lowest.tolist(), strict=True):
        body = capsule.body
        if body in checked:
            bounds[body] = min(bounds.get(body, np.inf), axis_distance - capsule.radius)
    return bounds


def may_touch(description: Description, q: ArrayLike) -> tuple[LinkBody, LinkBody] | None:
    """Return the two links whose capsules penetrate each other deepest; None if no capsules penetrate each other.

    Capsules contain the links' shapes: the links returned may touch, and if it returns None, no links do. Links with
    one joint between them are left out. Neither coal nor the shapes are needed.

    Parameters
    ----------
    q
        Joint values, shape (n,), rad and m.
    """
    capsules = link_capsules(description)
    pairs = [
        (i, j)
        for (i, first), (j, second) in combinations(enumerate(capsules), 2)
        if abs(second.link - first.link) > 1
    ]
    if not pairs:
        return None
    gaps = _gaps(description, joint_vector(description, q), pairs)
    deepest = int(np.argmin(gaps))
    if gaps[deepest] >= 0:
        return None
    i, j = pairs[deepest]
    return capsules[i].body, capsules[j].body


def _lower_bounds(
    description: Description, q: Array
) -> list[tuple[float, tuple[LinkBody, LinkBody]]]:
    """Return the pairs of bodies that are checked, each after the distance of their capsules, m: a lower bound."""
    capsules = link_capsules(description)
    checks = link_pairs(description)
    checked = {(capsules[i].body, capsules[j].body) for i, j in checks.capsules}
    checked |= set(checks.shapes)
    checked -= set(checks.unchecked)
    pairs = [
        (i, j)
        for (i, first), (j, second) in combinations(enumerate(capsules), 2)
        if (first.body, second.body) in checked
    ]
    if not pairs:
        return []
    least: dict[tuple[LinkBody, LinkBody], float] = {}
    for (i, j), gap in zip(pairs, _gaps(description, q, pairs).tolist(), strict=True):
        bodies = capsules[i].body, capsules[j].body
        least[bodies] = min(least.get(bodies, np.inf), gap)
    return [(bound, bodies) for bodies, bound in least.items()]


def _gaps(description: Description, q: Array, pairs: Sequence[tuple[int, int]]) -> Array:
    """Return the signed distances between capsules, given by their indices, shape (pairs,), m.

    Capsules are as far apart as their axes less both radii.
    """
    i, j = np.array(pairs).T
    axes = world_axes(description, q[None])[0]
    radii = np.array([capsule.radius for capsule in link_capsules(description)])
    gaps: Array = segment_distances(axes[i], axes[j]) - radii[i] - radii[j]
    return gaps
