"""Compiling in a thread of its own, after enough calls asked for it, so that no call waits."""

from __future__ import annotations

import threading
from collections.abc import Callable

CALLS_BEFORE_COMPILING = 200
"""A quantity is compiled for single calls when so many were made: they took about as long as compiling takes."""
_SMALLEST_STACK = 2**18
"""Smallest stack of a thread that LLVM is given, bytes; the usual ones have 8 MB."""


class Background:
    """Counts calls, and does some work in a thread at every ``CALLS_BEFORE_COMPILING``-th, unless it is being done.

    Parameters
    ----------
    name
        Of the work.
    work
        The work. It must raise nothing.
    """

    def __init__(self, name: str, work: Callable[[], object]) -> None:
        self.calls = 0
        self._name = name
        self._work = work
        self._thread: threading.Thread | None = None

    def count(self, calls: int = 1) -> None:
        """Count a call, or one that takes as long as so many."""
        before = self.calls // CALLS_BEFORE_COMPILING
        self.calls += calls
        if self.calls // CALLS_BEFORE_COMPILING > before:
            self._start()

    def _start(self) -> None:
        """Work in a thread, unless one is at work; after a fork, the parent's thread is not alive in the child."""
        if self._thread is not None and self._thread.is_alive():
            return
        if 0 < threading.stack_size() < _SMALLEST_STACK:
            return
        self._thread = threading.Thread(
            target=self._work, name=f"compile {self._name}", daemon=False
        )
        try:
            self._thread.start()
        except RuntimeError:
            # The interpreter is shutting down.
            self._thread = None
