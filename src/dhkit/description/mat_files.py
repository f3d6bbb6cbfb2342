"""Reader of MATLAB's files of format 5: full real matrices, texts, and structs of them.

SciPy's reader is not used, because it does not check the file's lengths and types: with SciPy 1.17, files with one to
four changed bytes crashed the process after 17 to 173 attempts. Reading by SciPy in a process of its own was built and
measured: 0.37 s a file instead of 0.1 ms, in as many lines. Element types and class numbers are those of MathWorks,
MAT-File Format, tables 1-1 and 1-3.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from dhkit.description.arrays import Array
from dhkit.description.bounds import BOUNDS
from dhkit.errors import DescriptionError

_HEADER_LENGTH = 128
_TAG_LENGTH = 8
_MATRIX = 14
"""Element type of a variable."""
_COMPRESSED = 15
"""Element type of a compressed variable."""
_NUMBER_TYPES = {
    1: "i1",
    2: "u1",
    3: "i2",
    4: "u2",
    5: "i4",
    6: "u4",
    7: "f4",
    9: "f8",
    12: "i8",
    13: "u8",
}
"""Element types of numbers as NumPy's; MATLAB stores doubles in the shortest type that holds them exactly."""
_TEXT_CODES = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
_CLASSES = dict(
    enumerate(("cell", "struct", "object", "char", "sparse matrix", "double", "single"), start=1)
) | {
    **{8 + k: f"{'u' if k % 2 else ''}int{8 << k // 2}" for k in range(8)},
    16: "function",
}
_STRUCT = 2
_OBJECT = 3
_CHARACTERS = 4
_OPAQUE = 17
"""Class of an object of one of MATLAB's own classes, such as timeseries; like the three above it has its own layout."""
_FULL_MATRICES = range(6, 16)
_COMPLEX_FLAG = 0x0800
_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_DAMAGE = "ends within an element, or has one of another kind; the .mat file is damaged"
_USER_BLOCK_LENGTH = 512
"""Bytes before the HDF5 signature of a file of format 7.3."""

Value: TypeAlias = "str | Array | tuple[dict[str, MatVariable], ...]"


@dataclass(frozen=True)
class _Element:
    kind: int
    data: bytes


@dataclass(frozen=True)
class MatVariable:
    """A variable of a file, or a field of a struct; ``value`` reads its content."""

    name: str
    kind: str
    """MATLAB's class: ``double``, ``char``, ``struct``, ``timeseries``; ``complex matrix`` for complex numbers."""
    parts: tuple[_Element, ...]
    """Dimensions and content; empty for classes that are not read."""
    reader: _ElementReader

    @property
    def readable(self) -> bool:
        """Whether it holds real numbers or text."""
        return bool(self.parts) and self.kind != _CLASSES[_STRUCT]

    @property
    def value(self) -> Value:
        """A text, a float64 array of two axes or more, or for each struct its fields by name, in MATLAB's order.

        Raises
        ------
        DescriptionError
            The variable is of another class, or the file is damaged there; names the variable.
        """
        if not self.parts:
            raise DescriptionError(
                f"{self.name}: found a {self.kind}; expected real numbers or text"
            )
        return self.reader.value(self)


def read_mat(content: bytes, max_bytes: int, *, advice: str) -> dict[str, MatVariable]:
    """Return a file's variables by name, in the file's order.

    Parameters
    ----------
    content
        A file of format 5, compressed or not.
    max_bytes
        Largest size of all unpacked variables together, bytes.
    advice
        How to save a readable file; ends the message for files of another format.

    Raises
    ------
    DescriptionError
        Another format, or damage; says which.
    """
    signature_places = content[:8], content[_USER_BLOCK_LENGTH : _USER_BLOCK_LENGTH + 8]
    if content.startswith(b"MATLAB 7.3 MAT-file") or _HDF5_SIGNATURE in signature_places:
        raise DescriptionError(f"a .mat file of format 7.3 (HDF5), which is not read; {advice}")
    order = {b"IM": "<", b"MI": ">"}.get(content[_HEADER_LENGTH - 2 : _HEADER_LENGTH])
    if order is None:
        raise DescriptionError(f"no .mat file of format 5; {advice}")
    reader = _ElementReader(order, max_bytes)
    variables: dict[str, MatVariable] = {}
    for variable in reader.variables(content[_HEADER_LENGTH:]):
        if variable.name in variables:
            raise DescriptionError(f"{variable.name}: stands there twice")
        if variable.name:  # objects keep their content in a variable without a name
            variables[variable.name] = variable
    return variables


@dataclass
class _ElementReader:
    """Reads elements in one byte order, with limits on size, number and depth."""

    order: str
    """``<`` or ``>``."""
    max_bytes: int
    """Largest size of all unpacked variables together, bytes."""
    unpacked: int = 0
    count: int = 0

    def variables(self, data: bytes) -> Iterator[MatVariable]:
        for element in self.elements(data):
            inner = (
                self.elements(self._unpack(element.data))
                if element.kind == _COMPRESSED
                else [element]
            )
            yield from (self._variable(matrix.data) for matrix in inner if matrix.kind == _MATRIX)

    def elements(self, data: bytes) -> Iterator[_Element]:
        """Yield the elements that data consist of, in their order."""
        offset = 0
        while offset < len(data):
            _require(len(data) - offset >= _TAG_LENGTH)
            kind, length = struct.unpack_from(f"{self.order}II", data, offset)
            # A small element: length and type share the first word, its data is the second.
            if kind >> 16:
                length = kind >> 16
                kind &= 0xFFFF
                start = offset + _TAG_LENGTH // 2
                step = _TAG_LENGTH
                _require(length <= _TAG_LENGTH // 2)
            else:
                start = offset + _TAG_LENGTH
                step = _TAG_LENGTH + length + (0 if kind == _COMPRESSED else -length % _TAG_LENGTH)
            _require(length <= len(data) - start)
            yield _Element(kind, data[start : start + length])
            offset += step

    def _unpack(self, data: bytes) -> bytes:
        remaining = self.max_bytes - self.unpacked
        unpacker = zlib.decompressobj()
        try:
            unpacked = unpacker.decompress(data, max(remaining, 1))
        except zlib.error as error:
            raise DescriptionError(f"damaged: {error}") from None
        if len(unpacked) >= remaining:
            raise DescriptionError(
                f"unpacks to more than the {self.max_bytes / 1e6:g} MB that are read"
            )
        _require(unpacker.eof)
        self.unpacked += len(unpacked)
        return unpacked

    def _variable(self, data: bytes, name: str | None = None, depth: int = 1) -> MatVariable:
        """Return the variable of an element; a field of a struct gets its name from the struct."""
        self.count += 1
        if depth > BOUNDS.mat_nesting or self.count > BOUNDS.mat_variables:
            raise DescriptionError("variables nested too deep, or too many")
        parts = self.elements(data)
        flags = _next(parts).data
        _require(len(flags) >= 4)
        word = struct.unpack(f"{self.order}I", flags[:4])[0]
        code = word & 0xFF
        if code == _OPAQUE:
            own_name, _, kind = (_name(_next(parts)) for _ in range(3))
            return MatVariable(name or own_name, kind, (), self)
        dimensions = _next(parts)
        own_name = _name(_next(parts))
        name = name or own_name
        if code == _OBJECT:
            return MatVariable(name, _name(_next(parts)), (), self)
        if code == _STRUCT:
            return MatVariable(name, _CLASSES[code], (dimensions, *parts), self)
        if code not in _FULL_MATRICES and code != _CHARACTERS:
            return MatVariable(name, _CLASSES.get(code, f"matrix of class {code}"), (), self)
        if word & _COMPLEX_FLAG:
            return MatVariable(name, "complex matrix", (), self)
        return MatVariable(name, _CLASSES[code], (dimensions, _next(parts)), self)

    def value(self, variable: MatVariable) -> Value:
        dimensions, *content = variable.parts
        count = len(dimensions.data) // 4
        _require(0 < count <= BOUNDS.mat_axes and len(dimensions.data) % 4 == 0)
        shape = struct.unpack(f"{self.order}{count}i", dimensions.data)
        _require(min(shape) >= 0)
        if variable.kind == _CLASSES[_STRUCT]:
            return self._records(variable.name, content, shape)
        if variable.kind == _CLASSES[_CHARACTERS]:
            return self._text(variable.name, content[0])
        return self._array(variable.name, content[0], shape)

    def _array(self, name: str, body: _Element, shape: tuple[int, ...]) -> Array:
        _require(body.kind in _NUMBER_TYPES)
        dtype = np.dtype(f"{self.order}{_NUMBER_TYPES[body.kind]}")
        if int(np.prod(shape, dtype=object)) * dtype.itemsize != len(body.data):
            raise DescriptionError(
                f"{name}: {len(body.data)} bytes for shape {shape}; the file is damaged"
            )
        return np.frombuffer(body.data, dtype).reshape(shape, order="F").astype(float)

    def _text(self, name: str, body: _Element) -> str:
        code = _TEXT_CODES.get(body.kind, "")
        if code.startswith(("utf-16", "utf-32")):
            code += {"<": "-le", ">": "-be"}[self.order]
        try:
            return body.data.decode(code)
        except (UnicodeDecodeError, LookupError):
            raise DescriptionError(f"{name}: no text; the file is damaged") from None

    def _records(
        self, name: str, parts: list[_Element], shape: tuple[int, ...]
    ) -> tuple[dict[str, MatVariable], ...]:
        """Return the fields of each struct of an array; in the file the names precede the fields of all structs."""
        _require(len(parts) >= 2 and len(parts[0].data) == 4)
        (length,) = struct.unpack(f"{self.order}i", parts[0].data)
        _require(0 < length <= BOUNDS.mat_name_characters + 1 and len(parts[1].data) % length == 0)
        text = parts[1].data
        names = [
            _name(_Element(1, text[at : at + length].split(b"\0")[0]))
            for at in range(0, len(text), length)
        ]
        fields = [part for part in parts[2:] if part.kind == _MATRIX]
        _require(
            len(fields) == len(names) * int(np.prod(shape, dtype=object))
            and len(set(names)) == len(names)
        )
        depth = name.count(".") + 2
        variables = [
            self._variable(field.data, f"{name}.{names[k % len(names)]}", depth)
            for k, field in enumerate(fields)
        ]
        records = [
            variables[at : at + len(names)] for at in range(0, len(variables), max(len(names), 1))
        ]
        return tuple(dict(zip(names, record, strict=True)) for record in records)


def _name(element: _Element) -> str:
    name = element.data[: BOUNDS.mat_name_characters].decode("latin-1")
    # Messages have one line, whatever the file holds.
    return name if name.isprintable() else ascii(name)[1:-1]


def _next(parts: Iterator[_Element]) -> _Element:
    part = next(parts, None)
    if part is None:
        raise DescriptionError(_DAMAGE)
    return part


def _require(is_intact: bool) -> None:
    """Refuse a damaged file."""
    if not is_intact:
        raise DescriptionError(_DAMAGE)
