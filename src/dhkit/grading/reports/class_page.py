"""The page of a class: marks, what needs a person, and what went wrong; HTML without scripts or network access."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape
from itertools import chain
from statistics import mean, median

from dhkit.display import counted
from dhkit.grading.catalogue import LIBRARY, capitalize
from dhkit.grading.grade_report import GradeReport, Verdict
from dhkit.grading.marks import Marks
from dhkit.grading.remarks import NoteKind
from dhkit.grading.reports import sentences
from dhkit.grading.reports.html import (
    STYLE,
    badge,
    html_text,
    report_page,
    sheet_sections,
)
from dhkit.grading.reports.sentences import plain, points, points_of

CLASS_STYLE = (
    STYLE
    + """
.mistake { margin: 1rem 0; break-inside: avoid; } .mistake p { margin: .1rem 0; }
.share { display: block; height: .45rem; max-width: 24rem; background: var(--tint); margin: .25rem 0; }
.share i { display: block; height: 100%; background: var(--wrong); }
.names a { white-space: nowrap; }
th.number { text-align: right; } ul.person + h3 { margin-top: .9rem; }
ul.person { padding-left: 1.2rem; margin: .3rem 0; } ul.person li { margin: .15rem 0; }
svg.points { display: block; width: 100%; max-width: 36rem; height: auto; margin: .5rem 0; }
svg.points rect { fill: var(--mark); } svg.points line { stroke: var(--line); }
svg.points text { font-size: 10px; fill: var(--faint); text-anchor: middle; }
svg.points .count { fill: var(--ink); }
@media print { .share, .share i { print-color-adjust: exact; -webkit-print-color-adjust: exact; } }
"""
)
_BINS = 10
"""Bins of the histogram, of equal width."""
_WIDTH = 360
_HEIGHT = 120
_MOST_NAMES = 12
"""Students named after a mistake before the rest is folded."""
_MOST_SHOWN = 40
"""Lines of a list of what needs a person before the rest is folded."""


@dataclass(frozen=True)
class _Row:
    """A sheet of the class, with the number by which the page links to it."""

    number: int
    report: GradeReport
    marks: Marks

    @property
    def name(self) -> str:
        """Name of the sheet as HTML: its student's, or its file's."""
        return html_text(self.report.student or self.report.sheet or f"sheet {self.number}", 120)

    @property
    def link(self) -> str:
        """Link to the sheet's section."""
        return f'<a href="#sheet-{self.number}">{self.name}</a>'


def html_class(
    reports: Sequence[GradeReport],
    marks: Sequence[Marks],
    title: str = "Class",
    table: str = "",
    totals: str = "",
) -> str:
    """Return the page of a class.

    Parameters
    ----------
    reports, marks
        Reports and marks of the sheets.
    title
        Heading.
    table
        Address of the marks as CSV, beside the page; no link if empty.
    totals
        Address of the sums of each student's marks as CSV, likewise.
    """
    pairs = zip(reports, marks, strict=True)
    rows = [_Row(number, *pair) for number, pair in enumerate(pairs, start=1)]
    parts = [f"<p>{line}</p>" for line in _summary(rows)]
    links = [f'<a href="{escape(address)}">{escape(address)}</a>' for address in (table, totals)]
    if table:
        by_student = f", and of each student together: {links[1]}" if totals else ""
        parts.append(f"<p>The marks as a table: {links[0]}{by_student}.</p>")
    warnings = sentences.class_warnings(reports)
    parts += [f'<p class="error">{html_text(line)}</p>' for line in warnings]
    kinds = _parts(rows)
    for noun, part in kinds:
        most = max(row.marks.most for row in part)
        heading = "Points" if len(kinds) == 1 else f"Points of {noun}s"
        parts.append(histogram([row.marks.points for row in part], most, noun, heading))
    parts += [*_for_a_person(rows), *_mistakes(rows)]
    parts += ['<h2 id="marks">Marks</h2>', _marks_table(rows)]
    for row in rows:
        parts.append(f'<section id="sheet-{row.number}">\n<h2>{row.name}</h2>')
        if row.report.sheet and row.report.sheet != row.report.student:
            parts.append(f'<p class="note">{html_text(row.report.sheet)}</p>')
        parts += [*sheet_sections(row.report, row.marks), "</section>"]
    return report_page(title, "\n".join(parts), CLASS_STYLE)


def _parts(rows: Sequence[_Row]) -> list[tuple[str, list[_Row]]]:
    """Return the sheets and the lab records with their nouns, as far as there are any."""
    sheets = [row for row in rows if not row.report.is_lab_record]
    records = [row for row in rows if row.report.is_lab_record]
    return [(noun, part) for noun, part in (("sheet", sheets), ("lab record", records)) if part]


def _noun(rows: Sequence[_Row]) -> str:
    """Return what all rows are, in the singular."""
    parts = _parts(rows)
    return parts[0][0] if len(parts) == 1 else "file"


def _summary(rows: Sequence[_Row]) -> Iterator[str]:
    """Yield the sentences with which the page begins, as HTML."""
    for noun, part in _parts(rows):
        students = {row.report.student for row in part}
        whose = "" if len(students) == len(part) else f" of {counted(len(students), 'student')}"
        verdicts = Counter(row.report.verdict for row in part)
        counts = ", ".join(
            f"{verdicts[verdict]} {verdict.value}" for verdict in Verdict if verdicts[verdict]
        )
        yield f"{counted(len(part), noun)}{whose}: {counts}."
        given = [row.marks.points for row in part]
        most = points(max(row.marks.most for row in part))
        yield (
            f"Of {most} points the {noun}s have {points(mean(given))} on average; half of them have "
            f"{points(median(given))} or more."
        )
    if late := sum(bool(row.marks.late) for row in rows):
        yield f"{counted(late, _noun(rows))} came late and lost points."


def histogram(
    given: Sequence[float], most: float, noun: str = "sheet", heading: str = "Points"
) -> str:
    """Return the distribution of points as HTML: bars of equal width, the last with its right end.

    Parameters
    ----------
    given
        Points of each; without two of them there is no distribution, and the text is empty.
    most
        Points possible.
    noun
        What has the points, in the singular.
    heading
        Heading of the picture.
    """
    if len(given) < 2 or not most:
        return ""
    counts = [0] * _BINS
    for number in given:
        counts[min(int(_BINS * number / most), _BINS - 1)] += 1
    highest = max(counts)
    width = _WIDTH / _BINS
    text = "; ".join(
        f"{counted(count, noun)} from {points(most * k / _BINS)} to {points(most * (k + 1) / _BINS)}"
        for k, count in enumerate(counts)
        if count
    )
    shapes = []
    for k, count in enumerate(counts):
        height = (_HEIGHT - 16) * count / highest
        x = k * width
        if count:
            shapes.append(
                f'<rect x="{x + 1:.1f}" y="{_HEIGHT - height:.1f}" width="{width - 2:.1f}" height="{height:.1f}"/>'
                f'<text class="count" x="{x + width / 2:.1f}" y="{_HEIGHT - height - 3:.1f}">{count}</text>'
            )
    for k in range(0, _BINS + 1, 2):
        label = points(most * k / _BINS)
        # The labels at both ends stay inside the picture.
        x = min(max(k * width, 3.0 * len(label)), _WIDTH - 3.0 * len(label))
        shapes.append(f'<text x="{x:.1f}" y="{_HEIGHT + 13}">{label}</text>')
    return (
        f'<h2>{escape(heading)}</h2>\n<p class="note">{noun.capitalize()}s by their points</p>\n'
        f'<svg class="points" viewBox="0 0 {_WIDTH} {_HEIGHT + 18}" role="img" aria-label="{text}">'
        f'<line x1="0" y1="{_HEIGHT}" x2="{_WIDTH}" y2="{_HEIGHT}"/>{"".join(shapes)}</svg>'
    )


def _for_a_person(rows: Sequence[_Row]) -> Iterator[str]:
    """Yield what a person has to look at: first what could not be read, then lab records, undecided answers, files."""
    unreadable = [
        f"{row.link}: {html_text(row.report.fault, 300)}"
        for row in rows
        if row.report.verdict is Verdict.UNREADABLE
    ]
    records = [row for row in rows if row.report.is_lab_record]
    signatures = []
    for row in records:
        signed = [note for note in row.report.notes if note.kind is NoteKind.SIGNED]
        signatures += [f"{row.link}: {html_text(note.values[0], 120)}" for note in signed]
    refused = [
        f"{row.link}: {html_text('; '.join(row.report.left_out), 300)}"
        for row in rows
        if row.report.left_out
    ]
    lists = [
        ("Could not be read", unreadable),
        ("Goals of the lab whose evidence does not show them", _with(records, Verdict.WRONG)),
        ("Another name was typed in the lab than the student's", signatures),
        (
            "Neither proved nor refuted: the answers agree wherever they were tried",
            _with(rows, Verdict.UNDECIDED),
        ),
        ("Goals of the lab that cannot be checked again", _with(records, Verdict.RECORDED)),
        ("Files and statements that were not read as answers", refused),
    ]
    if not any(lines for _, lines in lists):
        yield "<h2>What needs a person</h2>\n<p>Nothing: all was read and decided.</p>"
        return
    noun = _noun(rows)
    yield "<h2>What needs a person</h2>"
    for text, lines in lists:
        if lines:
            yield f'<h3>{text} <span class="note">{counted(len(lines), noun)}</span></h3>'
            yield folded_list(lines)


def _with(rows: Sequence[_Row], verdict: Verdict) -> list[str]:
    """Return a line of HTML for each row that has entries with a verdict, which it names."""
    lines = []
    for row in rows:
        names = [entry.name for entry in row.report.entries if entry.verdict is verdict]
        if names:
            lines.append(f"{row.link}: {html_text(', '.join(names), 200)}")
    return lines


def folded_list(lines: Sequence[str]) -> str:
    """Return a list of lines of HTML, of which those after the first ones are folded."""
    shown, rest = lines[:_MOST_SHOWN], lines[_MOST_SHOWN:]
    text = _list(shown)
    if rest:
        text += f"<details><summary>{len(rest)} more</summary>{_list(rest)}</details>"
    return text


def _list(lines: Sequence[str]) -> str:
    return '<ul class="person">' + "".join(f"<li>{line}</li>" for line in lines) + "</ul>"


def _mistakes(rows: Sequence[_Row]) -> Iterator[str]:
    """Yield the mistakes with their sheets, the most frequent first, and the wrong sheets that no mistake explains."""
    groups: dict[str, list[_Row]] = {}
    unexplained = []
    sheets = [row for row in rows if not row.report.is_lab_record]
    for row in sheets:
        names = dict.fromkeys(one.mistake for one in row.report.diagnosis if one.mistake)
        for name in names:
            groups.setdefault(name, []).append(row)
        if row.report.verdict is Verdict.WRONG and not names:
            unexplained.append(row)
    if not groups and not unexplained:
        return
    yield "<h2>What went wrong</h2>"
    ordered = sorted(groups.items(), key=lambda group: (-len(group[1]), group[0]))
    for name, having in ordered:
        yield group(_sentence(name), plain(name, 80), [row.link for row in having], len(sheets))
    if unexplained:
        text = "Wrong, and no mistake that has a name gives the answers."
        yield group(text, "", [row.link for row in unexplained], len(sheets))


def _sentence(mistake: str) -> str:
    """Return what a mistake is, in a sentence; its name if it is of another version of dhkit."""
    bare, _, where = mistake.partition(" (")
    if bare not in LIBRARY:
        return mistake
    place = f" ({where}" if where else ""
    return f"{capitalize(LIBRARY[bare].sentence).rstrip('.?')}{place}."


def group(text: str, name: str, links: Sequence[str], total: int, noun: str = "sheet") -> str:
    """Return a fault with a bar of its share, and links to those that have it, as HTML.

    Parameters
    ----------
    text, name
        The fault in a sentence, and its name; empty without one.
    links
        Links to those that have it, as HTML.
    total
        Number of all.
    noun
        What has the fault, in the singular.
    """
    label = f' <span class="note">{html_text(name)}</span>' if name else ""
    names = ", ".join(links[:_MOST_NAMES])
    more = links[_MOST_NAMES:]
    if more:
        names += f"<details><summary>{len(more)} more</summary>{', '.join(more)}</details>"
    return (
        f'<div class="mistake"><p>{html_text(text)}{label}</p>'
        f'<span class="share"><i style="width:{100 * len(links) / total:.1f}%"></i></span>'
        f'<div class="names">{len(links)} of {counted(total, noun)}: {names}</div></div>'
    )


def _marks_table(rows: Sequence[_Row]) -> str:
    """Return the table of a class's marks: a row for each sheet, a column for each quantity."""
    all_marks = chain.from_iterable(row.marks.quantities for row in rows)
    quantities = list(dict.fromkeys(mark.name for mark in all_marks))
    is_one_each = len({row.report.student for row in rows}) == len(rows)
    words = ["student", *([] if is_one_each else ["file"]), "verdict"]
    heads = [f"<th>{word}</th>" for word in words]
    heads += [f'<th class="number">{html_text(name, 40)}</th>' for name in ("points", *quantities)]
    lines = [f"<tr>{''.join(heads)}</tr>"]
    for row in rows:
        by_quantity = {mark.name: points(mark.points) for mark in row.marks.quantities}
        late = escape(sentences.lateness_of(row.marks))
        numbers = [points_of(row.marks) + late, *(by_quantity.get(name, "") for name in quantities)]
        cells = "".join(f'<td class="number">{cell}</td>' for cell in numbers)
        file = "" if is_one_each else f"<td>{html_text(_file_name(row.report), 80)}</td>"
        lines.append(
            f"<tr><td>{row.link}</td>{file}<td>{badge(row.report.verdict)}</td>{cells}</tr>"
        )
    return '<div class="wide"><table>' + "\n".join(lines) + "</table></div>"


def _file_name(report: GradeReport) -> str:
    return (report.sheet or "").replace("\\", "/").rpartition("/")[2]
