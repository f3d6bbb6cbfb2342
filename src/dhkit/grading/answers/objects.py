"""Answers as other libraries' objects: sympy and CasADi expressions become syntax trees, as exact as they are."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
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
        return _entries(value, n)
    except RecursionError:
        raise AnswerError("nested too deep") from None


def _entries(value: Any, n: int) -> Any:
    library = _library(value)
    if library == "casadi":
        return _casadi_entries(value, n)
    if library == "sympy" and hasattr(value, "tolist"):
        return _squeeze(value.tolist())
    if isinstance(value, np.ndarray):
        return _entries(value.tolist(), n)
    if isinstance(value, list | tuple):
        return [_entries(entry, n) for entry in value]
    if isinstance(value, str | int | float | Fraction | np.number) or library == "sympy" or callable(value):
        return value
    raise AnswerError(f"found {type(value).__name__}; expected text, numbers, sympy, CasADi or a function")


def _library(value: object) -> str:
    """Return the package of a value's type; sympy's undefined functions have no module."""
    module = (type(value).__module__ or "").partition(".")[0]
    return module or ("sympy" if hasattr(value, "free_symbols") else "")


def is_entry(value: object) -> bool:
    """Whether :func:`entry_tree` reads a value."""
    if isinstance(value, _CasadiScalar) or _library(value) == "sympy":
        return True
    return isinstance(value, str | int | float | Fraction | Decimal | np.number) and not isinstance(value, bool)


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

            if sum(1 for _ in islice(sympy.preorder_traversal(value), BOUNDS.object_nodes + 1)) > BOUNDS.object_nodes:
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


def _casadi_entries(value: Any, n: int) -> Any:
    import casadi

    if isinstance(value, casadi.Function):
        if value.n_in() > len(_STATES) or value.n_out() != 1:
            raise AnswerError(f"{value.name()}: expected a function of (q), (q, qd) or (q, qd, qdd) with one result")
        try:
            value = value(*(casadi.SX.sym(name, n) for name in _STATES[: value.n_in()]))
        except RuntimeError as error:
            raise AnswerError(f"{value.name()}: {str(error).splitlines()[-1][:200]}") from None
    if isinstance(value, casadi.DM):
        return _squeeze(value.full().tolist())
    if not isinstance(value, casadi.SX):
        raise AnswerError(f"found casadi.{type(value).__name__}; expected SX, DM or a Function that takes SX")
    rows = [[_CasadiScalar(value[i, j]) for j in range(value.shape[1])] for i in range(value.shape[0])]
    return rows[0][0] if value.shape == (1, 1) else _squeeze(rows)


class _CasadiScalar:
    """A CasADi scalar, still unread."""

    def __init__(self, scalar: Any) -> None:
        import casadi

        self.scalar = scalar
        self.nodes = int(casadi.n_nodes(scalar))
        is_short = self.nodes <= BOUNDS.shown_casadi_nodes
        self.text = (
            str(scalar)[: BOUNDS.shown_casadi_characters] if is_short else f"a CasADi expression of {self.nodes} nodes"
        )

    def tree(self, vocabulary: Vocabulary) -> Tree:
        import casadi

        from dhkit.symbolic.programs.graph import Graph

        if self.nodes > BOUNDS.object_nodes:
            raise AnswerError(f"{self.text}; expected at most {BOUNDS.object_nodes}")
        symbols = casadi.symvar(self.scalar)
        inputs = [read_answer(name, vocabulary) for name in _counted_from_one([x.name() for x in symbols])]
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


def _counted_from_one(names: Sequence[str]) -> list[str]:
    """Return names whose numbers begin with 1: SX.sym("q", 2) has q_0 and q_1."""
    matches = [re.fullmatch(r"(\w*?)_(\d+)", name) for name in names]
    from_zero = {match[1] for match in matches if match and match[2] == "0"}
    return [
        f"{match[1]}{int(match[2]) + 1}" if match and match[1] in from_zero else name
        for name, match in zip(names, matches, strict=True)
    ]


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
