"""Answers out of .py, .m and .tex files and notebooks: assignments are read as text, nothing is ever run."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dhkit.errors import AnswerError
from dhkit.grading.answers.sheet import ALIASES, MAX_NAMES, AnswerSheet, Names, Refusal, quantity_names, read_text
from dhkit.grading.answers.vocabulary import plain_name

__all__ = ["LANGUAGES", "read_source"]

MAX_CHARACTERS = 1_000_000
"""A notebook may be longer: its figures do not count."""
MAX_STATEMENTS = 5_000
ENTRY = re.compile(r"([A-Za-z]+?\d*)(?:_?(\d)_?(\d)|_?(\d))", re.ASCII)
INDEXED = re.compile(
    r"(\w+)\s*(?:\(\s*(\d+)\s*(?:,\s*(\d+)\s*)?\)|\[\s*(\d+)\s*(?:,\s*(\d+)\s*)?\](?:\[\s*(\d+)\s*\])?)", re.ASCII
)
SHORTENING = re.compile(
    r"(?:\w+\.)*(?:simplify|expand|trigsimp|factor|nsimplify|combine|vpa)\((.*)\)|(\w+)\.(?:simplify|expand)\(\)",
    re.DOTALL,
)
EMPTY = re.compile(r"(?:\w+\.)*(?:zeros|sym)\(.*\)", re.DOTALL)
SCALARS = ("K", "V", "L")


@dataclass(frozen=True)
class _Statement:
    line: int
    name: str
    index: tuple[int, ...]
    text: str
    changes: bool = False
    """Whether this is += and the like."""


def read_source(path: Path, n: int) -> AnswerSheet:
    """Return the answers that a file assigns: ``M = ...``, ``M11 = ...``, ``M(1,2) = ...``, and what they are made of.

    Parameters
    ----------
    path
        A file that ends in .py, .m, .tex or .ipynb.
    n
        The number of joints.

    Raises
    ------
    AnswerError
        A file that cannot be read, or one that assigns no quantity.
    """
    text = read_text(path, "a program or a paper")
    suffix = path.suffix.lower()
    if suffix == ".ipynb":
        text, suffix = _notebook(text, path)
    if len(text) > MAX_CHARACTERS:
        raise AnswerError(f"{path}: more than {MAX_CHARACTERS} characters of code or LaTeX")
    statements = list(_assignments(text, suffix))
    if len(statements) > MAX_STATEMENTS:
        raise AnswerError(f"{path}: more than {MAX_STATEMENTS} assignments")
    answers, others = _sorted(statements, n)
    if not answers:
        known = ", ".join(quantity_names(n)[:8])
        raise AnswerError(f"{path}: assigns no quantity; expected some of {known}, A1, T, J")
    return AnswerSheet(names=Names(parameters=others, lenient=True), answers=answers, file=str(path))


def _sorted(statements: list[_Statement], n: int) -> tuple[dict[str, Any], dict[str, str | Refusal]]:
    """Tell quantities from the names that they are made of.

    A program is read, not run: what is assigned twice, or changed afterwards, is refused.
    """
    known = quantity_names(n)
    whole: dict[str, str | Refusal] = {}
    parts: dict[str, dict[tuple[int, ...], str]] = {}
    others: dict[str, str | Refusal] = {}
    assigned = {s.name for s in statements if s.index or s.name in SCALARS or n == 1 or _is_matrix(s.text)}
    for statement in statements:
        name, text = statement.name, statement.text
        alias = ALIASES.get(name, name)
        quantity = name if name in known else alias if alias in known and alias not in assigned else ""
        is_whole = quantity and not statement.index and (quantity in SCALARS or n == 1 or _is_matrix(text))
        changed = Refusal(f"changed after it is assigned, in line {statement.line}")
        twice = Refusal(f"assigned twice, in line {statement.line}")
        if statement.changes:
            (whole if quantity in whole else others)[quantity if quantity in whole else name] = changed
        elif is_whole and EMPTY.fullmatch(text):
            continue  # zeros(2, 2): entries follow
        elif is_whole:
            whole[quantity] = text if whole.get(quantity, text) == text else twice
        elif quantity and statement.index and quantity in whole:
            whole[quantity] = changed
        elif quantity and statement.index:
            copied = INDEXED.fullmatch(text)
            own = parts.setdefault(quantity, {})
            text = own.get(_index_of(copied), text) if copied and copied[1] == name else text
            own[statement.index] = text
        elif not statement.index:
            entry = ENTRY.fullmatch(name)
            head = ALIASES.get(entry[1], entry[1]) if entry else ""
            if entry and head in ("M", "C", "h", "g", "tau"):
                index = (int(entry[4]),) if entry[4] else (int(entry[2]), int(entry[3]))
                parts.setdefault(head, {})[tuple(k - 1 for k in index)] = text
            others[name] = text if others.get(name, text) == text else twice
    answers: dict[str, Any] = dict(whole)
    for name, entries in parts.items():
        complete = _complete(name, entries, n)
        if complete is not None and name not in whole:
            answers[name] = complete
    return answers, dict(list(others.items())[-MAX_NAMES:])


def _is_matrix(text: str) -> bool:
    return "[" in text or "\\begin" in text or EMPTY.fullmatch(text) is not None


def _index_of(match: re.Match[str]) -> tuple[int, ...]:
    """Return an index from 0: of M(1,2) as MATLAB counts, of M[0,1] as Python does."""
    from_one, from_zero = match.groups()[1:3], (match[4], match[5] or match[6])
    return tuple(int(k[:4]) - 1 for k in from_one if k) or tuple(int(k[:4]) for k in from_zero if k)


def _complete(name: str, entries: Mapping[tuple[int, ...], str], n: int) -> Any:
    """Return entries as a list, or a list of lists; nothing where one is missing, of M its mirrored one."""
    if name in ("h", "g", "tau"):
        listed = [entries.get((i,), entries.get((i, 0))) for i in range(n)]
        return None if None in listed else listed
    rows = [[entries.get((i, j), entries.get((j, i)) if name == "M" else None) for j in range(n)] for i in range(n)]
    return None if any(None in row for row in rows) else rows


# Statements


def _assignments(text: str, suffix: str) -> Iterator[_Statement]:
    for line, statement in LANGUAGES[suffix](text):
        left, equals, right = statement.partition("=")
        if not equals or right.startswith("=") or left.rstrip().endswith(("!", "<", ">", "~")):
            continue
        changes = left.rstrip().endswith(("+", "-", "*", "/"))
        name, index = _target(left.rstrip().rstrip("+-*/"), suffix)
        right = _unwrapped(right.strip().rstrip(";").strip())
        if not name or not right or right == name:
            continue
        yield _Statement(line, name, index, right, changes)


def _unwrapped(text: str) -> str:
    """Take simplify( ) and the like away, which change nothing."""
    while match := SHORTENING.fullmatch(text):
        inner = match[1] if match[1] is not None else match[2]
        depth = 0
        for k, character in enumerate(inner):
            depth += {"(": 1, ")": -1}.get(character, 0)
            if depth < 0 or (depth == 0 and character == "," and "=" not in inner[k:]):
                return text
        text = re.sub(r",\s*\w+\s*=\s*\w+\s*$", "", inner).strip()
    return text


def _target(left: str, suffix: str) -> tuple[str, tuple[int, ...]]:
    """Return what is assigned to: a name, with an index from 0 perhaps."""
    left = left.strip()
    if suffix == ".tex":
        left = re.sub(r"\\(?:mathbf|mathrm|boldsymbol|bm|left|right|dot|ddot)(?![A-Za-z])", "", left)
        left = re.sub(r"\([^()]*\)", "", left)
    match = INDEXED.fullmatch(left)
    if match:
        return match[1], _index_of(match)
    name = plain_name(left)
    return (name, ()) if re.fullmatch(r"[A-Za-z]\w{0,63}", name, re.ASCII) else ("", ())


def _lines(text: str, comment: str, going_on: str, rows: bool) -> Iterator[tuple[int, str]]:
    """Yield statements with their lines: without comments, joined inside brackets and where they go on."""
    pieces: list[str] = []
    start, depth, last = 1, 0, ""
    for number, line in enumerate(text.splitlines(), start=1):
        code = line.partition(comment)[0].rstrip()
        goes_on = code.endswith(going_on)
        code = code.removesuffix(going_on)
        start = start if pieces else number
        for piece in re.split(r"([()\[\]{};])", code):
            depth += {"(": 1, "[": 1, "{": 1, ")": -1, "]": -1, "}": -1}.get(piece, 0)
            if piece == ";" and depth <= 0:
                yield start, "".join(pieces)
                pieces, start, last = [], number, ""
            elif piece:
                pieces.append(piece)
                last = piece.rstrip()[-1:] or last
        if depth <= 0 and not goes_on:
            yield start, "".join(pieces)
            pieces, depth, last = [], 0, ""
        elif code:
            # In MATLAB a new line inside a matrix is a new row.
            pieces.append("; " if depth > 0 and rows and not goes_on and last not in ("[", ";", ",") else " ")
    yield start, "".join(pieces)


def _python(text: str) -> Iterator[tuple[int, str]]:
    text = re.sub(r""""{3}.*?"{3}|\'{3}.*?\'{3}""", lambda found: "\n" * found[0].count("\n"), text, flags=re.DOTALL)
    return _lines(text, "#", "\\", rows=False)


def _matlab(text: str) -> Iterator[tuple[int, str]]:
    blocks = r"^[ \t]*%\{[ \t]*$.*?^[ \t]*%\}[ \t]*$"
    text = re.sub(blocks, lambda found: "\n" * found[0].count("\n"), text, flags=re.DOTALL | re.MULTILINE)
    return (
        (line, statement)
        for line, statement in _lines(text, "%", "...", rows=True)
        if not statement.lstrip().startswith("function")
    )


def _latex(text: str) -> Iterator[tuple[int, str]]:
    r"""Yield equations: parts of displays, at \\ and at blank lines, outside matrices."""
    text = re.sub(r"(?<!\\)%.*", "", text)
    matrix, line = 0, 1
    statement: list[str] = []
    pieces = re.split(
        r"(\\begin\{\w*matrix\}|\\end\{\w*matrix\}|\\\\|\\(?:begin|end)\{\w+\*?\}|\$\$?|\\[\[\]()]|\n\s*\n)", text
    )
    for piece in pieces:
        if re.fullmatch(r"\\(?:begin|end)\{\w*matrix\}", piece):
            matrix += 1 if piece.startswith("\\begin") else -1
            statement.append(piece)
        elif matrix or not re.fullmatch(r"\\\\|\\(?:begin|end)\{\w+\*?\}|\$\$?|\\[\[\]()]|\n\s*\n", piece):
            statement.append(piece if matrix else piece.replace("&", " "))
        else:
            yield line, "".join(statement).strip().rstrip(".,")
            statement = []
        line += piece.count("\n")
    yield line, "".join(statement).strip().rstrip(".,")


LANGUAGES: Mapping[str, Callable[[str], Iterator[tuple[int, str]]]] = {".py": _python, ".m": _matlab, ".tex": _latex}
"""How statements are told apart, by the file's suffix."""


def _notebook(text: str, path: Path) -> tuple[str, str]:
    """Return the code of a notebook's cells, and the suffix of its language."""
    try:
        document = json.loads(text)
        cells = document["cells"]
        language = str(document.get("metadata", {}).get("kernelspec", {}).get("language", "python")).lower()
        sources = [cell["source"] for cell in cells if cell["cell_type"] == "code"]
        code = "\n".join(source if isinstance(source, str) else "".join(source) for source in sources)
    except (ValueError, RecursionError):
        raise AnswerError(f"{path}: no notebook: not JSON") from None
    except (KeyError, TypeError, AttributeError):
        raise AnswerError(f"{path}: no notebook: expected cells with cell_type and source") from None
    return code, ".m" if language in ("matlab", "octave") else ".py"
