"""Shells (connected pieces) of a closed surface: cavities, inverted shells, and shells that reach into others.

By rays, a few points of each shell are tested for lying in the shells whose boxes hold them. What those points miss,
such as crossing bars, is found by manifold3d from the volumes that shells share.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.model.bounds import BOUNDS
from dhkit.model.triangle_mesh import TriangleMesh, area_vectors, component_labels, unit_normals
from dhkit.packages import imported

if TYPE_CHECKING:
    from manifold3d import Manifold

_TEST_POINT_DEPTH = 1e-6
"""Distance of a test point from its triangle, against the normal, as a share of the mesh's size."""
_TEST_POINTS = 16
"""Number of a shell's triangles whose middles, moved against the normal, are tested."""
_MIN_INSIDE_WINDING = 0.5
"""Winding number above which a point is inside: it is 1 inside a shell and 0 outside."""
_MIN_CAVITY_SHARE = 0.3
"""Smallest share of a cavity's test points that lie in material: a cavity may reach out of it, with a warning."""
_TOUCHING_DEPTH = 1e-6
"""Depth to which touching shells may overlap, as a share of the mesh's size: files round their vertices."""
_MAX_SHARED_VOLUME = 1e-3
"""Volume that two shells may share, relative to the smaller one: round parts that fit overlap by their facets."""
_OBLIQUE_ROTATION = np.linalg.qr(
    np.array([[0.61, 0.23, 0.37], [0.17, 0.71, 0.53], [0.43, 0.31, 0.67]])
)[0]
_OBLIQUE_ROTATION *= np.linalg.det(_OBLIQUE_ROTATION)
"""A rotation that maps no usual direction of a machine part to z."""


class Shells:
    """The connected pieces of a closed mesh, each closed by itself."""

    def __init__(self, mesh: TriangleMesh) -> None:
        self.mesh = self._original = mesh
        self._size = mesh.size
        self.numbers = _shell_numbers(mesh)
        """The shell of each triangle, shape (m,)."""
        self.count = int(self.numbers.max()) + 1
        self.flipped = np.zeros(self.count, dtype=bool)
        """Whether :meth:`turn` has turned each shell, shape (count,)."""

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
        return _Rays(self._original.corners[self._order])

    @cached_property
    def volume(self) -> Array:
        """The signed volume of each shell as it is in the mesh, shape (count,), m^3 for a mesh in m."""
        return np.array(
            [_signed_volume(self.mesh.vertices[self._faces(k)]) for k in range(self.count)]
        )

    def turn(self, chosen: NDArray[np.bool_]) -> None:
        """Turn the shells whose index, shape (count,), is True inside out."""
        if not chosen.any():
            return
        faces = np.where(chosen[self.numbers][:, None], self.mesh.faces[:, ::-1], self.mesh.faces)
        self.mesh = TriangleMesh(self.mesh.vertices, faces, self.mesh.colours)
        self.volume = np.where(chosen, -self.volume, self.volume)
        self.flipped = self.flipped ^ chosen

    def inside_out(self) -> NDArray[np.bool_]:
        """Return whether each shell has negative volume although it is not a cavity, shape (count,).

        Points just inside a cavity lie in the material that other shells enclose; touching cavities do not count for
        each other.
        """
        inverted = np.flatnonzero(self.volume < 0)
        wrong = [
            k
            for k in inverted
            if np.mean(self._windings(int(k)) > _MIN_INSIDE_WINDING) < _MIN_CAVITY_SHARE
        ]
        return np.isin(np.arange(self.count), wrong)

    def doubled(self) -> int:
        """Return the number of shells with a test point in the material of others, or twice in their own.

        The same surface in two tessellations is one shell, since both have the same vertices, and encloses twice.
        """
        solid = [int(k) for k in np.flatnonzero(self.volume > 0)]
        others = [bool((self._windings(k) > _MIN_INSIDE_WINDING).any()) for k in solid]
        own = [bool((self._own_windings(k) > 1 + _MIN_INSIDE_WINDING).any()) for k in solid]
        return sum(in_others or in_own for in_others, in_own in zip(others, own, strict=True))

    def shared(self) -> tuple[float, int]:
        """Return the volume that counts more than once, and the number of cavities that reach out of the material."""
        # Boxes meet if low_j < high_k and low_k < high_j in all three coordinates.
        low, high = self._bounds
        near = np.asarray(((low[:, None] < high[None]) & (low[None] < high[:, None])).all(axis=2))
        sizes = np.diff(self._ends)
        if int((near @ sizes).sum() - sizes.sum()) > BOUNDS.boolean_triangles:
            return 0.0, 0
        twice = 0.0
        reaching = 0

        # The largest first: each shell is intersected with the larger ones that it may lie in, so each pair once.
        solids = dict[int, "Manifold | None"]()
        order = np.argsort(-np.abs(self.volume), kind="stable")
        for place, k in enumerate(order):
            around = [int(j) for j in order[:place] if near[k, j]]
            if not around:
                continue
            for j in (k, *around):
                if j not in solids:
                    solids[j] = self._solid(j)
            common = _common_volume(solids[k], [(solids[j], self.volume[j] > 0) for j in around])
            if common is None:
                continue
            volume = abs(float(self.volume[k]))
            allowed = self._allowed_overlap(k)
            if self.volume[k] > 0 and common > allowed:
                twice += common
            reaching += bool(self.volume[k] < 0 and volume - common > allowed)
        return twice, reaching

    def _faces(self, k: int) -> NDArray[np.intp]:
        return self.mesh.faces[self._order[self._ends[k] : self._ends[k + 1]]]

    def _allowed_overlap(self, k: int) -> float:
        area = np.linalg.norm(area_vectors(self.mesh.vertices[self._faces(k)]), axis=1).sum() / 2
        return max(
            _TOUCHING_DEPTH * self._size * float(area),
            _MAX_SHARED_VOLUME * abs(float(self.volume[k])),
        )

    def _solid(self, k: int) -> Manifold | None:
        """Return a shell, or a cavity's inside, as a solid; None if an edge belongs to more than two triangles."""
        manifold3d = imported("manifold3d", "the mass of nested surfaces")
        used, faces = np.unique(self._faces(k), return_inverse=True)
        faces = faces.reshape(-1, 3)[:, :: 1 if self.volume[k] > 0 else -1]
        points = np.ascontiguousarray(self.mesh.vertices[used])
        mesh = manifold3d.Mesh64(points, np.ascontiguousarray(faces, dtype=np.uint64))
        solid: Manifold = manifold3d.Manifold(mesh)
        return solid if solid.status() == manifold3d.Error.NoError else None

    def _windings(self, k: int) -> Array:
        """Return the winding numbers of the other shells at a shell's test points, shape (p,)."""
        points = self._test_points(k)
        low, high = self._bounds
        in_box: NDArray[np.bool_] = np.all(
            (low[None] <= points[:, None]) & (points[:, None] <= high[None]), axis=2
        )
        in_box[:, k] = False
        windings = np.zeros(len(points))
        for j in np.flatnonzero(in_box.any(axis=0)):
            shell = slice(self._ends[j], self._ends[j + 1])
            sign = -1.0 if self.flipped[j] else 1.0
            windings[in_box[:, j]] += sign * self._rays.windings(shell, points[in_box[:, j]])
        return windings

    def _own_windings(self, k: int) -> Array:
        """Return the winding numbers of a shell at its own test points, shape (p,): 1 if it encloses once."""
        sign = -1.0 if self.flipped[k] else 1.0
        return sign * self._rays.windings(
            slice(self._ends[k], self._ends[k + 1]), self._test_points(k)
        )

    def _test_points(self, k: int) -> Array:
        """Return points just inside triangles' middles; points on a face that two shells share would be undecided."""
        faces = self._faces(k)
        corners = self.mesh.vertices[faces[:: max(1, len(faces) // _TEST_POINTS)][:_TEST_POINTS]]
        inwards = -np.sign(self.volume[k]) * _TEST_POINT_DEPTH * self._size
        points: Array = corners.mean(axis=1) + inwards * unit_normals(corners)
        return points


def _common_volume(
    solid: Manifold | None, around: list[tuple[Manifold | None, bool]]
) -> float | None:
    """Return the volume of a solid inside the material of larger shells, from which cavities are subtracted."""
    material = imported("manifold3d", "the mass of nested surfaces").Manifold()
    for other, is_material in around:
        if other is None or solid is None:
            return None
        material = material + other if is_material else material - other
    return 0.0 if solid is None else float((material ^ solid).volume())


def _signed_volume(corners: Array) -> float:
    """Return the volume enclosed by triangles, negative if they are inside out, about the middle of their box."""
    # V = sum a . (b x c) / 6 over the triangles; about the middle of the box few digits are lost.
    middle = (corners.min(axis=(0, 1)) + corners.max(axis=(0, 1))) / 2
    a, b, c = np.moveaxis(corners - middle, 1, 0)
    return float((np.einsum("ij,ij->i", a, np.cross(b, c)) / 6).sum())


def _shell_numbers(mesh: TriangleMesh) -> NDArray[np.intp]:
    """Return the number of the shell that each triangle belongs to, shape (m,)."""
    # Two edges connect the three vertices of a triangle.
    first, middle, last = mesh.faces.astype(np.int32).T
    labels = component_labels(
        np.concatenate([first, middle]), np.concatenate([middle, last]), len(mesh.vertices)
    )[mesh.faces[:, 0]]
    if not labels.any():
        return np.zeros(len(mesh.faces), dtype=np.intp)
    _, numbers = np.unique(labels, return_inverse=True)
    return numbers.reshape(-1)


class _Rays:
    """Rays in one direction, intersected with triangles to get winding numbers.

    Parameters
    ----------
    corners
        Shape (m, 3, 3).
    """

    def __init__(self, corners: Array) -> None:
        # Rotated, so that no ray runs along a usual face of a machine part or through its edges.
        self.corners = corners @ _OBLIQUE_ROTATION
        self.low = self.corners[:, :, :2].min(axis=1).T.copy()
        self.high = self.corners[:, :, :2].max(axis=1).T.copy()

    def windings(self, chosen: slice, points: Array) -> Array:
        """Return the winding number of some triangles' surface at each point, shape (p,)."""
        x0, y0 = self.low[:, chosen]
        x1, y1 = self.high[:, chosen]
        corners = self.corners[chosen]
        windings = np.zeros(len(points))
        for i, point in enumerate(points @ _OBLIQUE_ROTATION):
            x, y, _ = point
            hit = np.flatnonzero((x0 <= x) & (x <= x1) & (y0 <= y) & (y <= y1))
            windings[i] = _exits_minus_entries(corners[hit] - point)
        return windings


def _exits_minus_entries(corners: Array) -> float:
    """Return how often the ray from 0 along z passes out of triangles, minus how often in."""
    # Seen along z: u, v, w are twice the signed areas of (0, b, c), (0, c, a) and (0, a, b), the barycentric
    # coordinates of the ray times the area of (a, b, c). The ray hits the triangle if all have one sign, at the height
    #     (u a_z + v b_z + w c_z) / area;
    # it passes out where the triangle faces along z (area > 0), and in where it faces against it.
    a, b, c = np.moveaxis(corners, 1, 0)
    u = b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0]
    v = c[:, 0] * a[:, 1] - c[:, 1] * a[:, 0]
    w = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    area = u + v + w
    is_hit = ((u > 0) & (v > 0) & (w > 0)) | ((u < 0) & (v < 0) & (w < 0))
    is_ahead = is_hit & ((u * a[:, 2] + v * b[:, 2] + w * c[:, 2]) * area > 0)
    return float(np.sign(area[is_ahead]).sum())
