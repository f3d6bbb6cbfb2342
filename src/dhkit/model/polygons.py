"""Polygons as triangles: fans where they are convex, manifold3d's triangulation where they are not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.packages import imported

_CONCAVE_SINE = 1e-9
"""A corner is concave if its turn, relative to the squared length of the longest edge, is below minus this number."""


def triangles_of(
    vertices: Array, corners: NDArray[np.intp], counts: NDArray[np.intp]
) -> NDArray[np.intp]:
    """Return polygons as triangles of vertex indices, shape (m, 3), k - 2 for a polygon of k corners, in their order.

    Parameters
    ----------
    vertices
        Shape (v, 3), any unit.
    corners
        The vertex indices of all polygons, one after the other, from 0 to v - 1, shape (sum of counts,).
    counts
        The number of corners of each polygon, shape (p,); polygons with fewer than three are left out.
    """
    # The fan of a polygon 0 ... k - 1: triangles (0, i + 1, i + 2) for i = 0 ... k - 3, right where it is convex.
    starts = np.cumsum(counts) - counts
    sizes = np.maximum(counts - 2, 0)
    first_triangles = np.cumsum(sizes) - sizes
    first = np.repeat(starts, sizes)
    step = np.arange(int(sizes.sum())) - np.repeat(first_triangles, sizes)
    triangles: NDArray[np.intp] = corners[
        np.stack([first, first + step + 1, first + step + 2], axis=1)
    ]

    # Polygons with a concave corner are triangulated one by one.
    for k in np.unique(counts[counts > 3]):
        chosen = np.flatnonzero(counts == k)
        rings = corners[starts[chosen][:, None] + np.arange(k)]
        for i in np.flatnonzero(_is_concave(vertices[rings])):
            triangulation = _triangulate(vertices[rings[i]])
            if len(triangulation) == k - 2:
                start = first_triangles[chosen[i]]
                triangles[start : start + k - 2] = rings[i][triangulation]
    return triangles


def _normals(points: Array) -> Array:
    """Return twice the area vectors of polygons, points of shape (p, k, 3): Newell's sum about the first corner."""
    spokes = points - points[:, :1]
    normals: Array = np.cross(spokes, np.roll(spokes, -1, axis=1)).sum(axis=1)
    return normals


def _is_concave(points: Array) -> NDArray[np.bool_]:
    """Return which polygons, points of shape (p, k, 3), have a concave corner."""
    # Coordinates that are not finite are refused later.
    with np.errstate(invalid="ignore", over="ignore"):
        edges = np.roll(points, -1, axis=1) - points
        turns = np.einsum(
            "pki,pi->pk", np.cross(edges, np.roll(edges, -1, axis=1)), _normals(points)
        )

        # A corner is concave if its turn e_i x e_(i+1) points against the normal.
        longest = (edges**2).sum(axis=2).max(axis=1) * np.linalg.norm(_normals(points), axis=1)
        concave: NDArray[np.bool_] = (turns < -_CONCAVE_SINE * longest[:, None]).any(axis=1)
    return concave


def _triangulate(points: Array) -> NDArray[np.intp]:
    """Return a polygon's triangles by the indices of its corners, in the polygon's own orientation."""
    triangulate = imported("manifold3d", "reading concave faces").triangulate

    normal = _normals(points[None])[0]
    normal = normal / np.linalg.norm(normal)

    # Coordinates in the polygon's plane: u and normal x u.
    across = np.eye(3)[np.argmin(np.abs(normal))]
    u = np.cross(across, normal)
    u /= np.linalg.norm(u)
    flat = np.stack([points @ u, points @ np.cross(normal, u)], axis=1)
    triangles = np.asarray(triangulate([flat - flat.mean(axis=0)]))
    return triangles.astype(np.intp).reshape(-1, 3)
