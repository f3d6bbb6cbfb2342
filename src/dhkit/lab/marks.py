"""Marks of records of work on an assignment: their goals are checked again from the evidence."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from dhkit.display import plain, value_line
from dhkit.errors import AnswerError, DhkitError
from dhkit.grading.grade_report import Verdict
from dhkit.grading.reports.marks_csv import cell
from dhkit.lab.assignment import Assignment, Goal, Place
from dhkit.lab.record import SUFFIX, Reached, Record, is_confirmed

MAX_CELL = 1_000
"""Longest text of a cell, characters."""
OTHER_ASSIGNMENT = "the record is about another assignment, or another version of this one"
"""Note on a record without points."""


@dataclass(frozen=True)
class LabMark:
    """Marks of one record.

    Attributes
    ----------
    file
        The record.
    student
        Name as typed; empty without one.
    points, most
        Points of the goals that count, and of all goals.
    goals
        Points of each goal, in the assignment's order.
    begun
        When the lab was opened for the first time: ISO 8601, UTC.
    last
        When the last goal was reached: ISO 8601, UTC; empty if none was.
    unchecked
        Goals that count on the record's word: programs' scores, judged answers and controlled runs.
    notes
        What is wrong with the record, a sentence each.
    """

    file: Path
    student: str
    points: float
    most: float
    goals: tuple[float, ...] = ()
    last: str = ""
    begun: str = ""
    unchecked: int = 0
    notes: tuple[str, ...] = ()

    __repr__ = value_line


@dataclass(frozen=True)
class CheckedGoal:
    """A goal of an assignment, checked again from the evidence of a record.

    Attributes
    ----------
    place, goal
        The goal, and its place in the assignment.
    verdict
        Correct if the evidence shows it, wrong if it does not; taken from the record if that cannot be checked again;
        incomplete if it was not reached.
    time
        When the goal was reached, as the record says it; empty if it was not.
    """

    place: Place
    goal: Goal
    verdict: Verdict
    time: str = ""

    __repr__ = value_line


def find_records(paths: Sequence[Path]) -> list[Path]:
    """Return the records among files and folders, each once, by name within a folder.

    Raises
    ------
    AnswerError
        There is no such file, or no record at all.
    """
    found: dict[Path, None] = {}
    for path in paths:
        if not path.exists():
            raise AnswerError(f"{path}: no such file")
        if path.is_dir():
            # A link in a student's folder may lead to another student's record.
            inside = [file for file in sorted(path.rglob(f"*{SUFFIX}")) if not file.is_symlink()]
        else:
            inside = [path]
        found |= dict.fromkeys(inside)
    if not found:
        raise AnswerError(
            f"{', '.join(map(str, paths))}: no record of a lab; expected files *{SUFFIX}"
        )
    return list(found)


def lab_mark(path: Path, assignment: Assignment) -> LabMark:
    """Return the marks of a record; one that cannot be read or was edited has none, and a note why."""
    try:
        record = Record.read(path)
    except AnswerError as error:
        return LabMark(
            path, "", 0.0, assignment.points, notes=(str(error).removeprefix(f"{path}: "),)
        )
    if record.digest != assignment.digest:
        return LabMark(path, record.student, 0.0, assignment.points, notes=(OTHER_ASSIGNMENT,))
    checked = checked_goals(record, assignment)
    points = tuple(one.goal.points if one.verdict.passes else 0.0 for one in checked)
    refuted = [one.place for one in checked if one.verdict is Verdict.WRONG]
    return LabMark(
        path,
        record.student,
        sum(points),
        assignment.points,
        points,
        last_time(checked),
        record.begun,
        sum(one.verdict is Verdict.RECORDED for one in checked),
        tuple(
            f"step {place.step + 1}, goal {place.goal + 1}: the evidence does not show it"
            for place in refuted
        ),
    )


def checked_goals(record: Record, assignment: Assignment) -> list[CheckedGoal]:
    """Return all goals of an assignment, in its order, checked from the evidence of a record."""
    checked = []
    for place in assignment.places:
        goal = assignment.steps[place.step].goals[place.goal]
        reached = record.reached.get(place)
        if reached is None:
            checked.append(CheckedGoal(place, goal, Verdict.INCOMPLETE))
        else:
            verdict = _VERDICTS[_confirmed(assignment, goal, reached)]
            checked.append(CheckedGoal(place, goal, verdict, reached.time))
    return checked


def last_time(checked: Sequence[CheckedGoal]) -> str:
    """Return when the last goal that counts was reached: ISO 8601, UTC; empty if none was."""
    times = [one.time for one in checked if one.verdict.passes and _is_time(one.time)]
    return max(times, default="")


def lab_marks(paths: Sequence[Path], assignment: Assignment) -> list[LabMark]:
    """Return the marks of records; of those with the same beginning and times, a note names the other."""
    marks = [lab_mark(path, assignment) for path in paths]
    first: dict[tuple[str, str], Path] = {}
    noted = []
    for mark in marks:
        key = (mark.begun, mark.last)
        other = first.setdefault(key, mark.file) if mark.points and mark.begun else mark.file
        note = () if other is mark.file else (f"begun and ended at the same seconds as {other}",)
        noted.append(replace(mark, notes=(*mark.notes, *note)))
    return noted


def _is_time(text: str) -> bool:
    try:
        datetime.fromisoformat(text)
    except ValueError:
        return False
    return True


_VERDICTS = {True: Verdict.CORRECT, False: Verdict.WRONG, None: Verdict.RECORDED}
"""Verdict on a goal that was reached, by what :func:`_confirmed` says."""


def _confirmed(assignment: Assignment, goal: Goal, reached: Reached) -> bool | None:
    """Return whether the evidence shows a goal; None where it cannot be checked again."""
    try:
        return is_confirmed(assignment, goal.condition, reached.evidence)
    except (ValueError, KeyError, TypeError, IndexError, OverflowError, DhkitError):
        return False


def lab_marks_csv(marks: Sequence[LabMark], assignment: Assignment) -> str:
    """Return marks as CSV text: a row for each record, a column for each goal."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    goals = [f"{place.step + 1}.{place.goal + 1}" for place in assignment.places]
    writer.writerow(
        ["student", "points", "of", *goals, "last goal", "not checked again", "notes", "file"]
    )
    for mark in marks:
        each = [f"{x:g}" for x in mark.goals] or [""] * len(goals)
        row = [
            mark.student,
            f"{mark.points:g}",
            f"{mark.most:g}",
            *each,
            mark.last,
            str(mark.unchecked),
        ]
        writer.writerow(
            [cell(plain(text, MAX_CELL)) for text in (*row, "; ".join(mark.notes), str(mark.file))]
        )
    return file.getvalue()
