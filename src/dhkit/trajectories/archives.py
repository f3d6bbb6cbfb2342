"""Trajectories as NumPy and MATLAB archives: every number as it is, and the robot with them."""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.lib import format as npy

from dhkit.errors import DescriptionError
from dhkit.trajectories.matlab import read_matrices

__all__ = ["MOST_BYTES", "mat_bytes", "npz_bytes", "read_mat", "read_npz"]

MOST_BYTES = 200_000_000
"""Of a file, and of what is in it."""
KEYS = ("format", "robot", "digest", "toml", "breaks", "coefficients")
TEXTS = KEYS[:4]


def npz_bytes(values: Mapping[str, Any]) -> bytes:
    """Return an archive that ``numpy.load`` reads; texts are arrays of no dimension."""
    file = io.BytesIO()
    np.savez(file, **values)
    return file.getvalue()


def mat_bytes(values: Mapping[str, Any]) -> bytes:
    """Return an archive that MATLAB and Octave load, format 5."""
    from scipy.io import savemat

    file = io.BytesIO()
    savemat(file, dict(values), oned_as="row")
    return file.getvalue()


def read_npz(content: bytes) -> dict[str, Any]:
    """Return texts and arrays by name; nothing is unpickled, and nothing unpacked beyond a bound.

    Raises
    ------
    DescriptionError
        Not such an archive; says what was found.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
            _require_keys(members)
            size = sum(members[key].file_size for key in KEYS)
            if size > MOST_BYTES:
                raise DescriptionError(f"unpacks to {size / 1e6:.0f} MB; expected at most {MOST_BYTES / 1e6:g} MB")
            return {key: _npy(archive.read(members[key]), key) for key in KEYS}
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, MemoryError, OSError, ValueError) as error:
        raise DescriptionError(f"damaged, or no .npz file: {_line(error)}") from None


def _npy(data: bytes, key: str) -> Any:
    """Return one member, whose header has to say exactly what follows."""
    file = io.BytesIO(data)
    version = npy.read_magic(file)
    if version not in ((1, 0), (2, 0)):
        raise DescriptionError(f"{key}: .npy version {version}; expected 1.0 or 2.0")
    read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, fortran, dtype = read_header(file)
    wanted = "U" if key in TEXTS else "f"
    if dtype.kind != wanted or (wanted == "f" and dtype.itemsize != 8):
        expected = "text" if wanted == "U" else "float64"
        raise DescriptionError(f"{key}: found type {dtype}; expected {expected}")
    rest = data[file.tell() :]
    if int(np.prod(shape, dtype=object)) * dtype.itemsize != len(rest) or (wanted == "U" and shape != ()):
        raise DescriptionError(f"{key}: {len(rest)} bytes for shape {shape}; the file is damaged")
    if wanted == "U":
        return str(np.frombuffer(rest, dtype)[0]) if dtype.itemsize else ""
    return np.frombuffer(rest, dtype).reshape(shape, order="F" if fortran else "C").astype(float)


def read_mat(content: bytes) -> dict[str, Any]:
    """Return texts and arrays by name, as :func:`read_npz`; a trailing axis of length 1 may be missing.

    Raises
    ------
    DescriptionError
        Not such an archive; says what was found.
    """
    found = read_matrices(content, KEYS, MOST_BYTES)
    _require_keys(found)
    for key in KEYS:
        if isinstance(found[key], str) != (key in TEXTS):
            expected = "text" if key in TEXTS else "numbers"
            raise DescriptionError(f"{key}: found {'text' if key not in TEXTS else 'numbers'}; expected {expected}")
    return found


def _require_keys(found: Mapping[str, Any]) -> None:
    missing = [key for key in KEYS if key not in found]
    if missing:
        names = ", ".join(sorted(map(str, found)))[:80] or "nothing"
        raise DescriptionError(f"no {missing[0]} in it: found {names}; expected a trajectory that dhkit saved")


def _line(error: Exception) -> str:
    return (str(error) or type(error).__name__).splitlines()[0][:120]
