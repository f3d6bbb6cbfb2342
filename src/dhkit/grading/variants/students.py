"""Lists of students: one id a line, or a table of a course system; ids that are safe as names of folders."""

from __future__ import annotations

import csv
import io
import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from dhkit.cached_property import cached_property
from dhkit.description.files import read_bounded
from dhkit.errors import AnswerError
from dhkit.grading.bounds import BOUNDS

COLUMNS = ("SIS Login ID", "Username", "student", "Email", "Email address", "ID number")
"""Headings of the column of ids in tables of course systems; the first that a table has counts, in any case."""
_PUNCTUATION = frozenset(" ._-@+'")
"""Characters that names and addresses have beside letters and digits. A slash or a colon could not stand in the name of
a folder, and a comma separates columns."""
_RESERVED = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)
"""Names of devices, which cannot be folders on Windows."""
_MOST_ID_BYTES = 80
_CANVAS_POINTS = "points possible"
"""First cell of Canvas's second row, which is not a student."""


@dataclass(frozen=True)
class Students:
    """Students of a list.

    Attributes
    ----------
    ids
        Their ids, in the order of the file.
    column
        Heading of the column that was read; empty for a list without columns.
    rows
        All cells of each student's row: other names, numbers and addresses.
    """

    ids: tuple[str, ...]
    column: str = ""
    rows: tuple[tuple[str, ...], ...] = ()

    def find(self, names: Iterable[str]) -> str:
        """Return the student in whose row one of some names stands; empty if there is none, or more than one.

        Case, punctuation and the word ``Participant`` of Moodle do not count: a row with ``Lovelace, Ada`` is found by
        Canvas's ``lovelaceada``.

        Parameters
        ----------
        names
            Names by which an export tells a student, of which the first that is in one row counts.

        Returns
        -------
        str
            The student's id.
        """
        for name in names:
            found = self._by_cell.get(_letters(name), set())
            if len(found) == 1:
                return next(iter(found))
        return ""

    @cached_property
    def _by_cell(self) -> dict[str, set[str]]:
        found: dict[str, set[str]] = {}
        for student, row in zip(self.ids, self.rows, strict=True):
            for cell in row:
                if _letters(cell):
                    found.setdefault(_letters(cell), set()).add(student)
        return found


def _letters(text: str) -> str:
    """Return a name's letters and digits alone, in one case."""
    text = unicodedata.normalize("NFC", text).casefold().strip().removeprefix("participant ")
    return "".join(character for character in text if _is_letter(character))


def is_name_of(typed: str, names: Iterable[str]) -> bool:
    """Return whether a name that a person typed agrees with one of those by which the person is known.

    Two names agree if all words of one are in the other, in any order and case: ``Ada Lovelace`` and ``lovelaceada``,
    ``Ada`` and ``Lovelace, Ada``. Names without a letter, such as numbers, are not compared.

    Parameters
    ----------
    typed
        The name that was typed.
    names
        Names by which the person is known.

    Returns
    -------
    bool
        Whether one agrees, or there is none to compare.

    Examples
    --------
    >>> is_name_of("Ada Lovelace", ["101", "lovelaceada"]), is_name_of("Bob", ["ada"]), is_name_of("Bob", ["101"])
    (True, False, True)
    """
    known = [name for name in names if any(map(str.isalpha, name))]
    return not known or any(_has_words(name, typed) or _has_words(typed, name) for name in known)


def _has_words(name: str, other: str) -> bool:
    """Return whether all words of one name, numbers left out, are in another one."""
    words = [_letters(word) for word in re.split(r"[\W\d_]+", name)]
    words = [word for word in words if word]
    return bool(words) and all(word in _letters(other) for word in words)


def student_id(text: str) -> str:
    """Return a student's id in Unicode's composed form, or refuse one that could not be a folder's name.

    Raises
    ------
    AnswerError
        Says what an id may have.
    """
    name = unicodedata.normalize("NFC", text.strip())
    if (
        not all(character in _PUNCTUATION or _is_letter(character) for character in name)
        or not name[:1].isalnum()
        or name.endswith(".")
        or len(name.encode()) > _MOST_ID_BYTES
        or _RESERVED.fullmatch(name)
    ):
        raise AnswerError(
            f"student {_short(text)}: not an id; expected letters, digits, spaces and . _ - + @ ', "
            f"at most {_MOST_ID_BYTES} bytes, which can name a folder"
        )
    return name


def _is_letter(character: str) -> bool:
    """Return whether a character is a letter, a mark on one, or a digit, of any script."""
    return unicodedata.category(character)[0] in "LMN"


def read_students(path: Path) -> Students:
    """Read a list of students: text with an id a line, or a .csv file with headings.

    Of a table the first column of :data:`COLUMNS` counts, without one the first column. A .csv file with one column and
    without such a heading is a list.

    Parameters
    ----------
    path
        The list.

    Raises
    ------
    AnswerError
        The file cannot be read, has no student, one twice, or an id that cannot name a folder; names the line.
    """
    content = read_bounded(path, BOUNDS.students_bytes, "a list of students", AnswerError)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise AnswerError(f"{path}: not UTF-8 at byte {error.start}") from None
    rows = _rows(path, text)
    column = _column(rows[0][1]) if rows else None
    heading = ""
    if column is not None:
        heading = rows[0][1][column].strip()
        rows = rows[1:]

    found: dict[str, str] = {}
    kept: list[tuple[str, ...]] = []
    for line, row in rows:
        if row[0].strip().casefold() == _CANVAS_POINTS:
            continue
        place = f"{path}, line {line}"
        cell = row[column or 0] if len(row) > (column or 0) else ""
        if not cell.strip():
            raise AnswerError(f"{place}: no id in the column {heading!r}; expected one")
        try:
            student = student_id(cell)
        except AnswerError as error:
            raise AnswerError(f"{place}: {error}") from None
        # Folders of some systems do not distinguish case.
        if (other := found.get(student.casefold())) is not None:
            twice = "twice" if other == student else f"is also there as {other}"
            raise AnswerError(f"{place}: student {student} {twice}; expected each once")
        found[student.casefold()] = student
        kept.append(tuple(row))
        if len(found) > BOUNDS.sheets:
            raise AnswerError(f"{path}: more than {BOUNDS.sheets} students")
    if not found:
        raise AnswerError(f"{path}: no student; expected an id a line, or a table with headings")
    return Students(tuple(found.values()), heading, tuple(kept))


def _rows(path: Path, text: str) -> list[tuple[int, list[str]]]:
    """Return the lines that are not blank, each with its number from 1, taken apart if the file is a table."""
    if path.suffix.lower() != ".csv":
        lines = enumerate(text.splitlines(), start=1)
        return [(number, [line]) for number, line in lines if line.strip()]
    first = text.partition("\n")[0]
    separator = max(",;\t", key=first.count)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator)
    try:
        return [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise AnswerError(f"{path}, line {reader.line_num}: {error}") from None


def _column(first: list[str]) -> int | None:
    """Return the column of ids by the first row, from 0; None if the file is a list without headings."""
    headings = [cell.strip().casefold() for cell in first]
    for known in COLUMNS:
        if known.casefold() in headings:
            return headings.index(known.casefold())
    return 0 if len(first) > 1 else None


def _short(text: str) -> str:
    """Return a text in quotes, shortened, with escapes for what is not printable."""
    shown = repr(text)
    return shown if len(shown) <= 60 else f"{shown[:57]}..."
