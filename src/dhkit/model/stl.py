"""STL files as corners of triangles, binary and ASCII, read by NumPy; equal triangles are written as equal bytes."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import chain

import numpy as np

from dhkit.description import Array
from dhkit.errors import ModelError
from dhkit.model.bounds import BOUNDS
from dhkit.model.triangle_mesh import unit_normals

_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
_HEADER_LENGTH = 84
_NORMAL_DECIMALS = 6
"""Decimals of the normals that are written: sines of different machines agree to far more."""
_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(rb"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
_FACET_END = re.compile(rb"\bendfacet\b", re.IGNORECASE)
_NAME_LINE = re.compile(rb"^[ \t]*(?:end)?solid\b[^\r\n]*", re.IGNORECASE | re.MULTILINE)
"""Line with the name of a solid, which may have keywords in it."""


def binary_corners(content: bytes) -> Array:
    """Return the corners of a binary STL's triangles, shape (m, 3, 3), in the file's units; the header is not read.

    Raises
    ------
    ModelError
        No whole number of facets.
    """
    if len(content) < _HEADER_LENGTH or (len(content) - _HEADER_LENGTH) % _FACET.itemsize:
        raise ModelError(
            f"{len(content)} bytes; expected a header of {_HEADER_LENGTH} and facets of {_FACET.itemsize}"
        )
    return np.frombuffer(content, dtype=_FACET, offset=_HEADER_LENGTH)["corners"].astype(np.float64)


def ascii_corners(content: bytes) -> Array:
    """Return the corners of an ASCII STL's triangles, shape (m, 3, 3), in the file's units.

    Raises
    ------
    ModelError
        Another number of vertices than three a facet in the whole file, or a coordinate that is not a number.
    """
    content = _NAME_LINE.sub(b"", content)
    vertices = _VERTEX.findall(content)
    facets = len(_FACET_END.findall(content))
    if len(vertices) != 3 * facets:
        raise ModelError(f"{facets} facets with {len(vertices)} vertices; expected 3 each")
    try:
        numbers = coordinates(vertices)
    except ValueError as error:
        comma = next(filter(_DECIMAL_COMMA.fullmatch, chain.from_iterable(vertices)), None)
        if comma:
            raise ModelError(
                f"found {comma[:20].decode()!r}: decimal commas are not read; export 1.5 for 1,5"
            ) from None
        raise ModelError(f"{' '.join(str(error).split())[:80]}; expected a coordinate") from None
    return numbers.reshape(-1, 3, 3)


def coordinates(rows: Sequence[tuple[bytes, bytes, bytes]]) -> Array:
    """Return the numbers of texts, shape (m, 3).

    Raises
    ------
    ValueError
        A text that is not a number.
    """
    for text in chain.from_iterable(rows):
        if len(text) > BOUNDS.coordinate_characters:
            raise ValueError(
                f"found {text[:20].decode('ascii', 'replace')!r}, {len(text)} characters long"
            )
        if b"_" in text:  # NumPy would read 1_000 as Python does
            raise ValueError(f"found {text[:20].decode('ascii', 'replace')!r}")
    return (
        np.array(rows, dtype=f"S{BOUNDS.coordinate_characters}").astype(np.float64).reshape(-1, 3)
    )


def binary_stl(title: str, corners: Array) -> bytes:
    """Return triangles, corners of shape (m, 3, 3), as a binary STL file in their unit, with unit normals.

    The normal of a triangle without area is 0.
    """
    facets = np.zeros(len(corners), dtype=_FACET)
    facets["normal"] = np.round(unit_normals(corners), _NORMAL_DECIMALS) + 0.0
    facets["corners"] = corners
    # The title must be ASCII and must not begin with "solid": many readers would take the file for a text.
    header = title.encode("ascii", "replace")[:80].ljust(80, b"\0")
    return header + len(facets).to_bytes(4, "little") + facets.tobytes()


def ascii_stl(title: str, corners: Array) -> str:
    """Return triangles, corners of shape (m, 3, 3), as an ASCII STL file in their unit, with nine digits."""
    rows = [f"solid {title}"]
    normals = np.round(unit_normals(corners), _NORMAL_DECIMALS) + 0.0
    for (a, b, c), (u, v, w) in zip(corners.tolist(), normals.tolist(), strict=True):
        rows.append(f"facet normal {u:.6g} {v:.6g} {w:.6g}\n outer loop")
        rows += [f"  vertex {x:.9g} {y:.9g} {z:.9g}" for x, y, z in (a, b, c)]
        rows.append(" endloop\nendfacet")
    return "\n".join([*rows, f"endsolid {title}", ""])
