"""The code of a Jupyter notebook: its cells as one program, with the lines of each cell."""

from __future__ import annotations

import ast
import json
import re
import warnings
from bisect import bisect_right
from dataclasses import dataclass
from typing import Any

from dhkit.errors import AnswerError

HARMLESS_MAGICS = frozenset(
    (
        "matplotlib",
        "config",
        "timeit",
        "pip",
        "conda",
        "ls",
        "pwd",
        "who",
        "whos",
        "precision",
        "load_ext",
        "autoreload",
        "time",
        "cd",
        "lsmagic",
        "autosave",
        "pdb",
        "xmode",
        "colors",
        "history",
        "env",
        "display",
    )
)
"""Magics that assign nothing."""
WHOLE_CELLS = frozenset(
    ("latex", "markdown", "html", "HTML", "javascript", "js", "svg", "SVG", "bash", "sh", "writefile")
)
"""Cells with this magic hold no Python, and assign nothing."""
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
        .py, or .m of a kernel of MATLAB or Octave.
    starts
        First lines of the cells, from 1, and the cells' numbers.
    notes
        What a reader should know.
    """

    code: str
    suffix: str
    starts: tuple[tuple[int, int], ...]
    notes: tuple[str, ...]

    def line_name(self, line: int) -> str:
        """Return how messages name a line: ``cell 2, line 3``, cells of code counted from 1."""
        k = bisect_right([start for start, _ in self.starts], line) - 1
        if k < 0:
            return f"line {line}"
        start, cell = self.starts[k]
        return f"cell {cell}, line {line - start + 1}"


def notebook_code(text: str, file: str) -> Notebook:
    """Return the code of a notebook.

    Raises
    ------
    AnswerError
        No notebook, or a magic that may assign any name.
    """
    try:
        document = json.loads(text)
        cells = document["cells"]
        language = str(document.get("metadata", {}).get("kernelspec", {}).get("language", "python")).lower()
        code = [cell for cell in cells if cell["cell_type"] == "code"]
        sources = [_source(cell["source"]) for cell in code]
        counts = [cell.get("execution_count") for cell in code]
    except (ValueError, RecursionError):
        raise AnswerError(f"{file}: no notebook: not JSON") from None
    except (KeyError, TypeError, AttributeError):
        raise AnswerError(f"{file}: no notebook: expected cells with cell_type and source") from None
    is_matlab = language in ("matlab", "octave")
    if not is_matlab and language not in ("python", "python3", ""):
        raise AnswerError(f"{file}: a notebook of {language[:20]!r}; expected Python, MATLAB or Octave")
    lines: list[str] = []
    starts: list[tuple[int, int]] = []
    for number, source in enumerate(sources, start=1):
        starts.append((len(lines) + 1, number))
        cell = source.replace("\r\n", "\n").replace("\r", "\n")
        lines += cell.split("\n") if is_matlab else _without_magics(cell, f"{file}: cell {number}").split("\n")
    return Notebook("\n".join(lines), ".m" if is_matlab else ".py", tuple(starts), _order(counts))


def _source(source: Any) -> str:
    if isinstance(source, str):
        return source
    if not isinstance(source, list) or not all(isinstance(line, str) for line in source):
        raise TypeError
    return "".join(source)


def _order(counts: list[Any]) -> tuple[str, ...]:
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
    head = re.match(r"%%\s*(\w+)", lines[first])
    if head:
        if head[1] in WHOLE_CELLS:
            return "\n".join("" for _ in lines)
        if head[1] not in CELL_PREFIXES and head[1] != "timeit":
            raise AnswerError(f"{where}: found %%{head[1][:20]}, which may assign any name")
        if head[1] == "timeit":
            return "\n".join("" for _ in lines)
        lines[first] = ""
    for k, line in enumerate(lines):
        lines[k] = _plain_line(line, f"{where}, line {k + 1}")
    return "\n".join(lines)


def _plain_line(line: str, where: str) -> str:
    """Return a line of a cell; ``pass`` for one that only a notebook understands: inside brackets it is an error."""
    stripped = line.strip()
    indent = line[: len(line) - len(line.lstrip())]
    if stripped.startswith("%"):
        name = re.match(r"%\s*(\w+)", stripped)
        word = name[1] if name else ""
        if word not in HARMLESS_MAGICS or (word in ("time", "env", "timeit") and "=" in stripped):
            raise AnswerError(f"{where}: found %{word[:20]}, which may assign any name")
        return f"{indent}pass"
    if stripped.startswith(("!", "?")) or re.fullmatch(r"[\w.]+\?{1,2}", stripped):
        return f"{indent}pass"
    return line


def _is_python(cell: str) -> bool:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            ast.parse(cell, filename="cell")
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return False
    return True
