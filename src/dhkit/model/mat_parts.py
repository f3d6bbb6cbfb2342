"""Parts of an assembly from a MAT file of faces, vertices and colours, as the course's Robot_CAD2MAT stores them.

One struct for each part (``s1`` with fields F1, V1, C1), one struct for several parts (``s`` with F1, V1, C1, F2, ...)
or an array of structs ``s`` with fields F, V, C; or the field names of MATLAB's patch. Vertices have 3 columns, or 4,
of which the last is ignored. Faces number vertices from 1.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.description.files import read_bounded
from dhkit.description.mat_files import MatVariable, read_mat
from dhkit.errors import DhkitError, ModelError
from dhkit.model.bounds import BOUNDS
from dhkit.model.mesh_reader import check_coordinates
from dhkit.model.polygons import triangles_of
from dhkit.model.triangle_mesh import TriangleMesh

_EXPORT_ADVICE = "save it with save('robot.mat', 's1', ..., '-v7')"
_FIELD = re.compile(r"([FVC]|faces|vertices|facevertexcdata)(\d{0,3})", re.IGNORECASE)
"""Names of fields: the course's, and those of MATLAB's patch and isosurface."""


def mat_parts(path: Path) -> dict[str, TriangleMesh]:
    """Return the parts of a MAT file by name, in the file's units and order.

    Raises
    ------
    ModelError
        No MAT file of format 5, damaged, too large, or without faces and vertices; one line that begins with the path.
    """
    content = read_bounded(path, BOUNDS.mat_bytes, "a MAT file", ModelError)
    try:
        variables = read_mat(content, BOUNDS.mat_unpacked_bytes, advice=_EXPORT_ADVICE)
        parts: dict[str, TriangleMesh] = {}
        for name, mesh in _parts(variables):
            if name in parts:
                raise ModelError(f"{name}: two parts of this name")
            parts[name] = mesh
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
            matches = [(_FIELD.fullmatch(field), value) for field, value in record.items()]
            fields = {_field_letter(match) + match[2]: value for match, value in matches if match}
            numbers = sorted({field[1:] for field in fields}, key=lambda text: int(text or 0))
            for number in numbers:
                if f"F{number}" not in fields or f"V{number}" not in fields:
                    continue
                count += 1
                if count > BOUNDS.mat_parts:
                    raise ModelError(f"more than {BOUNDS.mat_parts} parts")
                # Parts of an array are numbered by their place, those of one struct by the numbers of its fields.
                part = f"{name}{k}" if len(records) > 1 else name
                if len(numbers) > 1:
                    part = f"{name}{number}" if len(records) == 1 else f"{part}_{number}"
                yield (
                    part,
                    _mesh(
                        part, fields[f"F{number}"], fields[f"V{number}"], fields.get(f"C{number}")
                    ),
                )


def _field_letter(match: re.Match[str]) -> str:
    """Return F, V or C for the name of a field."""
    return "C" if match[1].lower() == "facevertexcdata" else match[1][0].upper()


def _mesh(
    part: str, faces_field: MatVariable, vertices_field: MatVariable, colours: MatVariable | None
) -> TriangleMesh:
    faces = _matrix(faces_field)
    vertices = _matrix(vertices_field)
    if faces is None or vertices is None:
        raise ModelError(
            f"{part}: its {'faces' if faces is None else 'vertices'} are not a matrix of real numbers"
        )
    if vertices.shape[1] not in (3, 4):
        raise ModelError(f"{part}: vertices of shape {vertices.shape}; expected (k, 3) or (k, 4)")
    points = np.array(vertices[:, :3], dtype=np.float64)
    if not 3 <= faces.shape[1] <= BOUNDS.mat_face_columns:
        raise ModelError(
            f"{part}: faces of shape {faces.shape}; expected 3 to {BOUNDS.mat_face_columns} columns"
        )
    is_missing = np.isnan(faces)  # patch fills the rows of smaller polygons with NaN
    indices = faces[~is_missing]
    if np.any(indices != np.round(indices)) or np.any(is_missing[:, :3]):
        raise ModelError(f"{part}: faces that are not whole numbers")
    if np.any((indices < 1) | (indices > len(points))):
        raise ModelError(f"{part}: a face with a vertex that is none of 1 to {len(points)}")
    triangles = triangles_of(points, indices.astype(np.intp) - 1, (~is_missing).sum(axis=1))
    mesh = TriangleMesh(points, triangles, _colours(colours, len(triangles)))
    check_coordinates(mesh, f"{part}: ")
    return mesh


def _matrix(field: MatVariable | None) -> Array | None:
    """Return a field's matrix of numbers; None for other or empty content."""
    value = field.value if field is not None and field.readable else None
    return value if isinstance(value, np.ndarray) and value.ndim == 2 and value.size else None


def _colours(field: MatVariable | None, count: int) -> NDArray[np.uint8] | None:
    """Return a part's mean colour for each triangle, 0 to 255, shape (count, 3), from colours 0 to 1; None for none."""
    colours = _matrix(field)
    if colours is None or colours.shape[1] != 3 or not np.isfinite(colours).all():
        return None
    mean = np.clip(colours.mean(axis=0), 0, 1)
    return np.tile(np.round(255 * mean).astype(np.uint8), (count, 1))
