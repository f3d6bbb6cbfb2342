"""A reader of MATLAB's format 5, as far as real matrices and texts go; SciPy's crashes on some damaged files."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from dhkit.errors import DescriptionError

__all__ = ["read_matrices"]

HEADER, TAG = 128, 8
MATRIX, COMPRESSED = 14, 15
"""Types of elements (MathWorks, MAT-File Format, table 1-1)."""
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Types that a matrix of doubles may be stored as: MATLAB takes the shortest that is exact."""
CODES = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
CHARACTERS, DOUBLES = 4, 6
"""Classes of matrices (table 1-3)."""
COMPLEX = 0x0800
MOST_AXES, LONGEST_NAME = 8, 63


@dataclass(frozen=True)
class _Element:
    kind: int
    data: bytes


def read_matrices(content: bytes, names: Collection[str], most: int) -> dict[str, Any]:
    """Return the texts and arrays of these names.

    Parameters
    ----------
    content
        A file of format 5, compressed or not.
    names
        Of the matrices; others are passed over.
    most
        Bytes that may be unpacked altogether.

    Raises
    ------
    DescriptionError
        Another format, damage, or a matrix that is neither real nor text; says which.
    """
    order = {b"IM": "<", b"MI": ">"}.get(content[HEADER - 2 : HEADER])
    if order is None:
        raise DescriptionError("no .mat file of format 5 (save -v7 in MATLAB); format 7.3 is HDF5 and not read")
    found: dict[str, Any] = {}
    for element in _elements(content[HEADER:], order):
        if element.kind == COMPRESSED:
            unpacked = _unpacked(element.data, most)
            most -= len(unpacked)
            inner = list(_elements(unpacked, order))
        else:
            inner = [element]
        for matrix in inner:
            if matrix.kind == MATRIX:
                _add_matrix(matrix.data, order, names, found)
    return found


def _add_matrix(data: bytes, order: str, names: Collection[str], found: dict[str, Any]) -> None:
    parts = _elements(data, order)
    flags, dimensions, label = (_next(parts) for _ in range(3))
    name = label.data.decode("latin-1")[:LONGEST_NAME]
    if name not in names:
        return
    if name in found:
        raise DescriptionError(f"{name}: stands there twice")
    if len(flags.data) < 4 or not 0 < len(dimensions.data) <= 4 * MOST_AXES or len(dimensions.data) % 4:
        raise _damaged()
    word = struct.unpack(f"{order}I", flags.data[:4])[0]
    shape = struct.unpack(f"{order}{len(dimensions.data) // 4}i", dimensions.data)
    kind = word & 0xFF
    if kind not in (CHARACTERS, DOUBLES) or word & COMPLEX:
        raise DescriptionError(f"{name}: found a matrix of class {kind}; expected real numbers or text")
    body = _next(parts)
    found[name] = _text(name, body, order) if kind == CHARACTERS else _array(name, body, shape, order)


def _array(name: str, body: _Element, shape: tuple[int, ...], order: str) -> Any:
    code = NUMBERS.get(body.kind)
    if code is None:
        raise _damaged()
    dtype = np.dtype(f"{order}{code}")
    count = int(np.prod(shape, dtype=object))
    if min(shape) < 0 or count * dtype.itemsize != len(body.data):
        raise DescriptionError(f"{name}: {len(body.data)} bytes for shape {shape}; the file is damaged")
    return np.frombuffer(body.data, dtype).reshape(shape, order="F").astype(float)


def _text(name: str, body: _Element, order: str) -> str:
    code = CODES.get(body.kind, "")
    try:
        return body.data.decode(
            code + {"<": "-le", ">": "-be"}[order] if code.startswith(("utf-16", "utf-32")) else code
        )
    except (UnicodeDecodeError, LookupError):
        raise DescriptionError(f"{name}: no text; the file is damaged") from None


def _elements(data: bytes, order: str) -> Iterator[_Element]:
    """Yield the elements that lie one behind the other."""
    at = 0
    while at < len(data):
        if len(data) - at < TAG:
            raise _damaged()
        kind, length = struct.unpack(f"{order}II", data[at : at + TAG])
        if kind >> 16:
            # A small element: its length and type share the first word, and its data is the second.
            kind, length, start, step = kind & 0xFFFF, kind >> 16, at + TAG // 2, TAG
            if length > TAG // 2:
                raise _damaged()
        else:
            start = at + TAG
            step = TAG + length + (0 if kind == COMPRESSED else -length % TAG)
        if start + length > len(data):
            raise _damaged()
        yield _Element(kind, data[start : start + length])
        at += step


def _next(parts: Iterator[_Element]) -> _Element:
    part = next(parts, None)
    if part is None:
        raise _damaged()
    return part


def _unpacked(data: bytes, most: int) -> bytes:
    unpacker = zlib.decompressobj()
    try:
        unpacked = unpacker.decompress(data, max(most, 1))
    except zlib.error as error:
        raise DescriptionError(f"damaged: {error}") from None
    if len(unpacked) >= most:
        raise DescriptionError("unpacks to more than a trajectory takes, 200 MB")
    if not unpacker.eof:
        raise _damaged()
    return unpacked


def _damaged() -> DescriptionError:
    return DescriptionError("ends within an element, or has one of another kind; the .mat file is damaged")
