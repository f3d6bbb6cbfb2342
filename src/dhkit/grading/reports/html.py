"""Reports as HTML pages without scripts or network access; :mod:`~dhkit.grading.reports.class_page` has a class's."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

from dhkit.grading.bounds import BOUNDS
from dhkit.grading.grade_report import Entry, GradeReport, Verdict, worst_verdict
from dhkit.grading.marks import Mark, Marks
from dhkit.grading.reports import sentences
from dhkit.grading.reports.mathml import mathml
from dhkit.grading.reports.sentences import plain, points_of
from dhkit.page_style import PAGE_STYLE, page

_BADGES = {
    Verdict.CORRECT: ("right", "✓"),
    Verdict.ROUNDED: ("right", "≈"),
    Verdict.SAMPLED: ("open", "∼"),
    Verdict.RECORDED: ("open", "R"),
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
@media print { section { break-before: page; } }
"""
)
"""Style sheet of the pages: light and dark, wide and narrow, screen and paper."""


def html_report(report: GradeReport, marks: Marks) -> str:
    """Return the page of one sheet."""
    title = f"{report.student or report.sheet or 'Answers'}: {report.robot or 'not judged'}"
    return report_page(title, "\n".join(sheet_sections(report, marks)))


def report_page(title: str, body: str, style: str = STYLE) -> str:
    """Return a page with its title as heading around a body that is HTML already."""
    shown = plain(title, 200)
    return page(shown, f"<h1>{escape(shown)}</h1>\n{body}", style, _POLICY)


def sheet_sections(report: GradeReport, marks: Marks) -> Iterator[str]:
    """Yield the parts of a sheet's page below its heading; correct entries come last and folded."""
    conditions = "" if report.error else _conditions(report)
    remark = f" {conditions};" if conditions else ""
    late = escape(sentences.lateness_of(marks))
    yield f'<p class="sum">{badge(report.verdict)}{remark} {points_of(marks)} points{late}</p>'
    if report.error:
        yield f'<p class="error">{html_text(report.error)}</p>'
    if marks.quantities:
        yield _quantities_table(report, marks)
    yield from (
        f'<p class="found">{html_text(line)}</p>' for line in sentences.diagnosis_lines(report)
    )
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
    yield from (f'<p class="note">{html_text(line)}</p>' for line in sentences.remark_lines(report))
    yield f'<p class="note">{html_text(sentences.provenance(report))}</p>'


def _conditions(report: GradeReport) -> str:
    """Return the conclusion without its verdict: the parameter values at which it holds, why it does not pass."""
    return html_text(report.conclusion.removeprefix(report.verdict.value).removeprefix(", "))


def _quantities_table(report: GradeReport, marks: Marks) -> str:
    rows = ["<tr><th>quantity</th><th>verdict</th><th>entries</th><th>points</th></tr>"]
    for mark in marks.quantities:
        worst = worst_verdict(entries := report.of(mark.name))
        verdict = badge(worst) if worst else html_text(mark.rule)
        rows.append(
            f'<tr><td>{html_text(mark.name)}</td><td>{verdict}</td><td class="number">{len(entries)}</td>'
            f'<td class="number">{points_of(mark)}</td></tr>'
        )
    return '<div class="wide"><table>' + "\n".join(rows) + "\n</table></div>"


def _entry(entry: Entry, mark: Mark) -> str:
    rule = f": {html_text(mark.rule)}" if mark.rule and mark.rule != entry.verdict.value else ""
    worth = f'<span class="note">{points_of(mark)} points{rule}</span>'
    lines = [f"<h3>{html_text(entry.name)} {badge(entry.verdict)} {worth}</h3>"]
    if entry.answer:
        lines.append(f'<p>answer</p><div class="wide"><code>{html_text(entry.answer)}</code></div>')
    if entry.latex:
        lines.append(f"<p>read as</p>{_equation(entry.latex, entry.read)}")
    if entry.difference is not None:
        lines.append(
            f"<p>answer less the truth</p>{_equation(entry.difference_latex, entry.difference)}"
        )
    if entry.witness is not None:
        lines.append(f"<p>{html_text(sentences.witness_sentence(entry.witness))}</p>")
    if entry.statement:
        lines.append(f'<p class="note">{html_text(entry.statement)}</p>')
    if entry.follows:
        lines.append(f"<p>right in itself; follows from {html_text(entry.follows)}</p>")
    return "<article>" + "\n".join(lines) + "</article>"


def _equation(latex: str, text: str) -> str:
    """Return an equation as MathML, or as text if the LaTeX cannot be converted."""
    return f'<div class="wide">{mathml(latex) or f"<code>{html_text(text or latex)}</code>"}</div>'


def badge(verdict: Verdict) -> str:
    """Return a verdict in its colour and with its sign."""
    kind, sign = _BADGES[verdict]
    return f'<span class="badge {kind}">{sign} {escape(verdict.value)}</span>'


def html_text(line: str, most: int = BOUNDS.shown_characters) -> str:
    """Return text as HTML: one printable line, in which no character begins a tag or an entity."""
    return escape(plain(line, most))
