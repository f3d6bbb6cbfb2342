"""Jobs: work that takes longer than a request, one at a time, in a thread of its own, that can be cancelled."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import TypedDict, TypeVar

from dhkit.errors import DhkitError

log = logging.getLogger(__name__)

MAX_END_TIME = 20.0
"""Time that a cancelled job may take to end, s: making an optimizer's program, for one, takes some seconds."""

Result = TypeVar("Result")


class Cancelled(Exception):  # noqa: N818 - no error: the person who asked does not want it any more
    """The job was cancelled."""


class JobState(TypedDict):
    """The state of a job, as pages show it."""

    id: int
    title: str
    progress: str
    running: bool
    error: str | None


class Job:
    """A job, as the work that it runs sees it."""

    def __init__(self, number: int, title: str, report: Callable[[Job], None]) -> None:
        self.number = number
        self.title = title
        self.text = ""
        self._report = report
        self._cancelled = threading.Event()

    def progress(self, text: str) -> None:
        """Report how far the work is.

        Raises
        ------
        Cancelled
            The job was cancelled.
        """
        self.wait(0.0)
        self.text = text
        self._report(self)

    def wait(self, seconds: float) -> None:
        """Wait for a time in s.

        Raises
        ------
        Cancelled
            The job was cancelled.
        """
        if self._cancelled.wait(seconds):
            raise Cancelled

    def cancel(self) -> None:
        """Make the next :meth:`progress` or :meth:`wait` raise :class:`Cancelled`."""
        self._cancelled.set()


class Jobs:
    """Jobs of which the latest counts: one runs, and at most one waits until that one has noticed its cancelling.

    Parameters
    ----------
    publish
        Called with the state of the job, and with None when there is none any more.
    lock
        Held while a result is taken: the arm that it belongs to must not change meanwhile.
    """

    def __init__(
        self,
        publish: Callable[[JobState | None], None] = lambda state: None,
        lock: AbstractContextManager[object] | None = None,
    ) -> None:
        self._publish = publish
        self._result_lock: AbstractContextManager[object] = nullcontext() if lock is None else lock
        self._count = 0
        self._job: Job | None = None
        self._lock = threading.Lock()
        self._waiting: Callable[[], None] | None = None
        self._thread: threading.Thread | None = None

    def start(
        self, title: str, work: Callable[[Job], Result], take: Callable[[Result], None]
    ) -> int:
        """Start a job instead of the one that runs, and return its number; ``take`` is called with its result."""
        self.cancel()
        self._count += 1
        job = self._job = Job(self._count, title, self._report)
        self._report(job)
        with self._lock:
            self._waiting = lambda: self._run(job, work, take)
            if self._thread is None:
                self._thread = threading.Thread(
                    target=self._run_waiting, name="dhkit-job", daemon=True
                )
                self._thread.start()
        return job.number

    def cancel(self) -> None:
        """Cancel the job that runs."""
        job = self._job
        self._job = None
        with self._lock:
            self._waiting = None
        if job is not None:
            job.cancel()
            self._publish(None)

    def close(self) -> None:
        """Cancel the job that runs and wait for its end: a solver that still runs when Python exits makes it crash."""
        self.cancel()
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(MAX_END_TIME)
            if thread.is_alive():
                log.warning("a job did not end within %g s", MAX_END_TIME)

    def _run_waiting(self) -> None:
        while True:
            with self._lock:
                run = self._waiting
                self._waiting = None
                if run is None:
                    self._thread = None
                    return
            run()

    def _run(self, job: Job, work: Callable[[Job], Result], take: Callable[[Result], None]) -> None:
        error = None
        try:
            result = work(job)
            with self._result_lock:
                job.wait(0.0)  # the result of a job that was cancelled meanwhile is not taken
                take(result)
        except Cancelled:
            return
        except (DhkitError, ValueError, TypeError) as failure:
            error = " ".join(str(failure).split())
        except Exception as failure:
            log.exception("%s failed", job.title)
            error = f"{type(failure).__name__}: Python's log says more"
        if job is self._job:
            self._job = None
            self._publish(_state(job, error) if error else None)

    def _report(self, job: Job) -> None:
        if job is self._job:
            self._publish(_state(job, None))


def _state(job: Job, error: str | None) -> JobState:
    return {
        "id": job.number,
        "title": job.title,
        "progress": job.text,
        "running": error is None,
        "error": error,
    }
