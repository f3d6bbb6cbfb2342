"""A process that runs a program, with threads that read its output and watch its memory and processes."""

from __future__ import annotations

import json
import os
import queue
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import psutil

from dhkit.errors import DhkitError
from dhkit.grading.isolation import WAITING_FACTOR
from dhkit.programs.confinement import Confinement
from dhkit.programs.files_written import WrittenFiles
from dhkit.programs.orphans import begin_adoption, end_adoption, end_orphans

HERE = Path(__file__).parent
MAX_LINE_BYTES = 1 << 22
"""Largest answer, bytes."""
MAX_UNREAD_ANSWERS = 1_000
"""Most answers that wait to be read."""
MAX_OUTPUT_BYTES = 1 << 16
"""Bytes that are kept of a program's printed output: the last ones."""
MAX_PROCESSES = 64
MAX_WRITTEN_BYTES = 128 << 20
"""Largest size of all files together that a program may write, bytes."""
EXIT_DELAY = 0.3
"""Longest time from the end of a program's answers to its own end, s."""
WATCH_PERIOD = 0.05
"""Time between two looks at memory and processes, s."""
LAST_WORDS_TIME = 1.0
"""Longest time for the printed output of a program that has ended, s: children may hold it open."""
MAX_END_TIME = 5.0
"""Longest time that the supervisor may take to end the processes that a program started, s."""


class Failure(StrEnum):
    """How a call of a program failed."""

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
    """The process wrote something that is no answer."""
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
        self._begun, self._processor_begun = time.monotonic(), process.processor_time

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
        Called with the program's folder; returns what is executed.
    limits
        Limits of the program.
    sandbox
        ``"bwrap"``, or None.
    confinement
        Rights that the program does not have.
    """

    def __init__(
        self, command: Callable[[Path], list[str]], limits: Limits, sandbox: str | None, confinement: Confinement
    ) -> None:
        self.failure: Failure | None = None
        self._limits = limits
        self._folder = tempfile.TemporaryDirectory(prefix="dhkit-program-", ignore_cleanup_errors=True)
        begin_adoption()
        try:
            self._start(command, sandbox, confinement)
        except BaseException:
            end_adoption()
            self._folder.cleanup()
            raise
        self.processor_time = 0.0
        """Processor time of all processes of the program, when the watch last looked, s."""
        self._files = WrittenFiles(Path(self._folder.name))
        self._descendants: dict[int, psutil.Process] = {}
        self._processor_times: dict[int, float] = {}
        self._lines: queue.Queue[bytes | None] = queue.Queue(MAX_UNREAD_ANSWERS)
        self._output = bytearray()
        self._drained = threading.Event()
        """Set at the end of the printed output."""
        self._closed = threading.Event()
        self._count = 0
        self._threads = [
            threading.Thread(target=work, name=f"dhkit-program-{work.__name__.strip('_')}", daemon=True)
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
            The answer does not come in time or is no JSON object, or the process has ended.
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
        self._find_descendants()
        with suppress(OSError):
            self._process.send_signal(signal.SIGTERM)  # the supervisor ends the program's processes and itself
        try:
            self._process.wait(MAX_END_TIME)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._kill_descendants()
        end_adoption()
        os.close(self._requests)
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(MAX_END_TIME)
        self._folder.cleanup()

    def _start(self, command: Callable[[Path], list[str]], sandbox: str | None, confinement: Confinement) -> None:
        folder = Path(self._folder.name).resolve()
        program = _sandboxed(confinement.command(command(folder)), folder, sandbox)
        requests, self._requests = os.pipe()
        os.set_blocking(self._requests, False)
        self._answers, answers = os.pipe()
        try:
            self._process = subprocess.Popen(  # noqa: S603 - this module is made to run programs of others
                [
                    *(sys.executable, "-I", "-S", str(HERE / "supervisor.py")),
                    *map(str, (requests, answers, 4 * self._limits.memory, folder)),
                    *program,
                ],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                pass_fds=(requests, answers),
                cwd=folder,
                env=_environment(folder),
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
            Failure.FILES: f"wrote more than {MAX_WRITTEN_BYTES >> 20} MB to files",
            Failure.ENDED: f"the program ended{self._exit_status_text()}",
            Failure.GARBAGE: "wrote what is no answer",
        }
        if self.failure is Failure.ENDED:
            self._drained.wait(LAST_WORDS_TIME)  # its last words may come after the news of its end
        lines = self.output().strip().splitlines() if self.failure is Failure.ENDED else []
        last_line = f": {printable(lines[-1])[:200]}" if lines else ""
        return ProgramError(texts[self.failure] + last_line, self.failure)

    def _exit_status_text(self) -> str:
        """Return the status or the signal that the program ended with, as text; empty if it still runs."""
        with suppress(subprocess.TimeoutExpired):
            status = self._process.wait(EXIT_DELAY)
            if status > 128:
                with suppress(ValueError):
                    return f" by {signal.Signals(status - 128).name}"
            return f" with status {status}"
        return ""

    def _receive(self) -> None:
        """Queue the lines of answers; a line that is too long, or too many of them, ends the process."""
        with os.fdopen(self._answers, "rb") as file:
            while line := file.readline(MAX_LINE_BYTES):
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
            while piece := os.read(stream.fileno(), MAX_OUTPUT_BYTES):
                self._output += piece
                del self._output[:-MAX_OUTPUT_BYTES]
        self._drained.set()

    def _watch(self) -> None:
        """Watch processor time, memory, number and files of the processes, and end the process beyond its limits."""
        while not self._closed.wait(WATCH_PERIOD):
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
            if (self._process.poll() or 0) < 0:  # the supervisor was killed
                self.failure = self.failure or Failure.ENDED
                self._kill_descendants()
            elif memory > self._limits.memory:
                self._terminate(Failure.MEMORY)
            elif len(self._descendants) > MAX_PROCESSES:
                self._terminate(Failure.PROCESSES)
            elif self._files.size(list(self._descendants), MAX_WRITTEN_BYTES) > MAX_WRITTEN_BYTES:
                self._terminate(Failure.FILES)

    def _find_descendants(self) -> None:
        """Note the processes that the program has started."""
        with suppress(psutil.Error):
            for process in psutil.Process(self._process.pid).children(recursive=True):
                self._descendants.setdefault(process.pid, process)

    def _kill_descendants(self) -> None:
        """Kill the processes that were seen, and all others if the supervisor was killed and has not ended them."""
        for process in list(self._descendants.values()):
            with suppress(psutil.Error):
                process.kill()
        if (self._process.poll() or 0) < 0:
            end_orphans()

    def _terminate(self, failure: Failure) -> None:
        self.failure = self.failure or failure
        with suppress(OSError):
            self._process.send_signal(signal.SIGTERM)


def printable(text: str) -> str:
    """Return a program's text with spaces for unprintable characters, which a terminal may take as commands."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def _environment(folder: Path) -> dict[str, str]:
    """Return the environment of a program, which has none of our variables."""
    threads = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    paths = {"HOME": str(folder), "TMPDIR": str(folder), "PATH": "/usr/local/bin:/usr/bin:/bin"}
    return {"LANG": "C.UTF-8"} | paths | dict.fromkeys(threads, "1")


def _sandboxed(program: list[str], folder: Path, sandbox: str | None) -> list[str]:
    if sandbox is None:
        return program
    if sandbox != "bwrap":
        raise ProgramError(f"sandbox {sandbox!r}: expected 'bwrap'", Failure.UNREADABLE)
    bwrap = shutil.which("bwrap")
    if bwrap is None:
        raise ProgramError("bwrap is not installed (Debian: apt-get install bubblewrap)", Failure.UNREADABLE)
    home = str(Path.home())
    hidden = [part for path in dict.fromkeys((home, "/tmp", "/run")) for part in ("--tmpfs", path)]  # noqa: S108
    needed = dict.fromkeys((sys.prefix, sys.base_prefix, str(HERE)))
    bound = [part for path in needed for part in ("--ro-bind", path, path)]
    return [
        *(bwrap, "--unshare-all", "--die-with-parent", "--new-session", "--ro-bind", "/", "/"),
        *hidden,
        *bound,
        *("--bind", str(folder), str(folder), "--dev", "/dev", "--proc", "/proc", "--chdir", str(folder), "--"),
        *program,
    ]
