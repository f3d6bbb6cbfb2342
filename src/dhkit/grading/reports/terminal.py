"""Reports for the terminal: a table of quantities, then the entries that are not correct, one by one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rich.console import Group, RenderableType
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from dhkit.grading.grade_report import GradeReport, Verdict, worst_verdict
from dhkit.grading.marks import Marks
from dhkit.grading.reports import sentences
from dhkit.grading.reports.sentences import plain, points_of

_STYLES = {
    Verdict.CORRECT: "green",
    Verdict.ROUNDED: "green",
    Verdict.SAMPLED: "yellow",
    Verdict.RECORDED: "yellow",
    Verdict.UNDECIDED: "yellow",
    Verdict.INCOMPLETE: "yellow",
    Verdict.WRONG: "red",
    Verdict.UNREADABLE: "magenta",
}
_BAR_COLUMNS = 40
"""Width of a mistake's bar if all sheets have the mistake, in columns of the terminal."""


def terminal_report(report: GradeReport, marks: Marks, read: bool = False) -> RenderableType:
    """Return the report of one sheet; no text in it is taken for markup or for a command to the terminal.

    Parameters
    ----------
    report, marks
        Report and marks of the sheet.
    read
        Whether to show, before the verdicts, how each entry was read.
    """
    title = ", ".join(
        plain(part) for part in (report.student, report.sheet or "", report.robot) if part
    )
    verdict = (sentences.summary(report, marks), _STYLES[report.verdict])
    parts: list[RenderableType] = [Text.assemble((title or "answers", "bold"), ": ", verdict)]
    if read:
        parts += [Text(line, style="blue") for line in sentences.reading_lines(report)]
    if report.entries:
        parts.append(_quantities_table(report, marks))
    for entry, mark in zip(report.entries, marks.entries, strict=False):
        if entry.verdict not in (Verdict.CORRECT, Verdict.ROUNDED, Verdict.INCOMPLETE):
            worth = f" ({points_of(mark)} points)"
            verdict = (entry.verdict.value, _STYLES[entry.verdict])
            parts.append(Text.assemble((plain(entry.name), "bold"), ": ", verdict, worth))
            parts += [Text(f"  {line}") for line in sentences.entry_lines(entry, mark)]
    parts += [Text(line, style="cyan") for line in sentences.diagnosis_lines(report)]
    parts += [Text(line) for line in sentences.remark_lines(report)]
    return Group(*parts, Text(sentences.provenance(report), style="dim"))


def _quantities_table(report: GradeReport, marks: Marks) -> Table:
    table = _table("quantity", "verdict", "entries", "points")
    for mark in marks.quantities:
        entries = report.of(mark.name)
        passed = sum(entry.verdict.passes for entry in entries)
        worst = worst_verdict(entries)
        table.add_row(
            Text(plain(mark.name)),
            Text(worst.value, _STYLES[worst]) if worst else Text(mark.rule, "red"),
            Text(f"{passed} of {len(entries)} pass" if entries else ""),
            Text(points_of(mark)),
        )
    return table


def terminal_class(reports: Sequence[GradeReport], marks: Sequence[Marks]) -> RenderableType:
    """Return the report of a class: its sheets with their points, and how often each mistake was made."""
    table = _table("student", "verdict", "points", "sheet")
    for report, mark in zip(reports, marks, strict=True):
        table.add_row(
            Text(plain(report.student, 60)),
            Text(plain(report.conclusion), _STYLES[report.verdict]),
            Text(points_of(mark) + sentences.lateness_of(mark)),
            Text(sentences.fault_of(report) if report.error else plain(report.sheet or "", 120)),
        )
    lines = [Text(line, style="yellow") for line in sentences.class_warnings(reports)]
    return Group(*lines, table, *_mistake_bars(sentences.mistake_counts(reports), len(reports)))


def _mistake_bars(counts: Sequence[tuple[str, int]], sheets: int) -> Iterator[RenderableType]:
    if not counts:
        return
    yield Text(f"\nmistakes, and on how many of {sheets} sheets", style="bold")
    table = Table.grid(padding=(0, 2, 0, 0))
    for name, count in counts:
        bar = ProgressBar(
            total=sheets,
            completed=count,
            width=_BAR_COLUMNS,
            complete_style="red",
            finished_style="red",
        )
        table.add_row(Text(plain(name, 60)), Text(str(count)), bar)
    yield table


def _table(*headings: str) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in headings:
        table.add_column(
            Text(heading), justify="right" if heading == "points" else "left", overflow="fold"
        )
    return table
