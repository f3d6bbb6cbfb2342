"""Checks in notebooks: what a student's cells have computed is judged, quantity by quantity."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dhkit.description.toml_text import plain_numbers, toml_document
from dhkit.errors import AnswerError
from dhkit.grading.entry_points import grade_answers
from dhkit.grading.grade_report import GradeReport
from dhkit.grading.marks import marks
from dhkit.grading.reports import with_feedback
from dhkit.platforms.contents import Task

_OF_FILES = ("asked", "execute", "packages")
"""Keys of ``[task]`` that concern whole files, and not a single quantity."""


@dataclass(frozen=True)
class Check:
    """The judgement of a quantity in a notebook."""

    report: GradeReport
    """With the feedback that the task's rubric allows."""
    points: float
    most: float
    """Points given, and points possible."""

    def passes(self, entry: str) -> bool:
        """Return whether an entry such as ``"M12"`` is right."""
        return any(one.name == entry and one.verdict.passes for one in self.report.entries)

    def __repr__(self) -> str:
        return f"{self.points:g} of {self.most:g} points\n{self.report}"


def check(task: str | Path, quantity: str, value: object) -> Check:
    r"""Judge a quantity that a notebook has computed.

    Parameters
    ----------
    task
        The task's file.
    quantity
        Name of the quantity: ``"M"``, ``"g"``, ``"T"``.
    value
        What was computed: lists of text or numbers, a sympy or CasADi matrix, a function.

    Returns
    -------
    Check
        Verdicts of the entries, and points; an answer that cannot be judged gets none, and the reason.

    Raises
    ------
    AnswerError
        The file is no task.

    Examples
    --------
    >>> from pathlib import Path
    >>> size = Path("task.toml").write_text('robot = "planar2r"\n[task]\nasked = ["V"]\n[rubric]\npoints = 4')
    >>> check("task.toml", "V", "9.81*(l1*(m1/2 + m2)*sin(q1) + l2*m2*sin(q1 + q2)/2)").points
    4.0
    """
    read = Task.read(Path(task))
    document = plain_numbers(toml_document(read.files["task.toml"].decode()))
    requirements = {
        key: value for key, value in document.get("task", {}).items() if key not in _OF_FILES
    }
    try:
        if callable(value) and read.sheet.task.in_letters:
            raise AnswerError(
                f"{quantity}: found a function; the task asks for formulas in letters"
            )
        report = grade_answers(
            read.description, {quantity: value}, document.get("names"), requirements, read.rubric
        )
    except AnswerError as error:
        report = GradeReport(error=" ".join(str(error).split()))
    most = read.points_of(quantity)
    given = {mark.name: mark for mark in marks(report, read.rubric).quantities}.get(quantity)
    share = given.points / given.most if given is not None and given.most else 0.0
    return Check(with_feedback(report, read.rubric.feedback), share * most, most)
