"""Programs as straight lines of assignments: what each name is bound to, in which scope, and where."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import TypeAlias


class Use(Enum):
    """How a formula uses a name."""

    VALUE = "value"
    CALL = "call"
    MODULE = "module"
    TIME = "time"
    """As the argument t of a function of time, or the variable of a derivative by time."""


@dataclass(frozen=True)
class Read:
    """A name that a formula reads.

    Attributes
    ----------
    name
        The name.
    start, end
        Where it stands in the formula's text, its index or member included.
    index
        From 0, of ``M[0, 1]`` or ``q(1)``; None without one.
    member
        Of ``p.m2`` and ``p["m2"]``.
    use
        How it is used.
    """

    name: str
    start: int
    end: int
    index: tuple[int, ...] | None = None
    member: str = ""
    use: Use = Use.VALUE


@dataclass(frozen=True)
class Formula:
    """The right-hand side of an assignment.

    Attributes
    ----------
    text
        As typed, in one line and without comments, wrappers that change nothing, and spelling that only programs have.
    reads
        Names in it, in order.
    entries
        Of a matrix or a vector in brackets, its entries by index from 0; None of a scalar.
    is_zeros
        Whether it is a matrix of zeros, to be filled.
    number
        Its value, of a plain number or a quotient of two.
    problem
        Why it cannot be read; empty where it can.
    """

    text: str
    reads: tuple[Read, ...] = ()
    entries: Mapping[tuple[int, ...], Formula] | None = None
    is_zeros: bool = False
    number: float | None = None
    problem: str = ""

    @property
    def is_matrix(self) -> bool:
        """Whether it is written in brackets, or is a matrix of zeros."""
        return self.is_zeros or self.entries is not None


@dataclass(frozen=True)
class Symbol:
    """A symbol, an argument of a function, or one by time: a name that stands for itself.

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
class FunctionNamed:
    """A function of a library: sin, sqrt, simplify.

    Attributes
    ----------
    name
        Its name in the library.
    """

    name: str


@dataclass(frozen=True)
class ModuleNamed:
    """A module.

    Attributes
    ----------
    name
        Its own name: numpy.
    """

    name: str


@dataclass(frozen=True)
class NotUnderstood:
    """A binding, or a change, that is not read.

    Attributes
    ----------
    reason
        What it is, with its line.
    only_matrices
        Whether it can change matrices and lists alone, such as a call: numbers and expressions are immutable.
    """

    reason: str
    only_matrices: bool = False


@dataclass(frozen=True)
class Default:
    """The default of a function's argument, which stands where a call leaves the argument out.

    Attributes
    ----------
    formula
        The default.
    has_fields
        Whether it is a structure whose fields are bound one by one.
    """

    formula: Formula
    has_fields: bool = False


STRUCTURE = "structure"
"""Module that stands for a structure, whose fields are assigned one by one: p.m1 = 2."""

Value: TypeAlias = Formula | Symbol | FunctionNamed | ModuleNamed | NotUnderstood | Default


@dataclass(frozen=True)
class Binding:
    """One assignment to a name, or to an entry of it.

    Attributes
    ----------
    line
        Where it stands, as messages say it: ``line 3``, ``cell 2, line 3``.
    place
        Counts the program's bindings; what is read at a place was bound at a smaller one.
    value
        What is assigned.
    index
        From 0, of an entry; None of the whole.
    is_added
        Whether the value is added to the entry: ``+=``.
    """

    line: str
    place: int
    value: Value
    index: tuple[int, ...] | None = None
    is_added: bool = False


@dataclass(frozen=True)
class Returned:
    """What a function returns.

    Attributes
    ----------
    function
        The function's name.
    local
        The local name that it returns; ``return`` where it returns a formula.
    is_only
        Whether it returns nothing else.
    names
        Names in a formula that it returns.
    """

    function: str
    local: str
    is_only: bool = True
    names: tuple[str, ...] = ()


@dataclass
class Scope:
    """Names of the whole program, or of one function.

    Attributes
    ----------
    bindings
        By name, in the order of the program.
    outer
        Where names are looked up that this scope does not bind: the program, of a function of Python's.
    returned
        What the function returns.
    """

    bindings: dict[str, list[Binding]] = field(default_factory=dict)
    outer: Scope | None = None
    returned: list[Returned] = field(default_factory=list)

    def bind(self, name: str, binding: Binding) -> None:
        """Add a binding."""
        self.bindings.setdefault(name, []).append(binding)

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
    notes
        What a reader should know, with lines.
    place
        The number of bindings so far.
    """

    main: Scope = field(default_factory=Scope)
    functions: list[Scope] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    place: int = 0

    def bind(
        self,
        scope: Scope,
        name: str,
        line: str,
        value: Value,
        index: tuple[int, ...] | None = None,
        is_added: bool = False,
    ) -> None:
        """Add a binding at the next place."""
        self.place += 1
        scope.bind(name, Binding(line, self.place, value, index, is_added))
