"""Entry points of grading: files and answers of the Python API, judged against the robot that they concern."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Unpack

from dhkit.description import Description, Robot, library_robot, read_robot, robots
from dhkit.description.robot import description_of, takes_robot
from dhkit.errors import AnswerError, DescriptionError
from dhkit.execution import find_isolation
from dhkit.grading.answers.objects import entries_of
from dhkit.grading.answers.sheet import quantity_names, read_sheet, sheet_of
from dhkit.grading.answers.sheet_values import NO_NAMES, AnswerSheet, Names
from dhkit.grading.answers.sources import (
    SHEET_SUFFIXES,
    executed_source,
    import_readers,
    read_source,
)
from dhkit.grading.bounds import BOUNDS
from dhkit.grading.grade_report import GradeReport
from dhkit.grading.judging.truth import truth_of
from dhkit.grading.mistakes.diagnosis import variants_of
from dhkit.grading.options import GradeKeywords, GradeOptions
from dhkit.grading.rubric import Rubric
from dhkit.grading.sheet_judge import judge_sheet

MAX_PREPARED_JOINTS = 4
"""Largest arm whose mistakes are all derived ahead; for larger arms that takes longer than most sheets need."""
_IDENTITY = [
    ["1", "0", "0", "0"],
    ["0", "1", "0", "0"],
    ["0", "0", "1", "0"],
    ["0", "0", "0", "1"],
]


def grade(
    path: str | Path,
    robot: Robot | None = None,
    rubric: Rubric | None = None,
    *,
    options: GradeOptions | None = None,
    **keywords: Unpack[GradeKeywords],
) -> GradeReport:
    r"""Judge an answer sheet, or the answers that a program or a paper assigns.

    Nothing in it is executed unless ``execute`` is set.

    Work and size are bounded; for limits of time and memory see :func:`dhkit.grading.batch.grade_all`.

    Parameters
    ----------
    path
        File that ends in .toml, .py, .m, .tex or .ipynb.
    robot
        Arm or description that the answers concern; by default the robot that the sheet names.
    rubric
        Its ``digits`` say which decimals may be rounded.
    options, **keywords
        Fields of :class:`GradeOptions`, as one value or one by one: ``task``, ``seed``, ``explain``, ``execute``,
        ``isolation``.

    Returns
    -------
    GradeReport
        The verdict of every entry, with witnesses and mistakes.

    Raises
    ------
    AnswerError
        The sheet cannot be judged; the message names the key, the value found and the value expected.
    DescriptionError
        The robot file describes no robot.

    Examples
    --------
    >>> from pathlib import Path
    >>> answer = ["9.81*((m1/2 + m2)*l1*cos(q1) + m2*l2*cos(q1 + q2)/2)", "9.81*m2*l2*cos(q1 + q2)/2"]
    >>> lines = ["format = 1", 'robot = "planar2r"', "[answer]", f"g = {answer}"]
    >>> size = Path("answer.toml").write_text("\n".join(lines))
    >>> grade("answer.toml").verdict.value
    'correct'
    """
    chosen = GradeOptions.of(options, keywords)
    path = Path(path)
    digits = (rubric or Rubric()).digits
    given = None if robot is None else description_of(robot)
    suffix = path.suffix.lower()
    if suffix not in SHEET_SUFFIXES:
        raise AnswerError(
            f"{path}: not read: {path.suffix or path.name}; expected {', '.join(SHEET_SUFFIXES)}"
        )
    if suffix == ".toml":
        sheet = read_sheet(path)
    else:
        if given is None:
            raise AnswerError(
                f"{path}: a program does not say which robot it is about; give one (--robot)"
            )
        task = chosen.task
        names = NO_NAMES if task is None else task.names
        if chosen.execute and suffix != ".tex":
            _require_permission(path, task)
            found = chosen.isolation
            if found is None:
                found = find_isolation(packages=task.task.packages if task is not None else ())
            with executed_source(path, given, names, isolation=found) as sheet:
                return _judged(sheet, given, digits, chosen)
        sheet = read_source(path, given, names)
    description = given or robot_of(sheet, path.parent)
    return replace(_judged(sheet, description, digits, chosen), own_robot=given is None)


def _judged(
    sheet: AnswerSheet, description: Description, digits: int, options: GradeOptions
) -> GradeReport:
    if (task := options.task) is not None:
        sheet = replace(sheet, task=task.task, names=_merge_names(sheet.names, task.names))
    return judge_sheet(description, sheet, digits, seed=options.seed, explain=options.explain)


def _require_permission(path: Path, task: AnswerSheet | None) -> None:
    """Refuse to execute a program for a task that does not permit it."""
    if task is not None and not task.task.may_execute:
        raise AnswerError(
            f"{path}: the task does not permit executing programs (execute = true in [task])"
        )


def _merge_names(own: Names, given: Names) -> Names:
    """Return a sheet's names, completed by those of the task."""
    parameters = {**given.parameters, **own.parameters}
    return replace(
        own,
        q=own.q or given.q,
        qd=own.qd or given.qd,
        qdd=own.qdd or given.qdd,
        absolute=own.absolute or given.absolute,
        parameters=parameters,
        state=own.state or given.state,
    )


@takes_robot
def grade_answers(
    description: Description,
    answers: Mapping[str, object],
    names: Mapping[str, object] | None = None,
    task: Mapping[str, object] | None = None,
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
        Answers by quantity: M, C, h, g, tau, K, V, L, A1 ... An, T, J, and dh and ik as tables as on a sheet.
    names, task
        Tables as on a sheet: ``{"q": ["th1", "th2"], "angles": "absolute"}``, ``{"friction": True}``.
    rubric
        Its ``digits`` say which decimals may be rounded.
    seed, explain
        As for :func:`grade`.

    Returns
    -------
    GradeReport
        The verdict of every entry, with witnesses and mistakes.

    Raises
    ------
    AnswerError
        Answers that cannot be judged.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> report = grade_answers(library_robot("planar2r"), {"M": [["m1", 0], [0, "m2*l2^2/3"]]})
    >>> report.verdict.value
    'wrong'
    """
    entries: dict[str, object] = {}
    for name, value in answers.items():
        try:
            entries[name] = value if name in ("dh", "ik") else entries_of(value, description.n)
        except AnswerError as error:
            raise AnswerError(f"{name}: {error}") from None
    sheet = sheet_of(
        {"answer": entries, "names": dict(names or {}), "task": dict(task or {})}, "answers"
    )
    report = judge_sheet(
        description, sheet, (rubric or Rubric()).digits, seed=seed, explain=explain
    )
    return replace(report, sheet=None)


def robot_of(sheet: AnswerSheet, folder: str | Path) -> Description:
    r"""Return the robot that a sheet names: one of the library, or a file in the sheet's own folder.

    Parameters
    ----------
    sheet
        Answer sheet.
    folder
        Folder of the sheet, in which a robot file must lie.

    Returns
    -------
    Description
        The robot.

    Raises
    ------
    AnswerError
        No robot, an unknown one, or a path that leaves the folder.
    DescriptionError
        The file describes no robot.

    Examples
    --------
    >>> from pathlib import Path
    >>> from dhkit.grading.answers.sheet import read_sheet
    >>> lines = ["format = 1", 'robot = "planar2r"', "[answer]", 'V = "0"']
    >>> size = Path("answer.toml").write_text("\n".join(lines))
    >>> robot_of(read_sheet(Path("answer.toml")), ".").name
    'planar2r'
    """
    name = sheet.robot
    place = f"{sheet.file}: robot"
    if not name:
        raise AnswerError(
            f"{place}: missing; expected a library name, or a robot file beside the sheet"
        )
    if not name.endswith(".toml"):
        try:
            return library_robot(name)
        except DescriptionError as error:
            raise AnswerError(f"{place}: {error}") from None
    if len(name) > BOUNDS.robot_name_characters or not name.isprintable():
        raise AnswerError(f"{place}: {name[:40]!r} is not a file name")
    inside = Path(folder).resolve()
    try:
        path = (inside / name).resolve()
    except (
        ValueError,
        OSError,
        RuntimeError,
    ):
        # A NUL in the name, a name that is too long, a link to itself.
        raise AnswerError(f"{place}: {name[:60]!r} is not a file name") from None
    if not path.is_relative_to(inside):
        raise AnswerError(f"{place}: {name!r} leaves the sheet's folder; expected a file in it")
    return read_robot(path)


def prepare(
    description: Description | None,
    report: GradeReport | None = None,
    task: AnswerSheet | None = None,
) -> None:
    """Import modules and derive equations that the next sheets need, so that processes forked from this one inherit it.

    Parameters
    ----------
    description
        Robot of all sheets; None if each sheet names its own, of which the library's robots are prepared.
    report
        Report of a judged sheet: the mistakes of its quantities are derived, for arms of up to
        :data:`MAX_PREPARED_JOINTS` joints. Without a report the libraries are imported and the robot's equations
        derived.
    task
        The task of all sheets.
    """
    if report is None:
        judge_sheet(
            description or library_robot("planar2r"), sheet_of({"answer": {"A1": _IDENTITY}})
        )
        import_readers()
        import mpmath  # noqa: F401
        import scipy.optimize  # noqa: F401

        return
    if description is None:
        if report.robot not in robots():
            return
        description = library_robot(report.robot)
    if report.digest == description.digest:
        prepare_mistakes(description, report.quantities, task)


def prepare_mistakes(
    description: Description, quantities: Iterable[str], task: AnswerSheet | None = None
) -> None:
    """Derive all mistakes in some quantities of an arm; arms that differ in numbers of parameters alone share them.

    Parameters
    ----------
    description
        The arm; nothing is derived for one of more than :data:`MAX_PREPARED_JOINTS` joints.
    quantities
        Names of quantities; those without mistakes, such as tables, are passed over.
    task
        The task, which says in which coordinates answers are.
    """
    if description.n > MAX_PREPARED_JOINTS:
        return
    is_absolute = task is not None and task.names.absolute
    friction = task is not None and task.task.friction
    variants = variants_of(truth_of(description, is_absolute, friction), frozenset())
    for quantity in quantities:
        if quantity in quantity_names(description.n):
            variants.prepare(quantity)
