"""Scores of a class's programs: each in a row, and all as a table and a page."""

from __future__ import annotations

import csv
import io
import json as jsons
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace

from pydantic import TypeAdapter

from dhkit.arm import Arm
from dhkit.display import counted, plain, value_line
from dhkit.errors import DhkitError
from dhkit.execution.isolation import Isolation
from dhkit.execution.process import Limits
from dhkit.grading.batch import origin_of_sheet, seed_of_sheet
from dhkit.grading.reports.class_page import CLASS_STYLE, folded_list, group, histogram
from dhkit.grading.reports.html import html_text, report_page
from dhkit.grading.reports.marks_csv import cell
from dhkit.grading.reports.sentences import points
from dhkit.grading.sheets import Sheet
from dhkit.programs.check_report import CheckReport
from dhkit.programs.checks import check
from dhkit.programs.program import Program
from dhkit.programs.rubric import CheckRubric

PROGRAM_SUFFIXES = (".py", ".m")
"""Suffixes of the programs of a class."""


@dataclass(frozen=True)
class CheckRow:
    """Score of a student's program, or why it has none.

    Attributes
    ----------
    student, file
        The student, and the program's file.
    report
        The score; None for a program that cannot be loaded.
    error
        Why it has no score; empty if it has one.
    """

    student: str
    file: str
    report: CheckReport | None = None
    error: str = ""

    __repr__ = value_line

    @property
    def points(self) -> float:
        """Points of the program; 0 without a score."""
        return 0.0 if self.report is None else self.report.points

    @property
    def most(self) -> float:
        """Points possible; 0 without a score."""
        return 0.0 if self.report is None else self.report.most

    @property
    def first_failure(self) -> tuple[str, str]:
        """The first part without all points, such as ``fk agrees``, and what is said of it; empty if all are full."""
        if self.report is None:
            return "cannot be loaded", self.error
        for function, parts in self.report.functions.items():
            for part in parts:
                if part.points < part.most:
                    said = "; ".join((part.text, *part.details[:2]))
                    return f"{function} {part.name}", said
        return "", ""

    def to_json(self) -> str:
        """Return the row as JSON, which :meth:`from_json` reads."""
        return jsons.dumps(_FORM.dump_python(self, mode="json"), ensure_ascii=False)

    @classmethod
    def from_json(cls, text: str | bytes) -> CheckRow:
        """Return the row that :meth:`to_json` was made of; every field is checked.

        Raises
        ------
        ValueError
            Other data.
        """
        return _FORM.validate_json(text)


def check_class(
    arm: Arm,
    programs: Sequence[Sheet],
    rubric: CheckRubric | None,
    *,
    seed: int | None,
    samples: int,
    limits: Limits,
    isolation: Isolation,
    jobs: int,
    done: Callable[[Sheet, CheckRow], object],
) -> None:
    """Score programs, several at a time, each in processes of its own.

    Parameters
    ----------
    arm
        The arm.
    programs
        The programs.
    rubric
        Points of the parts; by default those of the functions that a program has.
    seed
        Seed of the run, from which each program's follows; by default from the system's entropy.
    samples
        Number of random states of each part.
    limits
        Limits of time and memory.
    isolation
        Isolation of the programs.
    jobs
        Number of programs at a time.
    done
        Called with each program and its row as soon as it is scored, in any order.
    """
    running: set[Program] = set()

    def score(sheet: Sheet) -> CheckRow:
        student, file = origin_of_sheet(sheet)
        row = CheckRow(student, file)
        if sheet.error:
            return replace(row, error=sheet.error)
        own = None if seed is None else seed_of_sheet(seed, sheet.path)
        try:
            with Program(sheet.path, limits, isolation) as program:
                running.add(program)
                try:
                    report = check(arm, program, rubric, own, samples)
                finally:
                    running.discard(program)
        except DhkitError as error:
            text = " ".join(str(error).replace(str(sheet.path), sheet.name).split())
            return replace(row, error=plain(text, 1000))
        return replace(row, report=report)

    with ThreadPoolExecutor(jobs) as pool:
        pending: dict[Future[CheckRow], Sheet] = {
            pool.submit(score, sheet): sheet for sheet in programs
        }
        try:
            while pending:
                for future in wait(pending, return_when=FIRST_COMPLETED).done:
                    done(pending.pop(future), future.result())
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for program in list(running):
                program.close()
            raise


def most_of(row: CheckRow, rows: Sequence[CheckRow]) -> float:
    """Return the points possible; of a program that cannot be loaded the largest number that another has."""
    return row.most if row.report is not None else max(other.most for other in rows)


def check_csv(rows: Sequence[CheckRow]) -> str:
    """Return the scores of a class as CSV text, in the order given."""
    names = list(dict.fromkeys(name for row in rows for name, _, _ in _parts(row)))
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(["student", "points", "most", *names, "first failure", "what is said", "file"])
    for row in rows:
        by_name = {name: points(got) for name, got, _ in _parts(row)}
        place, said = row.first_failure
        texts = [row.student, points(row.points), points(most_of(row, rows))]
        texts += [by_name.get(name, "") for name in names]
        writer.writerow([cell(plain(text, 1000)) for text in (*texts, place, said, row.file)])
    return file.getvalue()


def _parts(row: CheckRow) -> Iterator[tuple[str, float, float]]:
    """Yield the parts of a score: name, points, points possible."""
    if row.report is None:
        return
    for function, parts in row.report.functions.items():
        for part in parts:
            yield f"{function} {part.name}", part.points, part.most


def check_page(rows: Sequence[CheckRow], robot: str, table: str) -> str:
    """Return the page of a class's programs.

    Parameters
    ----------
    rows
        The scores.
    robot
        The arm's name.
    table
        Address of the scores as CSV, beside the page.
    """
    full = sum(row.report is not None and row.report.full for row in rows)
    parts = [
        f"<p>{counted(len(rows), 'program')} against {html_text(robot)}: {full} with all points.</p>",
        f'<p>The scores as a table: <a href="{table}">{table}</a>.</p>',
        histogram(
            [row.points for row in rows], max((row.most for row in rows), default=0.0), "program"
        ),
    ]
    links = [f'<a href="#row-{k}">{html_text(row.student, 120)}</a>' for k, row in enumerate(rows)]
    unloaded = [
        f"{link}: {html_text(row.error, 300)}"
        for link, row in zip(links, rows, strict=True)
        if row.error
    ]
    if unloaded:
        parts += [f"<h2>What needs a person</h2><h3>Not scored</h3>{folded_list(unloaded)}"]
    failures: dict[str, list[str]] = {}
    for link, row in zip(links, rows, strict=True):
        place, _ = row.first_failure
        if place and not row.error:
            failures.setdefault(place, []).append(link)
    if failures:
        parts.append("<h2>Where programs fail first</h2>")
    for place, having in sorted(failures.items(), key=lambda item: (-len(item[1]), item[0])):
        parts.append(group(place, "", having, len(rows), "program"))
    lines = ['<tr><th>student</th><th class="number">points</th><th>first failure</th></tr>']
    for k, row in enumerate(rows):
        place, said = row.first_failure
        text = f"{html_text(place)}: {html_text(said, 300)}" if place else "none"
        worth = f"{points(row.points)} of {points(row.most)}" if row.report else "not scored"
        cells = (
            f'<td>{html_text(row.student, 120)}</td><td class="number">{worth}</td><td>{text}</td>'
        )
        lines.append(f'<tr id="row-{k}">{cells}</tr>')
    parts += ["<h2>Scores</h2>", f'<div class="wide"><table>{"".join(lines)}</table></div>']
    return report_page("Programs", "\n".join(parts), CLASS_STYLE)


_FORM = TypeAdapter(CheckRow)
"""Checks every field of a row from JSON."""
