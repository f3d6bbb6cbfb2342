"""Reports as JUnit XML, which continuous integration shows: a suite for each sheet, a case for each entry."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from dhkit.grading.marks import Mark, Marks
from dhkit.grading.report import Entry, GradeReport, Verdict
from dhkit.grading.reports.sentences import diagnosis_lines, entry_lines, plain, points, summary

OUTCOMES = {
    Verdict.WRONG: "failure",
    Verdict.INCOMPLETE: "failure",
    Verdict.UNREADABLE: "error",
    Verdict.SAMPLED: "skipped",
    Verdict.UNDECIDED: "skipped",
}
"""Element inside the case of an entry that does not simply pass."""


def junit(reports: Sequence[GradeReport], marks: Sequence[Marks]) -> str:
    """Return XML in which wrong entries are failures, unreadable ones errors, those without proof skipped."""
    root = Element("testsuites", name="dhkit grade")
    for report, mark in zip(reports, marks, strict=True):
        _add_suite(root, report, mark)
    indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"


def _add_suite(root: Element, report: GradeReport, marks: Marks) -> None:
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
        _add_case(suite, report, entry, mark)
    for mark in marks.quantities:
        if mark.rule:
            case = SubElement(suite, "testcase", classname=plain(mark.name), name=plain(mark.name), time="0")
            SubElement(case, "failure", message=mark.rule, type="missing")
    suite.set("tests", str(len(suite.findall("testcase"))))
    for attribute, outcome in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        suite.set(attribute, str(len(suite.findall(f"testcase/{outcome}"))))


def _add_case(suite: Element, report: GradeReport, entry: Entry, mark: Mark) -> None:
    case = SubElement(suite, "testcase", classname=plain(entry.quantity), name=plain(entry.name), time="0")
    outcome = OUTCOMES.get(entry.verdict)
    if outcome == "skipped" and report.proof_required:
        outcome = "failure"
    if outcome is None:
        return
    diagnosis = list(diagnosis_lines(report, entry))
    lines = [*entry_lines(entry, mark), *diagnosis]
    message = [*diagnosis[:1], *lines[-1:], entry.verdict.value][0]
    element = SubElement(case, outcome, message=message)
    if outcome != "skipped":
        element.set("type", entry.verdict.value)
    element.text = "\n".join(lines)
