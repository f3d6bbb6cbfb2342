"""A judgement as the ``results.json`` that a Gradescope autograder leaves behind."""

from __future__ import annotations

from typing import Any

from dhkit.grading.marks import Mark, Marks
from dhkit.grading.report import Entry, GradeReport
from dhkit.grading.reports.plain import plain
from dhkit.grading.reports.sentences import found, provenance, remarks, summary, told


def gradescope(report: GradeReport, marks: Marks) -> dict[str, Any]:
    """Return what Gradescope shows a student: a test for each entry, and one for each quantity that is missing.

    Source: Gradescope, Autograder Specifications, "Output Format".
    """
    tests = [_test(report, entry, mark) for entry, mark in zip(report.entries, marks.entries, strict=False)]
    tests += [_missing(mark) for mark in marks.quantities if mark.rule]
    return {
        "score": marks.points,
        "execution_time": round(report.seconds, 3),
        "output": "\n".join([summary(report, marks), *found(report), *remarks(report), provenance(report)]),
        "output_format": "text",
        "test_output_format": "text",
        "visibility": "visible",
        "tests": tests,
        "extra_data": {
            "max_score": marks.most,
            "version": report.version,
            "robot": report.robot,
            "digest": report.digest,
        },
    }


def _test(report: GradeReport, entry: Entry, mark: Mark) -> dict[str, Any]:
    return {
        "name": plain(entry.name),
        "score": mark.points,
        "max_score": mark.most,
        "status": "passed" if entry.verdict.passes else "failed",
        "output": "\n".join([entry.verdict.value, *told(entry, mark), *found(report, entry)]),
        "output_format": "text",
        "visibility": "visible",
    }


def _missing(mark: Mark) -> dict[str, Any]:
    return {
        "name": plain(mark.name),
        "score": mark.points,
        "max_score": mark.most,
        "status": "failed",
        "output": mark.rule,
        "output_format": "text",
        "visibility": "visible",
    }
