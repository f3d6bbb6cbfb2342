"""A progress bar on stderr, once something takes long and someone is looking."""

from __future__ import annotations

import sys
import threading
from types import TracebackType
from typing import Any

PATIENCE = 1.0
"""s: what takes longer shows how far it is."""


class ProgressBar:
    """A bar with a text that appears after a second on a terminal, and is gone at the end.

    Parameters
    ----------
    text
        What it says at first.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self._done, self._total = 0.0, 0.0
        self._timer = threading.Timer(PATIENCE, self._open)
        self._timer.daemon = True
        self._bar: Any = None

    def show(self, done: float, total: float, text: str | None = None) -> None:
        """Say how far it is, as a share of a total, and perhaps with another text."""
        self._done, self._total, self._text = done, total, self._text if text is None else text
        if self._bar is not None:
            self._bar.update(self._task, completed=done, total=total, description=self._text)

    def __enter__(self) -> ProgressBar:
        if sys.stderr.isatty():
            self._timer.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._timer.cancel()
        if self._timer.is_alive():
            self._timer.join()
        if self._bar is not None:
            self._bar.stop()

    def _open(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
        bar = Progress(*columns, console=Console(stderr=True), transient=True)
        self._task = bar.add_task(self._text, total=self._total or None)
        bar.update(self._task, completed=self._done)
        bar.start()
        self._bar = bar
