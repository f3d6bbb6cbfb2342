"""What runs on a platform: one student's submission is judged, and the platform's file of results is written.

``python -m dhkit.platforms.running gradescope /autograder`` is called by the scripts of a package, in the folders that
the platform has laid out. Whatever a student hands in, a file of results is written: a submission that cannot be judged
gets 0 points and the reason.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dhkit.description.files import read_bounded, write_atomically
from dhkit.errors import AnswerError, DescriptionError, DhkitError
from dhkit.grading.batch import grade_all
from dhkit.grading.entry_points import grade, prepare
from dhkit.grading.grade_report import GradeReport
from dhkit.grading.marks import Marks, marks
from dhkit.grading.options import GradeOptions
from dhkit.grading.reports import gradescope, prairielearn, with_feedback
from dhkit.grading.rubric import Rubric
from dhkit.grading.sheets import find_sheets
from dhkit.grading.variants import VariantKey
from dhkit.platforms.containers import KEY
from dhkit.platforms.contents import Task

_SECONDS = 60.0
"""Processor time for judging a submission, s."""
_METADATA = "submission_metadata.json"
"""Gradescope's file about a submission, in its own folder."""
_METADATA_BYTES = 1_000_000
"""Largest such file, bytes."""
USAGE = "expected: python -m dhkit.platforms.running gradescope|prairielearn FOLDER"


@dataclass(frozen=True)
class Layout:
    """Where a platform puts things, relative to its own folder, and the form of its results."""

    task: str
    submission: str
    results: str
    result: Callable[[GradeReport, Marks], Mapping[str, object]]


LAYOUTS = {
    # Source: Gradescope, Autograder Specifications.
    "gradescope": Layout("source/task.toml", "submission", "results/results.json", gradescope),
    # Source: PrairieLearn, External Grading.
    "prairielearn": Layout("tests/task.toml", "student", "results/results.json", prairielearn),
}


def grade_submission(platform: str, root: Path) -> None:
    """Judge the submission in a platform's folder, and write its results there.

    Parameters
    ----------
    platform
        A key of :data:`LAYOUTS`.
    root
        The platform's folder: ``/autograder`` or ``/grade``.
    """
    layout = LAYOUTS[platform]
    folder = root / layout.submission
    rubric = Rubric()
    try:
        task = _task(root, layout)
        rubric = task.rubric
        report = _judged(folder, task)
    except DhkitError as error:
        report = GradeReport(error=" ".join(str(error).split()))
    # Students see the names of their files, not where the platform keeps them.
    plain = report.error.replace(f"{folder}/", "").replace(f"{folder}: ", "")
    report = replace(report, error=plain)
    given = marks(report, rubric)
    if rubric.feedback != "full":
        given = given.without_rules()
    result = layout.result(with_feedback(report, rubric.feedback), given)
    write_atomically(root / layout.results, json.dumps(result, ensure_ascii=False, indent=2))


def _task(root: Path, layout: Layout) -> Task:
    """Return the task, with the student's own robot where the package has a key of variants."""
    key_folder = (root / layout.task).parent / KEY
    if not key_folder.is_dir():
        return Task.read(root / layout.task)
    key = VariantKey.read(key_folder)
    ids = list(_submitters(root / _METADATA))
    student = next((one for one in ids if one in key), None)
    if student is None:
        raise AnswerError(
            f"no variant for {', '.join(ids) or 'an unknown student'}: ask your instructor"
        )
    return Task.of_student(key, student)


def _submitters(path: Path) -> Iterator[str]:
    """Yield ids of those who handed in, from Gradescope's metadata: number, address and its first part, name."""
    try:
        users = json.loads(read_bounded(path, _METADATA_BYTES, "metadata"))["users"]
    except (ValueError, KeyError, TypeError, RecursionError, DescriptionError):
        return
    for user in users if isinstance(users, list) else ():
        if not isinstance(user, dict):
            continue
        for key in ("sid", "email", "name"):
            text = user.get(key)
            if not isinstance(text, str) or not text:
                continue
            yield text
            if "@" in text:
                yield text.partition("@")[0]


def _judged(folder: Path, task: Task) -> GradeReport:
    """Return the report on the only answer file in a folder, judged in a process of its own.

    Files of other kinds may lie beside it; the report names them.
    """
    found = find_sheets([folder])
    sheets = [sheet for sheet in found if not sheet.error] or found
    if len(sheets) > 1:
        names = ", ".join(sheet.path.name for sheet in sheets[:5])
        raise AnswerError(f"found several answer files: {names}; expected one")
    beside = tuple(sheet.path.name for sheet in found if sheet.error)
    options = GradeOptions(task=task.sheet)
    prepare(task.description)
    reports = grade_all(
        [replace(sheets[0], student="", beside=(*sheets[0].beside, *beside))],
        lambda path: grade(path, task.description, task.rubric, options=options),
        seconds=_SECONDS,
    )
    return replace(next(reports), sheet=sheets[0].path.name)


def main(arguments: Sequence[str]) -> int:
    """Run the judge of a platform; return the exit status."""
    if len(arguments) != 2 or arguments[0] not in LAYOUTS:
        sys.stderr.write(f"dhkit: {USAGE}\n")
        return 2
    grade_submission(arguments[0], Path(arguments[1]))
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
