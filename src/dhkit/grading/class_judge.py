"""Judge of a class: one task and rubric for all, and one robot, or one for each student; lab records too."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePath
from typing import Protocol

from dhkit.description import Description
from dhkit.grading.batch import seed_of_sheet
from dhkit.grading.entry_points import grade, prepare, prepare_mistakes
from dhkit.grading.grade_report import GradeReport
from dhkit.grading.options import GradeOptions
from dhkit.grading.rubric import Rubric
from dhkit.grading.sheets import split_name
from dhkit.grading.variants import VariantKey


class FileJudge(Protocol):
    """Judge of files that are not answer sheets, such as the records of a lab: a value, as that of the class is."""

    @property
    def goals(self) -> Mapping[str, float]:
        """Points of the entries of its reports, by name."""

    @property
    def digest(self) -> str:
        """Digest of all that its reports depend on besides the file."""

    def __call__(self, path: Path) -> GradeReport:
        """Return the report of a file; one that cannot be judged has an error, and the goals all the same."""

    def prepare(self) -> None:
        """Derive and import what the files need, before processes are forked for them."""


@dataclass(frozen=True)
class ClassJudge:
    r"""Function from the file of a sheet to its report. It holds values alone, so that it can be sent to a worker.

    Attributes
    ----------
    rubric
        The rubric of all sheets.
    options
        Options of judging.
    robot
        Robot of all sheets; None if each sheet names its own, or a key has each student's.
    has_own_seeds
        Whether the seed of each sheet follows from that of the options and the sheet's content, so that it does not
        depend on the order in which sheets are judged.
    key
        Key of the task's variants.
    students
        With a key, the student of each file.
    others
        Judges of files that are not answer sheets, by their suffix.

    Examples
    --------
    >>> from pathlib import Path
    >>> from dhkit.description import library_robot
    >>> size = Path("answer.py").write_text("g1 = 9.81*((m1/2 + m2)*l1*cos(q1) + m2*l2*cos(q1 + q2)/2)")
    >>> judge = ClassJudge(robot=library_robot("planar2r"))
    >>> judge(Path("answer.py")).entries[0].verdict.value
    'correct'
    """

    rubric: Rubric = field(default_factory=Rubric)
    options: GradeOptions = field(default_factory=GradeOptions)
    robot: Description | None = None
    has_own_seeds: bool = False
    key: VariantKey | None = None
    students: Mapping[Path, str] = field(default_factory=dict)
    others: Mapping[str, FileJudge] = field(default_factory=dict)

    def __call__(self, path: Path) -> GradeReport:
        """Return the report of a sheet.

        Raises
        ------
        AnswerError, DescriptionError
            The sheet cannot be judged, or the key has no variant for its student.
        """
        if (other := self.other_for(path)) is not None:
            return other(path)
        options = self.options
        if options.seed is not None and self.has_own_seeds:
            options = replace(options, seed=seed_of_sheet(options.seed, path))
        return grade(path, self.robot_of(path), self.rubric, options=options)

    def other_for(self, path: PurePath) -> FileJudge | None:
        """Return the judge of a file that is not an answer sheet; None for a sheet."""
        return self.others.get(split_name(path.name, self.others)[1])

    def completed(self, report: GradeReport) -> GradeReport:
        """Return a report with the goals of its file, which one that was made without the file's judge lacks.

        Such a report is of a file that could not be judged: it took too long, or is a link out of the folder.
        """
        other = self.other_for(PurePath(report.sheet or ""))
        return report if other is None or report.goals else replace(report, goals=other.goals)

    def robot_of(self, path: Path) -> Description | None:
        """Return the robot by which a sheet is judged; None if the sheet names its own.

        Raises
        ------
        AnswerError
            The key has no variant for the sheet's student, or its robot file was changed.
        """
        return self.robot if self.key is None else self.key.robot_of(self.students[path])

    def for_sheet(self, path: Path) -> ClassJudge:
        """Return the judge of a single file, without the key of the others, and without the judges of other files.

        Raises
        ------
        AnswerError
            As :meth:`robot_of`.
        """
        if self.other_for(path) is not None:
            return replace(self, key=None, students={})
        return replace(self, robot=self.robot_of(path), key=None, students={}, others={})

    def prepare(self, report: GradeReport | None = None) -> None:
        """Derive and import what the next sheets need, before processes are forked for them.

        Parameters
        ----------
        report
            Report of a judged sheet; None at the beginning.
        """
        if report is None:
            for other in self.others.values():
                other.prepare()
        if self.key is None or report is None:
            prepare(self.robot, report, self.options.task)
            return
        for arm in self.key.examples:
            if arm.name == report.robot:
                prepare_mistakes(arm, report.quantities, self.options.task)
