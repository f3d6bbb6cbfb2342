"""Marks of a class as CSV: a row for each file, a column for each quantity or goal; and the sum of each student."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from itertools import chain
from math import fsum
from pathlib import PurePath

from dhkit.grading.grade_report import GradeReport, Verdict
from dhkit.grading.marks import Marks
from dhkit.grading.remarks import NoteKind
from dhkit.grading.reports.notes import note_text
from dhkit.grading.reports.sentences import equal_records, plain, points

_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠")
"""First characters of a text that a spreadsheet would compute."""
_NUMBER = re.compile(r"[+-]?[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]+)?")
_AFTER_POINTS = ("verdict", "judged at", "missing", "left out", "mistakes", "error", "kind")
"""Columns after the points of the quantities."""
_LATENESS = ("handed in", "before", "late")
"""Columns of a class whose export says when sheets were handed in: time, points before lateness, lateness."""
_LAB = ("last goal", "not checked again", "notes")
"""Columns of a class with lab records: time of the last goal, goals on the record's word, what a person should know."""
TOTALS_COLUMNS = ("student", "points", "most")
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
    lab = _LAB if any(report.is_lab_record for report in reports) else ()
    equal = {id(report): other for report, other in equal_records(reports)} if lab else {}
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
            *lab,
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
            _kind(report),
            *(_lab_cells(report, equal.get(id(report))) if lab else ()),
            *(getattr(report, name) or "" for name in _ORIGIN),
        ]
        writer.writerow([cell(plain(text)) for text in row])
    return file.getvalue()


def _kind(report: GradeReport) -> str:
    """Return the kind of a file: its suffix, or lab for the record of a lab."""
    if report.is_lab_record:
        return "lab"
    return PurePath(report.sheet or "").suffix.removeprefix(".")


def _lab_cells(report: GradeReport, equal: GradeReport | None) -> tuple[str, str, str]:
    """Return the cells of a row below the columns of lab records, which are empty for a sheet.

    Parameters
    ----------
    report
        The report of the row.
    equal
        Report of another student's record that began and ended at the same seconds; None if there is none.
    """
    if not report.is_lab_record:
        return "", "", ""
    last = ""
    notes = []
    for note in report.notes:
        if note.kind is NoteKind.LAB_WORK:
            last = note.values[1]
        else:
            notes.append(note_text(note))
    if equal is not None:
        notes.append(f"began and ended at the same seconds as {equal.sheet}")
    recorded = sum(entry.verdict is Verdict.RECORDED for entry in report.entries)
    return last, str(recorded), "; ".join(notes)


def totals_csv(reports: Sequence[GradeReport], marks: Sequence[Marks]) -> str:
    """Return the points of each student as CSV text, in the order of their first rows.

    Sheets and lab records are two parts of the whole, and of each part the file with the most points counts. A student
    without one of them has no points for it, out of those that the others could get.

    Parameters
    ----------
    reports, marks
        Reports and marks of all rows that count.
    """
    most_of_part: dict[bool, float] = {}
    best: dict[str, dict[bool, float]] = {}
    for report, of_file in zip(reports, marks, strict=True):
        part = report.is_lab_record
        most_of_part[part] = max(of_file.most, most_of_part.get(part, 0.0))
        own = best.setdefault(report.student, {})
        own[part] = max(of_file.points, own.get(part, 0.0))
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(TOTALS_COLUMNS)
    most = fsum(most_of_part.values())
    for student, of_parts in best.items():
        got = fsum(of_parts.values())
        writer.writerow([cell(plain(student)), points(got), points(most)])
    return file.getvalue()
