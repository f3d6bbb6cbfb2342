"""Reports as JUnit XML, which continuous integration shows: a suite for each sheet, a case for each entry."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from dhkit.grading.grade_report import GradeReport, Verdict
from dhkit.grading.marks import Marks
from dhkit.grading.reports.cases import Case, cases
from dhkit.grading.reports.sentences import plain, points, summary

_OUTCOMES = {
    Verdict.WRONG: "failure",
    Verdict.INCOMPLETE: "failure",
    Verdict.UNREADABLE: "error",
    Verdict.SAMPLED: "skipped",
    Verdict.RECORDED: "skipped",
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
    for one in cases(report, marks):
        _add_case(suite, one)
    suite.set("tests", str(len(suite.findall("testcase"))))
    for attribute, outcome in (
        ("failures", "failure"),
        ("errors", "error"),
        ("skipped", "skipped"),
    ):
        suite.set(attribute, str(len(suite.findall(f"testcase/{outcome}"))))


def _add_case(suite: Element, one: Case) -> None:
    case = SubElement(
        suite, "testcase", classname=plain(one.quantity), name=plain(one.mark.name), time="0"
    )
    if one.verdict is None:
        SubElement(case, "failure", message=one.mark.rule, type="missing")
        return
    outcome = _OUTCOMES.get(one.verdict)
    if outcome is None:
        return
    if outcome == "skipped" and not one.passes:
        outcome = "failure"
    lines = [*one.lines, *one.diagnosis]
    message = [*one.diagnosis[:1], *lines[-1:], one.verdict.value][0]
    element = SubElement(case, outcome, message=message)
    if outcome != "skipped":
        element.set("type", one.verdict.value)
    element.text = "\n".join(lines)
