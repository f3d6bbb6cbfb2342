"""Surfaces repaired to enclose a volume: triangles oriented alike, shells turned outwards, holes capped.

A surface is closed if every edge is passed as often in one direction as in the other. Then its triangles are the
boundary of a region, counted with signs, and integrals over that region are exact sums over the triangles, whatever
the number of shells and whether some touch. A hollow link has an outer shell and inner shells of opposite orientation,
so a shell is turned only after a test whether it lies inside another one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.model.bounds import BOUNDS
from dhkit.model.shells import Shells
from dhkit.model.triangle_mesh import TriangleMesh, area_vectors, component_labels, same_vertices

_MERGE_DISTANCE = 1e-6
"""Distance, as a share of a mesh's size, below which vertices of an open mesh are merged: files round each corner."""
_MAX_CAP_AREA = 0.02
"""Largest area of the caps over all holes, as a share of the whole area: with larger holes the shape is unknown."""
MIN_VOLUME = 1e-13
"""Smallest enclosed volume, as a share of the mesh's size cubed; a wire of 1 m length and 1 um width has 1e-12."""
_DOUBLED = "warning: the surface lies over itself, and the material inside counts twice"
"""Note on a surface that is written twice, in two tessellations."""
_INVERTED = "inside out: all triangles were turned"


@dataclass(frozen=True, eq=False)
class Surface:
    """A mesh after its repair, closed if that was possible."""

    mesh: TriangleMesh
    is_closed: bool
    is_filled: bool = False
    """Whether holes were capped."""
    notes: tuple[str, ...] = ()
    """Changes of the mesh, for printing."""


def repaired(mesh: TriangleMesh) -> Surface:
    """Return a mesh as a closed surface if possible, in its own unit; :func:`outwards` turns its shells."""
    if is_closed(mesh):
        return _closed_surface(mesh)
    merged = mesh.merged()
    if not len(merged.faces):
        return Surface(merged, is_closed=False)
    if is_closed(merged):
        return _closed_surface(merged)
    near = _merged_nearby(mesh)
    if is_closed(near):
        return _closed_surface(
            near, f"vertices nearer than {_MERGE_DISTANCE:g} of the size were joined"
        )
    for with_orientation in (True, False):
        fewer, notes = _without_duplicates(merged, with_orientation=with_orientation)
        if notes and is_closed(fewer := _consistently_oriented(fewer)[0]):
            return Surface(fewer, is_closed=True, notes=notes)
    fewer, notes = _without_duplicates(merged, with_orientation=True)
    oriented, turned = _consistently_oriented(fewer)
    if turned:
        notes = (*notes, f"{turned} triangles were turned to go round as their neighbours do")
    if is_closed(oriented):
        return Surface(oriented, is_closed=True, notes=notes)
    # Triangles that are written twice may be the wall between two bodies: without them, both would be open.
    for candidate, changes in (
        (oriented, notes),
        (merged, ()),
        (_consistently_oriented(merged)[0], ()),
    ):
        capped, share = _capped(candidate)
        if is_closed(capped):
            caps = f"open: holes were capped, {100 * share:.2g} % of the area"
            return Surface(capped, is_closed=True, is_filled=True, notes=(*changes, caps))
    return Surface(oriented, is_closed=False, notes=notes)


def _closed_surface(mesh: TriangleMesh, *notes: str) -> Surface:
    """Return a closed mesh without duplicate triangles; of triangles that exist in both orientations, with one each."""
    fewer, dropped = _without_duplicates(mesh, with_orientation=True)
    if dropped and is_closed(fewer):
        return Surface(fewer, is_closed=True, notes=(*notes, *dropped))
    if abs(signed_volume(mesh)) <= MIN_VOLUME * mesh.size**3:
        fewer, dropped = _without_duplicates(mesh, with_orientation=False)
        if dropped and is_closed(fewer := _consistently_oriented(fewer)[0]):
            return Surface(fewer, is_closed=True, notes=(*notes, *dropped))
    return Surface(mesh, is_closed=True, notes=notes)


def _without_duplicates(
    mesh: TriangleMesh, *, with_orientation: bool
) -> tuple[TriangleMesh, tuple[str, ...]]:
    """Return a mesh with one triangle for each set of vertices, or for each set and orientation, and a note."""
    if with_orientation:
        # A cyclic shift puts the smallest vertex first and keeps the orientation.
        start = np.argmin(mesh.faces, axis=1)
        rows = np.take_along_axis(mesh.faces, (start[:, None] + np.arange(3)) % 3, axis=1)
    else:
        rows = np.sort(mesh.faces, axis=1)
    first_rows, _ = same_vertices(rows.astype(np.float64))
    if len(first_rows) == len(mesh.faces):
        return mesh, ()
    kept = np.sort(first_rows)
    colours = None if mesh.colours is None else mesh.colours[kept]
    count = len(mesh.faces) - len(kept)
    note = f"{count} triangle{'s' * (count > 1)} written more than once {'were' if count > 1 else 'was'} dropped"
    return TriangleMesh(mesh.vertices, mesh.faces[kept], colours), (note,)


def is_closed(mesh: TriangleMesh) -> bool:
    """Return whether every edge, between vertices of equal index, is passed as often in one direction as the other.

    The edges and the reversed edges are compared as multisets, by the sums of 64-bit digests: unequal multisets have
    equal sums with a probability of 1 in 2^64, and nothing is sorted.
    """
    if not len(mesh.faces):
        return False
    # The directed edge from vertex i to j of V has the key i V + j.
    edges = _edges(mesh.faces).astype(np.uint64)
    count = np.uint64(len(mesh.vertices))
    forward = edges[:, 0] * count + edges[:, 1]
    backward = edges[:, 1] * count + edges[:, 0]
    return bool(_digest(forward).sum() == _digest(backward).sum())


def _digest(keys: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return well mixed 64-bit digests (the finalizer of splitmix64: Steele, Lea, Flood 2014)."""
    mixed = (keys ^ (keys >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return mixed ^ (mixed >> np.uint64(31))


def signed_volume(mesh: TriangleMesh) -> float:
    """Return the volume of a closed mesh, negative if it is inside out, in its unit cubed."""
    return float(tetrahedra(*mesh.corners_about(mesh.bounds.mean(axis=0))).sum())


def tetrahedra(a: Array, b: Array, c: Array) -> Array:
    """Return the signed volumes of tetrahedra with corners 0, a, b and c, each of shape (m, 3); shape (m,).

    Volumes are in the unit of the corners cubed: m^3 for m.
    """
    # V = a . (b x c) / 6
    ax, ay, az = a.T
    bx, by, bz = b.T
    cx, cy, cz = c.T
    volumes: Array = (
        ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    ) / 6
    return volumes


def _edges(faces: NDArray[np.intp]) -> NDArray[np.int64]:
    """Return the directed edges of triangles, shape (3 m, 2): all first ones, all second ones, all third ones."""
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)


def _merged_nearby(mesh: TriangleMesh) -> TriangleMesh:
    step = _MERGE_DISTANCE * mesh.size
    if step == 0:
        return mesh
    origin = mesh.bounds[0]
    merged = TriangleMesh(
        np.round((mesh.vertices - origin) / step), mesh.faces, mesh.colours
    ).merged()
    return TriangleMesh(merged.vertices * step + origin, merged.faces, merged.colours)


def _consistently_oriented(mesh: TriangleMesh) -> tuple[TriangleMesh, int]:
    """Return a mesh whose neighbouring triangles are oriented alike, and how many triangles were turned.

    Each triangle is two nodes of a graph, as it is and turned; triangles that share an edge connect the nodes in which
    they pass it in opposite directions. A piece of the surface that can be oriented is then two components, and the one
    with the larger area of unchanged triangles is kept, so that the inner shell of a hollow link stays an inner shell.
    """
    # Sorted by their vertices, edges between the same two vertices are neighbours.
    m = len(mesh.faces)
    edges = _edges(mesh.faces)
    low = edges.min(axis=1)
    high = edges.max(axis=1)
    order = np.lexsort((high, low))
    is_same = (low[order][1:] == low[order][:-1]) & (high[order][1:] == high[order][:-1])
    starts = np.flatnonzero(np.concatenate([[True], ~is_same]))
    pairs = starts[np.diff(np.append(starts, len(order))) == 2]  # edges of exactly two triangles
    first = order[pairs]
    second = order[pairs + 1]
    is_alike = (edges[first, 0] == edges[second, 0]).astype(np.int64)

    # Triangles f and g share an edge; edge e is one of triangle e modulo m. Node f is triangle f as it is, f + m the
    # same turned: if both pass the edge alike, f is joined to g + m and f + m to g; otherwise f to g, f + m to g + m.
    f = first % m
    g = second % m
    labels = component_labels(
        np.concatenate([f, f + m]),
        np.concatenate([g + is_alike * m, g + (1 - is_alike) * m]),
        2 * m,
    )
    kept = labels[:m]
    turned = labels[m:]
    if np.any(kept == turned):  # one-sided, like a Moebius strip
        return mesh, 0

    # Of the two components of a piece the one with the larger area of triangles as they are is kept; areas are doubled.
    area = np.linalg.norm(np.cross(*np.moveaxis(np.diff(mesh.corners, axis=1), 1, 0)), axis=1)
    weight = np.bincount(kept, area, minlength=labels.max() + 1)
    is_turned = weight[turned] > weight[kept]
    faces = np.where(is_turned[:, None], mesh.faces[:, ::-1], mesh.faces)
    return TriangleMesh(mesh.vertices, faces, mesh.colours), int(is_turned.sum())


def _capped(mesh: TriangleMesh) -> tuple[TriangleMesh, float]:
    """Return a mesh with a fan of triangles over each hole, and the fans' share of the area; itself for large holes."""
    # Where edge i -> j, key i V + j, is passed more often than j -> i, key j V + i, the difference is missing.
    edges = _edges(mesh.faces)
    count = len(mesh.vertices)
    keys, times = np.unique(edges[:, 0] * count + edges[:, 1], return_counts=True)
    reversed_keys = (keys % count) * count + keys // count
    places = np.minimum(np.searchsorted(keys, reversed_keys), len(keys) - 1)
    missing = times - np.where(keys[places] == reversed_keys, times[places], 0)
    # Edges that are passed more often than their reversed ones.
    rim = np.repeat(keys, np.maximum(missing, 0))
    start = rim // count
    end = rim % count

    # A hole is a connected piece of the rim. Its fan about the mean of its vertices passes each rim edge backwards.
    labels = component_labels(start, end, count)
    holes, hole = np.unique(labels[start], return_inverse=True)
    sizes = np.bincount(hole, minlength=len(holes))
    middles = np.stack(
        [
            np.bincount(hole, mesh.vertices[start, k], minlength=len(holes)) / sizes
            for k in range(3)
        ],
        axis=1,
    )
    fans = np.stack([end, start, count + hole], axis=1)
    filled = TriangleMesh(
        np.concatenate([mesh.vertices, middles]), np.concatenate([mesh.faces, fans])
    )
    area = np.linalg.norm(area_vectors(filled.corners), axis=1)
    share = float(area[len(mesh.faces) :].sum() / max(area.sum(), np.finfo(float).tiny))
    return (filled, share) if share <= _MAX_CAP_AREA else (mesh, share)


def outwards(mesh: TriangleMesh) -> tuple[TriangleMesh, tuple[str, ...]]:
    """Return a closed mesh with its shells turned outwards, those of cavities inwards, and notes of the changes."""
    is_inverted = signed_volume(mesh) < 0
    if is_inverted:
        mesh = mesh.turned()
    inversion = (_INVERTED,) if is_inverted else ()
    shells = Shells(mesh)
    if shells.count == 1:
        is_doubled = _has_crowded_edges(mesh) and shells.doubled()
        return mesh, (*inversion, *([_DOUBLED] if is_doubled else []))
    if shells.count > BOUNDS.shells:
        return mesh, (
            *inversion,
            f"{shells.count} shells: which of them lie in others was not looked at",
        )
    # The shells around a cavity have a winding number of 1; any other shell of negative volume is inside out.
    shells.turn(shells.inside_out())
    flipped = shells.flipped ^ is_inverted
    notes = []
    if flipped.all():
        notes.append(_INVERTED)
    elif flipped.any():
        notes.append(
            f"{int(flipped.sum())} of {shells.count} shells were inside out and were turned"
        )
    return shells.mesh, (*notes, *_shell_notes(shells))


def _has_crowded_edges(mesh: TriangleMesh) -> bool:
    """Whether an edge belongs to more than two triangles."""
    edges = np.sort(
        np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]),
        axis=1,
    )
    keys = np.sort(edges[:, 0].astype(np.int64) * len(mesh.vertices) + edges[:, 1])
    return bool((keys[2:] == keys[:-2]).any())


def _shell_notes(shells: Shells) -> list[str]:
    notes = []
    if cavities := int((shells.volume < 0).sum()):
        notes.append(f"{cavities} cavit{'y' if cavities == 1 else 'ies'} inside")
    doubled = shells.doubled()
    twice, reaching = shells.shared()
    share = f" ({100 * twice / float(shells.volume.sum()):.2g} % of the volume)" if twice else ""
    if doubled or twice:
        which = f"{doubled} of {shells.count}" if doubled else "some"
        notes.append(
            f"warning: {which} shells lie in or reach into others, where the material counts twice{share}"
        )
    if reaching:
        which = "a cavity reaches" if reaching == 1 else f"{reaching} cavities reach"
        notes.append(
            f"warning: {which} out of the material around, and takes volume away where there is none"
        )
    return notes
