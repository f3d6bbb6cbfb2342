"""Parts of an assembly from a MAT file of faces, vertices and colours, as the course's Robot_CAD2MAT stores them.

A struct a part, ``s1`` with fields F1, V1, C1, or one struct ``s`` with fields F1, V1, C1, F2 ..., or an array of
structs ``s`` with fields F, V, C; or faces, vertices, facevertexcdata as MATLAB's patch has them. Vertices are (k, 3),
or (k, 4) with a column of ones; faces count vertices from 1.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dhkit.description import Array
from dhkit.description.files import read_bounded
from dhkit.description.mat_files import MatVariable, read_mat
from dhkit.errors import DescriptionError, DhkitError, ModelError
from dhkit.model.mesh_reader import odd_coordinates
from dhkit.model.polygons import triangles_of
from dhkit.model.triangle_mesh import TriangleMesh

MAX_BYTES = 100_000_000
MAX_UNPACKED = 400_000_000
MAX_PARTS = 100
MAX_POLYGON = 16
"""Columns of a list of faces."""
EXPORT = "save it with save('robot.mat', 's1', ..., '-v7')"
FIELD = re.compile(r"([FVC]|faces|vertices|facevertexcdata)(\d{0,3})", re.IGNORECASE)
"""The course's names, and those of MATLAB's patch and isosurface."""


def mat_parts(path: Path) -> dict[str, TriangleMesh]:
    """Return the parts of a MAT file by name, in the file's units and order.

    Raises
    ------
    ModelError
        No MAT file of format 5, damaged, too large, or without faces and vertices; one line that begins with the path.
    """
    try:
        content = read_bounded(path, MAX_BYTES, "a MAT file")
    except DescriptionError as error:
        raise ModelError(str(error)) from None
    try:
        variables = read_mat(content, MAX_UNPACKED, advice=EXPORT)
        parts = dict(_parts(variables))
    except DhkitError as error:
        raise ModelError(f"{path}: {error}") from None
    if not parts:
        raise ModelError(
            f"{path}: no struct with fields F, V (faces, vertices); found {', '.join(variables)[:100] or 'none'}"
        )
    return parts


def _parts(variables: Mapping[str, MatVariable]) -> Iterator[tuple[str, TriangleMesh]]:
    count = 0
    for name, variable in variables.items():
        records = variable.value if variable.kind == "struct" else ()
        if not isinstance(records, tuple):
            continue
        for k, record in enumerate(records, start=1):
            matches = [(FIELD.fullmatch(field), value) for field, value in record.items()]
            fields = {_short(match) + match[2]: value for match, value in matches if match}
            numbers = sorted({field[1:] for field in fields}, key=lambda text: int(text or 0))
            for number in numbers:
                if f"F{number}" not in fields or f"V{number}" not in fields:
                    continue
                count += 1
                if count > MAX_PARTS:
                    raise ModelError(f"more than {MAX_PARTS} parts")
                # One struct for all parts: their numbers are the fields', or the places in the array.
                many = len(numbers) > 1 or len(records) > 1
                part = f"{name}{number or k}" if many else name
                yield part, _mesh(part, fields[f"F{number}"], fields[f"V{number}"], fields.get(f"C{number}"))


def _short(match: re.Match[str]) -> str:
    """Return F, V or C for the name of a field."""
    return "C" if match[1].lower() == "facevertexcdata" else match[1][0].upper()


def _mesh(
    part: str, faces_field: MatVariable, vertices_field: MatVariable, colours: MatVariable | None
) -> TriangleMesh:
    faces, vertices = _matrix(faces_field), _matrix(vertices_field)
    if faces is None or vertices is None:
        raise ModelError(f"{part}: its {'faces' if faces is None else 'vertices'} are no matrix of real numbers")
    if vertices.shape[1] not in (3, 4):
        raise ModelError(f"{part}: vertices of shape {vertices.shape}; expected (k, 3) or (k, 4)")
    points = np.array(vertices[:, :3], dtype=np.float64)
    if not 3 <= faces.shape[1] <= MAX_POLYGON:
        raise ModelError(f"{part}: faces of shape {faces.shape}; expected (m, 3)")
    wide = np.array(faces, dtype=np.float64)
    ragged = np.isnan(wide)  # patch takes NaN for the corners that a smaller polygon has not
    if np.any(wide[~ragged] != np.round(wide[~ragged])) or np.any(ragged[:, :3]):
        raise ModelError(f"{part}: faces that are no whole numbers")
    if np.any((wide[~ragged] < 1) | (wide[~ragged] > len(points))):
        raise ModelError(f"{part}: a face with a vertex that is none of 1 to {len(points)}")
    corners, counts = wide[~ragged].astype(np.intp) - 1, (~ragged).sum(axis=1)
    triangles = triangles_of(points, corners, counts)
    mesh = TriangleMesh(points, triangles, _colours(colours, len(triangles)))
    if wrong := odd_coordinates(mesh):
        raise ModelError(f"{part}: {wrong}")
    return mesh


def _matrix(field: MatVariable) -> Array | None:
    """Return a field's matrix of numbers; None where it holds something else, or nothing."""
    value = field.value if field.readable else None
    return value if isinstance(value, np.ndarray) and value.ndim == 2 and value.size else None


def _colours(field: MatVariable | None, count: int) -> np.ndarray[Any, np.dtype[np.uint8]] | None:
    """Return one colour for all triangles, shape (count, 3): the mean of a patch's, 0 to 1; None where it has none."""
    colours = None if field is None else _matrix(field)
    if colours is None or colours.shape[1] != 3 or not np.isfinite(colours).all():
        return None
    mean = np.clip(colours.mean(axis=0), 0, 1)
    return np.tile(np.round(255 * mean).astype(np.uint8), (count, 1))
