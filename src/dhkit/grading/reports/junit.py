"""Judgements as JUnit's XML, which continuous integration shows: a suite a sheet, a case an entry."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from dhkit.grading.marks import Mark, Marks
from dhkit.grading.report import Entry, GradeReport, Verdict
from dhkit.grading.reports.plain import plain, points
from dhkit.grading.reports.sentences import found, summary, told

OUTCOMES = {
    Verdict.WRONG: "failure",
    Verdict.INCOMPLETE: "failure",
    Verdict.UNREADABLE: "error",
    Verdict.UNDECIDED: "skipped",
}
"""What a case holds that did not simply pass."""


def junit(reports: Sequence[GradeReport], marks: Sequence[Marks]) -> str:
    """Return XML: what is wrong is a failure, what cannot be read an error, what is undecided skipped."""
    root = Element("testsuites", name="dhkit grade")
    for report, mark in zip(reports, marks, strict=True):
        _suite(root, report, mark)
    indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"


def _suite(root: Element, report: GradeReport, marks: Marks) -> None:
    name = plain(report.student or report.sheet or report.robot or "answers", 200)
    suite = SubElement(root, "testsuite", name=name, time=f"{report.seconds:.3f}")
    properties = SubElement(suite, "properties")
    facts = {
        "sheet": report.sheet or "",
        "robot": report.robot,
        "digest": report.digest,
        "version": report.version,
        "verdict": report.conclusion,
        "missing": ", ".join(report.missing),
        "left out": "; ".join(report.left_out),
        "points": points(marks.points),
        "most": points(marks.most),
    }
    for key, value in facts.items():
        SubElement(properties, "property", name=key, value=plain(value, 400))
    if report.error or not report.entries:
        case = SubElement(suite, "testcase", classname=name, name="sheet", time="0")
        SubElement(case, "error", message=summary(report, marks), type="unreadable")
    for entry, mark in zip(report.entries, marks.entries, strict=False):
        _case(suite, report, entry, mark)
    for mark in marks.quantities:
        if mark.rule:
            case = SubElement(suite, "testcase", classname=plain(mark.name), name=plain(mark.name), time="0")
            SubElement(case, "failure", message=mark.rule, type="missing")
    counts = {"failures": "failure", "errors": "error", "skipped": "skipped"}
    suite.set("tests", str(len(suite.findall("testcase"))))
    for attribute, outcome in counts.items():
        suite.set(attribute, str(len(suite.findall(f"testcase/{outcome}"))))


def _case(suite: Element, report: GradeReport, entry: Entry, mark: Mark) -> None:
    case = SubElement(suite, "testcase", classname=plain(entry.quantity), name=plain(entry.name), time="0")
    outcome = OUTCOMES.get(entry.verdict)
    if entry.verdict is Verdict.UNDECIDED and report.proof_required:
        outcome = "failure"
    if outcome is None:
        return
    lines = [*told(entry, mark), *found(report, entry)]
    message = next(found(report, entry), lines[-1] if lines else entry.verdict.value)
    told_here = SubElement(case, outcome, message=message)
    if outcome != "skipped":
        told_here.set("type", entry.verdict.value)
    told_here.text = "\n".join(lines)
