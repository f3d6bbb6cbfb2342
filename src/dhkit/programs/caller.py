"""A program's function, called for a score, with its failures counted and its calls timed."""

from __future__ import annotations

import time
from collections import Counter
from typing import Any

from dhkit.description import Array
from dhkit.execution.process import WAITING_FACTOR, Failure, ProgramError
from dhkit.programs.bounds import BOUNDS
from dhkit.programs.program import Program

LENGTH_UNITS = {"mm": 1e3, "cm": 1e2, "inches": 1 / 0.0254}
"""Units of length that programs may use instead of metres, and how many a metre has."""
POSE_TOLERANCE = 1e-6
"""Largest difference of poses that agree: entries of rotations, and positions as shares of the arm's reach."""
_FATAL = {
    Failure.LATE,
    Failure.MEMORY,
    Failure.PROCESSES,
    Failure.FILES,
    Failure.ENDED,
    Failure.GARBAGE,
}


class Caller:
    """A program's function, called until it has failed fatally several times in a row.

    Attributes
    ----------
    failures
        Number of failures, by their messages.
    seconds
        Times of the calls that did not fail, s.
    """

    def __init__(self, program: Program, function: str) -> None:
        self.program = program
        self.function = function
        self.failures: Counter[str] = Counter()
        self.seconds: list[float] = []
        self._fatal = 0
        self._begun = time.perf_counter()
        self._processor_begun = program.processor_time

    def __call__(self, *arguments: Any) -> Array:
        """Return the function's value, as :meth:`Program.fk` and the others return it.

        Raises
        ------
        ProgramError
            The call failed, or too many calls have failed.
        """
        if self._fatal >= BOUNDS.fatal_failures:
            raise ProgramError("not called any more", Failure.ENDED)
        processor = self.program.processor_time - self._processor_begun
        if (
            processor > BOUNDS.time
            or time.perf_counter() - self._begun > WAITING_FACTOR * BOUNDS.time
        ):
            self.failures[f"scoring took longer than {BOUNDS.time:g} s: not called any more"] = 1
            raise ProgramError("not called any more", Failure.LATE)
        begin = time.perf_counter()
        try:
            value: Array = getattr(self.program, self.function)(*arguments)
        except ProgramError as error:
            self.failures[str(error)] += 1
            self._fatal = self._fatal + 1 if error.failure in _FATAL else 0
            raise
        self._fatal = 0
        self.seconds.append(time.perf_counter() - begin)
        return value

    def failure_texts(self) -> tuple[str, ...]:
        """Return the failures as text, the most frequent first."""
        return tuple(
            f"{text} ({count} {'time' if count == 1 else 'times'})"
            for text, count in self.failures.most_common(BOUNDS.listed_failures)
        )
