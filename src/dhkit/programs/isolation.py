"""What a program of another person can see, reach and use up.

Isolated by bubblewrap, a program has a root of its own: the system's libraries, Python's own library and a folder with
the allowed packages alone for reading, and a folder of bounded size for writing, which vanishes with it. It has no
network, and all its processes end with the first. dhkit, Pinocchio, the task and the results are not there.

In a container whose root may not make namespaces, the program runs as a user without a name who can read none of these
files. Whether either works is tried before a program is run. Otherwise the program is not isolated, can do everything
that this user can, and may be run only by its own author.
"""

from __future__ import annotations

import importlib.util
import itertools
import os
import shutil
import stat
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from importlib import metadata
from pathlib import Path

import psutil

from dhkit.errors import DhkitError

PACKAGES = ("numpy", "scipy", "sympy", "casadi")
"""Packages that programs may import, unless a task names others."""
HOME = Path("/home/student")
"""Folder of a program that bubblewrap isolates."""
PACKAGE_FOLDER = Path("/packages")
RUNNERS = Path("/runners")
"""Folder of dhkit's files that are executed in the program's process."""
SYSTEM_FOLDERS = ("/usr", "/lib", "/lib32", "/lib64", "/bin", "/sbin")
SYSTEM_FILES = ("/etc/ld.so.cache", "/etc/alternatives", "/etc/octave", "/etc/fonts", "/etc/localtime")
"""What programs of the system read: Octave finds its linear algebra by /etc/alternatives."""
FOLDER_BYTES = 64 << 20
"""Size of each folder that a program may write to, bytes."""
FIRST_USER = 61_000
"""First number of the users that a program runs as: those of Debian end below, and nobody is 65,534."""
USERS = 3_000
END_ROUNDS = 200
"""Rounds of killing all processes of a user, 10 ms apart."""
PROBE_TIME = 20.0
"""Longest time of the attempt to isolate a program, s."""

_numbers = itertools.count(os.getpid())


class Kind(Enum):
    """How a program is kept from everything but its own folder."""

    BUBBLEWRAP = "isolated by bubblewrap"
    USER = "isolated as another user, with the network"
    NONE = "not isolated"


@dataclass(frozen=True)
class Isolation:
    """How programs are run.

    Attributes
    ----------
    kind
        How they are kept from everything but their folder.
    reason
        Why they are not.
    packages
        Packages that they may import.
    """

    kind: Kind
    reason: str = ""
    packages: tuple[str, ...] = PACKAGES

    def __bool__(self) -> bool:
        return self.kind is not Kind.NONE

    def __str__(self) -> str:
        return f"{self.kind.value}{f' ({self.reason})' if self.reason else ''}"

    def folder(self, outside: Path) -> Path:
        """Return where a program finds its folder."""
        return HOME if self.kind is Kind.BUBBLEWRAP else outside

    def python(self, runner: Path, folder: Path) -> list[str]:
        """Return the command of Python with one of dhkit's runners, and the folder of the packages as its argument.

        Parameters
        ----------
        runner
            The runner's file.
        folder
            The program's folder on this system.
        """
        if self.kind is Kind.NONE:
            return [sys.executable, "-I", "-B", "-u", str(runner), ""]
        packages = PACKAGE_FOLDER
        if self.kind is Kind.USER:
            packages = folder / "packages"
            packages.mkdir()
            for outside, inside in package_paths(self.packages).items():
                (packages / inside.name).symlink_to(outside)
        return [_base_python(), "-I", "-S", "-B", "-u", str(self.runner(runner, folder)), str(packages)]

    def runner(self, path: Path, folder: Path) -> Path:
        """Return where a program finds a runner; for another user, who cannot read dhkit's files, it is copied."""
        if self.kind is Kind.BUBBLEWRAP:
            return RUNNERS / path.name
        if self.kind is Kind.NONE:
            return path
        copy = folder / "runners" / path.name
        copy.parent.mkdir(exist_ok=True)
        copy.write_bytes(path.read_bytes())
        return copy

    def user(self) -> int:
        """Return a number of a user for one program; 0 where it runs as this one."""
        return FIRST_USER + next(_numbers) % USERS if self.kind is Kind.USER else 0

    def command(self, program: Sequence[str], folder: Path, shown: Iterable[Path] = ()) -> list[str]:
        """Return the command that runs a program.

        Parameters
        ----------
        program
            The program and its arguments, with paths as it sees them.
        folder
            Its folder on this system; its files are shown in the program's folder.
        shown
            Further files that it may read, at their own paths.
        """
        if self.kind is not Kind.BUBBLEWRAP:
            return list(program)
        here = Path(__file__).parent
        binds = {path: HOME / path.name for path in sorted(folder.iterdir())}
        binds |= {path: RUNNERS / path.name for path in (*here.glob("*_runner.py"), *here.glob("*_runner.m"))}
        binds |= {path.resolve(): path for path in shown}
        return [*_bubblewrap(self.packages), *_read_only(binds), "--chdir", str(HOME), "--", *program]


class IsolationError(DhkitError):
    """A program that must be isolated cannot be isolated on this system."""


def find_isolation(
    hidden: Iterable[Path] = (), packages: Sequence[str] = PACKAGES, *, required: bool = False
) -> Isolation:
    """Return the best isolation that works on this system.

    Parameters
    ----------
    hidden
        Files and folders that a program must not read, beside dhkit itself: task, rubric, results.
    packages
        Packages that it may import, with those that they need.
    required
        Whether programs of others are to be run, which must be isolated.

    Raises
    ------
    IsolationError
        It is required, and none works.
    """
    reference = importlib.util.find_spec("pinocchio")
    folders = [
        Path(__file__).parents[1],
        *(Path(x) for x in (reference and reference.submodule_search_locations) or ()),
    ]
    unseen = tuple(str(path.resolve()) for path in (*folders, *hidden))
    found = _probed(unseen, tuple(dict.fromkeys(("numpy", *packages))), os.geteuid())  # the runner needs numpy
    if required and not found:
        raise IsolationError(f"programs of others are run only where they can be isolated: {found.reason}")
    return found


@lru_cache(maxsize=64)
def _probed(hidden: tuple[str, ...], packages: tuple[str, ...], user: int) -> Isolation:
    if sys.platform != "linux":
        return Isolation(Kind.NONE, "isolation needs Linux", packages)
    reason = _problem_of_bubblewrap(hidden, packages)
    if not reason:
        return Isolation(Kind.BUBBLEWRAP, "", packages)
    if user != 0:
        return Isolation(Kind.NONE, reason, packages)
    problem = _problem_of_user(hidden)
    if not problem:
        return Isolation(Kind.USER, reason, packages)
    return Isolation(Kind.NONE, f"{reason}; as another user: {problem}", packages)


IS_SEEN = """
import os, sys
for path in sys.argv[1:]:
    try:
        os.listdir(path) if os.path.isdir(path) else open(path).close()
    except OSError:
        continue
    print(path)
    break
"""
"""Prints the first of some paths that a program can read."""


def _problem_of_bubblewrap(hidden: Sequence[str], packages: tuple[str, ...]) -> str:
    """Return why bubblewrap isolates nothing here; empty where it does."""
    if shutil.which("bwrap") is None:
        return "bubblewrap is not installed (Debian: apt-get install bubblewrap)"
    seen, error = _probe([*_bubblewrap(packages), "--", _base_python(), "-I", "-S", "-c", IS_SEEN, *hidden], 0)
    if error:
        return f"bubblewrap fails: {error}"
    return f"bubblewrap shows {seen}, which lies among the files of the system" if seen else ""


def _problem_of_user(hidden: Sequence[str]) -> str:
    """Return why another user is no isolation here; empty where it is."""
    seen, error = _probe([_base_python(), "-I", "-S", "-c", IS_SEEN, *hidden], FIRST_USER)
    if error:
        return error
    return f"can read {seen} (chmod -R go-rwx)" if seen else ""


def _probe(command: list[str], user: int) -> tuple[str, str]:
    """Return what a command prints, and its error."""
    try:
        done = subprocess.run(  # noqa: S603 - a command of our own
            command,
            capture_output=True,
            text=True,
            timeout=PROBE_TIME,
            cwd="/",
            env={"LANG": "C.UTF-8"},
            user=user or None,
            group=user or None,
            extra_groups=() if user else None,
            check=False,
        )
    except (OSError, subprocess.SubprocessError) as error:
        return "", str(error)[:200]
    if done.returncode:
        last = (done.stderr.strip().splitlines() or [f"status {done.returncode}"])[-1]
        return "", last[:200]
    return done.stdout.strip(), ""


def _base_python() -> str:
    """Return the interpreter itself, not that of a virtual environment."""
    return os.path.realpath(getattr(sys, "_base_executable", sys.executable))


def _bubblewrap(packages: tuple[str, ...]) -> list[str]:
    """Return bubblewrap with the listed mounts."""
    size = ("--size", str(FOLDER_BYTES))
    return [
        *("bwrap", "--unshare-all", "--die-with-parent", "--new-session", "--cap-drop", "ALL"),
        *_system_mounts(),
        *_read_only(package_paths(packages)),
        *("--dev", "/dev", *size, "--tmpfs", "/dev/shm", *size, "--tmpfs", "/tmp", *size, "--tmpfs", str(HOME)),  # noqa: S108
        *("--proc", "/proc"),
    ]


def _system_mounts() -> Iterator[str]:
    """Yield options for the system's libraries and for Python's, without the packages that are installed there."""
    for folder in SYSTEM_FOLDERS:
        path = Path(folder)
        if path.is_symlink():
            yield from ("--symlink", os.readlink(path), folder)  # noqa: PTH115 - as it is written there
        elif path.is_dir():
            yield from ("--ro-bind", folder, folder)
    for name in SYSTEM_FILES:
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


def _read_only(binds: dict[Path, Path]) -> Iterator[str]:
    for outside, inside in binds.items():
        yield from ("--ro-bind", str(outside), str(inside))


@lru_cache(maxsize=16)
def package_paths(names: tuple[str, ...]) -> dict[Path, Path]:
    """Return the files and folders of packages and of those that they need, and where a program finds them.

    Packages that are not installed are left out, and so are folders that several packages share.
    """
    paths: dict[Path, Path] = {}
    waiting, known = list(names), set[str]()
    while waiting:
        name = waiting.pop().lower().replace("_", "-")
        if name in known:
            continue
        known.add(name)
        with suppress(metadata.PackageNotFoundError):
            distribution = metadata.distribution(name)
            requirements = distribution.requires or ()
            # Behind a semicolon stands what extras and other systems need.
            waiting += [_name_of(requirement) for requirement in requirements if ";" not in requirement]
            for top in {file.parts[0] for file in distribution.files or ()}:
                if top not in ("..", "bin", "__pycache__", "cmeel.prefix"):
                    outside = Path(str(distribution.locate_file(top)))
                    if outside.exists():
                        paths[outside.resolve()] = PACKAGE_FOLDER / top
    return paths


def _name_of(requirement: str) -> str:
    """Return the package of a requirement such as ``mpmath<1.4,>=1.1``."""
    end = next((k for k, letter in enumerate(requirement) if not (letter.isalnum() or letter in "-_.")), None)
    return requirement[:end]


# What a program of another user leaves behind


def processes_of(user: int) -> list[psutil.Process]:
    """Return the processes of a user that have not ended."""
    found = []
    for process in psutil.process_iter():
        with suppress(psutil.Error):
            if process.uids().real == user and process.status() != psutil.STATUS_ZOMBIE:
                found.append(process)
    return found


def end_processes_of(user: int) -> None:
    """Kill a user's processes until none is left that could start another."""
    for _ in range(END_ROUNDS):
        left = processes_of(user)
        if not left:
            return
        for process in left:
            with suppress(psutil.Error):
                process.kill()
        time.sleep(0.01)


def remove_files_of(user: int) -> None:
    """Remove the files of a user in the folders to which everybody may write."""
    for folder in ("/tmp", "/var/tmp", "/dev/shm"):  # noqa: S108
        with suppress(OSError):
            for entry in list(os.scandir(folder)):
                if entry.stat(follow_symlinks=False).st_uid != user:
                    continue
                if stat.S_ISDIR(entry.stat(follow_symlinks=False).st_mode):
                    shutil.rmtree(entry.path, ignore_errors=True)
                else:
                    Path(entry.path).unlink(missing_ok=True)
