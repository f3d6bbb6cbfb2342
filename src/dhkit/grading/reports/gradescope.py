"""Reports as the ``results.json`` of a Gradescope autograder."""

from __future__ import annotations

from dhkit.grading.grade_report import GradeReport
from dhkit.grading.marks import Marks
from dhkit.grading.reports.cases import Case, cases
from dhkit.grading.reports.sentences import (
    diagnosis_lines,
    plain,
    provenance,
    remark_lines,
    summary,
)


def gradescope(report: GradeReport, marks: Marks) -> dict[str, object]:
    """Return the object of ``results.json``: a test for each entry, and one for each missing quantity.

    Source: Gradescope, Autograder Specifications, "Output Format".
    """
    lines = [
        summary(report, marks),
        *diagnosis_lines(report),
        *remark_lines(report),
        *([provenance(report)] if report.digest else []),
    ]
    facts = {"version": report.version, "robot": report.robot, "digest": report.digest}
    return {
        "score": marks.points,
        "execution_time": round(report.seconds, 3),
        "output": "\n".join(lines),
        "output_format": "text",
        "test_output_format": "text",
        "visibility": "visible",
        "tests": [_test(case) for case in cases(report, marks)],
        "extra_data": {"max_score": marks.most, **facts},
    }


def _test(case: Case) -> dict[str, object]:
    verdict = [] if case.verdict is None else [case.verdict.value]
    return {
        "name": plain(case.mark.name),
        "score": case.mark.points,
        "max_score": case.mark.most,
        "status": "passed" if case.passes else "failed",
        "output": "\n".join([*verdict, *case.lines, *case.diagnosis]),
        "output_format": "text",
        "visibility": "visible",
    }
