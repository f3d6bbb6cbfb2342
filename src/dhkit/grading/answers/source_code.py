"""The text of programs, papers and notebooks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from dhkit.errors import AnswerError
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.sheet import read_text

LineName: TypeAlias = Callable[[int], str]
"""Function from a line, from 1, to its name in messages."""


@dataclass(frozen=True)
class SourceCode:
    """The text of a program or a paper.

    Attributes
    ----------
    text
        The text; of a notebook its cells of code.
    suffix
        ``.py``, ``.m`` or ``.tex``.
    line_name
        How messages name a line, which counts from 1.
    notes
        Notes for the reader.
    """

    text: str
    suffix: str
    line_name: LineName
    notes: tuple[str, ...] = ()


def source_code(path: Path) -> SourceCode:
    """Return the text of a program, a paper or a notebook.

    Raises
    ------
    AnswerError
        A file that cannot be read, is not a notebook, or is too long.
    """
    code = SourceCode(
        read_text(path, "a program or a paper"), path.suffix.lower(), "line {}".format
    )
    if code.suffix == ".ipynb":
        from dhkit.grading.answers.programs.notebook import notebook_code

        notebook = notebook_code(code.text, str(path))
        code = SourceCode(notebook.code, notebook.suffix, notebook.line_name, notebook.notes)
    if len(code.text) > BOUNDS.code_characters:
        raise AnswerError(f"{path}: more than {BOUNDS.code_characters} characters of code or LaTeX")
    return code
