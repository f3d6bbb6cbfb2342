"""Reading at most so much, and writing all or nothing."""

from __future__ import annotations

import errno
import os
import re
import tempfile
from pathlib import Path
from typing import BinaryIO

from dhkit.errors import DescriptionError

STREAM = re.compile(r"/dev/(stdout|stderr)|/dev/fd/(\d{1,4})|/proc/self/fd/(\d{1,4})")
"""Names of what this process has open; other files below /dev, such as those of /dev/shm, are files."""


def read_bounded(path: str | Path, most: int, expected: str = "a robot file") -> bytes:
    """Return a regular file's bytes; ``expected`` says in a message what it should be.

    Raises
    ------
    DescriptionError
        No such file, not a regular file, unreadable, or longer than ``most`` bytes.
    """
    path = Path(path)
    try:
        if not path.is_file():
            raise DescriptionError(f"{path}: {'not a regular file' if path.exists() else 'no such file'}")
        with path.open("rb") as file:
            content = file.read(most + 1)
    except (OSError, ValueError) as error:
        raise DescriptionError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    if len(content) > most:
        raise DescriptionError(f"{path}: more than {most / 1e6:g} MB; expected {expected}")
    return content


def check_place(path: Path) -> None:
    """Refuse a path that no file can be written to, before long work is done for it.

    Raises
    ------
    DescriptionError
        A folder of the path is a file, or the nearest one that exists cannot be written to.
    """
    if path.is_dir():
        raise DescriptionError(f"{path}: is a folder; expected a file's name")
    above = path.absolute().parent
    try:
        while not above.exists():
            above = above.parent
        usable = above.is_dir()
    except OSError as error:
        raise DescriptionError(f"{path}: {error.strerror}") from None
    if not usable:
        raise DescriptionError(f"{above}: a file; expected a folder")
    if not os.access(above, os.W_OK | os.X_OK) and not path.exists():
        raise DescriptionError(f"{above}: cannot be written to")


def write_atomically(path: str | Path, content: str | bytes, *, private: bool = False) -> None:
    """Write a file under a temporary name and rename it: it is there whole, or not at all; folders are created.

    With ``private`` nobody else may read or write it, whatever the umask. A link is followed, and what is no file, such
    as ``/dev/stdout`` or a named pipe, is written to as it is: a file in its place would be another thing.

    Raises
    ------
    OSError
        It cannot be written; names the file or its folder.
    """
    path = Path(path)
    data = content.encode() if isinstance(content, str) else content
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, "is a folder; expected a file's name", str(path))
    path.parent.mkdir(parents=True, exist_ok=True)
    if not private:
        if STREAM.fullmatch(str(path.absolute())) or (path.exists() and not path.is_file()):
            try:
                with _opened(path) as stream:
                    stream.write(data)
            except OSError as error:
                error.filename = str(path)
                raise
            return
        path = path.resolve()
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        if not private:  # as which the temporary file was made
            umask = os.umask(0)
            os.umask(umask)
            Path(temporary).chmod(0o666 & ~umask)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _opened(path: Path) -> BinaryIO:
    """Return a pipe, a device or an open stream to write to as it is, never a file in its place."""
    found = STREAM.fullmatch(str(path.absolute()))
    if found is None:
        return path.open("ab")
    # A second opening of a stream that goes into a file would have a place of its own there, and be written over.
    number = {"stdout": 1, "stderr": 2}.get(found[1]) or int(found[2] or found[3])
    return os.fdopen(os.dup(number), "wb")
