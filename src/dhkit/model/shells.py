"""Shells of a closed surface: which are cavities, which are inside out, and which reach into others.

A few points of each shell are held against the shells whose boxes hold them, by rays; what those points miss,
such as bars that cross, is found by manifold3d from the volumes that two shells share.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.model.triangle_mesh import TriangleMesh

if TYPE_CHECKING:
    from manifold3d import Manifold

BEHIND = 1e-6
"""How far behind a triangle a point is looked at, as a share of the mesh's size."""
POINTS = 16
"""Middles of triangles of a shell that are looked at."""
INSIDE = 0.5
"""Winding number of a point, above which it is inside: 1 inside a shell, 0 outside."""
CAVITY = 0.3
"""Share of the points of a cavity that lie in material; one may reach out of it, which is warned of."""
TOUCHING = 1e-6
"""Depth to which shells may reach into each other as files round their corners, as a share of the mesh's size."""
SHARED = 1e-3
"""Volume that shells may share, of the smaller one's: round parts that fit do so by the flats of their facets."""
MOST_WORK = 3_000_000
"""Triangles that manifold3d is given in all; beyond it the points alone decide."""
ASKEW = np.linalg.qr(np.array([[0.61, 0.23, 0.37], [0.17, 0.71, 0.53], [0.43, 0.31, 0.67]]))[0]
ASKEW *= np.linalg.det(ASKEW)
"""A rotation that maps no direction of a machine to z."""


class Shells:
    """The connected pieces of a closed mesh, each closed by itself."""

    def __init__(self, mesh: TriangleMesh) -> None:
        self.mesh = self._first = mesh
        self._size = mesh.size
        self.numbers = _numbers(mesh)
        """The shell of each triangle, shape (m,)."""
        self.count = int(self.numbers.max()) + 1
        self.flipped = np.zeros(self.count, dtype=bool)
        """Which shells :meth:`turn` has turned."""

    @cached_property
    def _order(self) -> NDArray[np.intp]:
        return np.argsort(self.numbers, kind="stable")

    @cached_property
    def _ends(self) -> NDArray[np.intp]:
        return np.searchsorted(self.numbers[self._order], np.arange(self.count + 1))

    @cached_property
    def _bounds(self) -> tuple[Array, Array]:
        corners = self.mesh.corners[self._order]
        low = np.minimum.reduceat(corners.min(axis=1), self._ends[:-1])
        return low, np.maximum.reduceat(corners.max(axis=1), self._ends[:-1])

    @cached_property
    def _rays(self) -> _Rays:
        return _Rays(self._first.corners[self._order])

    @cached_property
    def volume(self) -> Array:
        """The signed volume of each shell as it is in the mesh, shape (count,)."""
        return np.array([float(_cones(self.mesh.vertices[self._faces(k)]).sum()) for k in range(self.count)])

    def turn(self, chosen: NDArray[np.bool_]) -> None:
        """Turn the chosen shells, shape (count,)."""
        if not chosen.any():
            return
        faces = np.where(chosen[self.numbers][:, None], self.mesh.faces[:, ::-1], self.mesh.faces)
        self.mesh = TriangleMesh(self.mesh.vertices, faces, self.mesh.colours)
        self.volume = np.where(chosen, -self.volume, self.volume)
        self.flipped = self.flipped ^ chosen

    def inside_out(self) -> NDArray[np.bool_]:
        """Return the shells that go the other way round and are no cavities, shape (count,).

        Points of a cavity, just inside it, lie in the material that the other shells enclose; cavities that touch do
        not count for each other.
        """
        inverted = np.flatnonzero(self.volume < 0)
        wrong = [k for k in inverted if np.mean(self._windings(int(k)) > INSIDE) < CAVITY]
        return np.isin(np.arange(self.count), wrong)

    def doubled(self) -> int:
        """Return how many shells have a point in the material of others."""
        return sum(bool((self._windings(int(k)) > INSIDE).any()) for k in np.flatnonzero(self.volume > 0))

    def shared(self) -> tuple[float, int]:
        """Return the volume that counts more than once, and the number of cavities that reach out of the material."""
        low, high = self._bounds
        near = np.asarray(((low[:, None] < high[None]) & (low[None] < high[:, None])).all(axis=2))
        sizes = np.diff(self._ends)
        if int((near @ sizes).sum() - sizes.sum()) > MOST_WORK:
            return 0.0, 0
        twice, reaching, solids = 0.0, 0, dict[int, "Manifold | None"]()
        order = np.argsort(-np.abs(self.volume), kind="stable")
        for place, k in enumerate(order):
            around = [int(j) for j in order[:place] if near[k, j]]
            if not around:
                continue
            for j in (k, *around):
                if j not in solids:
                    solids[j] = self._solid(j)
            common = _common(solids[k], [(solids[j], self.volume[j] > 0) for j in around])
            if common is None:
                continue
            volume, allowed = abs(float(self.volume[k])), self._allowed(k)
            if self.volume[k] > 0 and common > allowed:
                twice += common
            reaching += bool(self.volume[k] < 0 and volume - common > allowed)
        return twice, reaching

    def _faces(self, k: int) -> NDArray[np.intp]:
        return self.mesh.faces[self._order[self._ends[k] : self._ends[k + 1]]]

    def _allowed(self, k: int) -> float:
        corners = self.mesh.vertices[self._faces(k)]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
        return max(TOUCHING * self._size * float(area), SHARED * abs(float(self.volume[k])))

    def _solid(self, k: int) -> Manifold | None:
        """Return a shell as a solid, a cavity as what it takes away; None where edges have more than two triangles."""
        from manifold3d import Error, Manifold, Mesh64

        used, faces = np.unique(self._faces(k), return_inverse=True)
        faces = faces.reshape(-1, 3)[:, :: 1 if self.volume[k] > 0 else -1]
        points = np.ascontiguousarray(self.mesh.vertices[used])
        solid = Manifold(Mesh64(points, np.ascontiguousarray(faces, dtype=np.uint64)))
        return solid if solid.status() == Error.NoError else None

    def _windings(self, k: int) -> Array:
        """Return how often the other shells go round a few points just inside a shell."""
        points = self._points(k)
        low, high = self._bounds
        holds: NDArray[np.bool_] = np.all((low[None] <= points[:, None]) & (points[:, None] <= high[None]), axis=2)
        holds[:, k] = False
        found = np.zeros(len(points))
        for j in np.flatnonzero(holds.any(axis=0)):
            chosen = slice(self._ends[j], self._ends[j + 1])
            sign = -1.0 if self.flipped[j] else 1.0
            found[holds[:, j]] += sign * self._rays.windings(chosen, points[holds[:, j]])
        return found

    def _points(self, k: int) -> Array:
        """Return points just inside triangles' middles: on a face that two shells share nothing is decided."""
        faces = self._faces(k)
        corners = self.mesh.vertices[faces[:: max(1, len(faces) // POINTS)][:POINTS]]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        unit = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
        points: Array = corners.mean(axis=1) - np.sign(self.volume[k]) * BEHIND * self._size * unit
        return points


def _common(solid: Manifold | None, around: list[tuple[Manifold | None, bool]]) -> float | None:
    """Return the volume of a solid inside the material of larger shells, those of cavities taken away."""
    from manifold3d import Manifold

    material = Manifold()
    for other, adds in around:
        if other is None or solid is None:
            return None
        material = material + other if adds else material - other
    return 0.0 if solid is None else float((material ^ solid).volume())


def _cones(corners: Array) -> Array:
    """Return the signed volumes between triangles and the middle of their box, shape (m,)."""
    middle = (corners.min(axis=(0, 1)) + corners.max(axis=(0, 1))) / 2
    a, b, c = np.moveaxis(corners - middle, 1, 0)
    cones: Array = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    return cones


def _numbers(mesh: TriangleMesh) -> NDArray[np.intp]:
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


class _Rays:
    """Rays in one direction, against triangles: how often they pass out of closed surfaces less how often in.

    Parameters
    ----------
    corners
        Shape (m, 3, 3).
    """

    def __init__(self, corners: Array) -> None:
        # Askew to all faces that machines have: no ray runs along a face or through an edge.
        self.corners = corners @ ASKEW
        self.low, self.high = self.corners[:, :, :2].min(axis=1).T.copy(), self.corners[:, :, :2].max(axis=1).T.copy()

    def windings(self, chosen: slice, points: Array) -> Array:
        """Return how often the surface of some triangles goes round each point, shape (p,)."""
        (x0, y0), (x1, y1) = self.low[:, chosen], self.high[:, chosen]
        corners = self.corners[chosen]
        found = np.zeros(len(points))
        for i, point in enumerate(points @ ASKEW):
            x, y, _ = point
            hit = np.flatnonzero((x0 <= x) & (x <= x1) & (y0 <= y) & (y <= y1))
            found[i] = _passed(corners[hit] - point)
        return found


def _passed(corners: Array) -> float:
    """Return how often the ray from 0 along z passes out of triangles, less how often in."""
    a, b, c = np.moveaxis(corners, 1, 0)
    u, v, w = (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0] for p, q in ((b, c), (c, a), (a, b)))
    area = u + v + w
    passed = ((u > 0) & (v > 0) & (w > 0)) | ((u < 0) & (v < 0) & (w < 0))
    ahead = passed & ((u * a[:, 2] + v * b[:, 2] + w * c[:, 2]) * area > 0)
    return float(np.sign(area[ahead]).sum())
