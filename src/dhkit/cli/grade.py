"""`dhkit grade`: judge answer sheets, or mark again what was judged before; print or write the reports."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, get_args

from dhkit.arm import Arm
from dhkit.cli.grade_output import FORMS, Graded, check_output, deliver
from dhkit.cli.output import say
from dhkit.description import write_atomically
from dhkit.errors import AnswerError
from dhkit.grading import LIBRARY, grade
from dhkit.grading.answers.sheet import read_sheet, read_task
from dhkit.grading.batch import GIGABYTE, Judge, grade_all
from dhkit.grading.entry_points import prepare, robot_of
from dhkit.grading.explanation import explanation_html, explanation_text
from dhkit.grading.marks import marks
from dhkit.grading.report import GradeReport, Verdict
from dhkit.grading.reports import read_reports
from dhkit.grading.rubric import Feedback, Rubric
from dhkit.grading.schema import template
from dhkit.grading.sheets import find_sheets


def rubric_of(path: Path | None) -> Rubric:
    """Return the rubric of a file, its mistakes' names checked; the usual one without a file.

    Raises
    ------
    AnswerError
        No rubric, or a mistake that is not known.
    """
    rubric = Rubric() if path is None else Rubric.read(path)
    rubric.require_mistakes(LIBRARY, f"{path}: ")
    return rubric


def _own_rubric(path: Path) -> Rubric:
    """Return the rubric that a sheet brings along.

    It counts for a single sheet without another one: in a class anybody could give points to himself.
    """
    try:
        data = read_sheet(path).rubric
    except AnswerError:  # said when it is judged
        return Rubric()
    return _rubric_from(data, path)


def grade_files(
    sheets: Sequence[Path],
    robot: str | None,
    rubric: Path | None,
    task: Path | None = None,
    seed: int | None = None,
    **options: Any,
) -> int:
    """Judge sheets about their own robots, or all about one; see :func:`run` for the options.

    Parameters
    ----------
    sheets
        Files, and folders of them.
    robot
        What all are about, before the task's and the sheets' own.
    rubric
        What answers are worth, before the task's.
    task
        An instructor's file of what was asked for, and of which robot.
    seed
        Of the random states, to replay a report.

    Raises
    ------
    AnswerError, DescriptionError
        As :func:`run`, or no such robot, rubric or task.
    """
    asked = None if task is None else read_task(task)
    about = Arm.load(robot).description if robot is not None else None
    if about is None and asked is not None and task is not None and asked.robot:
        about = robot_of(asked, task.parent)
    alone = len(sheets) == 1 and sheets[0].suffix == ".toml" and sheets[0].is_file()
    if rubric is None and asked is not None and asked.rubric:
        chosen = _rubric_from(asked.rubric, task)
    elif rubric is None and asked is None and alone:
        chosen = _own_rubric(sheets[0])
    else:
        chosen = rubric_of(rubric)
    if len(sheets) > 1 or any(path.is_dir() for path in sheets):
        prepare(about)
    own_files = [path for path in (rubric, task, Path(robot) if robot else None) if path is not None]
    return run(
        sheets,
        judge=lambda path: grade(path, about, chosen, task=asked, seed=seed),
        rubric=chosen,
        exclude=own_files,
        prepare=lambda report: prepare(about, report),
        **options,
    )


def _rubric_from(data: Mapping[str, Any], path: Path | None) -> Rubric:
    rubric = Rubric.from_data(data, f"{path}: rubric: ")
    rubric.require_mistakes(LIBRARY, f"{path}: rubric: ")
    return rubric


def run(
    sheets: Sequence[Path],
    *,
    judge: Judge,
    rubric: Rubric,
    form: str = "text",
    feedback: str | None = None,
    jobs: int | None = None,
    output: Path | None = None,
    json: bool = False,
    read: bool = False,
    seconds: float = 60.0,
    memory: int = 2 * GIGABYTE,
    exclude: Collection[Path] = (),
    prepare: Callable[[GradeReport], object] | None = None,
) -> int:
    """Judge sheets and deliver the reports; return 0, 1 where one is wrong, 2 where one could not be judged.

    Parameters
    ----------
    sheets
        Files, and folders of them.
    judge, prepare, seconds, memory
        As in :func:`~dhkit.grading.batch.grade_all`.
    jobs
        Processes at once; one for each core unless given.
    rubric
        By which all are marked.
    form
        text, json, gradescope, junit or html.
    feedback
        full, hint or verdict; the rubric's unless given.
    output
        A file; or for several sheets as text a folder, of which ``students`` has what is for them, with the feedback,
        and all else is the teacher's, whole.
    json
        As ``form="json"``.
    read
        Whether text shows how each entry was read.
    exclude
        Files in the folders that are no sheets.

    Raises
    ------
    AnswerError
        No such file, format or feedback; an output that would overwrite a sheet.
    """
    found = find_sheets(sheets, exclude)
    several = len(found) > 1 or any(path.is_dir() for path in sheets)
    form, level = _form("json" if json else form, several), _level(feedback, rubric)
    check_output(output, form, several)
    with _progress(len(found)) as progress:
        judged = grade_all(
            found,
            judge,
            jobs=jobs or os.cpu_count() or 1,
            seconds=seconds,
            memory=memory,
            prepare=prepare,
            progress=progress,
        )
        reports = list(judged)
    deliver([Graded(report, marks(report, rubric)) for report in reports], form, level, output, several, read)
    return _status(reports)


def remark(
    files: Sequence[Path],
    rubric: Rubric,
    *,
    form: str = "text",
    feedback: str | None = None,
    output: Path | None = None,
    json: bool = False,
) -> int:
    """Mark again, without judging, what was judged before, and deliver it as :func:`run` does.

    Parameters
    ----------
    files
        JSON as ``dhkit grade --json`` prints it with all feedback, or folders of such files: ``records`` of an output.

    Raises
    ------
    AnswerError
        No such file, or no reports in it; no such format or feedback.
    """
    reports = [report for path in _records(files) for report in read_reports(path)]
    if not reports:
        raise AnswerError(f"{', '.join(map(str, files))}: no reports")
    form, level = _form("json" if json else form, len(reports) > 1), _level(feedback, rubric)
    check_output(output, form, len(reports) > 1)
    graded = [Graded(report, marks(report, rubric)) for report in reports]
    deliver(graded, form, level, output, len(reports) > 1)
    return _status(reports)


def _records(files: Sequence[Path]) -> Iterator[Path]:
    for path in files:
        folder = path / "records" if (path / "records").is_dir() else path
        yield from sorted(folder.glob("*.json")) if folder.is_dir() else [path]


def _form(form: str, several: bool) -> str:
    if form not in FORMS:
        raise AnswerError(f"--format: found {form!r}; expected {', '.join(FORMS)}")
    if form == "gradescope" and several:
        raise AnswerError("--format gradescope: found several sheets; expected one, which is what Gradescope hands in")
    return form


def _level(feedback: str | None, rubric: Rubric) -> Feedback:
    for level in get_args(Feedback):
        if level == (feedback or rubric.feedback):
            known: Feedback = level
            return known
    raise AnswerError(f"--feedback: found {feedback!r}; expected {', '.join(get_args(Feedback))}")


def _status(reports: Sequence[GradeReport]) -> int:
    """Return the exit status of the worst: a sheet that could not be judged, then one that does not pass."""
    if any(report.verdict is Verdict.UNREADABLE for report in reports):
        return 2
    return 0 if all(reports) else 1


@contextmanager
def _progress(total: int) -> Iterator[Callable[[int, int], None] | None]:
    """Show a bar on stderr, where that is a terminal and there is something to wait for."""
    if total < 2 or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import MofNCompleteColumn, Progress

    # Without a thread of its own: the sheets' processes are forked meanwhile.
    bar = Progress(
        *Progress.get_default_columns(),
        MofNCompleteColumn(),
        console=Console(stderr=True),
        transient=True,
        auto_refresh=False,
        redirect_stdout=False,
        redirect_stderr=False,
    )
    with bar:
        task = bar.add_task("judging", total=total)

        def show(done: int, of: int) -> None:
            bar.update(task, completed=done, total=of, refresh=True)

        bar.refresh()
        yield show


def write_template(robot: str, output: Path | None) -> int:
    """Print or write an empty answer sheet."""
    description = Arm.load(robot).description
    # A sheet finds robot files only in its own folder.
    name = Path(robot).name if robot.endswith(".toml") else description.name
    return _deliver(template(description, name), output)


def write_explanation(arm: Arm, form: str, output: Path | None) -> int:
    """Print or write a worked solution as text or HTML.

    Raises
    ------
    AnswerError
        Another format.
    """
    forms = {"text": explanation_text, "html": explanation_html}
    if form not in forms:
        raise AnswerError(f"--format: found {form!r}; expected {', '.join(forms)} for a worked solution")
    return _deliver(forms[form](arm.description), output)


def _deliver(text: str, output: Path | None) -> int:
    if output is None:
        sys.stdout.write(text)
    else:
        write_atomically(output, text)
        say(f"wrote {output}")
    return 0
