"""Reports as JSON, which programs read and which can be marked again."""

from __future__ import annotations

import json as jsons
from collections.abc import Iterator
from pathlib import Path

from pydantic import ValidationError

from dhkit.description.files import read_bounded
from dhkit.errors import AnswerError, DescriptionError
from dhkit.grading.bounds import BOUNDS
from dhkit.grading.grade_report import GradeReport
from dhkit.grading.marks import Marks
from dhkit.grading.rubric import Feedback


def json_report(
    report: GradeReport, marks: Marks, feedback: Feedback = "full"
) -> dict[str, object]:
    """Return a report with its marks as plain data.

    Parameters
    ----------
    report, marks
        Report to be shown, reduced already if ``feedback`` is not ``"full"``.
    feedback
        How much of the report is shown; only ``"full"`` reports can be marked again.
    """
    verdict = {"verdict": report.verdict.value, "points": marks.points, "most": marks.most}
    return verdict | report.data() | {"marks": marks.data(), "feedback": feedback}


def report_of(text: str | bytes) -> GradeReport:
    """Return the report in a JSON text; every field is checked, so that its writer need not be trusted.

    Raises
    ------
    ValueError
        No JSON, or no report: a field is missing, of another type, or not finite.
    """
    try:
        report = GradeReport.from_data(jsons.loads(text))
        report.to_json().encode()  # refuses NaN, infinity and lone surrogates
    except RecursionError:
        raise ValueError("nested too deep") from None
    return report


def read_reports(path: Path) -> Iterator[GradeReport]:
    """Yield the reports of a file of JSON: one on each line, or a single one.

    Raises
    ------
    AnswerError
        No such file, no reports, or reports that were reduced for students.
    """
    try:
        text = read_bounded(path, BOUNDS.report_file_bytes).decode().strip()
    except DescriptionError as error:
        raise AnswerError(str(error).replace("expected a robot file", "expected reports")) from None
    except UnicodeDecodeError as error:
        raise AnswerError(
            f"{path}: byte {error.start} is not UTF-8; expected reports in JSON"
        ) from None
    lines = [text] if _is_json(text) else text.splitlines()
    for number, line in enumerate(lines, start=1):
        if line.strip():
            yield _read_report(line, f"{path}: line {number}" if len(lines) > 1 else str(path))


def _read_report(text: str, place: str) -> GradeReport:
    try:
        feedback = jsons.loads(text).get("feedback", "full")
        report = report_of(text)
    except (ValueError, AttributeError, RecursionError) as error:
        raise AnswerError(
            f"{place}: {_fault(error)}; expected a report as `dhkit grade --json` writes it"
        ) from None
    if feedback != "full":
        raise AnswerError(
            f"{place}: feedback: found {str(feedback)[:60]!r}; expected 'full': no other can be marked again"
        )
    return report


def _fault(error: Exception) -> str:
    """Return the fault of a report in one line."""
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        place = ".".join(str(part)[:80] for part in first["loc"])
        return f"{place}: {first['msg']}" if place else first["msg"]
    return "no JSON" if isinstance(error, jsons.JSONDecodeError) else "no report"


def _is_json(text: str) -> bool:
    try:
        jsons.loads(text)
    except (ValueError, RecursionError):
        return False
    return True
