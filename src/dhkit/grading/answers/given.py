"""Answers as they are judged: entry by entry, each with its text and its syntax tree."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dhkit.description import Description
from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Tree
from dhkit.grading.answers.documents.statements import Statement, has_relation, statements_of
from dhkit.grading.answers.indices import first_index
from dhkit.grading.answers.matrices import read_matrix
from dhkit.grading.answers.objects import entry_tree, is_entry
from dhkit.grading.answers.pretty import is_pretty
from dhkit.grading.answers.quantity_names import QuantityNames, Target
from dhkit.grading.answers.reading import meaning_of
from dhkit.grading.answers.sheet import AnswerSheet, Chain, Entries, Refusal
from dhkit.grading.answers.tokens import shown
from dhkit.grading.answers.vocabulary import Vocabulary, plain_name

LEFT_EMPTY = "left empty"
KINETIC = frozenset(("T", "Ek", "Ec", "Ekin"))
"""Other names of the kinetic energy; T is a quantity of its own too."""
BRACKETED = re.compile(r"\s*(?:\w+\s*(?:\([^()]*\))?\s*=)?\s*(?:\[|⎡|\{\s*\{|\w*[Mm]atrix|\w+\.|\\begin|sym\()")
"""How the one entry of a matrix begins that stands in brackets."""
POSE_NAMES = ("px", "py", "pz", *(f"r{i}{j}" for i in "123" for j in "123"))
"""The tool's pose in the world, which inverse kinematics start from: its origin, m, and its rotation by rows."""


@dataclass(frozen=True, eq=False)
class Given:
    """One entry of an answer.

    Attributes
    ----------
    index
        Where it stands, from 0.
    text
        As it was typed.
    tree
        What it was read as; None where it could not be, or is missing.
    error
        Why it could not be read.
    earlier
        The other formulas of a statement ``V = a = b``, of which ``tree`` is the last.
    is_partly_read
        Whether a formula before the last could not be read, and was not held against it.
    """

    index: tuple[int, ...]
    text: str
    tree: Tree | None = None
    error: str = ""
    earlier: tuple[Tree, ...] = ()
    is_partly_read: bool = False

    @property
    def is_missing(self) -> bool:
        """Whether the entry was not handed in."""
        return self.tree is None and self.error == LEFT_EMPTY


def vocabulary_of(
    description: Description, sheet: AnswerSheet, sums: Sequence[Sequence[int]] = (), inverse: bool = False
) -> Vocabulary:
    """Return what names mean on a sheet.

    Raises
    ------
    AnswerError
        A name that stands for two things, or one made of names that the robot does not have.
    """
    further = POSE_NAMES if inverse else ()
    names = sheet.names
    vocabulary = Vocabulary(description, q=names.q, qd=names.qd, qdd=names.qdd, sums=sums, further=further)
    written = _texts([sheet.answers, sheet.table, sheet.branches, names.parameters])
    vocabulary.first_index = first_index(written, vocabulary)
    if vocabulary.first_index is None and sheet.file.endswith((".py", ".ipynb")):
        vocabulary.first_index = 0
    for name, text in names.parameters.items():
        if isinstance(text, Refusal):
            vocabulary.refuse(name, f"its own assignment is not read: {text.reason}")
            continue
        try:
            meaning = meaning_of(text, vocabulary)
            (vocabulary.redefine if names.lenient else vocabulary.define)(name, meaning)
        except AnswerError as error:
            if not names.lenient:
                raise AnswerError(f"names.parameters: {shown(name)}: {error}") from None
            vocabulary.refuse(name, f"its own assignment is not read: {error}")
    return vocabulary


def _texts(value: Any) -> Iterator[str]:
    """Yield every text in nested answers."""
    match value:
        case str():
            yield value
        case Chain():
            yield from value.formulas
        case Entries():
            yield from _texts(value.texts)
        case Mapping():
            yield from _texts(list(value.values()))
        case list() | tuple():
            for inner in value:
                yield from _texts(inner)


def given_quantity(
    name: str, value: Any, shape: tuple[int, ...], vocabulary: Vocabulary, names: QuantityNames
) -> tuple[Given, ...]:
    """Return all entries of a quantity, those that were not handed in among them.

    Parameters
    ----------
    name
        Which. Of M an entry that is missing is taken from the other half.
    value
        Text, a number, or lists of them; a matrix may stand in one text; :class:`~dhkit.grading.answers.sheet.Entries`.
    shape
        What is expected.
    vocabulary
        What names mean.
    names
        Which names stand in front of an answer: ``tau_1 = ...``.

    Raises
    ------
    AnswerError
        Another shape, or no text.
    """
    if isinstance(value, Refusal):
        raise AnswerError(f"{name}: {value.reason}; files are read, not run: state it in one formula")
    if isinstance(value, str) and shape:
        value = _system(name, value, names)
    if isinstance(value, Chain):
        return _chained([given_quantity(name, formula, shape, vocabulary, names) for formula in value.formulas])
    if isinstance(value, str) and math.prod(shape) != 1:
        given = _from_one_text(name, _without_head(name, value), shape, vocabulary)
    elif isinstance(value, Entries):
        given = _from_entries(name, value, shape, vocabulary, names)
    elif isinstance(value, str) and (not shape or not BRACKETED.match(value)):
        given = (_entry(Target(name, (0,) * len(shape)), value, vocabulary, names),)
    elif isinstance(value, str):
        given = _from_one_text(name, _without_head(name, value), shape, vocabulary)
    else:
        flat = _flat(name, value, shape, ())
        given = tuple(_entry(Target(name, index), text, vocabulary, names) for index, text in flat)
    return _mirrored(given) if name == "M" else given


def with_entries_gathered(answers: Mapping[str, Any], names: QuantityNames) -> dict[str, Any]:
    """Return answers by quantity: those that name one entry (``M11``, ``g_2``) gathered in :class:`Entries`.

    Raises
    ------
    AnswerError
        A quantity that is given whole and by its entries, or a name that two entries may have.
    """
    gathered: dict[str, Any] = {}
    entries: dict[str, dict[tuple[int, ...], Any]] = {}
    for name, value in answers.items():
        targets = [] if names.quantity(name) else names.entries(name)
        if len(targets) > 1:
            raise AnswerError(f"{name}: may be {' or '.join(map(str, targets))}; write M_1_12 or M_11_2")
        if targets and targets[0].index is not None:
            own = entries.setdefault(targets[0].quantity, {})
            if targets[0].index in own:
                raise AnswerError(f"{name}: {targets[0]} is given twice; expected each entry once")
            own[targets[0].index] = value
        else:
            gathered[name] = value
    for quantity, texts in entries.items():
        if quantity in gathered:
            raise AnswerError(f"{quantity}: given whole and entry by entry; expected one of them")
        gathered[quantity] = Entries(texts)
    return gathered


SYSTEM = re.compile(
    r"\\begin\s*\{(?:cases|align|aligned|alignat|split|gather|gathered|eqnarray|IEEEeqnarray|multline)\*?\}"
)
"""Environments whose rows are statements."""


def _system(name: str, text: str, names: QuantityNames) -> str | Chain | Entries:
    """Return the entries that a system of equations in one text states; the text itself where it is none."""
    if not SYSTEM.search(text):
        return text
    found: dict[tuple[int, ...], str | Chain] = {}
    for statement in statements_of(text):
        if statement.problem:
            raise AnswerError(f"{name}: {statement.problem}: {shown(statement.text)}")
        for target in statement.targets:
            if names.quantity(target) == name:
                return _formulas(statement)
            places = [one.index for one in names.entries(target) if one.quantity == name]
            if len(places) != 1 or places[0] is None:
                raise AnswerError(f"{name}: {shown(target)} is none of its entries")
            found[places[0]] = _formulas(statement)
    return Entries(found) if found else text


def _formulas(statement: Statement) -> str | Chain:
    formulas = statement.formulas
    return formulas[0] if len(formulas) == 1 else Chain(formulas)


def _stated(target: Target, text: str, names: QuantityNames) -> str | Chain:
    """Return an entry's formula without the name in front of it: tau_1 = ..., G(q) = ...; a chain of several.

    Raises
    ------
    AnswerError
        Several statements, or one about something else.
    """
    if not (SYSTEM.search(text) or has_relation(text)):
        return text
    statements = statements_of(text, "")
    if len(statements) != 1 or statements[0].problem:
        problem = statements[0].problem if len(statements) == 1 else f"{len(statements)} statements"
        raise AnswerError(f"{shown(text)}: {problem}; expected one formula")
    (statement,) = statements
    if not statement.formulas:
        return text
    if not statement.targets:
        raise AnswerError(f"{shown(text)}: begins with {shown(statement.formulas[0])}, which is no name of {target}")
    for name in statement.targets:
        if not _may_stand_for(name, target, names):
            raise AnswerError(f"{shown(text)}: states {name}, and stands where {target} is expected")
    return _formulas(statement)


def _may_stand_for(name: str, target: Target, names: QuantityNames) -> bool:
    """Whether a name may stand in front of an entry: its own, its quantity's, or one that means nothing else."""
    if name in KINETIC:
        return target.quantity == "K"
    entries = names.entries(name)
    if target in entries or names.quantity(name) == target.quantity:
        return True
    letters = name.rstrip("0123456789_")
    is_taken = bool(entries or names.quantity(name) or names.quantity(letters)) or names.is_parameter(name)
    return not (is_taken or names.vocabulary.knows(name))


def _from_entries(
    name: str, value: Entries, shape: tuple[int, ...], vocabulary: Vocabulary, names: QuantityNames
) -> tuple[Given, ...]:
    """Return a quantity's entries of those that were given one by one."""
    places = list(np.ndindex(shape))
    for index in value.texts:
        if index not in places:
            raise AnswerError(
                f"{name}: found {Target(name, index)}; expected {' x '.join(map(str, shape))} entries, counted from 1"
            )
    return tuple(_entry(Target(name, index), value.texts.get(index, ""), vocabulary, names) for index in places)


def _entry(target: Target, value: Any, vocabulary: Vocabulary, names: QuantityNames) -> Given:
    index = target.index or ()
    if isinstance(value, Refusal):
        return Given(index, "", error=f"{value.reason}; files are read, not run: state it in one formula")
    if isinstance(value, str):
        try:
            value = _stated(target, value, names)
        except AnswerError as error:
            return Given(index, value[:1000], error=str(error))
    if isinstance(value, Chain):
        (given,) = _chained([(_read(index, formula, vocabulary),) for formula in value.formulas])
        return given
    return _read(index, value, vocabulary)


def _chained(sides: Sequence[Sequence[Given]]) -> tuple[Given, ...]:
    """Return the entries of a chain's last side, each with those of the sides before it that can be read.

    K = q'^T M q'/2 = ... begins with a side that is no formula of the robot's names; the last side is the answer.
    """
    found = []
    for *earlier, last in zip(*sides, strict=True):
        trees = tuple(entry.tree for entry in earlier if entry.tree is not None)
        found.append(replace(last, earlier=trees, is_partly_read=len(trees) < len(earlier)))
    return tuple(found)


def _mirrored(given: Sequence[Given]) -> tuple[Given, ...]:
    """Return the entries of a symmetric matrix: those that are missing from the other half."""
    by_index = {entry.index: entry for entry in given}

    def filled(entry: Given) -> Given:
        other = by_index[entry.index[::-1]]
        return replace(other, index=entry.index) if entry.is_missing and not other.is_missing else entry

    return tuple(map(filled, given))


def _without_head(name: str, text: str) -> str:
    """Take M = and M(q) = away from in front of M."""
    head, equals, rest = text.partition("=")
    own = plain_name(re.sub(r"\(.*", "", head.strip(), flags=re.DOTALL))
    return rest.rstrip().removesuffix(";") if equals and own == name and not rest.startswith("=") else text


def given_rows(rows: Sequence[Sequence[str]], n: int, vocabulary: Vocabulary) -> list[tuple[Given, ...]]:
    """Return the entries of a table.

    Raises
    ------
    AnswerError
        Another number of rows.
    """
    if len(rows) != n:
        raise AnswerError(f"dh: found {len(rows)} rows; expected {n}, one a joint")
    return [tuple(_read((i, k), text, vocabulary) for k, text in enumerate(row)) for i, row in enumerate(rows)]


def given_branches(branches: Sequence[Sequence[str]], n: int, vocabulary: Vocabulary) -> list[tuple[Given, ...]]:
    """Return the formulas of inverse kinematics.

    Raises
    ------
    AnswerError
        Another number of formulas in a branch.
    """
    for k, branch in enumerate(branches):
        if len(branch) != n:
            raise AnswerError(f"ik: branch {k + 1}: found {len(branch)} formulas; expected {n}, one a joint")
    return [
        tuple(_read((k, i), text, vocabulary) for i, text in enumerate(branch)) for k, branch in enumerate(branches)
    ]


def _left_empty(value: Any) -> bool:
    return isinstance(value, str) and not value.strip()


def _read(index: tuple[int, ...], value: Any, vocabulary: Vocabulary) -> Given:
    if _left_empty(value):
        return Given(index, "", error=LEFT_EMPTY)
    try:
        if isinstance(value, str) and not is_pretty(value):  # whose first line's spaces count
            value = value.strip().rstrip(";,")
        return Given(index, *entry_tree(value, vocabulary))
    except AnswerError as error:
        shown_text = value if isinstance(value, str) else f"{type(value).__name__} object"
        return Given(index, shown_text[:1000], error=str(error))


def _flat(name: str, value: Any, shape: tuple[int, ...], index: tuple[int, ...]) -> list[tuple[tuple[int, ...], Any]]:
    if not shape:
        while isinstance(value, list) and len(value) == 1:
            (value,) = value
        if not is_entry(value):
            raise AnswerError(
                f"{_place(name, index)}: found {_kind(value)}; expected an expression in quotes, or a number"
            )
        return [(index, value)]
    if not isinstance(value, list) or len(value) != shape[0]:
        raise AnswerError(f"{_place(name, index)}: found {_kind(value)}; expected a list of {shape[0]}")
    return [entry for k, part in enumerate(value) for entry in _flat(name, part, shape[1:], (*index, k))]


def _kind(value: Any) -> str:
    if isinstance(value, list):
        return f"a list of {len(value)}"
    return "a table" if isinstance(value, Mapping) else str(value)[:40] or "nothing"


def _place(name: str, index: tuple[int, ...]) -> str:
    return name + "".join(f"[{k}]" for k in index)


def _from_one_text(name: str, text: str, shape: tuple[int, ...], vocabulary: Vocabulary) -> tuple[Given, ...]:
    try:
        rows = read_matrix(text, vocabulary)
    except AnswerError as error:
        raise AnswerError(f"{name}: {error}") from None
    if len(shape) == 1:
        listed = rows[0] if len(rows) == 1 else [entry for row in rows for entry in row]
        if len(listed) != shape[0]:
            raise AnswerError(f"{name}: found {len(listed)} entries; expected {shape[0]}")
        return tuple(Given((k,), written, tree) for k, (written, tree) in enumerate(listed))
    found = (len(rows), len(rows[0]) if rows else 0)
    if len(rows) != shape[0] or any(len(row) != shape[1] for row in rows):
        raise AnswerError(f"{name}: found {found[0]} rows of {found[1]}; expected {shape[0]} of {shape[1]}")
    return tuple(Given((i, j), *entry) for i, row in enumerate(rows) for j, entry in enumerate(row))
