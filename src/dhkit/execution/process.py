"""A process that runs a program, with threads that read its output and watch its memory and processes."""

from __future__ import annotations

import json
import os
import queue
import select
import signal
import stat
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import psutil

from dhkit.errors import DhkitError
from dhkit.execution.bounds import BOUNDS
from dhkit.execution.isolated_commands import folder_inside, isolated_command
from dhkit.execution.isolation import Isolation, Kind
from dhkit.execution.launcher import MAX_PROCESSES
from dhkit.execution.other_user import end_processes_of, next_user, remove_files_of

HERE = Path(__file__).parent
WAITING_FACTOR = 4.0
"""Longest time on the clock, as a multiple of the limit of processor time.

On a busy machine a process waits for its turns, which must not change what is found; one that sleeps ends all the same.
"""
_EXIT_DELAY = 0.3
"""Longest time from the end of a program's answers to its own end, s."""
_WATCH_PERIOD = 0.05
"""Time between two looks at memory and processes, s."""
_LAST_WORDS_TIME = 1.0
"""Longest time for the printed output of a program that has ended, s: children may hold it open."""
_BLOCK_BYTES = 512
"""Unit of ``st_blocks``."""


class Failure(StrEnum):
    """Kind of failure of a call of a program."""

    RAISED = "raised"
    """The function raised an exception, or returned something else than it must."""
    LATE = "late"
    """The function took too long."""
    MEMORY = "memory"
    """The processes needed too much memory."""
    PROCESSES = "processes"
    """The program started too many processes."""
    FILES = "files"
    """The program wrote too much to files."""
    ENDED = "ended"
    """The process ended."""
    GARBAGE = "garbage"
    """The process wrote something that is not an answer."""
    UNREADABLE = "unreadable"
    """The program cannot be loaded."""


class ProgramError(DhkitError):
    """A call of a program failed.

    Attributes
    ----------
    failure
        How the call failed.
    line
        Line of the program's source, from 1; None if it is not known.
    """

    def __init__(self, text: str, failure: Failure, line: int | None = None) -> None:
        super().__init__(text if line is None else f"line {line}: {text}")
        self.failure = failure
        self.line = line


@dataclass(frozen=True)
class Limits:
    """Limits of a program.

    Attributes
    ----------
    seconds
        Processor time of one call, s; on the clock it may take four times as long.
    memory
        Largest memory of all its processes together, bytes.
    """

    seconds: float = 5.0
    memory: int = 1 << 30


class CallTime:
    """Time that a call has taken.

    Parameters
    ----------
    process
        The process that is called.
    seconds
        Limit of its processor time, s.
    """

    def __init__(self, process: Process, seconds: float) -> None:
        self.seconds = seconds
        self._process = process
        self._begun = time.monotonic()
        self._processor_begun = process.processor_time

    @property
    def on_the_clock(self) -> float:
        """Time since the call began, s."""
        return time.monotonic() - self._begun

    def left(self) -> float:
        """Return the shortest time after which the call may be late, s; 0 where it is late."""
        on_the_clock = WAITING_FACTOR * self.seconds - self.on_the_clock
        processor = self.seconds - (self._process.processor_time - self._processor_begun)
        return max(0.0, min(on_the_clock, processor))

    @property
    def late(self) -> str:
        """Message on a call that is late."""
        if self.on_the_clock < WAITING_FACTOR * self.seconds:
            return f"no answer within {self.seconds:g} s of processor time"
        return f"no answer within {WAITING_FACTOR * self.seconds:g} s"


class Process:
    """A process that runs a program.

    Parameters
    ----------
    command
        Called with the program's folder on this system, into which it copies the program's files; returns what is
        executed, with paths as the program sees them.
    limits
        Limits of the program.
    isolation
        Isolation of the program: files and resources that it can use.
    shown
        Further files that the program may read, at their own paths.
    """

    def __init__(
        self,
        command: Callable[[Path], list[str]],
        limits: Limits,
        isolation: Isolation,
        shown: Iterable[Path] = (),
    ) -> None:
        self.failure: Failure | None = None
        self._limits = limits
        self._user = next_user() if isolation.kind is Kind.USER else 0
        self._has_own_root = isolation.kind is Kind.BUBBLEWRAP
        self._folder = tempfile.TemporaryDirectory(
            prefix="dhkit-program-", ignore_cleanup_errors=True
        )
        try:
            self._start(command, isolation, shown)
        except BaseException:
            self._folder.cleanup()
            raise
        self.processor_time = 0.0
        """Processor time of all processes of the program, when the watch last looked, s."""
        self._descendants: dict[int, psutil.Process] = {}
        self._processor_times: dict[int, float] = {}
        self._lines: queue.Queue[bytes | None] = queue.Queue(BOUNDS.unread_answers)
        self._output = bytearray()
        self._drained = threading.Event()
        """Set at the end of the printed output."""
        self._closed = threading.Event()
        self._count = 0
        self._threads = [
            threading.Thread(
                target=work, name=f"dhkit-program-{work.__name__.strip('_')}", daemon=True
            )
            for work in (self._receive, self._drain, self._watch)
        ]
        for thread in self._threads:
            thread.start()

    def next_number(self) -> int:
        """Return the number of the next request."""
        self._count += 1
        return self._count

    def write(self, line: bytes, call: CallTime) -> None:
        """Send a request; to a process that has ended, nothing is sent.

        Raises
        ------
        ProgramError
            The request is not read in time.
        """
        with suppress(BrokenPipeError):
            while line:
                left = call.left()
                if left == 0:
                    raise self._error(Failure.LATE, call)
                if select.select([], [self._requests], [], left)[1]:
                    with suppress(BlockingIOError):
                        line = line[os.write(self._requests, line) :]

    def read(self, call: CallTime) -> dict[str, object]:
        """Return the next answer to a call.

        Raises
        ------
        ProgramError
            The answer does not come in time or is not a JSON object, or the process has ended.
        """
        line = self._next_line(call)
        if line is None:
            raise self._error(Failure.ENDED, call)
        try:
            message = json.loads(line)
        except (ValueError, RecursionError):
            message = None
        if not isinstance(message, dict):
            raise self._error(Failure.GARBAGE, call)
        return message

    def _next_line(self, call: CallTime) -> bytes | None:
        """Return the next line of the answers; None if no more come."""
        while True:
            left = call.left()
            try:
                return self._lines.get(timeout=left)
            except queue.Empty:
                if left == 0:
                    raise self._error(Failure.LATE, call) from None

    def output(self) -> str:
        """Return the last part of the printed output."""
        return bytes(self._output).decode("utf-8", "replace")

    def close(self) -> None:
        """End the process and all processes that it started, and wait until they are gone."""
        if self._closed.is_set():
            return
        self.failure = self.failure or Failure.ENDED
        self._closed.set()
        self._kill()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(BOUNDS.end_time)
        os.close(self._requests)
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(BOUNDS.end_time)
        if self._user:
            remove_files_of(self._user)
        self._folder.cleanup()

    def _start(
        self, command: Callable[[Path], list[str]], isolation: Isolation, shown: Iterable[Path]
    ) -> None:
        folder = Path(self._folder.name).resolve()
        program = isolated_command(isolation, command(folder), folder, shown)
        if self._user:
            for path in (folder, *folder.rglob("*")):
                os.chown(path, self._user, self._user, follow_symlinks=False)
        requests, self._requests = os.pipe()
        os.set_blocking(self._requests, False)
        self._answers, answers = os.pipe()
        try:
            self._process = subprocess.Popen(  # noqa: S603 - this module is made to run programs of others
                [
                    *(sys.executable, "-I", "-S", str(HERE / "launcher.py")),
                    *map(str, (requests, answers, 4 * self._limits.memory, self._user)),
                    *program,
                ],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                pass_fds=(requests, answers),
                cwd=folder,
                env=_environment(folder_inside(isolation, folder)),
                start_new_session=True,
            )
        finally:
            os.close(requests)
            os.close(answers)

    def _error(self, failure: Failure, call: CallTime) -> ProgramError:
        """Note a failure, unless another was noted before, and return its error."""
        self.failure = self.failure or failure
        texts: dict[Failure, str] = {
            Failure.LATE: call.late,
            Failure.MEMORY: f"needed more than {self._limits.memory / (1 << 30):.3g} GB of memory",
            Failure.PROCESSES: f"started more than {MAX_PROCESSES} processes",
            Failure.FILES: f"wrote more than {BOUNDS.written_bytes >> 20} MB to files",
            Failure.ENDED: f"the program ended{self._exit_status_text()}",
            Failure.GARBAGE: "wrote something that is not an answer",
        }
        if self.failure is Failure.ENDED:
            # Its last words may come after the news of its end.
            self._drained.wait(_LAST_WORDS_TIME)
        lines = self.output().strip().splitlines() if self.failure is Failure.ENDED else []
        last_line = f": {printable(lines[-1])[:200]}" if lines else ""
        return ProgramError(texts[self.failure] + last_line, self.failure)

    def _exit_status_text(self) -> str:
        """Return the status or the signal that the program ended with, as text; empty if it still runs."""
        with suppress(subprocess.TimeoutExpired):
            status = self._process.wait(_EXIT_DELAY)
            # Bubblewrap tells a signal as a shell does.
            number = -status if status < 0 else status - 128
            if number > 0:
                with suppress(ValueError):
                    return f" by {signal.Signals(number).name}"
            return f" with status {status}"
        return ""

    def _receive(self) -> None:
        """Queue the lines of answers; a line that is too long, or too many of them, ends the process."""
        with os.fdopen(self._answers, "rb") as file:
            while line := file.readline(BOUNDS.answer_bytes):
                if self._has_own_root:
                    self._folder.cleanup()  # what is mounted from it stays; nothing is left even if dhkit is killed
                try:
                    self._lines.put_nowait(line if line.endswith(b"\n") else b"")
                except queue.Full:
                    self._terminate(Failure.GARBAGE)
                    break
        # The process has closed its answers: no more come, whether or not it goes on.
        while True:
            with suppress(queue.Full):
                self._lines.put_nowait(None)
                return
            with suppress(queue.Empty):
                self._lines.get_nowait()  # of a flood, which nobody reads

    def _drain(self) -> None:
        """Read the printed output, and keep its end."""
        stream = self._process.stdout
        assert stream is not None  # noqa: S101 - for mypy: it is a pipe
        with stream:
            while piece := os.read(stream.fileno(), BOUNDS.output_bytes):
                self._output += piece
                del self._output[: -BOUNDS.output_bytes]
        self._drained.set()

    def _watch(self) -> None:
        """Watch processor time, memory, number and files of the processes, and end the process beyond its limits."""
        while not self._closed.wait(_WATCH_PERIOD):
            self._find_descendants()
            memory = 0
            for process in list(self._descendants.values()):
                try:
                    memory += process.memory_info().rss
                    times = process.cpu_times()
                    self._processor_times[process.pid] = times.user + times.system
                except psutil.Error:
                    self._descendants.pop(process.pid, None)
            self.processor_time = sum(self._processor_times.values())
            if memory > self._limits.memory:
                self._terminate(Failure.MEMORY)
            elif len(self._descendants) > MAX_PROCESSES:
                self._terminate(Failure.PROCESSES)
            elif (
                _written_bytes(Path(self._folder.name), list(self._descendants))
                > BOUNDS.written_bytes
            ):
                self._terminate(Failure.FILES)

    def _find_descendants(self) -> None:
        """Note the processes that the program has started; the first is the program itself, or bubblewrap."""
        with suppress(psutil.Error):
            own = psutil.Process(self._process.pid)
            for process in (own, *own.children(recursive=True)):
                self._descendants.setdefault(process.pid, process)

    def _terminate(self, failure: Failure) -> None:
        self.failure = self.failure or failure
        self._kill()

    def _kill(self) -> None:
        """Kill the program and all that it started.

        With bubblewrap all end with the first. Those of another user are found by it. Otherwise a process that has left
        its family before anybody saw it lives on.
        """
        self._find_descendants()
        with suppress(OSError):
            os.killpg(self._process.pid, signal.SIGKILL)
        for process in list(self._descendants.values()):
            with suppress(psutil.Error):
                process.kill()
        if self._user:
            end_processes_of(self._user)


def _written_bytes(folder: Path, processes: Sequence[int]) -> int:
    """Return the size of a program's files on disk and in memory, bytes.

    Those without a name, which were deleted while open or are in memory (Linux: ``memfd_create``), are found in /proc.
    """
    total = 0
    for place, folders, names in os.walk(folder):
        for name in (*folders, *names):
            with suppress(OSError):
                total += _BLOCK_BYTES * os.lstat(os.path.join(place, name)).st_blocks  # noqa: PTH118 - many files
    unnamed: dict[tuple[int, int], int] = {}
    for pid in processes:
        with suppress(OSError):
            for descriptor in os.listdir(f"/proc/{pid}/fd"):  # noqa: PTH208 - names alone
                with suppress(OSError):
                    status = os.stat(f"/proc/{pid}/fd/{descriptor}")  # noqa: PTH116 - many files
                    if stat.S_ISREG(status.st_mode) and status.st_nlink == 0:
                        unnamed[status.st_dev, status.st_ino] = _BLOCK_BYTES * status.st_blocks
    return total + sum(unnamed.values())


def printable(text: str) -> str:
    """Return a program's text with spaces for unprintable characters, which a terminal may take as commands."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def _environment(folder: Path) -> dict[str, str]:
    """Return the environment of a program, which has none of our variables."""
    threads = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    paths = {"HOME": str(folder), "TMPDIR": str(folder), "PATH": "/usr/local/bin:/usr/bin:/bin"}
    return {"LANG": "C.UTF-8"} | paths | dict.fromkeys(threads, "1")
