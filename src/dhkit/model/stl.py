"""STL files as corners of triangles, binary and ASCII, read by NumPy and written as bytes that are always the same."""

from __future__ import annotations

import re

import numpy as np

from dhkit.description import Array
from dhkit.errors import ModelError

FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
HEADER = 84
NORMAL_DECIMALS = 6
"""Decimals of the normals that are written: sines differ between machines far behind them."""
VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
COMMA = re.compile(rb"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
FACET_END = re.compile(rb"\bendfacet\b", re.IGNORECASE)


def binary_corners(content: bytes) -> Array:
    """Return the corners of a binary STL's triangles, shape (m, 3, 3), in the file's units, whatever its header.

    Raises
    ------
    ModelError
        No whole number of facets.
    """
    if len(content) < HEADER or (len(content) - HEADER) % FACET.itemsize:
        raise ModelError(f"{len(content)} bytes; expected a header of {HEADER} and facets of {FACET.itemsize}")
    corners: Array = np.frombuffer(content, dtype=FACET, offset=HEADER)["corners"].astype(np.float64)
    return corners


def ascii_corners(content: bytes) -> Array:
    """Return the corners of an ASCII STL's triangles, shape (m, 3, 3), in the file's units.

    Raises
    ------
    ModelError
        A facet without three vertices, or a coordinate that is no number.
    """
    found = VERTEX.findall(content)
    facets = len(FACET_END.findall(content))
    if len(found) != 3 * facets:
        raise ModelError(f"{facets} facets with {len(found)} vertices; expected 3 each")
    try:
        numbers = np.array(found, dtype="S40").astype(np.float64)
    except ValueError as error:
        if comma := next((text for row in found for text in row if COMMA.fullmatch(text)), None):
            raise ModelError(
                f"found {comma[:20].decode()!r}: decimal commas are not read; export 1.5 for 1,5"
            ) from None
        raise ModelError(f"{' '.join(str(error).split())[:80]}; expected a coordinate") from None
    return numbers.reshape(-1, 3, 3)


def binary_stl(title: str, corners: Array) -> bytes:
    """Return triangles, corners of shape (m, 3, 3), as a binary STL file with unit normals (0 of a flat triangle)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    unit = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    facets = np.zeros(len(corners), dtype=FACET)
    facets["normal"] = np.round(unit, NORMAL_DECIMALS) + 0.0
    facets["corners"] = corners
    # A title of ASCII alone, and never one that begins with "solid": many readers would take the file for a text.
    header = title.encode("ascii", "replace")[:80].ljust(80, b"\0")
    return header + len(facets).to_bytes(4, "little") + facets.tobytes()


def ascii_stl(title: str, corners: Array) -> str:
    """Return triangles, corners of shape (m, 3, 3), as an ASCII STL file, numbers as single precision has them."""
    rows = [f"solid {title}"]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    unit = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    for (a, b, c), (u, v, w) in zip(corners.tolist(), unit.tolist(), strict=True):
        rows.append(f"facet normal {u:.6g} {v:.6g} {w:.6g}\n outer loop")
        rows += [f"  vertex {x:.9g} {y:.9g} {z:.9g}" for x, y, z in (a, b, c)]
        rows.append(" endloop\nendfacet")
    return "\n".join([*rows, f"endsolid {title}", ""])
