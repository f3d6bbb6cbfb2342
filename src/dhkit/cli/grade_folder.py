"""A folder with the results of a class: it holds those of the last run, and files of nobody else are touched."""

from __future__ import annotations

import csv
import io
import sys
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

from dhkit.description.files import read_bounded
from dhkit.errors import AnswerError, DescriptionError
from dhkit.grading.bounds import BOUNDS
from dhkit.grading.reports import read_reports
from dhkit.grading.reports.marks_csv import marks_key

PARTS = {"records": ".json", "students": ".html"}
"""Folders of a class's results, and the suffix of the file that each has for every sheet."""
MARKS = "marks.csv"
MAX_LISTED = 10
"""Largest number of names in a message."""


def clear_earlier_results(folder: Path, names: Collection[str]) -> None:
    """Remove the results of sheets that the run before this one judged and this one did not; name them on stderr.

    A result is the run's own if its record, a report of dhkit, stands in the run's table of marks. Other files in the
    folders of results are left, and named.

    Parameters
    ----------
    folder
        The folder of the results; it need not exist.
    names
        Names of this run's files, without suffix.
    """
    earlier = _earlier_names(folder)
    for name in earlier:
        for part, suffix in PARTS.items():
            (folder / part / f"{name}{suffix}").unlink(missing_ok=True)

    stale = [name for name in earlier if name not in names]
    if stale:
        sys.stderr.write(
            f"dhkit: {folder}: removed the results of an earlier run: {_listed(stale)}\n"
        )
    if others := list(_other_files(folder, names)):
        sys.stderr.write(f"dhkit: {folder}: not results of this run, left: {_listed(others)}\n")


def _earlier_names(folder: Path) -> list[str]:
    """Return the names, without suffix, of the records that the folder's table of marks lists."""
    try:
        table = read_bounded(folder / MARKS, BOUNDS.report_file_bytes, "marks").decode()
        rows = list(csv.DictReader(io.StringIO(table)))
    except (DescriptionError, UnicodeDecodeError, csv.Error):
        return []
    listed = {(row.get("student"), row.get("sheet")) for row in rows}
    names = []
    for path in sorted((folder / "records").glob("*.json")):
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
