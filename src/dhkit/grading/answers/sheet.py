"""Answer sheets: TOML with a robot, the student's names, and answers as text; read, checked, never evaluated."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import Any

from dhkit.description.files import read_bounded
from dhkit.description.toml_text import toml_document
from dhkit.errors import AnswerError, DescriptionError

FORMAT = 1
MAX_BYTES = 4_000_000
"""A PUMA's M and C, multiplied out in numbers, are 2 MB."""
MAX_NAMES = 100
MAX_BRANCHES = 64
KEYS = {
    "sheet": ("format", "robot", "student", "names", "task", "answer", "rubric"),
    "task file": ("format", "robot", "names", "task", "rubric"),
    "names": ("q", "qd", "qdd", "angles", "parameters"),
    "task": ("friction", "total_derivative", "asked", "proof", "frames", "zero"),
    "dh": ("convention", "rows"),
    "ik": ("branches",),
}
"""Keys that a document, and each table in it, may have. No key stands in two tables with two meanings."""
CHOICES = {
    "angles": ("relative", "absolute"),
    "proof": ("optional", "required"),
    "frames": ("free", "given"),
    "zero": ("free", "given"),
    "convention": ("standard", "modified"),
}
"""Values that a key may have; the first counts where the key is missing."""
COLUMNS = ("theta", "d", "a", "alpha")
"""Entries of a table's row."""
QUANTITY = re.compile(r"M|C|h|g|tau|K|V|L|T|J|dh|ik|A[1-9][0-9]?")
"""Names of quantities."""
ALIASES = {
    "D": "M",
    "G": "g",
    "KE": "K",
    "PE": "V",
    "U": "V",
    "P": "V",
    "Tau": "tau",
    "N": "g",
    "Jac": "J",
    "Lagrangian": "L",
}
"""What quantities are called elsewhere."""


@dataclass(frozen=True)
class Refusal:
    """What stands for a text that a program assigned and that is not to be judged.

    Attributes
    ----------
    reason
        Why, with the line.
    """

    reason: str


@dataclass(frozen=True)
class Chain:
    """The formulas of one statement ``V = a = b``: the last is the answer, and those before it must equal it.

    Attributes
    ----------
    formulas
        As they were typed, two or more.
    """

    formulas: tuple[str, ...]


@dataclass(frozen=True)
class Entries:
    """A quantity that was given entry by entry, perhaps not all of them.

    Attributes
    ----------
    texts
        Text, :class:`Chain` or :class:`Refusal` by index, from 0.
    """

    texts: Mapping[tuple[int, ...], str | Chain | Refusal]


@dataclass(frozen=True)
class Names:
    """How a student's names map on ours.

    Attributes
    ----------
    q, qd, qdd
        Names of the joint variables, their rates and accelerations; the usual ones unless given.
    absolute
        Whether angles count from a fixed direction rather than from the link before.
    parameters
        The student's further names, each as text in the robot's parameters and in those before it.
    lenient
        Whether a further name may be unreadable, and replaces any other meaning: what a program defines.
    """

    q: tuple[str, ...] = ()
    qd: tuple[str, ...] = ()
    qdd: tuple[str, ...] = ()
    absolute: bool = False
    parameters: Mapping[str, str | Refusal] = field(default_factory=dict)
    lenient: bool = False


@dataclass(frozen=True)
class Task:
    """What was asked for, where there is a choice.

    Attributes
    ----------
    friction
        Whether tau includes viscous friction.
    total_derivative
        Whether L is right up to the total derivative of a function of q and t.
    asked
        Quantities that were assigned; a sheet without one of them is incomplete. Those that were begun unless given.
    proof_required
        Whether answers that are not proved do not pass (``proof = "required"``).
    frames_given
        Whether a table must have the file's own frames (``frames = "given"``).
    zero_given
        Whether a table's joint variables must be zero in the file's own zero pose (``zero = "given"``).
    """

    friction: bool = False
    total_derivative: bool = False
    asked: tuple[str, ...] = ()
    proof_required: bool = False
    frames_given: bool = False
    zero_given: bool = False


@dataclass(frozen=True)
class AnswerSheet:
    """What was handed in, as text.

    Attributes
    ----------
    robot
        A library name, or a path inside the sheet's folder; empty where the caller says.
    names, task
        What names mean, and what was asked for.
    answers
        Text, or lists of text, by quantity.
    table
        Convention and rows (theta, d, a, alpha) of a table; None without one.
    branches
        Inverse kinematics' formulas, a list of n a branch.
    rubric
        How points are given; the instructor's own file comes first.
    student
        Student's name; empty if unknown.
    file
        What messages begin with.
    notes
        What a reader should know of how a program or a document was read, each with its line.
    left_out
        Statements that were not read as answers, each with its line.
    """

    robot: str = ""
    names: Names = field(default=Names())
    task: Task = field(default=Task())
    answers: Mapping[str, Any] = field(default_factory=dict)
    table: tuple[str, tuple[tuple[str, ...], ...]] | None = None
    branches: tuple[tuple[str, ...], ...] = ()
    rubric: Mapping[str, Any] = field(default_factory=dict)
    student: str = ""
    file: str = "answers"
    notes: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()


def read_text(path: Path, expected: str) -> str:
    """Return a file's text; ``expected`` says in a message what it should be.

    Raises
    ------
    AnswerError
        A file that cannot be read, is too long, or is not UTF-8.
    """
    try:
        return read_bounded(path, MAX_BYTES, expected).decode("utf-8-sig")
    except DescriptionError as error:
        raise AnswerError(str(error)) from None
    except UnicodeDecodeError as error:
        raise AnswerError(f"{path}: not UTF-8 at byte {error.start}") from None


def read_sheet(path: Path) -> AnswerSheet:
    """Read an answer sheet.

    Raises
    ------
    AnswerError
        A file that cannot be read, or is no answer sheet; with the file, the key, what was found and expected.
    """
    text = read_text(path, "an answer sheet")
    try:
        return sheet_of(toml_document(text), str(path))
    except DescriptionError as error:
        raise AnswerError(f"{path}: {error}") from None
    except RecursionError:
        raise AnswerError(f"{path}: nested too deep") from None


def read_task(path: Path) -> AnswerSheet:
    """Read an instructor's task: a sheet without answers, with robot, [task], [names] and [rubric].

    Raises
    ------
    AnswerError
        A file that cannot be read, or is no task; with the file, the key, what was found and expected.
    """
    try:
        data = toml_document(read_text(path, "a task"))
        return _sheet(data, _Where(str(path)), KEYS["task file"])
    except DescriptionError as error:
        raise AnswerError(f"{path}: {error}") from None
    except RecursionError:
        raise AnswerError(f"{path}: nested too deep") from None


def quantity_names(n: int) -> list[str]:
    """Return what an arm of n joints may be asked for."""
    return ["M", "C", "h", "g", "tau", "K", "V", "L", *(f"A{i}" for i in range(1, n + 1)), "T", "J"]


def shape_of(quantity: str, n: int) -> tuple[int, ...]:
    """Return the shape of a quantity for an arm of n joints; () of a scalar."""
    if quantity in ("M", "C"):
        return (n, n)
    if quantity in ("h", "g", "tau"):
        return (n,)
    if quantity in ("K", "V", "L"):
        return ()
    return (6, n) if quantity == "J" else (4, 4)


def sheet_of(data: Mapping[str, Any], file: str = "answers") -> AnswerSheet:
    """Return the answer sheet that a TOML document is.

    Raises
    ------
    AnswerError
        It is none; with the key, what was found and expected.
    """
    where = _Where(file)
    sheet = _sheet(data, where, KEYS["sheet"])
    if not where.table(data, "answer", ""):
        raise AnswerError(f"{file}: no answers; expected a table [answer] with M, g, tau or others")
    return sheet


def _sheet(data: Mapping[str, Any], where: _Where, known: Sequence[str]) -> AnswerSheet:
    """Return what a document says, of the keys that it may have."""
    where.keys(data, known, "")
    if data.get("format", FORMAT) != FORMAT:
        raise AnswerError(f"{where.file}: format: found {where.shown(data['format'])}; expected {FORMAT}")
    answers = where.table(data, "answer", "")
    names, task = where.table(data, "names", ""), where.table(data, "task", "")
    table, inverse = where.table(answers, "dh", "answer."), where.table(answers, "ik", "answer.")
    return AnswerSheet(
        where.text(data, "robot", ""),
        _names(where, names),
        _task(where, task),
        {name: value for name, value in answers.items() if name not in ("dh", "ik")},
        _dh(where, table) if "dh" in answers else None,
        _branches(where, inverse) if "ik" in answers else (),
        where.table(data, "rubric", ""),
        where.text(data, "student", ""),
        where.file,
    )


class _Where:
    """Checks entries of a document, with the file in every message."""

    def __init__(self, file: str) -> None:
        self.file = file

    def fail(self, key: str, found: object, expected: str) -> AnswerError:
        return AnswerError(f"{self.file}: {key}: found {self.shown(found)}; expected {expected}")

    @staticmethod
    def shown(found: object) -> str:
        if isinstance(found, Mapping):
            return "a table"
        text = str(found) if isinstance(found, Decimal) else repr(found)
        return text if len(text) <= 60 else text[:57] + "..."

    def keys(self, table: Mapping[str, Any], known: Sequence[str], prefix: str) -> None:
        for key in table:
            if key not in known:
                close = difflib.get_close_matches(key, known, n=1)
                hint = f"did you mean {close[0]!r}?" if close else f"expected {', '.join(known)}"
                raise AnswerError(f"{self.file}: unknown key {prefix}{key[:60]!r}; {hint}")

    def table(self, data: Mapping[str, Any], key: str, prefix: str) -> Mapping[str, Any]:
        value = data.get(key, {})
        if not isinstance(value, Mapping):
            raise self.fail(prefix + key, value, "a table")
        return value

    def text(self, data: Mapping[str, Any], key: str, prefix: str) -> str:
        value = data.get(key, "")
        if not isinstance(value, str):
            raise self.fail(prefix + key, value, "text in quotes")
        return value

    def texts(self, value: object, key: str, what: str) -> tuple[str, ...]:
        if not isinstance(value, list) or not all(_is_entry(x) for x in value):
            raise self.fail(key, value, what)
        return tuple(str(x) for x in value)

    def choice(self, data: Mapping[str, Any], key: str, prefix: str) -> str:
        known = CHOICES[key]
        value = data.get(key, known[0])
        if value not in known:
            raise self.fail(prefix + key, value, " or ".join(map(repr, known)))
        return str(value)

    def switch(self, data: Mapping[str, Any], key: str, prefix: str) -> bool:
        value = data.get(key, False)
        if not isinstance(value, bool):
            raise self.fail(prefix + key, value, "true or false")
        return value


def _is_entry(value: object) -> bool:
    return isinstance(value, str | int | float | Decimal) and not isinstance(value, bool)


def _names(where: _Where, data: Mapping[str, Any]) -> Names:
    where.keys(data, KEYS["names"], "names.")
    parameters = where.table(data, "parameters", "names.")
    if len(parameters) > MAX_NAMES:
        raise where.fail("names.parameters", f"{len(parameters)} names", f"at most {MAX_NAMES}")
    for name, value in parameters.items():
        if not _is_entry(value):
            raise where.fail(f"names.parameters: {name[:40]!r}", value, "an expression in the robot's parameters")
    q, qd, qdd = (
        where.texts(data[key], f"names.{key}", "a list of names, one a joint") if key in data else ()
        for key in ("q", "qd", "qdd")
    )
    absolute = where.choice(data, "angles", "names.") == "absolute"
    return Names(q, qd, qdd, absolute, parameters={name: str(value) for name, value in parameters.items()})


def _task(where: _Where, data: Mapping[str, Any]) -> Task:
    where.keys(data, KEYS["task"], "task.")
    asked = where.texts(data.get("asked", []), "task.asked", 'a list of quantities such as ["M", "g"]')
    for name in asked:
        if not QUANTITY.fullmatch(name):
            raise where.fail("task.asked", name, "M, C, h, g, tau, K, V, L, A1 ..., T, J, dh or ik")
    return Task(
        where.switch(data, "friction", "task."),
        where.switch(data, "total_derivative", "task."),
        tuple(dict.fromkeys(asked)),
        where.choice(data, "proof", "task.") == "required",
        where.choice(data, "frames", "task.") == "given",
        where.choice(data, "zero", "task.") == "given",
    )


def _dh(where: _Where, data: Mapping[str, Any]) -> tuple[str, tuple[tuple[str, ...], ...]]:
    where.keys(data, KEYS["dh"], "answer.dh.")
    rows = data.get("rows")
    if not isinstance(rows, list) or not rows:
        raise where.fail("answer.dh.rows", rows, "a list of rows [theta, d, a, alpha]")
    read = tuple(where.texts(row, f"answer.dh.rows[{k}]", "[theta, d, a, alpha]") for k, row in enumerate(rows))
    for k, row in enumerate(read):
        if len(row) != len(COLUMNS):
            raise where.fail(f"answer.dh.rows[{k}]", list(row), "four entries: theta, d, a, alpha")
    return where.choice(data, "convention", "answer.dh."), read


def _branches(where: _Where, data: Mapping[str, Any]) -> tuple[tuple[str, ...], ...]:
    where.keys(data, KEYS["ik"], "answer.ik.")
    branches = data.get("branches")
    if not isinstance(branches, list) or not 0 < len(branches) <= MAX_BRANCHES:
        raise where.fail("answer.ik.branches", branches, f"1 to {MAX_BRANCHES} lists of formulas, one a joint")
    return tuple(
        where.texts(branch, f"answer.ik.branches[{k}]", "a list of formulas, one a joint")
        for k, branch in enumerate(branches)
    )
