"""Archives of NumPy and MATLAB, which hold every number without rounding, and the robot."""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.lib import format as npy

from dhkit.description import mat_files
from dhkit.errors import DescriptionError
from dhkit.trajectories.bounds import BOUNDS
from dhkit.trajectories.labels import TEXTS, FileKind

ARCHIVES = (".npz", ".mat")
_SAVED = "expected one that dhkit saved"


def archive_bytes(suffix: str, values: Mapping[str, Any]) -> bytes:
    """Return the bytes of an archive of texts and arrays, in the format of its suffix."""
    return npz_bytes(values) if suffix == ".npz" else mat_bytes(values)


def read_archive(suffix: str, content: bytes, kind: FileKind) -> dict[str, Any]:
    """Return an archive's texts and arrays by name, read in the format of its suffix.

    From a ``.mat`` file arrays have two axes or more, and a trailing axis of length 1 may be missing.

    Raises
    ------
    DescriptionError
        Not such an archive; says what was found.
    """
    return _read_npz(content, kind) if suffix == ".npz" else _read_mat(content, kind)


def archive_format(suffix: str, content: bytes, most: int) -> str:
    """Return the text ``format`` that dhkit writes into its archives; empty for archives of other programs.

    Parameters
    ----------
    suffix, content
        The file.
    most
        Largest size of its unpacked variables, bytes.

    Raises
    ------
    DescriptionError
        A damaged ``.mat`` file.
    """
    if suffix == ".mat":
        variable = mat_files.read_mat(content, most, advice=_SAVED).get("format")
        value = variable.value if variable is not None else None
        return value if isinstance(value, str) else ""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            info = archive.getinfo("format.npy")
            return (
                str(_npy(archive.read(info), "format"))
                if info.file_size <= BOUNDS.format_bytes
                else ""
            )
    except (
        KeyError,
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        RuntimeError,
        OSError,
        ValueError,
        DescriptionError,
    ):
        return ""


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


def _read_npz(content: bytes, kind: FileKind) -> dict[str, Any]:
    """Return texts and arrays by name; nothing is unpickled, and the unpacked size is bounded."""
    keys = (*TEXTS, *kind.arrays)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
            _require_keys(members, kind)
            keys = (*keys, *(key for key in kind.optional if key in members))
            size = sum(members[key].file_size for key in keys)
            if size > kind.most:
                raise DescriptionError(
                    f"unpacks to {size / 1e6:.0f} MB; expected at most {kind.most / 1e6:g} MB"
                )
            return {key: _npy(archive.read(members[key]), key) for key in keys}
    except (
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        RuntimeError,
        MemoryError,
        OSError,
        ValueError,
    ) as error:
        raise DescriptionError(f"damaged, or no .npz file: {_line(error)}") from None


def _npy(data: bytes, key: str) -> Any:
    """Return one member; its header must describe its bytes exactly."""
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
    if int(np.prod(shape, dtype=object)) * dtype.itemsize != len(rest) or (
        wanted == "U" and shape != ()
    ):
        raise DescriptionError(f"{key}: {len(rest)} bytes for shape {shape}; the file is damaged")
    if wanted == "U":
        return str(np.frombuffer(rest, dtype)[0]) if dtype.itemsize else ""
    return np.frombuffer(rest, dtype).reshape(shape, order="F" if fortran else "C").astype(float)


def _read_mat(content: bytes, kind: FileKind) -> dict[str, Any]:
    """Return texts and arrays by name, as :func:`_read_npz`."""
    variables = mat_files.read_mat(content, kind.most, advice=_SAVED)
    _require_keys(variables, kind)
    keys = (*TEXTS, *kind.arrays, *(key for key in kind.optional if key in variables))
    found = {key: variables[key].value for key in keys}
    for key, value in found.items():
        if isinstance(value, str) != (key in TEXTS):
            expected = "text" if key in TEXTS else "numbers"
            raise DescriptionError(
                f"{key}: found {'text' if key not in TEXTS else 'numbers'}; expected {expected}"
            )
    return found


def _require_keys(found: Mapping[str, Any], kind: FileKind) -> None:
    missing = [key for key in (*TEXTS, *kind.arrays) if key not in found]
    if missing:
        names = " ".join(", ".join(sorted(found)).split())[:80] or "nothing"
        raise DescriptionError(
            f"no {missing[0]} in it: found {names}; expected a {kind.noun} that dhkit saved"
        )


def _line(error: Exception) -> str:
    return (str(error) or type(error).__name__).splitlines()[0][:120]
