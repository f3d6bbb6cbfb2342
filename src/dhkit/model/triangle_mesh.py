"""Triangles between numbered vertices, as an immutable value: scaled, moved, joined, with equal vertices merged."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import Array
from dhkit.display import repr_line

_HASH_FACTORS = np.array(
    [0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64
)
"""Odd factors that spread three coordinates over 64 bits."""


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles whose vertices are in counterclockwise order, seen from outside.

    Raises
    ------
    ValueError
        Arrays of another shape.
    """

    vertices: Array
    """Shape (k, 3), m unless stated otherwise."""
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
        """Return a mesh of separate triangles, corners of shape (m, 3, 3), m unless stated otherwise."""
        return cls(
            corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.intp).reshape(-1, 3)
        )

    @property
    def corners(self) -> Array:
        """The three vertices of each triangle, shape (m, 3, 3), in the unit of the vertices."""
        return self.vertices[self.faces]

    def corners_about(self, origin: Array) -> tuple[Array, Array, Array]:
        """Return the first, second and third vertices of all triangles relative to an origin, shape (3,).

        Each is of shape (m, 3), in the unit of the vertices.
        """
        shifted = self.vertices - origin
        first, second, third = self.faces.T
        return shifted[first], shifted[second], shifted[third]

    @property
    def bounds(self) -> Array:
        """Lowest and highest coordinates, shape (2, 3), in the unit of the vertices."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @property
    def size(self) -> float:
        """The diagonal of the box around all vertices, in their unit."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    @property
    def colour(self) -> str | None:
        """The mean colour of its triangles as ``#rrggbb``; None where it has none."""
        if self.colours is None or not len(self.colours):
            return None
        return "#" + "".join(f"{round(float(x)):02x}" for x in self.colours.mean(axis=0))

    def scaled(self, scale: ArrayLike) -> TriangleMesh:
        """Return the mesh with its coordinates times one factor or three, shape () or (3,).

        The outside stays outside when factors mirror the mesh. Factors may convert a file's unit to m.

        Parameters
        ----------
        scale
            Factor of all lengths.
        """
        factors = np.broadcast_to(np.asarray(scale, dtype=float), (3,))
        is_mirrored = bool(np.prod(np.sign(factors)) < 0)
        faces = self.faces[:, ::-1] if is_mirrored else self.faces
        return replace(self, vertices=self.vertices * factors, faces=faces)

    def moved(self, T: ArrayLike) -> TriangleMesh:
        """Return the mesh in the frame that a rigid transform T, shape (4, 4), m, maps its own frame to.

        Parameters
        ----------
        T
            Pose of the present frame in the new one, shape (4, 4), m.
        """
        matrix = np.asarray(T, dtype=float)
        return replace(self, vertices=self.vertices @ matrix[:3, :3].T + matrix[:3, 3])

    def turned(self) -> TriangleMesh:
        """Return the mesh with its vertices in opposite order, inside out."""
        return replace(self, faces=self.faces[:, ::-1])

    def merged(self) -> TriangleMesh:
        """Return the mesh with equal vertices merged, and without the triangles that lose a corner by it."""
        first_rows, numbers = same_vertices(self.vertices)
        faces = numbers[self.faces]
        is_kept = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
        colours = None if self.colours is None else self.colours[is_kept]
        return TriangleMesh(self.vertices[first_rows], faces[is_kept], colours)

    def __repr__(self) -> str:
        size = f", {self.size:.4g} m across" if len(self.vertices) else ""
        return repr_line(
            "TriangleMesh", "", f"{len(self.faces)} triangles, {len(self.vertices)} vertices{size}"
        )


def joined_meshes(meshes: Sequence[TriangleMesh]) -> TriangleMesh:
    """Return several meshes of one frame as one mesh; colours are kept only if all of them have some."""
    if len(meshes) == 1:
        return meshes[0]
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    colours = [mesh.colours for mesh in meshes if mesh.colours is not None]
    return TriangleMesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]),
        np.concatenate(colours) if len(colours) == len(meshes) else None,
    )


def common_bounds(meshes: Iterable[TriangleMesh]) -> tuple[Array, Array]:
    """Return the lowest and highest coordinates of several meshes, shape (3,) each, in the unit of their vertices."""
    low, high = np.array([mesh.bounds for mesh in meshes]).swapaxes(0, 1)
    return low.min(axis=0), high.max(axis=0)


def area_vectors(corners: Array) -> Array:
    """Return (b - a) x (c - a) of triangles with corners a, b, c, shape (m, 3, 3): normals of twice the area.

    Shape (m, 3), in the squared unit of the corners, such as m^2.
    """
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def unit_normals(corners: Array) -> Array:
    """Return the unit normals, shape (m, 3), of triangles, corners of shape (m, 3, 3), any unit; 0 of flat ones."""
    vectors = area_vectors(corners)
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    normals: Array = np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0)
    return normals


def component_labels(
    first: NDArray[np.integer], second: NDArray[np.integer], count: int
) -> NDArray[np.intp]:
    """Return the connected component of each of ``count`` nodes; edges join nodes with these indices, shape (e,)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(first), dtype=np.int8), (first, second)), shape=(count, count))
    _, labels = connected_components(graph, directed=False)
    return np.asarray(labels, dtype=np.intp)


def same_vertices(vertices: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the index of one row of each set of equal rows, and the number of the set that each row belongs to.

    Rows are sorted by a 64-bit digest, ten times faster than by coordinates for millions of rows. Whether two digests
    coincide is checked; the coordinates themselves are sorted then.

    Parameters
    ----------
    vertices
        Shape (k, 3), any unit.

    Returns
    -------
    tuple
        Indices of rows, shape (c,), and numbers of sets, shape (k,), from 0 to c - 1.
    """
    rows = np.ascontiguousarray(vertices + 0.0, dtype=np.float64)  # adding zero turns -0.0 into 0.0
    bits = rows.view(np.uint64)
    digest = bits[:, 0] * _HASH_FACTORS[0]
    for k in (1, 2):
        digest = (digest ^ (digest >> np.uint64(29))) * _HASH_FACTORS[k] + bits[
            :, k
        ] * _HASH_FACTORS[(k + 1) % 3]
    # As np.unique works, but with a sort that need not be stable: a third of the time.
    order = np.argsort(digest)
    ordered = digest[order]
    is_first = (
        np.concatenate([[True], ordered[1:] != ordered[:-1]])
        if len(rows)
        else np.zeros(0, dtype=bool)
    )
    first_rows = order[is_first]
    sets = np.empty(len(rows), dtype=np.intp)
    sets[order] = np.cumsum(is_first) - 1
    if not np.array_equal(rows[first_rows][sets], rows):
        _, first_rows, sets = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return first_rows, sets.reshape(-1)
