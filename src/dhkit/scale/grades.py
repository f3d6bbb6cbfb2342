"""Sheets of a class judged by the workers of a cluster."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from dhkit.errors import DhkitError
from dhkit.grading.batch import GIGABYTE, NumberedReport, with_origin
from dhkit.grading.class_judge import ClassJudge
from dhkit.grading.grade_report import GradeReport
from dhkit.grading.judge_process import JudgeTask, judged_elsewhere
from dhkit.grading.reports.json import report_of
from dhkit.grading.sheets import Sheet
from dhkit.scale.clusters import completed, prepare

if TYPE_CHECKING:
    from dhkit.scale.clusters import Client


def grade_many(
    client: Client,
    sheets: Sequence[Sheet],
    judge: ClassJudge,
    *,
    seconds: float = 60.0,
    memory: int = 2 * GIGABYTE,
) -> Iterator[NumberedReport]:
    """Judge sheets by the workers of a cluster, a task each.

    A worker gets a sheet's content, the task, the rubric and the robot, and judges the sheet in a process with limits,
    as :func:`~dhkit.grading.batch.grade_all` does. It needs none of the files. With a seed in the judge's options and
    ``has_own_seeds``, reports are those of one machine, but for the time that they took.

    Parameters
    ----------
    client
        A client of dask, as :func:`connected` yields it.
    sheets
        Sheets to judge. Those that name a robot file need the judge's robot, since no other files are sent.
    judge
        What the sheets are judged by.
    seconds
        Processor time for each sheet, s; on the clock a sheet may take four times as long.
    memory
        Address space for each sheet beyond what its worker has, bytes.

    Yields
    ------
    tuple[int, GradeReport]
        The number of a sheet, from 0, and its report, as soon as it is there.

    Raises
    ------
    DhkitError
        A worker has another dhkit or none, or the connection is lost.

    Examples
    --------
    >>> from pathlib import Path
    >>> from dhkit.description import library_robot
    >>> from dhkit.grading.sheets import find_sheets
    >>> judge = ClassJudge(robot=library_robot("planar2r"))
    >>> with connected("local:2") as client:                                # doctest: +SKIP
    ...     reports = dict(grade_many(client, find_sheets([Path("class")]), judge))
    """
    prepare(client)
    sent: list[int] = []
    refused: list[NumberedReport] = []

    def tasks() -> Iterator[JudgeTask]:
        for number, sheet in enumerate(sheets):
            error = sheet.error
            if not error:
                try:
                    task = JudgeTask.of(sheet, judge, seconds, memory)
                except (DhkitError, OSError) as problem:
                    error = str(problem)
                else:
                    sent.append(number)
                    yield task
            if error:
                refused.append((number, with_origin(GradeReport(error=error), sheet, 0.0)))

    for task_number, answer in completed(client, judged_elsewhere, tasks()):
        number = sent[task_number]
        yield number, with_origin(report_of(answer), sheets[number], 0.0)
        while refused:
            yield refused.pop()
    yield from refused
