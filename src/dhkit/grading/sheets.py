"""Search for answer sheets in folders, with the student of each."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

from dhkit.errors import AnswerError
from dhkit.grading.answers.sources import SHEET_SUFFIXES
from dhkit.grading.bounds import BOUNDS

_ROBOT = re.compile(rb"^[ \t]*\[\[[ \t]*joint[ \t]*\]\]", re.MULTILINE)
_ANSWER = re.compile(rb"^[ \t]*(\[[ \t]*answer|answer[ \t.]*=)", re.MULTILINE)
_PEEK_BYTES = 1_000_000
"""Length of the beginning of a file by which robot files are recognized, bytes."""


@dataclass(frozen=True)
class Sheet:
    """An answer sheet.

    Attributes
    ----------
    path
        The file.
    student
        Student's name: the name of the file, or of the student's own folder.
    error
        Why the sheet is not to be judged; empty if it is.
    beside
        Names of the student's other files, which are not read.
    """

    path: Path
    student: str = ""
    error: str = ""
    beside: tuple[str, ...] = ()


def find_sheets(paths: Sequence[Path], exclude: Collection[Path] = ()) -> list[Sheet]:
    """Return the sheets among files and folders, each once, in the order given and by name within a folder.

    A file is taken as it is. In a folder and the folders below, files with a suffix of answer sheets are taken; hidden
    files, and robot files directly in the folder, are ignored. Files with other suffixes are not read: the student's
    sheet lists them, and if the student has no sheet they become one with an error. A link that leaves the folder is
    not followed, and becomes a sheet with an error; a link to a folder inside is ignored, because that folder is read
    anyway.

    The student of a sheet directly in a folder is the name of the file, of a sheet further below the name of the first
    folder below. The student of a single file is its name or, for several files of one name (``*/answer.toml``), the
    name of its folder. A student's name in a sheet counts only for a single file: in a class anybody could sign as
    another.

    Parameters
    ----------
    paths
        Files and folders.
    exclude
        Files in them that are not sheets, such as the rubric.

    Raises
    ------
    AnswerError
        No such file; a folder without sheets, or with too many.
    """
    found: dict[Path, Sheet] = {}
    stems = Counter(path.stem for path in paths)
    passed_over = {path.resolve() for path in exclude}
    for path in paths:
        if not path.exists():
            raise AnswerError(
                f"{path}: no such file; expected an answer sheet or a folder of them (--template NAME makes one)"
            )
        for sheet in (
            _in_folder(path, passed_over) if path.is_dir() else [Sheet(path, _student(path, stems))]
        ):
            found.setdefault(sheet.path.absolute(), sheet)
            if len(found) > BOUNDS.sheets:
                raise AnswerError(f"{path}: more than {BOUNDS.sheets} answer sheets")
    return list(found.values())


def _student(path: Path, stems: Counter[str]) -> str:
    if stems.total() == 1:
        return ""
    return path.absolute().parent.name if stems[path.stem] > 1 else path.stem


def _in_folder(root: Path, passed_over: Collection[Path]) -> list[Sheet]:
    sheets: dict[str, list[Sheet]] = {}
    unread: dict[str, list[Path]] = {}
    for sheet in _visit(root):
        if not sheet.error and sheet.path.resolve() in passed_over:
            continue
        if sheet.error == _UNREAD:
            unread.setdefault(sheet.student, []).append(sheet.path)
        else:
            sheets.setdefault(sheet.student, []).append(sheet)
    if not sheets:
        raise AnswerError(
            f"{root}: no answer sheet; expected files that end in {', '.join(sorted(SHEET_SUFFIXES))}"
        )
    for student, paths in unread.items():
        if student in sheets:
            first, *others = sheets[student]
            sheets[student] = [
                replace(first, beside=_shorten([path.name for path in paths])),
                *others,
            ]
        else:
            kinds = dict.fromkeys(path.suffix.lower() or path.name for path in paths)
            error = f"not read: {', '.join(_shorten(list(kinds)))}; expected {', '.join(sorted(SHEET_SUFFIXES))}"
            sheets[student] = [Sheet(paths[0], student, error)]
    return sorted(chain.from_iterable(sheets.values()), key=lambda sheet: sheet.path.parts)


def _shorten(names: Sequence[str]) -> tuple[str, ...]:
    more = (f"{len(names) - BOUNDS.listed_files} more",) if len(names) > BOUNDS.listed_files else ()
    return (*names[: BOUNDS.listed_files], *more)


_UNREAD = "unread"
"""Marks, in :func:`_visit`, a file with another suffix; it is replaced by a message for the student."""


def _visit(root: Path) -> Iterator[Sheet]:
    inside = root.resolve()
    for looked_at, path in enumerate(_walk(root, 0)):
        if looked_at >= BOUNDS.files:
            raise AnswerError(
                f"{root}: more than {BOUNDS.files} files; expected a folder of answer sheets"
            )
        parts = path.relative_to(root).parts
        student = path.stem if len(parts) == 1 else parts[0]
        if path.is_symlink() and (fault := _fault_of_link(path, inside)):
            yield Sheet(path, student, fault)
        elif path.is_dir():
            if fault := _fault_of_folder(path, len(parts)):
                yield Sheet(path, student, fault)
        elif path.suffix.lower() not in SHEET_SUFFIXES or _is_robot(path):
            if len(parts) > 1 or path.suffix.lower() not in SHEET_SUFFIXES:
                yield Sheet(path, student, _UNREAD)
        else:
            yield Sheet(path, student, "" if path.is_file() else "not a regular file")


def _walk(folder: Path, depth: int) -> Iterator[Path]:
    """Yield the entries of a folder, sorted, each folder followed by its entries; links are not followed."""
    try:
        entries = sorted(os.scandir(folder), key=lambda entry: entry.name)
    except OSError:
        return
    for entry in entries:
        if entry.name.startswith("."):
            continue
        path = folder / entry.name
        yield path
        if entry.is_dir(follow_symlinks=False) and depth + 1 < BOUNDS.folder_depth:
            yield from _walk(path, depth + 1)


def _fault_of_link(path: Path, inside: Path) -> str:
    """Return the error of a link; empty if its target is inside the folder, or would not be a sheet."""
    try:
        target = path.resolve(strict=True)
    except (OSError, RuntimeError):
        return "a link that leads nowhere" if path.suffix.lower() in SHEET_SUFFIXES else ""
    if target.is_relative_to(inside) or not (
        target.is_dir() or path.suffix.lower() in SHEET_SUFFIXES
    ):
        return ""
    return "a link out of the folder; it is not followed"


def _fault_of_folder(path: Path, depth: int) -> str:
    """Return why a folder is not searched; empty if it is, or for a link to a folder."""
    if path.is_symlink():
        return ""
    if depth >= BOUNDS.folder_depth:
        return f"nested deeper than {BOUNDS.folder_depth} folders; not looked into"
    return "" if os.access(path, os.R_OK | os.X_OK) else "a folder that cannot be read"


def _is_robot(path: Path) -> bool:
    """Whether a file is a robot file, which sheets beside it may name."""
    if path.suffix.lower() != ".toml" or not path.is_file():
        return False
    try:
        with path.open("rb") as file:
            start = file.read(_PEEK_BYTES)
    except OSError:
        return False
    return bool(_ROBOT.search(start)) and not _ANSWER.search(start)
