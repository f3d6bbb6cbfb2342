"""The numbers that a syntax tree stands for, in doubles over batches or in many digits; nothing is ever executed."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from dhkit.description import Array
from dhkit.errors import AnswerError
from dhkit.expressions import CONSTANTS
from dhkit.expressions.syntax import Call, Name, Number, Power, Product, Sum, Tree

__all__ = [
    "FUNCTIONS",
    "EditedDoubles",
    "LostDigitsError",
    "TooLargeError",
    "doubles",
    "general_state",
    "many_digits",
    "names_of",
    "parts_of",
    "state_arrays",
]

FUNCTIONS = ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sqrt", "abs", "sign", "exp", "min", "max")
"""What an answer may call; secants and the like are read as quotients of these."""

LARGEST, LARGEST_POWER = 2_000, 100_000
"""Bits: of a function's argument in many digits, and of a power."""

LARGEST_LOSS = 365
"""Bits that a sum in many digits may lose by cancellation: 110 digits of the 200 in which answers are worked out."""

Table = Mapping[str, Callable[..., Any]]


class TooLargeError(AnswerError):
    """A number that would fill the memory if it were worked out."""


class LostDigitsError(AnswerError):
    """An answer whose terms cancel so far that the digits do not tell it from another."""


_NUMPY: Table = {
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
        return _Evaluation(arrays, _NUMPY, float, np.float64).of(tree)


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
        self._evaluation = _Evaluation(arrays, _NUMPY, float, np.float64)
        self._tree = tree  # keeps the parts alive, which are known by their ids
        with np.errstate(all="ignore"):
            self.numbers = self._evaluation.of(tree)

    def of(self, edited: Tree) -> Any:
        """Return the number, or array (...), of a tree that shares parts with the first one."""
        evaluation = _Evaluation(self._evaluation.values, _NUMPY, float, np.float64)
        evaluation.shared = dict(self._evaluation.shared)
        with np.errstate(all="ignore"):
            return evaluation.of(edited)


def many_digits(tree: Tree, values: Mapping[str, Any]) -> Any:
    """Return an mpmath number in the precision that is set, complex where a root is; see :func:`doubles`.

    Raises
    ------
    AnswerError
        As for :func:`doubles`, or no finite value.
    """
    import mpmath

    table: Table = {name: _bounded(getattr(mpmath, name)) for name in FUNCTIONS if hasattr(mpmath, name)} | {
        "abs": abs,
        "min": min,
        "max": max,
    }
    units = {name: _mpmath_number(unit.rational) for name, unit in CONSTANTS.items() if unit.rational is not None}
    units |= {"pi": +mpmath.pi, "deg": mpmath.pi / 180}
    evaluation = _Evaluation({**units, **values}, table, _mpmath_number, mpmath.mpf)
    try:
        return evaluation.of(tree)
    except (ZeroDivisionError, ValueError, OverflowError, TypeError):
        raise AnswerError("no finite value") from None


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


def _mpmath_number(value: Fraction) -> Any:
    import mpmath

    return mpmath.mpf(value.numerator) / value.denominator


def _bounded(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function of mpmath that refuses numbers whose exponentials fill the memory."""
    import mpmath

    def checked(*arguments: Any) -> Any:
        if any(x and mpmath.isfinite(x) and mpmath.mag(x) > LARGEST for x in arguments):
            raise TooLargeError("a number too large to be worked out")
        return function(*arguments)

    return checked


def _bounded_power(base: Any, exponent: Any) -> Any:
    import mpmath

    for x in (base, exponent):
        if not mpmath.isfinite(x):
            raise AnswerError("no finite value")
    digits = abs(mpmath.mag(base)) * abs(exponent) if base and exponent else 0
    if digits > LARGEST_POWER or (exponent and mpmath.mag(exponent) > LARGEST):
        raise TooLargeError("a number too large to be worked out")
    return operator.pow(base, exponent)


class _Evaluation:
    """One walk over a tree."""

    def __init__(self, values: Mapping[str, Any], table: Table, number: Callable[[Fraction], Any], kind: Any) -> None:
        self.values = values
        self.table = table
        self.number = number
        self.kind = kind
        self.power = operator.pow if table is _NUMPY else _bounded_power
        self.shared: dict[int, Any] = {}
        self.has_absorbed = False
        """Whether a sum is so much larger than one of its terms that it keeps too few of the term's digits."""

    def of(self, tree: Tree) -> Any:
        # CasADi's graphs share what is used twice.
        if id(tree) not in self.shared:
            self.shared[id(tree)] = self._value(tree)
        return self.shared[id(tree)]

    def _value(self, tree: Tree) -> Any:
        match tree:
            case Number(value=value):
                return self.kind(self.number(value))
            case Name(text):
                if text not in self.values:
                    raise AnswerError(f"{text} has no value")
                return self.values[text]
            case Call(function, arguments):
                if function not in self.table:
                    raise AnswerError(f"unknown function {function!r}; known are {', '.join(FUNCTIONS)}")
                return self.table[function](*(self.of(argument) for argument in arguments))
            case Power(base, exponent):
                return self.power(self.of(base), self.of(exponent))
            case Sum(terms):
                if self.table is not _NUMPY:
                    return self._exact_sum([self.of(term) if added else -self.of(term) for added, term in terms])
                total: Any = self.kind(0)
                for added, term in terms:
                    total = total + self.of(term) if added else total - self.of(term)
                return total
            case Product(factors):
                product: Any = self.kind(1)
                for multiplied, factor in factors:
                    value = self.of(factor)
                    product = product * value if multiplied else product / value
                return product

    def _exact_sum(self, terms: list[Any]) -> Any:
        """Return a sum that is rounded once; refuse one that cancels where a sum before it had absorbed terms.

        Two precisions cannot show this alone: what is lost in both is zero in both. Terms that cancel and had absorbed
        nothing, as in x - x + y, leave y.
        """
        import mpmath

        total = mpmath.fsum(terms)
        sizes = [mpmath.mag(term) for term in terms if term and mpmath.isfinite(term)]
        if len(sizes) < 2 or not mpmath.isfinite(total):
            return total
        if self.has_absorbed and (not total or max(sizes) - mpmath.mag(total) > LARGEST_LOSS):
            raise LostDigitsError("cancels so far that its digits do not decide it")
        self.has_absorbed = self.has_absorbed or bool(total and mpmath.mag(total) - min(sizes) > LARGEST_LOSS)
        return total
