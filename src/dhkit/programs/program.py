"""A program of another person, called through lines of JSON in a process of its own."""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dhkit.description import Array
from dhkit.display import repr_line
from dhkit.programs.isolated_commands import folder_inside, python_command, runner_inside
from dhkit.programs.isolation import Isolation, find_isolation
from dhkit.programs.process import HERE, CallTime, Failure, Limits, Process, ProgramError, printable

if TYPE_CHECKING:
    from dhkit.control import Setpoint

FUNCTIONS = ("fk", "ik", "controller")
"""Functions that a program may define."""
MAX_SOURCE_BYTES = 1_000_000
MAX_SOLUTIONS = 64
"""Most solutions of a pose: no arm of six joints has more than 16."""
MAX_START_TIME = 30.0
"""Processor time from the start to the first line, s: importing numpy may take some seconds."""


class Program:
    """A program that is started when it is first called, and again after a failure that ended it.

    Isolated, it cannot read dhkit's files. Otherwise :attr:`imported` says whether it imports dhkit: that is a hint,
    since such a program may do anything.

    Parameters
    ----------
    source
        A ``.py`` or ``.m`` file with functions of :data:`FUNCTIONS`; or a command and its arguments, which follows the
        protocol of docs/own-code.md on its descriptors 3 and 4. No shell reads the command.
    limits
        Limits of time and memory.
    isolation
        What the program can see and reach; by default the best that works on this system, or none.

    Raises
    ------
    ProgramError
        The file cannot be read, or the interpreter is not installed.
    """

    def __init__(
        self, source: str | Path | Sequence[str], limits: Limits | None = None, isolation: Isolation | None = None
    ) -> None:
        if os.name != "posix":
            raise ProgramError("programs run on Linux and macOS alone", Failure.UNREADABLE)
        self.limits = limits or Limits()
        source = Path(source) if isinstance(source, str) else source
        self.name = source.name if isinstance(source, Path) else source[0]
        self.functions: tuple[str, ...] = ()
        self.imported: tuple[str, ...] = ()
        """Modules that it imported although it should not: ``dhkit``."""
        self._source = source
        self.isolation = find_isolation() if isolation is None else isolation
        self._process: Process | None = None
        self._lock = threading.Lock()
        self._closed = False
        self._ended_time = 0.0

    def start(self) -> None:
        """Start the program, unless it runs, and wait until it has named its functions.

        Raises
        ------
        ProgramError
            The program cannot be loaded.
        """
        with self._lock:
            self._running_process()

    def call(self, function: str, **arguments: object) -> object:
        """Return the value of a function: nested lists of floats, in which None stands for NaN and infinity.

        Parameters
        ----------
        function
            Name of the function, one of :attr:`functions`.
        arguments
            Numbers, nested lists of numbers, or dicts of such, in the order in which the function takes them.

        Raises
        ------
        ProgramError
            The call failed. If the process has ended or cannot be trusted any more, the next call starts another.
        """
        with self._lock:
            answer = self._answer_to(function, arguments)
        if "error" in answer:
            raise ProgramError(_text(answer["error"]), Failure.RAISED, _line(answer))
        if "value" not in answer:
            raise ProgramError("an answer without a value", Failure.GARBAGE)
        return answer["value"]

    def fk(self, q: Array) -> Array:
        """Return the program's pose of the tool, shape (4, 4), m, at joint values, shape (n,), rad and m.

        Raises
        ------
        ProgramError
            The call failed, or returned something else.
        """
        T = _numbers("fk", self.call("fk", q=q.tolist()))
        if T.shape != (4, 4):
            raise ProgramError(f"fk returned shape {T.shape}; expected (4, 4)", Failure.RAISED)
        if not np.isfinite(T).all():
            raise ProgramError("fk returned NaN or infinity", Failure.RAISED)
        return T

    def ik(self, T: Array, n: int) -> Array:
        """Return the program's solutions, shape (B, n), rad and m, of a pose, shape (4, 4), m; rows may have NaN.

        Raises
        ------
        ProgramError
            The call failed, or returned something else.
        """
        rows = _numbers("ik", self.call("ik", T=T.tolist()))
        if rows.size and (rows.ndim > 2 or rows.shape[-1] != n):
            raise ProgramError(f"ik returned shape {rows.shape}; expected ({n},), or (B, {n})", Failure.RAISED)
        if rows.size > MAX_SOLUTIONS * n:
            raise ProgramError(
                f"ik returned {rows.size // n} solutions; expected at most {MAX_SOLUTIONS}", Failure.RAISED
            )
        return rows.reshape(-1, n)

    def controller(self, t: float, q: Array, qd: Array, setpoint: Setpoint) -> Array:
        """Return the program's torques, N m and N: this is a controller as :meth:`dhkit.Arm.simulate` takes it.

        Raises
        ------
        ProgramError
            The call failed, or returned something else.
        """
        to_follow = {name: np.asarray(getattr(setpoint, name)).tolist() for name in ("q", "qd", "qdd")}
        torques = self.call("controller", t=float(t), q=q.tolist(), qd=qd.tolist(), setpoint=to_follow)
        return _numbers("controller", torques)

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
        """End the program and all processes that it started, also during a call; it is not started again."""
        self._closed = True
        self._end(keep=True)
        with self._lock:
            self._end()

    def __enter__(self) -> Program:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return repr_line(f"Program {self.name}", summary=", ".join(self.functions) or "not started")

    def _running_process(self) -> Process:
        if self._closed:
            raise ProgramError(f"{self.name} was closed", Failure.ENDED)
        running = self._process
        if running is not None and running.failure is None:
            return running
        return self._start()

    def _start(self) -> Process:
        """Start a process, and wait until it has named its functions."""
        self._end()
        running = self._process = Process(self._command, self.limits, self.isolation, self._shown())
        if self._closed:  # meanwhile, by another thread, which has not seen this process
            self._end()
            raise ProgramError(f"{self.name} was closed", Failure.ENDED)
        first = self._read_until(running, MAX_START_TIME, lambda answer: "functions" in answer or "error" in answer)
        if "error" in first:
            self._end()
            raise ProgramError(_text(first["error"]), Failure.UNREADABLE, _line(first))
        functions = first["functions"]
        if not isinstance(functions, list) or not set(map(str, functions)) <= set(FUNCTIONS) or not functions:
            self._end()
            raise ProgramError(f"{self.name} defines none of {', '.join(FUNCTIONS)}", Failure.UNREADABLE)
        self.functions = tuple(map(str, functions))
        return running

    def _answer_to(self, function: str, arguments: dict[str, object]) -> dict[str, object]:
        running = self._running_process()
        if function not in self.functions:
            raise ProgramError(f"{self.name} has no function {function}", Failure.UNREADABLE)
        request = {"call": function, "arguments": arguments}
        number = running.next_number()
        # Octave reads one character beyond a line, here of the empty line behind it.
        line = json.dumps({"id": number, **request}).encode() + b"\n\n"
        try:
            running.write(line, CallTime(running, self.limits.seconds))
        except ProgramError:
            self._end(keep=True)
            raise

        # Late answers to earlier requests are passed over.
        return self._read_until(running, self.limits.seconds, lambda message: message.get("id") == number)

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
            if source.stat().st_size > MAX_SOURCE_BYTES:
                raise ProgramError(f"{source}: expected at most {MAX_SOURCE_BYTES} bytes", Failure.UNREADABLE)
            (folder / source.name).write_bytes(source.read_bytes())
        except OSError as error:
            raise ProgramError(f"{source}: {error.strerror}", Failure.UNREADABLE) from None
        inside = str(folder_inside(self.isolation, folder) / source.name)
        if source.suffix == ".py":
            return [*python_command(self.isolation, HERE / "python_runner.py", folder), inside]
        if source.suffix == ".m":
            octave = shutil.which("octave-cli") or shutil.which("octave")
            if octave is None:
                raise ProgramError(
                    f"{source.name}: GNU Octave, which runs .m files, is not installed", Failure.UNREADABLE
                )
            runner = runner_inside(self.isolation, HERE / "octave_runner.m", folder)
            return [octave, "--no-gui", "--quiet", "--norc", "--no-history", str(runner), inside]
        raise ProgramError(f"{source}: expected a .py or .m file", Failure.UNREADABLE)


def protect_from_children() -> None:
    """Keep processes of the same user from reading this one's memory and environment (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(4, 0, 0, 0, 0)  # PR_SET_DUMPABLE


def _numbers(function: str, value: object) -> Array:
    """Return an answer as an array, in which null is NaN."""
    try:
        return np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise ProgramError(f"{function} returned what is no array of numbers", Failure.RAISED) from None


def _text(error: object) -> str:
    return " ".join(printable(str(error)).split())[:500] or "failed"


def _line(message: dict[str, object]) -> int | None:
    line = message.get("line")
    return line if isinstance(line, int) and not isinstance(line, bool) and 0 < line < 10**7 else None
