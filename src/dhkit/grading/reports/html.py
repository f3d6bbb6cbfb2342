"""A judgement as one page of HTML: no script, nothing from the network, to be read on a phone and on paper."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

from dhkit.grading.marks import Mark, Marks
from dhkit.grading.report import Entry, GradeReport, Verdict
from dhkit.grading.reports.mathml import mathml
from dhkit.grading.reports.plain import plain, points
from dhkit.grading.reports.sentences import found, provenance, remarks, witness_sentence
from dhkit.grading.reports.style import STYLE

SIGNS = {
    Verdict.CORRECT: ("right", "✓"),
    Verdict.ROUNDED: ("right", "≈"),
    Verdict.UNDECIDED: ("open", "?"),
    Verdict.INCOMPLETE: ("open", "…"),
    Verdict.WRONG: ("wrong", "✗"),
    Verdict.UNREADABLE: ("unread", "!"),
}
"""Class of a verdict's badge, and a sign for those who do not tell its colours."""
POLICY = "default-src 'none'; style-src 'unsafe-inline'"


def html_report(report: GradeReport, marks: Marks) -> str:
    """Return a sheet's page."""
    title = f"{report.student or report.sheet or 'Answers'}: {report.robot or 'not judged'}"
    return page(title, "\n".join(sections(report, marks)))


def page(title: str, body: str) -> str:
    """Return a page around what is already HTML."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{text(title, 200)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<h1>{text(title, 200)}</h1>\n"
        f"{body}\n</body>\n</html>\n"
    )


def sections(report: GradeReport, marks: Marks) -> Iterator[str]:
    """Yield what a page shows of a sheet, below its heading."""
    rest = report.conclusion.removeprefix(report.verdict.value).removeprefix(", ")
    said = f" {text(rest)};" if rest and not report.error else ""
    yield f'<p class="sum">{badge(report.verdict)}{said} {points(marks.points)} of {points(marks.most)} points</p>'
    if report.error:
        yield f'<p class="error">{text(report.error)}</p>'
    if marks.quantities:
        yield _quantities(report, marks)
    yield from (f'<p class="found">{text(line)}</p>' for line in found(report))
    pairs = list(zip(report.entries, marks.entries, strict=False))
    settled = (Verdict.CORRECT, Verdict.ROUNDED)
    yield from (_entry(entry, mark) for entry, mark in pairs if entry.verdict not in settled)
    right = [_entry(entry, mark) for entry, mark in pairs if entry.verdict in settled]
    if right:
        yield f"<details><summary>{len(right)} correct</summary>\n" + "\n".join(right) + "\n</details>"
    yield from (f'<p class="note">{text(line)}</p>' for line in remarks(report))
    yield f'<p class="note">{text(provenance(report))}</p>'


def _quantities(report: GradeReport, marks: Marks) -> str:
    rows = []
    for mark in marks.quantities:
        entries = report.of(mark.name)
        worst = max((entry.verdict for entry in entries), key=lambda verdict: verdict.severity, default=None)
        verdict = badge(worst) if worst else text(mark.rule)
        rows.append(
            f'<tr><td>{text(mark.name)}</td><td>{verdict}</td><td class="number">{len(entries)}</td>'
            f'<td class="number">{points(mark.points)} of {points(mark.most)}</td></tr>'
        )
    head = "<tr><th>quantity</th><th>verdict</th><th>entries</th><th>points</th></tr>"
    return f'<div class="wide"><table>{head}\n' + "\n".join(rows) + "\n</table></div>"


def _entry(entry: Entry, mark: Mark) -> str:
    worth = f"{points(mark.points)} of {points(mark.most)} points"
    rule = f": {text(mark.rule)}" if mark.rule and mark.rule != entry.verdict.value else ""
    lines = [f'<h3>{text(entry.name)} {badge(entry.verdict)} <span class="note">{worth}{rule}</span></h3>']
    if entry.answer:
        lines.append(f'<p>answer</p><div class="wide"><code>{text(entry.answer)}</code></div>')
    if entry.latex:
        lines.append(f"<p>read as</p>{_equation(entry.latex, entry.read)}")
    if entry.difference is not None:
        lines.append(f"<p>answer less the truth</p>{_equation(entry.difference_latex, entry.difference)}")
    if entry.witness is not None:
        lines.append(f"<p>{text(witness_sentence(entry.witness))}</p>")
    if entry.statement:
        lines.append(f'<p class="note">{text(entry.statement)}</p>')
    if entry.follows:
        lines.append(f"<p>right in itself; follows from {text(entry.follows)}</p>")
    return "<article>" + "\n".join(lines) + "</article>"


def _equation(latex: str, otherwise: str) -> str:
    """Return an equation, and as text where it cannot be set."""
    return f'<div class="wide">{mathml(latex) or f"<code>{text(otherwise or latex)}</code>"}</div>'


def badge(verdict: Verdict) -> str:
    """Return a verdict in its colour."""
    kind, sign = SIGNS[verdict]
    return f'<span class="badge {kind}">{sign} {escape(verdict.value)}</span>'


def text(line: str, most: int = 4000) -> str:
    """Return text as HTML: printable, and nothing in it is a tag."""
    return escape(plain(line, most))
