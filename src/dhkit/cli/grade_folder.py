"""A folder with the results of a class: it holds those of the last run, and files of nobody else are touched."""

from __future__ import annotations

import csv
import io
import json as jsons
import re
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path

from dhkit.description import write_atomically
from dhkit.description.files import read_bounded
from dhkit.errors import AnswerError, DescriptionError
from dhkit.grading.bounds import BOUNDS
from dhkit.grading.grade_report import GradeReport
from dhkit.grading.reports import read_reports, report_of
from dhkit.grading.reports.marks_csv import marks_key

PARTS = {"records": ".json", "students": ".html"}
"""Folders of a class's results, and the suffix of the file that each has for every sheet."""
MARKS = "marks.csv"
MAX_LISTED = 10
"""Largest number of names in a message."""
KEY = "judgement_key"
"""Field of a record: digest of all that the report depends on."""
UNSAFE = re.compile(r"[^\w.-]+")
"""Characters that file names made from students' names do not have."""
MAX_NAME_BYTES = 80


class Records:
    """Reports that are written into a class's folder as soon as they are made, so that a stopped run can go on.

    Parameters
    ----------
    folder
        The folder of the results.
    names
        Name of each sheet's record, without suffix, by its student and file as reports name them.
    keys
        Key of each sheet's judgement, likewise; empty if its report may not be used again.
    """

    def __init__(
        self,
        folder: Path,
        names: Mapping[tuple[str, str], str],
        keys: Mapping[tuple[str, str], str],
    ) -> None:
        self._folder = folder / "records"
        self._names = names
        self._keys = keys

    def earlier(self) -> dict[tuple[str, str], GradeReport]:
        """Return the reports of earlier runs that would be made again, by student and file."""
        wanted = {key: sheet for sheet, key in self._keys.items() if key}
        found = {}
        for path in sorted(self._folder.glob("*.json")):
            record = _read_record(path)
            if record is None or record[0] not in wanted:
                continue
            key, report = record
            if not report.error:
                found[wanted[key]] = report
        return found

    def write(self, report: GradeReport) -> None:
        """Write a report, unless it is an error, which another run need not find again."""
        sheet = origin_of(report)
        if not report.error and self._keys.get(sheet):
            path = self._folder / f"{self._names[sheet]}.json"
            write_atomically(path, jsons.dumps(self.marked(report, report.data())) + "\n")

    def marked(self, report: GradeReport, data: Mapping[str, object]) -> dict[str, object]:
        """Return the data of a record with the key of its judgement."""
        key = self._keys.get(origin_of(report), "")
        return {**data, KEY: key} if key and not report.error else dict(data)


def origin_of(report: GradeReport) -> tuple[str, str]:
    """Return the student and the file of a report, which tell it from the others of a class."""
    return report.student, report.sheet or ""


def file_names(students: Sequence[str]) -> list[str]:
    """Return names of files, made from the students' names, that differ also where case does not count."""
    names: dict[str, str] = {}
    for student in students:
        plain = (
            UNSAFE.sub("_", student).encode()[:MAX_NAME_BYTES].decode(errors="ignore").lstrip(".")
            or "sheet"
        )
        name = plain
        number = 1
        while name.casefold() in names:
            number += 1
            name = f"{plain}-{number}"
        names[name.casefold()] = name
    return list(names.values())


def _read_record(path: Path) -> tuple[str, GradeReport] | None:
    """Return the key and the report of a record; None if it is not a record with a key."""
    try:
        text = read_bounded(path, BOUNDS.report_bytes, "a record")
        key = jsons.loads(text).get(KEY)
        return (key, report_of(text)) if isinstance(key, str) else None
    except (DescriptionError, ValueError, AttributeError, RecursionError):
        return None


def clear_earlier_results(folder: Path, names: Collection[str]) -> None:
    """Remove the results of sheets that the run before this one judged and this one did not; name them on stderr.

    A result is a run's own if its record, a report of dhkit, stands in the run's table of marks, or has the key that a
    run writes. Other files in the folders of results are left, and named.

    Parameters
    ----------
    folder
        The folder of the results; it need not exist.
    names
        Names of this run's files, without suffix.
    """
    earlier = _earlier_names(folder)
    stale = [name for name in earlier if name not in names]
    for name in stale:
        for part, suffix in PARTS.items():
            (folder / part / f"{name}{suffix}").unlink(missing_ok=True)
    if stale:
        sys.stderr.write(
            f"dhkit: {folder}: removed the results of an earlier run: {_listed(stale)}\n"
        )
    if others := list(_other_files(folder, names)):
        sys.stderr.write(f"dhkit: {folder}: not results of this run, left: {_listed(others)}\n")


def _earlier_names(folder: Path) -> list[str]:
    """Return the names, without suffix, of the records that the folder's table of marks lists, or that have a key."""
    try:
        table = read_bounded(folder / MARKS, BOUNDS.report_file_bytes, "marks").decode()
        rows = list(csv.DictReader(io.StringIO(table)))
    except (DescriptionError, UnicodeDecodeError, csv.Error):
        rows = []
    listed = {(row.get("student"), row.get("sheet")) for row in rows}
    names = []
    for path in sorted((folder / "records").glob("*.json")):
        if _read_record(path) is not None:
            names.append(path.stem)
            continue
        try:
            reports = list(read_reports(path))
        except AnswerError:
            continue
        if len(reports) == 1 and marks_key(reports[0]) in listed:
            names.append(path.stem)
    return names


def _other_files(folder: Path, names: Collection[str]) -> Iterator[str]:
    """Yield the files among the results that are not of this run."""
    for part, suffix in PARTS.items():
        for path in sorted((folder / part).glob("*")):
            is_own = path.suffix == suffix and path.stem in names
            if not is_own and not path.name.startswith("."):
                yield f"{part}/{path.name}"


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - MAX_LISTED} more" if len(names) > MAX_LISTED else ""
    return ", ".join(names[:MAX_LISTED]) + more
