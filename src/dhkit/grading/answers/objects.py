"""Answers as other libraries' objects: sympy and CasADi expressions become syntax trees, as exact as they are."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterator, Sequence
from decimal import Decimal
from fractions import Fraction
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from dhkit.errors import AnswerError
from dhkit.expressions.syntax import Call, Number, Power, Sum, Tree
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.derivatives import product, quotient
from dhkit.grading.answers.reading import read_answer
from dhkit.grading.answers.vocabulary import Vocabulary

if TYPE_CHECKING:
    from dhkit.symbolic.programs.graph import Node

_STATES = ("q", "qd", "qdd")


def entries_of(value: object, n: int) -> object:
    """Return an object's entries as nested lists of what :func:`entry_tree` reads; text and callables stay.

    Parameters
    ----------
    value
        Text, numbers, lists, NumPy arrays, sympy expressions or matrices, CasADi expressions or functions of
        (q), (q, qd) or (q, qd, qdd).
    n
        The number of joints.

    Raises
    ------
    AnswerError
        An object of another kind.
    """
    try:
        return _entries(value, n, frozenset(_casadi_names(value)))
    except RecursionError:
        raise AnswerError("nested too deep") from None


def _entries(value: Any, n: int, names: frozenset[str]) -> Any:
    """Return an object's entries; ``names`` are those of all symbols of CasADi in the whole answer."""
    library = _library(value)
    if library == "casadi":
        return _casadi_entries(value, n, names)
    if library == "sympy" and hasattr(value, "tolist"):
        return _squeeze(value.tolist())
    if isinstance(value, np.ndarray):
        return _entries(value.tolist(), n, names)
    if isinstance(value, list | tuple):
        return [_entries(entry, n, names) for entry in value]
    if (
        isinstance(value, str | int | float | Fraction | np.number)
        or library == "sympy"
        or callable(value)
    ):
        return value
    raise AnswerError(
        f"found {type(value).__name__}; expected text, numbers, sympy, CasADi or a function"
    )


def _library(value: object) -> str:
    """Return the package of a value's type; sympy's undefined functions have no module."""
    module = (type(value).__module__ or "").partition(".")[0]
    return module or ("sympy" if hasattr(value, "free_symbols") else "")


def is_entry(value: object) -> bool:
    """Whether :func:`entry_tree` reads a value."""
    if isinstance(value, _CasadiScalar) or _library(value) == "sympy":
        return True
    return isinstance(value, str | int | float | Fraction | Decimal | np.number) and not isinstance(
        value, bool
    )


def entry_tree(value: object, vocabulary: Vocabulary) -> tuple[str, Tree]:
    """Return an entry's text and its syntax tree.

    Raises
    ------
    AnswerError
        No expression, or an unknown name.
    """
    if isinstance(value, _CasadiScalar):
        return value.text, value.tree(vocabulary)
    if isinstance(value, float | np.floating):
        return str(value), _decimal(float(value))
    text = _text(value)
    return text, read_answer(text, vocabulary)


def _text(value: object) -> str:
    """Return the printed text of a value.

    Raises
    ------
    AnswerError
        It is too large to be printed.
    """
    try:
        if _library(value) == "sympy":
            import sympy

            if (
                sum(1 for _ in islice(sympy.preorder_traversal(value), BOUNDS.object_nodes + 1))
                > BOUNDS.object_nodes
            ):
                raise AnswerError(f"an expression of more than {BOUNDS.object_nodes} nodes")
        return str(value)
    except (RecursionError, ValueError):  # of integers of thousands of digits
        raise AnswerError("nested too deep, or a number too long") from None


def _decimal(value: float) -> Tree:
    """Return a double as its decimal of 15 digits: further digits come from arithmetic in doubles.

    Raises
    ------
    AnswerError
        Not finite.
    """
    if not math.isfinite(value):
        raise AnswerError(f"{value} is not a number")
    text = f"{abs(value):.15g}"
    number = Number(Fraction(text), text, 0)
    return number if value >= 0 else Sum(((False, number),))


def _squeeze(rows: list[Any]) -> list[Any]:
    """Return a column's or a row's entries in one list."""
    if len(rows) == 1 and isinstance(rows[0], list):
        return list(rows[0])
    is_column = all(isinstance(row, list) and len(row) == 1 for row in rows)
    return [row[0] for row in rows] if is_column else rows


# CasADi

_NUMBERED = re.compile(r"(\w*?)_(\d{1,4})", re.ASCII)
"""Name of a numbered symbol, such as q_0 of SX.sym("q", 2)."""


def _casadi_names(value: Any) -> Iterator[str]:
    """Yield the names of all symbols of CasADi in an object, or in lists and arrays of them."""
    if isinstance(value, np.ndarray) and value.dtype == object:
        value = value.tolist()
    if isinstance(value, list | tuple):
        for entry in value:
            yield from _casadi_names(entry)
    elif _library(value) == "casadi" and type(value).__name__ == "SX":
        import casadi

        yield from (symbol.name() for symbol in casadi.symvar(value))


def _casadi_entries(value: Any, n: int, names: frozenset[str]) -> Any:
    import casadi

    if isinstance(value, casadi.Function):
        if not 1 <= value.n_in() <= len(_STATES) or value.n_out() != 1:
            raise AnswerError(
                f"{value.name()}: expected a function of (q), (q, qd) or (q, qd, qdd) with one result"
            )
        try:
            states = []
            for name in _STATES[: value.n_in()]:
                symbols = [casadi.SX.sym(f"{name}{i}") for i in range(1, n + 1)]
                states.append(casadi.vertcat(*symbols))
            value = value(*states)
        except RuntimeError as error:
            raise AnswerError(f"{value.name()}: {str(error).splitlines()[-1][:200]}") from None
    if isinstance(value, casadi.DM):
        return _squeeze(value.full().tolist())
    if not isinstance(value, casadi.SX):
        raise AnswerError(
            f"found casadi.{type(value).__name__}; expected SX, DM or a Function that takes SX"
        )
    m, n_columns = value.shape
    rows = []
    for i in range(m):
        row = [_CasadiScalar(value[i, j], names) for j in range(n_columns)]
        rows.append(row)
    return rows[0][0] if value.shape == (1, 1) else _squeeze(rows)


class _CasadiScalar:
    """A CasADi scalar, still unread, with the names of all symbols of the answer that it is an entry of."""

    def __init__(self, scalar: Any, names: frozenset[str]) -> None:
        import casadi

        self.scalar = scalar
        self.names = names
        self.nodes = int(casadi.n_nodes(scalar))
        is_short = self.nodes <= BOUNDS.shown_casadi_nodes
        self.text = (
            str(scalar)[: BOUNDS.shown_casadi_characters]
            if is_short
            else f"a CasADi expression of {self.nodes} nodes"
        )

    def tree(self, vocabulary: Vocabulary) -> Tree:
        import casadi

        from dhkit.symbolic.programs.graph import Graph

        if self.nodes > BOUNDS.object_nodes:
            raise AnswerError(f"{self.text}; expected at most {BOUNDS.object_nodes}")
        symbols = casadi.symvar(self.scalar)
        inputs = [
            read_answer(_counted_from_one(x.name(), self.names, vocabulary), vocabulary)
            for x in symbols
        ]
        try:
            inside = {"x": casadi.SX(casadi.vertcat(*symbols))} if symbols else {}
            graph = Graph.of("answer", inside, {"y": self.scalar})
        except ValueError as error:
            raise AnswerError(f"{self.text[:60]!r}: {error}") from None
        trees: list[Tree] = []
        for node in graph.nodes:
            arguments = [] if node.operation == "input" else [trees[k] for k in node.arguments]
            trees.append(_tree_of(node, arguments, inputs))
        return trees[graph.results[0][0]]


def _counted_from_one(name: str, names: Collection[str], vocabulary: Vocabulary) -> str:
    """Return a symbol's name with a number that counts from 1.

    The entries of ``SX.sym("q", 2)`` are called q_0 and q_1. A number counts from 0 if the answer has a symbol q_0, and
    from 1 if it has q_n of an arm of n joints.

    Raises
    ------
    AnswerError
        A joint's variable that may count from 0 or from 1.
    """
    match = _NUMBERED.fullmatch(name)
    if match is None:
        return name
    prefix, number = match[1], int(match[2])
    numbers = {
        int(other[2]) for other in map(_NUMBERED.fullmatch, names) if other and other[1] == prefix
    }
    if 0 in numbers:
        return f"{prefix}{number + 1}"
    n = len(vocabulary.kinds)
    if number < n and n not in numbers and vocabulary.is_state(name):
        raise AnswerError(
            f"{name} may be joint {number} or, as an entry of SX.sym({prefix!r}, {n}), joint {number + 1}: expected "
            f"symbols named {prefix}1 to {prefix}{n}"
        )
    return name


_TREES: dict[str, Callable[..., Tree]] = {
    "negate": lambda a: Sum(((False, a),)),
    "add": lambda a, b: Sum(((True, a), (True, b))),
    "subtract": lambda a, b: Sum(((True, a), (False, b))),
    "multiply": product,
    "divide": quotient,
    "power": lambda a, b: Power(a, b, 0),
}
"""Trees of operations of their arguments' trees."""

FUNCTIONS = {name: name for name in ("sqrt", "sin", "cos", "sign", "atan2")} | dict(
    absolute="abs", minimum="min", maximum="max"
)
"""Names of operations that are functions."""


def _tree_of(node: Node, arguments: Sequence[Tree], inputs: Sequence[Tree]) -> Tree:
    operation = node.operation
    if operation == "constant":
        return _decimal(node.value)
    if operation == "input":
        return inputs[node.arguments[1]]
    if operation in _TREES:
        return _TREES[operation](*arguments)
    if operation in FUNCTIONS:
        return Call(FUNCTIONS[operation], tuple(arguments), 0)
    raise AnswerError(f"CasADi's {operation} is not read")
