"""The doubles that a syntax tree stands for, over batches; nothing is ever executed."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from dhkit.description import Array
from dhkit.errors import AnswerError
from dhkit.expressions import CONSTANTS
from dhkit.expressions.syntax import Call, Name, Number, Power, Product, Sum, Tree

FUNCTIONS = ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sqrt", "abs", "sign", "exp", "min", "max")
"""What an answer may call; secants and the like are read as quotients of these."""

_NUMPY: Mapping[str, Callable[..., Any]] = {
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "atan2": np.arctan2,
    "sqrt": np.sqrt,
    "abs": np.abs,
    "sign": np.sign,
    "exp": np.exp,
    "min": np.minimum,
    "max": np.maximum,
}


_UNITS = {name: float(constant) for name, constant in CONSTANTS.items()}
"""pi, deg, mm, cm and inch."""


def doubles(tree: Tree, values: Mapping[str, Any]) -> Any:
    """Return the number, or array (...), that a tree stands for; NaN or infinite where it has no value.

    Parameters
    ----------
    tree
        An answer as :func:`dhkit.grading.answers.read_answer` reads it.
    values
        Doubles or arrays by name; ``pi`` need not be given.

    Raises
    ------
    AnswerError
        A name without value, or a function that is not known.
    """
    with np.errstate(all="ignore"):
        # Floats of Python's own would raise where NumPy's give infinity.
        arrays = {name: np.asarray(value, dtype=float)[()] for name, value in {**_UNITS, **values}.items()}
        return _Evaluation(arrays).of(tree)


class EditedDoubles:
    """The numbers of trees that differ from one tree in a place or two: what they share is worked out once.

    Parameters
    ----------
    tree
        What is changed later.
    values
        Doubles or arrays by name, as for :func:`doubles`.
    """

    def __init__(self, tree: Tree, values: Mapping[str, Any]) -> None:
        arrays = {name: np.asarray(value, dtype=float)[()] for name, value in {**_UNITS, **values}.items()}
        self._evaluation = _Evaluation(arrays)
        self._tree = tree  # keeps the parts alive, which are known by their ids
        with np.errstate(all="ignore"):
            self.numbers = self._evaluation.of(tree)

    def of(self, edited: Tree) -> Any:
        """Return the number, or array (...), of a tree that shares parts with the first one."""
        evaluation = _Evaluation(self._evaluation.values)
        evaluation.shared = dict(self._evaluation.shared)
        with np.errstate(all="ignore"):
            return evaluation.of(edited)


def general_state(n: int) -> dict[str, float]:
    """Return a state in general position, by name."""
    turns = np.random.default_rng(11).uniform(-1.5, 1.5, (3, n))
    return {f"{kind}{i + 1}": float(turns[k, i]) for k, kind in enumerate(("q", "qd", "qdd")) for i in range(n)}


def state_arrays(state: Mapping[str, float], n: int) -> tuple[Array, Array, Array]:
    """Return q, qd and qdd, shape (n,) each, of a state by name."""
    q, qd, qdd = (np.array([state[f"{kind}{i + 1}"] for i in range(n)]) for kind in ("q", "qd", "qdd"))
    return q, qd, qdd


def names_of(tree: Tree) -> set[str]:
    """Return the names that occur in a tree."""
    return {part.text for part in parts_of(tree) if isinstance(part, Name)}


def parts_of(tree: Tree, coefficients: bool = False) -> Iterator[Tree]:
    """Yield every node of a tree once: CasADi's graphs share what is used twice.

    Parameters
    ----------
    tree
        Any.
    coefficients
        Whether arguments of functions and exponents are left out.
    """
    seen: set[int] = set()
    left = [tree]
    while left:
        part = left.pop()
        if id(part) in seen:
            continue
        seen.add(id(part))
        yield part
        match part:
            case Sum(terms) | Product(terms):
                left += [term for _, term in terms]
            case Power(base, exponent):
                left += [base] if coefficients else [base, exponent]
            case Call(_, arguments):
                left += () if coefficients else arguments


class _Evaluation:
    """One walk over a tree."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self.values = values
        self.shared: dict[int, Any] = {}

    def of(self, tree: Tree) -> Any:
        # CasADi's graphs share what is used twice.
        if id(tree) not in self.shared:
            self.shared[id(tree)] = self._value(tree)
        return self.shared[id(tree)]

    def _value(self, tree: Tree) -> Any:
        match tree:
            case Number(value=value):
                return np.float64(float(value))
            case Name(text):
                if text not in self.values:
                    raise AnswerError(f"{text} has no value")
                return self.values[text]
            case Call(function, arguments):
                if function not in _NUMPY:
                    raise AnswerError(f"unknown function {function!r}; known are {', '.join(FUNCTIONS)}")
                return _NUMPY[function](*(self.of(argument) for argument in arguments))
            case Power(base, exponent):
                return operator.pow(self.of(base), self.of(exponent))
            case Sum(terms):
                total: Any = np.float64(0)
                for added, term in terms:
                    total = total + self.of(term) if added else total - self.of(term)
                return total
            case Product(factors):
                product: Any = np.float64(1)
                for multiplied, factor in factors:
                    value = self.of(factor)
                    product = product * value if multiplied else product / value
                return product
