"""The marks of a class as CSV: a row a sheet, a column a quantity."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence

from dhkit.grading.marks import Marks
from dhkit.grading.report import GradeReport
from dhkit.grading.reports.plain import plain, points

FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠")
"""How a text begins that a spreadsheet would compute."""
NUMBER = re.compile(r"[+-]?[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]+)?")


def cell(text: str) -> str:
    """Return text that a spreadsheet takes for text: with a leading apostrophe where it might compute it.

    Examples
    --------
    >>> cell("=1+1"), cell("-2.5"), cell("ada")
    ("'=1+1", '-2.5', 'ada')
    """
    return f"'{text}" if text.startswith(FORMULA) and not NUMBER.fullmatch(text) else text


def marks_csv(reports: Sequence[GradeReport], marks: Sequence[Marks]) -> str:
    """Return the marks, the students in the order given."""
    quantities = list(dict.fromkeys(mark.name for sheet in marks for mark in sheet.quantities))
    names = [cell(plain(quantity)) for quantity in quantities]
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(
        [
            "student",
            "points",
            "most",
            *names,
            "verdict",
            "judged at",
            "missing",
            "left out",
            "mistakes",
            "error",
            *ORIGIN,
        ]
    )
    for report, sheet in zip(reports, marks, strict=True):
        reached = {mark.name: points(mark.points) for mark in sheet.quantities}
        mistakes = dict.fromkeys(one.mistake for one in report.diagnosis if one.mistake)
        row = [
            report.student,
            points(sheet.points),
            points(sheet.most),
            *(reached.get(quantity, "") for quantity in quantities),
            report.verdict.value,
            ", ".join(f"{name} = {value:g}" for name, value in report.judged_at.items()),
            " ".join(report.missing),
            "; ".join(report.left_out),
            " ".join(mistakes),
            report.fault,
            *(getattr(report, name) or "" for name in ORIGIN),
        ]
        writer.writerow([cell(plain(text)) for text in row])
    return file.getvalue()


ORIGIN = ("sheet", "robot", "digest", "version")
"""Fields of a report that say what was judged by what."""
