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

HARMLESS_MAGICS = word_set(
    """
    matplotlib config timeit pip conda ls pwd who whos precision load_ext autoreload time cd lsmagic autosave
    pdb xmode colors history env display
    """
)
"""Magics that assign nothing."""

WHOLE_CELL_MAGICS = word_set("latex markdown html HTML javascript js svg SVG bash sh writefile timeit")
"""Magics of cells that hold no Python, or Python that assigns nothing."""

CELL_PREFIXES = frozenset(("time", "capture", "matplotlib"))
"""Magics in front of a cell that is otherwise ordinary."""


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
        What a reader should know.
    """

    code: str
    suffix: str
    starts: tuple[int, ...]
    notes: tuple[str, ...]

    def line_name(self, line: int) -> str:
        """Return how messages name a line: ``cell 2, line 3``, cells of code and lines counted from 1."""
        cell = bisect_right(self.starts, line)
        return f"cell {cell}, line {line - self.starts[cell - 1] + 1}" if cell else f"line {line}"


def notebook_code(text: str, file: str) -> Notebook:
    """Return the code of a notebook.

    Parameters
    ----------
    text
        The notebook, as JSON.
    file
        What messages begin with.

    Raises
    ------
    AnswerError
        No notebook, or a magic that may assign any name.
    """
    try:
        document = json.loads(text)
        language = str(document.get("metadata", {}).get("kernelspec", {}).get("language", "python")).lower()
        cells = [cell for cell in document["cells"] if cell["cell_type"] == "code"]
        sources = [_source(cell["source"]) for cell in cells]
        counts = [cell.get("execution_count") for cell in cells]
    except (ValueError, RecursionError):
        raise AnswerError(f"{file}: no notebook: not JSON") from None
    except (KeyError, TypeError, AttributeError):
        raise AnswerError(f"{file}: no notebook: expected cells with cell_type and source") from None
    is_matlab = language in ("matlab", "octave")
    if not is_matlab and language not in ("python", "python3", ""):
        raise AnswerError(f"{file}: a notebook of {language[:20]!r}; expected Python, MATLAB or Octave")
    lines: list[str] = []
    starts: list[int] = []
    for number, source in enumerate(sources, start=1):
        starts.append(len(lines) + 1)
        cell = source.replace("\r\n", "\n").replace("\r", "\n")
        lines += (cell if is_matlab else _without_magics(cell, f"{file}: cell {number}")).split("\n")
    return Notebook("\n".join(lines), ".m" if is_matlab else ".py", tuple(starts), _order_notes(counts))


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
    """Return a cell without lines that begin with %, ! or ? and assign nothing."""
    if _is_python(cell):
        return cell
    lines = cell.split("\n")
    first = next((k for k, line in enumerate(lines) if line.strip()), 0)
    if magic := re.match(r"%%\s*(\w+)", lines[first]):
        if magic[1] in WHOLE_CELL_MAGICS:
            return "\n".join("" for _ in lines)
        if magic[1] not in CELL_PREFIXES:
            raise AnswerError(f"{where}: found %%{magic[1][:20]}, which may assign any name")
        lines[first] = ""
    return "\n".join(_without_magic(line, f"{where}, line {k}") for k, line in enumerate(lines, start=1))


def _without_magic(line: str, where: str) -> str:
    """Return a line of a cell; ``pass`` for one that only a notebook understands: inside brackets it is an error."""
    stripped = line.strip()
    if stripped.startswith("%"):
        name = re.match(r"%\s*(\w+)", stripped)
        word = name[1] if name else ""
        if word not in HARMLESS_MAGICS or (word in ("time", "env", "timeit") and "=" in stripped):
            raise AnswerError(f"{where}: found %{word[:20]}, which may assign any name")
    elif not stripped.startswith(("!", "?")) and not re.fullmatch(r"[\w.]+\?{1,2}", stripped):
        return line
    return f"{line[: len(line) - len(line.lstrip())]}pass"


def _is_python(cell: str) -> bool:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            ast.parse(cell, filename="cell")
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return False
    return True
