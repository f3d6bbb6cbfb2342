"""A file or command of another person, which is asked through lines of JSON in a process of its own."""

from __future__ import annotations

import json
import os
import shutil
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from dhkit.execution.bounds import BOUNDS
from dhkit.execution.isolated_commands import folder_inside, python_command, runner_inside
from dhkit.execution.isolation import Isolation
from dhkit.execution.process import (
    HERE,
    CallTime,
    Failure,
    Limits,
    Process,
    ProgramError,
    printable,
)

FUNCTION_RUNNERS = {".py": "python_runner.py", ".m": "octave_runner.m"}
"""Runners that call a file's functions with numbers."""


class Child:
    """A file or command that is started when it is first asked, and again after a failure that ended it.

    Parameters
    ----------
    source
        A file, or a command and its arguments.
    runners
        File of this package that runs a source, by the source's suffix.
    limits
        Limits of time and memory.
    isolation
        Isolation of the program: files and resources that it can use.

    Attributes
    ----------
    first
        The first line of the process that runs, or of the last one.
    imported
        Modules that the program imported although it should not: ``dhkit``.
    """

    def __init__(
        self,
        source: Path | Sequence[str],
        runners: Mapping[str, str],
        limits: Limits,
        isolation: Isolation,
    ) -> None:
        if os.name != "posix":
            raise ProgramError("programs run on Linux and macOS alone", Failure.UNREADABLE)
        self.name = source.name if isinstance(source, Path) else source[0]
        self.isolation = isolation
        self.limits = limits
        self.first: Mapping[str, object] = {}
        self.imported: tuple[str, ...] = ()
        self._source = source
        self._runners = runners
        self._process: Process | None = None
        self._lock = threading.Lock()
        self._closed = False
        self._ended_time = 0.0

    def start(self) -> Mapping[str, object]:
        """Start the program, unless it runs; return its first line.

        Raises
        ------
        ProgramError
            The program cannot be loaded.
        """
        with self._lock:
            self._running_process()
            return self.first

    def ask(
        self, request: Mapping[str, object], seconds: float | None = None
    ) -> Mapping[str, object]:
        """Return the answer to a request.

        Parameters
        ----------
        request
            Request without its number.
        seconds
            Limit of its processor time, s; by default that of the limits.

        Raises
        ------
        ProgramError
            No answer. If the process has ended or cannot be trusted any more, the next request starts another.
        """
        with self._lock:
            running = self._running_process()
            number = running.next_number()
            limit = self.limits.seconds if seconds is None else seconds
            # Octave reads one character beyond a line, here of the empty line after it.
            line = json.dumps({"id": number, **request}).encode() + b"\n\n"
            try:
                running.write(line, CallTime(running, limit))
            except ProgramError:
                self._end(keep=True)
                raise

            # Late answers to earlier requests are passed over.
            answer = self._read_until(running, limit, lambda message: message.get("id") == number)
        if "error" in answer:
            raise ProgramError(_error_text(answer), Failure.RAISED, _error_line(answer))
        return answer

    @property
    def output(self) -> str:
        """The last part of the program's printed output."""
        running = self._process
        return "" if running is None else running.output()

    @property
    def processor_time(self) -> float:
        """Processor time of all its processes so far, s."""
        running = self._process
        return self._ended_time + (0.0 if running is None else running.processor_time)

    def close(self) -> None:
        """End the program and all processes that it started, also during a request; it is not started again."""
        self._closed = True
        self._end(keep=True)
        with self._lock:
            self._end()

    def refuse(self, reason: str) -> ProgramError:
        """End the process, which cannot be used; return the error that says why."""
        with self._lock:
            self._end()
        return ProgramError(reason, Failure.UNREADABLE)

    def _running_process(self) -> Process:
        if self._closed:
            raise ProgramError(f"{self.name} was closed", Failure.ENDED)
        running = self._process
        if running is not None and running.failure is None:
            return running
        return self._start()

    def _start(self) -> Process:
        """Start a process, and wait for its first line."""
        self._end()
        running = self._process = Process(self._command, self.limits, self.isolation, self._shown())
        if self._closed:  # meanwhile, by another thread, which has not seen this process
            self._end()
            raise ProgramError(f"{self.name} was closed", Failure.ENDED)
        first = self._read_until(
            running, BOUNDS.start_time, lambda answer: "functions" in answer or "error" in answer
        )
        if "error" in first:
            self._end()
            raise ProgramError(_error_text(first), Failure.UNREADABLE, _error_line(first))
        self.first = first
        return running

    def _read_until(
        self, running: Process, seconds: float, is_answer: Callable[[dict[str, object]], bool]
    ) -> dict[str, object]:
        call = CallTime(running, seconds)
        while True:
            try:
                message = running.read(call)
            except ProgramError:
                self._end(keep=True)
                raise
            if message.get("imported") == ["dhkit"]:
                self.imported = ("dhkit",)
            if is_answer(message):
                return message
            if not message.keys() & {"id", "imported"}:
                self._end(keep=True)
                raise ProgramError("wrote something that is not an answer", Failure.GARBAGE)

    def _end(self, keep: bool = False) -> None:
        if self._process is not None:
            self._process.close()
            if not keep:
                self._ended_time += self._process.processor_time
                self._process = None

    def _shown(self) -> Iterator[Path]:
        """Yield the files of a command and its arguments, which it may read where it is isolated."""
        if isinstance(self._source, Path):
            return
        for argument in (shutil.which(self._source[0]) or "", *self._source[1:]):
            path = Path(argument)
            if path.is_absolute() and path.is_file():
                yield path

    def _command(self, folder: Path) -> list[str]:
        """Copy the source into the program's folder, and return the command to execute."""
        source = self._source
        if not isinstance(source, Path):
            executable = shutil.which(source[0])
            if executable is None:
                raise ProgramError(f"{source[0]}: there is no such program", Failure.UNREADABLE)
            return [executable, *source[1:]]
        try:
            if not source.is_file():
                raise ProgramError(f"{source}: expected a file", Failure.UNREADABLE)
            if source.stat().st_size > BOUNDS.source_bytes:
                raise ProgramError(
                    f"{source}: expected at most {BOUNDS.source_bytes} bytes", Failure.UNREADABLE
                )
            (folder / source.name).write_bytes(source.read_bytes())
        except OSError as error:
            raise ProgramError(f"{source}: {error.strerror}", Failure.UNREADABLE) from None
        runner = self._runners.get(source.suffix)
        if runner is None:
            raise ProgramError(
                f"{source}: expected a {' or '.join(self._runners)} file", Failure.UNREADABLE
            )
        inside = str(folder_inside(self.isolation, folder) / source.name)
        if source.suffix == ".py":
            return [*python_command(self.isolation, HERE / runner, folder), inside]
        octave = shutil.which("octave-cli") or shutil.which("octave")
        if octave is None:
            raise ProgramError(
                f"{source.name}: GNU Octave, which runs .m files, is not installed",
                Failure.UNREADABLE,
            )
        script = str(runner_inside(self.isolation, HERE / runner, folder))
        return [octave, "--no-gui", "--quiet", "--norc", "--no-history", script, inside]


def _error_text(answer: Mapping[str, object]) -> str:
    """Return the text of an answer that is an error, in one line."""
    return " ".join(printable(str(answer["error"])).split())[: BOUNDS.error_characters] or "failed"


def _error_line(answer: Mapping[str, object]) -> int | None:
    """Return the line of the source that an answer names; None where it names none."""
    line = answer.get("line")
    return (
        line
        if isinstance(line, int) and not isinstance(line, bool) and 0 < line < BOUNDS.line_number
        else None
    )
