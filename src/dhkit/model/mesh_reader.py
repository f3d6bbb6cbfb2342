"""The reader of all mesh files: a file is checked first and then read as triangles, which are checked too.

STL, OBJ and COLLADA are read by dhkit itself, PLY by trimesh. Libraries were tried on 131 files of example-robot-data
and on damaged ones. trimesh 5.2 does not say where a text STL is wrong, drops vertices that are not numbers, ignores
COLLADA's unit and up axis. pycollada 0.9.3 leaves a geometry out where the texture of its material is missing
(anymal_foot.dae), an accessor names no parameters or an index has no vertex; it needs twice the time.
"""

from __future__ import annotations

import io
import re
from itertools import chain
from pathlib import Path

import numpy as np

from dhkit.description import Mesh
from dhkit.description.bounds import BOUNDS as ROBOT_BOUNDS
from dhkit.description.mesh_files import MeshFileError, MeshHeader, check_mesh_file
from dhkit.errors import ModelError
from dhkit.model.bounds import BOUNDS
from dhkit.model.collada import collada_mesh
from dhkit.model.polygons import triangles_of
from dhkit.model.shapes import Part
from dhkit.model.stl import ascii_corners, binary_corners, coordinates
from dhkit.model.triangle_mesh import TriangleMesh
from dhkit.packages import imported

_OBJ_VERTEX = re.compile(rb"^[ \t]*v[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.MULTILINE)
_OBJ_FACE_OR_VERTEX = re.compile(rb"^[ \t]*(?:f|v)[ \t]+([^\r\n]*)", re.MULTILINE)


def mesh_header(path: Path, max_bytes: int = ROBOT_BOUNDS.mesh_bytes) -> MeshHeader:
    """Return a mesh file's header; see :func:`dhkit.description.mesh_files.check_mesh_file`.

    Raises
    ------
    ModelError
        It can be no mesh: one line that begins with the path.
    """
    try:
        return check_mesh_file(path, max_bytes)
    except MeshFileError as error:
        raise ModelError(f"{error}{_byte_order_mark_hint(path)}") from None


def _byte_order_mark_hint(path: Path) -> str:
    """Return a hint if a refused STL file begins with a byte order mark."""
    if path.suffix.lower() != ".stl" or not path.is_file():
        return ""
    with path.open("rb") as file:
        beginning = file.read(3)
    if not beginning.startswith((b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff")):
        return ""
    return "; it begins with a byte order mark: save the text as ASCII, or as UTF-8 without BOM"


def read_mesh(
    path: str | Path,
    *,
    max_triangles: int = BOUNDS.triangles,
    max_bytes: int = ROBOT_BOUNDS.mesh_bytes,
) -> TriangleMesh:
    """Return the triangles of an STL, OBJ, PLY or COLLADA file.

    Coordinates are in the file's units; those of COLLADA, which states its unit and its up axis, in metres with z up.
    Files that a mesh names (textures, materials) are not opened.

    Parameters
    ----------
    path
        The file.
    max_triangles, max_bytes
        Largest number of triangles and of bytes; a binary file with more triangles is refused from its header.

    Returns
    -------
    TriangleMesh
        Vertices, in the file's units or m, and triangles.

    Raises
    ------
    ModelError
        It is not a mesh, too large, or has no triangles, coordinates that are not finite, or indices of no vertex: one
        line that begins with the path.

    Examples
    --------
    >>> from dhkit.description import asset
    >>> path = asset("meshes/puma560/forearm.stl")
    >>> read_mesh(path).faces.shape[1]
    3
    """
    path = Path(path)
    header = mesh_header(path, max_bytes)
    try:
        _check_count(header.triangles or 0, max_triangles)
        mesh = _read_content(path.read_bytes(), header)
        if not len(mesh.faces):
            raise ModelError("no triangles")
        _check_count(len(mesh.faces), max_triangles)
        if mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices):
            raise ModelError(
                f"a face with vertex {mesh.faces.max()} of {len(mesh.vertices)}, counted from 0"
            )
        check_coordinates(mesh)
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from None
    except OSError as error:
        raise ModelError(f"{path}: {error.strerror or error}") from None
    return mesh


def _check_count(count: int, max_triangles: int) -> None:
    if count > max_triangles:
        raise ModelError(f"{count} triangles; expected at most {max_triangles}")


def check_coordinates(mesh: TriangleMesh, where: str = "") -> None:
    """Refuse a mesh with a coordinate that is not finite or larger than ``BOUNDS.coordinate``.

    Raises
    ------
    ModelError
        Names the first such vertex; begins with ``where``.
    """
    with np.errstate(invalid="ignore"):
        is_odd = ~(np.abs(mesh.vertices) <= BOUNDS.coordinate).all(axis=1)
    if is_odd.any():
        number = int(np.argmax(is_odd))
        fault = (
            "not finite"
            if not np.isfinite(mesh.vertices[number]).all()
            else f"beyond {BOUNDS.coordinate:g}"
        )
        raise ModelError(f"{where}vertex {number} (from 0) has coordinates that are {fault}")


def read_part(part: Part) -> TriangleMesh:
    """Return the triangles of a part that is a mesh, in the part's own axes, m: its scale is applied.

    Raises
    ------
    ModelError
        It has no folder, or its file is not a mesh: one line that names link and file.
    """
    geometry = part.geometry
    if not isinstance(geometry, Mesh):
        raise ModelError(f"link {part.link}: a {type(geometry).__name__}; expected a mesh")
    if part.file is None:
        raise ModelError(
            f"link {part.link}: mesh {geometry.path!r} has no folder; expected a robot read from a file"
        )
    try:
        mesh = read_mesh(part.file)
    except ModelError as error:
        raise ModelError(f"link {part.link}: mesh {error}") from None
    return mesh.scaled([float(factor) for factor in geometry.scale])


def _read_content(content: bytes, header: MeshHeader) -> TriangleMesh:
    match header.format:
        case "stl":
            return TriangleMesh.of_corners(binary_corners(content))
        case "stl_ascii":
            return TriangleMesh.of_corners(ascii_corners(content))
        case "obj":
            return _obj_mesh(content)
        case "dae":
            return collada_mesh(content)
    return _ply_mesh(content, header.triangles or 0)


def _obj_mesh(content: bytes) -> TriangleMesh:
    """Return an OBJ file's faces as triangles, in the file's units; a material file that it names is not opened."""
    content = content.replace(b"\\\n", b" ").replace(b"\\\r\n", b" ")
    try:
        vertices = coordinates(_OBJ_VERTEX.findall(content))
        polygons = _obj_polygons(content, len(vertices))
    except ValueError as error:
        raise ModelError(f"{' '.join(str(error).split())[:80]}; expected a number") from None
    corners = np.array(list(chain.from_iterable(polygons)), dtype=np.intp)
    counts = np.array([len(polygon) for polygon in polygons], dtype=np.intp)
    return TriangleMesh(vertices, triangles_of(vertices, corners, counts))


def _obj_polygons(content: bytes, count: int) -> list[list[int]]:
    """Return the vertices of each face, from 0; a negative index counts back from the vertices above the face."""
    polygons: list[list[int]] = []
    vertices_above = 0
    for line in _OBJ_FACE_OR_VERTEX.finditer(content):
        if line.group().lstrip().startswith(b"v"):
            vertices_above += 1
            continue
        words = line[1].split(b"#")[0].split()
        if not 3 <= len(words) <= BOUNDS.polygon_corners:
            raise ModelError(
                f"a face of {len(words)} corners; expected 3 to {BOUNDS.polygon_corners}"
            )
        indices = [int(word.partition(b"/")[0]) for word in words]
        corners = [index - 1 if index > 0 else vertices_above + index for index in indices]
        for index, corner in zip(indices, corners, strict=True):
            if index == 0 or not 0 <= corner < count:
                raise ModelError(f"a face with vertex {index}; the file has vertices 1 to {count}")
        polygons.append(corners)
    return polygons


def _ply_mesh(content: bytes, count: int) -> TriangleMesh:
    """Return a PLY file's triangles, at least ``count`` of them."""
    trimesh = imported("trimesh", "reading a PLY file")
    try:
        # From memory and without a resolver, so that no texture file is opened.
        mesh = trimesh.load_scene(io.BytesIO(content), file_type="ply", process=False).to_mesh()
        vertices = np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3)
        faces = np.asarray(mesh.faces, dtype=np.intp).reshape(-1, 3)
        kind = mesh.visual.kind if len(faces) else None
        colours = (
            np.asarray(mesh.visual.face_colors)[:, :3].astype(np.uint8)
            if kind in ("face", "vertex")
            else None
        )
    except Exception as error:  # trimesh passes on any exception of its parsers
        raise ModelError(f"no PLY: {' '.join(str(error).split())[:100]}") from None
    if len(faces) < count:
        raise ModelError(
            f"{len(faces)} faces; its header counts {count} (truncated, or a lying count)"
        )
    return TriangleMesh(vertices, faces, colours)
