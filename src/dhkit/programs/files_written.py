"""Size of the files that a program has written.

Counted are the files in its folder, those without a name that it has open, and those elsewhere by what they have grown
since it was first seen to have them open for writing. Files without a name are those that were deleted while open, and
those in memory (Linux: ``memfd_create``).
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

BLOCK_BYTES = 512
"""Unit of ``st_blocks``."""
MIN_FILE_BYTES = 4096
"""Least size that a file in the folder counts with, so that the number of files is bounded, too."""


@dataclass(frozen=True)
class _FileElsewhere:
    """A file outside the folder that a process was seen to have open for writing, and its size then, bytes."""

    path: str
    first_size: int


class WrittenFiles:
    """The files that a program has written.

    Parameters
    ----------
    folder
        The program's folder.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._elsewhere: dict[tuple[int, int], _FileElsewhere] = {}

    def size(self, processes: Sequence[int], enough: int) -> int:
        """Return the size of the files on disk and in memory, bytes; without /proc that of the folder's files.

        Parameters
        ----------
        processes
            Numbers of the program's processes.
        enough
            Size beyond which the rest is not counted, bytes.
        """
        counted: set[tuple[int, int]] = set()
        total = 0
        for status in self._in_folder():
            # A file may have several names.
            if _identity(status) not in counted:
                counted.add(_identity(status))
                total += max(MIN_FILE_BYTES, _size(status))
            if total > enough:
                return total

        for path, status in _open_files(processes):
            file = _identity(status)
            if file in counted:
                continue
            if status.st_nlink == 0:
                counted.add(file)
                total += _size(status)
            else:
                self._elsewhere.setdefault(file, _FileElsewhere(path, _size(status)))

        for file, elsewhere in self._elsewhere.items():
            with suppress(OSError):
                status = os.lstat(elsewhere.path)
                if _identity(status) == file and file not in counted:
                    total += max(0, _size(status) - elsewhere.first_size)
        return total

    def _in_folder(self) -> Iterator[os.stat_result]:
        """Return the status of every entry of the program's folder."""
        for place, folders, names in os.walk(self._folder):
            for name in (*folders, *names):
                with suppress(OSError):
                    yield os.lstat(os.path.join(place, name))  # noqa: PTH118 - called many times


def _open_files(processes: Sequence[int]) -> Iterator[tuple[str, os.stat_result]]:
    """Return path and status of every file without a name, and of every other that is open for writing."""
    for pid in processes:
        with suppress(OSError):
            for descriptor in os.listdir(f"/proc/{pid}/fd"):  # noqa: PTH208 - names alone
                link = f"/proc/{pid}/fd/{descriptor}"
                with suppress(OSError):
                    status = os.stat(link)  # noqa: PTH116 - called many times
                    is_written = bool(os.lstat(link).st_mode & stat.S_IWUSR)
                    if stat.S_ISREG(status.st_mode) and (is_written or status.st_nlink == 0):
                        yield os.readlink(link), status  # noqa: PTH115


def _identity(status: os.stat_result) -> tuple[int, int]:
    return status.st_dev, status.st_ino


def _size(status: os.stat_result) -> int:
    """Return the space that a file takes, bytes: parts that were never written take none."""
    return BLOCK_BYTES * status.st_blocks
