"""Polygons as triangles: fans where they are convex, and by manifold3d's triangulation where they are not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array

STRAIGHT = 1e-9
"""A corner turns inwards where the sine of its turn, the longest edges' product as measure, is below minus this."""


def triangles_of(vertices: Array, corners: NDArray[np.intp], counts: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return polygons as triangles of vertex numbers, shape (m, 3), k - 2 of a polygon of k corners, in their order.

    Parameters
    ----------
    vertices
        Shape (v, 3).
    corners
        The vertices of all polygons, one after the other, each from 0 to v - 1.
    counts
        How many corners each polygon has; those with fewer than three are left out.
    """
    starts, fans = np.cumsum(counts) - counts, np.maximum(counts - 2, 0)
    at = np.cumsum(fans) - fans
    first = np.repeat(starts, fans)
    step = np.arange(int(fans.sum())) - np.repeat(at, fans)
    triangles: NDArray[np.intp] = corners[np.stack([first, first + step + 1, first + step + 2], axis=1)]
    for k in np.unique(counts[counts > 3]):
        chosen = np.flatnonzero(counts == k)
        rings = corners[starts[chosen][:, None] + np.arange(k)]
        for i in np.flatnonzero(_is_concave(vertices[rings])):
            cut = _cut(vertices[rings[i]])
            if len(cut) == k - 2:
                triangles[at[chosen[i]] : at[chosen[i]] + k - 2] = rings[i][cut]
    return triangles


def _normals(points: Array) -> Array:
    """Return twice the area vectors of polygons, points of shape (p, k, 3): Newell's sum about the first corner."""
    spokes = points - points[:, :1]
    normals: Array = np.cross(spokes, np.roll(spokes, -1, axis=1)).sum(axis=1)
    return normals


def _is_concave(points: Array) -> NDArray[np.bool_]:
    """Return which polygons, points of shape (p, k, 3), have a corner that turns inwards."""
    with np.errstate(invalid="ignore", over="ignore"):  # coordinates that are no numbers are refused later
        edges = np.roll(points, -1, axis=1) - points
        turns = np.einsum("pki,pi->pk", np.cross(edges, np.roll(edges, -1, axis=1)), _normals(points))
        longest = (edges**2).sum(axis=2).max(axis=1) * np.linalg.norm(_normals(points), axis=1)
        concave: NDArray[np.bool_] = (turns < -STRAIGHT * longest[:, None]).any(axis=1)
    return concave


def _cut(points: Array) -> NDArray[np.intp]:
    """Return a polygon's triangles by the numbers of its corners, going round as it does."""
    from manifold3d import triangulate

    normal = _normals(points[None])[0]
    normal = normal / np.linalg.norm(normal)
    across = np.eye(3)[np.argmin(np.abs(normal))]
    u = np.cross(across, normal)
    u /= np.linalg.norm(u)
    flat = np.stack([points @ u, points @ np.cross(normal, u)], axis=1)
    cut: NDArray[np.intp] = np.asarray(triangulate([flat - flat.mean(axis=0)])).astype(np.intp).reshape(-1, 3)
    return cut
