"""Work in a forked process without files, with limits of time and memory.

The library pebble (``ProcessPool.schedule(timeout=...)``) cannot replace this module. It limits time alone, not memory
or the size of a result. The parent unpickles results, so that a worker under the control of an answer could control the
grader; here results are bytes. Its workers are forked ahead, whereas a process here inherits everything derived before
its sheet. Processes that a worker started are not ended with it.
"""

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
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

_PIPE_BYTES = 1 << 18
"""Bytes that are read from a pipe at once."""
_MAX_FILES = 65_536
"""Highest number of a file that is closed in a new process."""
_WAITING_FACTOR = 4.0
"""Longest time on the clock, as a multiple of the limit of processor time.

On a busy machine a process waits for its turns, which must not change what is found; one that sleeps ends all the same.
"""
_GRACE = 5.0
"""Time that a process may outlive its limit, s: its parent has died then and does not end it."""
_TIME_SIGNALS = ("SIGXCPU", "SIGALRM", "SIGPROF")
"""Signals that end a process which exceeds its time."""


@dataclass(frozen=True)
class WorkerLimits:
    """Limits of a process.

    Attributes
    ----------
    seconds
        Processor time, s, and a quarter of the longest time on the clock.
    memory
        Address space beyond what the parent process has, bytes.
    """

    seconds: float
    memory: int

    @property
    def longest(self) -> float:
        """Longest time on the clock, s."""
        return _WAITING_FACTOR * self.seconds

    @property
    def late(self) -> str:
        """Message on a process that exceeds its time."""
        return f"took longer than {self.seconds:g} s"

    @property
    def starved(self) -> str:
        """Message on a process that exceeds its memory."""
        return f"needed more than {self.memory / 1024**3:.3g} GB"


@dataclass(eq=False)
class Worker:
    """A forked process and the pipe from which its result is read.

    Attributes
    ----------
    pid
        Number of the process, and of the process group with all that it starts.
    pipe
        File descriptor to read from.
    begin, deadline
        Start, and latest end, on the clock of :func:`time.monotonic`, s.
    received
        Bytes of the result so far.
    """

    pid: int
    pipe: int
    begin: float
    deadline: float
    received: bytearray = field(default_factory=bytearray)

    def read(self) -> bool:
        """Receive the contents of the pipe; return whether the process has closed it, its result being complete."""
        piece = os.read(self.pipe, _PIPE_BYTES)
        self.received += piece
        return not piece

    def end(self) -> int:
        """Kill the process with all that it started, unless it has ended; return its status, -k for signal k."""
        os.close(self.pipe)
        for kill in (os.killpg, os.kill):
            with contextlib.suppress(OSError):
                kill(self.pid, signal.SIGKILL)
        try:
            return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        except ChildProcessError:
            return 0


def start_worker(work: Callable[[], bytes], limits: WorkerLimits) -> Worker:
    """Fork a process that does some work and writes the result into a pipe.

    Raises
    ------
    OSError
        The system grants no process or no pipe.
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
    with contextlib.suppress(OSError):  # the child does the same: either may be first
        os.setpgid(pid, pid)
    now = time.monotonic()
    return Worker(pid, pipe, now, now + limits.longest)


def result_of(work: Callable[[], bytes], limits: WorkerLimits) -> bytes:
    """Return the result of work in a process of its own; in this process if there is no ``os.fork`` (Windows).

    Raises
    ------
    TimeoutError
        The work took longer than the limit.
    ChildProcessError
        The process ended without a result.
    OSError
        The system grants no process.
    """
    if not hasattr(os, "fork"):
        return work()
    worker = start_worker(work, limits)
    try:
        is_complete = False
        while not is_complete:
            if not select.select(
                [worker.pipe], [], [], max(0.0, worker.deadline - time.monotonic())
            )[0]:
                raise TimeoutError(limits.late)
            is_complete = worker.read()
    finally:
        status = worker.end()
    if is_late(status):
        raise TimeoutError(limits.late)
    if not worker.received:
        raise ChildProcessError("the process ended without a result")
    return bytes(worker.received)


def is_late(status: int) -> bool:
    """Return whether a process exceeded its time, given its status, -k for signal k."""
    return -status in [getattr(signal, name) for name in _TIME_SIGNALS]


def _run(end: int, work: Callable[[], bytes], limits: WorkerLimits) -> NoReturn:
    """Run in the child: work, write the result, and exit without cleaning up resources of the parent."""
    import fcntl

    status = 1
    try:
        with contextlib.suppress(OSError):
            os.setpgid(0, 0)
        # A parent without an input gives the pipe the number 0.
        end = fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 3)
        _close_files(end)
        _set_limits(limits)
        text = memoryview(work())
        for timer in (signal.ITIMER_REAL, signal.ITIMER_PROF):
            signal.setitimer(timer, 0.0)  # the parent may be busy with other reports
        while text:
            text = text[os.write(end, text) :]
        status = 0
    finally:
        os._exit(status)


def _close_files(end: int) -> None:
    """Close all files but the pipe; standard input, output and error lead to the null device."""
    faulthandler.disable()  # it would write into whatever file gets its number next
    null = os.open(os.devnull, os.O_RDWR)
    for standard in (0, 1, 2):
        os.dup2(null, standard)
    os.closerange(3, end)
    os.closerange(end + 1, min(os.sysconf("SC_OPEN_MAX"), _MAX_FILES))
    sys.stdin = open(0, closefd=False)  # noqa: SIM115
    sys.stdout = sys.stderr = open(1, "w", closefd=False)  # noqa: SIM115


def _set_limits(limits: WorkerLimits) -> None:
    import resource

    for number, timer, longest in (
        (signal.SIGALRM, signal.ITIMER_REAL, limits.longest + _GRACE),
        (signal.SIGPROF, signal.ITIMER_PROF, limits.seconds),
    ):
        signal.signal(number, signal.SIG_DFL)
        signal.setitimer(timer, longest)
    seconds = math.ceil(limits.seconds) + 1
    memory = limits.memory + _address_space()
    for kind, soft, hard in (
        (resource.RLIMIT_CORE, 0, 0),
        (resource.RLIMIT_CPU, seconds, seconds + 1),
        (resource.RLIMIT_AS, memory, memory),
    ):
        own = resource.getrlimit(kind)[1]
        bound = math.inf if own == resource.RLIM_INFINITY else own
        with contextlib.suppress(OSError, ValueError):  # macOS has no limit of the address space
            resource.setrlimit(kind, (int(min(soft, bound)), int(min(hard, bound))))


def _address_space() -> int:
    """Return the size of the address space in use, bytes: libraries reserve gigabytes that they never touch."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        return 0
