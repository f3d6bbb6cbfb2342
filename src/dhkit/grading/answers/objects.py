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
from dhkit.expressions.syntax import Call, Number, Power, Product, Sum, Tree
from dhkit.grading.answers.reading import read_answer
from dhkit.grading.answers.vocabulary import Vocabulary

if TYPE_CHECKING:
    from dhkit.symbolic.programs.graph import Node

STATES = ("q", "qd", "qdd")
MAX_NODES = 20_000
"""Of an expression: a PUMA's inverse dynamics in CasADi has 1,100."""
SHOWN = 500


def entries_of(value: Any, n: int) -> Any:
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
    module = _module(value)
    if module == "casadi":
        return _casadi_entries(value, n)
    if module == "sympy" and hasattr(value, "tolist"):
        return _squeezed(value.tolist())
    if isinstance(value, np.ndarray):
        return _entries(value.tolist(), n)
    if isinstance(value, list | tuple):
        return [_entries(entry, n) for entry in value]
    if isinstance(value, str | int | float | Fraction | np.number) or module == "sympy" or callable(value):
        return value
    raise AnswerError(f"found {type(value).__name__}; expected text, numbers, sympy, CasADi or a function")


def _module(value: Any) -> str:
    """Return which library a value is of; sympy's undefined functions have no module."""
    module = (type(value).__module__ or "").partition(".")[0]
    return module or ("sympy" if hasattr(value, "free_symbols") else "")


def is_entry(value: Any) -> bool:
    """Whether :func:`entry_tree` reads a value."""
    if isinstance(value, _Expression) or _module(value) == "sympy":
        return True
    return isinstance(value, str | int | float | Fraction | Decimal | np.number) and not isinstance(value, bool)


def entry_tree(value: Any, vocabulary: Vocabulary) -> tuple[str, Tree]:
    """Return an entry's text and its syntax tree.

    Raises
    ------
    AnswerError
        No expression, or an unknown name.
    """
    if isinstance(value, _Expression):
        return value.text, value.tree(vocabulary)
    if isinstance(value, float | np.floating) and not isinstance(value, bool):
        return str(value), _double(float(value))
    text = _text(value)
    return text, read_answer(text, vocabulary)


def _text(value: Any) -> str:
    """Return what a value prints as.

    Raises
    ------
    AnswerError
        It is too large to be printed.
    """
    if isinstance(value, str):
        return value
    try:
        if _module(value) == "sympy":
            import sympy

            if sum(1 for _ in islice(sympy.preorder_traversal(value), MAX_NODES + 1)) > MAX_NODES:
                raise AnswerError(f"an expression of more than {MAX_NODES} nodes")
        return str(value)
    except (RecursionError, ValueError):  # of integers of thousands of digits
        raise AnswerError("nested too deep, or a number too long") from None


def _double(value: float) -> Tree:
    """Return a double as the decimal of 15 digits that it is: what is beyond them came of arithmetic in doubles.

    Raises
    ------
    AnswerError
        Not finite.
    """
    if not math.isfinite(value):
        raise AnswerError(f"{value} is no number")
    text = f"{abs(value):.15g}"
    number = Number(Fraction(text), text, 0)
    return number if value >= 0 else Sum(((False, number),))


def _squeezed(rows: list[Any]) -> list[Any]:
    """Return a column's or a row's entries in one list."""
    if len(rows) == 1 and isinstance(rows[0], list):
        return list(rows[0])
    if all(isinstance(row, list) and len(row) == 1 for row in rows):
        return [row[0] for row in rows]
    return rows


# CasADi


def _casadi_entries(value: Any, n: int) -> Any:
    import casadi

    if isinstance(value, casadi.Function):
        inputs = [casadi.SX.sym(name, n) for name, _ in zip(STATES, range(value.n_in()), strict=False)]
        if value.n_in() > len(inputs) or value.n_out() != 1:
            raise AnswerError(f"{value.name()}: expected a function of (q), (q, qd) or (q, qd, qdd) with one result")
        try:
            value = value(*inputs)
        except RuntimeError as error:
            raise AnswerError(f"{value.name()}: {str(error).splitlines()[-1][:200]}") from None
    if isinstance(value, casadi.DM):
        return _squeezed(value.full().tolist())
    if not isinstance(value, casadi.SX):
        raise AnswerError(f"found casadi.{type(value).__name__}; expected SX, DM or a Function that takes SX")
    rows = [[_Expression(value[i, j]) for j in range(value.shape[1])] for i in range(value.shape[0])]
    return rows[0][0] if value.shape == (1, 1) else _squeezed(rows)


class _Expression:
    """A CasADi scalar, still unread."""

    def __init__(self, scalar: Any) -> None:
        import casadi

        self.scalar = scalar
        self.nodes = int(casadi.n_nodes(scalar))
        self.text = str(scalar)[:1000] if self.nodes <= SHOWN else f"a CasADi expression of {self.nodes} nodes"

    def tree(self, vocabulary: Vocabulary) -> Tree:
        import casadi

        from dhkit.symbolic.programs.graph import Graph

        if self.nodes > MAX_NODES:
            raise AnswerError(f"{self.text}; expected at most {MAX_NODES}")
        symbols = casadi.symvar(self.scalar)
        names = [symbol.name() for symbol in symbols]
        inputs = [read_answer(name, vocabulary) for name in _from_one(names)]
        try:
            inside = {"x": casadi.SX(casadi.vertcat(*symbols))} if symbols else {}
            graph = Graph.of("answer", inside, {"y": self.scalar})
        except ValueError as error:
            raise AnswerError(f"{self.text[:60]!r}: {error}") from None
        made: list[Tree] = []
        for node in graph.nodes:
            earlier = [] if node.operation == "input" else [made[k] for k in node.arguments]
            made.append(_node(node, earlier, inputs))
        return made[graph.results[0][0]]


def _from_one(names: Sequence[str]) -> list[str]:
    """Return names as they are counted here: SX.sym("q", 2) has q_0 and q_1."""
    from_zero = {match[1] for name in names if (match := re.fullmatch(r"(\w*?)_0", name))}
    renamed = []
    for name in names:
        match = re.fullmatch(r"(\w*?)_(\d+)", name)
        renamed.append(f"{match[1]}{int(match[2]) + 1}" if match and match[1] in from_zero else name)
    return renamed


BINARY: dict[str, Callable[[Tree, Tree], Tree]] = {
    "add": lambda a, b: Sum(((True, a), (True, b))),
    "subtract": lambda a, b: Sum(((True, a), (False, b))),
    "multiply": lambda a, b: Product(((True, a), (True, b))),
    "divide": lambda a, b: Product(((True, a), (False, b))),
    "power": lambda a, b: Power(a, b, 0),
    "atan2": lambda a, b: Call("atan2", (a, b), 0),
    "minimum": lambda a, b: Call("min", (a, b), 0),
    "maximum": lambda a, b: Call("max", (a, b), 0),
}
UNARY = {"sqrt": "sqrt", "sin": "sin", "cos": "cos", "absolute": "abs", "sign": "sign"}


def _node(node: Node, arguments: Sequence[Tree], inputs: Sequence[Tree]) -> Tree:
    operation = node.operation
    if operation == "constant":
        return _double(node.value)
    if operation == "input":
        return inputs[node.arguments[1]]
    if operation == "negate":
        return Sum(((False, arguments[0]),))
    if operation in BINARY:
        return BINARY[operation](arguments[0], arguments[1])
    if operation in UNARY:
        return Call(UNARY[operation], (arguments[0],), 0)
    raise AnswerError(f"CasADi's {operation} is not read")
