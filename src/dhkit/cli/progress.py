"""A progress bar on stderr, for work that takes long, where stderr is a terminal."""

from __future__ import annotations

import sys
import threading
from typing import Any

from dhkit.cli.streams import styled

DELAY = 1.0
"""Time before the bar appears, s."""


class ProgressBar:
    """A bar with a text that appears after a second on a terminal, and is gone at the end.

    Parameters
    ----------
    text
        The text at first.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self._done = 0.0
        self._total = 0.0
        self._timer = threading.Timer(DELAY, self._open)
        self._timer.daemon = True
        self._bar: Any = None

    def show(self, done: float, total: float, text: str | None = None) -> None:
        """Show how much of the total is done, and another text if given."""
        self._done = done
        self._total = total
        self._text = self._text if text is None else text
        if self._bar is not None:
            self._bar.update(self._task, completed=done, total=total, description=self._text)

    def __enter__(self) -> ProgressBar:
        if sys.stderr.isatty():
            self._timer.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._timer.cancel()
        if self._timer.is_alive():
            self._timer.join()
        if self._bar is not None:
            self._bar.stop()

    def _open(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
        bar = Progress(*columns, console=Console(file=styled(sys.stderr)), transient=True)
        self._task = bar.add_task(self._text, total=self._total or None)
        bar.update(self._task, completed=self._done)
        bar.start()
        self._bar = bar
