"""Values of a program that is read and not run: scalars as text, matrices of them, and what else a name can stand for.

A scalar is the text of a formula in which every name belongs to the robot or is defined beside the answers. Text is
put together by the rules of precedence, so that a formula that was typed once looks as it was typed.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from itertools import chain
from typing import Any, TypeAlias

from dhkit.grading.answers.bounds import BOUNDS

Index: TypeAlias = tuple[int, ...]
"""Index of an entry, counted from 0 in both languages."""


class UnreadError(Exception):
    """Something that is not read; the message says what, and why."""


class Level(IntEnum):
    """Binding strength of the outermost operation of a text."""

    SUM = 0
    SIGNED = 1
    """A product with a sign in front."""
    PRODUCT = 2
    POWER = 3
    ATOM = 4


@dataclass(frozen=True)
class Scalar:
    """A number or a formula.

    Attributes
    ----------
    text
        The formula.
    level
        Its outermost operation.
    number
        Value of a plain number, or of an operation with numbers alone; None for any other formula.
    uses
        Names in the text that are defined beside the answers.
    """

    text: str
    level: Level = Level.ATOM
    number: float | None = None
    uses: frozenset[str] = frozenset()

    def at_least(self, level: Level) -> str:
        """Return the text, in brackets where its operation binds less tightly."""
        return self.text if self.level >= level else f"({self.text})"

    @property
    def is_name(self) -> bool:
        """Whether it is a single name."""
        return (
            self.level is Level.ATOM
            and re.fullmatch(r"[A-Za-z]\w*", self.text, re.ASCII) is not None
        )

    @property
    def is_zero(self) -> bool:
        """Whether it is the number 0."""
        return self.number == 0


ZERO = Scalar("0", number=0.0)
ONE = Scalar("1", number=1.0)


@dataclass(frozen=True)
class Matrix:
    """A matrix, or a vector, of scalars.

    Attributes
    ----------
    entries
        Entries by index, from 0: ``(i, j)``, or ``(i,)`` of a flat vector such as numpy's.
    multiplies_entries
        Whether ``*`` multiplies entry by entry, as between numpy's arrays.
    is_zeros
        Whether it was made of zeros, whose entries are assigned later.
    is_list
        Whether it is a list or a tuple, with which Python does not calculate.
    """

    entries: Mapping[Index, Scalar]
    multiplies_entries: bool = False
    is_zeros: bool = False
    is_list: bool = False

    @property
    def is_flat(self) -> bool:
        """Whether it is a vector with one index."""
        return len(next(iter(self.entries))) == 1

    @property
    def shape(self) -> tuple[int, ...]:
        """Its numbers of rows and columns, or its length."""
        return tuple(max(place) + 1 for place in zip(*self.entries, strict=True))

    @property
    def rows(self) -> list[list[Scalar]]:
        """Its entries by rows; a flat vector is a column."""
        if self.is_flat:
            return [[self.entries[(i,)]] for i in range(self.shape[0])]
        m, n = self.shape
        return self.part(range(m), range(n))

    def part(self, rows: Iterable[int], columns: Sequence[int]) -> list[list[Scalar]]:
        """Return the entries in some rows and columns of a matrix with two indices."""
        part = []
        for i in rows:
            row = [self.entries[(i, j)] for j in columns]
            part.append(row)
        return part

    @property
    def text(self) -> str:
        """The matrix in brackets, as the reader of answers takes it."""
        if self.is_flat:
            return f"[{', '.join(entry.text for entry in self.entries.values())}]"
        row_texts = []
        for row in self.rows:
            entries = ", ".join(entry.text for entry in row)
            row_texts.append(f"[{entries}]")
        return f"[{', '.join(row_texts)}]"

    def mapped(self, change: Callable[[Scalar], Scalar]) -> Matrix:
        """Return the matrix with a function applied to each entry."""
        return replace(
            self, entries={k: change(x) for k, x in self.entries.items()}, is_zeros=False
        )


@dataclass(frozen=True)
class Given:
    """A name that stands for itself: an argument of a function, or a name that the program does not bind.

    Attributes
    ----------
    name
        The name.
    is_argument
        Whether it is a function's argument, which may be a structure or a state.
    is_symbol
        Whether the program made a symbol of this name.
    is_constant
        Whether it is a symbol that is not a function of time: its derivative by t is 0.
    number
        Which call of a function it is an argument of; 0 for none.
    uses
        Names of the program by which it goes.
    """

    name: str
    is_argument: bool = False
    is_symbol: bool = False
    is_constant: bool = False
    number: int = field(default=0, compare=False)
    uses: frozenset[str] = field(default=frozenset(), compare=False)


@dataclass(frozen=True)
class Part:
    """Entries of a vector that the robot does not have, such as the state x of an ordinary differential equation.

    Attributes
    ----------
    vector
        The vector's name.
    places
        Places of the entries, from 0.
    is_slice
        Whether it is a vector, and not a scalar.
    number
        That of the argument which the vector is.
    """

    vector: str
    places: tuple[int, ...]
    is_slice: bool = False
    number: int = 0


@dataclass(frozen=True)
class Structure:
    """A structure with fields: a dictionary, or p.m1 = 2 in MATLAB."""

    fields: Mapping[str, Value]


@dataclass(frozen=True)
class Library:
    """A function of a library, by its name there."""

    name: str


@dataclass(frozen=True)
class Module:
    """An imported module, by its own name."""

    name: str


@dataclass(frozen=True, eq=False)
class Function:
    """A function of the program.

    Attributes
    ----------
    name
        Its name.
    parameters
        Names of its arguments.
    defaults
        Values of arguments that a call may leave out.
    definition
        Its definition in the syntax of the language.
    where
        The line in which it is defined, as messages name it.
    problem
        Why it cannot be read; empty where it can.
    default_names
        Names in the defaults.
    outer
        The names among which it was defined; None for the program's.
    captured
        What other names stood for when it was made: a handle of MATLAB's.
    """

    name: str
    parameters: tuple[str, ...]
    definition: Any
    where: str
    defaults: Mapping[str, Value] = field(default_factory=dict)
    problem: str = ""
    default_names: frozenset[str] = frozenset()
    outer: Any = None
    captured: Mapping[str, Value] = field(default_factory=dict)


@dataclass(frozen=True)
class Several:
    """Results of a function with several of them, with the names of those that are local variables."""

    values: tuple[Value, ...]
    names: tuple[str, ...] = ()


@dataclass(frozen=True)
class Unread:
    """A value that is not read.

    Attributes
    ----------
    reason
        What the program does there, with its line.
    names
        Names in the expression that is not read.
    is_written_out
        Whether it is a matrix in brackets, and not a calculation.
    """

    reason: str
    names: frozenset[str] = frozenset()
    is_written_out: bool = False


@dataclass(frozen=True)
class Text:
    """A string."""

    text: str


Value: TypeAlias = (
    Scalar
    | Matrix
    | Given
    | Part
    | Structure
    | Library
    | Module
    | Function
    | Several
    | Unread
    | Text
)


# Scalars


def number(text: str) -> Scalar:
    """Return a number as it was typed."""
    return Scalar(text, number=float(text))


def joined(left: Scalar, sign: str, right: Scalar, power: str = "^") -> Scalar:
    """Return a sum, difference, product, quotient or power of two scalars; ``power`` is how powers are written."""
    match sign:
        case "+" | "-":
            level = Level.SUM
            texts = left.text, right.at_least(Level.PRODUCT)
            text = f" {sign} ".join(texts)
        case "*" | "/":
            level = Level.SIGNED if left.level is Level.SIGNED else Level.PRODUCT
            text = f"{left.at_least(Level.SIGNED)}{sign}{right.at_least(Level.POWER)}"
        case _:
            level = Level.POWER
            text = f"{left.at_least(Level.ATOM)}{power}{right.at_least(Level.ATOM)}"
    if len(text) > BOUNDS.entry_characters:
        raise UnreadError(
            f"a formula of {len(text)} characters; expected at most {BOUNDS.entry_characters}"
        )
    return Scalar(text, level, _calculated(left.number, sign, right.number), left.uses | right.uses)


def _calculated(left: float | None, sign: str, right: float | None) -> float | None:
    if left is None or right is None:
        return None
    try:
        match sign:
            case "+":
                return left + right
            case "-":
                return left - right
            case "*":
                return left * right
            case "/":
                return left / right
        result = left**right
        return result if isinstance(result, float) else None
    except ArithmeticError:
        return None


def _negated(scalar: Scalar) -> Scalar:
    """Return a scalar with a minus in front."""
    value = None if scalar.number is None else -scalar.number
    return Scalar(f"-{scalar.at_least(Level.PRODUCT)}", Level.SIGNED, value, scalar.uses)


def applied(function: str, arguments: Sequence[Scalar]) -> Scalar:
    """Return a function of scalars."""
    uses = frozenset[str]().union(*(x.uses for x in arguments))
    return Scalar(f"{function}({', '.join(x.text for x in arguments)})", uses=uses)


# Matrices


def matrix_of(rows: Sequence[Sequence[Scalar]], **options: bool) -> Matrix:
    """Return a matrix of its rows."""
    lengths = {len(row) for row in rows}
    if lengths == {0} or len(lengths) != 1:
        raise UnreadError("a matrix whose rows differ in length, or are empty, is not read")
    if len(rows) * len(rows[0]) > BOUNDS.matrix_entries:
        raise UnreadError(f"a matrix of more than {BOUNDS.matrix_entries} entries")
    entries: dict[Index, Scalar] = {}
    for i, row in enumerate(rows):
        entries |= {(i, j): entry for j, entry in enumerate(row)}
    return Matrix(entries, **options)


def row_or_column(entries: Sequence[Scalar], *, is_column: bool) -> Matrix:
    """Return a matrix of one row or one column."""
    return matrix_of([[entry] for entry in entries]) if is_column else matrix_of([entries])


def vector_of(scalars: Sequence[Scalar], **options: bool) -> Matrix:
    """Return a flat vector of its entries."""
    if not scalars or len(scalars) > BOUNDS.matrix_entries:
        raise UnreadError(f"a vector of {len(scalars)} entries is not read")
    return Matrix({(i,): x for i, x in enumerate(scalars)}, **options)


def zeros(*shape: int, multiplies_entries: bool = False) -> Matrix:
    """Return a matrix or a flat vector of zeros, whose entries are assigned later."""
    if not all(0 < k <= BOUNDS.index for k in shape) or len(shape) > 2:
        raise UnreadError("zeros of this shape are not read")
    options = {"multiplies_entries": multiplies_entries, "is_zeros": True}
    if len(shape) == 1:
        return vector_of([ZERO] * shape[0], **options)
    return matrix_of([[ZERO] * shape[1]] * shape[0], **options)


def identity(n: int, multiplies_entries: bool = False) -> Matrix:
    """Return an identity matrix."""
    if not 0 < n <= BOUNDS.index:
        raise UnreadError("an identity matrix of this size is not read")
    rows = []
    for i in range(n):
        row = [ZERO] * n
        row[i] = ONE
        rows.append(row)
    return matrix_of(rows, multiplies_entries=multiplies_entries)


def transposed(matrix: Matrix) -> Matrix:
    """Return a transpose; that of a flat vector is the vector."""
    if matrix.is_flat:
        return matrix
    return replace(
        matrix,
        entries=dict(sorted(((j, i), x) for (i, j), x in matrix.entries.items())),
        is_zeros=False,
    )


def entry_of(matrix: Matrix, index: Index) -> Scalar:
    """Return an entry; one index into a row or a column counts along it."""
    if len(index) == 1 and not matrix.is_flat and 1 in matrix.shape:
        index = (0, index[0]) if matrix.shape[0] == 1 else (index[0], 0)
    if len(index) == 2 and matrix.is_flat and index[1] == 0:
        index = index[:1]
    if index not in matrix.entries:
        raise UnreadError("an entry is read that is not assigned")
    return matrix.entries[index]


def product(left: Matrix, right: Matrix, power: str = "^") -> Matrix | Scalar:
    """Return the product of two matrices; of two flat vectors it is a scalar."""
    a = left.rows
    b = right.rows
    if left.is_flat:
        a = [[row[0] for row in a]]  # numpy: a flat vector in front is a row
    if len(a[0]) != len(b):
        raise UnreadError(
            f"a product of matrices of {len(a)} x {len(a[0])} and {len(b)} x {len(b[0])}"
        )
    if len(a) * len(b) * len(b[0]) > BOUNDS.matrix_entries:
        raise UnreadError("a product of matrices of this size is not read")
    columns = list(zip(*b, strict=True))
    rows = []
    for row in a:
        entries = [_dot(row, column, power) for column in columns]
        rows.append(entries)
    if left.is_flat and right.is_flat:
        return rows[0][0]
    multiplies_entries = left.multiplies_entries or right.multiplies_entries
    if left.is_flat or right.is_flat:
        return vector_of(list(chain.from_iterable(rows)), multiplies_entries=multiplies_entries)
    return matrix_of(rows, multiplies_entries=multiplies_entries)


def _dot(row: Sequence[Scalar], column: Sequence[Scalar], power: str) -> Scalar:
    """Return sum_k row_k column_k, without the products that are zero."""
    total: Scalar | None = None
    for a, b in zip(row, column, strict=True):
        if a.is_zero or b.is_zero:
            continue
        if a.number == 1:
            term = b
        elif b.number == 1:
            term = a
        else:
            term = joined(a, "*", b, power)
        total = term if total is None else joined(total, "+", term, power)
    return ZERO if total is None else total


def calculated(left: Value, sign: str, right: Value, power: str = "^") -> Value:
    """Return the result of an operation.

    The sign says what is meant only together with the language, which a matrix carries as ``multiplies_entries``:

    ======================  =======================  =======================
    operation               NumPy arrays (True)      MATLAB, SymPy (False)
    ======================  =======================  =======================
    product of matrices     ``A @ B``                ``A * B``
    entry by entry          ``A * B``, ``A / B``     ``A .* B``, ``A ./ B``
    with a number           ``A * s``, ``A + s``     ``A * s``; ``A + s`` is refused
    power of a matrix       refused                  ``A ^ k``
    power entry by entry    refused                  ``A .^ k``
    ======================  =======================  =======================

    Raises
    ------
    UnreadError
        A list, text or function, or an operation that the table does not have.
    """
    for side in (left, right):
        if not isinstance(side, Scalar | Matrix):
            raise UnreadError("a calculation with what is not a number or a matrix is not read")
        if isinstance(side, Matrix) and side.is_list:
            raise UnreadError("a calculation with a list is not read")
    assert isinstance(left, Scalar | Matrix) and isinstance(right, Scalar | Matrix)  # noqa: S101
    plain = sign.removeprefix(".")
    if isinstance(left, Scalar) and isinstance(right, Scalar):
        return joined(left, "*" if plain == "@" else plain, right, power)
    if isinstance(left, Matrix) and isinstance(right, Matrix):
        return _of_two_matrices(left, sign, right, power)
    if isinstance(left, Matrix) and isinstance(right, Scalar):
        if plain in ("*", "/") or (plain in ("+", "-") and left.multiplies_entries):
            return left.mapped(lambda x: joined(x, plain, right, power))
        if plain == "^" and sign == ".^":
            return left.mapped(lambda x: joined(x, "^", right, power))
        if plain == "^" and not left.multiplies_entries:
            return _power_of_matrix(left, right, power)
    is_of_entries = plain == "*" or (
        plain in ("+", "-") and getattr(right, "multiplies_entries", False)
    )
    if isinstance(left, Scalar) and isinstance(right, Matrix) and is_of_entries:
        return right.mapped(lambda x: joined(left, plain, x, power))
    raise UnreadError(f"{sign!r} between these matrices or numbers is not read")


def _of_two_matrices(left: Matrix, sign: str, right: Matrix, power: str) -> Value:
    multiplies_entries = left.multiplies_entries or right.multiplies_entries
    if sign in ("*", "/") and left.multiplies_entries != right.multiplies_entries:
        raise UnreadError(f"{sign!r} between matrices of two libraries is not read")
    if sign == "@" or (sign == "*" and not multiplies_entries):
        return product(left, right, power)
    plain = sign.removeprefix(".")
    is_by_entries = (
        sign.startswith(".") or plain in ("+", "-") or (multiplies_entries and plain in ("*", "/"))
    )
    if not is_by_entries or left.entries.keys() != right.entries.keys():
        raise UnreadError(f"{sign!r} between matrices of these sizes is not read")
    entries = {k: joined(x, plain, right.entries[k], power) for k, x in left.entries.items()}
    return Matrix(entries, multiplies_entries)


def _power_of_matrix(base: Matrix, exponent: Scalar, power: str) -> Value:
    count = exponent.number
    if count is None or count not in range(1, BOUNDS.matrix_power + 1):
        raise UnreadError("a power of a matrix that is not a small whole number")
    result: Value = base
    for _ in range(int(count) - 1):
        result = calculated(result, "@", base, power)
    return result


def opposite(value: Value) -> Value:
    """Return a value with a minus in front."""
    if isinstance(value, Scalar):
        return _negated(value)
    if isinstance(value, Matrix) and not value.is_list:
        return value.mapped(_negated)
    raise UnreadError("a minus in front of what is not a number or a matrix is not read")
