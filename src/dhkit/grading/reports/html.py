"""Reports as HTML pages without scripts or network access: one sheet, or a class with its marks and mistakes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from itertools import chain

from dhkit.grading.bounds import BOUNDS
from dhkit.grading.grade_report import Entry, GradeReport, Verdict, worst_verdict
from dhkit.grading.marks import Mark, Marks
from dhkit.grading.reports import sentences
from dhkit.grading.reports.mathml import mathml
from dhkit.grading.reports.sentences import plain, points, points_of
from dhkit.page_style import PAGE_STYLE, page

_BADGES = {
    Verdict.CORRECT: ("right", "✓"),
    Verdict.ROUNDED: ("right", "≈"),
    Verdict.SAMPLED: ("open", "∼"),
    Verdict.UNDECIDED: ("open", "?"),
    Verdict.INCOMPLETE: ("open", "…"),
    Verdict.WRONG: ("wrong", "✗"),
    Verdict.UNREADABLE: ("unread", "!"),
}
"""CSS class of a verdict's badge, and a sign for readers who cannot tell its colours apart."""
_POLICY = "default-src 'none'; style-src 'unsafe-inline'"
"""Content security policy of the pages."""
STYLE = (
    PAGE_STYLE
    + """
h2 { margin-top: 2.5rem; } h3 .note { font-weight: normal; } p { margin: .35rem 0; } .sum { font-size: 1.1rem; }
.error, .found { border-left: 3px solid var(--wrong); padding-left: .7rem; }
.badge { white-space: nowrap; font-weight: 600; }
.right { color: var(--right); } .wrong { color: var(--wrong); } .open { color: var(--open); }
.unread { color: var(--unread); }
.wide { overflow: auto hidden; padding: .2rem 0; } math[display="block"] { margin: 0 0 0 1rem; }
article { border-top: 1px solid var(--line); padding: .7rem 0; break-inside: avoid; }
details { margin-top: 1rem; } summary { cursor: pointer; }
td:first-child { white-space: nowrap; }
td.bar { width: 50%; min-width: 8rem; } td.bar i { display: block; height: .8rem; background: var(--wrong); }
@media print { section { break-before: page; }
  td.bar i { print-color-adjust: exact; -webkit-print-color-adjust: exact; } }
"""
)
"""Style sheet of the pages: light and dark, wide and narrow, screen and paper."""


def html_report(report: GradeReport, marks: Marks) -> str:
    """Return the page of one sheet."""
    title = f"{report.student or report.sheet or 'Answers'}: {report.robot or 'not judged'}"
    return _page(title, "\n".join(_sections(report, marks)))


def html_class(reports: Sequence[GradeReport], marks: Sequence[Marks], title: str = "Class") -> str:
    """Return the page of a class: mistakes with their frequency, a table of marks, then the sheets in order."""
    parts = [f'<p class="error">{_text(line)}</p>' for line in sentences.class_warnings(reports)]
    parts += [*_mistake_bars(reports), "<h2>Marks</h2>", _marks_table(reports, marks)]
    for number, (report, sheet) in enumerate(zip(reports, marks, strict=True), start=1):
        parts.append(f'<section id="sheet-{number}">\n<h2>{_sheet_name(report, number)}</h2>')
        parts += [*_sections(report, sheet), "</section>"]
    return _page(title, "\n".join(parts))


def _page(title: str, body: str) -> str:
    """Return a page with its title as heading around a body that is HTML already."""
    shown = plain(title, 200)
    return page(shown, f"<h1>{escape(shown)}</h1>\n{body}", STYLE, _POLICY)


def _sections(report: GradeReport, marks: Marks) -> Iterator[str]:
    """Yield the parts of a sheet's page below its heading; correct entries come last and folded."""
    conditions = "" if report.error else _conditions(report)
    remark = f" {conditions};" if conditions else ""
    yield f'<p class="sum">{_badge(report.verdict)}{remark} {points_of(marks)} points</p>'
    if report.error:
        yield f'<p class="error">{_text(report.error)}</p>'
    if marks.quantities:
        yield _quantities_table(report, marks)
    yield from (f'<p class="found">{_text(line)}</p>' for line in sentences.diagnosis_lines(report))
    correct = []
    for entry, mark in zip(report.entries, marks.entries, strict=False):
        if entry.verdict in (Verdict.CORRECT, Verdict.ROUNDED):
            correct.append(_entry(entry, mark))
        else:
            yield _entry(entry, mark)
    if correct:
        yield (
            f"<details><summary>{len(correct)} correct</summary>\n"
            + "\n".join(correct)
            + "\n</details>"
        )
    yield from (f'<p class="note">{_text(line)}</p>' for line in sentences.remark_lines(report))
    yield f'<p class="note">{_text(sentences.provenance(report))}</p>'


def _conditions(report: GradeReport) -> str:
    """Return the conclusion without its verdict: the parameter values at which it holds, why it does not pass."""
    return _text(report.conclusion.removeprefix(report.verdict.value).removeprefix(", "))


def _quantities_table(report: GradeReport, marks: Marks) -> str:
    rows = ["<tr><th>quantity</th><th>verdict</th><th>entries</th><th>points</th></tr>"]
    for mark in marks.quantities:
        worst = worst_verdict(entries := report.of(mark.name))
        verdict = _badge(worst) if worst else _text(mark.rule)
        rows.append(
            f'<tr><td>{_text(mark.name)}</td><td>{verdict}</td><td class="number">{len(entries)}</td>'
            f'<td class="number">{points_of(mark)}</td></tr>'
        )
    return '<div class="wide"><table>' + "\n".join(rows) + "\n</table></div>"


def _entry(entry: Entry, mark: Mark) -> str:
    rule = f": {_text(mark.rule)}" if mark.rule and mark.rule != entry.verdict.value else ""
    worth = f'<span class="note">{points_of(mark)} points{rule}</span>'
    lines = [f"<h3>{_text(entry.name)} {_badge(entry.verdict)} {worth}</h3>"]
    if entry.answer:
        lines.append(f'<p>answer</p><div class="wide"><code>{_text(entry.answer)}</code></div>')
    if entry.latex:
        lines.append(f"<p>read as</p>{_equation(entry.latex, entry.read)}")
    if entry.difference is not None:
        lines.append(
            f"<p>answer less the truth</p>{_equation(entry.difference_latex, entry.difference)}"
        )
    if entry.witness is not None:
        lines.append(f"<p>{_text(sentences.witness_sentence(entry.witness))}</p>")
    if entry.statement:
        lines.append(f'<p class="note">{_text(entry.statement)}</p>')
    if entry.follows:
        lines.append(f"<p>right in itself; follows from {_text(entry.follows)}</p>")
    return "<article>" + "\n".join(lines) + "</article>"


def _equation(latex: str, text: str) -> str:
    """Return an equation as MathML, or as text if the LaTeX cannot be converted."""
    return f'<div class="wide">{mathml(latex) or f"<code>{_text(text or latex)}</code>"}</div>'


def _marks_table(reports: Sequence[GradeReport], marks: Sequence[Marks]) -> str:
    """Return the table of a class's marks: a row for each sheet, a column for each quantity."""
    all_marks = chain.from_iterable(sheet.quantities for sheet in marks)
    quantities = list(dict.fromkeys(mark.name for mark in all_marks))
    heads = "".join(
        f"<th>{_text(head, 40)}</th>" for head in ("student", "verdict", "points", *quantities)
    )
    rows = [f"<tr>{heads}</tr>"]
    for number, (report, sheet) in enumerate(zip(reports, marks, strict=True), start=1):
        by_quantity = {mark.name: points(mark.points) for mark in sheet.quantities}
        numbers = [points_of(sheet), *(by_quantity.get(name, "") for name in quantities)]
        cells = "".join(f'<td class="number">{cell}</td>' for cell in numbers)
        link = f'<a href="#sheet-{number}">{_sheet_name(report, number)}</a>'
        conditions = "" if report.error else _conditions(report)
        rows.append(
            f"<tr><td>{link}</td><td>{_badge(report.verdict)} {conditions}</td>{cells}</tr>"
        )
    return '<div class="wide"><table>' + "\n".join(rows) + "</table></div>"


def _mistake_bars(reports: Sequence[GradeReport]) -> Iterator[str]:
    """Yield a bar for each mistake, as long as the share of the sheets that have it."""
    counts = sentences.mistake_counts(reports)
    if not counts:
        return
    yield f"<h2>Mistakes, and on how many of {len(reports)} sheets</h2>\n<table>"
    for name, count in counts:
        bar = f'<td class="bar"><i style="width:{100 * count / len(reports):.1f}%"></i></td>'
        yield f'<tr><td>{_text(name, 80)}</td><td class="number">{count}</td>{bar}</tr>'
    yield "</table>"


def _sheet_name(report: GradeReport, number: int) -> str:
    return _text(report.student or report.sheet or f"sheet {number}", 120)


def _badge(verdict: Verdict) -> str:
    kind, sign = _BADGES[verdict]
    return f'<span class="badge {kind}">{sign} {escape(verdict.value)}</span>'


def _text(line: str, most: int = BOUNDS.shown_characters) -> str:
    """Return text as HTML: one printable line, in which no character begins a tag or an entity."""
    return escape(plain(line, most))
