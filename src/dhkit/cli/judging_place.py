"""Place where the sheets of `dhkit grade` are judged: processes of this machine, or the workers of a cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from dhkit.grading.batch import grade_all, in_order
from dhkit.grading.class_judge import ClassJudge
from dhkit.grading.grade_report import GradeReport
from dhkit.grading.sheets import Sheet


@dataclass(frozen=True)
class JudgingPlace:
    """Place where sheets are judged.

    Attributes
    ----------
    jobs
        Number of processes at a time on this machine; by default one for each core.
    scheduler
        Address of a scheduler of dask whose workers judge instead.
    """

    jobs: int | None = None
    scheduler: str | None = None

    def reports(
        self,
        sheets: Sequence[Sheet],
        judge: ClassJudge,
        seconds: float,
        complete: Callable[[GradeReport], object],
        progress: Callable[[int, int], object] | None,
    ) -> Iterator[GradeReport]:
        """Yield the reports of sheets in their order; ``complete`` gets each as soon as it is made.

        Raises
        ------
        DhkitError
            No scheduler answers, or its workers cannot judge.
        """
        if self.scheduler is None:

            def prepare_next(report: GradeReport) -> None:
                complete(report)
                judge.prepare(report)

            yield from grade_all(
                sheets,
                judge,
                jobs=self.jobs or os.cpu_count() or 1,
                seconds=seconds,
                prepare=prepare_next,
                progress=progress,
            )
        elif sheets:
            from dhkit.scale import connected, grade_many

            with connected(self.scheduler) as client:
                results = grade_many(client, sheets, judge, seconds=seconds)
                yield from in_order(results, len(sheets), complete, progress)


HERE = JudgingPlace()
