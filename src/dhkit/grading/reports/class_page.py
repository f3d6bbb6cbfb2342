"""A class on one page: who got how many points, which mistakes were made, and every sheet below."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from dhkit.grading.marks import Marks
from dhkit.grading.report import GradeReport
from dhkit.grading.reports.html import badge, page, sections, text
from dhkit.grading.reports.plain import points
from dhkit.grading.reports.sentences import mistakes_of, own_robots


def html_class(reports: Sequence[GradeReport], marks: Sequence[Marks], title: str = "Class") -> str:
    """Return a class's page; the sheets in the order given."""
    warnings = [f'<p class="error">{text(line)}</p>' for line in own_robots(reports)]
    parts = [*warnings, *_mistakes(reports), "<h2>Marks</h2>", _table(reports, marks)]
    for number, (report, sheet) in enumerate(zip(reports, marks, strict=True), start=1):
        parts.append(f'<section id="sheet-{number}">\n<h2>{_name(report, number)}</h2>')
        parts += [*sections(report, sheet), "</section>"]
    return page(title, "\n".join(parts))


def _name(report: GradeReport, number: int) -> str:
    return text(report.student or report.sheet or f"sheet {number}", 120)


def _table(reports: Sequence[GradeReport], marks: Sequence[Marks]) -> str:
    quantities = list(dict.fromkeys(mark.name for sheet in marks for mark in sheet.quantities))
    heads = "".join(f"<th>{text(head, 40)}</th>" for head in ("student", "verdict", "points", *quantities))
    rows = [f"<tr>{heads}</tr>"]
    for number, (report, sheet) in enumerate(zip(reports, marks, strict=True), start=1):
        reached = {mark.name: points(mark.points) for mark in sheet.quantities}
        numbers = [f"{points(sheet.points)} of {points(sheet.most)}", *(reached.get(name, "") for name in quantities)]
        cells = "".join(f'<td class="number">{cell}</td>' for cell in numbers)
        link = f'<a href="#sheet-{number}">{_name(report, number)}</a>'
        rows.append(f"<tr><td>{link}</td><td>{badge(report.verdict)} {_at(report)}</td>{cells}</tr>")
    return '<div class="wide"><table>' + "\n".join(rows) + "</table></div>"


def _at(report: GradeReport) -> str:
    return text(report.conclusion.removeprefix(report.verdict.value).removeprefix(", ")) if not report.error else ""


def _mistakes(reports: Sequence[GradeReport]) -> Iterator[str]:
    """Yield a bar for each mistake, as long as the share of the sheets that have it."""
    mistakes = mistakes_of(reports)
    if not mistakes:
        return
    yield f"<h2>Mistakes, and on how many of {len(reports)} sheets</h2>\n<table>"
    for name, count in mistakes:
        width = 100 * count / len(reports)
        bar = f'<td class="bar"><i style="width:{width:.1f}%"></i></td>'
        yield f'<tr><td>{text(name, 80)}</td><td class="number">{count}</td>{bar}</tr>'
    yield "</table>"
