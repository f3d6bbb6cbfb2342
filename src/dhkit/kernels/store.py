"""Machine code of kernels on disk: a later process neither derives nor compiles."""

from __future__ import annotations

import hashlib
import logging
import os
import stat
from functools import cache
from importlib.metadata import version
from pathlib import Path

import platformdirs

from dhkit.description import write_atomically
from dhkit.errors import DhkitError
from dhkit.kernels.machine_code import processor

__all__ = ["cache_folder", "digest", "read", "write"]

log = logging.getLogger(__name__)

PACKAGES = ("description", "dynamics", "expressions", "kernels", "kinematics", "symbolic")
"""Of dhkit: every source that can decide what a kernel computes."""
VERSIONS = ("casadi", "llvmlite", "numpy")
"""Packages that programs and machine code are made with."""


def cache_folder() -> Path | None:
    """Return the user's own folder of kernels, made if missing: in ``DHKIT_CACHE_DIR`` or the platform's cache folder.

    None where it cannot be written, or where others could write to it or to a folder above it: what lies in it is run.

    Raises
    ------
    DhkitError
        ``DHKIT_CACHE_DIR`` names the home of a user that does not exist.
    """
    root = os.environ.get("DHKIT_CACHE_DIR") or platformdirs.user_cache_dir("dhkit", appauthor=False)
    try:
        folder = Path(os.path.abspath(Path(root).expanduser())) / "kernels"  # noqa: PTH100 - keeps symbolic links
    except RuntimeError:
        raise DhkitError(f"DHKIT_CACHE_DIR is {root!r}: there is no such user; expected a folder") from None
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder = folder.resolve()
        levels = ((level, level != folder) for level in (folder, *folder.parents))
        foreign = next((level for level, above in levels if _writable_by_others(level, sticky=above)), None)
    except OSError as error:
        log.info("kernels are not cached: %s: %s", folder, error.strerror)
        return None
    if foreign is not None:
        _warn_once(f"kernels are not cached: {foreign} can be written by other users")
        return None
    return folder if os.access(folder, os.W_OK | os.X_OK) else None


@cache
def _warn_once(message: str) -> None:
    log.warning(message)


def _writable_by_others(folder: Path, *, sticky: bool) -> bool:
    """Return whether somebody else than this user and the administrator can change what lies in a folder.

    With ``sticky`` a sticky folder, such as /tmp, will do: others can add to it, but not move what is ours.
    """
    if not hasattr(os, "geteuid"):
        return False
    status = folder.stat()
    kept = sticky and bool(status.st_mode & stat.S_ISVTX)
    return status.st_uid not in (0, os.geteuid()) or (bool(status.st_mode & 0o022) and not kept)


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
        content = path.read_bytes()
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


def write(name: str, key: str, code: bytes) -> None:
    """Keep a kernel's machine code for later processes; without a folder, or with a full disk, do nothing."""
    folder = cache_folder()
    if folder is None:
        return
    path = _path(folder, name, key)
    try:
        if path.is_dir():
            path.rename(path.with_suffix(f".{os.getpid()}.set-aside"))
        write_atomically(path, _seal(code) + code)
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
