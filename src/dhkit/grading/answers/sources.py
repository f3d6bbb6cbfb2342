"""Answers out of .py, .m and .tex files and notebooks: read as text, or executed where a person asks for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from dhkit.description import Description
from dhkit.grading.answers.sheet_values import NO_NAMES, AnswerSheet, Names
from dhkit.grading.answers.source_code import LineName, source_code

if TYPE_CHECKING:
    from dhkit.execution import Isolation

_Reader: TypeAlias = Callable[[str, str, LineName, Description, Names], AnswerSheet]
"""Function from a text, the file's name, the names of lines, the robot and the task's names to the answers."""


def read_source(path: Path, description: Description, names: Names = NO_NAMES) -> AnswerSheet:
    """Return the answers that a file assigns: ``M = ...``, ``M11 = ...``, ``M(1,2) = ...``, and their definitions.

    Parameters
    ----------
    path
        A file that ends in .py, .m, .tex or .ipynb.
    description
        The robot: its parameters and joint variables are never answers.
    names
        The task's names of the joint variables.

    Returns
    -------
    AnswerSheet
        Quantities as text, as :class:`~dhkit.grading.answers.sheet.Entries` where they are given entry by entry, and
        as :class:`~dhkit.grading.answers.sheet.Refusal` where something that they depend on is not understood; with
        notes on how the file was read, and what was left out.

    Raises
    ------
    AnswerError
        A file that cannot be read, one in which a statement may change any name, or one that assigns no quantity.
    """
    code = source_code(path)
    sheet = _LANGUAGES[code.suffix](code.text, str(path), code.line_name, description, names)
    return replace(sheet, notes=(*code.notes, *sheet.notes))


@contextmanager
def executed_source(
    path: Path, description: Description, names: Names = NO_NAMES, *, isolation: Isolation
) -> Iterator[AnswerSheet]:
    """Execute a program in a process of its own, and yield the answers that its names and functions are.

    Parameters
    ----------
    path
        A file that ends in .py, .m or .ipynb.
    description, names
        As for :func:`read_source`; the names may give the order of a state.
    isolation
        Isolation of the program: files and resources that it can use.

    Raises
    ------
    AnswerError
        A file that cannot be read or executed, or gives no answer.
    """
    from dhkit.grading.answers.programs.executed_program import executed_answers

    code = source_code(path)
    with executed_answers(path, code, description, names, isolation=isolation) as sheet:
        yield replace(sheet, notes=(*code.notes, *sheet.notes))


# The readers are imported when they are used: most sheets are TOML, and `dhkit grade` must answer at once.


def import_readers() -> None:
    """Import the readers of all languages, so that processes that are forked for the sheets of a class inherit them."""
    import dhkit.grading.answers.documents.latex_document
    import dhkit.grading.answers.documents.latex_source
    import dhkit.grading.answers.programs.matlab_program
    import dhkit.grading.answers.programs.notebook
    import dhkit.grading.answers.programs.program_answers
    import dhkit.grading.answers.programs.python_program  # noqa: F401


def _python(
    text: str, file: str, line_name: LineName, description: Description, names: Names
) -> AnswerSheet:
    from dhkit.grading.answers.programs.program_answers import answers_of
    from dhkit.grading.answers.programs.python_program import PythonProgram
    from dhkit.grading.answers.programs.robot_names import RobotNames
    from dhkit.grading.answers.programs.scope import Record

    return answers_of(
        PythonProgram(text, file, line_name, Record(RobotNames(description, names), "**")), file
    )


def _matlab(
    text: str, file: str, line_name: LineName, description: Description, names: Names
) -> AnswerSheet:
    from dhkit.grading.answers.programs.matlab_program import MatlabProgram
    from dhkit.grading.answers.programs.program_answers import answers_of
    from dhkit.grading.answers.programs.robot_names import RobotNames
    from dhkit.grading.answers.programs.scope import Record

    return answers_of(
        MatlabProgram(text, file, line_name, Record(RobotNames(description, names), "^")), file
    )


def _latex(
    text: str, file: str, line_name: LineName, description: Description, names: Names
) -> AnswerSheet:
    from dhkit.grading.answers.documents.latex_document import latex_answers

    return latex_answers(text, file, line_name, description, names)


_LANGUAGES: Mapping[str, _Reader] = {".py": _python, ".m": _matlab, ".tex": _latex}
"""Readers by suffix."""
SHEET_SUFFIXES = (".toml", *_LANGUAGES, ".ipynb")
"""Suffixes of answer sheets; a notebook has a program of one of the languages."""
