"""Exact distances between the shapes of two links, for links whose capsules are too wide for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Box, Capsule, Cylinder, Description, Sphere, world_to_frames
from dhkit.model.shapes import MeshVersions, Part, link_parts, mesh_versions
from dhkit.planning.obstacles.capsules import LinkBody, convex_hull
from dhkit.planning.obstacles.solids import coal_module, distance_request, signed_distance

SHORT = 1e-12
"""Length of a vector, m, below which it has no direction."""


@dataclass(frozen=True, eq=False)
class _Solid:
    """A convex solid that moves with a link."""

    shape: Any
    """coal's."""
    T_link_solid: Array
    """Pose in the link's DH frame, shape (4, 4), m."""
    extent: Callable[[Array], Array]
    """Support function: the largest n . x of its points x, m, for unit vectors n in its frame, shape (..., 3)."""


def shape_distances(
    description: Description, q: Array, bodies: tuple[LinkBody, LinkBody], enough: float = np.inf
) -> Array:
    """Return the signed distances between the shapes of two bodies of links, shape (N,), m; inf if one has none.

    Boxes, spheres, cylinders and capsules are exact; a mesh counts as its convex hull.

    Parameters
    ----------
    q
        Joint values, shape (N, n), rad and m.
    bodies
        The two bodies.
    enough
        Distance, m, from which a lower bound of the distance is returned in its place: it takes 2 µs a state, and the
        distance itself 50 µs.

    Raises
    ------
    ModelError
        coal is not installed, or a mesh cannot be read.
    """
    solids = _solids(description, mesh_versions(description))
    frames = world_to_frames(description, q)
    least = np.full(len(q), np.inf)
    coal = coal_module()
    request, result = distance_request(), coal.DistanceResult()
    for first, second in product(*(solids.get(body, ()) for body in bodies)):
        T1 = frames[:, bodies[0].link] @ first.T_link_solid
        T2 = frames[:, bodies[1].link] @ second.T_link_solid
        bound = _separation(first, T1, second, T2)
        decided = bound >= np.minimum(least, enough)
        least[decided] = np.minimum(least, bound)[decided]
        for k in np.flatnonzero(~decided):
            here, there = (
                coal.Transform3s(np.ascontiguousarray(T[k, :3, :3]), np.ascontiguousarray(T[k, :3, 3]))
                for T in (T1, T2)
            )
            gap = signed_distance(coal, first.shape, here, second.shape, there, request, result)
            least[k] = min(least[k], gap)
    return least


def _separation(first: _Solid, T1: Array, second: _Solid, T2: Array) -> Array:
    """Return the largest gap between two solids along one of several directions, shape (N,), m.

    It is a lower bound of their distance: with the support function h of a solid, that is h(n) = max n . x over its
    points x, a plane of normal n lies between them if the gap along n is positive,

        gap(n) = n . (c2 - c1) - h1(n) - h2(-n),

    and two convex solids are as far apart as the largest gap (Boyd and Vandenberghe 2004, ch. 8.1). Tried are the axes
    of both solids, the line between their centres, its parts across an axis, and the common normal of the axes.
    """
    R1 = T1[:, :3, :3]
    R2 = T2[:, :3, :3]
    line = T2[:, :3, 3] - T1[:, :3, 3]
    z1 = R1[:, :, 2]
    z2 = R2[:, :, 2]
    across = [line - np.sum(line * z, axis=1, keepdims=True) * z for z in (z1, z2)]
    axes = [R[:, :, i] for R in (R1, R2) for i in range(3)]
    n = np.stack([*axes, line, *across, np.cross(z1, z2)], axis=1)

    length = np.linalg.norm(n, axis=2, keepdims=True)
    n = np.divide(n, length, out=np.broadcast_to(z1[:, None], n.shape).copy(), where=length > SHORT)
    along = np.einsum("nki,ni->nk", n, line)
    n = np.where(along[..., None] < 0, -n, n)

    # n in the frame of each solid, the second seen from outside.
    gaps: Array = np.abs(along) - first.extent(n @ R1) - second.extent(-n @ R2)
    largest: Array = gaps.max(axis=1)
    return largest


@lru_cache(maxsize=64)
def _solids(description: Description, meshes: MeshVersions) -> dict[LinkBody, tuple[_Solid, ...]]:
    """Return the solids of each body that has any."""
    found: dict[LinkBody, tuple[_Solid, ...]] = {}
    for part in link_parts(description):
        body = LinkBody(part.link, part.body)
        found[body] = (*found.get(body, ()), _solid(part))
    return found


def _solid(part: Part) -> _Solid:
    coal = coal_module()
    T = part.T_link_part
    match part.geometry:
        case Sphere():
            r = float(part.geometry.radius)
            return _Solid(coal.Sphere(r), T, lambda n: np.full(n.shape[:-1], r))
        case Capsule():
            r = float(part.geometry.radius)
            half = float(part.geometry.length) / 2
            return _Solid(coal.Capsule(r, 2 * half), T, lambda n: r + half * np.abs(n[..., 2]))
        case Cylinder():
            r = float(part.geometry.radius)
            half = float(part.geometry.length) / 2
            return _Solid(
                coal.Cylinder(r, 2 * half), T, lambda n: r * np.hypot(n[..., 0], n[..., 1]) + half * np.abs(n[..., 2])
            )
        case Box():
            edges = np.array([float(edge) for edge in part.geometry.size])
            return _Solid(coal.Box(*edges.tolist()), T, lambda n: np.abs(n) @ (edges / 2))
    corners, faces = convex_hull(part)
    hull = coal.Convex(_vectors(corners), _triangles(faces))
    return _Solid(hull, T, lambda n: np.max(n @ corners.T, axis=-1))


def _vectors(corners: Array) -> Any:
    vectors = coal_module().StdVec_Vec3s()
    vectors.extend(corners)
    return vectors


def _triangles(faces: NDArray[np.int_]) -> Any:
    coal = coal_module()
    triangles = coal.StdVec_Triangle()
    triangles.extend([coal.Triangle(*map(int, face)) for face in faces])
    return triangles
