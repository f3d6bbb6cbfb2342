"""Reports as the ``results.json`` of a PrairieLearn external grader."""

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


def prairielearn(report: GradeReport, marks: Marks) -> dict[str, object]:
    """Return the object of ``results.json``: a test for each entry, and one for each missing quantity.

    A submission that cannot be read is not gradable: PrairieLearn then takes no attempt from the student.

    Source: PrairieLearn, External Grading, "Grading results".
    """
    if report.error:
        return {"gradable": False, "format_errors": [plain(report.error)]}
    lines = [*diagnosis_lines(report), *remark_lines(report), provenance(report)]
    return {
        "gradable": True,
        "score": marks.points / marks.most if marks.most else 0.0,
        "message": summary(report, marks),
        "output": "\n".join(lines),
        "tests": [_test(case) for case in cases(report, marks)],
    }


def _test(case: Case) -> dict[str, object]:
    return {
        "name": plain(case.mark.name),
        "points": case.mark.points,
        "max_points": case.mark.most,
        "message": "missing" if case.verdict is None else case.verdict.value,
        "output": "\n".join([*case.lines, *case.diagnosis]),
    }
