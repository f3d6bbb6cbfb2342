"""Marks of a class as CSV: a row for each sheet, a column for each quantity."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from itertools import chain
from pathlib import PurePath

from dhkit.grading.grade_report import GradeReport
from dhkit.grading.marks import Marks
from dhkit.grading.reports.sentences import plain, points

_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠")
"""First characters of a text that a spreadsheet would compute."""
_NUMBER = re.compile(r"[+-]?[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]+)?")
_AFTER_POINTS = ("verdict", "judged at", "missing", "left out", "mistakes", "error", "kind")
"""Columns after the points of the quantities."""
_LATENESS = ("handed in", "before", "late")
"""Columns of a class whose export says when sheets were handed in: time, points before lateness, lateness."""
_ORIGIN = ("sheet", "robot", "digest", "version")
"""Last columns: fields of a report that name the file judged and the program that judged it."""


def cell(text: str) -> str:
    """Return text that a spreadsheet does not compute: with a leading apostrophe if it might be a formula.

    Examples
    --------
    >>> cell("=1+1"), cell("-2.5"), cell("ada")
    ("'=1+1", '-2.5', 'ada')
    """
    return f"'{text}" if text.startswith(_FORMULA) and not _NUMBER.fullmatch(text) else text


def marks_key(report: GradeReport) -> tuple[str, str]:
    """Return the cells of a report's row that tell it from the others: student and sheet."""
    return cell(plain(report.student)), cell(plain(report.sheet or ""))


def marks_csv(reports: Sequence[GradeReport], marks: Sequence[Marks]) -> str:
    """Return the marks of sheets as CSV text, in the order given."""
    all_marks = chain.from_iterable(sheet.quantities for sheet in marks)
    quantities = list(dict.fromkeys(mark.name for mark in all_marks))
    lateness = _LATENESS if any(report.handed_in for report in reports) else ()
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(
        [
            "student",
            "points",
            "most",
            *lateness,
            *(cell(plain(name)) for name in quantities),
            *_AFTER_POINTS,
            *_ORIGIN,
        ]
    )
    for report, sheet in zip(reports, marks, strict=True):
        by_quantity = {mark.name: points(mark.points) for mark in sheet.quantities}
        row = [
            report.student,
            points(sheet.points),
            points(sheet.most),
            *((report.handed_in, points(sheet.before), sheet.late) if lateness else ()),
            *(by_quantity.get(quantity, "") for quantity in quantities),
            report.verdict.value,
            ", ".join(f"{name} = {value:g}" for name, value in report.at_values.items()),
            " ".join(report.missing),
            "; ".join(report.left_out),
            " ".join(dict.fromkeys(one.mistake for one in report.diagnosis if one.mistake)),
            report.fault,
            PurePath(report.sheet or "").suffix.removeprefix("."),
            *(getattr(report, name) or "" for name in _ORIGIN),
        ]
        writer.writerow([cell(plain(text)) for text in row])
    return file.getvalue()
