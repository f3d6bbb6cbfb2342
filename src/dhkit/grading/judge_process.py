"""A process that judges sheets for a program with threads, such as a worker of a cluster.

Each sheet is judged in a forked process, with limits (:func:`~dhkit.grading.batch.grade_all`). A process with threads
must not fork: the child would wait forever for a lock that another thread held. So such a program starts a process of
its own once, which has no threads, keeps what was derived, and forks one child for each sheet.
"""

from __future__ import annotations

import os
import pickle
import select
import subprocess
import sys
import threading
import weakref
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Any, cast

from dhkit.errors import DhkitError
from dhkit.execution import find_isolation
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.batch import GIGABYTE, grade_all
from dhkit.grading.class_judge import ClassJudge
from dhkit.grading.grade_report import GradeReport
from dhkit.grading.sheets import Sheet

IDLE_SECONDS = 60.0
"""Time after which a process without a task ends, s: a cluster may live for days after a class was graded."""
_ALONE = "no other files are sent to a cluster: give --robot, or a task with a robot"
PROGRAM = "from dhkit.grading.judge_process import serve; serve()"


@dataclass(frozen=True)
class JudgeTask:
    """A sheet to judge, as values that can be sent to another machine.

    Attributes
    ----------
    judge
        Judge of the sheet.
    sheet
        The sheet; of its path the name counts.
    content
        Content of its file.
    seconds, memory
        Limits as in :func:`~dhkit.grading.batch.grade_all`, s and bytes.
    """

    judge: ClassJudge
    sheet: Sheet
    content: bytes
    seconds: float = 60.0
    memory: int = 2 * GIGABYTE

    @classmethod
    def of(cls, sheet: Sheet, judge: ClassJudge, seconds: float, memory: int) -> JudgeTask:
        """Return the task for a sheet on this machine.

        Raises
        ------
        AnswerError
            The sheet's student has no variant.
        OSError
            The file cannot be read.
        """
        with sheet.path.open("rb") as file:
            # One byte more than is allowed: the judge then refuses it, as it would here.
            content = file.read(BOUNDS.sheet_bytes + 1)
        return cls(
            judge.for_sheet(sheet.path), replace(sheet, shown=sheet.name), content, seconds, memory
        )

    def report(self) -> GradeReport:
        """Judge the sheet in a process forked from this one, which must have no threads."""
        judge = self.judge
        try:
            if judge.options.execute:
                judge = _isolated(judge)
            with TemporaryDirectory(prefix="dhkit-sheet-") as folder:
                path = Path(folder, self.sheet.path.name)
                path.write_bytes(self.content)
                sheet = replace(self.sheet, path=path)
                [report] = grade_all(
                    [sheet],
                    judge,
                    seconds=self.seconds,
                    memory=self.memory,
                    prepare=judge.prepare,
                )
                if folder in report.error:
                    beside = report.error.replace(f"{folder}{os.sep}", "")
                    report = replace(report, error=f"{self.sheet.name}: {beside}; {_ALONE}")
        except (DhkitError, OSError) as error:
            return GradeReport(error=f"{self.sheet.name}: {error}")
        return report


def _isolated(judge: ClassJudge) -> ClassJudge:
    """Return a judge that executes programs isolated on this machine.

    Raises
    ------
    IsolationError
        Programs cannot be isolated here.
    """
    task = judge.options.task
    packages = task.task.packages if task is not None else ()
    isolation = find_isolation(packages=packages, required=True)
    return replace(judge, options=replace(judge.options, isolation=isolation))


def judged_elsewhere(task: JudgeTask) -> bytes:
    """Return the report of a sheet as JSON, judged by this thread's own process, which is started if there is none."""
    # A process that was idle may end just before the task reaches it, so that a second one is tried.
    for _ in range(2):
        answer = _OWN.process().answer(task)
        if answer:
            return answer
    return GradeReport(error="the process that judges sheets ended").to_json().encode()


class _JudgeProcess:
    """The process of a thread: it ends with the program, or when nothing was asked of it for a while."""

    def __init__(self) -> None:
        # In a session of its own, Ctrl-C in a terminal does not reach it. -P: it imports nothing from the folder in
        # which the program runs.
        self._process = subprocess.Popen(  # noqa: S603
            [sys.executable, "-P", "-c", PROGRAM],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
        )
        # Also at the end of this program, without a warning of a process that still runs.
        self.end = weakref.finalize(self, _end, self._process)
        self._requests = cast("IO[bytes]", self._process.stdin)
        self._answers = cast("IO[bytes]", self._process.stdout)

    @property
    def is_alive(self) -> bool:
        return self._process.poll() is None

    def answer(self, task: JudgeTask) -> bytes:
        """Return the report as JSON; empty if the process has ended."""
        try:
            pickle.dump(task, self._requests)
            self._requests.flush()
            line = self._answers.readline()
        except OSError:
            line = b""
        if not line.endswith(b"\n"):
            self.end()
            return b""
        return line


def _end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    with process:
        pass


class _Own(threading.local):
    """Process of each thread."""

    _process: _JudgeProcess | None = None

    def process(self) -> _JudgeProcess:
        if self._process is None or not self._process.is_alive:
            self._process = _JudgeProcess()
        return self._process


_OWN = _Own()


def serve() -> None:
    """Judge the sheets whose tasks come on standard input, and write each report as a line to standard output."""
    requests = sys.stdin.buffer
    answers = os.fdopen(os.dup(1), "wb")
    # What libraries print must not mix with the reports.
    os.dup2(2, 1)
    is_prepared = False
    while (task := _next_task(requests)) is not None:
        if not is_prepared:
            task.judge.prepare()
            is_prepared = True
        answers.write(task.report().to_json().encode("utf-8", "replace") + b"\n")
        answers.flush()


def _next_task(requests: IO[bytes]) -> Any:
    """Return the next task; None if the program has ended or asks for nothing."""
    if not select.select([requests], [], [], IDLE_SECONDS)[0]:
        return None
    try:
        return pickle.load(requests)  # noqa: S301 - from the program that started this process
    except EOFError:
        return None
