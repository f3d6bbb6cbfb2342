"""A program that somebody else wrote, called through lines of JSON in a process of its own."""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dhkit.description import Array
from dhkit.display import repr_line
from dhkit.programs.process import HERE, Limits, Process, ProgramError, printable

if TYPE_CHECKING:
    from dhkit.control import Setpoint

FUNCTIONS = ("fk", "ik", "controller")
"""What a program may define."""
LARGEST_SOURCE = 1_000_000
"""Bytes of a source file."""
MOST_SOLUTIONS = 64
"""Of a pose: no arm of six joints has more than 16."""
LONGEST_START = 30.0
"""s from the start to the first line: importing numpy on a busy machine takes some."""


class Program:
    """A program that is started when it is first called, and again after it failed in a way that ended it.

    Parameters
    ----------
    source
        A ``.py`` or ``.m`` file with functions of :data:`FUNCTIONS`; or a command and its arguments, which speak the
        protocol of docs/own-code.md on their descriptors 3 and 4. No shell reads them.
    limits
        What it may take.
    sandbox
        ``"bwrap"`` runs it in bubblewrap: without a network, and with nothing writable but a folder of its own.

    Raises
    ------
    ProgramError
        The file cannot be read, or what runs it is not installed.
    """

    def __init__(
        self, source: str | Path | Sequence[str], limits: Limits | None = None, sandbox: str | None = None
    ) -> None:
        if os.name != "posix":
            raise ProgramError("programs run on Linux and macOS alone", "unreadable")
        self.limits = limits or Limits()
        source = Path(source) if isinstance(source, str) else source
        self.name = source.name if isinstance(source, Path) else source[0]
        self.functions: tuple[str, ...] = ()
        self.imported: tuple[str, ...] = ()
        """Modules that it was asked not to import, and did: ``dhkit``."""
        self._source, self._sandbox = source, sandbox
        self._process: Process | None = None
        self._lock = threading.Lock()
        self._closed = False

    def start(self) -> None:
        """Start the program, unless it runs, and wait until it says which functions it has.

        Raises
        ------
        ProgramError
            It cannot be loaded.
        """
        with self._lock:
            self._started()

    def call(self, function: str, **arguments: Any) -> Any:
        """Return what a function gives: nested lists of floats, None for NaN and infinity.

        Parameters
        ----------
        function
            One of :attr:`functions`.
        arguments
            Numbers, nested lists of numbers, or dicts of such, in the order in which the function takes them.

        Raises
        ------
        ProgramError
            It failed; where its process has ended or is not to be trusted any more, the next call starts another.
        """
        with self._lock:
            running = self._started()
            if function not in self.functions:
                raise ProgramError(f"{self.name} has no function {function}", "unreadable")
            answer = self._asked(running, {"call": function, "arguments": arguments})
        if "error" in answer:
            raise ProgramError(_text(answer["error"]), "raised", _line(answer))
        if "value" not in answer:
            raise ProgramError("an answer without a value", "garbage")
        return answer["value"]

    def fk(self, q: Array) -> Array:
        """Return the pose that the program gives for joint values, shape (n,), as shape (4, 4).

        Raises
        ------
        ProgramError
            It failed, or gave something else.
        """
        T = _numbers("fk", self.call("fk", q=q.tolist()))
        if T.shape != (4, 4):
            raise ProgramError(f"fk returned shape {T.shape}; expected (4, 4)", "raised")
        if not np.isfinite(T).all():
            raise ProgramError("fk returned NaN or infinity", "raised")
        return T

    def ik(self, T: Array, n: int) -> Array:
        """Return the solutions that the program gives for a pose, shape (4, 4), as shape (B, n); rows may hold NaN.

        Raises
        ------
        ProgramError
            It failed, or gave something else.
        """
        rows = _numbers("ik", self.call("ik", T=T.tolist()))
        if rows.size and (rows.ndim > 2 or rows.shape[-1] != n):
            raise ProgramError(f"ik returned shape {rows.shape}; expected ({n},), or (B, {n})", "raised")
        if rows.size > MOST_SOLUTIONS * n:
            raise ProgramError(f"ik returned {rows.size // n} solutions; expected at most {MOST_SOLUTIONS}", "raised")
        return rows.reshape(-1, n)

    def controller(self, t: float, q: Array, qd: Array, setpoint: Setpoint) -> Array:
        """Return the torques that the program gives: a controller as :meth:`dhkit.Arm.simulate` takes it.

        Raises
        ------
        ProgramError
            It failed, or gave something else.
        """
        wanted = {name: np.asarray(getattr(setpoint, name)).tolist() for name in ("q", "qd", "qdd")}
        torques = self.call("controller", t=float(t), q=q.tolist(), qd=qd.tolist(), setpoint=wanted)
        return _numbers("controller", torques)

    @property
    def output(self) -> str:
        """The last part of what the program has printed."""
        running = self._process
        return "" if running is None else running.output()

    def close(self) -> None:
        """End the program and all that it started, in the middle of a call too; it is not started again."""
        self._closed = True
        self._end(keep=True)
        with self._lock:
            self._end()

    def __enter__(self) -> Program:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return repr_line(f"Program {self.name}", said=", ".join(self.functions) or "not started")

    def _started(self) -> Process:
        if self._closed:
            raise ProgramError(f"{self.name} was closed", "ended")
        running = self._process
        if running is not None and running.failure is None:
            return running
        self._end()
        running = self._process = Process(self._command, self.limits, self._sandbox)
        first = self._answer(running, LONGEST_START, lambda message: "functions" in message or "error" in message)
        if "error" in first:
            self._end()
            raise ProgramError(_text(first["error"]), "unreadable", _line(first))
        functions = first["functions"]
        if not isinstance(functions, list) or not set(map(str, functions)) <= set(FUNCTIONS) or not functions:
            self._end()
            raise ProgramError(f"{self.name} defines none of {', '.join(FUNCTIONS)}", "unreadable")
        self.functions = tuple(map(str, functions))
        return running

    def _asked(self, running: Process, request: dict[str, Any]) -> dict[str, Any]:
        number = running.next_number()
        # Octave reads one character beyond a line: the empty line behind it.
        line, seconds = json.dumps({"id": number, **request}).encode() + b"\n\n", self.limits.seconds
        try:
            running.write(line, time.monotonic() + seconds, seconds)
        except ProgramError:
            self._end(keep=True)
            raise

        # Answers to requests that were given up come late: they are passed over.
        return self._answer(running, seconds, lambda message: message.get("id") == number)

    def _answer(self, running: Process, seconds: float, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        deadline = time.monotonic() + seconds
        while True:
            try:
                message = running.read(deadline, seconds)
            except ProgramError:
                self._end(keep=True)
                raise
            if isinstance(message.get("imported"), list):
                self.imported = tuple(sorted({*self.imported, *map(str, message["imported"])} & {"dhkit"}))
            if wanted(message):
                return message

    def _end(self, keep: bool = False) -> None:
        if self._process is not None:
            self._process.close()
            if not keep:
                self._process = None

    def _command(self, folder: Path) -> list[str]:
        """Return what is executed, with a copy of the source in the program's folder."""
        source = self._source
        if not isinstance(source, Path):
            found = shutil.which(source[0])
            if found is None:
                raise ProgramError(f"{source[0]}: there is no such program", "unreadable")
            return [found, *source[1:]]
        try:
            if not source.is_file():
                raise ProgramError(f"{source}: expected a file", "unreadable")
            if source.stat().st_size > LARGEST_SOURCE:
                raise ProgramError(f"{source}: expected at most {LARGEST_SOURCE} bytes", "unreadable")
            copy = folder / source.name
            copy.write_bytes(source.read_bytes())
        except OSError as error:
            raise ProgramError(f"{source}: {error.strerror}", "unreadable") from None
        if source.suffix == ".py":
            return [sys.executable, "-I", "-B", "-u", str(HERE / "python_runner.py"), str(copy)]
        if source.suffix == ".m":
            octave = shutil.which("octave-cli") or shutil.which("octave")
            if octave is None:
                raise ProgramError(f"{source.name}: GNU Octave, which runs .m files, is not installed", "unreadable")
            return [octave, "--no-gui", "--quiet", "--norc", "--no-history", str(HERE / "octave_runner.m"), str(copy)]
        raise ProgramError(f"{source}: expected a .py or .m file", "unreadable")


def protect_from_children() -> None:
    """Keep processes of the same user from reading this one's memory and environment (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(4, 0, 0, 0, 0)  # PR_SET_DUMPABLE


def _numbers(function: str, value: Any) -> Array:
    """Return an answer as an array, null as NaN."""
    try:
        return np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise ProgramError(f"{function} returned what is no array of numbers", "raised") from None


def _text(error: Any) -> str:
    return " ".join(printable(str(error)).split())[:500] or "failed"


def _line(message: dict[str, Any]) -> int | None:
    line = message.get("line")
    return line if isinstance(line, int) and not isinstance(line, bool) and 0 < line < 10**7 else None
