"""Values of syntax trees in doubles, over batches; nothing is ever executed."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from fractions import Fraction
from typing import Any

import numpy as np

from dhkit.description import Array
from dhkit.errors import AnswerError
from dhkit.expressions import CONSTANTS
from dhkit.expressions.syntax import Call, Name, Number, Power, Tree
from dhkit.expressions.trees import Algebra

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
_UNITS = {name: float(constant) for name, constant in CONSTANTS.items()}
"""Values of pi, deg, mm, cm and inch, in rad and m."""


class Evaluation(Algebra[Any]):
    """Values of trees in some arithmetic: doubles, arrays of them, or intervals.

    Parameters
    ----------
    values
        Values of names.
    number
        Converts a rational number.
    functions
        Functions that trees may call.
    power, divide
        Operations of the arithmetic; sums, differences and products are Python's.
    """

    def __init__(
        self,
        values: Mapping[str, Any],
        number: Callable[[Fraction], Any] = lambda value: np.float64(float(value)),
        functions: Mapping[str, Callable[..., Any]] | None = None,
        power: Callable[[Any, Any], Any] = operator.pow,
        divide: Callable[[Any, Any], Any] = operator.truediv,
    ) -> None:
        super().__init__()
        self.values = values
        self.functions = FUNCTIONS if functions is None else functions
        self._number = number
        self._power = power
        self._divide = divide

    def number(self, tree: Number) -> Any:
        """Return a number in the arithmetic."""
        return self._number(tree.value)

    def name(self, tree: Name) -> Any:
        """Return the value of a name.

        Raises
        ------
        AnswerError
            It has none.
        """
        if tree.text not in self.values:
            raise AnswerError(f"{tree.text} has no value")
        return self.values[tree.text]

    def call(self, tree: Call) -> Any:
        """Return the value of a call.

        Raises
        ------
        AnswerError
            An unknown function.
        """
        if tree.function not in self.functions:
            raise AnswerError(
                f"unknown function {tree.function!r}; known are {', '.join(self.functions)}"
            )
        return self.functions[tree.function](*map(self.of, tree.arguments))

    def power(self, tree: Power) -> Any:
        """Return the value of a power."""
        return self._power(self.of(tree.base), self.of(tree.exponent))

    def product(self, factors: Sequence[tuple[bool, Any]]) -> Any:
        """Return a product, from left to right."""
        product = self._number(Fraction(1))
        for is_factor, value in factors:
            product = product * value if is_factor else self._divide(product, value)
        return product

    def sum(self, terms: Sequence[tuple[bool, Any]]) -> Any:
        """Return a sum, from left to right."""
        total = self._number(Fraction(0))
        for added, value in terms:
            total = total + value if added else total - value
        return total


class _Doubles(Evaluation):
    """Values in NumPy's doubles: where Python's own floats raise, they give infinity."""

    def name(self, tree: Name) -> Any:
        return np.asarray(super().name(tree), dtype=float)[()]


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
        self._evaluation = _Doubles({**_UNITS, **values})
        self._tree = tree  # keeps its parts alive, whose ids are used
        with np.errstate(all="ignore"):
            self.numbers = self._evaluation.of(tree)

    def of(self, edited: Tree) -> Any:
        """Return the value, a double or an array (...), of a tree that shares parts with the first one."""
        evaluation = copy(self._evaluation)
        evaluation.shared = dict(self._evaluation.shared)
        with np.errstate(all="ignore"):
            return evaluation.of(edited)


def general_state(n: int) -> dict[str, float]:
    """Return values of q1 ... qn, qd1 ... and qdd1 ... in general position, SI units and rad."""
    rows = np.random.default_rng(11).uniform(-1.5, 1.5, (3, n))
    state: dict[str, float] = {}
    for kind, row in zip(("q", "qd", "qdd"), rows, strict=True):
        state |= {f"{kind}{i + 1}": float(x) for i, x in enumerate(row)}
    return state


def state_arrays(state: Mapping[str, float], n: int) -> tuple[Array, Array, Array]:
    """Return q, qd and qdd, shape (n,) each, of a state given by name, SI units and rad."""
    joints = range(1, n + 1)
    q = np.array([state[f"q{i}"] for i in joints])
    qd = np.array([state[f"qd{i}"] for i in joints])
    qdd = np.array([state[f"qdd{i}"] for i in joints])
    return q, qd, qdd
