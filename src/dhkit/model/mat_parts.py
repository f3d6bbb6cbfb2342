"""Parts of an assembly from a MAT file of faces, vertices and colours, as the course's Robot_CAD2MAT stores them.

A struct a part, ``s1`` with fields F1, V1, C1, or one struct ``s`` with fields F1, V1, C1, F2 ..., or an array of
structs ``s`` with fields F, V, C; or faces, vertices, facevertexcdata as MATLAB's patch has them. Vertices are (k, 3),
or (k, 4) with a column of ones; faces count vertices from 1.
"""

from __future__ import annotations

import io
import re
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dhkit.description.files import read_bounded
from dhkit.errors import DescriptionError, ModelError
from dhkit.model.mesh_reader import odd_coordinates
from dhkit.model.polygons import triangles_of
from dhkit.model.triangle_mesh import TriangleMesh

MAX_BYTES = 100_000_000
MAX_UNPACKED = 400_000_000
MAX_DEPTH = 6
"""Matrices inside one another: a field of a struct is at depth 2."""
MAX_ELEMENTS = 20_000
MAX_PARTS = 100
MAX_POLYGON = 16
"""Columns of a list of faces."""
HEADER, MATRIX, COMPRESSED = 128, 14, 15
FIELD = re.compile(r"([FVC]|faces|vertices|facevertexcdata)(\d{0,3})", re.IGNORECASE)
"""The course's names, and those of MATLAB's patch and isosurface."""
VARIABLE = re.compile(r"[A-Za-z]\w*?(\d{0,3})")


def mat_parts(path: Path) -> dict[str, TriangleMesh]:
    """Return the parts of a MAT file by name, in the file's units and order.

    Raises
    ------
    ModelError
        No MAT file of format 5, damaged, too large, or without faces and vertices; one line that begins with the path.
    """
    try:
        content = read_bounded(path, MAX_BYTES, "a MAT file")
        _check_elements(content)
        variables = _loaded(content)
        parts = dict(_parts(variables))
    except DescriptionError as error:
        raise ModelError(str(error)) from None
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from None
    if not parts:
        raise ModelError(
            f"{path}: no struct with fields F, V (faces, vertices); found {', '.join(variables)[:100] or 'none'}"
        )
    return parts


def _check_elements(content: bytes) -> None:
    """Refuse another format, lengths that lead out of the file, and what unpacks to more than a bound.

    SciPy's reader takes every length for true, and crashes on some that are not.
    """
    if content[:19] == b"MATLAB 7.3 MAT-file" or b"\x89HDF\r\n\x1a\n" in content[:1024]:
        raise ModelError("a MAT file of format 7.3 (HDF5); save it with save('robot.mat', 's1', ..., '-v7')")
    order = {b"IM": "<", b"MI": ">"}.get(content[HEADER - 2 : HEADER])
    if order is None:
        raise ModelError("no MAT file of format 5; save it with save('robot.mat', 's1', ..., '-v7')")
    left, count = MAX_UNPACKED, [0]
    for kind, data in _elements(content[HEADER:], order):
        if kind == COMPRESSED:
            unpacker = zlib.decompressobj()
            try:
                data = unpacker.decompress(data, left + 1)
            except zlib.error as error:
                raise ModelError(f"damaged: {error}") from None
            left -= len(data)
            if left < 0 or unpacker.unconsumed_tail:
                raise ModelError(f"unpacks to more than {MAX_UNPACKED // 1_000_000} MB")
            if not unpacker.eof:
                raise ModelError("damaged: a compressed variable ends early")
            inner = list(_elements(data, order))
        else:
            inner = [(kind, data)]
        for inner_kind, inner_data in inner:
            if inner_kind == MATRIX:
                _check_matrix(inner_data, order, 1, count)


def _check_matrix(data: bytes, order: str, depth: int, count: list[int]) -> None:
    count[0] += 1
    if depth > MAX_DEPTH or count[0] > MAX_ELEMENTS:
        raise ModelError("variables nested too deep, or too many")
    for kind, inner in _elements(data, order):
        if kind == MATRIX:
            _check_matrix(inner, order, depth + 1, count)


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Yield kind and content of a run of elements (MathWorks, MAT-File Format, "Data Element Format")."""
    at = 0
    while at + 8 <= len(data):
        first, size = struct.unpack_from(f"{order}II", data, at)
        if first >> 16:  # a small element: up to four bytes in the tag itself
            kind, size, begin = first & 0xFFFF, first >> 16, at + 4
            end, at = begin + size, at + 8
        else:
            kind, begin = first, at + 8
            end = begin + size
            at = end if kind == COMPRESSED else end + (-size) % 8
        if end > len(data) or (first >> 16) > 4:
            raise ModelError("damaged: an element is longer than what holds it")
        yield kind, data[begin:end]


def _loaded(content: bytes) -> dict[str, Any]:
    from scipy.io import loadmat

    try:
        loaded = loadmat(io.BytesIO(content), struct_as_record=True, squeeze_me=False, chars_as_strings=True)
    except Exception as error:  # SciPy raises what its parser raises
        raise ModelError(f"no MAT file that can be read: {' '.join(str(error).split())[:100]}") from None
    return {name: value for name, value in loaded.items() if not name.startswith("__")}


def _parts(variables: dict[str, Any]) -> Iterator[tuple[str, TriangleMesh]]:
    found = 0
    for name, value in variables.items():
        if not isinstance(value, np.ndarray) or value.dtype.names is None:
            continue
        records = value.reshape(-1)
        for k, record in enumerate(records, start=1):
            found_names = [(FIELD.fullmatch(field), field) for field in value.dtype.names]
            fields = {_short(match) + match[2]: record[field] for match, field in found_names if match}
            numbers = sorted({field[1:] for field in fields}, key=lambda text: int(text or 0))
            for number in numbers:
                if f"F{number}" not in fields or f"V{number}" not in fields:
                    continue
                found += 1
                if found > MAX_PARTS:
                    raise ModelError(f"more than {MAX_PARTS} parts")
                # One struct for all parts: their numbers are the fields', or the places in the array.
                many = len(numbers) > 1 or len(records) > 1
                part = f"{name}{number or k}" if many else name
                yield part, _mesh(part, fields[f"F{number}"], fields[f"V{number}"], fields.get(f"C{number}"))


def _short(match: re.Match[str]) -> str:
    """Return F, V or C for the name of a field."""
    return "C" if match[1].lower() == "facevertexcdata" else match[1][0].upper()


def _mesh(part: str, faces: Any, vertices: Any, colours: Any) -> TriangleMesh:
    for what, array in (("faces", faces), ("vertices", vertices)):
        if not isinstance(array, np.ndarray) or array.ndim != 2 or array.dtype.kind not in "fiu" or not array.size:
            raise ModelError(f"{part}: its {what} are no matrix of real numbers")
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


def _colours(colours: Any, count: int) -> np.ndarray[Any, np.dtype[np.uint8]] | None:
    """Return one colour for all triangles: the mean of those that a patch has, 0 to 1; None where it has none."""
    if not isinstance(colours, np.ndarray) or colours.ndim != 2 or colours.dtype.kind not in "fiu":
        return None
    if colours.shape[1] != 3 or not colours.size or not np.isfinite(colours).all():
        return None
    mean = np.clip(np.array(colours, dtype=np.float64).mean(axis=0), 0, 1)
    return np.tile(np.round(255 * mean).astype(np.uint8), (count, 1))
