"""Judging of many sheets, each in a process of its own: one that hangs, crashes or fills the memory harms no other."""

from __future__ import annotations

import hashlib
import json as jsons
import os
import selectors
import signal
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeAlias

from dhkit.errors import DhkitError
from dhkit.grading.bounds import BOUNDS
from dhkit.grading.grade_report import GradeReport
from dhkit.grading.isolation import Worker, WorkerLimits, is_late, start_worker
from dhkit.grading.remarks import Note, NoteKind
from dhkit.grading.reports.json import report_of
from dhkit.grading.sheets import Sheet
from dhkit.grading.variants.students import is_name_of

GIGABYTE = 1024**3

Judge: TypeAlias = Callable[[Path], GradeReport]
"""Judges a sheet; an exception that it raises becomes the report's error."""
NumberedReport: TypeAlias = tuple[int, GradeReport]
"""A report with the number of its sheet, from 0."""


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

    Each sheet is judged in a forked process, which inherits all that this process has imported and computed; so import
    and compute first, and run no threads. It sends its report as JSON, of which every field is checked. An error in
    judging a sheet becomes its report's ``error``. Without ``os.fork`` (Windows) sheets are judged in this process, one
    after the other, without limits.

    Parameters
    ----------
    sheets
        Sheets to judge; those that :func:`~dhkit.grading.sheets.find_sheets` refused are reported as they are.
    judge
        Function that judges one sheet.
    jobs
        Number of processes at once.
    seconds
        Processor time for each sheet, s; on the clock a sheet may take four times as long.
    memory
        Address space for each sheet beyond what this process has, bytes (Linux; elsewhere address space in all).
    prepare
        Called in this process with each report as soon as it is complete, in any order, to compute what later processes
        inherit. It has no limits.
    progress
        Called with the number of sheets judged so far and the number of all sheets.

    Raises
    ------
    ValueError
        Fewer than one job, or limits that are not positive.
    """
    if jobs < 1 or seconds <= 0 or memory <= 0:
        raise ValueError(
            f"found jobs {jobs}, seconds {seconds}, memory {memory}; expected positive numbers"
        )
    limits = WorkerLimits(seconds, memory)
    if hasattr(os, "fork"):
        results = _judge_in_processes(sheets, judge, jobs, limits)
    else:
        results = _judge_here(sheets, judge, limits)
    return in_order(results, len(sheets), prepare, progress)


def origin_of_sheet(sheet: Sheet) -> tuple[str, str]:
    """Return the student and the file of a sheet of a class as its report names them."""
    return _printable(sheet.student or sheet.path.stem), _printable(sheet.name)


def content_digest(path: Path) -> str:
    """Return the SHA-256 of a file's content, hexadecimal; empty if it is not a file that can be read."""
    try:
        if not path.is_file():
            return ""
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""


def seed_of_sheet(seed: int, path: Path) -> int:
    """Return the seed of the random states of one sheet of a class.

    It depends on the seed of the run and on the content of the file alone: not on the order in which sheets are judged,
    nor on the others.

    Parameters
    ----------
    seed
        Seed of the run.
    path
        The sheet.

    Returns
    -------
    int
        A number of 53 bits, which JSON keeps.

    Examples
    --------
    >>> from pathlib import Path
    >>> for name in ("a.py", "b.py"):
    ...     size = Path(name).write_text("g1 = 0")
    >>> seed_of_sheet(7, Path("a.py")) == seed_of_sheet(7, Path("b.py")) != seed_of_sheet(8, Path("a.py"))
    True
    """
    digest = hashlib.sha256(f"{seed}:{content_digest(path)}".encode()).digest()
    return int.from_bytes(digest[:8]) >> 11


def judgement_key(sheet: Sheet, rules: Sequence[str]) -> str:
    """Return a digest of all that a sheet's report depends on; empty if the sheet cannot be read.

    Parameters
    ----------
    sheet
        The sheet.
    rules
        What the report depends on besides: dhkit's version, the task, the robot, options.

    Returns
    -------
    str
        SHA-256, hexadecimal: a report with the same key need not be made again.
    """
    content = "" if sheet.error else content_digest(sheet.path)
    if not content:
        return ""
    parts = [content, sheet.student, sheet.name, str(sheet.time), *sheet.beside, *rules]
    return hashlib.sha256(jsons.dumps(parts).encode()).hexdigest()


def in_order(
    results: Iterator[NumberedReport],
    total: int,
    prepare: Callable[[GradeReport], object] | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Iterator[GradeReport]:
    """Yield reports in the order of their numbers from 0.

    Parameters
    ----------
    results
        The reports, in any order.
    total
        How many there will be.
    prepare, progress
        As in :func:`grade_all`.
    """
    early: dict[int, GradeReport] = {}
    turn = 0
    for done, (number, report) in enumerate(results, start=1):
        early[number] = report
        if prepare is not None and not report.error:
            prepare(report)
        if progress is not None:
            progress(done, total)
        while turn in early:
            yield early.pop(turn)
            turn += 1


def _judge_here(
    sheets: Sequence[Sheet], judge: Judge, limits: WorkerLimits
) -> Iterator[NumberedReport]:
    for number, sheet in enumerate(sheets):
        begin = time.monotonic()
        report = (
            GradeReport(error=sheet.error)
            if sheet.error
            else report_of(_judge_to_json(sheet, judge, limits))
        )
        yield number, with_origin(report, sheet, time.monotonic() - begin)


def _judge_in_processes(
    sheets: Sequence[Sheet], judge: Judge, jobs: int, limits: WorkerLimits
) -> Iterator[NumberedReport]:
    """Yield reports as they are completed; at the end no process is left."""
    waiting = deque(enumerate(sheets))
    with closing(_Pool(judge, limits)) as pool:
        while waiting or pool.running:
            while waiting and len(pool.running) < jobs:
                number, sheet = waiting.popleft()
                error = sheet.error or pool.start(number, sheet)
                if error:
                    yield number, with_origin(GradeReport(error=error), sheet, 0.0)
            yield from pool.wait()


def _judge_to_json(sheet: Sheet, judge: Judge, limits: WorkerLimits) -> bytes:
    """Return the report of a sheet as JSON; an exception of the judge becomes its error."""
    report = _judge_path_to_json(sheet.path, judge, limits)
    if not sheet.shown:
        return report
    # Messages name the file; one from an archive has a temporary path.
    return report.replace(_json_text(str(sheet.path)), _json_text(sheet.shown))


def _json_text(text: str) -> bytes:
    """Return a text as it stands between the quotation marks of JSON."""
    return jsons.dumps(text, ensure_ascii=False)[1:-1].encode("utf-8", "replace")


def _judge_path_to_json(path: Path, judge: Judge, limits: WorkerLimits) -> bytes:
    starved = _error_json(limits.starved)  # made while there is memory
    try:
        return judge(path).to_json().encode("utf-8", "replace")
    except MemoryError:
        return starved
    except DhkitError as error:
        return _error_json(str(error))
    except (Exception, SystemExit) as error:
        if "bad_alloc" in str(error):  # C++'s exception of a lack of memory
            return starved
        return _error_json(f"{type(error).__name__}: {str(error)[:500]}; please report this")


def _error_json(error: str) -> bytes:
    return GradeReport(error=" ".join(error.split())).to_json().encode("utf-8", "replace")


class _Pool:
    """The processes that judge sheets at the moment."""

    def __init__(self, judge: Judge, limits: WorkerLimits) -> None:
        self.judge = judge
        self.limits = limits
        self.running: dict[int, tuple[Sheet, Worker]] = {}
        self._selector = selectors.DefaultSelector()
        self._waited = time.monotonic()

    def close(self) -> None:
        """End all processes."""
        for number in list(self.running):
            self._end(number)
        self._selector.close()

    def start(self, number: int, sheet: Sheet) -> str:
        """Begin to judge a sheet; return why that is impossible, empty if it is not."""
        try:
            worker = start_worker(
                partial(_judge_to_json, sheet, self.judge, self.limits), self.limits
            )
        except OSError as error:
            return f"no process to judge it in: {error.strerror}"
        self.running[number] = sheet, worker
        self._selector.register(worker.pipe, selectors.EVENT_READ, number)
        return ""

    def wait(self) -> list[NumberedReport]:
        """Wait until a process writes or exceeds its limit; return the reports that are then complete."""
        if not self.running:
            return []
        now = time.monotonic()
        workers = {number: worker for number, (_, worker) in self.running.items()}
        # While the caller was busy, no process could hand in its report.
        for worker in workers.values():
            worker.deadline += max(0.0, now - max(self._waited, worker.begin))
        patience = min(worker.deadline for worker in workers.values()) - now
        done = []
        for key, _ in self._selector.select(max(0.0, patience)):
            is_complete = workers[key.data].read()
            if len(workers[key.data].received) > BOUNDS.report_bytes:
                done.append(
                    self._finish(
                        key.data, f"the judge wrote more than {BOUNDS.report_bytes / 1e6:g} MB"
                    )
                )
            elif is_complete:
                done.append(self._finish(key.data))
        self._waited = time.monotonic()
        late = [
            number
            for number, (_, worker) in self.running.items()
            if worker.deadline <= self._waited
        ]
        return done + [self._finish(number, self.limits.late) for number in late]

    def _finish(self, number: int, error: str = "") -> NumberedReport:
        sheet, worker = self.running[number]
        status = self._end(number)
        report = GradeReport(error=error) if error else self._report(worker.received, status)
        return number, with_origin(report, sheet, time.monotonic() - worker.begin)

    def _end(self, number: int) -> int:
        _, worker = self.running.pop(number)
        self._selector.unregister(worker.pipe)
        return worker.end()

    def _report(self, received: bytearray, status: int) -> GradeReport:
        """Return the report that a process sent before it ended, or why it sent none."""
        try:
            return report_of(bytes(received))
        except ValueError:
            fault = "the judge's answer cannot be read" if received else "the judge gave no answer"
        if is_late(status):
            fault = self.limits.late
        elif status:
            fault = (
                f"the judge stopped: {_signal_name(-status) if status < 0 else f'status {status}'}"
            )
        return GradeReport(error=fault)


def _signal_name(number: int) -> str:
    try:
        return f"signal {number} ({signal.Signals(number).name})"
    except ValueError:
        return f"signal {number}"


def with_origin(report: GradeReport, sheet: Sheet, seconds: float) -> GradeReport:
    """Return a report with the fields that this process knows better than the judge."""
    return replace(
        report,
        sheet=origin_of_sheet(sheet)[1],
        student=_printable(sheet.student or report.student or sheet.path.stem),
        handed_in="" if sheet.time is None else sheet.time.isoformat(),
        seconds=report.seconds or seconds,
        left_out=(*report.left_out, *(f"not read: {_printable(name)}" for name in sheet.beside)),
        notes=tuple(note for note in report.notes if not _is_own_signature(note, sheet)),
    )


def _is_own_signature(note: Note, sheet: Sheet) -> bool:
    """Return whether a note says that the sheet bears a name which is the student's; a single file has no other."""
    if note.kind is not NoteKind.SIGNED:
        return False
    names = (sheet.student, *sheet.aliases, *sheet.listed)
    return not sheet.student or is_name_of(note.values[0], names)


def _printable(name: str) -> str:
    """Return a file's name as text: on disk it may be any bytes."""
    return os.fsencode(name).decode("utf-8", "replace")
