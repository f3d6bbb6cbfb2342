"""`dhkit grade`: judge answer sheets, or mark earlier reports again; print or write the reports."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from itertools import chain
from pathlib import Path
from typing import Annotated, Any

import typer

from dhkit.arm import Arm
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.grade_output import Delivery
from dhkit.cli.isolating import Isolated, isolation_for
from dhkit.cli.options import Json, read_arm
from dhkit.cli.output import print_json, print_table, say
from dhkit.cli.streams import styled
from dhkit.description import write_atomically
from dhkit.display import counted
from dhkit.errors import AnswerError, DescriptionError
from dhkit.grading import LIBRARY, grade as judge_sheet
from dhkit.grading.answers.sheet import read_sheet, read_task
from dhkit.grading.answers.sheet_values import AnswerSheet
from dhkit.grading.batch import GIGABYTE, Judge, grade_all
from dhkit.grading.empty_sheet import template as empty_sheet
from dhkit.grading.entry_points import prepare, robot_of
from dhkit.grading.explanation import explanation_html, explanation_text
from dhkit.grading.grade_report import GradeReport, Verdict
from dhkit.grading.options import GradeOptions
from dhkit.grading.reports import read_reports
from dhkit.grading.rubric import Rubric
from dhkit.grading.sheets import Sheet, find_sheets
from dhkit.grading.variants import VariantKey
from dhkit.lab.assignment import Assignment, is_assignment
from dhkit.lab.marks import find_records, lab_marks, lab_marks_csv

app = typer.Typer(rich_markup_mode=None)
PRINTED = Delivery()


@app.command()
def grade(
    context: typer.Context,
    sheets: Annotated[
        list[Path] | None,
        typer.Argument(help="Answer sheets (.toml, .py, .m, .tex, .ipynb), or folders of them."),
    ] = None,
    robot: Annotated[
        str | None, typer.Option(help="A library name or a robot file, instead of the sheets' own.")
    ] = None,
    task: Annotated[
        Path | None,
        typer.Option(
            help="The instructor's file: robot, [task], [names], [rubric]; or a lab's assignment (.toml); or the key "
            "of a task's variants, a folder."
        ),
    ] = None,
    rubric: Annotated[
        Path | None, typer.Option(help="Rubric: points of the answers (.toml).")
    ] = None,
    execute: Annotated[
        bool,
        typer.Option(
            "--execute", help="Execute programs in processes of their own, instead of reading them."
        ),
    ] = False,
    isolated: Isolated = False,
    read: Annotated[bool, typer.Option("--read", help="Show how each entry was read.")] = False,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed of the random states, to repeat a report.")
    ] = None,
    form: Annotated[
        str, typer.Option("--format", help="Format: text, json, gradescope, junit or html.")
    ] = "text",
    feedback: Annotated[
        str | None,
        typer.Option(help="Feedback: full, hint or verdict; default: that of the rubric."),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(min=1, max=1024, help="Number of processes; default: one for each core."),
    ] = None,
    seconds: Annotated[
        float,
        typer.Option(
            min=0.1, help="Processor time for judging a sheet, s; four times as long on the clock."
        ),
    ] = 60.0,
    remark: Annotated[
        bool, typer.Option("--remark", help="Mark earlier reports (JSON) again, without judging.")
    ] = False,
    template: Annotated[
        str | None,
        typer.Option(help="Print an empty sheet for this robot, and for what --task asks for."),
    ] = None,
    explain: Annotated[
        str | None, typer.Option(help="Print this robot's worked solution, step by step.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="File to write; a folder for several sheets."),
    ] = None,
    json: Json = False,
) -> ExitStatus:
    """Judge students' answers exactly, entry by entry.

    Exit status 0: all pass; 1: one is wrong or incomplete, or lacks the proof that is asked for; 2: one is
    unreadable.
    """
    if template is not None:
        _require_used(context, "--template", ("template", "task", "output"))
        return _write_template(template, task, output)
    if explain is not None:
        _require_used(context, "--explain", ("explain", "form", "output"))
        return _write_explanation(read_arm(explain), form, output)
    if sheets and task is not None and is_assignment(task):
        records = ("sheets", "task", "form", "json", "output")
        _require_used(context, f"{task}, a lab's assignment", records)
        return grade_records(sheets, task, "json" if json else form, output)
    if not sheets:
        raise DescriptionError(
            "no answer sheet; expected files or folders, --template NAME or --explain NAME"
        )
    key = None
    if task is not None and (task.is_dir() or task.suffix.lower() == ".json"):
        key = VariantKey.read(task)
        task = key.task
    delivery = Delivery("json" if json else form, feedback, output, read)
    if remark:
        used = ("remark", "sheets", "task", "rubric", "form", "json", "feedback", "read", "output")
        _require_used(context, "--remark", used)
        return mark_again(sheets, _rubric_of_task(rubric, task), delivery)
    return grade_files(
        sheets,
        robot,
        rubric,
        task,
        seed,
        delivery,
        execute=execute,
        isolated=isolated,
        jobs=jobs,
        seconds=seconds,
        key=key,
    )


def _require_used(context: typer.Context, mode: str, used: Collection[str]) -> None:
    """Refuse options that a mode of the command has no use for: they would be ignored.

    Parameters
    ----------
    context
        The command as it was called.
    mode
        The mode, as messages name it.
    used
        Names of the parameters that count in this mode, besides the number of processes and their time.

    Raises
    ------
    DescriptionError
        Names the option.
    """
    harmless = ("jobs", "seconds", "as_designed")
    for parameter in context.command.params:
        name = parameter.name or ""
        if name in (*used, *harmless):
            continue
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE":
            found = "answer sheets" if name == "sheets" else parameter.opts[0]
            raise DescriptionError(f"{mode}: found {found} too, which has no meaning there")


def grade_records(paths: Sequence[Path], task: Path, form: str, output: Path | None) -> ExitStatus:
    """Collect the records of a lab's assignment into marks; print them, or write them as CSV.

    Raises
    ------
    AnswerError
        There is no record, or the form is not text or json.
    DescriptionError
        The assignment cannot be read, or the output does not end in .csv.
    """
    if form not in ("text", "json"):
        raise AnswerError(
            f"--format {form}: records of a lab have the forms text and json; --output marks.csv"
        )
    if output is not None and output.suffix.lower() != ".csv":
        raise DescriptionError(
            f"{output}: ends in {output.suffix!r}; expected .csv for the marks of a lab"
        )
    assignment = Assignment.read(task)
    marks = lab_marks(find_records(paths), assignment)
    if output is not None:
        write_atomically(output, lab_marks_csv(marks, assignment))
        say(f"wrote {output}")
    elif form == "json":
        print_json([asdict(mark) | {"file": str(mark.file)} for mark in marks])
    else:
        rows = []
        for mark in marks:
            notes = list(mark.notes)
            if mark.unchecked:
                notes.append(f"{counted(mark.unchecked, 'goal')} on the record's word")
            rows.append(
                (
                    mark.student,
                    f"{mark.points:g}",
                    f"{mark.most:g}",
                    mark.last,
                    str(mark.file),
                    "; ".join(notes),
                )
            )
        print_table(
            ("student", "points", "of", "last goal", "file", "notes"), rows, title=assignment.title
        )
    if any(mark.notes for mark in marks):
        return ExitStatus.UNUSABLE
    return ExitStatus.FINE if all(mark.points >= mark.most for mark in marks) else ExitStatus.NO


def rubric_of(path: Path | None) -> Rubric:
    """Return the rubric of a file, with checked names of mistakes; without a file the default rubric.

    Raises
    ------
    AnswerError
        The file is not a rubric, or a mistake is not known.
    """
    rubric = Rubric() if path is None else Rubric.read(path)
    rubric.require_mistakes(LIBRARY, f"{path}: ")
    return rubric


def _rubric_of_task(path: Path | None, task: Path | None) -> Rubric:
    """Return the rubric of a file or else that of a task; without both, or if the task has none, the default rubric.

    Raises
    ------
    AnswerError
        A file is not a rubric or a task, or a mistake is not known.
    """
    if path is None and task is not None and (data := read_task(task).rubric):
        return _rubric_from(data, task)
    return rubric_of(path)


def _own_rubric(path: Path) -> Rubric:
    """Return the rubric in a sheet.

    It is used only for a single sheet without another rubric: in a class, students could give points to themselves.
    """
    try:
        data = read_sheet(path).rubric
    except AnswerError:  # reported when the sheet is judged
        return Rubric()
    return _rubric_from(data, path)


def grade_files(
    sheets: Sequence[Path],
    robot: str | None,
    rubric: Path | None,
    task: Path | None = None,
    seed: int | None = None,
    delivery: Delivery = PRINTED,
    *,
    execute: bool = False,
    isolated: bool = False,
    jobs: int | None = None,
    seconds: float = 60.0,
    key: VariantKey | None = None,
) -> ExitStatus:
    """Judge sheets about their own robots, all about one robot, or each about its student's variant.

    Parameters
    ----------
    sheets
        Files, and folders of them.
    robot
        The robot of all sheets, instead of the task's and the sheets' own.
    rubric
        The rubric, instead of the task's.
    task
        An instructor's file with the task and its robot.
    seed
        Seed of the random states, to repeat a report.
    execute
        Whether programs are executed: those of several sheets, which are other people's, only isolated.
    isolated
        Whether a single program too is executed only where it can be isolated.
    delivery, jobs, seconds
        As in :func:`run`.
    key
        Key of the task's variants, which has a robot for each student.

    Raises
    ------
    AnswerError, DescriptionError
        As :func:`run`, or there is no such robot, rubric or task; or a task with variants has no key, or one robot for
        all is given beside the key.
    IsolationError
        Programs are to be executed, and cannot be isolated.
    """
    read = None if task is None else read_task(task)
    if key is not None and robot is not None:
        raise AnswerError(f"--robot {robot}: {key.folder} has a robot for each student")
    if key is None and read is not None and read.variants:
        raise AnswerError(
            f"{task}: has variants; expected the folder key that `dhkit task variants` wrote, with each student's robot"
        )
    about = read_arm(robot).description if robot is not None else None
    if about is None and key is None and read is not None and task is not None and read.robot:
        about = robot_of(read, task.parent)
    is_single = len(sheets) == 1 and sheets[0].suffix == ".toml" and sheets[0].is_file()
    if rubric is None and read is not None and read.rubric:
        chosen = _rubric_from(read.rubric, task)
    elif rubric is None and read is None and is_single:
        chosen = _own_rubric(sheets[0])
    else:
        chosen = rubric_of(rubric)
    are_several = len(sheets) > 1 or any(path.is_dir() for path in sheets)
    if are_several:
        prepare(about)
    own_files = [
        path for path in (rubric, task, Path(robot) if robot else None) if path is not None
    ]
    if key is not None:
        own_files.append(key.folder)
    isolation = None
    if execute:
        packages = read.task.packages if read is not None else ()
        name = sheets[0].name if not are_several else "the sheets' programs"
        isolation = isolation_for(name, isolated or are_several, [*own_files, *sheets], packages)
    options = GradeOptions(task=read, seed=seed, execute=isolation is not None, isolation=isolation)

    def judge(path: Path) -> GradeReport:
        subject = about if key is None else key.robot_of(students[path])
        return judge_sheet(path, subject, chosen, options=options)

    students = {} if key is None else _students(find_sheets(sheets, own_files), key)
    return run(
        sheets,
        judge,
        chosen,
        delivery,
        exclude=own_files,
        prepare=lambda report: prepare(about, report),
        jobs=jobs,
        seconds=seconds,
    )


def _students(sheets: Sequence[Sheet], key: VariantKey) -> dict[Path, str]:
    """Return the student of each sheet by its file: the name of a single file counts, else that of its folder."""
    students = {}
    for sheet in sheets:
        names = (
            (sheet.student,)
            if sheet.student
            else (sheet.path.stem, sheet.path.absolute().parent.name)
        )
        students[sheet.path] = next((name for name in names if name in key), names[0])
    return students


def _rubric_from(data: Mapping[str, Any], path: Path | None) -> Rubric:
    rubric = Rubric.from_data(data, f"{path}: rubric: ")
    rubric.require_mistakes(LIBRARY, f"{path}: rubric: ")
    return rubric


def run(
    sheets: Sequence[Path],
    judge: Judge,
    rubric: Rubric,
    delivery: Delivery = PRINTED,
    *,
    jobs: int | None = None,
    seconds: float = 60.0,
    memory: int = 2 * GIGABYTE,
    exclude: Collection[Path] = (),
    prepare: Callable[[GradeReport], object] | None = None,
) -> ExitStatus:
    """Judge sheets and deliver the reports; the status is NO if one is wrong, UNUSABLE if one is unreadable.

    Parameters
    ----------
    sheets
        Files, and folders of them.
    judge, prepare, seconds, memory
        As in :func:`~dhkit.grading.batch.grade_all`.
    jobs
        Number of processes at a time; by default one for each core.
    rubric
        The rubric of all sheets.
    delivery
        Form and place of the reports.
    exclude
        Files in the folders that are not sheets.

    Raises
    ------
    AnswerError
        There is no such file, format or feedback, or the output would overwrite a sheet.
    """
    paths = find_sheets(sheets, exclude)
    several = len(paths) > 1 or any(path.is_dir() for path in sheets)
    delivery.check(several)
    with _progress(len(paths)) as progress:
        judged = grade_all(
            paths,
            judge,
            jobs=jobs or os.cpu_count() or 1,
            seconds=seconds,
            memory=memory,
            prepare=prepare,
            progress=progress,
        )
        reports = list(judged)
    delivery(reports, rubric, several)
    return _status(reports)


def mark_again(files: Sequence[Path], rubric: Rubric, delivery: Delivery = PRINTED) -> ExitStatus:
    """Mark earlier reports again, without judging, and deliver them as :func:`run` does.

    Parameters
    ----------
    files
        JSON of ``dhkit grade --json`` with full feedback, or folders of such files, such as ``records`` of an output.

    Raises
    ------
    AnswerError
        There is no such file, format or feedback, or a file has no reports.
    """
    reports = list(chain.from_iterable(map(read_reports, _records(files))))
    if not reports:
        raise AnswerError(f"{', '.join(map(str, files))}: no reports")
    several = len(reports) > 1
    delivery.check(several)
    delivery(reports, rubric, several)
    return _status(reports)


def _records(files: Sequence[Path]) -> Iterator[Path]:
    for path in files:
        folder = path / "records" if (path / "records").is_dir() else path
        yield from sorted(folder.glob("*.json")) if folder.is_dir() else [path]


def _status(reports: Sequence[GradeReport]) -> ExitStatus:
    """Return the status of the worst sheet: one that could not be judged, then one that does not pass."""
    if any(report.verdict is Verdict.UNREADABLE for report in reports):
        return ExitStatus.UNUSABLE
    return ExitStatus.FINE if all(reports) else ExitStatus.NO


@contextmanager
def _progress(total: int) -> Iterator[Callable[[int, int], None] | None]:
    """Show a bar on stderr, if that is a terminal and there are several sheets."""
    if total < 2 or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import MofNCompleteColumn, Progress

    # The bar has no thread of its own, since the sheets' processes are forked meanwhile.
    bar = Progress(
        *Progress.get_default_columns(),
        MofNCompleteColumn(),
        console=Console(file=styled(sys.stderr)),
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


def _write_template(robot: str, task: Path | None, output: Path | None) -> ExitStatus:
    """Print or write an empty answer sheet, of a task if one is given.

    Raises
    ------
    DescriptionError
        There is no such robot, or the task is about another one.
    AnswerError
        The task is not one, or is a lab's assignment, which has no sheets.
    """
    description = read_arm(robot).description
    # A sheet finds robot files only in its own folder.
    name = Path(robot).name if robot.endswith(".toml") else description.name
    read: AnswerSheet | None = None
    if task is not None:
        if is_assignment(task):
            raise AnswerError(
                f"--template: found a lab's assignment, {task}; expected a task of answer sheets"
            )
        read = read_task(task)
        if read.robot:
            if robot_of(read, task.parent).digest != description.digest:
                raise DescriptionError(
                    f"--template {robot}: {task} is about another robot; expected {read.robot}"
                )
            name = read.robot
    return _deliver(empty_sheet(description, name, read), output)


def _write_explanation(arm: Arm, form: str, output: Path | None) -> ExitStatus:
    """Print or write a worked solution as text or HTML.

    Raises
    ------
    AnswerError
        There is no such format.
    """
    forms = {"text": explanation_text, "html": explanation_html}
    if form not in forms:
        raise AnswerError(
            f"--format: found {form!r}; expected {', '.join(forms)} for a worked solution"
        )
    return _deliver(forms[form](arm.description), output)


def _deliver(text: str, output: Path | None) -> ExitStatus:
    if output is None:
        sys.stdout.write(text)
    else:
        write_atomically(output, text)
        say(f"wrote {output}")
    return ExitStatus.FINE
