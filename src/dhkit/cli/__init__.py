"""The ``dhkit`` command: the library for the terminal, with ``--json`` for machines.

Exit status 0: fine; 1: the answer is no; 2: unusable input, which one line on stderr names; 130: interrupted.
"""

import gc
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

from dhkit.cli.exit_status import ExitStatus

__all__ = ["main"]

RETRY_INTERVAL = 0.005
"""Time after which a KeyboardInterrupt that would be discarded is tried again, s."""


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command and exit with its status; modules are imported here, so that Ctrl-C always ends in one line."""
    # A command imports thousands of objects that all stay: collecting garbage among them is a tenth of its start.
    gc.set_threshold(50_000, 20, 50)
    try:
        with _reliable_interrupts():
            from dhkit.cli.app import run

            status = run(arguments)
    except KeyboardInterrupt:
        sys.stderr.write("dhkit: interrupted\n")
        status = ExitStatus.INTERRUPTED
    sys.exit(status)


@contextmanager
def _reliable_interrupts() -> Iterator[None]:
    """Raise KeyboardInterrupt only where no extension module discards it or raises another error in its place."""
    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return

    def interrupt(number: int, frame: FrameType | None) -> None:
        if _discards_exceptions(frame):
            signal.setitimer(signal.ITIMER_REAL, RETRY_INTERVAL)
        else:
            signal.default_int_handler(number, frame)

    def retry(number: int, frame: FrameType | None) -> None:
        handler = signal.getsignal(signal.SIGINT)  # planning replaces it while CasADi's solver runs
        if callable(handler):
            handler(signal.SIGINT, frame)

    signal.signal(signal.SIGINT, interrupt)
    before = signal.signal(signal.SIGALRM, retry)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _discards_exceptions(frame: FrameType | None) -> bool:
    """Return whether a frame is CasADi's, or inside an import, which an extension module may have begun."""
    if frame is not None and frame.f_globals.get("__name__") == "casadi.casadi":
        return True
    while frame is not None and not frame.f_code.co_filename.startswith("<frozen importlib"):
        frame = frame.f_back
    return frame is not None
