"""Reports of judged sheets in all forms: terminal, JSON, HTML, JUnit XML, CSV, and results for teaching platforms."""

from dhkit.grading.reports.class_page import html_class
from dhkit.grading.reports.gradescope import gradescope
from dhkit.grading.reports.html import html_report
from dhkit.grading.reports.json import json_report, read_reports, report_of
from dhkit.grading.reports.junit import junit
from dhkit.grading.reports.marks_csv import marks_csv, totals_csv
from dhkit.grading.reports.prairielearn import prairielearn
from dhkit.grading.reports.sentences import with_feedback
from dhkit.grading.reports.terminal import terminal_class, terminal_report

__all__ = [
    "gradescope",
    "html_class",
    "html_report",
    "json_report",
    "junit",
    "marks_csv",
    "prairielearn",
    "read_reports",
    "report_of",
    "terminal_class",
    "terminal_report",
    "totals_csv",
    "with_feedback",
]
