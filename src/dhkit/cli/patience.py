"""A line on stderr that says how far something is, once it takes long and someone is looking."""

from __future__ import annotations

import sys
import threading
from types import TracebackType
from typing import Any

__all__ = ["Patience"]

PATIENCE = 1.0
"""s: what takes longer shows how far it is."""


class Patience:
    """A line that appears after a second on a terminal, and is gone at the end.

    Parameters
    ----------
    text
        What it says at first.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self._timer = threading.Timer(PATIENCE, self._open)
        self._timer.daemon = True
        self._status: Any = None

    def say(self, text: str) -> None:
        """Put another text in the line."""
        self._text = text
        if self._status is not None:
            self._status.update(text)

    def __enter__(self) -> Patience:
        if sys.stderr.isatty():
            self._timer.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._timer.cancel()
        if self._timer.is_alive():
            self._timer.join()
        if self._status is not None:
            self._status.stop()

    def _open(self) -> None:
        from rich.console import Console

        self._status = Console(stderr=True).status(self._text)
        self._status.start()
