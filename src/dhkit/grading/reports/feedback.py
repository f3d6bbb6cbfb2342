"""How much of a report is told: all, where to look, or verdicts alone."""

from __future__ import annotations

from dataclasses import replace

from dhkit.grading.report import Diagnosis, Entry, GradeReport
from dhkit.grading.rubric import Feedback


def with_feedback(report: GradeReport, level: Feedback) -> GradeReport:
    """Return what of a report is told.

    With ``"verdict"``, verdicts alone; with ``"hint"``, verdicts and where to look, without differences and names of
    mistakes. What is left out cannot be marked again: marks are made of full reports.
    """
    if level == "full":
        return report
    told = report.diagnosis if level == "hint" else ()
    hints = dict.fromkeys(Diagnosis(None, one.hint, one.where, one.entries, one.hint) for one in told if one.hint)
    entries = tuple(_told(entry, level) for entry in report.entries)
    notes = report.notes if level == "hint" else ()  # they say which parts agree
    return replace(report, entries=entries, diagnosis=tuple(hints), notes=notes)


def _told(entry: Entry, level: Feedback) -> Entry:
    hidden = replace(entry, difference=None, difference_latex="", witness=None)
    if not entry.verdict.passes:
        hidden = replace(hidden, statement="")  # of a wrong entry it may say by how much
    return hidden if level == "hint" else replace(hidden, statement="", latex="", follows="")
