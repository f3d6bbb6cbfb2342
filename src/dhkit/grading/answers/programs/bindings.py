"""Programs as straight lines of assignments: the value, scope and line of each binding of a name."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import TypeAlias

Index: TypeAlias = tuple[int, ...]
"""Index of an entry of a matrix or vector, counted from 0 in both Python and MATLAB programs."""

MAX_INDEX = 1_000
"""Largest index, counted from 0 in Python and from 1 in MATLAB, that is read."""

MAX_ENTRIES = 1_024
"""Largest number of entries of a matrix that is read."""

MAX_STATEMENTS = 5_000
"""Largest number of statements of a program that is read."""

PLAIN_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
"""A number as Python and MATLAB both write it."""


class Use(Enum):
    """How a formula uses a name."""

    VALUE = "value"
    CALL = "call"
    MODULE = "module"
    TIME = "time"
    """As the argument t of a function of time, or as the variable of a derivative by time."""


@dataclass(frozen=True)
class Read:
    """A name that a formula reads.

    Attributes
    ----------
    name
        The name.
    start, end
        Where the name stands in the formula's text, its index or member included; both alike where it does not.
    index
        Index of the entry, from 0, in ``M[0, 1]`` or ``q(1)``; None without an index.
    member
        Field name in ``p.m2`` and ``p["m2"]``; empty without a field.
    use
        How the name is used.
    """

    name: str
    start: int
    end: int
    index: Index | None = None
    member: str = ""
    use: Use = Use.VALUE


@dataclass(frozen=True)
class Formula:
    """The right-hand side of an assignment.

    Attributes
    ----------
    text
        As typed, but in one line, without comments and ``simplify``, and without spelling that only programs have.
    reads
        Names in the text, in order.
    entries
        Entries of a matrix or a vector in brackets, by index from 0; None for a scalar.
    is_zeros
        Whether it is a matrix of zeros whose entries are assigned later.
    number
        Value of a plain number or of a quotient of two numbers; None for any other formula.
    problem
        Why the formula cannot be read; empty where it can.
    """

    text: str
    reads: tuple[Read, ...] = ()
    entries: Mapping[Index, Formula] | None = None
    is_zeros: bool = False
    number: float | None = None
    problem: str = ""

    @property
    def is_matrix(self) -> bool:
        """Whether it is written in brackets, or is a matrix of zeros."""
        return self.is_zeros or self.entries is not None

    def after_reads(self, reads: Sequence[Read]) -> Formula:
        """Return the formula with further reads in front of its own."""
        return replace(self, reads=(*reads, *self.reads)) if reads else self


def join_formulas(pieces: Sequence[str | Formula]) -> Formula:
    """Return texts and formulas side by side as one formula, with the first problem among them."""
    texts: list[str] = []
    reads: list[Read] = []
    length, problem = 0, ""
    for piece in pieces:
        text = piece if isinstance(piece, str) else piece.text
        if isinstance(piece, Formula):
            reads += [replace(read, start=read.start + length, end=read.end + length) for read in piece.reads]
            problem = problem or piece.problem
        texts.append(text)
        length += len(text)
    return Formula("".join(texts), tuple(reads), problem=problem)


def vector_of_names(names: Sequence[str], typed: Sequence[str] = ()) -> Formula:
    """Return a vector whose entries are names, for example the symbols of ``symbols('q1 q2')``.

    Parameters
    ----------
    names
        Entries of the vector.
    typed
        The entries as they are typed in the program, where that differs.
    """
    entries: dict[Index, Formula] = {(k,): Formula(name) for k, name in enumerate(names)}
    return Formula(f"[{', '.join(typed or names)}]", entries=entries)


@dataclass(frozen=True)
class Symbol:
    """A symbol, an argument of a function, or a function of time: a name that stands for itself.

    Attributes
    ----------
    name
        Name of the symbol, which may differ from the variable's.
    is_argument
        Whether it is a function's argument, which may be a structure.
    """

    name: str
    is_argument: bool = False


@dataclass(frozen=True)
class LibraryFunction:
    """A function of a library: sin, sqrt, simplify.

    Attributes
    ----------
    name
        Name of the function in the library.
    """

    name: str


@dataclass(frozen=True)
class OwnFunction:
    """A function that the program defines; two bindings of this kind are never the same function."""


@dataclass(frozen=True)
class Module:
    """An imported module.

    Attributes
    ----------
    name
        The module's own name: numpy.
    """

    name: str


@dataclass(frozen=True)
class Structure:
    """A structure of MATLAB's whose fields are assigned one by one: ``p.m1 = 2``."""


@dataclass(frozen=True)
class NotUnderstood:
    """A binding, or a change, that is not read.

    Attributes
    ----------
    reason
        What the program does there, with its line.
    only_matrices
        Whether it can change matrices and lists alone, as a call can: numbers and expressions are immutable.
    """

    reason: str
    only_matrices: bool = False


@dataclass(frozen=True)
class DefaultArgument:
    """The default of a function's argument, used where a call leaves the argument out.

    Attributes
    ----------
    formula
        The default.
    has_fields
        Whether it is a structure whose fields are bound one by one.
    """

    formula: Formula
    has_fields: bool = False


LibraryName: TypeAlias = LibraryFunction | OwnFunction | Module | Structure
"""What a name can be bound to that has no value: a function, a module or a structure."""

Value: TypeAlias = Formula | Symbol | LibraryName | NotUnderstood | DefaultArgument


@dataclass(frozen=True)
class Binding:
    """One assignment to a name, or to an entry of it.

    Attributes
    ----------
    line
        Where it stands, as messages name it: ``line 3``, ``cell 2, line 3``.
    order
        Number of the binding in program order; a formula of order k reads bindings of smaller order.
    value
        What is assigned.
    index
        Index of the entry that is assigned, from 0; None where the whole name is.
    is_added
        Whether the value is added to the entry: ``+=``.
    """

    line: str
    order: int
    value: Value
    index: Index | None = None
    is_added: bool = False

    @property
    def formula(self) -> Formula | None:
        """The value where it is a formula."""
        return self.value if isinstance(self.value, Formula) else None

    @property
    def is_argument(self) -> bool:
        """Whether it binds an argument of a function."""
        return isinstance(self.value, Symbol) and self.value.is_argument

    @property
    def is_not_understood(self) -> bool:
        """Whether it may change the name in a way that is not read, numbers and expressions included."""
        return isinstance(self.value, NotUnderstood) and not self.value.only_matrices


@dataclass(frozen=True)
class ReturnValue:
    """What a function returns.

    Attributes
    ----------
    function
        The function's name.
    local
        The local name that it returns; :data:`RETURNED_FORMULA` where it returns a formula.
    is_only
        Whether it returns nothing else.
    names
        Names in the formula that it returns.
    """

    function: str
    local: str
    is_only: bool = True
    names: tuple[str, ...] = ()


RETURNED_FORMULA = "return"
"""Local name of the formula that a function returns: a keyword, so that no variable has this name."""


@dataclass
class Scope:
    """Names of the whole program, or of one function.

    Attributes
    ----------
    bindings
        Bindings by name, in program order.
    outer
        Scope in which names are looked up that this one does not bind: the program's, for a function of Python's.
    return_values
        What the function returns.
    """

    bindings: dict[str, list[Binding]] = field(default_factory=dict)
    outer: Scope | None = None
    return_values: list[ReturnValue] = field(default_factory=list)

    def owner(self, name: str) -> Scope | None:
        """Return the scope in which a name is bound."""
        if name in self.bindings:
            return self
        return self.outer.owner(name) if self.outer is not None else None


@dataclass
class Program:
    """A program, read as bindings.

    Attributes
    ----------
    main
        Names of the program itself.
    functions
        Scopes of its functions.
    left_out
        Statements that were not understood, with their lines.
    order
        Order of the latest binding.
    """

    main: Scope = field(default_factory=Scope)
    functions: list[Scope] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    order: int = 0

    def bind(
        self, scope: Scope, name: str, line: str, value: Value, index: Index | None = None, is_added: bool = False
    ) -> None:
        """Add a binding behind all others."""
        self.order += 1
        scope.bindings.setdefault(name, []).append(Binding(line, self.order, value, index, is_added))

    def add_function(self, outer: Scope | None = None) -> Scope:
        """Add the scope of a function, and return it."""
        self.functions.append(Scope(outer=outer))
        return self.functions[-1]
