"""The gate in front of every reader of mesh files: a file's kind, length and header, before anything is parsed.

Readers of meshes take truncated files, lying counts and text files for empty meshes, expand XML entities, and open the
files that a mesh names. So a file passes here first. Nothing of trimesh is needed, and a binary file of any size is
judged by its header and its length alone.
"""

from __future__ import annotations

import re
import stat
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from xml.parsers import expat

from dhkit.description.assets import MESH_FORMATS
from dhkit.errors import DescriptionError

MAX_MESH_BYTES = 50_000_000
"""A million triangles of a binary STL: more than a browser shows well."""
STL_HEADER, STL_FACET = 84, 50
"""Bytes of a binary STL before its facets (80 of text, 4 of a count), and of each facet."""
ENDS = 4_096
"""Bytes that are looked at at the beginning and at the end of a text."""
LONGEST_PLY_HEADER = 65_536
MAX_DEPTH = 64
"""Elements of a COLLADA file inside one another; exporters write about 12."""
PLY_SIZES = {
    **dict.fromkeys(("char", "uchar", "int8", "uint8"), 1),
    **dict.fromkeys(("short", "ushort", "int16", "uint16"), 2),
    **dict.fromkeys(("int", "uint", "float", "int32", "uint32", "float32"), 4),
    **dict.fromkeys(("double", "float64"), 8),
}
"""Bytes of a number in a binary PLY file."""
VERTEX_LINE = re.compile(rb"^[ \t]*v[ \t]+[-+.\d]", re.MULTILINE)


@dataclass(frozen=True)
class MeshHeader:
    """What a mesh file says of itself."""

    format: str
    """``stl`` (binary), ``stl_ascii``, ``obj``, ``ply`` or ``dae``."""
    triangles: int | None
    """Number of faces that the header promises; None where the format has no count."""


def check_mesh_file(path: Path, most: int = MAX_MESH_BYTES) -> MeshHeader:
    """Return what a mesh file says of itself, where it can be the mesh that its name says.

    Parameters
    ----------
    path
        The file; links are followed, so what it may reach is checked before by :func:`dhkit.description.assets.inside`.
    most
        Largest size, bytes.

    Raises
    ------
    DescriptionError
        No such file, not a regular file, too large, empty, of another format, truncated, or with a count that does
        not fit its length: one line that begins with the path.
    """
    try:
        found = path.stat()
    except (OSError, ValueError) as error:
        raise DescriptionError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    if not stat.S_ISREG(found.st_mode):
        what = "a folder" if stat.S_ISDIR(found.st_mode) else "not a regular file"
        raise DescriptionError(f"{path}: {what}; expected a mesh file")
    if path.suffix.lower() not in MESH_FORMATS:
        raise DescriptionError(f"{path}: ends in {path.suffix!r}; expected one of {', '.join(MESH_FORMATS)}")
    if found.st_size > most:
        raise DescriptionError(f"{path}: more than {most / 1e6:g} MB; expected a mesh of at most that size")
    # Descriptions are checked whenever one is made from another, up to sixty times a second while a table is edited.
    judged = _judged(path, found.st_size, found.st_mtime_ns, found.st_ino)
    if isinstance(judged, str):
        raise DescriptionError(f"{path}: {judged}")
    return judged


def is_mesh_file(path: Path) -> bool:
    """Return whether a file passes :func:`check_mesh_file`."""
    try:
        check_mesh_file(path)
    except DescriptionError:
        return False
    return True


class _NoMeshError(Exception):
    """Says why a file is no mesh, without its path."""


@lru_cache(maxsize=256)
def _judged(path: Path, size: int, _time: int, _inode: int) -> MeshHeader | str:
    """Return a file's header, or why it has none."""
    if size == 0:
        return "an empty file; expected a mesh"
    checks: dict[str, Callable[[Path, int], MeshHeader]] = {".stl": _stl, ".obj": _obj, ".ply": _ply, ".dae": _dae}
    try:
        return checks[path.suffix.lower()](path, size)
    except _NoMeshError as error:
        return str(error)
    except OSError as error:
        return error.strerror or "cannot be read"


def _head(path: Path, count: int) -> bytes:
    with path.open("rb") as file:
        return file.read(count)


def _tail(path: Path, size: int) -> bytes:
    with path.open("rb") as file:
        file.seek(max(0, size - ENDS))
        return file.read(ENDS)


def _stl(path: Path, size: int) -> MeshHeader:
    head = _head(path, ENDS)
    count = int.from_bytes(head[80:STL_HEADER], "little")
    expected = STL_HEADER + STL_FACET * count
    # The length decides, not the first word: binary files of many exporters begin with "solid" too.
    if len(head) >= STL_HEADER and size == expected:
        if count == 0:
            raise _NoMeshError("no triangles: a binary STL whose header counts 0")
        return MeshHeader("stl", count)
    if head.lstrip()[:5].lower() == b"solid" and b"\0" not in head:
        return _ascii_stl(path, size, head)
    if len(head) < STL_HEADER or b"\0" not in head:
        raise _NoMeshError("no STL: neither a text that begins with 'solid' nor a binary header")
    raise _NoMeshError(
        f"no STL: {size} bytes; its header counts {count} triangles, which need {expected} "
        "(truncated, or a lying count)"
    )


def _ascii_stl(path: Path, size: int, head: bytes) -> MeshHeader:
    if b"facet" not in head.lower():
        raise _NoMeshError("no triangles: an ASCII STL without facets")
    if b"endsolid" not in _tail(path, size).lower():
        raise _NoMeshError("truncated: an ASCII STL that does not end in 'endsolid'")
    return MeshHeader("stl_ascii", None)


def _obj(path: Path, size: int) -> MeshHeader:
    del size
    head = _head(path, 1_000_000)
    if b"\0" in head[:ENDS] or not VERTEX_LINE.search(head):
        raise _NoMeshError("no OBJ: no line 'v x y z' in its first megabyte")
    return MeshHeader("obj", None)


def _ply(path: Path, size: int) -> MeshHeader:
    head = _head(path, LONGEST_PLY_HEADER)
    header, ending, _ = head.partition(b"end_header")
    lines = [line.split() for line in header.decode("ascii", "replace").splitlines()]
    if not ending or not lines or lines[0] != ["ply"]:
        raise _NoMeshError("no PLY: expected 'ply', a header and 'end_header'")
    form = next((words[1] for words in lines if words[:1] == ["format"] and len(words) > 1), "")
    if form not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise _NoMeshError(f"no PLY: its format is {form[:30]!r}; expected ascii or binary")
    counts, least = _ply_elements(lines, is_ascii=form == "ascii")
    if not counts.get("vertex") or not counts.get("face"):
        raise _NoMeshError("no triangles: its header counts no vertices or no faces")
    if size < len(header) + len(ending) + 1 + least:
        raise _NoMeshError(
            f"no PLY: {size} bytes; its header counts {counts['vertex']} vertices and {counts['face']} faces, which "
            f"need {len(header) + len(ending) + 1 + least} or more (truncated, or a lying count)"
        )
    return MeshHeader("ply", counts["face"])


def _ply_elements(lines: list[list[str]], *, is_ascii: bool) -> tuple[dict[str, int], int]:
    """Return the count of each element, and the fewest bytes that all of them take."""
    counts: dict[str, int] = {}
    least, element = 0, ""
    for words in lines:
        if words[:1] == ["element"]:
            if len(words) != 3 or not words[2].isdecimal() or len(words[2]) > 12:
                raise _NoMeshError(f"no PLY: found {' '.join(words)[:60]!r}; expected 'element NAME COUNT'")
            element = words[1]
            counts[element] = int(words[2])
        elif words[:1] == ["property"] and element and len(words) >= 3:
            # A text takes a digit and a blank for a number; a list takes its count and, of a face, three entries.
            if is_ascii:
                each = 2 if words[1] != "list" else 8
            elif words[1] == "list" and len(words) >= 5:
                each = PLY_SIZES.get(words[2], 1) + 3 * PLY_SIZES.get(words[3], 1) * (element == "face")
            else:
                each = PLY_SIZES.get(words[1], 1)
            least += counts[element] * each
    return counts, max(0, least - 1)


def _dae(path: Path, size: int) -> MeshHeader:
    """Refuse XML with a document type or entities, that nests too deep, or that is no COLLADA file."""
    content = _head(path, size)
    parser = expat.ParserCreate()
    depth, root = 0, ""

    def started(name: str, _attributes: dict[str, str]) -> None:
        nonlocal depth, root
        depth += 1
        root = root or name
        if depth > MAX_DEPTH:
            raise _NoMeshError(f"elements nested more than {MAX_DEPTH} deep")

    def ended(_name: str) -> None:
        nonlocal depth
        depth -= 1

    def refused(*_arguments: object) -> None:
        raise _NoMeshError(
            "has a document type or entities, which a COLLADA file does not need and dhkit does not read"
        )

    parser.StartElementHandler, parser.EndElementHandler = started, ended
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refused
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        raise _NoMeshError(f"no XML: {error}") from None
    except (LookupError, ValueError) as error:  # an encoding that Python does not know
        raise _NoMeshError(f"no XML: {' '.join(str(error).split())[:100]}") from None
    if root.rpartition(":")[2] != "COLLADA":
        raise _NoMeshError(f"found <{root[:40]}>; expected <COLLADA>")
    return MeshHeader("dae", None)
