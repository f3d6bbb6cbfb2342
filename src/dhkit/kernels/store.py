"""Machine code of kernels on disk, so that a later process neither derives nor compiles them."""

from __future__ import annotations

import errno
import hashlib
import logging
import os
import shutil
import stat
from functools import cache
from importlib.metadata import version
from pathlib import Path

import platformdirs

from dhkit.description import write_atomically
from dhkit.errors import DhkitError
from dhkit.kernels.machine_code import processor

log = logging.getLogger(__name__)

PACKAGES = (
    "control",
    "description",
    "dynamics",
    "expressions",
    "kernels",
    "kinematics",
    "symbolic",
)
"""Packages of dhkit whose sources determine the results of a kernel."""
_SUFFIX = ".kernel"
_SEAL_BYTES = hashlib.sha256().digest_size
_VERSIONS = ("casadi", "llvmlite", "numpy")
"""Packages whose versions determine programs and machine code."""


def cache_folder() -> Path | None:
    """Return the user's own folder of kernels, made if missing: in ``DHKIT_CACHE_DIR`` or the platform's cache folder.

    None if there is none, or if others could write to it or to a folder above it: its content is executed.

    Raises
    ------
    DhkitError
        ``DHKIT_CACHE_DIR`` names the home of a user that does not exist.
    """
    given = os.environ.get("DHKIT_CACHE_DIR")
    try:
        root = (
            Path(given).expanduser()
            if given
            else Path(platformdirs.user_cache_dir("dhkit", appauthor=False))
        )
    except RuntimeError as error:
        if given:
            raise DhkitError(
                f"DHKIT_CACHE_DIR is {given!r}: there is no such user; expected a folder"
            ) from None
        _warn_once(f"kernels are not cached: {error}")
        return None
    try:
        folder = _make_folder(Path.cwd() / root / "kernels").resolve()
        levels = ((level, level != folder) for level in (folder, *folder.parents))
        foreign = next(
            (level for level, above in levels if _writable_by_others(level.stat(), sticky=above)),
            None,
        )
    except OSError as error:
        _warn_once(f"kernels are not cached: {root}: {error.strerror}")
        return None
    if foreign is not None:
        _warn_once(f"kernels are not cached: {foreign} can be written by other users")
        return None
    return folder


def _make_folder(folder: Path) -> Path:
    """Return a folder, created with those above it for this user alone, whatever the umask allows."""
    missing = [level for level in (folder, *folder.parents) if not level.exists()]
    for level in reversed(missing):
        level.mkdir(mode=0o700, exist_ok=True)
    return folder


@cache
def _warn_once(message: str) -> None:
    log.warning(message)


def _writable_by_others(status: os.stat_result, *, sticky: bool = False) -> bool:
    """Return whether others than this user and the administrator can change a file or a folder's content.

    With ``sticky`` a sticky folder, such as /tmp, is accepted: others can add to it, but not move our files.
    """
    if not hasattr(os, "geteuid"):
        return False
    if status.st_uid not in (0, os.geteuid()):
        return True
    if sticky and status.st_mode & stat.S_ISVTX:
        return False
    by_group = bool(status.st_mode & stat.S_IWGRP) and not _own_group(status.st_gid)
    return by_group or bool(status.st_mode & stat.S_IWOTH)


@cache
def _own_group(gid: int) -> bool:
    """Return whether this user is the only member of a group; many systems create such groups, with write access."""
    import grp
    import pwd

    try:
        group = grp.getgrgid(gid)
        user = pwd.getpwuid(os.geteuid())
    except KeyError:
        return False
    return (
        group.gr_name == user.pw_name and user.pw_gid == gid and set(group.gr_mem) <= {user.pw_name}
    )


def digest(name: str, pattern: str) -> str:
    """Return a kernel's key: a digest of name, pattern, dhkit's sources, package versions and the processor."""
    return hashlib.sha256("\0".join((name, pattern, *_circumstances())).encode()).hexdigest()[:32]


def read(name: str, key: str) -> bytes | None:
    """Return a kernel's machine code; None if it is missing, damaged, or not to be trusted."""
    folder = cache_folder()
    if folder is None:
        return None
    path = _path(folder, name, key)
    try:
        content = _own_file(path)
    except FileNotFoundError:
        return None
    except OSError as error:
        log.warning("%s: %s; the kernel is compiled anew", path, error.strerror)
        return None
    seal = content[:_SEAL_BYTES]
    code = content[_SEAL_BYTES:]
    if seal != _seal(path.name, code):
        log.warning("%s: damaged; the kernel is compiled anew", path)
        return None
    return code


def _own_file(path: Path) -> bytes:
    """Return the content of a regular file that nobody else could have written.

    Raises
    ------
    OSError
        It is missing, another user's, a link, a folder or a pipe.
    """
    # Non-blocking, because opening a pipe would wait for a writer.
    handle = os.open(
        path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    )
    with os.fdopen(handle, "rb") as file:
        status = os.fstat(handle)
        if not stat.S_ISREG(status.st_mode) or _writable_by_others(status):
            raise PermissionError(
                errno.EPERM, "not a file that this user alone could have written", str(path)
            )
        return file.read()


def write(name: str, key: str, code: bytes) -> None:
    """Store a kernel's machine code for later processes; do nothing without a folder or on a full disk."""
    folder = cache_folder()
    if folder is None:
        return
    path = _path(folder, name, key)
    try:
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        write_atomically(path, _seal(path.name, code) + code, private=True)
    except OSError as error:
        _warn_once(f"kernels are not cached: {folder}: {error.strerror}")


def stored_kernels() -> list[Path]:
    """Return the files of all kernels in the cache, those of other versions and processors too."""
    folder = cache_folder()
    return [] if folder is None else sorted(folder.glob(f"*{_SUFFIX}"))


def clear() -> int:
    """Delete the kernels in the cache, and return how many there were; they are compiled again when needed.

    Raises
    ------
    DhkitError
        A file cannot be deleted.
    """
    files = stored_kernels()
    for path in files:
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise DhkitError(f"{path}: {error.strerror}") from None
    return len(files)


def _path(folder: Path, name: str, key: str) -> Path:
    return folder / f"{name}_{key}{_SUFFIX}"


def _seal(name: str, code: bytes) -> bytes:
    """Return the checksum that is stored before machine code, which detects files cut short, renamed or exchanged."""
    return hashlib.sha256(name.encode() + b"\0" + code).digest()


@cache
def _circumstances() -> tuple[str, ...]:
    root = Path(__file__).parents[1]
    total = hashlib.sha256()
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            total.update(path.read_bytes())
    return (total.hexdigest(), *(f"{name} {version(name)}" for name in _VERSIONS), *processor())
