"""MATLAB's files of format 5: real matrices, texts and structs, read by SciPy in a process of its own.

SciPy's reader does not check the file's lengths and types: with SciPy 1.17, files with one to four changed bytes
crashed the process after 17 to 173 attempts.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from dhkit.description.arrays import Array
from dhkit.errors import DescriptionError

HEADER_LENGTH = 128
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
USER_BLOCK_LENGTH = 512
"""Bytes before the HDF5 signature of a file of format 7.3."""
MAX_DEPTH = 6
"""Largest nesting depth of structs."""
MAX_SECONDS = 240.0
"""Longest time on the clock for reading a file, s; its process has a minute of processor time."""
DAMAGE = "the .mat file is damaged"
RUNNER = Path(__file__).with_name("mat_runner.py")

Value: TypeAlias = "str | Array | tuple[dict[str, MatVariable], ...]"


@dataclass(frozen=True, eq=False)
class MatVariable:
    """A variable of a file, or a field of a struct."""

    name: str
    kind: str
    """MATLAB's class: ``double``, ``char``, ``struct``, ``timeseries``; ``complex matrix`` for complex numbers."""
    content: Value | None
    """None for classes that are not read."""

    @property
    def readable(self) -> bool:
        """Whether it holds real numbers or text."""
        return isinstance(self.content, str | np.ndarray)

    @property
    def value(self) -> Value:
        """A text, a float64 array of two axes or more, or for each struct its fields by name, in MATLAB's order.

        Raises
        ------
        DescriptionError
            The variable is of another class; names the variable.
        """
        if self.content is None:
            raise DescriptionError(f"{self.name}: found a {self.kind}; expected real numbers or text")
        return self.content


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
    signature_places = content[:8], content[USER_BLOCK_LENGTH : USER_BLOCK_LENGTH + 8]
    if content.startswith(b"MATLAB 7.3 MAT-file") or HDF5_SIGNATURE in signature_places:
        raise DescriptionError(f"a .mat file of format 7.3 (HDF5), which is not read; {advice}")
    if content[HEADER_LENGTH - 2 : HEADER_LENGTH] not in (b"IM", b"MI"):
        raise DescriptionError(f"no .mat file of format 5; {advice}")
    answer = _read_in_child(content, max_bytes)
    if "error" in answer:
        raise DescriptionError(str(answer["error"]))
    variables = [_variable(one, "") for one in answer["variables"]]
    return {one.name: one for one in variables}


def _read_in_child(content: bytes, max_bytes: int) -> dict[str, Any]:
    """Return what the runner says of a file."""
    command = [sys.executable, "-I", str(RUNNER), str(max_bytes), str(MAX_DEPTH)]
    try:
        done = subprocess.run(  # noqa: S603 - a file of ours
            command, input=content, capture_output=True, timeout=MAX_SECONDS, check=False
        )
    except subprocess.TimeoutExpired:
        raise DescriptionError(f"not read within {MAX_SECONDS:g} s; {DAMAGE}") from None
    try:
        answer: dict[str, Any] = json.loads(done.stdout)
    except ValueError:  # SciPy has crashed
        raise DescriptionError(DAMAGE) from None
    return answer


def _variable(one: Mapping[str, Any], struct: str) -> MatVariable:
    """Return a variable out of JSON; a field of a struct has the struct's name in front."""
    name = f"{struct}.{_plain(one['name'])}" if struct else _plain(one["name"])
    content: Value | None = one.get("text")
    if "array" in one:
        content = np.array(one["array"], dtype=float).reshape(one["shape"])
    if "records" in one:
        records = [[_variable(field, name) for field in record] for record in one["records"]]
        content = tuple({field.name.rpartition(".")[2]: field for field in record} for record in records)
    return MatVariable(name, _plain(one["kind"]), content)


def _plain(name: str) -> str:
    """Return a name for messages, which have one line whatever the file holds."""
    return name if name.isprintable() else ascii(name)[1:-1]
