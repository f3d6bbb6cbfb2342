"""OBJ files as triangles: vertices and faces alone; what a file names beside itself (mtllib) is never opened."""

from __future__ import annotations

import re

import numpy as np

from dhkit.errors import ModelError
from dhkit.model.polygons import triangles_of
from dhkit.model.triangle_mesh import TriangleMesh

VERTEX = re.compile(rb"^[ \t]*v[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.MULTILINE)
FACE = re.compile(rb"^[ \t]*(?:f|v)[ \t]+([^\r\n]*)", re.MULTILINE)
MOST_CORNERS = 1_000
"""Corners of one face."""


def obj_mesh(content: bytes) -> TriangleMesh:
    """Return an OBJ file's faces as triangles, in the file's units.

    Raises
    ------
    ModelError
        A coordinate or an index that is no number, or an index of no vertex.
    """
    content = content.replace(b"\\\n", b" ").replace(b"\\\r\n", b" ")
    try:
        vertices = np.array(VERTEX.findall(content), dtype="S40").astype(np.float64).reshape(-1, 3)
        polygons = _polygons(content, len(vertices))
    except ValueError as error:
        raise ModelError(f"{' '.join(str(error).split())[:80]}; expected a number") from None
    corners = np.array([corner for polygon in polygons for corner in polygon], dtype=np.intp)
    counts = np.array([len(polygon) for polygon in polygons], dtype=np.intp)
    return TriangleMesh(vertices, triangles_of(vertices, corners, counts))


def _polygons(content: bytes, count: int) -> list[list[int]]:
    """Return the vertex numbers of each face from 0; an index below 0 counts back from the vertices read so far."""
    faces: list[list[int]] = []
    seen = 0
    for line in FACE.finditer(content):
        if line.group().lstrip().startswith(b"v"):
            seen += 1
            continue
        words = line[1].split(b"#")[0].split()
        if not 3 <= len(words) <= MOST_CORNERS:
            raise ModelError(f"a face of {len(words)} corners; expected 3 to {MOST_CORNERS}")
        found = [int(word.partition(b"/")[0]) for word in words]
        corners = [index - 1 if index > 0 else seen + index for index in found]
        if 0 in found or min(corners) < 0 or max(corners) >= count:
            wrong = next(i for i, k in zip(found, corners, strict=True) if i == 0 or not 0 <= k < count)
            raise ModelError(f"a face with vertex {wrong}; the file has vertices 1 to {count}")
        faces.append(corners)
    return faces
