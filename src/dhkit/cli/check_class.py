"""`dhkit check` for a class: programs in a folder or a platform's export, scored several at a time."""

from __future__ import annotations

import json as jsons
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from dhkit.arm import Arm
from dhkit.cli.exit_status import ExitStatus
from dhkit.cli.grade_folder import KEY, MARKS, file_names
from dhkit.cli.isolating import isolation_for
from dhkit.cli.output import print_table, say
from dhkit.cli.progress import ProgressBar
from dhkit.description import write_atomically
from dhkit.description.files import read_bounded
from dhkit.display import counted, plain
from dhkit.errors import AnswerError, DescriptionError
from dhkit.execution import Limits
from dhkit.grading.batch import content_digest, judgement_key, origin_of_sheet
from dhkit.grading.bounds import BOUNDS
from dhkit.grading.exports import (
    ExportKind,
    Keep,
    are_best,
    last_attempts,
    opened_submissions,
)
from dhkit.grading.reports.sentences import points
from dhkit.grading.sheet_judge import package_version
from dhkit.grading.sheets import Sheet
from dhkit.programs import CheckRubric
from dhkit.programs.class_check import (
    PROGRAM_SUFFIXES,
    CheckRow,
    check_class,
    check_csv,
    check_page,
    most_of,
)

SHOWN = 100
"""Characters of a failure in the table on the terminal."""


def check_folder(
    arm: Arm,
    folder: Path,
    rubric: Path | None,
    *,
    seed: int | None,
    samples: int,
    seconds: float,
    export: ExportKind | None,
    keep: Keep = Keep.LAST,
    jobs: int | None,
    output: Path | None,
    json: bool,
) -> ExitStatus:
    """Score the programs of a class, print or write a table, and return the status of the worst.

    Parameters
    ----------
    arm
        The arm.
    folder
        Folder or archive of the programs.
    rubric
        File of a rubric.
    seed, samples, seconds
        As for a single program; each program's seed follows from the seed and its content.
    export
        Layout of the folder; recognized unless given.
    keep
        Which of a student's programs counts. All that are scored have a record, and those that count a row.
    jobs
        Number of programs at a time; by default one for each core.
    output
        Folder for the table, the page and the records, with which a stopped run goes on.
    json
        Whether rows are printed as JSON, one a line.

    Raises
    ------
    AnswerError
        There is no program, or the output is a file.
    IsolationError
        Programs of others cannot be isolated on this system.
    """
    if output is not None and output.exists() and not output.is_dir():
        raise AnswerError(f"{output}: a file; expected a folder for the scores of a class")
    points_of_parts = None if rubric is None else CheckRubric.read(rubric)
    own_files = [] if rubric is None else [rubric]
    with opened_submissions([folder], export, own_files, PROGRAM_SUFFIXES) as submissions:
        for note in submissions.notes:
            sys.stderr.write(f"dhkit: {note}\n")
        sheets = list(submissions.sheets)
        if keep is Keep.LAST:
            sheets = last_attempts(sheets)
        hidden = [*own_files, folder, *submissions.folders]
        isolation = isolation_for("the class's programs", True, hidden)
        rules = [
            package_version(),
            arm.description.digest,
            content_digest(rubric) if rubric is not None else "",
            f"seed {seed}, {samples} samples, {seconds:g} s, {isolation}",
        ]
        names = file_names([origin_of_sheet(sheet)[0] for sheet in sheets])
        keys = [judgement_key(sheet, rules) for sheet in sheets]
        place = dict(zip(map(origin_of_sheet, sheets), zip(names, keys, strict=True), strict=True))
        rows = {} if output is None else _earlier(output, sheets, keys)
        if rows:
            count = f"{len(rows)} of {counted(len(sheets), 'program')}"
            sys.stderr.write(f"dhkit: {output}: {count} were scored before, and are taken up\n")
        waiting = [sheet for sheet in sheets if origin_of_sheet(sheet) not in rows]
        taken = len(rows)

        with ProgressBar("scoring programs") as bar:

            def done(sheet: Sheet, row: CheckRow) -> None:
                rows[origin_of_sheet(sheet)] = row
                bar.show(len(rows) - taken, len(waiting))
                name, key = place[origin_of_sheet(sheet)]
                # An error may be the machine's; another run tries again.
                if output is not None and key and not row.error:
                    record = {**jsons.loads(row.to_json()), KEY: key}
                    text = jsons.dumps(record, ensure_ascii=False)
                    write_atomically(output / "records" / f"{name}.json", text + "\n")

            try:
                check_class(
                    arm,
                    waiting,
                    points_of_parts,
                    seed=seed,
                    samples=samples,
                    limits=Limits(seconds=seconds),
                    isolation=isolation,
                    jobs=jobs or os.cpu_count() or 1,
                    done=done,
                )
            except KeyboardInterrupt:
                if output is not None:
                    sys.stderr.write(f"dhkit: stopped; the same command goes on with {output}\n")
                raise
        ordered = [rows[origin_of_sheet(sheet)] for sheet in sheets]
    counting = ordered
    if keep is Keep.BEST:
        best = are_best([row.student for row in ordered], [row.points for row in ordered])
        counting = [row for row, is_best in zip(ordered, best, strict=True) if is_best]
    if output is not None:
        write_atomically(output / MARKS, check_csv(counting))
        write_atomically(output / "class.html", check_page(counting, arm.name, MARKS))
    if json:
        for row in counting:
            sys.stdout.write(row.to_json() + "\n")
    else:
        _print(counting)
        if output is not None:
            say(f"wrote {output}")
    if any(row.error for row in ordered):
        return ExitStatus.UNUSABLE
    is_full = all(row.report is not None and row.report.full for row in ordered)
    return ExitStatus.FINE if is_full else ExitStatus.NO


def _earlier(
    output: Path, sheets: Sequence[Sheet], keys: Sequence[str]
) -> dict[tuple[str, str], CheckRow]:
    """Return the rows of earlier runs that would be made again, by student and file."""
    origins = {key: origin_of_sheet(sheet) for key, sheet in zip(keys, sheets, strict=True) if key}
    found = {}
    for path in sorted((output / "records").glob("*.json")):
        with suppress(DescriptionError, ValueError, AttributeError, RecursionError):
            data = jsons.loads(read_bounded(path, BOUNDS.report_bytes, "a record"))
            key = data.pop(KEY, None)
            if key in origins:
                found[origins[key]] = CheckRow.from_json(jsons.dumps(data))
    return found


def _print(rows: Sequence[CheckRow]) -> None:
    lines = []
    for row in rows:
        place, said = row.first_failure
        failure = plain(f"{place}: {said}" if place else "", SHOWN)
        lines.append(
            (plain(row.student, 60), points(row.points), points(most_of(row, rows)), failure)
        )
    print_table(("student", "points", "of", "first failure"), lines, title="Programs")
