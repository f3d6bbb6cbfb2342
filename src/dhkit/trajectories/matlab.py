"""A reader of MATLAB's format 5, as far as real matrices and texts go; SciPy's crashes on some damaged files."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from dhkit.errors import DescriptionError

HEADER, TAG = 128, 8
MATRIX, COMPRESSED = 14, 15
"""Types of elements (MathWorks, MAT-File Format, table 1-1)."""
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Types that a matrix of doubles may be stored as: MATLAB takes the shortest that is exact."""
CODES = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
CLASSES = dict(enumerate(("cell", "struct", "object", "char", "sparse matrix", "double", "single"), start=1)) | {
    **{8 + k: f"{'u' if k % 2 else ''}int{8 << k // 2}" for k in range(8)},
    16: "function",
}
"""MATLAB's classes (table 1-3)."""
OBJECT, CHARACTERS, OPAQUE = 3, 4, 17
"""Classes with a layout of their own; an opaque variable is an object of a class of MATLAB's own, as timeseries is."""
REAL = range(6, 16)
"""Classes of full matrices of numbers."""
COMPLEX = 0x0800
MOST_AXES, LONGEST_NAME = 8, 63
HDF5 = b"\x89HDF\r\n\x1a\n"
USER_BLOCK = 512
"""Bytes before the HDF5 signature of a file of format 7.3."""
ARRAY_EXPORT = "save arrays by save('log.mat', 't', 'q', '-v7'), a timeseries ts as [ts.Time, ts.Data]"
"""What to do in MATLAB in place of what is not read."""


@dataclass(frozen=True)
class _Element:
    kind: int
    data: bytes


@dataclass(frozen=True)
class Variable:
    """A variable of a file, whose content is read when asked for."""

    name: str
    kind: str
    """MATLAB's class, such as ``double``, ``char``, ``struct`` or ``timeseries``; ``complex`` for complex numbers."""
    parts: tuple[_Element, ...]
    """Dimensions and real part; none for what is neither real numbers nor text."""
    order: str
    """Byte order, ``<`` or ``>``."""

    @property
    def readable(self) -> bool:
        """Whether it holds real numbers or text."""
        return bool(self.parts)

    @property
    def value(self) -> Any:
        """A text, or an array of float64 with two axes or more.

        Raises
        ------
        DescriptionError
            Neither, or the file is damaged there; names the variable.
        """
        if not self.parts:
            raise DescriptionError(f"{self.name}: found a {self.kind}; expected real numbers or text")
        dimensions, body = self.parts
        if not 0 < len(dimensions.data) <= 4 * MOST_AXES or len(dimensions.data) % 4:
            raise _damaged()
        shape = struct.unpack(f"{self.order}{len(dimensions.data) // 4}i", dimensions.data)
        read = _text if self.kind == CLASSES[CHARACTERS] else _array
        return read(self.name, body, shape, self.order)


def read_variables(content: bytes, most: int) -> dict[str, Variable]:
    """Return a file's variables by name.

    Parameters
    ----------
    content
        A file of format 5, compressed or not.
    most
        Bytes that may be unpacked altogether.

    Raises
    ------
    DescriptionError
        Another format, or damage; says which.
    """
    if content.startswith(b"MATLAB 7.3 MAT-file") or HDF5 in (content[:8], content[USER_BLOCK : USER_BLOCK + 8]):
        raise DescriptionError(f"a .mat file of format 7.3 (HDF5), which is not read; {ARRAY_EXPORT}")
    order = {b"IM": "<", b"MI": ">"}.get(content[HEADER - 2 : HEADER])
    if order is None:
        raise DescriptionError(f"no .mat file of format 5; {ARRAY_EXPORT}")
    found: dict[str, Variable] = {}
    left = most
    for element in _elements(content[HEADER:], order):
        inner = [element]
        if element.kind == COMPRESSED:
            unpacked = _unpacked(element.data, left, most)
            left -= len(unpacked)
            inner = list(_elements(unpacked, order))
        for matrix in inner:
            if matrix.kind != MATRIX:
                continue
            variable = _variable(matrix.data, order)
            if variable.name in found:
                raise DescriptionError(f"{variable.name}: stands there twice")
            if variable.name:  # objects keep their content in one without a name
                found[variable.name] = variable
    return found


def _variable(data: bytes, order: str) -> Variable:
    parts = _elements(data, order)
    flags = _next(parts)
    if len(flags.data) < 4:
        raise _damaged()
    word = struct.unpack(f"{order}I", flags.data[:4])[0]
    code = word & 0xFF
    if code == OPAQUE:
        name, _, kind = (_name(_next(parts)) for _ in range(3))
        return Variable(name, kind, (), order)
    dimensions, name = _next(parts), _name(_next(parts))
    if code == OBJECT:
        return Variable(name, _name(_next(parts)), (), order)
    if code not in REAL and code != CHARACTERS:
        return Variable(name, CLASSES.get(code, f"matrix of class {code}"), (), order)
    if word & COMPLEX:
        return Variable(name, "complex matrix", (), order)
    return Variable(name, CLASSES[code], (dimensions, _next(parts)), order)


def _name(element: _Element) -> str:
    name = element.data[:LONGEST_NAME].decode("latin-1")
    return name if name.isprintable() else ascii(name)[1:-1]  # messages are one line, whatever the file


def _array(name: str, body: _Element, shape: tuple[int, ...], order: str) -> Any:
    code = NUMBERS.get(body.kind)
    if code is None:
        raise _damaged()
    dtype = np.dtype(f"{order}{code}")
    count = int(np.prod(shape, dtype=object))
    if min(shape) < 0 or count * dtype.itemsize != len(body.data):
        raise DescriptionError(f"{name}: {len(body.data)} bytes for shape {shape}; the file is damaged")
    return np.frombuffer(body.data, dtype).reshape(shape, order="F").astype(float)


def _text(name: str, body: _Element, _shape: tuple[int, ...], order: str) -> str:
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


def _unpacked(data: bytes, left: int, most: int) -> bytes:
    """Return what a compressed element holds, of which ``left`` bytes of ``most`` may still be unpacked."""
    unpacker = zlib.decompressobj()
    try:
        unpacked = unpacker.decompress(data, max(left, 1))
    except zlib.error as error:
        raise DescriptionError(f"damaged: {error}") from None
    if len(unpacked) >= left:
        raise DescriptionError(f"unpacks to more than the {most / 1e6:g} MB that are read")
    if not unpacker.eof:
        raise _damaged()
    return unpacked


def _damaged() -> DescriptionError:
    return DescriptionError("ends within an element, or has one of another kind; the .mat file is damaged")
