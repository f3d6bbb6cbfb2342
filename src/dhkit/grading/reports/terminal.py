"""A judgement for the terminal: a table of quantities, then what is wrong, entry by entry."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rich.console import Group, RenderableType
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from dhkit.grading.marks import Mark, Marks
from dhkit.grading.report import Entry, GradeReport, Verdict
from dhkit.grading.reports.plain import plain, points
from dhkit.grading.reports.sentences import (
    fault_of,
    found,
    mistakes_of,
    own_robots,
    provenance,
    reading,
    remarks,
    summary,
    told,
)

STYLES = {
    Verdict.CORRECT: "green",
    Verdict.ROUNDED: "green",
    Verdict.UNDECIDED: "yellow",
    Verdict.INCOMPLETE: "yellow",
    Verdict.WRONG: "red",
    Verdict.UNREADABLE: "magenta",
}
BAR = 40
"""Columns of a bar for all sheets."""


def terminal_report(report: GradeReport, marks: Marks, read: bool = False) -> RenderableType:
    """Return a sheet's report: nothing in it is read as markup, or commands the terminal.

    Parameters
    ----------
    report, marks
        Of the sheet.
    read
        Whether to show, before the verdicts, how each entry was read.
    """
    title = ", ".join(plain(part) for part in (report.student, report.sheet or "", report.robot) if part)
    parts: list[RenderableType] = [
        Text.assemble((title or "answers", "bold"), ": ", (summary(report, marks), STYLES[report.verdict]))
    ]
    if read:
        parts += [Text(line, style="blue") for line in reading(report)]
    if report.entries:
        parts.append(_quantities(report, marks))
    for entry, mark in zip(report.entries, marks.entries, strict=False):
        if entry.verdict not in (Verdict.CORRECT, Verdict.ROUNDED, Verdict.INCOMPLETE):
            parts += _entry(entry, mark)
    parts += [Text(line, style="cyan") for line in found(report)]
    parts += [Text(line) for line in remarks(report)]
    return Group(*parts, Text(provenance(report), style="dim"))


def _quantities(report: GradeReport, marks: Marks) -> Table:
    table = _table("quantity", "verdict", "entries", "points")
    for mark in marks.quantities:
        entries = report.of(mark.name)
        right = sum(entry.verdict.passes for entry in entries)
        worst = max((entry.verdict for entry in entries), key=lambda verdict: verdict.severity, default=None)
        table.add_row(
            Text(plain(mark.name)),
            Text(worst.value, STYLES[worst]) if worst else Text(mark.rule, "red"),
            Text(f"{right} of {len(entries)} pass" if entries else ""),
            Text(f"{points(mark.points)} of {points(mark.most)}"),
        )
    return table


def _entry(entry: Entry, mark: Mark) -> Iterator[RenderableType]:
    """Yield an entry's heading, and below it what is said of it."""
    worth = f" ({points(mark.points)} of {points(mark.most)} points)"
    yield Text.assemble((plain(entry.name), "bold"), ": ", (entry.verdict.value, STYLES[entry.verdict]), worth)
    for line in told(entry, mark):
        yield Text(f"  {line}")


def terminal_class(reports: Sequence[GradeReport], marks: Sequence[Marks]) -> RenderableType:
    """Return a class: its sheets with their points, and which mistakes were made how often."""
    table = _table("student", "verdict", "points", "sheet")
    for report, mark in zip(reports, marks, strict=True):
        table.add_row(
            Text(plain(report.student, 60)),
            Text(plain(report.conclusion), STYLES[report.verdict]),
            Text(f"{points(mark.points)} of {points(mark.most)}"),
            Text(fault_of(report) if report.error else plain(report.sheet or "", 120)),
        )
    lines = [Text(line, style="yellow") for line in own_robots(reports)]
    return Group(*lines, table, *_bars(mistakes_of(reports), len(reports)))


def _bars(mistakes: Sequence[tuple[str, int]], sheets: int) -> Iterator[RenderableType]:
    if not mistakes:
        return
    yield Text(f"\nmistakes, and on how many of {sheets} sheets", style="bold")
    table = Table.grid(padding=(0, 2, 0, 0))
    for name, count in mistakes:
        bar = ProgressBar(total=sheets, completed=count, width=BAR, complete_style="red", finished_style="red")
        table.add_row(Text(plain(name, 60)), Text(str(count)), bar)
    yield table


def _table(*headings: str) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in headings:
        table.add_column(Text(heading), justify="right" if heading == "points" else "left", overflow="fold")
    return table
