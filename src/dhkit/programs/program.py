"""A program of another person, called through lines of JSON in a process of its own."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dhkit.description import Array
from dhkit.display import repr_line
from dhkit.execution.child import FUNCTION_RUNNERS, Child
from dhkit.execution.isolation import Isolation, find_isolation
from dhkit.execution.process import Failure, Limits, ProgramError
from dhkit.programs.bounds import BOUNDS

if TYPE_CHECKING:
    from dhkit.control import Setpoint

FUNCTIONS = ("fk", "ik", "controller")
"""Functions that a program may define."""


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
        Isolation of the program; by default the best that works on this system, or none.

    Raises
    ------
    ProgramError
        The file cannot be read, or the interpreter is not installed.
    """

    def __init__(
        self,
        source: str | Path | Sequence[str],
        limits: Limits | None = None,
        isolation: Isolation | None = None,
    ) -> None:
        self.limits = limits or Limits()
        self.isolation = find_isolation() if isolation is None else isolation
        self._child = Child(
            Path(source) if isinstance(source, str) else source,
            FUNCTION_RUNNERS,
            self.limits,
            self.isolation,
        )
        self.name = self._child.name
        self.functions: tuple[str, ...] = ()

    def start(self) -> None:
        """Start the program, unless it runs, and wait until it has named its functions.

        Raises
        ------
        ProgramError
            The program cannot be loaded.
        """
        functions = self._child.start()["functions"]
        if (
            not isinstance(functions, list)
            or not set(map(str, functions)) <= set(FUNCTIONS)
            or not functions
        ):
            raise self._child.refuse(f"{self.name} defines none of {', '.join(FUNCTIONS)}")
        self.functions = tuple(map(str, functions))

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
        self.start()
        if function not in self.functions:
            raise ProgramError(f"{self.name} has no function {function}", Failure.UNREADABLE)
        answer = self._child.ask({"call": function, "arguments": arguments})
        if "value" not in answer:
            raise ProgramError("an answer without a value", Failure.GARBAGE)
        return answer["value"]

    def fk(self, q: Array) -> Array:
        """Return the program's pose of the tool, shape (4, 4), m, at joint values, shape (n,), rad and m.

        Parameters
        ----------
        q
            Joint values, shape (n,), rad and m.

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

        Parameters
        ----------
        T
            Pose of the tool in the world, shape (4, 4), m.
        n
            Number of joints.

        Raises
        ------
        ProgramError
            The call failed, or returned something else.
        """
        rows = _numbers("ik", self.call("ik", T=T.tolist()))
        if rows.size and (rows.ndim > 2 or rows.shape[-1] != n):
            raise ProgramError(
                f"ik returned shape {rows.shape}; expected ({n},), or (B, {n})", Failure.RAISED
            )
        if rows.size > BOUNDS.solutions * n:
            raise ProgramError(
                f"ik returned {rows.size // n} solutions; expected at most {BOUNDS.solutions}",
                Failure.RAISED,
            )
        return rows.reshape(-1, n)

    def controller(self, t: float, q: Array, qd: Array, setpoint: Setpoint) -> Array:
        """Return the program's torques, N m and N: this is a controller as :meth:`dhkit.Arm.simulate` takes it.

        Raises
        ------
        ProgramError
            The call failed, or returned something else.
        """
        to_follow = {
            name: np.asarray(getattr(setpoint, name)).tolist() for name in ("q", "qd", "qdd")
        }
        torques = self.call(
            "controller", t=float(t), q=q.tolist(), qd=qd.tolist(), setpoint=to_follow
        )
        return _numbers("controller", torques)

    @property
    def imported(self) -> tuple[str, ...]:
        """Modules that it imported although it should not: ``dhkit``."""
        return self._child.imported

    @property
    def output(self) -> str:
        """The last part of the program's printed output."""
        return self._child.output

    @property
    def processor_time(self) -> float:
        """Processor time of all its processes so far, s."""
        return self._child.processor_time

    def close(self) -> None:
        """End the program and all processes that it started, also during a call; it is not started again."""
        self._child.close()

    def __enter__(self) -> Program:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return repr_line(f"Program {self.name}", summary=", ".join(self.functions) or "not started")


def protect_from_children() -> None:
    """Keep processes of the same user from reading this one's memory and environment (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(4, 0, 0, 0, 0)  # PR_SET_DUMPABLE


def _numbers(function: str, value: object) -> Array:
    """Return an answer as an array, in which null is NaN."""
    try:
        return np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise ProgramError(
            f"{function} returned a value that is not an array of numbers", Failure.RAISED
        ) from None
