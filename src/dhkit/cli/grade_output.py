"""Output of `dhkit grade`: reports on the terminal, in a file, or in a folder for a class."""

from __future__ import annotations

import io
import json as jsons
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast, get_args

from rich.console import Console

from dhkit.cli.grade_folder import (
    MARKS,
    PARTS,
    Records,
    clear_earlier_results,
    file_names,
)
from dhkit.cli.output import console, say
from dhkit.description import write_atomically
from dhkit.description.files import check_place, read_bounded
from dhkit.errors import AnswerError, DescriptionError
from dhkit.grading.answers.sources import SHEET_SUFFIXES
from dhkit.grading.bounds import BOUNDS
from dhkit.grading.exports import Keep, are_best
from dhkit.grading.grade_report import GradeReport
from dhkit.grading.marks import Marks, marks
from dhkit.grading.reports import (
    gradescope,
    html_class,
    html_report,
    json_report,
    junit,
    marks_csv,
    terminal_class,
    terminal_report,
    totals_csv,
    with_feedback,
)
from dhkit.grading.reports.marks_csv import TOTALS_COLUMNS
from dhkit.grading.reports.sentences import fault_of
from dhkit.grading.rubric import Feedback, Rubric
from dhkit.lab.record import SUFFIX

FORMS = ("text", "json", "gradescope", "junit", "html")
TOTALS = "totals.csv"
FILE_WIDTH = 120
"""Width of text in a file, columns."""


@dataclass(frozen=True)
class Graded:
    """A report with its marks."""

    report: GradeReport
    marks: Marks

    def with_feedback(self, level: Feedback) -> Graded:
        """Return the report and its marks with this level of feedback."""
        marks = self.marks if level == "full" else self.marks.without_rules()
        return replace(self, report=with_feedback(self.report, level), marks=marks)


@dataclass(frozen=True)
class Delivery:
    """Form and place in which reports are handed over."""

    form: str = "text"
    """text, json, gradescope, junit or html."""
    feedback: str | None = None
    """full, hint or verdict; by default the rubric's."""
    output: Path | None = None
    """A file; for several sheets as text a folder, in which ``students`` has the pages for students, with the
    feedback, and everything else is for the teacher, without omissions. Printed unless given."""
    read: bool = False
    """Whether reports as text show how each entry was read."""
    keep: Keep = Keep.ALL
    """Which of a student's submissions counts: with ``BEST`` the one with the most points has a row. ``LAST`` was
    chosen before they were judged."""

    def check(self, several: bool) -> None:
        """Refuse what cannot be meant, before anything is judged.

        Raises
        ------
        AnswerError
            No such form or feedback; a form for one sheet; an output that would overwrite a sheet, or that is a file
            where a folder is needed.
        """
        if self.form not in FORMS:
            raise AnswerError(f"--format: found {self.form!r}; expected {', '.join(FORMS)}")
        if self.feedback is not None and self.feedback not in get_args(Feedback):
            raise AnswerError(
                f"--feedback: found {self.feedback!r}; expected {', '.join(get_args(Feedback))}"
            )
        if self.form == "gradescope" and several:
            raise AnswerError(
                "--format gradescope: found several sheets; expected one, which is what Gradescope hands in"
            )
        output = self.output
        if output is None or output.is_dir():
            return
        if output.name.lower().endswith((*SHEET_SUFFIXES, SUFFIX)):
            raise AnswerError(
                f"{output}: a report would overwrite an answer sheet; expected another name"
            )
        if _is_folder(output, self.form, several):
            if output.exists() or output.suffix:
                raise AnswerError(
                    f"{output}: found a file's name; expected a folder for the reports of several sheets"
                )
        else:
            try:
                check_place(output)
            except DescriptionError as error:
                raise AnswerError(str(error)) from None

    def is_folder(self, several: bool) -> bool:
        """Return whether reports are written into a folder."""
        return self.output is not None and _is_folder(self.output, self.form, several)

    def __call__(
        self,
        reports: Sequence[GradeReport],
        rubric: Rubric,
        several: bool,
        records: Records | None = None,
    ) -> None:
        """Mark reports, and print or write them; reports in a folder are printed as well.

        Parameters
        ----------
        reports
            The reports.
        rubric
            The rubric.
        several
            Whether they are a class's.
        records
            Records of a run that can be continued.
        """
        judged = [Graded(report, marks(report, rubric)) for report in reports]
        counts = [True] * len(judged)
        if self.keep is Keep.BEST:
            # Sheets and lab records are compared among themselves.
            owners = [(record_student(one.report), one.report.is_lab_record) for one in judged]
            counts = are_best(owners, [one.marks.points for one in judged])
        level = cast("Feedback", self.feedback or rubric.feedback)
        form = self.form
        output = self.output
        pages = [
            one.with_feedback(level) if is_counted else None
            for one, is_counted in zip(judged, counts, strict=True)
        ]
        shown = [page for page in pages if page is not None]
        if output is not None and _is_folder(output, form, several):
            _write_folder(judged, pages, output, records)
        elif output is not None:
            write_atomically(output, _document(shown, form, level, several))
        if form == "json" and (output is None or output.is_dir()):
            sys.stdout.write(_document(shown, form, level, several))
        elif form == "text":
            _print(shown, several, self.read)
        elif output is None:
            sys.stdout.write(_document(shown, form, level, several))
        if output is not None and form != "json":
            say(f"wrote {output}")


def _is_folder(output: Path, form: str, several: bool) -> bool:
    return output.is_dir() or (several and form == "text")


def _print(shown: Sequence[Graded], several: bool, read: bool) -> None:
    if several and not read:
        console().print(terminal_class(*_columns(shown)))
        return
    for one in shown:
        if one.report.error:
            sys.stderr.write(f"dhkit: {fault_of(one.report)}\n")
        else:
            console().print(terminal_report(one.report, one.marks, read))


def _document(shown: Sequence[Graded], form: str, level: Feedback, several: bool) -> str:
    """Return the content of a file of a format."""
    first = shown[0]
    match form:
        case "json":
            return "".join(f"{_json(one, level)}\n" for one in shown)
        case "gradescope":
            return (
                jsons.dumps(gradescope(first.report, first.marks), ensure_ascii=False, indent=2)
                + "\n"
            )
        case "junit":
            return junit(*_columns(shown))
        case "html":
            return (
                html_class(*_columns(shown)) if several else html_report(first.report, first.marks)
            )
        case _:
            file = io.StringIO()
            page = Console(
                file=file, width=FILE_WIDTH, highlight=False, color_system=None, soft_wrap=True
            )
            page.print(terminal_report(first.report, first.marks))
            return file.getvalue()


def _json(one: Graded, level: Feedback, records: Records | None = None) -> str:
    data = json_report(one.report, one.marks, level)
    if records is not None:
        data = records.marked(one.report, data)
    return jsons.dumps(data, ensure_ascii=False, allow_nan=False)


def _columns(graded: Sequence[Graded]) -> tuple[list[GradeReport], list[Marks]]:
    return [one.report for one in graded], [one.marks for one in graded]


def _write_folder(
    judged: Sequence[Graded], shown: Sequence[Graded | None], folder: Path, records: Records | None
) -> None:
    """Write the files of a class: marks, a page and full records for the teacher, and a page for each student.

    With lab records a student's work has two parts: a table of totals has their sums.

    Results of an earlier run in the folder are removed.

    Parameters
    ----------
    judged
        All reports.
    shown
        For each of them what its student is shown; None for a submission that does not count, which has a record only.
    folder
        The folder.
    records
        Records of a run that can be continued.
    """
    names = file_names([record_student(one.report) for one in judged])
    clear_earlier_results(folder, names)
    for part in PARTS:
        (folder / part).mkdir(parents=True, exist_ok=True)
    counting = []
    for name, whole, one in zip(names, judged, shown, strict=True):
        write_atomically(folder / "records" / f"{name}.json", _json(whole, "full", records) + "\n")
        page = folder / "students" / f"{name}.html"
        if one is None:
            page.unlink(missing_ok=True)
            continue
        counting.append(whole)
        write_atomically(page, html_report(one.report, one.marks))
    columns = _columns(counting)
    write_atomically(folder / MARKS, marks_csv(*columns))
    has_parts = any(one.report.is_lab_record for one in counting)
    if has_parts:
        write_atomically(folder / TOTALS, totals_csv(*columns))
    else:
        _remove_totals(folder / TOTALS)
    overview = html_class(*columns, table=MARKS, totals=TOTALS if has_parts else "")
    write_atomically(folder / "class.html", overview)


def _remove_totals(path: Path) -> None:
    """Remove the totals of an earlier run; a file that is not a table of totals stays."""
    with suppress(DescriptionError):
        content = read_bounded(path, BOUNDS.report_file_bytes, "totals")
        if content.startswith(f"{','.join(TOTALS_COLUMNS)}\n".encode()):
            path.unlink()


def record_student(report: GradeReport) -> str:
    """Return the student by whom the files of a report are named."""
    return report.student or Path(report.sheet or "sheet").stem
