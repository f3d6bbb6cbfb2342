"""Signals that end a command in order: processes that it started are ended, and temporary folders are removed."""

from __future__ import annotations

import signal
import threading
from types import FrameType

END_SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)
)
"""Signals by which a grader's time limit or a closed terminal ends a command."""


def end_in_order_on_signals() -> None:
    """Let SIGTERM and SIGHUP end this process as Ctrl-C does; a signal that is ignored stays ignored (nohup)."""
    if threading.current_thread() is not threading.main_thread():
        return
    for number in END_SIGNALS:
        if signal.getsignal(number) == signal.SIG_DFL:
            signal.signal(number, _interrupt)


def _interrupt(_: int, frame: FrameType | None) -> None:
    # A second signal would disturb the end that the first has begun.
    for number in END_SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    # Raises KeyboardInterrupt where nothing discards it.
    interrupt = signal.getsignal(signal.SIGINT)
    if not callable(interrupt):
        raise KeyboardInterrupt
    interrupt(signal.SIGINT, frame)
