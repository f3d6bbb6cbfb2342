"""The command that runs a program under an isolation, and where the program finds its files."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from dhkit.execution.bubblewrap import (
    HOME,
    PACKAGE_FOLDER,
    RUNNERS,
    base_python,
    bubblewrap,
    package_paths,
    read_only,
)
from dhkit.execution.isolation import Isolation, Kind

_HERE = Path(__file__).parent


def folder_inside(isolation: Isolation, outside: Path) -> Path:
    """Return where a program finds its folder."""
    return HOME if isolation.kind is Kind.BUBBLEWRAP else outside


def python_command(isolation: Isolation, runner: Path, folder: Path) -> list[str]:
    """Return the command of Python with one of dhkit's runners, and the folder of the packages as its argument.

    Parameters
    ----------
    isolation
        Isolation of the program: files and resources that it can use.
    runner
        The runner's file.
    folder
        The program's folder on this system.
    """
    if isolation.kind is Kind.NONE:
        return [sys.executable, "-I", "-B", "-u", str(runner), ""]
    packages = PACKAGE_FOLDER
    if isolation.kind is Kind.USER:
        packages = folder / "packages"
        packages.mkdir()
        for outside, inside in package_paths(isolation.packages).items():
            (packages / inside.name).symlink_to(outside)
    return [
        base_python(),
        "-I",
        "-S",
        "-B",
        "-u",
        str(runner_inside(isolation, runner, folder)),
        str(packages),
    ]


def runner_inside(isolation: Isolation, path: Path, folder: Path) -> Path:
    """Return where a program finds a runner; for another user, who cannot read dhkit's files, it is copied."""
    if isolation.kind is Kind.BUBBLEWRAP:
        return RUNNERS / path.name
    if isolation.kind is Kind.NONE:
        return path
    copy = folder / "runners" / path.name
    copy.parent.mkdir(exist_ok=True)
    copy.write_bytes(path.read_bytes())
    return copy


def isolated_command(
    isolation: Isolation, program: Sequence[str], folder: Path, shown: Iterable[Path] = ()
) -> list[str]:
    """Return the command that runs a program.

    Parameters
    ----------
    isolation
        Isolation of the program: files and resources that it can use.
    program
        The program and its arguments, with paths as it sees them.
    folder
        Its folder on this system; its files are shown in the program's folder.
    shown
        Further files that it may read, at their own paths.
    """
    if isolation.kind is not Kind.BUBBLEWRAP:
        return list(program)
    binds = {path: HOME / path.name for path in sorted(folder.iterdir())}
    binds |= {
        path: RUNNERS / path.name
        for path in (*_HERE.glob("*_runner.py"), *_HERE.glob("*_runner.m"))
    }
    binds |= {path.resolve(): path for path in shown}
    return [
        *bubblewrap(isolation.packages),
        *read_only(binds),
        "--chdir",
        str(HOME),
        "--",
        *program,
    ]
