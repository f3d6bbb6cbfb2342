"""Search for answer sheets in folders, with the student of each."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
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
    shown
        Name of the file in reports; empty for its path.
    aliases
        Other names by which a platform's export tells the student: a number, an address, an ID.
    listed
        Cells of the student's row in a list of students.
    series, attempt
        Sheets of a student that have the same series were handed in one after the other, in the order of their
        attempts from 0.
    time
        When the sheet was handed in; None if nothing says it.
    is_marked_late
        Whether the export marks the sheet as late.
    """

    path: Path
    student: str = ""
    error: str = ""
    beside: tuple[str, ...] = ()
    shown: str = ""
    aliases: tuple[str, ...] = ()
    listed: tuple[str, ...] = ()
    series: str = ""
    attempt: int = 0
    time: datetime | None = None
    is_marked_late: bool = False

    @property
    def name(self) -> str:
        """Name of the file in reports."""
        return self.shown or str(self.path)


def find_sheets(
    paths: Sequence[Path],
    exclude: Collection[Path] = (),
    suffixes: Collection[str] = SHEET_SUFFIXES,
) -> list[Sheet]:
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
    suffixes
        Suffixes of the files that are read.

    Raises
    ------
    AnswerError
        No such file; a folder without sheets, or with too many.
    """
    found: dict[Path, Sheet] = {}
    stems = Counter(split_name(path.name, suffixes)[0] for path in paths)
    passed_over = {path.resolve() for path in exclude}
    for path in paths:
        if not path.exists():
            raise AnswerError(
                f"{path}: no such file; expected an answer sheet or a folder of them (--template NAME makes one)"
            )
        for sheet in (
            _in_folder(path, passed_over, suffixes)
            if path.is_dir()
            else [Sheet(path, _student(path, split_name(path.name, suffixes)[0], stems))]
        ):
            found.setdefault(sheet.path.absolute(), sheet)
            if len(found) > BOUNDS.sheets:
                raise AnswerError(f"{path}: more than {BOUNDS.sheets} answer sheets")
    return list(found.values())


def split_name(name: str, suffixes: Collection[str]) -> tuple[str, str]:
    """Return the name of a file without its suffix, and the suffix in lower case.

    A suffix of two parts counts where it is among those given. Browsers and Canvas number copies of a file before its
    last part; such a number belongs to neither.

    Parameters
    ----------
    name
        Name of the file, without folders.
    suffixes
        Suffixes that are looked for, such as ``.py`` and ``.lab.json``.

    Examples
    --------
    >>> split_name("answer.v2.py", [".py", ".lab.json"]), split_name("wave.lab-1.json", [".py", ".lab.json"])
    (('answer.v2', '.py'), ('wave', '.lab.json'))
    """
    for suffix in suffixes:
        first, _, last = suffix.rpartition(".")
        if first:
            copy = rf"(.+){re.escape(first)}(?:-\d+| ?\(\d+\))?\.{re.escape(last)}"
            if found := re.fullmatch(copy, name, re.IGNORECASE | re.DOTALL | re.ASCII):
                return found[1], suffix
    path = Path(name)
    return path.stem, path.suffix.lower()


def _student(path: Path, stem: str, stems: Counter[str]) -> str:
    if stems.total() == 1:
        return ""
    return path.absolute().parent.name if stems[stem] > 1 else stem


def _in_folder(root: Path, passed_over: Collection[Path], suffixes: Collection[str]) -> list[Sheet]:
    visited = []
    for sheet in visit(root, suffixes):
        is_own = sheet.error in ("", UNREAD) and sheet.path.resolve() in passed_over
        is_robot_beside = sheet.error == UNREAD and _is_robot_of_all(sheet.path, root, suffixes)
        if not is_own and not is_robot_beside:
            visited.append(sheet)
    return gathered(visited, root, suffixes)


def gathered(visited: Sequence[Sheet], root: Path, suffixes: Collection[str]) -> list[Sheet]:
    """Return the sheets of a folder, with the files that are not read listed beside the sheet of the same submission.

    Parameters
    ----------
    visited
        What :func:`visit` found, with the students.
    root
        The folder.
    suffixes
        Suffixes of the files that are read.

    Raises
    ------
    AnswerError
        There is no sheet at all.
    """
    sheets: dict[tuple[str, int], list[Sheet]] = {}
    unread: dict[tuple[str, int], list[Sheet]] = {}
    for sheet in visited:
        submission = (sheet.student, sheet.attempt)
        kind = unread if sheet.error == UNREAD else sheets
        kind.setdefault(submission, []).append(sheet)
    if not sheets:
        raise AnswerError(
            f"{root}: no answer sheet; expected files that end in {', '.join(sorted(suffixes))}"
        )
    for submission, others in unread.items():
        if submission in sheets:
            first, *more = sheets[submission]
            names = [Path(other.name).name for other in others]
            sheets[submission] = [replace(first, beside=_shorten(names)), *more]
        else:
            kinds = dict.fromkeys(
                other.path.suffix.lower() or Path(other.name).name for other in others
            )
            error = f"not read: {', '.join(_shorten(list(kinds)))}; expected {', '.join(sorted(suffixes))}"
            sheets[submission] = [replace(others[0], error=error)]
    return sorted(chain.from_iterable(sheets.values()), key=lambda sheet: sheet.path.parts)


def _shorten(names: Sequence[str]) -> tuple[str, ...]:
    more = (f"{len(names) - BOUNDS.listed_files} more",) if len(names) > BOUNDS.listed_files else ()
    return (*names[: BOUNDS.listed_files], *more)


UNREAD = "unread"
"""Error, in what :func:`visit` yields, of a file with another suffix; :func:`gathered` replaces it by a message."""


def visit(root: Path, suffixes: Collection[str]) -> Iterator[Sheet]:
    """Yield every file below a folder as a sheet of the student that its place says; :func:`gathered` sorts them.

    Parameters
    ----------
    root
        The folder.
    suffixes
        Suffixes of the files that are read; others, and robot files, have the error :data:`UNREAD`.

    Raises
    ------
    AnswerError
        There are too many files.
    """
    inside = root.resolve()
    for looked_at, path in enumerate(_walk(root, 0)):
        if looked_at >= BOUNDS.files:
            raise AnswerError(
                f"{root}: more than {BOUNDS.files} files; expected a folder of answer sheets"
            )
        parts = path.relative_to(root).parts
        stem, suffix = split_name(path.name, suffixes)
        student = stem if len(parts) == 1 else parts[0]
        # A link in a student's folder must not lead to another student's sheet.
        own = inside if len(parts) == 1 else inside / parts[0]
        if path.is_symlink() and (fault := _fault_of_link(path, own, suffixes)):
            yield Sheet(path, student, fault)
        elif path.is_dir():
            if fault := _fault_of_folder(path, len(parts)):
                yield Sheet(path, student, fault)
        elif suffix not in suffixes or _is_robot(path):
            yield Sheet(path, student, UNREAD)
        else:
            yield Sheet(path, student, "" if path.is_file() else "not a regular file")


def _is_robot_of_all(path: Path, root: Path, suffixes: Collection[str]) -> bool:
    """Whether a file is a robot file directly in the folder, which all sheets may name."""
    return path.parent == root and path.suffix.lower() in suffixes


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


def _fault_of_link(path: Path, inside: Path, suffixes: Collection[str]) -> str:
    """Return the error of a link; empty if its target is inside a folder, or would not be a sheet."""
    is_sheet = split_name(path.name, suffixes)[1] in suffixes
    try:
        target = path.resolve(strict=True)
    except (OSError, RuntimeError):
        return "a link that leads nowhere" if is_sheet else ""
    if target.is_relative_to(inside) or not (target.is_dir() or is_sheet):
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
