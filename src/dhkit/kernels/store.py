"""Machine code of kernels on disk: a later process neither derives nor compiles."""

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

PACKAGES = ("description", "dynamics", "expressions", "kernels", "kinematics", "symbolic")
"""Of dhkit: every source that can decide what a kernel computes."""
VERSIONS = ("casadi", "llvmlite", "numpy")
"""Packages that programs and machine code are made with."""


def cache_folder() -> Path | None:
    """Return the user's own folder of kernels, made if missing: in ``DHKIT_CACHE_DIR`` or the platform's cache folder.

    None where there is none, or where others could write to it or to a folder above it: what lies in it is run.

    Raises
    ------
    DhkitError
        ``DHKIT_CACHE_DIR`` names the home of a user that does not exist.
    """
    given = os.environ.get("DHKIT_CACHE_DIR")
    try:
        root = Path(given).expanduser() if given else Path(platformdirs.user_cache_dir("dhkit", appauthor=False))
    except RuntimeError as error:
        if given:
            raise DhkitError(f"DHKIT_CACHE_DIR is {given!r}: there is no such user; expected a folder") from None
        _warn_once(f"kernels are not cached: {error}")
        return None
    try:
        folder = _made(Path.cwd() / root / "kernels").resolve()
        levels = ((level, level != folder) for level in (folder, *folder.parents))
        foreign = next((level for level, above in levels if _writable_by_others(level.stat(), sticky=above)), None)
    except OSError as error:
        _warn_once(f"kernels are not cached: {root}: {error.strerror}")
        return None
    if foreign is not None:
        _warn_once(f"kernels are not cached: {foreign} can be written by other users")
        return None
    return folder


def _made(folder: Path) -> Path:
    """Return a folder, made with those above it for this user alone: the umask may allow others more."""
    missing = [level for level in (folder, *folder.parents) if not level.exists()]
    for level in reversed(missing):
        level.mkdir(mode=0o700, exist_ok=True)
    return folder


@cache
def _warn_once(message: str) -> None:
    log.warning(message)


def _writable_by_others(status: os.stat_result, *, sticky: bool = False) -> bool:
    """Return whether somebody else than this user and the administrator can change a file, or what is in a folder.

    With ``sticky`` a sticky folder, such as /tmp, will do: others can add to it, but not move what is ours.
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
    """Return whether a group is this user's alone: many systems make one for each user, and let it write by default."""
    import grp
    import pwd

    try:
        group, user = grp.getgrgid(gid), pwd.getpwuid(os.geteuid())
    except KeyError:
        return False
    return group.gr_name == user.pw_name and user.pw_gid == gid and set(group.gr_mem) <= {user.pw_name}


def digest(name: str, pattern: str) -> str:
    """Return what a kernel is found by: its function and pattern, dhkit's sources, versions and the processor."""
    return hashlib.sha256("\0".join((name, pattern, *_circumstances())).encode()).hexdigest()[:32]


def read(name: str, key: str) -> bytes | None:
    """Return a kernel's machine code, or None if it is not there, damaged, or not to be trusted."""
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
    seal, code = content[: len(_seal(b""))], content[len(_seal(b"")) :]
    if seal != _seal(code):
        log.warning("%s: damaged; the kernel is compiled anew", path)
        return None
    return code


def _own_file(path: Path) -> bytes:
    """Return the content of a regular file that nobody else could have written.

    Raises
    ------
    OSError
        There is none, or it is another's, a link, a folder or a pipe.
    """
    # Without blocking: a pipe would wait for somebody to write.
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
    with os.fdopen(handle, "rb") as file:
        status = os.fstat(handle)
        if not stat.S_ISREG(status.st_mode) or _writable_by_others(status):
            raise PermissionError(errno.EPERM, "not a file that this user alone could have written", str(path))
        return file.read()


def write(name: str, key: str, code: bytes) -> None:
    """Keep a kernel's machine code for later processes; without a folder, or with a full disk, do nothing."""
    folder = cache_folder()
    if folder is None:
        return
    path = _path(folder, name, key)
    try:
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        write_atomically(path, _seal(code) + code, private=True)
    except OSError as error:
        _warn_once(f"kernels are not cached: {folder}: {error.strerror}")


def _path(folder: Path, name: str, key: str) -> Path:
    return folder / f"{name}_{key}.kernel"


def _seal(code: bytes) -> bytes:
    """Return what stands before machine code: a full disk or a power cut may have left part of it."""
    return hashlib.sha256(code).digest()


@cache
def _circumstances() -> tuple[str, ...]:
    root, total = Path(__file__).parents[1], hashlib.sha256()
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            total.update(path.read_bytes())
    return (total.hexdigest(), *(f"{name} {version(name)}" for name in VERSIONS), *processor())
