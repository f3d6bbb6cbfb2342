"""`dhkit grade`: judge answer sheets, or mark earlier reports again; print or write the reports."""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, replace
from itertools import chain
from pathlib import Path
from typing import Annotated, Any

import typer

from dhkit.arm import Arm
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.grade_folder import MAX_LISTED, Records, file_names
from dhkit.cli.grade_output import Delivery
from dhkit.cli.isolating import Isolated, isolation_for
from dhkit.cli.judging_place import HERE, JudgingPlace
from dhkit.cli.options import Json, read_arm
from dhkit.cli.output import print_json, print_table, say
from dhkit.cli.streams import styled
from dhkit.description import write_atomically
from dhkit.display import counted, plain
from dhkit.errors import AnswerError, DescriptionError
from dhkit.grading import LIBRARY
from dhkit.grading.answers.sheet import read_sheet, read_task
from dhkit.grading.answers.sheet_values import AnswerSheet
from dhkit.grading.answers.sources import SHEET_SUFFIXES
from dhkit.grading.archives import is_archive, unpacked
from dhkit.grading.batch import (
    content_digest,
    judgement_key,
    origin_of_sheet,
)
from dhkit.grading.class_judge import ClassJudge
from dhkit.grading.empty_sheet import template as empty_sheet
from dhkit.grading.entry_points import robot_of
from dhkit.grading.explanation import explanation_html, explanation_text
from dhkit.grading.exports import (
    ExportKind,
    Keep,
    Submissions,
    last_attempts,
    opened_submissions,
    with_ids,
)
from dhkit.grading.grade_report import GradeReport, Verdict
from dhkit.grading.options import GradeOptions
from dhkit.grading.reports import read_reports
from dhkit.grading.rubric import Rubric
from dhkit.grading.sheet_judge import package_version
from dhkit.grading.sheets import Sheet
from dhkit.grading.variants import VariantKey
from dhkit.grading.variants.students import read_students
from dhkit.lab.assignment import Assignment, is_assignment
from dhkit.lab.marks import LabMark, find_records, lab_marks, lab_marks_csv
from dhkit.lab.record import SUFFIX
from dhkit.lab.record_judge import RecordJudge

app = typer.Typer(rich_markup_mode=None)
PRINTED = Delivery()


@app.command()
def grade(
    context: typer.Context,
    sheets: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Answer sheets (.toml, .py, .m, .tex, .ipynb), folders of them, or a platform's export (.zip)."
        ),
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
    lab: Annotated[
        Path | None,
        typer.Option(
            metavar="ASSIGNMENT",
            help="A lab's assignment (.toml), whose records (.lab.json) lie among the sheets of the class.",
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
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Scheduler of dask whose workers judge: tcp://HOST:PORT; local, or local:4 for four processes here.",
        ),
    ] = None,
    seconds: Annotated[
        float,
        typer.Option(
            min=0.1, help="Processor time for judging a sheet, s; four times as long on the clock."
        ),
    ] = 60.0,
    export: Annotated[
        ExportKind | None,
        typer.Option(help="Layout of the folder or archive; default: recognized by its names."),
    ] = None,
    students: Annotated[
        Path | None,
        typer.Option(
            help="List of students (.csv) with the names or numbers of an export, instead of which rows get its ids."
        ),
    ] = None,
    keep: Annotated[
        Keep,
        typer.Option(
            help="Which of a student's submissions counts; the last where the export tells their order."
        ),
    ] = Keep.LAST,
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
    delivery = Delivery("json" if json else form, feedback, output, read, keep)
    if scheduler is not None and jobs is not None:
        raise DescriptionError(
            "--jobs and --scheduler: the scheduler knows its workers; expected one of them"
        )
    if remark:
        files = ("remark", "sheets", "task", "rubric", "output")
        _require_used(context, "--remark", (*files, "form", "json", "feedback", "read", "keep"))
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
        place=JudgingPlace(jobs, scheduler),
        seconds=seconds,
        key=key,
        export=export,
        students=students,
        lab=lab,
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
    marks = _marks_of_records(paths, assignment)
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


def _marks_of_records(paths: Sequence[Path], assignment: Assignment) -> list[LabMark]:
    """Return the marks of the records in files, folders and archives, which messages name as they were given."""
    with ExitStack() as opened:
        folders = {}
        for path in paths:
            is_packed = path.exists() and is_archive(path)
            folders[opened.enter_context(unpacked(path)) if is_packed else path] = path
        try:
            marks = lab_marks(find_records(list(folders)), assignment)
        except AnswerError as error:
            raise AnswerError(_with_given_paths(str(error), folders)) from None
    return [
        replace(
            mark,
            file=Path(_with_given_paths(str(mark.file), folders)),
            notes=tuple(_with_given_paths(note, folders) for note in mark.notes),
        )
        for mark in marks
    ]


def _with_given_paths(text: str, folders: Mapping[Path, Path]) -> str:
    """Return a text in which archives are named instead of the folders into which they were unpacked."""
    for folder, path in folders.items():
        text = text.replace(str(folder), str(path))
    return text


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
    place: JudgingPlace = HERE,
    seconds: float = 60.0,
    key: VariantKey | None = None,
    export: ExportKind | None = None,
    students: Path | None = None,
    lab: Path | None = None,
) -> ExitStatus:
    """Judge sheets about their own robots, all about one robot, or each about its student's variant.

    Parameters
    ----------
    sheets
        Files, folders of them, and archives.
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
    delivery, place, seconds
        As in :func:`run`.
    key
        Key of the task's variants, which has a robot for each student.
    export
        Layout of the folders and archives; recognized unless given.
    students
        List of students, whose ids count instead of an export's names.
    lab
        A lab's assignment, whose records are judged among the sheets.

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
    own_files = [
        path for path in (rubric, task, Path(robot) if robot else None) if path is not None
    ]
    if key is not None:
        own_files.append(key.folder)
    listed = None if students is None else read_students(students)
    if students is not None:
        own_files.append(students)
    others = {}
    if lab is not None:
        others[SUFFIX] = record_judge(lab)
        own_files.append(lab)
    suffixes = (*SHEET_SUFFIXES, *others)
    with opened_submissions(sheets, export, own_files, suffixes) as submissions:
        _say_notes(submissions.notes)
        _say_notes(_late_notes(submissions.sheets, chosen))
        if listed is not None:
            named, unknown = with_ids(submissions.sheets, listed)
            submissions = replace(submissions, sheets=tuple(named))
            if unknown:
                _say_notes([f"{students}: nobody, or no single row, is {_listed(unknown)}"])
        if delivery.keep is Keep.LAST:
            submissions = replace(submissions, sheets=tuple(last_attempts(submissions.sheets)))
        are_several = submissions.are_several
        isolation = None
        if execute and place.scheduler is None:
            packages = read.task.packages if read is not None else ()
            name = sheets[0].name if not are_several else "the sheets' programs"
            hidden = [*own_files, *sheets, *submissions.folders]
            isolation = isolation_for(name, isolated or are_several, hidden, packages)
        judge = ClassJudge(
            chosen,
            GradeOptions(task=read, seed=seed, execute=execute, isolation=isolation),
            about,
            has_own_seeds=are_several,
            key=key,
            students={} if key is None else _students(submissions.sheets, key),
            others=others,
        )
        rules = [
            package_version(),
            content_digest(task) if task is not None else "",
            f"digits {chosen.digits}",
            "from the system's entropy" if seed is None else f"seed {seed}",
            f"executed {isolation or 'isolated'}" if execute else "read as text",
        ]

        def key_of(sheet: Sheet) -> str:
            if (other := judge.other_for(sheet.path)) is not None:
                # The name that was typed in the lab is compared with all by which the class knows the student.
                names = [*sheet.aliases, "listed as", *sheet.listed]
                return judgement_key(sheet, [package_version(), other.digest, *names])
            try:
                subject = judge.robot_of(sheet.path)
            except AnswerError:
                return ""
            return judgement_key(sheet, [*rules, subject.digest if subject is not None else ""])

        if are_several and place.scheduler is None:
            judge.prepare()
        return run(submissions, judge, delivery, place=place, seconds=seconds, key_of=key_of)


def record_judge(path: Path) -> RecordJudge:
    """Return the judge of the records of a lab's assignment.

    Raises
    ------
    DescriptionError
        The file is not an assignment, or one without goals.
    """
    assignment = Assignment.read(path)
    if not assignment.places:
        raise DescriptionError(f"{path}: an assignment without goals; expected points to be given")
    return RecordJudge(assignment)


def _late_notes(sheets: Sequence[Sheet], rubric: Rubric) -> Iterator[str]:
    """Yield a line on submissions that cannot be late, because nothing says when they were handed in."""
    without = sum(sheet.time is None for sheet in sheets)
    if rubric.late is None or not without:
        return
    due = f"due {rubric.late.due.isoformat()}"
    if without == len(sheets):
        yield f"{due}: nothing says when the sheets were handed in, and none counts as late"
    else:
        yield f"{due}: nothing says when {without} of {len(sheets)} sheets were handed in; they count as in time"


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - MAX_LISTED} more" if len(names) > MAX_LISTED else ""
    return ", ".join(plain(name, 80) for name in names[:MAX_LISTED]) + more


def _say_notes(notes: Iterable[str]) -> None:
    """Say on stderr how the files were read: stdout may be JSON."""
    for note in notes:
        sys.stderr.write(f"dhkit: {note}\n")


def _students(sheets: Sequence[Sheet], key: VariantKey) -> dict[Path, str]:
    """Return the student of each sheet by its file.

    The name of a single file counts, else that of its folder; in an export any name by which it tells the student.
    """
    students = {}
    for sheet in sheets:
        names = (
            (sheet.student, *sheet.aliases)
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
    submissions: Submissions,
    judge: ClassJudge,
    delivery: Delivery = PRINTED,
    *,
    place: JudgingPlace = HERE,
    seconds: float = 60.0,
    key_of: Callable[[Sheet], str] = lambda sheet: "",
) -> ExitStatus:
    """Judge sheets and deliver the reports; the status is NO if one is wrong, UNUSABLE if one is unreadable.

    Results of a class that go into a folder are written one by one. After a stop, sheets whose record in the folder has
    the same key are not judged again.

    Parameters
    ----------
    submissions
        The sheets.
    judge
        Judge of the sheets, with their rubric.
    delivery
        Form and place of the reports.
    place
        Where the sheets are judged.
    seconds
        Processor time for each sheet, s; on the clock a sheet may take four times as long.
    key_of
        Function from a sheet to the key of its judgement; empty for one that is always judged.

    Raises
    ------
    AnswerError
        There is no such format or feedback, or the output would overwrite a sheet.
    DhkitError
        No scheduler answers, or its workers cannot judge.
    """
    sheets = submissions.sheets
    several = submissions.are_several
    delivery.check(several)
    records = None
    if delivery.output is not None and delivery.is_folder(several):
        records = _records_of(sheets, delivery.output, key_of)
    taken = {} if records is None else records.earlier()
    waiting = [sheet for sheet in sheets if origin_of_sheet(sheet) not in taken]
    if taken:
        count = f"{len(taken)} of {counted(len(sheets), 'sheet')}"
        sys.stderr.write(
            f"dhkit: {delivery.output}: {count} were judged before, and are taken up\n"
        )

    def complete(report: GradeReport) -> None:
        if records is not None:
            records.write(report)

    judged: list[GradeReport] = []
    try:
        with _progress(len(waiting)) as progress:
            judged += place.reports(waiting, judge, seconds, complete, progress)
    except KeyboardInterrupt:
        if records is not None:
            sys.stderr.write(f"dhkit: stopped; the same command goes on with {delivery.output}\n")
        raise
    new = iter(judged)
    reports = []
    for sheet in sheets:
        origin = origin_of_sheet(sheet)
        report = taken[origin] if origin in taken else next(new)
        reports.append(judge.completed(report))
    delivery(reports, judge.rubric, several, records)
    return _status(reports)


def _records_of(sheets: Sequence[Sheet], folder: Path, key_of: Callable[[Sheet], str]) -> Records:
    """Return the records of a class's sheets, with the names that their files get."""
    origins = [origin_of_sheet(sheet) for sheet in sheets]
    names = file_names([student for student, _ in origins])
    keys = [key_of(sheet) for sheet in sheets]
    return Records(
        folder, dict(zip(origins, names, strict=True)), dict(zip(origins, keys, strict=True))
    )


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
