"""A process that runs a program, the threads that read from it, and the one that watches what it takes."""

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
from pathlib import Path
from typing import Any, Literal, TypeAlias

import psutil

from dhkit.errors import DhkitError

HERE = Path(__file__).parent
LONGEST_LINE = 1 << 22
"""Bytes of an answer."""
MOST_LINES = 1_000
"""Answers that nobody has read yet."""
OUTPUT = 1 << 16
"""Bytes that are kept of what a program prints: the last."""
MOST_PROCESSES = 64
MOMENT = 0.3
"""s from the end of a program's answers to its own end."""
PERIOD = 0.05
"""s between two looks at memory and processes."""
LONGEST_END = 5.0
"""s that the supervisor may take to end what a program started."""

Failure: TypeAlias = Literal["raised", "late", "memory", "processes", "ended", "garbage", "unreadable"]
"""How a program fails: its function raised an exception, took too long, the process needed too much memory, started too
many processes, ended, wrote what is no answer, or never became ready."""


class ProgramError(DhkitError):
    """A call of a program that failed.

    Attributes
    ----------
    failure
        How.
    line
        Of the program's source, counted from 1; None where it is not known.
    """

    def __init__(self, text: str, failure: Failure, line: int | None = None) -> None:
        super().__init__(text if line is None else f"line {line}: {text}")
        self.failure: Failure = failure
        self.line = line


@dataclass(frozen=True)
class Limits:
    """What a program may take.

    Attributes
    ----------
    seconds
        Of the clock, for one call.
    memory
        Bytes, of all its processes together.
    """

    seconds: float = 5.0
    memory: int = 1 << 30


class Process:
    """A process, the threads that read from it, and the one that watches what it takes."""

    def __init__(self, command: Callable[[Path], list[str]], limits: Limits, sandbox: str | None) -> None:
        self.failure: Failure | None = None
        self._limits = limits
        self._folder = tempfile.TemporaryDirectory(prefix="dhkit-program-", ignore_cleanup_errors=True)
        try:
            self._start(command, sandbox)
        except BaseException:
            self._folder.cleanup()
            raise
        self._known: dict[int, psutil.Process] = {}
        self._lines: queue.Queue[bytes | None] = queue.Queue(MOST_LINES)
        self._printed = bytearray()
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

    def write(self, line: bytes, deadline: float, seconds: float) -> None:
        """Send a request; to a process that has ended, nothing.

        Raises
        ------
        ProgramError
            It is not read until the deadline, which so many seconds end at.
        """
        with suppress(BrokenPipeError):
            while line:
                left = deadline - time.monotonic()
                if left <= 0 or not select.select([], [self._requests], [], left)[1]:
                    raise self._failed("late", seconds)
                with suppress(BlockingIOError):
                    line = line[os.write(self._requests, line) :]

    def read(self, deadline: float, seconds: float) -> dict[str, Any]:
        """Return the next answer; it must come within so many seconds, which end at the deadline.

        Raises
        ------
        ProgramError
            It does not come in time, is no JSON object, or the process ended.
        """
        try:
            line = self._lines.get(timeout=max(0.0, deadline - time.monotonic()))
        except queue.Empty:
            raise self._failed("late", seconds) from None
        if line is None:
            raise self._failed("ended", seconds)
        try:
            message = json.loads(line)
        except (ValueError, RecursionError):
            message = None
        if not isinstance(message, dict):
            raise self._failed("garbage", seconds)
        return message

    def output(self) -> str:
        """Return the last part of what was printed."""
        return bytes(self._printed).decode("utf-8", "replace")

    def close(self) -> None:
        """End the process and all that it started, and wait until they are gone."""
        if self._closed.is_set():
            return
        self.failure = self.failure or "ended"
        self._closed.set()
        self._look()
        with suppress(OSError):
            self._process.send_signal(signal.SIGTERM)  # the supervisor ends what the program started, and itself
        try:
            self._process.wait(LONGEST_END)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        # What was seen and is still there: its supervisor was killed by the program.
        self._kill_known()
        os.close(self._requests)
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(LONGEST_END)
        self._folder.cleanup()

    def _start(self, command: Callable[[Path], list[str]], sandbox: str | None) -> None:
        folder = Path(self._folder.name).resolve()
        program = _sandboxed(command(folder), folder, sandbox)
        requests, self._requests = os.pipe()
        os.set_blocking(self._requests, False)
        self._answers, answers = os.pipe()
        try:
            self._process = subprocess.Popen(  # noqa: S603 - a program of others is what it is for
                [
                    *(sys.executable, "-I", "-S", str(HERE / "supervisor.py")),
                    *map(str, (requests, answers, 4 * self._limits.memory)),
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

    def _failed(self, how: Failure, seconds: float) -> ProgramError:
        self.failure = self.failure or how
        texts: dict[Failure, str] = {
            "late": f"no answer within {seconds:g} s",
            "memory": f"needed more than {self._limits.memory / (1 << 30):.3g} GB of memory",
            "processes": f"started more than {MOST_PROCESSES} processes",
            "ended": f"the program ended{self._status()}",
            "garbage": "wrote what is no answer",
        }
        printed = self.output().strip().splitlines() if self.failure == "ended" else []
        said = f": {printable(printed[-1])[:200]}" if printed else ""
        return ProgramError(texts[self.failure] + said, self.failure)

    def _status(self) -> str:
        """Return with which status the program ended, in words; nothing where it still runs."""
        with suppress(subprocess.TimeoutExpired):
            status = self._process.wait(MOMENT)
            if status > 128:
                with suppress(ValueError):
                    return f" by {signal.Signals(status - 128).name}"
            return f" with status {status}"
        return ""

    def _receive(self) -> None:
        """Take the answers' lines; a line that is too long, or nobody reads, ends the process."""
        with os.fdopen(self._answers, "rb") as file:
            while line := file.readline(LONGEST_LINE):
                try:
                    self._lines.put_nowait(line if line.endswith(b"\n") else b"")
                except queue.Full:
                    self._give_up("garbage")
                    break
        # It has closed its answers: nothing comes any more, whether or not the process goes on.
        with suppress(queue.Full):
            self._lines.put_nowait(None)

    def _drain(self) -> None:
        """Take what is printed, and keep its end."""
        stream = self._process.stdout
        assert stream is not None  # noqa: S101 - for mypy: it is a pipe
        with stream:
            while piece := os.read(stream.fileno(), OUTPUT):
                self._printed += piece
                del self._printed[:-OUTPUT]

    def _watch(self) -> None:
        """Look at memory and number of processes."""
        while not self._closed.wait(PERIOD):
            self._look()
            memory = 0
            for process in list(self._known.values()):
                try:
                    memory += process.memory_info().rss
                except psutil.Error:
                    self._known.pop(process.pid, None)
            if (self._process.poll() or 0) < 0:  # the program has killed its supervisor
                self.failure = self.failure or "ended"
                self._kill_known()
            elif memory > self._limits.memory:
                self._give_up("memory")
            elif len(self._known) > MOST_PROCESSES:
                self._give_up("processes")

    def _look(self) -> None:
        """Note the processes that there are."""
        with suppress(psutil.Error):
            for process in psutil.Process(self._process.pid).children(recursive=True):
                self._known.setdefault(process.pid, process)

    def _kill_known(self) -> None:
        for process in list(self._known.values()):
            with suppress(psutil.Error):
                process.kill()

    def _give_up(self, how: Failure) -> None:
        self.failure = self.failure or how
        with suppress(OSError):
            self._process.send_signal(signal.SIGTERM)


def printable(text: str) -> str:
    """Return a program's text without characters that a terminal takes as commands."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def _environment(folder: Path) -> dict[str, str]:
    """Return the variables that a program gets: none of ours."""
    threads = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    paths = {"HOME": str(folder), "TMPDIR": str(folder), "PATH": "/usr/local/bin:/usr/bin:/bin"}
    return {"LANG": "C.UTF-8"} | paths | dict.fromkeys(threads, "1")


def _sandboxed(program: list[str], folder: Path, sandbox: str | None) -> list[str]:
    if sandbox is None:
        return program
    if sandbox != "bwrap":
        raise ProgramError(f"sandbox {sandbox!r}: expected 'bwrap'", "unreadable")
    bwrap = shutil.which("bwrap")
    if bwrap is None:
        raise ProgramError("bwrap is not installed (Debian: apt-get install bubblewrap)", "unreadable")
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
