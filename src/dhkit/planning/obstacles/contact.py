"""The two links of an arm that are nearest to each other, by their shapes, with the points where they are nearest."""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, joint_vector, takes_robot, world_to_frames
from dhkit.planning.obstacles.capsules import LinkBody, link_capsules, world_axes
from dhkit.planning.obstacles.pairs import link_pairs
from dhkit.planning.obstacles.solids import nearest_of_bodies, segment_distances


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
    nearest: NearestLinks | None = None
    for bound, bodies in sorted((bound, bodies) for bodies, bound in bounds.items()):
        if nearest is not None and bound >= nearest.distance:
            break
        enough = np.inf if nearest is None else nearest.distance
        found = nearest_of_bodies(description, frames, bodies, enough)
        if found is not None and found[0] < enough:
            nearest = NearestLinks(*bodies, *found)
    return nearest


def may_touch(description: Description, q: ArrayLike) -> tuple[LinkBody, LinkBody] | None:
    """Return the two links whose capsules penetrate each other deepest, if any do: the links themselves may touch.

    It needs neither coal nor the shapes; links with one joint between them are left out.

    Parameters
    ----------
    q
        Joint values, shape (n,), rad and m.
    """
    capsules = link_capsules(description)
    axes = world_axes(description, joint_vector(description, q)[None])[0]
    pairs = [
        (i, j) for (i, first), (j, second) in combinations(enumerate(capsules), 2) if abs(second.link - first.link) > 1
    ]
    if not pairs:
        return None
    i, j = np.array(pairs).T
    radii = np.array([capsule.radius for capsule in capsules])
    gaps = segment_distances(axes[i], axes[j]) - radii[i] - radii[j]
    worst = int(np.argmin(gaps))
    return (capsules[i[worst]].body, capsules[j[worst]].body) if gaps[worst] < 0 else None


def _lower_bounds(description: Description, q: Array) -> dict[tuple[LinkBody, LinkBody], float]:
    """Return lower bounds of the distances between the bodies of links that are checked, m: those of their capsules."""
    capsules = link_capsules(description)
    pairs = link_pairs(description)
    checked = {(capsules[i].body, capsules[j].body) for i, j in pairs.capsules} | set(pairs.shapes)
    checked -= set(pairs.unchecked)
    of_bodies = [
        (i, j)
        for (i, first), (j, second) in combinations(enumerate(capsules), 2)
        if (first.body, second.body) in checked
    ]
    if not of_bodies:
        return {}
    i, j = np.array(of_bodies).T
    axes = world_axes(description, q[None])[0]
    radii = np.array([capsule.radius for capsule in capsules])
    gaps = segment_distances(axes[i], axes[j]) - radii[i] - radii[j]
    bounds: dict[tuple[LinkBody, LinkBody], float] = {}
    for (first, second), gap in zip(of_bodies, gaps.tolist(), strict=True):
        bodies = capsules[first].body, capsules[second].body
        bounds[bodies] = min(bounds.get(bodies, np.inf), gap)
    return bounds
