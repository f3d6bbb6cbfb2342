"""The code of a Jupyter notebook: its cells as one program, with the lines of each cell."""

from __future__ import annotations

import ast
import json
import re
import warnings
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

from dhkit.errors import AnswerError
from dhkit.grading.answers.tokens import word_set

_HARMLESS_MAGICS = word_set(
    """
    matplotlib config pip conda ls pwd who whos precision load_ext autoreload cd lsmagic autosave pdb xmode colors
    history env display
    """
)
"""Magics of a line that execute nothing of the program and assign nothing."""

_CELLS_WITHOUT_PYTHON = word_set("latex markdown html HTML javascript js svg SVG bash sh writefile")
"""Magics of cells that hold another language, or text."""


@dataclass(frozen=True)
class Notebook:
    """A notebook's code.

    Attributes
    ----------
    code
        Cells one below the other.
    suffix
        ``.py``, or ``.m`` for a kernel of MATLAB or Octave.
    starts
        First line of each cell of code, from 1.
    notes
        Notes for the reader.
    """

    code: str
    suffix: str
    starts: tuple[int, ...]
    notes: tuple[str, ...]

    def line_name(self, line_number: int) -> str:
        """Return how messages name a line: ``cell 2, line 3``, cells of code and lines counted from 1."""
        cell = bisect_right(self.starts, line_number)
        if not cell:
            return f"line {line_number}"
        return f"cell {cell}, line {line_number - self.starts[cell - 1] + 1}"


def notebook_code(text: str, file: str) -> Notebook:
    """Return the code of a notebook.

    Parameters
    ----------
    text
        The notebook, as JSON.
    file
        Beginning of messages.

    Raises
    ------
    AnswerError
        No notebook, or a magic that may assign any name.
    """
    try:
        document = json.loads(text)
        language = str(
            document.get("metadata", {}).get("kernelspec", {}).get("language", "python")
        ).lower()
        cells = [cell for cell in document["cells"] if cell["cell_type"] == "code"]
        sources = [_source(cell["source"]) for cell in cells]
        counts = [cell.get("execution_count") for cell in cells]
    except (ValueError, RecursionError):
        raise AnswerError(f"{file}: no notebook: not JSON") from None
    except (KeyError, TypeError, AttributeError):
        raise AnswerError(
            f"{file}: no notebook: expected cells with cell_type and source"
        ) from None
    is_matlab = language in ("matlab", "octave")
    if not is_matlab and language not in ("python", "python3", ""):
        raise AnswerError(
            f"{file}: a notebook of {language[:20]!r}; expected Python, MATLAB or Octave"
        )
    lines: list[str] = []
    starts: list[int] = []
    for number, source in enumerate(sources, start=1):
        starts.append(len(lines) + 1)
        cell = source.replace("\r\n", "\n").replace("\r", "\n")
        lines += (cell if is_matlab else _without_magics(cell, f"{file}: cell {number}")).split(
            "\n"
        )
    return Notebook(
        "\n".join(lines), ".m" if is_matlab else ".py", tuple(starts), _order_notes(counts)
    )


def _source(source: object) -> str:
    if isinstance(source, str):
        return source
    if not isinstance(source, list) or not all(isinstance(line, str) for line in source):
        raise TypeError
    return "".join(source)


def _order_notes(counts: Sequence[object]) -> tuple[str, ...]:
    """Return a note where cells were run in another order than they stand in."""
    run = [count for count in counts if isinstance(count, int)]
    if run == sorted(run):
        return ()
    return ("cells were last run in another order than they stand in; they are read as they stand",)


def _without_magics(cell: str, where: str) -> str:
    """Return a cell as Python executes it.

    Lines that begin with %, ! or ? become what they execute, and ``pass`` where they execute nothing of the program. As
    in IPython, the indentation of the first line is taken from all.

    Raises
    ------
    AnswerError
        A magic that may assign any name, or a cell that is not Python by itself.
    """
    cell = _without_indentation(cell)
    if not _is_python(cell):
        lines = cell.split("\n")
        first = next((k for k, line in enumerate(lines) if line.strip()), 0)
        if magic := re.match(r"%%\s*(\w+)(.*)", lines[first]):
            if magic[1] in _CELLS_WITHOUT_PYTHON:
                return "\n".join("" for _ in lines)
            lines = _timed_or_captured(lines, first, magic[1], magic[2].split(), where)
        cell = "\n".join(
            _executed(line, f"{where}, line {k}") for k, line in enumerate(lines, start=1)
        )
    try:
        _parse(cell)
    except SyntaxError as error:
        raise AnswerError(
            f"{where}, line {error.lineno or 1}: no Python: {str(error.msg)[:100]}"
        ) from None
    except (ValueError, RecursionError, MemoryError):
        raise AnswerError(f"{where}: no Python, or nested too deep to be read") from None
    return cell


def _without_indentation(cell: str) -> str:
    lines = cell.split("\n")
    first = next((line for line in lines if line.strip()), "")
    indentation = first[: len(first) - len(first.lstrip())]
    return "\n".join(line.removeprefix(indentation) for line in lines)


def _timed_or_captured(
    lines: list[str], first: int, magic: str, arguments: list[str], where: str
) -> list[str]:
    """Return a cell under a magic of the whole cell, whose code is executed, as the same number of lines."""
    rest = lines[first + 1 :]
    before = ["" for _ in lines[:first]]
    match magic, [word for word in arguments if not word.startswith("-")]:
        case "time" | "matplotlib", []:
            return [*before, "", *rest]
        case "capture", []:
            return [*before, "", *rest]
        case "capture", [name] if name.isidentifier():
            return [*before, f"{name} = object()", *rest]
        case "timeit", _:
            # Its names are local to it, and it is executed many times: its changes are those of a loop.
            return [
                *before,
                "for _ in range(7):",
                *(f" {line}" for line in rest),
                *([" pass"] if not any(line.strip() for line in rest) else []),
            ]
    raise AnswerError(f"{where}: found %%{magic[:20]}, which may assign any name")


def _executed(line: str, where: str) -> str:
    """Return the Python statement in a line of a cell; ``pass`` for a line that only a notebook understands."""
    stripped = line.strip()
    indentation = line[: len(line) - len(line.lstrip())]
    if not stripped.startswith("%"):
        is_notebooks = stripped.startswith(("!", "?")) or re.fullmatch(r"[\w.]+\?{1,2}", stripped)
        return f"{indentation}pass" if is_notebooks else line
    match = re.match(r"%\s*(\w*)\s*(.*)", stripped)
    word, rest = (match[1], match[2]) if match else ("", "")
    if word in ("time", "timeit"):
        statement = re.sub(r"^(?:-\w+\s*\d*\s+)*", "", rest)
        if word == "time" or not statement or _is_expression(statement):
            return f"{indentation}{statement or 'pass'}"
    elif word in _HARMLESS_MAGICS and not (word == "env" and "=" in stripped):
        return f"{indentation}pass"
    raise AnswerError(f"{where}: found %{word[:20]}, which may assign any name")


def _is_expression(text: str) -> bool:
    try:
        ast.parse(text, filename="cell", mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return False
    return True


def _parse(cell: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ast.parse(cell, filename="cell")


def _is_python(cell: str) -> bool:
    try:
        _parse(cell)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return False
    return True
