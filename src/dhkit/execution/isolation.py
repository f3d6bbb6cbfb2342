"""Isolation of other people's programs: the files, the network and the resources that they can use.

Isolated by bubblewrap, a program has a root of its own: the system's libraries, Python's own library and a folder with
the allowed packages alone for reading, and a folder of bounded size for writing, which vanishes with it. It has no
network, and all its processes end with the first. dhkit, Pinocchio, the task and the results are not there.

In a container whose root may not make namespaces, the program runs as a user without a name who can read none of these
files. Whether either works is tried before a program is run. Otherwise the program is not isolated, can do everything
that this user can, and may be run only by its own author.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from pathlib import Path

from dhkit.display import repr_line
from dhkit.errors import DhkitError
from dhkit.execution.bubblewrap import base_python, bubblewrap, package_paths
from dhkit.execution.other_user import FIRST_USER

PACKAGES = ("numpy", "scipy", "sympy", "casadi")
"""Packages that programs may import, unless a task names others."""
_PROBE_TIME = 20.0
"""Longest time of the attempt to isolate a program, s."""


class Kind(Enum):
    """Means that keeps a program from everything but its own folder."""

    BUBBLEWRAP = "isolated by bubblewrap"
    USER = "isolated as another user, with the network"
    NONE = "not isolated"


@dataclass(frozen=True)
class Isolation:
    """Isolation in which programs are run.

    Attributes
    ----------
    kind
        Means that keeps them from everything but their folder.
    reason
        Reason why programs are not isolated; empty if they are.
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

    def __repr__(self) -> str:
        return repr_line("Isolation", self.kind.value, ", ".join(self.packages))


class IsolationError(DhkitError):
    """A program that must be isolated cannot be isolated on this system."""


def find_isolation(
    hidden: Iterable[Path] = (), packages: Sequence[str] = (), *, required: bool = False
) -> Isolation:
    """Return the best isolation that works on this system.

    Parameters
    ----------
    hidden
        Files and folders that a program must not read, beside dhkit itself: task, rubric, results.
    packages
        Packages that it may import, with those that they need; :data:`PACKAGES` where none are named.
    required
        Whether programs of others are to be run, which must be isolated.

    Returns
    -------
    Isolation
        How programs are run; false in a condition where they are not isolated.

    Raises
    ------
    IsolationError
        It is required, and none works.

    Examples
    --------
    >>> isolation = find_isolation()
    >>> bool(isolation) or "not isolated" in str(isolation)
    True
    """
    reference = importlib.util.find_spec("pinocchio")
    folders = [
        Path(__file__).parents[1],
        *(Path(x) for x in (reference and reference.submodule_search_locations) or ()),
    ]
    unseen = tuple(str(path.resolve()) for path in (*folders, *hidden))
    named = packages or PACKAGES
    needed = tuple(dict.fromkeys(("numpy", *named)))  # the runner needs numpy
    found = _probed(unseen, needed, os.geteuid())
    if required and not found:
        reason = f"programs of others are run only where they can be isolated: {found.reason}"
        raise IsolationError(reason)
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
    problem = _problem_of_user(hidden, [str(path) for path in package_paths(packages)])
    if not problem:
        return Isolation(Kind.USER, reason, packages)
    return Isolation(Kind.NONE, f"{reason}; as another user: {problem}", packages)


_WHAT_IS_SEEN = """
import os, sys
for path in sys.argv[1:]:
    try:
        os.listdir(path) if os.path.isdir(path) else open(path).close()
    except OSError:
        continue
    print(path)
"""
"""Prints those of some paths that a program can read, a line each."""


def _problem_of_bubblewrap(hidden: Sequence[str], packages: tuple[str, ...]) -> str:
    """Return why bubblewrap isolates nothing here; empty where it does."""
    if shutil.which("bwrap") is None:
        return "bubblewrap is not installed (Debian: apt-get install bubblewrap)"
    seen, error = _probe(
        [*bubblewrap(packages), "--", base_python(), "-I", "-S", "-c", _WHAT_IS_SEEN, *hidden], 0
    )
    if error:
        return f"bubblewrap fails: {error}"
    return f"bubblewrap shows {seen[0]}, which lies among the files of the system" if seen else ""


def _problem_of_user(hidden: Sequence[str], needed: Sequence[str]) -> str:
    """Return why another user does not isolate here, or cannot read the packages it needs; empty where it works."""
    seen, error = _probe(
        [base_python(), "-I", "-S", "-c", _WHAT_IS_SEEN, *hidden, *needed], FIRST_USER
    )
    if error:
        return error
    for path in hidden:
        if path in seen:
            return f"can read {path} (chmod -R go-rwx)"
    for path in needed:
        if path not in seen:
            return f"cannot read {path} (install dhkit in a folder that every user may enter)"
    return ""


def _probe(command: list[str], user: int) -> tuple[list[str], str]:
    """Return the lines that a command prints, and its error."""
    try:
        done = subprocess.run(  # noqa: S603 - a command of our own
            command,
            capture_output=True,
            text=True,
            timeout=_PROBE_TIME,
            cwd="/",
            env={"LANG": "C.UTF-8"},
            user=user or None,
            group=user or None,
            extra_groups=() if user else None,
            check=False,
        )
    except (OSError, subprocess.SubprocessError) as error:
        return [], str(error)[:200]
    if done.returncode:
        last = (done.stderr.strip().splitlines() or [f"status {done.returncode}"])[-1]
        return [], last[:200]
    return done.stdout.splitlines(), ""
