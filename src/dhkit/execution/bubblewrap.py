"""bubblewrap's command: the folders that a program sees, and nothing else."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from functools import lru_cache
from importlib import metadata
from pathlib import Path

HOME = Path("/home/student")
"""Folder of a program that bubblewrap isolates."""
PACKAGE_FOLDER = Path("/packages")
RUNNERS = Path("/runners")
"""Folder of dhkit's files that are executed in the program's process."""
_SYSTEM_FOLDERS = ("/usr", "/lib", "/lib32", "/lib64", "/bin", "/sbin")
_SYSTEM_FILES = (
    "/etc/ld.so.cache",
    "/etc/alternatives",
    "/etc/octave",
    "/etc/fonts",
    "/etc/localtime",
)
"""Files that programs of the system read: Octave finds its linear algebra by /etc/alternatives."""
_FOLDER_BYTES = 64 << 20
"""Size of each folder that a program may write to, bytes."""


def base_python() -> str:
    """Return the interpreter itself, not that of a virtual environment."""
    return os.path.realpath(getattr(sys, "_base_executable", sys.executable))


def bubblewrap(packages: tuple[str, ...]) -> list[str]:
    """Return bubblewrap with the listed mounts."""
    return [
        *("bwrap", "--unshare-all", "--die-with-parent", "--new-session", "--cap-drop", "ALL"),
        *_system_mounts(),
        *read_only(package_paths(packages)),
        *("--dev", "/dev"),
        *_memory_folder("/dev/shm"),  # noqa: S108 - inside the sandbox
        *_memory_folder("/tmp"),  # noqa: S108
        *_memory_folder(str(HOME)),
        *("--proc", "/proc"),
    ]


def _memory_folder(path: str) -> tuple[str, ...]:
    """Return the options for an empty folder in memory, of bounded size."""
    return ("--size", str(_FOLDER_BYTES), "--tmpfs", path)


def _system_mounts() -> Iterator[str]:
    """Yield options for the system's libraries and for Python's, without the packages that are installed there."""
    for folder in _SYSTEM_FOLDERS:
        path = Path(folder)
        if path.is_symlink():
            yield from ("--symlink", os.readlink(path), folder)  # noqa: PTH115 - as it is written there
        elif path.is_dir():
            yield from ("--ro-bind", folder, folder)
    for name in _SYSTEM_FILES:
        yield from ("--ro-bind-try", name, name)
    prefix = os.path.realpath(sys.base_prefix)
    if not prefix.startswith("/usr"):
        yield from ("--ro-bind", prefix, prefix)
    for folder in sorted({str(path) for path in _installed_packages(prefix)}):
        yield from ("--tmpfs", folder)


def _installed_packages(prefix: str) -> Iterator[Path]:
    """Yield the folders of the system's own packages for Python."""
    for root in {"/usr", "/usr/local", prefix}:
        for name in ("site-packages", "dist-packages"):
            yield from Path(root, "lib").glob(f"python3*/{name}")


def read_only(binds: dict[Path, Path]) -> Iterator[str]:
    """Yield options that show files and folders elsewhere, for reading."""
    for outside, inside in binds.items():
        yield from ("--ro-bind", str(outside), str(inside))


@lru_cache(maxsize=16)
def package_paths(names: tuple[str, ...]) -> dict[Path, Path]:
    """Return the files and folders of packages and of those that they need, and where a program finds them.

    Packages that are not installed are left out, and so are folders that several packages share.
    """
    paths: dict[Path, Path] = {}
    waiting = list(names)
    known = set[str]()
    while waiting:
        name = waiting.pop().lower().replace("_", "-")
        if name in known:
            continue
        known.add(name)
        with suppress(metadata.PackageNotFoundError):
            distribution = metadata.distribution(name)
            requirements = distribution.requires or ()
            # Requirements of extras and other systems follow a semicolon.
            waiting += [
                _name_of(requirement) for requirement in requirements if ";" not in requirement
            ]
            for top in {file.parts[0] for file in distribution.files or ()}:
                if top not in ("..", "bin", "__pycache__", "cmeel.prefix"):
                    outside = Path(str(distribution.locate_file(top)))
                    if outside.exists():
                        paths[outside.resolve()] = PACKAGE_FOLDER / top
    return paths


def _name_of(requirement: str) -> str:
    """Return the package of a requirement such as ``mpmath<1.4,>=1.1``."""
    end = next(
        (k for k, letter in enumerate(requirement) if not (letter.isalnum() or letter in "-_.")),
        None,
    )
    return requirement[:end]
