"""Values of syntax trees in doubles, over batches; nothing is ever executed."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

import numpy as np

from dhkit.description import Array
from dhkit.errors import AnswerError
from dhkit.expressions import CONSTANTS
from dhkit.expressions.syntax import Call, Name, Number, Power, Product, Sum, Tree

FUNCTIONS: Mapping[str, Callable[..., Any]] = {
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
"""Functions that an answer may call; secants and the like are read as quotients of these."""
UNITS = {name: float(constant) for name, constant in CONSTANTS.items()}
"""Values of pi, deg, mm, cm and inch, in rad and m."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """One walk over trees in some arithmetic: doubles, arrays of them, or intervals.

    A part that occurs more than once is worked out once: CasADi's graphs share parts.

    Attributes
    ----------
    values
        Values of names.
    number
        Converts a rational number.
    functions
        Functions that trees may call.
    power, divide
        Operations of the arithmetic; sums, differences and products are Python's.
    shared
        Values of the parts met so far, by their ids.
    """

    values: Mapping[str, Any]
    number: Callable[[Fraction], Any] = lambda value: np.float64(float(value))
    functions: Mapping[str, Callable[..., Any]] = field(default_factory=lambda: FUNCTIONS)
    power: Callable[[Any, Any], Any] = operator.pow
    divide: Callable[[Any, Any], Any] = operator.truediv
    shared: dict[int, Any] = field(default_factory=dict)

    def of(self, tree: Tree) -> Any:
        """Return the value of a tree.

        Raises
        ------
        AnswerError
            A name without value, or an unknown function.
        """
        if id(tree) not in self.shared:
            self.shared[id(tree)] = self._value(tree)
        return self.shared[id(tree)]

    def _value(self, tree: Tree) -> Any:
        match tree:
            case Number(value=value):
                return self.number(value)
            case Name(text):
                if text not in self.values:
                    raise AnswerError(f"{text} has no value")
                return self.values[text]
            case Call(function, arguments):
                if function not in self.functions:
                    raise AnswerError(f"unknown function {function!r}; known are {', '.join(self.functions)}")
                return self.functions[function](*map(self.of, arguments))
            case Power(base, exponent):
                return self.power(self.of(base), self.of(exponent))
            case Sum(terms):
                total = self.number(Fraction(0))
                for added, term in terms:
                    total = total + self.of(term) if added else total - self.of(term)
                return total
            case Product(factors):
                product = self.number(Fraction(1))
                for is_factor, factor in factors:
                    value = self.of(factor)
                    product = product * value if is_factor else self.divide(product, value)
                return product


def doubles(tree: Tree, values: Mapping[str, Any]) -> Any:
    """Return the value of a tree as a double, or as an array (...) of them; NaN or infinite where it has none.

    Parameters
    ----------
    tree
        An answer as :func:`dhkit.grading.answers.read_answer` reads it.
    values
        Doubles or arrays (...) by name, SI units and rad; ``pi`` and units need not be given.

    Raises
    ------
    AnswerError
        A name without value, or an unknown function.
    """
    return EditedDoubles(tree, values).numbers


class EditedDoubles:
    """Values of trees that differ from one tree in a few places; the parts they share are worked out once.

    Parameters
    ----------
    tree
        The first tree.
    values
        Doubles or arrays (...) by name, as for :func:`doubles`.
    """

    def __init__(self, tree: Tree, values: Mapping[str, Any]) -> None:
        # Python's own floats would raise where NumPy's give infinity.
        arrays = {name: np.asarray(value, dtype=float)[()] for name, value in {**UNITS, **values}.items()}
        self._evaluation = Evaluation(arrays)
        self._tree = tree  # keeps its parts alive, whose ids are used
        with np.errstate(all="ignore"):
            self.numbers = self._evaluation.of(tree)

    def of(self, edited: Tree) -> Any:
        """Return the value, a double or an array (...), of a tree that shares parts with the first one."""
        evaluation = replace(self._evaluation, shared=dict(self._evaluation.shared))
        with np.errstate(all="ignore"):
            return evaluation.of(edited)


def general_state(n: int) -> dict[str, float]:
    """Return values of q1 ... qn, qd1 ... and qdd1 ... in general position, SI units and rad."""
    turns = np.random.default_rng(11).uniform(-1.5, 1.5, (3, n))
    return {f"{kind}{i + 1}": float(turns[k, i]) for k, kind in enumerate(("q", "qd", "qdd")) for i in range(n)}


def state_arrays(state: Mapping[str, float], n: int) -> tuple[Array, Array, Array]:
    """Return q, qd and qdd, shape (n,) each, of a state given by name, SI units and rad."""
    q, qd, qdd = (np.array([state[f"{kind}{i + 1}"] for i in range(n)]) for kind in ("q", "qd", "qdd"))
    return q, qd, qdd


def names_of(tree: Tree) -> set[str]:
    """Return the names that occur in a tree."""
    return {part.text for part in parts_of(tree) if isinstance(part, Name)}


def parts_of(tree: Tree, coefficients: bool = False) -> Iterator[Tree]:
    """Yield every node of a tree once, also those that CasADi's graphs share.

    Parameters
    ----------
    tree
        Any tree.
    coefficients
        Whether to leave out arguments of functions and exponents.
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
