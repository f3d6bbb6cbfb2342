"""The one reader of mesh files: through the gate, and then as triangles that are checked.

STL, OBJ and COLLADA are read by dhkit itself, PLY by trimesh. trimesh ignores COLLADA's unit and up axis, drops
vertices that are not numbers, and takes truncated STL files for empty scenes.
"""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from dhkit.description import Mesh
from dhkit.description.mesh_files import MAX_MESH_BYTES, MeshHeader, check_mesh_file
from dhkit.errors import DescriptionError, ModelError
from dhkit.model.collada import collada_mesh
from dhkit.model.obj import obj_mesh
from dhkit.model.shapes import Part
from dhkit.model.stl import ascii_corners, binary_corners
from dhkit.model.triangle_mesh import TriangleMesh

MAX_TRIANGLES = 2_000_000
"""Of a file that is drawn or measured, more than 50 MB of binary STL hold."""
LARGEST_COORDINATE = 1e12
"""In a file's units: squares and cubes of coordinates stay far from the range of a double."""


def mesh_header(path: Path, most: int = MAX_MESH_BYTES) -> MeshHeader:
    """Return what a mesh file says of itself; see :func:`dhkit.description.mesh_files.check_mesh_file`.

    Raises
    ------
    ModelError
        It can be no mesh: one line that begins with the path.
    """
    try:
        return check_mesh_file(path, most)
    except DescriptionError as error:
        raise ModelError(f"{error}{_mark(path)}") from None


def _mark(path: Path) -> str:
    """Return a hint where a refused STL begins with a byte order mark."""
    if path.suffix.lower() != ".stl" or not path.is_file():
        return ""
    with path.open("rb") as file:
        marked = file.read(3)
    if not marked.startswith((b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff")):
        return ""
    return "; it begins with a byte order mark: save the text as ASCII, or as UTF-8 without BOM"


def read_mesh(path: str | Path, *, max_triangles: int = MAX_TRIANGLES, max_bytes: int = MAX_MESH_BYTES) -> TriangleMesh:
    """Return the triangles of an STL, OBJ, PLY or COLLADA file.

    Coordinates are in the file's units; those of COLLADA, which states its unit and its up axis, in metres with z up.
    Files that a mesh names (textures, materials) are not opened.

    Parameters
    ----------
    path
        The file.
    max_triangles, max_bytes
        What it may have at most; a binary file with more triangles is refused from its header.

    Raises
    ------
    ModelError
        It is no mesh, too large, has no triangles, coordinates that are not finite, or indices of no vertex: one line
        that begins with the path.
    """
    path = Path(path)
    header = mesh_header(path, max_bytes)
    if header.triangles is not None:
        _check_count(path, header.triangles, max_triangles)
    try:
        mesh = _read(path.read_bytes(), header)
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from None
    except OSError as error:
        raise ModelError(f"{path}: {error.strerror or error}") from None
    if not len(mesh.faces):
        raise ModelError(f"{path}: no triangles")
    _check_count(path, len(mesh.faces), max_triangles)
    if mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices):
        raise ModelError(f"{path}: a face with vertex {mesh.faces.max()} of {len(mesh.vertices)}, counted from 0")
    if wrong := odd_coordinates(mesh):
        raise ModelError(f"{path}: {wrong}")
    return mesh


def odd_coordinates(mesh: TriangleMesh) -> str:
    """Return which vertex of a mesh has coordinates that are not finite or beyond all sizes; empty where none has."""
    with np.errstate(invalid="ignore"):
        odd = ~(np.abs(mesh.vertices) <= LARGEST_COORDINATE).all(axis=1)
    if not odd.any():
        return ""
    number = int(np.argmax(odd))
    what = "not finite" if not np.isfinite(mesh.vertices[number]).all() else f"beyond {LARGEST_COORDINATE:g}"
    return f"vertex {number} (from 0) has coordinates that are {what}"


def read_part(part: Part) -> TriangleMesh:
    """Return the triangles of a part that is a mesh, in the part's own axes, m: its scale is applied.

    Raises
    ------
    ModelError
        It has no folder, or its file is no mesh: one line that names link and file.
    """
    geometry = part.geometry
    if not isinstance(geometry, Mesh):
        raise ModelError(f"link {part.link}: a {type(geometry).__name__}; expected a mesh")
    if part.file is None:
        raise ModelError(f"link {part.link}: mesh {geometry.path!r} has no folder; expected a robot read from a file")
    try:
        mesh = read_mesh(part.file)
    except ModelError as error:
        raise ModelError(f"link {part.link}: mesh {error}") from None
    return mesh.scaled([float(factor) for factor in geometry.scale])


def _check_count(path: Path, count: int, most: int) -> None:
    if count > most:
        raise ModelError(f"{path}: {count} triangles; expected at most {most}")


def _read(content: bytes, header: MeshHeader) -> TriangleMesh:
    if header.format == "stl":
        return TriangleMesh.of_corners(binary_corners(content))
    if header.format == "stl_ascii":
        return TriangleMesh.of_corners(ascii_corners(content))
    if header.format == "obj":
        return obj_mesh(content)
    if header.format == "dae":
        return collada_mesh(content)
    return _ply(content, header)


def _ply(content: bytes, header: MeshHeader) -> TriangleMesh:
    import trimesh

    try:
        # From memory and without a resolver: a texture that the file names is not looked for.
        mesh = trimesh.load_scene(io.BytesIO(content), file_type="ply", process=False).to_mesh()
        vertices = np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3)
        faces = np.asarray(mesh.faces, dtype=np.intp).reshape(-1, 3)
        kind = mesh.visual.kind if len(faces) else None
        colours = np.asarray(mesh.visual.face_colors)[:, :3].astype(np.uint8) if kind in ("face", "vertex") else None
    except Exception as error:  # trimesh raises what its parsers raise
        raise ModelError(f"no PLY: {' '.join(str(error).split())[:100]}") from None
    if len(faces) < (header.triangles or 0):
        raise ModelError(f"{len(faces)} faces; its header counts {header.triangles} (truncated, or a lying count)")
    return TriangleMesh(vertices, faces, colours)
