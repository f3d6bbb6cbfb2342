"""Submissions of a class as teaching platforms export them: folders and archives of Canvas, Moodle and Gradescope."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Hashable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Any, TypeAlias

from dhkit.description.files import read_bounded
from dhkit.display import counted
from dhkit.errors import AnswerError
from dhkit.grading.answers.sources import SHEET_SUFFIXES
from dhkit.grading.archives import is_archive, unpacked
from dhkit.grading.bounds import BOUNDS
from dhkit.grading.sheets import Sheet, find_sheets, gathered, visit
from dhkit.grading.variants.students import Students

METADATA = "submission_metadata.yml"
"""File of a Gradescope export that names the submitters."""
_CANVAS = re.compile(
    r"(?P<student>[^_]+)(?P<late>_LATE)?_(?P<user>\d+)_(?P<file_id>\d+)_(?P<file>.+)", re.ASCII
)
_RESUBMISSION = re.compile(r"(?P<stem>.+)-(?P<number>[1-9]\d{0,3})", re.ASCII)
_MOODLE = re.compile(
    r"(?P<student>.+?)_(?P<participant>\d+)_assignsubmission_(?:file|onlinetext)(?:_(?P<file>.*))?",
    re.ASCII,
)


class ExportKind(StrEnum):
    """Layout of the submissions of a class."""

    PLAIN = "plain"
    CANVAS = "canvas"
    MOODLE = "moodle"
    GRADESCOPE = "gradescope"

    @property
    def sentence(self) -> str:
        """The layout with an article, for messages."""
        return "plain folder" if self is ExportKind.PLAIN else f"{self.value.capitalize()} export"


class Keep(StrEnum):
    """Which of a student's submissions counts."""

    LAST = "last"
    BEST = "best"
    ALL = "all"


@dataclass(frozen=True)
class Submissions:
    """The sheets of a class.

    Attributes
    ----------
    sheets
        Sheets with their students, all attempts.
    notes
        Sentences that say how the files were read.
    are_several
        Whether a class was given: several sheets, a folder or an archive.
    folders
        Temporary folders of unpacked archives.
    """

    sheets: tuple[Sheet, ...]
    notes: tuple[str, ...] = ()
    are_several: bool = False
    folders: tuple[Path, ...] = ()


_Owner: TypeAlias = Callable[[Sheet], Sequence[Sheet]]
"""Function from a file of an export to the same file with its student; several of a group, and none for what is not a
submission."""


@contextmanager
def opened_submissions(
    paths: Sequence[Path],
    kind: ExportKind | None = None,
    exclude: Collection[Path] = (),
    suffixes: Collection[str] = SHEET_SUFFIXES,
) -> Iterator[Submissions]:
    """Find the sheets of a class in files, folders and archives, which stay unpacked for the time of the context.

    Parameters
    ----------
    paths
        Files, folders, and archives of folders.
    kind
        Layout of the folders and archives; recognized by the names of their files unless given.
    exclude
        Files that are not sheets, such as the rubric.
    suffixes
        Suffixes of the files that are read.

    Yields
    ------
    Submissions
        The sheets, and how they were read.

    Raises
    ------
    AnswerError
        No such file, no sheet, an archive that is damaged or dangerous, or another layout than the one given.

    Examples
    --------
    >>> from pathlib import Path
    >>> Path("export").mkdir()
    >>> for name in ("lovelaceada_101_5001_answer.py", "babbagecharles_LATE_102_5002_answer.py"):
    ...     size = Path("export", name).write_text("g1 = 0")
    >>> with opened_submissions([Path("export")]) as submissions:
    ...     submissions.notes[0], [sheet.student for sheet in submissions.sheets]
    ('export: read as a Canvas export: 2 students', ['babbagecharles_102', 'lovelaceada_101'])
    """
    sheets: list[Sheet] = []
    notes: list[str] = []
    plain_paths: list[Path] = []
    folders: list[Path] = []
    with ExitStack() as opened:
        for path in paths:
            if path.exists() and is_archive(path):
                folders.append(opened.enter_context(unpacked(path)))
                root = _top(folders[-1])
            elif path.is_dir():
                root = path
            else:
                plain_paths.append(path)
                continue
            found = kind or recognized(root)
            if found is ExportKind.PLAIN and root == path:
                plain_paths.append(path)
                continue
            read = _read_folder(root, found, exclude, suffixes, path)
            sheets += [replace(sheet, shown=_shown(sheet, root, path)) for sheet in read]
            notes += _notes(path, found, read)
        if plain_paths:
            sheets += find_sheets(plain_paths, exclude, suffixes)
        if len(sheets) > BOUNDS.sheets:
            raise AnswerError(f"{paths[0]}: more than {BOUNDS.sheets} answer sheets")
        are_several = len(sheets) > 1 or any(path.is_dir() or is_archive(path) for path in paths)
        yield Submissions(tuple(sheets), tuple(notes), are_several, tuple(folders))


def recognized(root: Path) -> ExportKind:
    """Return the layout of a folder by the names in it.

    Parameters
    ----------
    root
        The folder.

    Returns
    -------
    ExportKind
        Gradescope if it has the file that names the submitters; Canvas or Moodle if all names in it are of their
        form; otherwise plain.
    """
    if (root / METADATA).is_file():
        return ExportKind.GRADESCOPE
    entries = [entry for entry in root.iterdir() if not entry.name.startswith(".")]
    if entries and all(entry.is_file() and _CANVAS.fullmatch(entry.name) for entry in entries):
        return ExportKind.CANVAS
    if entries and all(_MOODLE.fullmatch(entry.name) for entry in entries):
        return ExportKind.MOODLE
    return ExportKind.PLAIN


def last_attempts(sheets: Sequence[Sheet]) -> list[Sheet]:
    """Return the sheets without those that their student replaced by a later one.

    Parameters
    ----------
    sheets
        Sheets of all attempts.

    Returns
    -------
    list[Sheet]
        For each student and series those of the last attempt, in the order given.
    """
    last = Counter[tuple[str, str]]()
    for sheet in sheets:
        place = sheet.student, sheet.series
        last[place] = max(last[place], sheet.attempt)
    return [sheet for sheet in sheets if sheet.attempt == last[sheet.student, sheet.series]]


def are_best(owners: Sequence[Hashable], points: Sequence[float]) -> list[bool]:
    """Return for each submission whether it is its owner's with the most points; of equal ones the last is.

    Parameters
    ----------
    owners
        For each submission a value that is equal for those of which one counts.
    points
        Points of each.

    Examples
    --------
    >>> are_best(["ada", "bob", "ada", "ada"], [5, 3, 8, 7])
    [False, True, True, False]
    """
    best: dict[Hashable, int] = {}
    for number, owner in enumerate(owners):
        if owner not in best or points[number] >= points[best[owner]]:
            best[owner] = number
    counting = set(best.values())
    return [number in counting for number in range(len(owners))]


def with_ids(sheets: Sequence[Sheet], students: Students) -> tuple[list[Sheet], list[str]]:
    """Return the sheets of an export with the ids of a list of students instead of the platform's names.

    Parameters
    ----------
    sheets
        The sheets.
    students
        The list.

    Returns
    -------
    list[Sheet], list[str]
        The sheets, and the students who are not in the list, or whose name several have; these keep the platform's.
    """
    ids = {}
    for sheet in sheets:
        ids[sheet.student] = students.find((*sheet.aliases, sheet.student))
    # Two students of the platform who have one name cannot both be the one of the list.
    claims = Counter(ids.values())
    unknown = [name for name, student in ids.items() if not student or claims[student] > 1]
    rows = dict(zip(students.ids, students.rows, strict=True))
    named = []
    for sheet in sheets:
        if sheet.student not in unknown:
            student = ids[sheet.student]
            sheet = replace(sheet, student=student, listed=rows[student])
        named.append(sheet)
    return named, unknown


def _top(folder: Path) -> Path:
    """Return the folder of a class in an unpacked archive: many archives have a single folder in which all is."""
    while True:
        entries = [entry for entry in folder.iterdir() if not entry.name.startswith(".")]
        if len(entries) != 1 or not entries[0].is_dir() or _MOODLE.fullmatch(entries[0].name):
            return folder
        inside = [entry for entry in entries[0].iterdir() if not entry.name.startswith(".")]
        is_submission = len(inside) == 1 and inside[0].is_file()
        if is_submission and not _CANVAS.fullmatch(inside[0].name):
            return folder
        folder = entries[0]


def _shown(sheet: Sheet, root: Path, path: Path) -> str:
    """Return the name of a file of an export in reports: that of the archive, and the place in it."""
    return str(path / sheet.path.relative_to(root))


def _read_folder(
    root: Path,
    kind: ExportKind,
    exclude: Collection[Path],
    suffixes: Collection[str],
    path: Path,
) -> list[Sheet]:
    """Return the sheets of a folder; messages name the path that the user gave."""
    try:
        if kind is ExportKind.PLAIN:
            return find_sheets([root], exclude, suffixes)
        owner = _OWNERS[kind](root, path)
        visited: list[Sheet] = []
        for sheet in visit(root, suffixes):
            visited += owner(sheet)
        if kind is ExportKind.CANVAS:
            visited = _with_canvas_attempts(visited)
        return gathered(visited, path, suffixes)
    except AnswerError as error:
        raise AnswerError(str(error).replace(str(root), str(path))) from None


def _notes(path: Path, kind: ExportKind, sheets: Sequence[Sheet]) -> Iterator[str]:
    students = {sheet.student for sheet in sheets}
    again = {sheet.student for sheet in sheets if sheet.attempt}
    text = f"{path}: read as a {kind.sentence}: {counted(len(students), 'student')}"
    yield text + (f", {len(again)} of them handed in again" if again else "")
    if marked := sum(sheet.is_marked_late for sheet in sheets):
        yield (
            f"{path}: {counted(marked, 'file')} marked LATE by Canvas, which does not say by how much: "
            "no points are taken off"
        )


# Canvas: `lastnamefirstname_LATE_user_file_name-1.py`, all in one folder.


def _canvas_owner(root: Path, path: Path) -> _Owner:
    def owner(sheet: Sheet) -> Sequence[Sheet]:
        found = _CANVAS.fullmatch(sheet.path.name)
        if found is None or sheet.path.parent != root:
            fault = "not the name of a file of Canvas; expected name_12345_67890_file"
            return [replace(sheet, error=fault)]
        user = found["user"]
        student = found["student"]
        return [
            replace(
                sheet,
                student=f"{student}_{user}",
                aliases=(user, student),
                series=found["file"],
                is_marked_late=found["late"] is not None,
            )
        ]

    return owner


def _with_canvas_attempts(sheets: Sequence[Sheet]) -> list[Sheet]:
    """Return the sheets with attempts by the number that Canvas adds to a name that was handed in before.

    ``answer-1.py`` replaces ``answer.py``. Where there is no ``answer.py``, the number may be the student's own.
    """
    names = {(sheet.student, sheet.series) for sheet in sheets}
    numbered = []
    for sheet in sheets:
        name = Path(sheet.series)
        again = _RESUBMISSION.fullmatch(name.stem)
        first = f"{again['stem']}{name.suffix}" if again else ""
        if again and (sheet.student, first) in names:
            sheet = replace(sheet, series=first, attempt=int(again["number"]))
        numbered.append(sheet)
    return numbered


# Moodle: folders `Name_participant_assignsubmission_file_`, or files with that in front.


def _moodle_owner(root: Path, path: Path) -> _Owner:
    def owner(sheet: Sheet) -> Sequence[Sheet]:
        found = _MOODLE.fullmatch(sheet.path.relative_to(root).parts[0])
        if found is None:
            fault = "not a name of Moodle; expected Name_12345_assignsubmission_file"
            return [replace(sheet, error=fault)]
        name = found["student"]
        participant = found["participant"]
        return [replace(sheet, student=f"{name}_{participant}", aliases=(participant, name))]

    return owner


# Gradescope: folders `submission_N`, and a file that says whose they are.


def _gradescope_owner(root: Path, path: Path) -> _Owner:
    owners = _submitters(root / METADATA, path)

    def owner(sheet: Sheet) -> Sequence[Sheet]:
        first = sheet.path.relative_to(root).parts[0]
        if first == METADATA:
            return []
        if first not in owners:
            return [replace(sheet, student=first, error=f"not named in {METADATA}")]
        return [
            replace(
                sheet,
                student=one.student,
                aliases=one.aliases,
                attempt=one.attempt,
                time=one.time,
            )
            for one in owners[first]
        ]

    return owner


@dataclass(frozen=True)
class _Submitter:
    """A student who handed in a submission, when, and after how many others of the export."""

    student: str
    aliases: tuple[str, ...]
    time: datetime | None
    attempt: int = 0


def _submitters(file: Path, path: Path) -> dict[str, list[_Submitter]]:
    """Return the submitters of each folder of a Gradescope export, also of earlier submissions (``history``)."""
    content = read_bounded(file, BOUNDS.metadata_bytes, "an export's submitters", AnswerError)
    data = _yaml(content, f"{path}: {METADATA}")
    if not isinstance(data, dict):
        raise AnswerError(f"{path}: {METADATA}: found no submissions; expected submission_N: ...")
    owners: dict[str, list[_Submitter]] = {}
    for folder, entry in data.items():
        if not isinstance(entry, dict) or not isinstance(entry.get(":submitters"), list):
            raise AnswerError(f"{path}: {METADATA}: {str(folder)[:80]}: no submitters")
        history = entry.get(":history")
        earlier = [one for one in history or () if isinstance(one, dict) and ":id" in one]
        for name, when in [
            *((f"submission_{one[':id']}", one.get(":created_at")) for one in earlier),
            (str(folder), entry.get(":created_at")),
        ]:
            owners[name] = [
                _submitter(one, _time(when), f"{path}: {METADATA}: {str(folder)[:80]}")
                for one in entry[":submitters"]
            ]
    present = {name: people for name, people in owners.items() if (file.parent / name).is_dir()}
    return _with_attempts(present)


def _submitter(data: object, time: datetime | None, place: str) -> _Submitter:
    fields = data if isinstance(data, dict) else {}
    # Numbers and text alone: what YAML's aliases can nest would be endless as text.
    values = [fields.get(key) for key in (":sid", ":email", ":name")]
    texts = [str(value).strip() for value in values if isinstance(value, str | int)]
    names = tuple(text for text in texts if text)
    if not names:
        raise AnswerError(f"{place}: a submitter without name, email and sid")
    return _Submitter(names[0], names[1:], time)


def _with_attempts(owners: Mapping[str, Sequence[_Submitter]]) -> dict[str, list[_Submitter]]:
    """Return the submitters with the number of their earlier submissions, by time and then by number."""
    earliest = datetime.min.replace(tzinfo=UTC)

    def order(name: str) -> tuple[datetime, int]:
        digits = re.sub(r"\D", "", name)
        return owners[name][0].time or earliest, int(digits[:18] or 0)

    so_far = Counter[str]()
    numbered: dict[str, list[_Submitter]] = {}
    for name in sorted((name for name in owners if owners[name]), key=order):
        numbered[name] = [replace(one, attempt=so_far[one.student]) for one in owners[name]]
        so_far.update(one.student for one in owners[name])
    return numbered


def _time(value: object) -> datetime | None:
    """Return a time; without a zone it is UTC, as Gradescope writes it."""
    if isinstance(value, str):
        try:
            value = datetime.fromisoformat(value)
        except ValueError:
            return None
    if not isinstance(value, datetime):
        return None
    return value if value.tzinfo is not None else value.replace(tzinfo=UTC)


def _yaml(content: bytes, place: str) -> Any:
    """Return the data of a YAML file; tags of Ruby's classes count as the plain data that they mark."""
    import yaml

    class Loader(yaml.CSafeLoader if yaml.__with_libyaml__ else yaml.SafeLoader):  # type: ignore[misc]
        """Plain data alone: no tag makes an object."""

    def plain_data(loader: Any, suffix: str, node: Any) -> Any:
        if isinstance(node, yaml.MappingNode):
            return loader.construct_mapping(node, deep=True)
        if isinstance(node, yaml.SequenceNode):
            return loader.construct_sequence(node, deep=True)
        return loader.construct_scalar(node)

    Loader.add_multi_constructor("!", plain_data)
    try:
        return yaml.load(content, Loader)  # noqa: S506
    except (yaml.YAMLError, ValueError, RecursionError, TypeError) as error:
        line = " ".join(str(error).split())[:200]
        raise AnswerError(f"{place}: not YAML: {line}") from None


_OWNERS: Mapping[ExportKind, Callable[[Path, Path], _Owner]] = {
    ExportKind.CANVAS: _canvas_owner,
    ExportKind.MOODLE: _moodle_owner,
    ExportKind.GRADESCOPE: _gradescope_owner,
}
"""For each layout, the function from the folder, and its path in messages, to who handed in a file."""
