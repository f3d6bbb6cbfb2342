"""Files read up to a largest size, and written whole or not at all."""

from __future__ import annotations

import errno
import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from dhkit.errors import DescriptionError, DhkitError

_STREAM = re.compile(r"/dev/(stdout|stderr)|/dev/fd/(\d{1,4})|/proc/self/fd/(\d{1,4})")
"""Names of streams that this process has open; other paths below /dev, such as /dev/shm, name files."""


def error_reason(error: Exception) -> str:
    """Return the operating system's message of a failed file operation, or the error's own text."""
    return getattr(error, "strerror", None) or str(error)


def read_bounded(
    path: str | Path,
    max_bytes: int,
    expected: str = "a robot file",
    error_type: type[DhkitError] = DescriptionError,
) -> bytes:
    """Return a regular file's bytes; ``expected`` is the kind of file, for messages.

    Raises
    ------
    DescriptionError
        Or another ``error_type``: no such file, not a regular file, unreadable, or longer than ``max_bytes``.
    """
    path = Path(path)
    try:
        if not path.is_file():
            raise error_type(f"{path}: {'not a regular file' if path.exists() else 'no such file'}")
        with path.open("rb") as file:
            content = file.read(max_bytes + 1)
    except (OSError, ValueError) as error:
        raise error_type(f"{path}: {error_reason(error)}") from None
    if len(content) > max_bytes:
        raise error_type(f"{path}: more than {max_bytes / 1e6:g} MB; expected {expected}")
    return content


def check_place(path: Path) -> None:
    """Refuse a path that no file can be written to, before long work is done for the file.

    Raises
    ------
    DescriptionError
        A folder of the path is a file, or the nearest existing folder cannot be written to.
    """
    if path.is_dir():
        raise DescriptionError(f"{path}: is a folder; expected a file's name")
    folder = path.absolute().parent
    try:
        while not folder.exists():
            folder = folder.parent
        is_folder = folder.is_dir()
    except OSError as error:
        raise DescriptionError(f"{path}: {error.strerror}") from None
    if not is_folder:
        raise DescriptionError(f"{folder}: a file; expected a folder")
    if not os.access(folder, os.W_OK | os.X_OK) and not path.exists():
        raise DescriptionError(f"{folder}: cannot be written to")


def write_atomically(path: str | Path, content: str | bytes, *, private: bool = False) -> None:
    """Write a file under a temporary name and rename it, so that no reader sees half a file; folders are created.

    With ``private`` nobody else may read or write the file, whatever the umask. A symbolic link is followed. A path
    that is not a regular file, such as ``/dev/stdout`` or a named pipe, is written to directly, since a renamed file
    would replace it.

    Parameters
    ----------
    path
        File to write.
    content
        Text or bytes.
    private
        Whether only this user may read the file.

    Raises
    ------
    OSError
        It cannot be written; names the file or its folder.

    Examples
    --------
    >>> from pathlib import Path
    >>> write_atomically("results/note.txt", "done")
    >>> Path("results/note.txt").read_text()
    'done'
    """
    path = Path(path)
    data = content.encode() if isinstance(content, str) else content
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, "is a folder; expected a file's name", str(path))
    path.parent.mkdir(parents=True, exist_ok=True)
    if not private:
        if _STREAM.fullmatch(str(path.absolute())) or (path.exists() and not path.is_file()):
            try:
                with _open_stream(path) as stream:
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
        if not private:  # mkstemp has made the temporary file private
            umask = os.umask(0)
            os.umask(umask)
            Path(temporary).chmod(0o666 & ~umask)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


@contextmanager
def whole_folder(path: str | Path) -> Iterator[Path]:
    """Fill a folder under a temporary name beside it, and rename it at the end: a folder of this name is complete.

    An error, or Ctrl-C, leaves the folder that was there before, or none.

    Parameters
    ----------
    path
        Folder to write; one that is there is replaced, and folders above are created.

    Yields
    ------
    Path
        The empty folder to fill.

    Raises
    ------
    OSError
        It cannot be written; names the folder.

    Examples
    --------
    >>> with whole_folder("results") as folder:
    ...     size = Path(folder, "note.txt").write_text("done")
    >>> Path("results/note.txt").read_text()
    'done'
    """
    place = Path(path).absolute()
    place.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=place.parent, prefix=f".{place.name}.") as holder:
        # The temporary folder itself can be entered by its owner alone.
        complete = Path(holder) / "made"
        complete.mkdir()
        yield complete
        previous = Path(holder) / "previous"
        if place.exists():
            place.replace(previous)
        try:
            complete.replace(place)
        except BaseException:
            if previous.exists():
                previous.replace(place)
            raise


def _open_stream(path: Path) -> BinaryIO:
    """Open a pipe, a device or a stream of this process for writing, without replacing it."""
    stream = _STREAM.fullmatch(str(path.absolute()))
    if stream is None:
        return path.open("ab")
    # Opening a redirected stream a second time would write from the file's beginning; a duplicate shares its position.
    number = {"stdout": 1, "stderr": 2}.get(stream[1]) or int(stream[2] or stream[3])
    return os.fdopen(os.dup(number), "wb")
