"""Work in a forked process that can harm nobody: without files, and with limits of time and memory."""

from __future__ import annotations

import contextlib
import faulthandler
import math
import os
import select
import signal
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn, TypeAlias

from dhkit.errors import DhkitError
from dhkit.grading.report import GradeReport

Judge: TypeAlias = Callable[[Path], GradeReport]
"""Judges a sheet; what it raises becomes the report's error."""

PIECE = 1 << 18
"""Bytes that are read from a pipe at once."""
MOST_FILES = 65_536
GRACE = 5.0
"""Seconds that a process may outlive its limit: then its parent has died and nobody else ends it."""


@dataclass(frozen=True)
class Limits:
    """What judging a sheet may take.

    Attributes
    ----------
    seconds
        Of the clock.
    memory
        Bytes.
    """

    seconds: float
    memory: int

    @property
    def late(self) -> str:
        """What is said of a sheet that takes longer."""
        return f"took longer than {self.seconds:g} s"

    @property
    def starved(self) -> str:
        """What is said of a sheet that needs more memory."""
        return f"needed more than {self.memory / 1024**3:.3g} GB"


def judged(path: Path, judge: Judge, limits: Limits) -> bytes:
    """Return a sheet's report as JSON; what the judge raises is its error."""
    starved = _failed(limits.starved)  # made while there is memory
    try:
        return judge(path).to_json().encode("utf-8", "replace")
    except MemoryError:
        return starved
    except DhkitError as error:
        return _failed(str(error))
    except (Exception, SystemExit) as error:
        if "bad_alloc" in str(error):  # what C++ calls it
            return starved
        return _failed(f"{type(error).__name__}: {str(error)[:500]}; please report this")


def _failed(error: str) -> bytes:
    return GradeReport(error=" ".join(error.split())).to_json().encode("utf-8", "replace")


def start_worker(work: Callable[[], bytes], limits: Limits) -> tuple[int, int]:
    """Fork a process that does some work; return its id and the end of a pipe from which to read its result.

    Raises
    ------
    OSError
        No process, or no pipe, is to be had.
    """
    pipe, end = os.pipe()
    try:
        with warnings.catch_warnings():
            # Python 3.12 warns of threads: BLAS has some, and starts its own anew in the child.
            warnings.simplefilter("ignore", DeprecationWarning)
            pid = os.fork()
    except OSError:
        os.close(pipe)
        os.close(end)
        raise
    if pid == 0:
        _run(end, work, limits)
    os.close(end)
    with contextlib.suppress(OSError):  # the child does it too: whoever is first
        os.setpgid(pid, pid)
    return pid, pipe


def result_of(work: Callable[[], bytes], limits: Limits) -> bytes:
    """Return what work in a process of its own gives; in this process where there is no ``os.fork`` (Windows).

    Raises
    ------
    TimeoutError
        It took longer than the limit.
    ChildProcessError
        The process ended without a result.
    OSError
        No process is to be had.
    """
    if not hasattr(os, "fork"):
        return work()
    pid, pipe = start_worker(work, limits)
    received = bytearray()
    deadline = time.monotonic() + limits.seconds
    try:
        while True:
            ready, _, _ = select.select([pipe], [], [], max(0.0, deadline - time.monotonic()))
            if not ready:
                raise TimeoutError(limits.late)
            piece = os.read(pipe, PIECE)
            if not piece:
                break
            received += piece
    finally:
        os.close(pipe)
        kill(pid)
    if not received:
        raise ChildProcessError("the process ended without a result")
    return bytes(received)


def kill(pid: int) -> int:
    """End a process with all that it started, unless it has ended; return its status, below 0 a signal's."""
    with contextlib.suppress(OSError):
        os.killpg(pid, signal.SIGKILL)
    with contextlib.suppress(OSError):
        os.kill(pid, signal.SIGKILL)
    try:
        return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    except ChildProcessError:
        return 0


def _run(end: int, work: Callable[[], bytes], limits: Limits) -> NoReturn:
    """Be the child: work, write the result, and leave without cleaning up what is the parent's."""
    status = 1
    try:
        with contextlib.suppress(OSError):
            os.setpgid(0, 0)
        end = _above_standard(end)
        _close_files(end)
        _limit(limits)
        text = work()
        signal.setitimer(signal.ITIMER_REAL, 0.0)  # the parent may be busy with other reports
        _write(end, text)
        status = 0
    finally:
        os._exit(status)


def _above_standard(end: int) -> int:
    """Return a file's copy above 2: a parent without an input gives the pipe the number 0."""
    import fcntl

    return fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 3)


def _close_files(end: int) -> None:
    """Close all files but the pipe; input and output lead nowhere."""
    faulthandler.disable()  # it would write into whatever file is next to get its number
    nowhere = os.open(os.devnull, os.O_RDWR)
    for standard in (0, 1, 2):
        os.dup2(nowhere, standard)
    os.closerange(3, end)
    os.closerange(end + 1, min(os.sysconf("SC_OPEN_MAX"), MOST_FILES))
    sys.stdin = open(0, closefd=False)  # noqa: SIM115
    sys.stdout = sys.stderr = open(1, "w", closefd=False)  # noqa: SIM115


def _limit(limits: Limits) -> None:
    import resource

    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_REAL, limits.seconds + GRACE)
    seconds = math.ceil(limits.seconds) + 1
    for kind, least, most in (
        (resource.RLIMIT_CORE, 0, 0),
        (resource.RLIMIT_CPU, seconds, seconds + 1),
        (resource.RLIMIT_AS, limits.memory + _addresses(), limits.memory + _addresses()),
    ):
        hard = resource.getrlimit(kind)[1]
        bound = math.inf if hard == resource.RLIM_INFINITY else hard
        with contextlib.suppress(OSError, ValueError):  # macOS knows no limit of addresses
            resource.setrlimit(kind, (int(min(least, bound)), int(min(most, bound))))


def _addresses() -> int:
    """Return how many bytes of addresses are in use: libraries reserve gigabytes that they never touch."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        return 0


def _write(end: int, text: bytes) -> None:
    left = memoryview(text)
    while left:
        left = left[os.write(end, left) :]
