"""Linearly dependent parameters of equations of motion: found as columns of the regressor, grouped exactly."""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from itertools import combinations, islice

import numpy as np

from dhkit.description import Array
from dhkit.expressions import Expression, exact, substitute
from dhkit.symbolic.exact.lagrangian import Lagrangian
from dhkit.symbolic.ring import Element, Ring, RingError, translated
from dhkit.symbolic.ring.polynomials import Monomial

_MAX_SUPPORT = 3
"""Largest number of parameters that one depends on: a prismatic link's moment, on two moments of the link before and
a mass."""
_TRIES = 200
_DEPENDENT = 1e-9
"""A column of unit length depends on others where less than this remains of it; rounding leaves 1e-14."""


class MissingReciprocalError(Exception):
    """A parameter depends on another by a fraction whose reciprocal is not in the ring."""

    def __init__(self, reciprocal: Expression) -> None:
        super().__init__(str(reciprocal))
        self.reciprocal = reciprocal


def independent(trial: Lagrangian, definitions: Mapping[str, Element]) -> dict[str, Element]:
    """Return the independent parameters: without those of no effect, dependent ones grouped with those before them."""
    regressor = _Regressor.of(trial, list(definitions))
    merged: dict[str, Element] = {}
    basis = np.zeros((len(regressor.rows), 0))
    for name in definitions:
        column = regressor.column(name)
        if not column.any():
            continue
        rest = column / np.linalg.norm(column)
        for _ in range(2):  # the second pass removes what rounding left
            rest = rest - basis @ (basis.T @ rest)
        if np.linalg.norm(rest) > _DEPENDENT:
            merged[name] = definitions[name]
            basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
            continue
        for other, factor in regressor.grouping(name, list(merged)).items():
            merged[other] = merged[other] + definitions[name] * translated(factor, definitions[name].ring, {})
    return merged


@dataclass(frozen=True, eq=False)
class _Regressor:
    """Coefficients of the parameters in M and g, one row for each entry and each monomial in the state.

    Attributes
    ----------
    ring, names
        The ring of the coefficients, and the parameters.
    rows
        The coefficient of each parameter, an element without the state.
    numbers
        The rows' values at random lengths and angles, shape (rows, parameters).
    """

    ring: Ring
    names: Sequence[str]
    rows: Sequence[Mapping[str, Mapping[Monomial, Fraction]]]
    numbers: Array

    @classmethod
    def of(cls, trial: Lagrangian, names: Sequence[str]) -> _Regressor:
        ring = trial.arm.ring
        places = {ring.place("constant", name): name for name in names}
        of_state = [k for k, generator in enumerate(ring.generators) if generator.kind != "constant"]
        terms: dict[tuple[int, Monomial], dict[str, dict[Monomial, Fraction]]] = {}
        for i, element in enumerate([*trial.M[np.triu_indices(trial.n)], *trial.g]):
            for monomial, coefficient in element.terms.items():
                place = next(place for place in places if monomial[place])
                rest = list(monomial)
                for k in (*of_state, place):
                    rest[k] = 0
                row = terms.setdefault((i, tuple(monomial[k] for k in of_state)), {})
                row.setdefault(places[place], {})[tuple(rest)] = coefficient
        anywhere = _random_values(ring)
        numbers = np.zeros((len(terms), len(names)))
        for k, row in enumerate(terms.values()):
            for name, entry in row.items():
                numbers[k, names.index(name)] = sum(_term_value(m, c, anywhere) for m, c in entry.items())
        return cls(ring, names, list(terms.values()), numbers)

    def column(self, name: str) -> Array:
        """Return a parameter's column of :attr:`numbers`, shape (rows,)."""
        return self.numbers[:, self.names.index(name)]

    def grouping(self, name: str, kept: Sequence[str]) -> dict[str, Element]:
        """Return the exact factors with which a dependent parameter is added to earlier ones.

        The smallest set of columns that it depends on is found in numbers; the factors are quotients of determinants of
        exact entries (Cramer's rule), taken from the rows with the shortest entries.
        """
        column = self.column(name)
        for size in range(1, _MAX_SUPPORT + 1):
            for support in combinations(kept, size):
                A = np.column_stack([self.column(other) for other in support])
                factors, *_ = np.linalg.lstsq(A, column, rcond=None)
                if np.linalg.norm(A @ factors - column) <= _DEPENDENT * np.linalg.norm(column):
                    return self._factors(name, support)
        raise RingError(
            f"{name} depends on more than {_MAX_SUPPORT} parameters before it; base parameters were not found"
        )

    def _factors(self, name: str, support: Sequence[str]) -> dict[str, Element]:
        ring = self.ring
        polynomials = self.ring.polynomials
        places = [self.names.index(other) for other in support]
        touching = [k for k, row in enumerate(self.rows) if not row.keys().isdisjoint(support)]
        touching.sort(key=lambda k: sum(len(entry) for entry in self.rows[k].values()))
        fractions: tuple[list[Element], Element] | None = None
        for chosen in islice(combinations(touching, len(support)), _TRIES):
            if abs(np.linalg.det(self.numbers[np.ix_(chosen, places)])) < _DEPENDENT:
                continue
            A = [[ring.from_terms(self.rows[k].get(other, {})) for other in support] for k in chosen]
            right = [ring.from_terms(self.rows[k].get(name, {})) for k in chosen]
            whole = _determinant(A)
            parts = [
                _determinant([[*r[:j], b, *r[j + 1 :]] for r, b in zip(A, right, strict=True)]) for j in range(len(A))
            ]
            quotients = [polynomials.quotient(part.polynomial, whole.polynomial) for part in parts]
            if all(quotient is not None for quotient in quotients):
                return {other: Element(ring, x) for other, x in zip(support, quotients, strict=True)}
            fractions = fractions or (parts, whole)
        if fractions is None:
            raise RingError(f"{name} depends on {', '.join(support)}, but not exactly; base parameters were not found")
        parts, whole = fractions
        inverse = 1 / _expression(whole)
        try:
            factor = ring.read(inverse)
        except RingError:
            raise MissingReciprocalError(inverse) from None
        return {other: part * factor for other, part in zip(support, parts, strict=True)}


def _expression(element: Element) -> Expression:
    """Return an element of constants as an expression in the parameters."""
    meanings = {k: g.meaning or Expression.symbol(g.text) for k, g in enumerate(element.ring.generators)}
    return Expression.sum(
        reduce(operator.mul, (meanings[k] ** e for k, e in enumerate(monomial) if e), Expression.number(coefficient))
        for monomial, coefficient in element.terms.items()
    )


def _random_values(ring: Ring) -> list[float]:
    """Return a random value for each generator that satisfies the ring's relations."""
    rng = np.random.default_rng(0)
    known: dict[str, float] = {}
    symbols = frozenset[str]().union(*(constant.symbols for constant in ring.given))
    values = {name: exact(float(x)) for name, x in zip(sorted(symbols), rng.uniform(0.5, 2.0, 1000), strict=False)}
    for constant in ring.given:
        if constant.text in known:
            continue
        if constant.text.startswith("cos(") and constant.meaning is not None:
            angle = rng.uniform(0.2, 1.4)
            known[constant.text] = math.cos(angle)
            known[f"sin{constant.text[3:]}"] = math.sin(angle)
        elif constant.reciprocal_of is not None:
            so_far = [known.get(generator.text, 1.0) for generator in ring.generators]
            known[constant.text] = 1 / float(ring.read(constant.reciprocal_of).value(so_far))
        else:
            known[constant.text] = float(substitute(constant.meaning or Expression.symbol(constant.text), values))
    return [known.get(generator.text, 1.0) for generator in ring.generators]


def _term_value(monomial: Monomial, coefficient: Fraction, values: Sequence[float]) -> float:
    number = float(coefficient)
    for value, exponent in zip(values, monomial, strict=True):
        if exponent:
            number *= value**exponent
    return number


def _determinant(A: list[list[Element]]) -> Element:
    if len(A) == 1:
        return A[0][0]
    minors = [_determinant([row[:j] + row[j + 1 :] for row in A[1:]]) for j in range(len(A))]
    signed = [(1 if j % 2 == 0 else -1) * A[0][j] * minor for j, minor in enumerate(minors)]
    return signed[0].ring.sum(signed)
