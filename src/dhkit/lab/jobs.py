"""Work that takes longer than a request: one job at a time, in a thread of its own, that can be cancelled."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

from dhkit.errors import DhkitError

log = logging.getLogger(__name__)

LONGEST_END = 20.0
"""s from the cancelling of a job to its next :meth:`Job.progress`: some seconds while it makes its program."""


class Cancelled(Exception):  # noqa: N818 - no error: the person who asked does not want it any more
    """The job was cancelled."""


class Job:
    """What a running job is given."""

    def __init__(self, number: int, title: str, tell: Callable[[Job], None]) -> None:
        self.number, self.title, self.text = number, title, ""
        self._tell = tell
        self._cancelled = threading.Event()

    def progress(self, text: str) -> None:
        """Tell how far it is.

        Raises
        ------
        Cancelled
            Nobody wants it any more.
        """
        if self._cancelled.is_set():
            raise Cancelled
        self.text = text
        self._tell(self)

    def wait(self, seconds: float) -> None:
        """Wait for a time.

        Raises
        ------
        Cancelled
            Nobody wants it any more.
        """
        if self._cancelled.wait(seconds):
            raise Cancelled

    def cancel(self) -> None:
        """End it at its next :meth:`progress` or :meth:`wait`."""
        self._cancelled.set()

    @property
    def cancelled(self) -> bool:
        """Whether its result is still wanted."""
        return self._cancelled.is_set()


class Jobs:
    """Jobs, of which the latest counts: one runs, and at most one waits until it has noticed that it is cancelled.

    Parameters
    ----------
    tell
        Called with a panel's state: what runs, how far it is, and what went wrong.
    lock
        Held while a result is taken: what it belongs to must not change meanwhile.
    """

    def __init__(self, tell: Callable[[Any], None], lock: AbstractContextManager[Any] | None = None) -> None:
        self._tell = tell
        self._taking: AbstractContextManager[Any] = nullcontext() if lock is None else lock
        self._count = 0
        self._job: Job | None = None
        self._lock = threading.Lock()
        self._waiting: Callable[[], None] | None = None
        self._thread: threading.Thread | None = None

    def start(self, title: str, work: Callable[[Job], Any], done: Callable[[Any], None]) -> int:
        """Begin a job in place of the one that runs; ``done`` is called with its result.

        Returns
        -------
        int
            Its number.
        """
        self.cancel()
        self._count += 1
        job = self._job = Job(self._count, title, self._told)
        self._told(job)
        with self._lock:
            self._waiting = lambda: self._run(job, work, done)
            if self._thread is None:
                self._thread = threading.Thread(target=self._work, name="dhkit-job", daemon=True)
                self._thread.start()
        return job.number

    def cancel(self) -> None:
        """Cancel what runs."""
        job, self._job = self._job, None
        with self._lock:
            self._waiting = None
        if job is not None:
            job.cancel()
            self._tell(None)

    def close(self) -> None:
        """Cancel what runs and wait for its end: a solver that still runs when Python exits makes it crash."""
        self.cancel()
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(LONGEST_END)
            if thread.is_alive():
                log.warning("a job did not end within %g s", LONGEST_END)

    def _work(self) -> None:
        while True:
            with self._lock:
                run, self._waiting = self._waiting, None
                if run is None:
                    self._thread = None
                    return
            run()

    def _run(self, job: Job, work: Callable[[Job], Any], done: Callable[[Any], None]) -> None:
        try:
            result = work(job)
            with self._taking:
                if not job.cancelled:
                    done(result)
        except Cancelled:
            return
        except (DhkitError, ValueError, TypeError) as error:
            self._ended(job, " ".join(str(error).split()))
        except Exception as error:
            log.exception("%s failed", job.title)
            self._ended(job, f"{type(error).__name__}: Python's log says more")
        else:
            self._ended(job, None)

    def _told(self, job: Job) -> None:
        if job is self._job:
            self._tell(_state(job, running=True, error=None))

    def _ended(self, job: Job, error: str | None) -> None:
        if job is self._job:
            self._job = None
            self._tell(_state(job, running=False, error=error) if error else None)


def _state(job: Job, *, running: bool, error: str | None) -> dict[str, Any]:
    return {"id": job.number, "title": job.title, "progress": job.text, "running": running, "error": error}
