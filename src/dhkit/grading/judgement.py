"""Grading: an answer sheet, a source file, or answers of the Python API, against the robot that they are about."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from dhkit.description import Description, library_robot, read_robot, robots
from dhkit.description.robot import Robot, description_of, takes_robot
from dhkit.errors import AnswerError, DescriptionError
from dhkit.grading.answers.objects import entries_of
from dhkit.grading.answers.sheet import AnswerSheet, Names, quantity_names, read_sheet, sheet_of
from dhkit.grading.answers.sources import LANGUAGES, read_source
from dhkit.grading.judge import judge
from dhkit.grading.judging.truth import truth_of
from dhkit.grading.mistakes.diagnosis import variants_of
from dhkit.grading.report import GradeReport
from dhkit.grading.rubric import Rubric

MOST_JOINTS = 4
"""Of robots whose mistakes are all derived ahead: those of larger ones take longer than most sheets need."""
LONGEST_NAME = 200
ONE = [["1" if i == j else "0" for j in range(4)] for i in range(4)]


def grade(
    path: str | Path,
    robot: Robot = None,
    rubric: Rubric | None = None,
    *,
    task: AnswerSheet | None = None,
    seed: int | None = None,
    explain: bool = True,
) -> GradeReport:
    """Judge an answer sheet, or what a program or a paper assigns; nothing in it is executed.

    Work and size are bounded; for limits of time and memory see :func:`dhkit.grading.batch.grade_all`.

    Parameters
    ----------
    path
        A file that ends in .toml, .py, .m, .tex or .ipynb.
    robot
        What it is about, an arm or its description; the sheet says so unless given.
    rubric
        What counts as rounding.
    task
        What was asked for, from :func:`dhkit.grading.answers.sheet.read_task`: it goes before the sheet's own [task],
        and its [names] count where the sheet has none.
    seed
        Of the random states that answers outside the exact ring are tried at; from the system's entropy unless given.
    explain
        Whether mistakes are looked for; verdicts do not depend on it.

    Raises
    ------
    AnswerError
        A sheet that cannot be judged: says which key, what was found and what expected.
    DescriptionError
        Its robot file describes no robot.
    """
    path, digits = Path(path), (rubric or Rubric()).digits
    given = None if robot is None else description_of(robot)
    if path.suffix.lower() == ".ipynb" or path.suffix.lower() in LANGUAGES:
        if given is None:
            raise AnswerError(f"{path}: a program does not say which robot it is about; give one (--robot)")
        sheet = read_source(path, given)
    elif path.suffix.lower() == ".toml":
        sheet = read_sheet(path)
    else:
        raise AnswerError(f"{path}: not read: {path.suffix or path.name}; expected .toml, .py, .m, .tex or .ipynb")
    about = given or robot_of(sheet, path.parent)
    if task is not None:
        sheet = replace(sheet, task=task.task, names=_names(sheet.names, task.names))
    report = judge(about, sheet, digits, seed=seed, explained=explain)
    return replace(report, own_robot=given is None)


def _names(own: Names, given: Names) -> Names:
    """Return a sheet's names, those of the task where it has none of its own."""
    parameters = {**given.parameters, **own.parameters}
    q, qd, qdd = own.q or given.q, own.qd or given.qd, own.qdd or given.qdd
    return replace(own, q=q, qd=qd, qdd=qdd, absolute=own.absolute or given.absolute, parameters=parameters)


@takes_robot
def grade_answers(
    description: Description,
    answers: Mapping[str, Any],
    names: Mapping[str, Any] | None = None,
    task: Mapping[str, Any] | None = None,
    rubric: Rubric | None = None,
    *,
    seed: int | None = None,
    explain: bool = True,
) -> GradeReport:
    """Judge answers that are text, numbers, sympy or CasADi expressions, or functions.

    Parameters
    ----------
    description
        The robot.
    answers
        By quantity: M, C, h, g, tau, K, V, L, A1 ... An, T, J, and dh and ik as tables as on a sheet.
    names, task
        As on a sheet: ``{"q": ["th1", "th2"], "angles": "absolute"}``, ``{"friction": True}``.
    rubric
        What counts as rounding.
    seed, explain
        As in :func:`grade`.

    Raises
    ------
    AnswerError
        Answers that cannot be judged.
    """
    listed: dict[str, Any] = {}
    for name, value in answers.items():
        try:
            listed[name] = value if name in ("dh", "ik") else entries_of(value, description.n)
        except AnswerError as error:
            raise AnswerError(f"{name}: {error}") from None
    sheet = sheet_of({"answer": listed, "names": dict(names or {}), "task": dict(task or {})}, "answers")
    report = judge(description, sheet, (rubric or Rubric()).digits, seed=seed, explained=explain)
    return replace(report, sheet=None)


def robot_of(sheet: AnswerSheet, folder: str | Path) -> Description:
    """Return the robot that a sheet names: of the library, or a file in the sheet's own folder.

    Raises
    ------
    AnswerError
        No robot, an unknown one, or a path that leaves the folder.
    DescriptionError
        A file that describes no robot.
    """
    folder = Path(folder)
    name = sheet.robot
    if not name:
        raise AnswerError(
            f"{sheet.file}: robot: found nothing; expected a library name, or a robot file beside the sheet"
        )
    if not name.endswith(".toml"):
        try:
            return library_robot(name)
        except DescriptionError as error:
            raise AnswerError(f"{sheet.file}: robot: {error}") from None
    if len(name) > LONGEST_NAME or not name.isprintable():
        raise AnswerError(f"{sheet.file}: robot: {name[:40]!r} is no file name")
    inside = folder.resolve()
    try:
        path = (inside / name).resolve()
    except (ValueError, OSError, RuntimeError):  # a NUL in the name, one too long, a link to itself
        raise AnswerError(f"{sheet.file}: robot: {name[:60]!r} is no file name") from None
    if not path.is_relative_to(inside):
        raise AnswerError(f"{sheet.file}: robot: {name!r} leaves the sheet's folder; expected a file in it")
    return read_robot(path)


def prepare(description: Description | None, report: GradeReport | None = None) -> None:
    """Make what the next sheets need, those that processes forked from this one will inherit.

    Parameters
    ----------
    description
        The robot that all sheets are about; None where each says itself, of which robots of the library are prepared.
    report
        Of a sheet that was judged: what its quantities need is made, for arms of up to four joints. Without one the
        libraries are imported, and the robot's truth is derived.
    """
    if report is None:
        judge(description or library_robot("planar2r"), sheet_of({"answer": {"A1": ONE}}))
        import mpmath  # noqa: F401
        import scipy.optimize  # noqa: F401

        return
    if description is None:
        if report.robot not in robots():
            return
        description = library_robot(report.robot)
    if description.n > MOST_JOINTS or report.digest != description.digest:
        return
    for quantity in report.quantities:
        if quantity in quantity_names(description.n):
            variants_of(truth_of(description)).prepare(quantity)
