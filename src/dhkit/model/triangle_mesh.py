"""Triangles between numbered vertices, as an immutable value: scaled, moved, joined, its equal vertices made one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import Array
from dhkit.display import repr_line

MIXERS = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)
"""Odd factors that spread three coordinates over 64 bits."""


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles whose vertices go round counterclockwise, seen from outside.

    Raises
    ------
    ValueError
        Arrays of another shape.
    """

    vertices: Array
    """Shape (k, 3), m unless said otherwise."""
    faces: NDArray[np.intp]
    """Vertices of each triangle, from 0, shape (m, 3)."""
    colours: NDArray[np.uint8] | None = None
    """Red, green and blue of each triangle, 0 to 255, shape (m, 3); None where the file has none."""

    def __post_init__(self) -> None:
        for name, array in (("vertices", self.vertices), ("faces", self.faces)):
            if array.ndim != 2 or array.shape[1] != 3:
                raise ValueError(f"{name} has shape {array.shape}; expected (..., 3)")
        if self.colours is not None and self.colours.shape != self.faces.shape:
            raise ValueError(f"colours has shape {self.colours.shape}; expected {self.faces.shape}")

    @classmethod
    def of_corners(cls, corners: Array) -> TriangleMesh:
        """Return a mesh of separate triangles, corners of shape (m, 3, 3)."""
        return cls(corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.intp).reshape(-1, 3))

    @property
    def corners(self) -> Array:
        """The three vertices of each triangle, shape (m, 3, 3)."""
        corners: Array = self.vertices[self.faces]
        return corners

    def corners_about(self, origin: Array) -> tuple[Array, Array, Array]:
        """Return the first, second and third vertices of all triangles about an origin, each of shape (m, 3)."""
        moved = self.vertices - origin
        first, second, third = self.faces.T
        return moved[first], moved[second], moved[third]

    @property
    def bounds(self) -> Array:
        """Lowest and highest coordinates, shape (2, 3)."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @property
    def size(self) -> float:
        """The diagonal of the box around all vertices."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    @property
    def colour(self) -> str | None:
        """The mean colour of its triangles as ``#rrggbb``; None where it has none."""
        if self.colours is None or not len(self.colours):
            return None
        return "#" + "".join(f"{round(float(x)):02x}" for x in self.colours.mean(axis=0))

    def scaled(self, scale: ArrayLike) -> TriangleMesh:
        """Return the mesh with its coordinates times one factor or three; a mirrored mesh keeps its outside."""
        factors = np.broadcast_to(np.asarray(scale, dtype=float), (3,))
        mirrored = bool(np.prod(np.sign(factors)) < 0)
        faces = self.faces[:, ::-1] if mirrored else self.faces
        return replace(self, vertices=self.vertices * factors, faces=faces)

    def moved(self, T: ArrayLike) -> TriangleMesh:
        """Return the mesh in the frame that T, shape (4, 4), a rigid transform, maps its own to."""
        matrix = np.asarray(T, dtype=float)
        return replace(self, vertices=self.vertices @ matrix[:3, :3].T + matrix[:3, 3])

    def turned(self) -> TriangleMesh:
        """Return the mesh with every triangle the other way round."""
        return replace(self, faces=self.faces[:, ::-1])

    def merged(self) -> TriangleMesh:
        """Return the mesh with equal vertices made one, and without triangles that have lost a corner by it."""
        chosen, numbers = same_vertices(self.vertices)
        faces = numbers[self.faces]
        kept = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
        colours = None if self.colours is None else self.colours[kept]
        return TriangleMesh(self.vertices[chosen], faces[kept], colours)

    def __repr__(self) -> str:
        size = f", {self.size:.4g} m across" if len(self.vertices) else ""
        return repr_line("TriangleMesh", said=f"{len(self.faces)} triangles, {len(self.vertices)} vertices{size}")


def joined_meshes(meshes: Sequence[TriangleMesh]) -> TriangleMesh:
    """Return several meshes of one frame as one; colours are kept only where all of them have some."""
    if len(meshes) == 1:
        return meshes[0]
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    found = [mesh.colours for mesh in meshes]
    coloured = [colours for colours in found if colours is not None]
    return TriangleMesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]),
        np.concatenate(coloured) if len(coloured) == len(found) else None,
    )


def same_vertices(vertices: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return one row of each kind of equal rows, and which kind each row is.

    Rows are sorted by a 64-bit digest, ten times faster than by coordinates where there are millions; should two
    digests coincide, which is checked, the coordinates are sorted themselves.

    Parameters
    ----------
    vertices
        Shape (k, 3).

    Returns
    -------
    tuple
        Indices of rows, shape (c,), and kinds, shape (k,), from 0 to c - 1.
    """
    rows = np.ascontiguousarray(vertices + 0.0, dtype=np.float64)  # adding zero turns -0.0 into 0.0
    words = rows.view(np.uint64)
    digest = words[:, 0] * MIXERS[0]
    for k in (1, 2):
        digest = (digest ^ (digest >> np.uint64(29))) * MIXERS[k] + words[:, k] * MIXERS[(k + 1) % 3]
    # What np.unique does, with a sort that need not be stable: a third of the time.
    order = np.argsort(digest)
    ordered = digest[order]
    is_first = np.concatenate([[True], ordered[1:] != ordered[:-1]]) if len(rows) else np.zeros(0, dtype=bool)
    chosen = order[is_first]
    kinds = np.empty(len(rows), dtype=np.intp)
    kinds[order] = np.cumsum(is_first) - 1
    if not np.array_equal(rows[chosen][kinds], rows):
        _, chosen, kinds = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return chosen, kinds.reshape(-1)
