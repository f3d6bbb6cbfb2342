"""A program's function, called for a score: its failures counted, its time taken."""

from __future__ import annotations

import time
from collections import Counter
from typing import Any

from dhkit.description import Array
from dhkit.programs.process import ProgramError
from dhkit.programs.program import Program

CLOSE = 1e-6
"""Between a pose and the one that is reached: entries of the rotations, and positions in shares of the arm's reach."""
EXAMPLES = 5
"""Failing poses that are listed."""
MOST_FAILURES = 3
"""Failures in a row (of those that end a program) after which it is not called again."""
LONGEST = 600.0
"""s of all calls of a function together."""
FATAL = {"late", "memory", "processes", "ended", "garbage"}


class Caller:
    """A program's function, called until it has failed fatally several times in a row."""

    def __init__(self, program: Program, function: str) -> None:
        self.program, self.function = program, function
        self.failures: Counter[str] = Counter()
        self.seconds: list[float] = []
        self._fatal = 0
        self._begun = time.perf_counter()

    def __call__(self, *arguments: Any) -> Array:
        """Return the function's value, as :meth:`Program.fk` and the like give it.

        Raises
        ------
        ProgramError
            It failed, or has failed too often.
        """
        if self._fatal >= MOST_FAILURES:
            raise ProgramError("not called any more", "ended")
        if time.perf_counter() - self._begun > LONGEST:
            self.failures[f"scoring took longer than {LONGEST:g} s: not called any more"] = 1
            raise ProgramError("not called any more", "late")
        begin = time.perf_counter()
        try:
            value: Array = getattr(self.program, self.function)(*arguments)
        except ProgramError as error:
            self.failures[str(error)] += 1
            self._fatal = self._fatal + 1 if error.failure in FATAL else 0
            raise
        self._fatal = 0
        self.seconds.append(time.perf_counter() - begin)
        return value

    def said(self) -> tuple[str, ...]:
        """Return what its failures were, the most frequent first."""
        return tuple(
            f"{text} ({count} {'time' if count == 1 else 'times'})"
            for text, count in self.failures.most_common(EXAMPLES)
        )
