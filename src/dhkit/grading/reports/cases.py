"""A sheet as a table of cases: one for each entry, and one for each quantity that is missing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from dhkit.grading.grade_report import GradeReport, Verdict
from dhkit.grading.marks import Mark, Marks
from dhkit.grading.reports.sentences import diagnosis_lines, entry_lines


@dataclass(frozen=True)
class Case:
    """A row of a sheet's report.

    Attributes
    ----------
    quantity
        The quantity that the case is about.
    mark
        Its name, points and rule.
    verdict
        Verdict on the entry; None of a quantity that is missing.
    passes
        Whether it has the points that it may have as far as the verdict says.
    lines
        Statement about the entry.
    diagnosis
        Mistakes that explain it.
    """

    quantity: str
    mark: Mark
    verdict: Verdict | None
    passes: bool
    lines: tuple[str, ...] = ()
    diagnosis: tuple[str, ...] = ()


def cases(report: GradeReport, marks: Marks) -> Iterator[Case]:
    """Yield the cases of a sheet, entries first."""
    for entry, mark in zip(report.entries, marks.entries, strict=False):
        is_proved = entry.verdict.is_proved or not report.proof_required
        yield Case(
            entry.quantity,
            mark,
            entry.verdict,
            entry.verdict.passes and is_proved,
            tuple(entry_lines(entry, mark)),
            tuple(diagnosis_lines(report, entry)),
        )
    for mark in marks.quantities:
        if mark.rule:
            yield Case(mark.name, mark, None, passes=False, lines=(mark.rule,))
