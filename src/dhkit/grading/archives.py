"""Archives (.zip, .tar, .tar.gz) unpacked into a temporary folder; other people make them, so that all is bounded."""

from __future__ import annotations

import gzip
import re
import stat
import tarfile
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from dhkit.display import plain
from dhkit.errors import AnswerError
from dhkit.grading.bounds import BOUNDS

ARCHIVE_SUFFIXES = (".zip", ".tar", ".tar.gz", ".tgz")
"""Ends of the names of archives that are read."""
_PIECE_BYTES = 1 << 20
"""Bytes that are unpacked at once."""
_DRIVE = re.compile(r"[A-Za-z]:")
_UTF8_FLAG = 0x800
"""Flag of an entry of a zip file whose name is UTF-8."""
_ENCRYPTED_FLAG = 0x1
_MOST_NAME_CHARACTERS = 200
"""Characters of an entry's name that a message shows."""


def is_archive(path: Path) -> bool:
    """Return whether a file's name is that of an archive."""
    return path.name.lower().endswith(ARCHIVE_SUFFIXES) and not path.is_dir()


@contextmanager
def unpacked(path: Path) -> Iterator[Path]:
    """Unpack an archive; yield the folder with its files, which is removed at the end.

    Parameters
    ----------
    path
        A file that ends in .zip, .tar, .tar.gz or .tgz.

    Yields
    ------
    Path
        A temporary folder with regular files and folders alone.

    Raises
    ------
    AnswerError
        The archive is damaged, encrypted or too large; or an entry would leave the folder, is a link or a device, or
        is there twice. The message names the archive and the entry.

    Examples
    --------
    >>> import zipfile
    >>> from pathlib import Path
    >>> with zipfile.ZipFile("class.zip", "w") as archive:
    ...     archive.writestr("ada/answer.py", "g1 = 0")
    >>> with unpacked(Path("class.zip")) as folder:
    ...     [file.relative_to(folder).as_posix() for file in folder.rglob("*.py")]
    ['ada/answer.py']
    """
    with tempfile.TemporaryDirectory(prefix="dhkit-class-") as holder:
        folder = Path(holder) / "files"
        folder.mkdir()
        try:
            if path.name.lower().endswith(".zip"):
                _unpack_zip(path, folder)
            else:
                _unpack_tar(path, folder, Path(holder) / "archive.tar")
        except (
            zipfile.BadZipFile,
            tarfile.TarError,
            zlib.error,
            gzip.BadGzipFile,
            EOFError,
            NotImplementedError,
            MemoryError,
            ValueError,
        ) as error:
            raise AnswerError(
                f"{path}: not an archive that can be read: {plain(str(error), 200) or type(error).__name__}"
            ) from None
        yield folder


class _Target:
    """The folder into which an archive is unpacked, with what has been unpacked so far."""

    def __init__(self, archive: Path, folder: Path) -> None:
        self._archive = archive
        self._folder = folder
        self._most_bytes = _most_bytes(archive)
        self._entries = 0
        self._bytes = 0

    def count(self) -> None:
        """Count an entry of the archive.

        Raises
        ------
        AnswerError
            There are too many.
        """
        self._entries += 1
        if self._entries > BOUNDS.files:
            raise AnswerError(f"{self._archive}: more than {BOUNDS.files} files")

    def place(self, name: str) -> Path:
        """Return the path of an entry inside the folder.

        Raises
        ------
        AnswerError
            The name leads out of the folder, or too deep into it.
        """
        parts = [part for part in name.replace("\\", "/").split("/") if part not in ("", ".")]
        is_absolute = name.startswith(("/", "\\")) or bool(_DRIVE.match(name))
        if is_absolute or ".." in parts or "\0" in name or not parts:
            raise self.refusal(name, "leads out of the archive")
        if len(parts) > BOUNDS.archive_depth:
            raise self.refusal(name, f"is nested deeper than {BOUNDS.archive_depth} folders")
        return self._folder.joinpath(*parts)

    def make_folder(self, name: str) -> None:
        """Make a folder, which may exist.

        Raises
        ------
        AnswerError
            The name leads out of the folder, or is that of a file.
        """
        path = self.place(name)
        try:
            path.mkdir(parents=True, exist_ok=True)
        except (OSError, UnicodeEncodeError):
            raise self.refusal(name, "cannot be written") from None

    def write(self, name: str, content: IO[bytes]) -> None:
        """Write a file.

        Raises
        ------
        AnswerError
            The name is not one of a file in the folder, or is there twice; or the archive is too large.
        """
        path = self.place(name)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("xb") as file:
                while piece := content.read(_PIECE_BYTES):
                    self._bytes += len(piece)
                    if self._bytes > self._most_bytes:
                        raise _too_large(self._archive)
                    file.write(piece)
        except FileExistsError:
            raise self.refusal(name, "is there twice") from None
        except UnicodeEncodeError:
            raise self.refusal(name, "has a name that cannot be written") from None
        except OSError as error:
            raise self.refusal(name, f"cannot be written: {error.strerror}") from None

    def refusal(self, name: str, reason: str) -> AnswerError:
        """Return the error on an entry."""
        shown = plain(name.encode("utf-8", "replace").decode(), _MOST_NAME_CHARACTERS)
        return AnswerError(f"{self._archive}: {shown!r} {reason}; nothing was unpacked")


def _most_bytes(archive: Path) -> int:
    """Return the largest size of an archive's files together, bytes.

    Text may be packed a hundred times smaller, so that the ratio counts beyond some size only.
    """
    by_ratio = max(BOUNDS.archive_ratio * archive.stat().st_size, BOUNDS.archive_free_bytes)
    return min(BOUNDS.archive_bytes, by_ratio)


def _too_large(archive: Path) -> AnswerError:
    return AnswerError(
        f"{archive}: its files have more than {_most_bytes(archive) / 1e6:.0f} MB: over {BOUNDS.archive_ratio} times "
        f"the archive's size, or over {BOUNDS.archive_bytes / 1e9:g} GB; nothing was unpacked"
    )


def _unpack_zip(path: Path, folder: Path) -> None:
    target = _Target(path, folder)
    with zipfile.ZipFile(path) as archive:
        for entry in archive.infolist():
            target.count()
            name = _zip_name(entry)
            mode = entry.external_attr >> 16
            kind = stat.S_IFMT(mode)
            if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
                raise target.refusal(name, "is a link or a device; expected regular files")
            if _is_litter(name):
                continue
            if name.endswith(("/", "\\")) or kind == stat.S_IFDIR:
                target.make_folder(name)
                continue
            if entry.flag_bits & _ENCRYPTED_FLAG:
                raise target.refusal(name, "is encrypted")
            with archive.open(entry) as content:
                target.write(name, content)


def _zip_name(entry: zipfile.ZipInfo) -> str:
    """Return the name of an entry: many programs write UTF-8 and do not say so."""
    name = entry.orig_filename
    if entry.flag_bits & _UTF8_FLAG:
        return name
    try:
        return name.encode("cp437").decode("utf-8")
    except UnicodeError:
        return name


def _unpack_tar(path: Path, folder: Path, plain_tar: Path) -> None:
    target = _Target(path, folder)
    if path.name.lower().endswith(".tar"):
        plain_tar = path
    else:
        # Headers too are compressed: bounded here, before they are read.
        with gzip.open(path) as packed, plain_tar.open("wb") as file:
            size = 0
            while piece := packed.read(_PIECE_BYTES):
                size += len(piece)
                if size > _most_bytes(path):
                    raise _too_large(path)
                file.write(piece)
    with tarfile.open(plain_tar, "r:") as archive:
        for entry in archive:
            target.count()
            name = entry.name
            is_regular = entry.isreg() and not entry.issparse()
            if not is_regular and not entry.isdir():
                raise target.refusal(name, "is a link or a device; expected regular files")
            if _is_litter(name) or name.strip("./") == "":
                continue
            if entry.isdir():
                target.make_folder(name)
            elif (content := archive.extractfile(entry)) is not None:
                target.write(name, content)
    if plain_tar != path:
        plain_tar.unlink()


def _is_litter(name: str) -> bool:
    """Return whether an entry is one that macOS adds beside the files."""
    return name.startswith("__MACOSX/")
