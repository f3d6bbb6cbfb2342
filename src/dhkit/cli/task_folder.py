"""A folder with variants of a task: a folder for each student and the key beside them, written whole or not at all."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import tomlkit

from dhkit.description import to_toml
from dhkit.description.files import check_place, whole_folder
from dhkit.errors import AnswerError, MissingPackageError
from dhkit.grading.answers.sheet_values import AnswerSheet
from dhkit.grading.empty_sheet import template
from dhkit.grading.variants import Variant, VariantKey, Variants
from dhkit.grading.variants.key import key_files
from dhkit.report.document import html_text, pdf
from dhkit.report.document.pdf import require_typst
from dhkit.report.pictures import image_png
from dhkit.report.statement import statement
from dhkit.viewer.pictures import picture

STUDENTS = "students"
KEY = "key"
ROBOT = "robot.toml"
SHEET = "sheet.toml"
PICTURE_SIZE = (960, 720)
"""Width and height of the picture of an arm, px."""
_STUDENT_LINE = re.compile(r'^student = ""$', re.MULTILINE)


def check_folder(folder: Path, *, force: bool) -> None:
    """Refuse a folder that the variants cannot be written to, before they are drawn.

    Parameters
    ----------
    folder
        The folder: new, empty, or with ``force`` one that an earlier run wrote.
    force
        Whether variants of an earlier run are replaced; a folder with anything else is refused all the same.

    Raises
    ------
    AnswerError
        The folder is a file or has other content.
    DescriptionError
        Its place cannot be written to.
    """
    if folder.exists() and not folder.is_dir():
        raise AnswerError(f"{folder}: a file; expected a new folder")
    if not folder.exists():
        check_place(folder)
        return
    names = {path.name for path in folder.iterdir()}
    if names and (not names <= {STUDENTS, KEY} or earlier_key(folder) is None):
        raise AnswerError(f"{folder}: has files that are not variants; expected a new folder")
    if names and not force:
        raise AnswerError(f"{folder}: has variants already; expected a new folder, or --force")


def can_print() -> bool:
    """Return whether the package that writes PDF is installed."""
    try:
        require_typst()
    except MissingPackageError:
        return False
    return True


def earlier_key(folder: Path) -> VariantKey | None:
    """Return the key that an earlier run wrote into a folder; None if there is none."""
    try:
        return VariantKey.read(folder / KEY)
    except AnswerError:
        return None


def write_folder(
    varied: Variants,
    task: Path,
    drawn: Sequence[Variant],
    seed: int,
    folder: Path,
    progress: Callable[[int, int], object],
) -> None:
    """Write the variants of all students and their key; an interrupted run leaves the folder as it was.

    Parameters
    ----------
    varied
        What varies.
    task
        The task's file.
    drawn
        The variants of all students.
    seed
        Seed of the variants.
    folder
        A folder that :func:`check_folder` accepts.
    progress
        Called with the number of students written so far and the number of all students.
    """
    with whole_folder(folder) as complete:
        for name, content in key_files(varied, task, drawn, seed).items():
            _write(complete / KEY / name, content)
        for done, variant in enumerate(drawn):
            progress(done, len(drawn))
            for name, content in student_files(variant, varied.task).items():
                _write(complete / STUDENTS / variant.student / name, content)


def student_files(variant: Variant, task: AnswerSheet) -> dict[str, bytes]:
    """Return the files of a student by name: sheet, robot file, picture and statement.

    Parameters
    ----------
    variant
        The student's arm.
    task
        The task.
    """
    description = variant.description
    image = image_png(picture(description, size=PICTURE_SIZE, frames=True))
    student = tomlkit.string(variant.student).as_string()
    empty = template(description, ROBOT, task)
    sheet = _STUDENT_LINE.sub(lambda _: f"student = {student}", empty, count=1)
    document = statement(description, task, variant.student, SHEET, image)
    # Notes of library robots may say what is asked.
    own = replace(description, notes="")
    files = {
        SHEET: sheet.encode(),
        ROBOT: to_toml(own).encode(),
        "picture.png": image,
        "statement.html": html_text(document).encode(),
    }
    if can_print():
        files["statement.pdf"] = pdf(document).content
    return files


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
