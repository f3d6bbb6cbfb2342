"""Output of `dhkit grade`: reports on the terminal, in a file, or in a folder for a class."""

from __future__ import annotations

import io
import json as jsons
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast, get_args

from rich.console import Console

from dhkit.cli.grade_folder import MARKS, PARTS, clear_earlier_results
from dhkit.cli.output import console, say
from dhkit.description import write_atomically
from dhkit.description.files import check_place
from dhkit.errors import AnswerError, DescriptionError
from dhkit.grading.answers.sources import SHEET_SUFFIXES
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
    with_feedback,
)
from dhkit.grading.reports.sentences import fault_of
from dhkit.grading.rubric import Feedback, Rubric

FORMS = ("text", "json", "gradescope", "junit", "html")
FILE_WIDTH = 120
"""Width of text in a file, columns."""
UNSAFE = re.compile(r"[^\w.-]+")
"""Characters that file names made from students' names do not have."""
MAX_NAME_BYTES = 80


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
        if output.suffix.lower() in SHEET_SUFFIXES:
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

    def __call__(self, reports: Sequence[GradeReport], rubric: Rubric, several: bool) -> None:
        """Mark reports, and print or write them; reports in a folder are printed as well."""
        graded = [Graded(report, marks(report, rubric)) for report in reports]
        level = cast("Feedback", self.feedback or rubric.feedback)
        form = self.form
        output = self.output
        shown = [one.with_feedback(level) for one in graded]
        if output is not None and _is_folder(output, form, several):
            _write_folder(graded, shown, output)
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


def _json(one: Graded, level: Feedback) -> str:
    return jsons.dumps(
        json_report(one.report, one.marks, level), ensure_ascii=False, allow_nan=False
    )


def _columns(graded: Sequence[Graded]) -> tuple[list[GradeReport], list[Marks]]:
    return [one.report for one in graded], [one.marks for one in graded]


def _write_folder(graded: Sequence[Graded], shown: Sequence[Graded], folder: Path) -> None:
    """Write the files of a class: marks, a page and full records for the teacher, and a page for each student.

    Results of an earlier run in the folder are removed.
    """
    names = _names(graded)
    clear_earlier_results(folder, names)
    for part in PARTS:
        (folder / part).mkdir(parents=True, exist_ok=True)
    for name, whole, one in zip(names, graded, shown, strict=True):
        write_atomically(folder / "records" / f"{name}.json", _json(whole, "full") + "\n")
        write_atomically(folder / "students" / f"{name}.html", html_report(one.report, one.marks))
    write_atomically(folder / MARKS, marks_csv(*_columns(graded)))
    write_atomically(folder / "class.html", html_class(*_columns(graded)))


def _names(graded: Sequence[Graded]) -> list[str]:
    """Return names of files, made from the students' names, that differ also where case does not count."""
    names: dict[str, str] = {}
    for one in graded:
        student = one.report.student or Path(one.report.sheet or "sheet").stem
        plain = (
            UNSAFE.sub("_", student).encode()[:MAX_NAME_BYTES].decode(errors="ignore").lstrip(".")
            or "sheet"
        )
        name = plain
        number = 1
        while name.casefold() in names:
            number += 1
            name = f"{plain}-{number}"
        names[name.casefold()] = name
    return list(names.values())
