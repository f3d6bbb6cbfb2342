"""Judging many sheets, each in a process of its own: what hangs, crashes or eats memory harms no other."""

from __future__ import annotations

import os
import selectors
import signal
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from types import TracebackType

from dhkit.grading.isolation import PIECE, Judge, Limits, judged, kill, start_worker
from dhkit.grading.report import GradeReport
from dhkit.grading.reports.json import report_of
from dhkit.grading.sheets import Sheet

GIGABYTE = 1024**3
MOST = 20_000_000
"""Bytes of a report."""

Numbered = tuple[int, GradeReport]
"""A report with its sheet's number, from 0."""


def grade_all(
    sheets: Sequence[Sheet],
    judge: Judge,
    *,
    jobs: int = 1,
    seconds: float = 60.0,
    memory: int = 2 * GIGABYTE,
    prepare: Callable[[GradeReport], object] | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Iterator[GradeReport]:
    """Judge sheets, and yield their reports in the order of the sheets.

    Each sheet is judged in a forked process, which has all that this one has imported and computed; so import and
    compute first, and run no threads. It sends its report as JSON, of which every field is checked. What goes wrong
    with a sheet becomes its report's ``error``. Where there is no ``os.fork`` (Windows) sheets are judged in this
    process, one after the other, without limits.

    Parameters
    ----------
    sheets
        What to judge; those that :func:`find_sheets` refused are reported as they are.
    judge
        Judges one sheet.
    jobs
        How many processes at once.
    seconds
        For each sheet, of the clock.
    memory
        For each sheet, bytes of addresses beyond those that this process has (Linux; elsewhere of addresses in all).
    prepare
        Called here with each report as soon as it is there, in whichever order: to compute what later processes
        inherit. It has no limits.
    progress
        Called with how many sheets are done, and of how many.

    Raises
    ------
    ValueError
        Fewer than one job, or limits that are not positive.
    """
    if jobs < 1 or seconds <= 0 or memory <= 0:
        raise ValueError(f"found jobs {jobs}, seconds {seconds}, memory {memory}; expected positive numbers")
    limits = Limits(seconds, memory)
    results = _forked(sheets, judge, jobs, limits) if hasattr(os, "fork") else _here(sheets, judge, limits)
    return _in_order(results, len(sheets), prepare, progress)


def _in_order(
    results: Iterator[Numbered],
    total: int,
    prepare: Callable[[GradeReport], object] | None,
    progress: Callable[[int, int], object] | None,
) -> Iterator[GradeReport]:
    waiting: dict[int, GradeReport] = {}
    turn = 0
    for done, (number, report) in enumerate(results, start=1):
        waiting[number] = report
        if prepare is not None and not report.error:
            prepare(report)
        if progress is not None:
            progress(done, total)
        while turn in waiting:
            yield waiting.pop(turn)
            turn += 1


def _here(sheets: Sequence[Sheet], judge: Judge, limits: Limits) -> Iterator[Numbered]:
    for number, sheet in enumerate(sheets):
        begin = time.monotonic()
        report = GradeReport(error=sheet.error) if sheet.error else report_of(judged(sheet.path, judge, limits))
        yield number, _of_sheet(report, sheet, time.monotonic() - begin)


def _forked(sheets: Sequence[Sheet], judge: Judge, jobs: int, limits: Limits) -> Iterator[Numbered]:
    """Yield reports as they come."""
    ahead = deque(enumerate(sheets))
    with _Processes(judge, limits) as processes:
        while ahead or processes.running:
            while ahead and len(processes.running) < jobs:
                number, sheet = ahead.popleft()
                refused = sheet.error or processes.start(number, sheet)
                if refused:
                    yield number, _of_sheet(GradeReport(error=refused), sheet, 0.0)
            yield from processes.finished()


@dataclass(eq=False)
class _Process:
    """A sheet that is being judged."""

    number: int
    sheet: Sheet
    pid: int
    pipe: int
    begin: float
    deadline: float
    received: bytearray = field(default_factory=bytearray)


class _Processes:
    """The processes that judge; at its end none is left."""

    def __init__(self, judge: Judge, limits: Limits) -> None:
        self.judge = judge
        self.limits = limits
        self.running: list[_Process] = []
        self._selector = selectors.DefaultSelector()
        self._left = time.monotonic()

    def __enter__(self) -> _Processes:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        for process in list(self.running):
            self._end(process)
        self._selector.close()

    def start(self, number: int, sheet: Sheet) -> str:
        """Begin with a sheet; return why that cannot be."""
        try:
            pid, pipe = start_worker(partial(judged, sheet.path, self.judge, self.limits), self.limits)
        except OSError as error:
            return f"no process to judge it in: {error.strerror}"
        now = time.monotonic()
        process = _Process(number, sheet, pid, pipe, now, now + self.limits.seconds)
        self.running.append(process)
        self._selector.register(pipe, selectors.EVENT_READ, process)
        return ""

    def finished(self) -> list[Numbered]:
        """Wait until something comes or a limit passes; return what is then done."""
        if not self.running:
            return []
        now = time.monotonic()
        for process in self.running:  # while the caller was busy, none could hand in its report
            process.deadline += max(0.0, now - max(self._left, process.begin))
        patience = min(process.deadline for process in self.running) - now
        done = [self._read(key.data) for key, _ in self._selector.select(max(0.0, patience))]
        self._left = time.monotonic()
        late = [process for process in self.running if process.deadline <= self._left]
        done += [self._done(process, self.limits.late) for process in late]
        return [numbered for numbered in done if numbered is not None]

    def _read(self, process: _Process) -> Numbered | None:
        piece = os.read(process.pipe, PIECE)
        process.received += piece
        if len(process.received) > MOST:
            return self._done(process, f"the judge wrote more than {MOST / 1e6:g} MB")
        return None if piece else self._done(process)

    def _done(self, process: _Process, error: str = "") -> Numbered:
        status = self._end(process)
        report = GradeReport(error=error) if error else self._report(process, status)
        return process.number, _of_sheet(report, process.sheet, time.monotonic() - process.begin)

    def _end(self, process: _Process) -> int:
        self.running.remove(process)
        self._selector.unregister(process.pipe)
        os.close(process.pipe)
        return kill(process.pid)

    def _report(self, process: _Process, status: int) -> GradeReport:
        """Return what a process that has ended sent, or why it sent nothing."""
        try:
            return report_of(bytes(process.received))
        except ValueError:
            fault = "the judge's answer cannot be read" if process.received else "the judge gave no answer"
        if status < 0:
            fault = f"the judge stopped: {_signal(-status)}"
        elif status > 0:
            fault = f"the judge stopped: status {status}"
        if -status in (signal.SIGXCPU, signal.SIGALRM):
            fault = self.limits.late
        return GradeReport(error=fault)


def _signal(number: int) -> str:
    try:
        return f"signal {number} ({signal.Signals(number).name})"
    except ValueError:
        return f"signal {number}"


def _of_sheet(report: GradeReport, sheet: Sheet, seconds: float) -> GradeReport:
    """Return a report with what this process knows better than the judge."""
    return replace(
        report,
        sheet=_printable(str(sheet.path)),
        student=_printable(sheet.student or report.student or sheet.path.stem),
        seconds=report.seconds or seconds,
        left_out=(*report.left_out, *(f"not read: {_printable(name)}" for name in sheet.beside)),
    )


def _printable(name: str) -> str:
    """Return a file's name as text: on disk it may be any bytes."""
    return os.fsencode(name).decode("utf-8", "replace")
