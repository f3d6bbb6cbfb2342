"""Answers as they are judged: entry by entry, each with its text and its syntax tree."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any, TypeAlias

import numpy as np

from dhkit.description import Description
from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Tree
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.documents.entry_statements import statements_of
from dhkit.grading.answers.documents.latex_statements import has_relation
from dhkit.grading.answers.documents.statements import Statement
from dhkit.grading.answers.indices import first_index
from dhkit.grading.answers.matrices import read_matrix
from dhkit.grading.answers.matrix_algebra import MatrixOf, is_algebra, no_names, read_algebra
from dhkit.grading.answers.objects import entry_tree, is_entry
from dhkit.grading.answers.pose_entries import other_names, with_pose_entries
from dhkit.grading.answers.pretty import is_pretty
from dhkit.grading.answers.quantity_names import QuantityNames, Target
from dhkit.grading.answers.reading import meaning_of
from dhkit.grading.answers.sheet_values import AnswerSheet, Entries, EqualFormulas, Refusal
from dhkit.grading.answers.tokens import quote
from dhkit.grading.answers.vocabulary import Vocabulary, plain_name
from dhkit.symbolic import table_lengths

LEFT_EMPTY = "left empty"
"""Error of an entry that was not handed in."""


_KINETIC = frozenset(("T", "Ek", "Ec", "Ekin"))
"""Other names of the kinetic energy; T is a quantity of its own too."""

_BRACKETED = re.compile(
    r"\s*(?:\w+\s*(?:\([^()]*\))?\s*=)?\s*(?:\[|⎡|\{\s*\{|\w*[Mm]atrix|\w+\.|\\begin|sym\()"
)
"""Beginning of a matrix in brackets, as the one entry of a quantity."""

_SYSTEM = re.compile(
    r"\\begin\s*\{(?:cases|align|aligned|alignat|split|gather|gathered|eqnarray|IEEEeqnarray|multline)\*?\}"
)
"""Environments whose rows are statements."""

POSE_NAMES = ("px", "py", "pz", "r11", "r12", "r13", "r21", "r22", "r23", "r31", "r32", "r33")
"""Names of the tool's pose in the world, the data of inverse kinematics: its origin, m, and its rotation by rows."""

Answer: TypeAlias = object
"""Text, a number, lists of them, :class:`Entries`, :class:`EqualFormulas` or :class:`Refusal`; or an expression of a
library."""


@dataclass(frozen=True, eq=False)
class Given:
    """One entry of an answer.

    Attributes
    ----------
    index
        Its index in the quantity, from 0; () of a scalar.
    text
        As it was typed.
    tree
        Its syntax tree; None where it could not be read, or is missing.
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
    description: Description,
    sheet: AnswerSheet,
    sums: Sequence[Sequence[int]] = (),
    inverse: bool = False,
) -> Vocabulary:
    """Return the meanings of names on a sheet.

    Parameters
    ----------
    description
        The robot.
    sheet
        The sheet.
    sums
        As for :class:`~dhkit.grading.answers.vocabulary.Vocabulary`.
    inverse
        Whether answers may use the names of the tool's pose, as inverse kinematics do.

    Raises
    ------
    AnswerError
        A name that stands for two things, or one made of names that the robot does not have.
    """
    further = (*POSE_NAMES, *table_lengths(description)) if inverse else ()
    names = sheet.names
    vocabulary = Vocabulary(
        description, q=names.q, qd=names.qd, qdd=names.qdd, sums=sums, further=further
    )
    steps = [[*step.equations, *step.solutions] for step in sheet.steps]
    texts = _texts([sheet.answers, sheet.table, sheet.branches, steps, names.parameters])
    vocabulary.first_index = first_index(texts, vocabulary)
    if vocabulary.first_index is None and sheet.file.endswith((".py", ".ipynb")):
        vocabulary.first_index = 0
    if inverse:
        vocabulary.define_aliases(other_names())
    for name, text in names.parameters.items():
        try:
            if isinstance(text, Refusal):
                raise AnswerError(text.reason)
            define = vocabulary.redefine if names.lenient else vocabulary.define
            define(name, meaning_of(text, vocabulary))
        except AnswerError as error:
            is_of_the_pose = not inverse and (sheet.steps or sheet.branches)
            if not names.lenient and not is_of_the_pose:
                raise AnswerError(f"names.parameters: {quote(name)}: {error}") from None
            vocabulary.refuse(name, f"its own assignment is not read: {error}")
    return vocabulary


def _texts(value: object) -> Iterator[str]:
    """Yield every text in nested answers."""
    match value:
        case str():
            yield value
        case EqualFormulas():
            yield from value.formulas
        case Entries():
            yield from _texts(value.texts)
        case Mapping():
            yield from _texts(list(value.values()))
        case list() | tuple():
            for inner in value:
                yield from _texts(inner)


def given_quantity(
    name: str,
    value: Answer,
    shape: tuple[int, ...],
    vocabulary: Vocabulary,
    names: QuantityNames,
    matrix_of: MatrixOf = no_names,
) -> tuple[Given, ...]:
    """Return all entries of a quantity, those that were not handed in among them.

    Parameters
    ----------
    name
        The quantity. Of M an entry that is missing is taken from the other half.
    value
        The answer; a matrix may stand in one text.
    shape
        Shape of the quantity: (n, n), (n,), () of a scalar.
    vocabulary
        Meanings of names.
    names
        Which names stand in front of an answer: ``tau_1 = ...``.
    matrix_of
        Which names stand for matrices: other answers of the sheet.

    Raises
    ------
    AnswerError
        Another shape, or no text.
    """
    if isinstance(value, Refusal):
        raise AnswerError(f"{name}: {_refused(value)}")
    if isinstance(value, str) and shape:
        value = _system(name, value, names)
    if isinstance(value, EqualFormulas):
        return _chained(
            [
                given_quantity(name, formula, shape, vocabulary, names, matrix_of)
                for formula in value.formulas
            ]
        )
    places = list(np.ndindex(shape))
    entries: Iterable[tuple[tuple[int, ...], Answer]]
    if isinstance(value, Entries):
        for index in value.texts:
            if index not in places:
                size = " x ".join(map(str, shape))
                raise AnswerError(
                    f"{name}: found {Target(name, index)}; expected {size} entries, counted from 1"
                )
        entries = [(index, value.texts.get(index, "")) for index in places]
    elif isinstance(value, str) and shape and (len(places) != 1 or _BRACKETED.match(value)):
        given = _from_one_text(name, _without_head(name, value), shape, vocabulary, matrix_of)
        return _mirrored(given) if name == "M" else given
    elif isinstance(value, str) and is_algebra(_without_head(name, value), vocabulary, matrix_of):
        return _from_one_text(name, _without_head(name, value), shape, vocabulary, matrix_of)
    else:
        entries = [(places[0], value)] if isinstance(value, str) else _flat(name, value, shape, ())
    given = tuple(_entry(Target(name, index), text, vocabulary, names) for index, text in entries)
    return _mirrored(given) if name == "M" else given


def with_entries_gathered(answers: Mapping[str, Answer], names: QuantityNames) -> dict[str, Answer]:
    """Return answers by quantity: those that name one entry (``M11``, ``g_2``) gathered in :class:`Entries`.

    Raises
    ------
    AnswerError
        A quantity that is given whole and by its entries, or a name that two entries may have.
    """
    gathered: dict[str, Answer] = {}
    entries: dict[str, dict[tuple[int, ...], Any]] = {}
    for name, value in answers.items():
        targets = [] if names.quantity(name) else names.entries(name)
        if len(targets) > 1:
            raise AnswerError(
                f"{name}: may be {' or '.join(map(str, targets))}; write M_1_12 or M_11_2"
            )
        if not targets or targets[0].index is None:
            gathered[name] = value
            continue
        own = entries.setdefault(targets[0].quantity, {})
        if targets[0].index in own:
            raise AnswerError(f"{name}: {targets[0]} is given twice; expected each entry once")
        own[targets[0].index] = value
    for quantity, texts in entries.items():
        if quantity in gathered:
            raise AnswerError(f"{quantity}: given whole and entry by entry; expected one of them")
        gathered[quantity] = Entries(texts)
    return gathered


def _refused(refusal: Refusal) -> str:
    return f"{refusal.reason}{f'; {refusal.advice}' if refusal.advice else ''}"


# Statements


def _system(name: str, text: str, names: QuantityNames) -> str | EqualFormulas | Entries:
    """Return the entries that a system of equations in one text states; the text itself where it is none."""
    if not _SYSTEM.search(text):
        return text
    entries: dict[tuple[int, ...], str | EqualFormulas | Refusal] = {}
    for statement in statements_of(text):
        if statement.problem:
            raise AnswerError(f"{name}: {statement.problem}: {quote(statement.text)}")
        for target in statement.targets:
            if names.quantity(target) == name:
                return _formulas(statement)
            places = [one.index for one in names.entries(target) if one.quantity == name]
            if len(places) != 1 or places[0] is None:
                raise AnswerError(f"{name}: {quote(target)} is none of its entries")
            entries[places[0]] = _formulas(statement)
    return Entries(entries) if entries else text


def _formulas(statement: Statement) -> str | EqualFormulas:
    return (
        statement.formulas[0] if len(statement.formulas) == 1 else EqualFormulas(statement.formulas)
    )


def _without_name(target: Target, text: str, names: QuantityNames) -> str | EqualFormulas:
    """Return an entry's formula without the name in front of it: tau_1 = ..., G(q) = ...; a chain of several.

    Raises
    ------
    AnswerError
        Several statements, or one about something else.
    """
    if not (_SYSTEM.search(text) or has_relation(text)):
        return text
    statements = statements_of(text, "")
    if len(statements) != 1 or statements[0].problem:
        problem = statements[0].problem if len(statements) == 1 else f"{len(statements)} statements"
        raise AnswerError(f"{quote(text)}: {problem}; expected one formula")
    (statement,) = statements
    if not statement.formulas:
        return text
    if not statement.targets:
        raise AnswerError(
            f"{quote(text)}: begins with {quote(statement.formulas[0])}, which is not a name of {target}"
        )
    for name in statement.targets:
        if not _may_stand_for(name, target, names):
            raise AnswerError(
                f"{quote(text)}: states {name}, and stands where {target} is expected"
            )
    return _formulas(statement)


def _may_stand_for(name: str, target: Target, names: QuantityNames) -> bool:
    """Whether a name may stand in front of an entry: its own, its quantity's, or one that means nothing else."""
    if name in _KINETIC:
        return target.quantity == "K"
    entries = names.entries(name)
    if target in entries or names.quantity(name) == target.quantity:
        return True
    letters = name.rstrip("0123456789_")
    is_taken = bool(
        entries or names.quantity(name) or names.quantity(letters)
    ) or names.is_parameter(name)
    return not (is_taken or names.vocabulary.knows(name))


def _without_head(name: str, text: str) -> str:
    """Take M = and M(q) = away from in front of M."""
    head, equals, rest = text.partition("=")
    own = plain_name(re.sub(r"\(.*", "", head.strip(), flags=re.DOTALL))
    return (
        rest.rstrip().removesuffix(";")
        if equals and own == name and not rest.startswith("=")
        else text
    )


# Entries


def _entry(target: Target, value: Answer, vocabulary: Vocabulary, names: QuantityNames) -> Given:
    index = target.index or ()
    if isinstance(value, Refusal):
        return Given(index, "", error=_refused(value))
    if isinstance(value, str):
        try:
            value = _without_name(target, value, names)
        except AnswerError as error:
            return Given(index, str(value)[: BOUNDS.unread_characters], error=str(error))
    if isinstance(value, EqualFormulas):
        (given,) = _chained([(_read(index, formula, vocabulary),) for formula in value.formulas])
        return given
    return _read(index, value, vocabulary)


def _chained(sides: Sequence[Sequence[Given]]) -> tuple[Given, ...]:
    """Return the entries of a chain's last side, each with those of the sides before it that can be read.

    K = q'^T M q'/2 = ... begins with a side that is not a formula of the robot's names; the last side is the answer.
    """
    chained = []
    for *earlier, last in zip(*sides, strict=True):
        trees = tuple(entry.tree for entry in earlier if entry.tree is not None)
        chained.append(replace(last, earlier=trees, is_partly_read=len(trees) < len(earlier)))
    return tuple(chained)


def _mirrored(given: Sequence[Given]) -> tuple[Given, ...]:
    """Return the entries of a symmetric matrix: those that are missing from the other half."""
    by_index = {entry.index: entry for entry in given}
    other_half = [by_index[entry.index[::-1]] for entry in given]
    mirrored = []
    for entry, other in zip(given, other_half, strict=True):
        if entry.is_missing and not other.is_missing:
            mirrored.append(replace(other, index=entry.index))
        else:
            mirrored.append(entry)
    return tuple(mirrored)


def given_rows(
    rows: Sequence[Sequence[str]], n: int, vocabulary: Vocabulary
) -> list[tuple[Given, ...]]:
    """Return the entries of a table of n rows, each with four entries.

    Raises
    ------
    AnswerError
        Another number of rows.
    """
    if len(rows) != n:
        raise AnswerError(f"dh: found {len(rows)} rows; expected {n}, one a joint")
    return _given_lists(rows, vocabulary)


def given_branches(
    branches: Sequence[Sequence[str]], n: int, vocabulary: Vocabulary
) -> list[tuple[Given, ...]]:
    """Return the formulas of inverse kinematics, n for each branch.

    Raises
    ------
    AnswerError
        Another number of formulas in a branch.
    """
    for k, branch in enumerate(branches, start=1):
        if len(branch) != n:
            raise AnswerError(
                f"ik: branch {k}: found {len(branch)} formulas; expected {n}, one a joint"
            )
    named_branches = []
    for branch in branches:
        named = [with_pose_entries(text, vocabulary) for text in branch]
        named_branches.append(named)
    return _given_lists(named_branches, vocabulary)


def _given_lists(lists: Sequence[Sequence[str]], vocabulary: Vocabulary) -> list[tuple[Given, ...]]:
    given = []
    for i, texts in enumerate(lists):
        entries = tuple(_read((i, k), text, vocabulary) for k, text in enumerate(texts))
        given.append(entries)
    return given


def _read(index: tuple[int, ...], value: Answer, vocabulary: Vocabulary) -> Given:
    if isinstance(value, str) and not value.strip():
        return Given(index, "", error=LEFT_EMPTY)
    try:
        # In which the spaces of the first line count.
        if isinstance(value, str) and not is_pretty(value):
            value = value.strip().rstrip(";,")
        return Given(index, *entry_tree(value, vocabulary))
    except AnswerError as error:
        text = value if isinstance(value, str) else f"{type(value).__name__} object"
        return Given(index, text[: BOUNDS.unread_characters], error=str(error))


def _flat(
    name: str, value: Answer, shape: tuple[int, ...], index: tuple[int, ...]
) -> list[tuple[tuple[int, ...], Answer]]:
    """Return the entries of nested lists, each with its index from 0."""
    if not shape:
        while isinstance(value, list) and len(value) == 1:
            (value,) = value
        if is_entry(value):
            return [(index, value)]
        expected = "an expression in quotes, or a number"
    elif isinstance(value, list) and len(value) == shape[0]:
        entries: list[tuple[tuple[int, ...], Answer]] = []
        for k, part in enumerate(value):
            entries += _flat(name, part, shape[1:], (*index, k))
        return entries
    else:
        expected = f"a list of {shape[0]}"
    kind = f"a list of {len(value)}" if isinstance(value, list) else str(value)[:40] or "nothing"
    kind = "a table" if isinstance(value, Mapping) else kind
    place = name + "".join(f"[{k}]" for k in index)
    raise AnswerError(f"{place}: found {kind}; expected {expected}")


def _from_one_text(
    name: str, text: str, shape: tuple[int, ...], vocabulary: Vocabulary, matrix_of: MatrixOf
) -> tuple[Given, ...]:
    """Return the entries of a matrix, a vector or a number that stands in one text, of one matrix or of several."""
    try:
        if is_algebra(text, vocabulary, matrix_of):
            # An entry of a product has no text of its own: each is shown as the whole formula.
            shown = text.strip()[: BOUNDS.unread_characters]
            rows = []
            for trees in read_algebra(text, vocabulary, matrix_of):
                row = [(shown, tree) for tree in trees]
                rows.append(row)
        else:
            rows = read_matrix(text, vocabulary)
    except AnswerError as error:
        raise AnswerError(f"{name}: {error}") from None
    places = list(np.ndindex(shape))
    found = f"found {len(rows)} rows of {len(rows[0]) if rows else 0}"
    if len(shape) == 2 and [len(row) for row in rows] != [shape[1]] * shape[0]:
        raise AnswerError(f"{name}: {found}; expected {shape[0]} of {shape[1]}")
    entries = list(chain.from_iterable(rows))
    if len(entries) != len(places):
        expected = f"expected {len(places)} entries" if shape else "expected a number"
        raise AnswerError(
            f"{name}: {found if not shape else f'found {len(entries)} entries'}; {expected}"
        )
    return tuple(Given(place, *entry) for place, entry in zip(places, entries, strict=True))
