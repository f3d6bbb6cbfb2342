"""Surfaces made fit to enclose a volume: triangles turned the same way round, shells turned outwards, holes capped.

A surface is closed where every edge is passed as often in one direction as in the other. Then its triangles are the
boundary of a region, counted with signs, and integrals over that region are exact sums over the triangles; it does not
matter how many shells there are or whether some touch. A hollow link has an outer shell and inner shells that go the
other way round: what turns a shell here looks first whether it lies inside another one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.model.triangle_mesh import TriangleMesh

__all__ = ["Surface", "closed_surface", "is_closed", "signed_volume", "tetrahedra"]

NEAR = 1e-6
"""Vertices nearer than this share of a mesh's size are joined where the mesh is open: files round each corner alone."""
LARGEST_CAP = 0.02
"""Area of the caps over all holes, at most, as a share of the whole area: beyond it the shape is not known."""
MOST_SHELLS = 400
"""Shells whose place inside others is looked at: each is held against all triangles."""
BEHIND = 1e-6
"""How far behind a triangle a point is looked at, as a share of the mesh's size."""
OVERLAP_POINTS = 16
"""Middles of triangles of a shell that are looked at: shells that overlap by a few triangles alone are not found."""
INSIDE = 0.75
"""Winding number of a point, above which it is inside: 1 inside a shell, 0 outside, up to rounding."""


@dataclass(frozen=True, eq=False)
class Surface:
    """A mesh with its vertices made one, turned and capped as far as that is possible."""

    mesh: TriangleMesh
    is_closed: bool
    is_filled: bool
    """Whether holes were capped."""
    notes: tuple[str, ...]
    """What was changed, in words."""


def closed_surface(mesh: TriangleMesh) -> Surface:
    """Return a mesh as a closed surface that goes round counterclockwise seen from outside, if it can be made one."""
    notes: list[str] = []
    if not is_closed(mesh):
        mesh, is_filled, repairs = _repaired(mesh)
        notes += repairs
        if is_filled is None:
            return Surface(mesh, False, False, tuple(notes))
    else:
        is_filled = False
    outside, said = _outwards(mesh)
    return Surface(outside, True, is_filled, (*notes, *said))


def _repaired(mesh: TriangleMesh) -> tuple[TriangleMesh, bool | None, list[str]]:
    """Return a mesh made closed, whether holes were capped for it, None where that fails, and what was changed."""
    one = mesh.merged()
    if is_closed(one):
        return one, False, []
    if not len(one.faces):
        return one, None, []
    notes: list[str] = []
    near = _joined_nearby(mesh)
    if is_closed(near):
        return near, False, [f"vertices nearer than {NEAR:g} of the size were joined"]
    one, turned = _consistent(one)
    if turned:
        notes.append(f"{turned} triangles were turned to go round as their neighbours do")
    if is_closed(one):
        return one, False, notes
    one, share = _capped(one)
    if is_closed(one):
        return one, True, [*notes, f"open: holes were capped, {100 * share:.2g} % of the area"]
    return one, None, notes


def is_closed(mesh: TriangleMesh) -> bool:
    """Return whether every edge, between vertices of equal number, is passed as often one way as the other.

    The edges and the reversed edges are compared as multisets, by the sums of 64-bit digests: unlike ones have equal
    sums with a chance of 1 in 2^64, and nothing need be sorted.
    """
    if not len(mesh.faces):
        return False
    edges, count = _edges(mesh.faces).astype(np.uint64), np.uint64(len(mesh.vertices))
    there, back = edges[:, 0] * count + edges[:, 1], edges[:, 1] * count + edges[:, 0]
    return bool(_digest(there).sum() == _digest(back).sum())


def _digest(keys: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return well mixed 64-bit digests (the finalizer of splitmix64: Steele, Lea, Flood 2014)."""
    mixed = (keys ^ (keys >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    digest: NDArray[np.uint64] = mixed ^ (mixed >> np.uint64(31))
    return digest


def signed_volume(mesh: TriangleMesh) -> float:
    """Return the volume of a closed mesh, negative where it is inside out, in its unit cubed."""
    return float(_volumes(mesh).sum())


def _volumes(mesh: TriangleMesh) -> Array:
    """Return the signed volume between each triangle and the middle of the mesh, shape (m,)."""
    return tetrahedra(*mesh.corners_about(mesh.bounds.mean(axis=0)))


def tetrahedra(a: Array, b: Array, c: Array) -> Array:
    """Return the signed volumes of tetrahedra with corners 0, a, b and c, each of shape (m, 3)."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = a.T, b.T, c.T
    volumes: Array = (ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)) / 6
    return volumes


def _edges(faces: NDArray[np.intp]) -> NDArray[np.int64]:
    """Return the directed edges of triangles, shape (3 m, 2): all first ones, all second ones, all third ones."""
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)


def _joined_nearby(mesh: TriangleMesh) -> TriangleMesh:
    step = NEAR * mesh.size
    if step == 0:
        return mesh
    rounded = np.round((mesh.vertices - mesh.bounds[0]) / step)
    return TriangleMesh(rounded, mesh.faces, mesh.colours).merged().scaled(step).moved(_shift(mesh.bounds[0]))


def _shift(offset: Array) -> Array:
    T = np.eye(4)
    T[:3, 3] = offset
    return T


def _consistent(mesh: TriangleMesh) -> tuple[TriangleMesh, int]:
    """Return a mesh whose neighbours go round alike, and how many triangles were turned.

    Each triangle is two nodes of a graph, as it is and turned; triangles that share an edge join the nodes in which
    they pass it in opposite directions. A piece of the surface that can be oriented is then two components, and the one
    with more area as it was is kept: so the inner shell of a hollow link stays the inner one.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    m, edges = len(mesh.faces), _edges(mesh.faces)
    low, high = edges.min(axis=1), edges.max(axis=1)
    order = np.lexsort((high, low))
    same = (low[order][1:] == low[order][:-1]) & (high[order][1:] == high[order][:-1])
    starts = np.flatnonzero(np.concatenate([[True], ~same]))
    pairs = starts[np.diff(np.append(starts, len(order))) == 2]  # edges of exactly two triangles
    first, second = order[pairs], order[pairs + 1]
    alike = (edges[first, 0] == edges[second, 0]).astype(np.int64)
    f, g = first % m, second % m
    rows = np.concatenate([f, f + m])
    columns = np.concatenate([g + alike * m, g + (1 - alike) * m])
    _, label = connected_components(
        coo_array((np.ones(len(rows)), (rows, columns)), shape=(2 * m, 2 * m)), directed=False
    )
    kept, turned = label[:m], label[m:]
    if np.any(kept == turned):  # one-sided, like a Moebius strip
        return mesh, 0
    area = np.linalg.norm(np.cross(*np.moveaxis(np.diff(mesh.corners, axis=1), 1, 0)), axis=1)
    weight = np.bincount(kept, area, minlength=label.max() + 1)
    flip = weight[turned] > weight[kept]
    faces = np.where(flip[:, None], mesh.faces[:, ::-1], mesh.faces)
    return TriangleMesh(mesh.vertices, faces, mesh.colours), int(flip.sum())


def _capped(mesh: TriangleMesh) -> tuple[TriangleMesh, float]:
    """Return a mesh with a fan of triangles over each hole, and the fans' share of the area; itself where too much."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    edges, count = _edges(mesh.faces), len(mesh.vertices)
    keys, times = np.unique(edges[:, 0] * count + edges[:, 1], return_counts=True)
    back = (keys % count) * count + keys // count
    at = np.minimum(np.searchsorted(keys, back), len(keys) - 1)
    missing = times - np.where(keys[at] == back, times[at], 0)
    rim = np.repeat(keys, np.maximum(missing, 0))  # an edge that is passed more often than back
    start, end = rim // count, rim % count
    graph = coo_array((np.ones(len(rim)), (start, end)), shape=(count, count))
    _, label = connected_components(graph, directed=False)
    holes, hole = np.unique(label[start], return_inverse=True)
    size = np.bincount(hole, minlength=len(holes))
    middle = np.stack(
        [np.bincount(hole, mesh.vertices[start, k], minlength=len(holes)) / size for k in range(3)], axis=1
    )
    fans = np.stack([end, start, count + hole], axis=1)
    filled = TriangleMesh(np.concatenate([mesh.vertices, middle]), np.concatenate([mesh.faces, fans]))
    corners = filled.corners
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    share = float(area[len(mesh.faces) :].sum() / max(area.sum(), np.finfo(float).tiny))
    return (filled, share) if share <= LARGEST_CAP else (mesh, share)


def _outwards(mesh: TriangleMesh) -> tuple[TriangleMesh, tuple[str, ...]]:
    """Return a closed mesh with its shells turned outwards, those of cavities inwards, and what was done."""
    notes: list[str] = []
    if signed_volume(mesh) < 0:
        mesh = mesh.turned()
        notes.append("inside out: all triangles were turned")
    shells = _shells(mesh)
    count = int(shells.max()) + 1
    if count == 1:
        return mesh, tuple(notes)
    if count > MOST_SHELLS:
        return mesh, (*notes, f"{count} shells: which of them lie in others was not looked at")
    volume = np.bincount(shells, _volumes(mesh), minlength=count)
    inside = np.array([_winding(mesh, shells != k, _inner_points(mesh, shells == k)[0]) for k in range(count)])
    # A cavity lies where the shells around it count 1; a shell elsewhere has its triangles the wrong way round.
    wrong = (volume < 0) & (inside < INSIDE)
    if wrong.any():
        faces = np.where(wrong[shells][:, None], mesh.faces[:, ::-1], mesh.faces)
        mesh = TriangleMesh(mesh.vertices, faces, mesh.colours)
        notes.append(f"{int(wrong.sum())} of {count} shells were inside out and were turned")
    if cavities := int(((volume < 0) & ~wrong).sum()):
        notes.append(f"{cavities} cavit{'y' if cavities == 1 else 'ies'} inside")
    if doubled := sum(_overlaps(mesh, shells, k) for k in np.flatnonzero(volume > 0).tolist()):
        notes.append(
            f"warning: {doubled} of {count} shells lie in or reach into others, where the material counts twice"
        )
    return mesh, tuple(notes)


def _overlaps(mesh: TriangleMesh, shells: NDArray[np.intp], k: int) -> bool:
    """Return whether a few points of a shell lie inside others."""
    points = _inner_points(mesh, shells == k)
    chosen = points[:: max(1, len(points) // OVERLAP_POINTS)][:OVERLAP_POINTS]
    return any(_winding(mesh, shells != k, point) > INSIDE for point in chosen)


def _inner_points(mesh: TriangleMesh, chosen: NDArray[np.bool_]) -> Array:
    """Return points just behind triangles' middles: on a face that two shells share the winding number is undecided."""
    corners = mesh.corners[chosen]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    unit = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    points: Array = corners.mean(axis=1) - BEHIND * mesh.size * unit
    return points


def _shells(mesh: TriangleMesh) -> NDArray[np.intp]:
    """Return the number of the connected piece that each triangle belongs to, shape (m,)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    # Two edges join the three vertices of a triangle.
    first, middle, last = mesh.faces.astype(np.int32).T
    ends = np.concatenate([first, middle]), np.concatenate([middle, last])
    graph = coo_array((np.ones(len(ends[0]), dtype=np.int8), ends), shape=(len(mesh.vertices),) * 2)
    _, label = connected_components(graph, directed=False)
    if not label[mesh.faces[:, 0]].any():
        return np.zeros(len(mesh.faces), dtype=np.intp)
    _, shells = np.unique(label[mesh.faces[:, 0]], return_inverse=True)
    return shells.reshape(-1)


def _winding(mesh: TriangleMesh, chosen: NDArray[np.bool_], point: Array) -> float:
    """Return how often triangles go round a point: the solid angles over 4 pi (Van Oosterom, Strackee 1983)."""
    a, b, c = np.moveaxis(mesh.corners[chosen] - point, 1, 0)
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    triple = np.einsum("ij,ij->i", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", x, y) for x, y in ((a, b), (b, c), (c, a)))
    angle = 2 * np.arctan2(triple, la * lb * lc + ab * lc + bc * la + ca * lb)
    return float(angle.sum() / (4 * np.pi))
