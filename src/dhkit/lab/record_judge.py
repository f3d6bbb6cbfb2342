"""Judge of lab records in a class: the record of a student's work becomes a report with an entry for each goal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dhkit.display import plain, value_line
from dhkit.errors import AnswerError
from dhkit.grading.grade_report import Entry, GradeReport, Verdict
from dhkit.grading.remarks import Note, NoteKind
from dhkit.grading.sheet_judge import package_version
from dhkit.lab.assignment import Assignment, Place
from dhkit.lab.marks import OTHER_ASSIGNMENT, CheckedGoal, checked_goals, last_time
from dhkit.lab.record import Record

MAX_TIME_LENGTH = 40
"""Longest text of a time, characters: a record may have anything there."""
_STATEMENTS = {
    Verdict.CORRECT: "shown by its evidence",
    Verdict.RECORDED: "reached in the lab; it cannot be checked again",
    Verdict.WRONG: "the evidence does not show it",
    Verdict.INCOMPLETE: "not reached",
}
"""Reason of each verdict on a goal."""


@dataclass(frozen=True)
class RecordJudge:
    r"""Function from the file of a lab record to its report, as :class:`~dhkit.grading.class_judge.FileJudge` says.

    Attributes
    ----------
    assignment
        The assignment of all records.

    Examples
    --------
    >>> from pathlib import Path
    >>> from dhkit.lab import Assignment
    >>> from dhkit.lab.record import Record
    >>> lines = ['kind = "assignment"', "format = 1", 'title = "Stretch"', 'robot = "planar2r"', "[[step]]"]
    >>> lines += ['title = "Up"', "[[step.goal]]", 'text = "The arm straight up"', 'joints = ["pi/2", 0]']
    >>> size = Path("stretch.toml").write_text("\n".join(lines))
    >>> judge = RecordJudge(Assignment.read("stretch.toml"))
    >>> Record(judge.assignment.digest, "Ada").write(Path("ada.lab.json"))
    >>> report = judge(Path("ada.lab.json"))
    >>> report.verdict.value, report.missing
    ('incomplete', ('goal1.1',))
    """

    assignment: Assignment

    __repr__ = value_line

    @property
    def goals(self) -> Mapping[str, float]:
        """Points of each goal by the name of its entry: ``goal1.2`` is the second of the first step."""
        steps = self.assignment.steps
        return {
            goal_name(place): steps[place.step].goals[place.goal].points
            for place in self.assignment.places
        }

    @property
    def digest(self) -> str:
        """Digest of the assignment and its robot."""
        return self.assignment.digest

    def __call__(self, path: Path) -> GradeReport:
        """Return the report of a record; one that cannot be read, or was edited, has an error."""
        try:
            record = Record.read(path)
        except AnswerError as error:
            return self._report(error=str(error))
        if record.digest != self.assignment.digest:
            return self._report(error=f"{path}: {OTHER_ASSIGNMENT}")
        checked = checked_goals(record, self.assignment)
        begun = plain(record.begun, MAX_TIME_LENGTH)
        notes = [Note(NoteKind.LAB_WORK, values=(begun, last_time(checked)))]
        if record.student:
            notes.append(Note(NoteKind.SIGNED, values=(record.student,)))
        return self._report(
            entries=tuple(map(_entry, checked)), notes=tuple(notes), student=record.student
        )

    def prepare(self) -> None:
        """Derive the arm's kinematics, before processes are forked for the records."""
        arm = self.assignment.arm
        arm.fk(np.zeros(arm.n))

    def _report(
        self,
        *,
        entries: tuple[Entry, ...] = (),
        notes: tuple[Note, ...] = (),
        student: str = "",
        error: str = "",
    ) -> GradeReport:
        arm = self.assignment.arm
        return GradeReport(
            arm.name,
            arm.description.digest,
            package_version(),
            entries=entries,
            notes=notes,
            student=student,
            error=error,
            goals=self.goals,
        )


def goal_name(place: Place) -> str:
    """Return the name of a goal's entry, counted from 1: goal1.2."""
    return f"goal{place.step + 1}.{place.goal + 1}"


def _entry(checked: CheckedGoal) -> Entry:
    statement = f"{checked.goal.text}: {_STATEMENTS[checked.verdict]}"
    return Entry(goal_name(checked.place), (), checked.verdict, statement=statement)
