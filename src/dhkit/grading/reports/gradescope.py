"""Reports as the ``results.json`` of a Gradescope autograder."""

from __future__ import annotations

from dhkit.grading.marks import Mark, Marks
from dhkit.grading.report import GradeReport
from dhkit.grading.reports.sentences import (
    diagnosis_lines,
    entry_lines,
    plain,
    provenance,
    remark_lines,
    summary,
)


def gradescope(report: GradeReport, marks: Marks) -> dict[str, object]:
    """Return the object of ``results.json``: a test for each entry, and one for each missing quantity.

    Source: Gradescope, Autograder Specifications, "Output Format".
    """
    tests = [
        _test(
            mark,
            entry.verdict.passes,
            [entry.verdict.value, *entry_lines(entry, mark), *diagnosis_lines(report, entry)],
        )
        for entry, mark in zip(report.entries, marks.entries, strict=False)
    ]
    tests += [_test(mark, False, [mark.rule]) for mark in marks.quantities if mark.rule]
    lines = [summary(report, marks), *diagnosis_lines(report), *remark_lines(report), provenance(report)]
    facts = {"version": report.version, "robot": report.robot, "digest": report.digest}
    return {
        "score": marks.points,
        "execution_time": round(report.seconds, 3),
        "output": "\n".join(lines),
        "output_format": "text",
        "test_output_format": "text",
        "visibility": "visible",
        "tests": tests,
        "extra_data": {"max_score": marks.most, **facts},
    }


def _test(mark: Mark, passed: bool, lines: list[str]) -> dict[str, object]:
    return {
        "name": plain(mark.name),
        "score": mark.points,
        "max_score": mark.most,
        "status": "passed" if passed else "failed",
        "output": "\n".join(lines),
        "output_format": "text",
        "visibility": "visible",
    }
