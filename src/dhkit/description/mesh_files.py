"""Checks of mesh files before any reader parses them: a file's kind, length and header.

Readers of meshes take truncated files, wrong counts and text files for empty meshes, expand XML entities, and open the
files that a mesh names. Therefore every mesh file is checked here first, without trimesh; a binary file of any size is
checked by its header and its length alone.
"""

from __future__ import annotations

import re
import stat
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from xml.parsers import expat

from dhkit.description.assets import MESH_FORMATS
from dhkit.description.bounds import BOUNDS
from dhkit.description.files import error_reason
from dhkit.errors import DescriptionError

_STL_HEADER_LENGTH = 84
_STL_FACET_LENGTH = 50
"""Bytes of a binary STL before its facets (80 of text, 4 of a count), and of each facet."""
_TEXT_END_LENGTH = 4_096
"""Bytes that are read at the beginning and at the end of a text file."""
_PLY_SIZES = {
    **dict.fromkeys(("char", "uchar", "int8", "uint8"), 1),
    **dict.fromkeys(("short", "ushort", "int16", "uint16"), 2),
    **dict.fromkeys(("int", "uint", "float", "int32", "uint32", "float32"), 4),
    **dict.fromkeys(("double", "float64"), 8),
}
"""Bytes of a number in a binary PLY file, by its type."""
_VERTEX_LINE = re.compile(rb"^[ \t]*v[ \t]+[-+.\d]", re.MULTILINE)


@dataclass(frozen=True)
class MeshHeader:
    """Format and number of triangles, as a mesh file's header states them."""

    format: str
    """``stl`` (binary), ``stl_ascii``, ``obj``, ``ply`` or ``dae``."""
    triangles: int | None
    """Number of faces that the header states; None where the format has no count."""


class MeshFileError(DescriptionError):
    """A file that is not a readable mesh; ``reason`` is the message without the path."""

    def __init__(self, path: Path, reason: str) -> None:
        super().__init__(path, reason)
        self.path = path
        self.reason = reason

    def __str__(self) -> str:
        return f"{self.path}: {self.reason}"


def check_mesh_file(path: Path, max_bytes: int = BOUNDS.mesh_bytes) -> MeshHeader:
    """Return a mesh file's header, or refuse a file that cannot be the mesh that its name says.

    Parameters
    ----------
    path
        The file; links are followed: whether it lies in the robot's folder is for
        :func:`dhkit.description.assets.inside` to check before.
    max_bytes
        Largest size, bytes.

    Raises
    ------
    MeshFileError
        No such file, not a regular file, too large, empty, of another format, truncated, or with a count that does
        not fit its length: one line that begins with the path.
    """
    try:
        status = path.stat()
    except (OSError, ValueError) as error:
        raise MeshFileError(path, error_reason(error)) from None
    if not stat.S_ISREG(status.st_mode):
        kind = "a folder" if stat.S_ISDIR(status.st_mode) else "not a regular file"
        raise MeshFileError(path, f"{kind}; expected a mesh file")
    if path.suffix.lower() not in MESH_FORMATS:
        raise MeshFileError(
            path, f"ends in {path.suffix!r}; expected one of {', '.join(MESH_FORMATS)}"
        )
    if status.st_size > max_bytes:
        raise MeshFileError(
            path, f"more than {max_bytes / 1e6:g} MB; expected a mesh of at most that size"
        )
    # Cached: descriptions are checked whenever one is made from another, up to 60 times a second in the lab.
    header = _header_or_fault(path, status.st_size, status.st_mtime_ns, status.st_ino)
    if isinstance(header, str):
        raise MeshFileError(path, header)
    return header


def is_mesh_file(path: Path) -> bool:
    """Return whether a file passes :func:`check_mesh_file`."""
    try:
        check_mesh_file(path)
    except MeshFileError:
        return False
    return True


class _FaultError(Exception):
    """The reason why a file is not a mesh."""


@lru_cache(maxsize=256)
def _header_or_fault(path: Path, size: int, _time: int, _inode: int) -> MeshHeader | str:
    """Return a file's header, or the reason why it is not a mesh."""
    if size == 0:
        return "an empty file; expected a mesh"
    read_header = {
        ".stl": _stl_header,
        ".obj": _obj_header,
        ".ply": _ply_header,
        ".dae": _dae_header,
    }
    try:
        return read_header[path.suffix.lower()](path, size)
    except _FaultError as fault:
        return str(fault)
    except OSError as error:
        return error.strerror or "cannot be read"


def _bytes_at(path: Path, start: int, count: int) -> bytes:
    with path.open("rb") as file:
        file.seek(start)
        return file.read(count)


def _stl_header(path: Path, size: int) -> MeshHeader:
    head = _bytes_at(path, 0, _TEXT_END_LENGTH)
    count = int.from_bytes(head[80:_STL_HEADER_LENGTH], "little")
    expected = _STL_HEADER_LENGTH + _STL_FACET_LENGTH * count
    # The length decides, not the first word: binary files of many exporters begin with "solid" too.
    if len(head) >= _STL_HEADER_LENGTH and size == expected:
        if count == 0:
            raise _FaultError("no triangles: a binary STL whose header counts 0")
        return MeshHeader("stl", count)
    if head.lstrip()[:5].lower() == b"solid" and b"\0" not in head:
        if b"facet" not in head.lower():
            raise _FaultError("no triangles: an ASCII STL without facets")
        if (
            b"endsolid"
            not in _bytes_at(path, max(0, size - _TEXT_END_LENGTH), _TEXT_END_LENGTH).lower()
        ):
            raise _FaultError("truncated: an ASCII STL that does not end in 'endsolid'")
        return MeshHeader("stl_ascii", None)
    if len(head) < _STL_HEADER_LENGTH or b"\0" not in head:
        raise _FaultError("no STL: neither a text that begins with 'solid' nor a binary header")
    raise _FaultError(
        f"no STL: {size} bytes; its header counts {count} triangles, which need {expected} "
        "(truncated, or a lying count)"
    )


def _obj_header(path: Path, _size: int) -> MeshHeader:
    head = _bytes_at(path, 0, BOUNDS.obj_head_bytes)
    if b"\0" in head[:_TEXT_END_LENGTH] or not _VERTEX_LINE.search(head):
        raise _FaultError("no OBJ: no line 'v x y z' in its first megabyte")
    return MeshHeader("obj", None)


def _ply_header(path: Path, size: int) -> MeshHeader:
    header, ending, _ = _bytes_at(path, 0, BOUNDS.ply_header_bytes).partition(b"end_header")
    lines = [line.split() for line in header.decode("ascii", "replace").splitlines()]
    if not ending or not lines or lines[0] != ["ply"]:
        raise _FaultError("no PLY: expected 'ply', a header and 'end_header'")
    form = next((words[1] for words in lines if words[:1] == ["format"] and len(words) > 1), "")
    if form not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise _FaultError(f"no PLY: its format is {form[:30]!r}; expected ascii or binary")
    counts, min_bytes = _ply_elements(lines, is_ascii=form == "ascii")
    if not counts.get("vertex") or not counts.get("face"):
        raise _FaultError("no triangles: its header counts no vertices or no faces")
    expected = len(header) + len(ending) + 1 + min_bytes
    if size < expected:
        raise _FaultError(
            f"no PLY: {size} bytes; its header counts {counts['vertex']} vertices and {counts['face']} faces, which "
            f"need {expected} or more (truncated, or a lying count)"
        )
    return MeshHeader("ply", counts["face"])


def _ply_elements(lines: list[list[str]], *, is_ascii: bool) -> tuple[dict[str, int], int]:
    """Return the count of each element, and the fewest bytes that all of them take."""
    counts: dict[str, int] = {}
    min_bytes = 0
    element = ""
    for words in lines:
        if words[:1] == ["element"]:
            if len(words) != 3 or not words[2].isdecimal() or len(words[2]) > 12:
                raise _FaultError(
                    f"no PLY: found {' '.join(words)[:60]!r}; expected 'element NAME COUNT'"
                )
            element = words[1]
            counts[element] = int(words[2])
        elif words[:1] == ["property"] and element and len(words) >= 3:
            # In ASCII a number takes a digit and a blank; a list takes its count and, of a face, three entries.
            if is_ascii:
                each = 2 if words[1] != "list" else 8
            elif words[1] == "list" and len(words) >= 5:
                each = _PLY_SIZES.get(words[2], 1) + 3 * _PLY_SIZES.get(words[3], 1) * (
                    element == "face"
                )
            else:
                each = _PLY_SIZES.get(words[1], 1)
            min_bytes += counts[element] * each
    return counts, max(0, min_bytes - 1)


def _dae_header(path: Path, size: int) -> MeshHeader:
    """Refuse XML with a document type or entities, XML nested too deep, and other XML than COLLADA."""
    parser = expat.ParserCreate()
    depth = 0
    root = ""

    def start_element(name: str, _attributes: dict[str, str]) -> None:
        nonlocal depth, root
        depth += 1
        root = root or name
        if depth > BOUNDS.collada_nesting:
            raise _FaultError(f"elements nested more than {BOUNDS.collada_nesting} deep")

    def end_element(_name: str) -> None:
        nonlocal depth
        depth -= 1

    def refuse(*_arguments: object) -> None:
        raise _FaultError(
            "has a document type or entities, which a COLLADA file does not need and dhkit does not read"
        )

    parser.StartElementHandler = start_element
    parser.EndElementHandler = end_element
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    try:
        parser.Parse(_bytes_at(path, 0, size), True)
    except expat.ExpatError as error:
        raise _FaultError(f"no XML: {error}") from None
    except (LookupError, ValueError) as error:  # an encoding that Python does not know
        raise _FaultError(f"no XML: {' '.join(str(error).split())[:100]}") from None
    if root.rpartition(":")[2] != "COLLADA":
        raise _FaultError(f"found <{root[:40]}>; expected <COLLADA>")
    return MeshHeader("dae", None)
