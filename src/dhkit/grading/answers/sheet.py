"""Answer sheets: TOML with a robot, the student's names, and answers as text; read, checked, never evaluated."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Mapping, Sequence
from decimal import Decimal
from pathlib import Path
from typing import TypeVar

from dhkit.description.files import read_bounded
from dhkit.description.toml_text import toml_document
from dhkit.errors import AnswerError, DescriptionError
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.sheet_values import (
    AnswerSheet,
    Entries,
    EqualFormulas,
    InverseStep,
    Names,
    Refusal,
    Requirements,
)

T = TypeVar("T")

FORMAT = 1
"""Version of the format of answer sheets."""


KEYS = {
    "sheet": ("format", "robot", "student", "names", "task", "answer", "rubric"),
    "task file": ("format", "robot", "names", "task", "rubric", "variants"),
    "names": ("q", "qd", "qdd", "angles", "parameters", "state"),
    "task": (
        "friction",
        "total_derivative",
        "asked",
        "proof",
        "frames",
        "zero",
        "values",
        "J_rows",
        "execute",
        "packages",
    ),
    "dh": ("convention", "rows"),
    "ik": ("branches", "steps"),
    "step": ("joint", "equation", "solution"),
}
"""Keys that a document, and each table in it, may have. No key stands in two tables with two meanings."""

RUBRIC_KEYS = ("points", "weights", "credit", "digits", "feedback", "late")
"""Keys of the table of a rubric, which :class:`dhkit.grading.rubric.Rubric` reads."""

VARIANT_KEYS = ("parameters", "robots", "conventions", "payload", "digits")
"""Keys of a task's table of variants, which :class:`dhkit.grading.variants.Variants` reads."""

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

JACOBIAN_ROWS = ("vx", "vy", "vz", "wx", "wy", "wz")
"""Names of the rows of the Jacobian: linear velocities along the world's axes, then angular ones about them."""

QUANTITY = re.compile(r"M|C|h|g|tau|K|V|L|T|J|dh|ik|A[1-9][0-9]?")
"""Names of quantities."""

_PACKAGE = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,60}", re.ASCII)
"""Name of a package."""

ALIASES = dict(
    D="M", G="g", KE="K", PE="V", U="V", P="V", Tau="tau", N="g", Jac="J", Lagrangian="L"
)
"""Other names of quantities."""


def source_sheet(
    file: str,
    n: int,
    answers: Mapping[str, str | EqualFormulas | Entries | Refusal],
    parameters: Mapping[str, str | Refusal],
    notes: Sequence[str],
    left_out: Sequence[str],
) -> AnswerSheet:
    """Return the answers of a program or a document as a sheet.

    Parameters
    ----------
    file
        Beginning of messages.
    n
        The number of joints.
    answers
        Answers by quantity.
    parameters
        The file's own names that the answers are made of, each after those that it needs.
    notes, left_out
        As in :class:`AnswerSheet`.

    Raises
    ------
    AnswerError
        No answers.
    """
    if not answers:
        known = ", ".join(quantity_names(n)[:8])
        left = f"; left out: {left_out[0]}" if left_out else ""
        raise AnswerError(f"{file}: assigns no quantity; expected some of {known}, A1, T, J{left}")
    return AnswerSheet(
        names=Names(parameters=parameters, lenient=True),
        answers=answers,
        file=file,
        notes=tuple(notes),
        left_out=tuple(left_out[: BOUNDS.listed_statements]),
    )


def read_text(path: Path, expected: str) -> str:
    """Return a file's text; ``expected`` is the kind of file, for messages.

    Raises
    ------
    AnswerError
        A file that cannot be read, is too long, or is not UTF-8.
    """
    try:
        return read_bounded(path, BOUNDS.sheet_bytes, expected).decode("utf-8-sig")
    except DescriptionError as error:
        raise AnswerError(str(error)) from None
    except UnicodeDecodeError as error:
        raise AnswerError(f"{path}: not UTF-8 at byte {error.start}") from None


def read_sheet(path: Path) -> AnswerSheet:
    """Read an answer sheet.

    Raises
    ------
    AnswerError
        A file that cannot be read, or is not an answer sheet; with file, key, value found and value expected.
    """
    return _read(path, "an answer sheet", lambda data: sheet_of(data, str(path)))


def read_task(path: Path) -> AnswerSheet:
    """Read an instructor's task: a sheet without answers, with robot, [task], [names] and [rubric].

    Raises
    ------
    AnswerError
        A file that cannot be read, or is not a task; with file, key, value found and value expected.
    """
    return _read(path, "a task", lambda data: _sheet(data, _Checker(str(path)), KEYS["task file"]))


def _read(
    path: Path, expected: str, sheet_from: Callable[[Mapping[str, object]], AnswerSheet]
) -> AnswerSheet:
    text = read_text(path, expected)
    try:
        return sheet_from(toml_document(text))
    except DescriptionError as error:
        raise AnswerError(f"{path}: {error}") from None
    except RecursionError:
        raise AnswerError(f"{path}: nested too deep") from None


def quantity_names(n: int) -> list[str]:
    """Return the names of the quantities that an arm of n joints may be asked for."""
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


def sheet_of(data: Mapping[str, object], file: str = "answers") -> AnswerSheet:
    """Return the answer sheet that a TOML document is.

    Raises
    ------
    AnswerError
        It is none; with the key, the value found and the value expected.
    """
    checker = _Checker(file)
    sheet = _sheet(data, checker, KEYS["sheet"])
    if not checker.table(data, "answer", ""):
        raise AnswerError(f"{file}: no answers; expected a table [answer] with M, g, tau or others")
    return sheet


def _sheet(data: Mapping[str, object], checker: _Checker, known: Sequence[str]) -> AnswerSheet:
    """Return the sheet of a document, which may have the known keys."""
    checker.keys(data, known, "")
    if data.get("format", FORMAT) != FORMAT:
        raise checker.error("format", data["format"], str(FORMAT))
    answers = checker.table(data, "answer", "")
    names = checker.table(data, "names", "")
    task = checker.table(data, "task", "")
    table = checker.table(answers, "dh", "answer.")
    inverse = checker.table(answers, "ik", "answer.")
    return AnswerSheet(
        checker.text(data, "robot", ""),
        _names(checker, names),
        _requirements(checker, task),
        {name: value for name, value in answers.items() if name not in ("dh", "ik")},
        _table(checker, table) if "dh" in answers else None,
        _branches(checker, inverse) if "ik" in answers and "steps" not in inverse else (),
        _steps(checker, inverse) if "steps" in inverse else (),
        checker.table(data, "rubric", ""),
        checker.text(data, "student", ""),
        checker.file,
        variants=checker.table(data, "variants", ""),
    )


class _Checker:
    """Reads entries of a document; messages begin with the file and the key."""

    def __init__(self, file: str) -> None:
        self.file = file

    def error(self, key: str, value: object, expected: str) -> AnswerError:
        text = str(value) if isinstance(value, Decimal) else repr(value)
        if isinstance(value, Mapping):
            text = "a table"
        elif len(text) > 60:
            text = text[:57] + "..."
        return AnswerError(f"{self.file}: {key}: found {text}; expected {expected}")

    def keys(self, table: Mapping[str, object], known: Sequence[str], prefix: str) -> None:
        for key in table:
            if key not in known:
                close = difflib.get_close_matches(key, known, n=1)
                hint = f"did you mean {close[0]!r}?" if close else f"expected {', '.join(known)}"
                if key in RUBRIC_KEYS:
                    place = f"[rubric.{key}]" if isinstance(table[key], Mapping) else "[rubric]"
                    hint = f"it belongs to the rubric: expected it in {place}"
                raise AnswerError(f"{self.file}: unknown key {prefix}{key[:60]!r}; {hint}")

    def _value(
        self, data: Mapping[str, object], key: str, prefix: str, default: T, expected: str
    ) -> T:
        """Return the value of a key, of the same type as the default."""
        value = data.get(key, default)
        if not isinstance(value, type(default)):
            raise self.error(prefix + key, value, expected)
        return value

    def table(self, data: Mapping[str, object], key: str, prefix: str) -> Mapping[str, object]:
        value = data.get(key, {})
        if not isinstance(value, Mapping):
            raise self.error(prefix + key, value, "a table")
        return value

    def text(self, data: Mapping[str, object], key: str, prefix: str) -> str:
        return self._value(data, key, prefix, "", "text in quotes")

    def switch(self, data: Mapping[str, object], key: str, prefix: str) -> bool:
        return self._value(data, key, prefix, False, "true or false")

    def texts(self, value: object, key: str, expected: str) -> tuple[str, ...]:
        if not isinstance(value, list) or not all(_is_entry(x) for x in value):
            raise self.error(key, value, expected)
        return tuple(str(x) for x in value)

    def choice(self, data: Mapping[str, object], key: str, prefix: str) -> str:
        known = CHOICES[key]
        value = data.get(key, known[0])
        if value not in known:
            raise self.error(prefix + key, value, " or ".join(map(repr, known)))
        return str(value)


def _is_entry(value: object) -> bool:
    return isinstance(value, str | int | float | Decimal) and not isinstance(value, bool)


def _names(checker: _Checker, data: Mapping[str, object]) -> Names:
    checker.keys(data, KEYS["names"], "names.")
    parameters = checker.table(data, "parameters", "names.")
    if len(parameters) > BOUNDS.names:
        raise checker.error(
            "names.parameters", f"{len(parameters)} names", f"at most {BOUNDS.names}"
        )
    for name, value in parameters.items():
        if not _is_entry(value):
            raise checker.error(
                f"names.parameters: {name[:40]!r}", value, "an expression in the robot's parameters"
            )
    q, qd, qdd = (
        checker.texts(data.get(key, []), f"names.{key}", "a list of names, one a joint")
        for key in ("q", "qd", "qdd")
    )
    absolute = checker.choice(data, "angles", "names.") == "absolute"
    state = tuple(
        part.strip() for part in checker.text(data, "state", "names.").split(",") if part.strip()
    )
    if not all(map(str.isidentifier, state)):
        raise checker.error(
            "names.state", data["state"], 'names in the order of a state vector, such as "q, qd"'
        )
    further = {name: str(value) for name, value in parameters.items()}
    return Names(q, qd, qdd, absolute, further, state)


def _requirements(checker: _Checker, data: Mapping[str, object]) -> Requirements:
    checker.keys(data, KEYS["task"], "task.")
    asked = checker.texts(
        data.get("asked", []), "task.asked", 'a list of quantities such as ["M", "g"]'
    )
    for name in asked:
        if not QUANTITY.fullmatch(name):
            raise checker.error(
                "task.asked", name, "M, C, h, g, tau, K, V, L, A1 ..., T, J, dh or ik"
            )
    rows = checker.texts(
        data.get("J_rows", []), "task.J_rows", 'a list of rows such as ["vx", "vy", "wz"]'
    )
    for k, row in enumerate(rows):
        if row not in JACOBIAN_ROWS or row in rows[:k]:
            raise checker.error("task.J_rows", row, f"each once of {', '.join(JACOBIAN_ROWS)}")
    return Requirements(
        checker.switch(data, "friction", "task."),
        checker.switch(data, "total_derivative", "task."),
        tuple(dict.fromkeys(asked)),
        checker.choice(data, "proof", "task.") == "required",
        checker.choice(data, "frames", "task.") == "given",
        checker.choice(data, "zero", "task.") == "given",
        "values" in data and not checker.switch(data, "values", "task."),
        tuple(map(JACOBIAN_ROWS.index, rows)),
        checker.switch(data, "execute", "task."),
        _packages(checker, data),
    )


def _packages(checker: _Checker, data: Mapping[str, object]) -> tuple[str, ...]:
    packages = checker.texts(
        data.get("packages", []), "task.packages", 'a list of packages such as ["numpy", "sympy"]'
    )
    for name in packages:
        if not _PACKAGE.fullmatch(name):
            raise checker.error("task.packages", name, "the name of an installed package")
    return packages


def _table(
    checker: _Checker, data: Mapping[str, object]
) -> tuple[str, tuple[tuple[str, ...], ...]] | None:
    """Return the convention and the rows of a table; None of one without rows, which is not filled in."""
    checker.keys(data, KEYS["dh"], "answer.dh.")
    if "rows" not in data:
        return None
    rows = data["rows"]
    if not isinstance(rows, list) or not rows:
        raise checker.error("answer.dh.rows", rows, "a list of rows [theta, d, a, alpha]")
    texts = tuple(
        checker.texts(row, f"answer.dh.rows[{k}]", "[theta, d, a, alpha]")
        for k, row in enumerate(rows)
    )
    for k, row in enumerate(texts):
        if len(row) != len(COLUMNS):
            raise checker.error(
                f"answer.dh.rows[{k}]", list(row), "four entries: theta, d, a, alpha"
            )
    return checker.choice(data, "convention", "answer.dh."), texts


def _steps(checker: _Checker, data: Mapping[str, object]) -> tuple[InverseStep, ...]:
    checker.keys(data, KEYS["ik"], "answer.ik.")
    if "branches" in data:
        raise checker.error("answer.ik", "both branches and steps", "one of them")
    steps = data.get("steps")
    expected = (
        f'1 to {BOUNDS.steps} steps such as {{ joint = 1, equation = "...", solution = "..." }}'
    )
    if not isinstance(steps, list) or not 0 < len(steps) <= BOUNDS.steps:
        raise checker.error("answer.ik.steps", steps, expected)
    read = [_step(checker, step, f"answer.ik.steps[{k}]", expected) for k, step in enumerate(steps)]
    return tuple(step for step in read if step.equations or step.solutions)


def _step(checker: _Checker, data: object, place: str, expected: str) -> InverseStep:
    if not isinstance(data, Mapping):
        raise checker.error(place, data, expected)
    checker.keys(data, KEYS["step"], f"{place}.")
    joint = data.get("joint")
    if not isinstance(joint, int) or isinstance(joint, bool):
        raise checker.error(f"{place}.joint", joint, "the joint's number, from 1")
    texts = []
    for key in ("equation", "solution"):
        value = data.get(key, [])
        several = checker.texts(
            value if isinstance(value, list) else [value], f"{place}.{key}", "a formula, or a list"
        )
        if len(several) > BOUNDS.steps:
            raise checker.error(
                f"{place}.{key}", f"{len(several)} formulas", f"at most {BOUNDS.steps}"
            )
        texts.append(tuple(text for text in several if text.strip()))
    if not {"equation", "solution"} & data.keys():
        raise checker.error(place, data, "an equation, a solution, or both")
    return InverseStep(joint, *texts)


def _branches(checker: _Checker, data: Mapping[str, object]) -> tuple[tuple[str, ...], ...]:
    checker.keys(data, KEYS["ik"], "answer.ik.")
    branches = data.get("branches")
    if not isinstance(branches, list) or not 0 < len(branches) <= BOUNDS.branches:
        raise checker.error(
            "answer.ik.branches", branches, f"1 to {BOUNDS.branches} lists of formulas, one a joint"
        )
    return tuple(
        checker.texts(branch, f"answer.ik.branches[{k}]", "a list of formulas, one a joint")
        for k, branch in enumerate(branches)
    )
