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
from dhkit.model.shells import Shells
from dhkit.model.triangle_mesh import TriangleMesh, same_vertices

NEAR = 1e-6
"""Vertices nearer than this share of a mesh's size are joined where the mesh is open: files round each corner alone."""
LARGEST_CAP = 0.02
"""Area of the caps over all holes, at most, as a share of the whole area: beyond it the shape is not known."""
MOST_SHELLS = 400
"""Shells whose place inside others is looked at."""
FLAT = 1e-13
"""Volume below which a mesh encloses nothing, as a share of its size cubed: a wire of 1 m and 1 um has 1e-12."""
INVERTED = "inside out: all triangles were turned"


@dataclass(frozen=True, eq=False)
class Surface:
    """A mesh with its vertices made one, turned and capped as far as that is possible."""

    mesh: TriangleMesh
    is_closed: bool
    is_filled: bool
    """Whether holes were capped."""
    notes: tuple[str, ...]
    """What was changed, in words."""


def repaired(mesh: TriangleMesh) -> Surface:
    """Return a mesh as a closed surface, if it can be made one; :func:`outwards` turns its shells."""
    if is_closed(mesh):
        single, notes = _single(mesh)
        return Surface(single, True, False, notes)
    one = mesh.merged()
    if not len(one.faces):
        return Surface(one, False, False, ())
    if is_closed(one):
        one, notes = _single(one)
        return Surface(one, True, False, notes)
    near = _joined_nearby(mesh)
    if is_closed(near):
        near, notes = _single(near)
        return Surface(near, True, False, (f"vertices nearer than {NEAR:g} of the size were joined", *notes))
    for way_matters in (True, False):
        fewer, notes = _without_copies(one, way_matters=way_matters)
        if notes and is_closed(fewer := _consistent(fewer)[0]):
            return Surface(fewer, True, False, notes)
    return _capped_surface(*_without_copies(one, way_matters=True))


def _single(mesh: TriangleMesh) -> tuple[TriangleMesh, tuple[str, ...]]:
    """Return a closed mesh without copies of triangles, and, where each is there both ways round, with one of both."""
    fewer, notes = _without_copies(mesh, way_matters=True)
    if notes and is_closed(fewer):
        return fewer, notes
    if abs(signed_volume(mesh)) <= FLAT * mesh.size**3:
        fewer, notes = _without_copies(mesh, way_matters=False)
        if notes and is_closed(fewer := _consistent(fewer)[0]):
            return fewer, notes
    return mesh, ()


def _without_copies(mesh: TriangleMesh, *, way_matters: bool) -> tuple[TriangleMesh, tuple[str, ...]]:
    """Return a mesh with one of each triangle, told by its vertices and perhaps its way round, and what was dropped."""
    if way_matters:
        start = np.argmin(mesh.faces, axis=1)
        rows = np.take_along_axis(mesh.faces, (start[:, None] + np.arange(3)) % 3, axis=1)
    else:
        rows = np.sort(mesh.faces, axis=1)
    first, _ = same_vertices(rows.astype(np.float64))
    if len(first) == len(mesh.faces):
        return mesh, ()
    kept = np.sort(first)
    colours = None if mesh.colours is None else mesh.colours[kept]
    dropped = len(mesh.faces) - len(kept)
    said = f"{dropped} triangle{'s' * (dropped > 1)} written more than once {'were' if dropped > 1 else 'was'} dropped"
    return TriangleMesh(mesh.vertices, mesh.faces[kept], colours), (said,)


def _capped_surface(mesh: TriangleMesh, notes: tuple[str, ...]) -> Surface:
    """Return an open mesh with its triangles turned alike and its holes capped, as far as that makes it closed."""
    one, turned = _consistent(mesh)
    if turned:
        notes = (*notes, f"{turned} triangles were turned to go round as their neighbours do")
    if is_closed(one):
        return Surface(one, True, False, notes)
    one, share = _capped(one)
    if is_closed(one):
        return Surface(one, True, True, (*notes, f"open: holes were capped, {100 * share:.2g} % of the area"))
    return Surface(one, False, False, notes)


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


def outwards(mesh: TriangleMesh) -> tuple[TriangleMesh, tuple[str, ...]]:
    """Return a closed mesh with its shells turned outwards, those of cavities inwards, and what was done."""
    is_inverted = signed_volume(mesh) < 0
    if is_inverted:
        mesh = mesh.turned()
    shells = Shells(mesh)
    if shells.count > MOST_SHELLS:
        said = (INVERTED,) if is_inverted else ()
        return mesh, (*said, f"{shells.count} shells: which of them lie in others was not looked at")
    if shells.count == 1:
        return mesh, (INVERTED,) if is_inverted else ()
    # A cavity lies where the shells around it count 1; a shell elsewhere has its triangles the wrong way round.
    shells.turn(shells.inside_out())
    flipped = shells.flipped ^ is_inverted
    notes = []
    if flipped.all():
        notes.append(INVERTED)
    elif flipped.any():
        notes.append(f"{int(flipped.sum())} of {shells.count} shells were inside out and were turned")
    return shells.mesh, (*notes, *_shell_notes(shells))


def _shell_notes(shells: Shells) -> list[str]:
    notes = []
    if cavities := int((shells.volume < 0).sum()):
        notes.append(f"{cavities} cavit{'y' if cavities == 1 else 'ies'} inside")
    doubled, (twice, reaching) = shells.doubled(), shells.shared()
    share = f" ({100 * twice / float(shells.volume.sum()):.2g} % of the volume)" if twice else ""
    if doubled or twice:
        which = f"{doubled} of {shells.count}" if doubled else "some"
        notes.append(f"warning: {which} shells lie in or reach into others, where the material counts twice{share}")
    if reaching:
        which = "a cavity reaches" if reaching == 1 else f"{reaching} cavities reach"
        notes.append(f"warning: {which} out of the material around, and takes volume away where there is none")
    return notes
