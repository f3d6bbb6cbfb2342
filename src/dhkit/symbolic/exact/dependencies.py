"""Linearly dependent parameters of equations of motion: found as columns of the regressor, grouped exactly."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
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
"""Largest number of choices of rows that are tried for factors without a denominator."""
_DEPENDENT = 1e-9
"""Largest norm that is left of a dependent column of length 1 when its projection on others is subtracted; rounding
leaves 1e-14."""


class MissingReciprocalError(Exception):
    """A parameter depends on another by a fraction whose reciprocal is not in the ring."""

    def __init__(self, reciprocal: Expression) -> None:
        super().__init__(str(reciprocal))
        self.reciprocal = reciprocal


def independent(trial: Lagrangian, definitions: Mapping[str, Element]) -> dict[str, Element]:
    """Return the independent parameters with their definitions.

    Parameters of no effect are left out. With tau = sum of y_k p_k and a dependent column y = sum of f_k y_k over
    earlier columns, tau stays the same without y if each p_k becomes p_k + f_k p.

    Parameters
    ----------
    trial
        The equations of motion with a symbol for each parameter.
    definitions
        The combination of inertial parameters that each symbol stands for, in any ring with the same constants.
    """
    regressor = _Regressor.of(trial, list(definitions))
    grouped: dict[str, Element] = {}
    Q = np.zeros((len(regressor.rows), 0))
    for name, definition in definitions.items():
        y = regressor.column(name)
        if not y.any():
            continue

        # Gram-Schmidt: the columns of Q are an orthonormal basis of the independent columns. The second pass removes
        # the components along them that rounding left.
        rest = y / np.linalg.norm(y)
        for _ in range(2):
            rest = rest - Q @ (Q.T @ rest)
        if np.linalg.norm(rest) > _DEPENDENT:
            grouped[name] = definition
            Q = np.column_stack([Q, rest / np.linalg.norm(rest)])
            continue

        for other, factor in regressor.grouping(name, list(grouped)).items():
            grouped[other] = grouped[other] + definition * translated(factor, definition.ring, {})
    return grouped


@dataclass(frozen=True, eq=False)
class _Regressor:
    """Coefficients of the parameters in M and g, one row for each entry and each monomial in the state.

    Attributes
    ----------
    ring, names
        The ring of the coefficients, and the parameters.
    rows
        For each row, the coefficients of the parameters that occur: polynomials without the state, as terms.
    numbers
        The rows' values at random lengths and angles, shape (rows, parameters).
    """

    ring: Ring
    names: Sequence[str]
    rows: Sequence[Mapping[str, Mapping[Monomial, Fraction]]]
    numbers: Array

    @classmethod
    def of(cls, trial: Lagrangian, names: Sequence[str]) -> _Regressor:
        """Return the regressor of equations that are linear in parameters of these names."""
        ring = trial.arm.ring
        parameters = {ring.place("constant", name): name for name in names}
        state = [k for k, generator in enumerate(ring.generators) if generator.kind != "constant"]

        # Each term is  number * (constants) * (one parameter) * (monomial in the state)  of one entry of M or g.
        rows: dict[tuple[int, Monomial], dict[str, dict[Monomial, Fraction]]] = {}
        for i, element in enumerate([*trial.M[np.triu_indices(trial.n)], *trial.g]):
            for monomial, coefficient in element.terms.items():
                parameter = next(k for k in parameters if monomial[k])
                constants = list(monomial)
                for k in (*state, parameter):
                    constants[k] = 0
                in_state = tuple(monomial[k] for k in state)
                row = rows.setdefault((i, in_state), {})
                row.setdefault(parameters[parameter], {})[tuple(constants)] = coefficient

        values = _random_values(ring)
        numbers = np.zeros((len(rows), len(names)))
        for k, row in enumerate(rows.values()):
            for name, entry in row.items():
                numbers[k, names.index(name)] = sum(
                    _term_value(m, c, values) for m, c in entry.items()
                )
        return cls(ring, names, list(rows.values()), numbers)

    def column(self, name: str) -> Array:
        """Return a parameter's column of :attr:`numbers`, shape (rows,)."""
        return self.numbers[:, self.names.index(name)]

    def grouping(self, name: str, kept: Sequence[str]) -> dict[str, Element]:
        """Return the exact factors with which a dependent parameter is added to earlier ones.

        The smallest set of columns that it depends on is found in numbers; the factors are quotients of determinants of
        exact entries (Cramer's rule), taken from the rows with the shortest entries.
        """
        y = self.column(name)
        for size in range(1, _MAX_SUPPORT + 1):
            for support in combinations(kept, size):
                Y = np.column_stack([self.column(other) for other in support])
                f, *_ = np.linalg.lstsq(Y, y, rcond=None)
                if np.linalg.norm(Y @ f - y) <= _DEPENDENT * np.linalg.norm(y):
                    return self._factors(name, support)
        raise RingError(
            f"{name} depends on more than {_MAX_SUPPORT} parameters before it; base parameters were not found"
        )

    def _factors(self, name: str, support: Sequence[str]) -> dict[str, Element]:
        """Return the exact f with y_name = sum of f_k y_k over the support.

        Raises
        ------
        RingError
            No choice of rows determines f.
        MissingReciprocalError
            f has a denominator whose reciprocal is not in the ring.
        """
        ring = self.ring
        columns = [self.names.index(other) for other in support]
        usable = [k for k, row in enumerate(self.rows) if not row.keys().isdisjoint(support)]
        usable.sort(key=lambda k: sum(len(entry) for entry in self.rows[k].values()))

        first_fractions: tuple[list[Element], Element] | None = None
        for rows in islice(combinations(usable, len(support)), _TRIES):
            if abs(np.linalg.det(self.numbers[np.ix_(rows, columns)])) < _DEPENDENT:
                continue

            # Cramer's rule for A f = y: f_j = det(A with column j replaced by y) / det(A)
            A = []
            for k in rows:
                row = [self._entry(k, other) for other in support]
                A.append(row)
            y = [self._entry(k, name) for k in rows]
            denominator = _determinant(A)
            numerators = [_determinant(_with_column(A, j, y)) for j in range(len(A))]
            quotients = [
                ring.polynomials.quotient(x.polynomial, denominator.polynomial) for x in numerators
            ]
            if all(quotient is not None for quotient in quotients):
                return {
                    other: Element(ring, f) for other, f in zip(support, quotients, strict=True)
                }
            first_fractions = first_fractions or (numerators, denominator)

        # No choice of rows gives factors without a denominator.
        if first_fractions is None:
            raise RingError(
                f"{name} depends on {', '.join(support)}, but not exactly; base parameters were not found"
            )
        numerators, denominator = first_fractions
        reciprocal = 1 / _expression(denominator)
        try:
            factor = ring.read(reciprocal)
        except RingError:
            raise MissingReciprocalError(reciprocal) from None
        return {
            other: numerator * factor for other, numerator in zip(support, numerators, strict=True)
        }

    def _entry(self, row: int, name: str) -> Element:
        """Return an exact entry of the regressor."""
        return self.ring.from_terms(self.rows[row].get(name, {}))


def _expression(element: Element) -> Expression:
    """Return an element of constants as an expression in the parameters."""
    meanings = [g.meaning or Expression.symbol(g.text) for g in element.ring.generators]
    products = []
    for monomial, coefficient in element.terms.items():
        product = Expression.number(coefficient)
        for meaning, exponent in zip(meanings, monomial, strict=True):
            if exponent:
                product = product * meaning**exponent
        products.append(product)
    return Expression.sum(products)


def _random_values(ring: Ring) -> list[float]:
    """Return a value for each generator: random for constants, so that the ring's relations hold; 1 for the state."""
    rng = np.random.default_rng(0)
    symbols = frozenset[str]().union(*(constant.symbols for constant in ring.given))
    values = {
        name: exact(float(x))
        for name, x in zip(sorted(symbols), rng.uniform(0.5, 2.0, 1000), strict=False)
    }

    known: dict[str, float] = {}
    for constant in ring.given:
        if constant.text in known:
            continue
        if constant.text.startswith("cos(") and constant.meaning is not None:
            # The sine of the same angle is a constant of its own, which follows the cosine.
            angle = rng.uniform(0.2, 1.4)
            known[constant.text] = math.cos(angle)
            known[f"sin{constant.text[3:]}"] = math.sin(angle)
        elif constant.reciprocal_of is not None:
            so_far = [known.get(generator.text, 1.0) for generator in ring.generators]
            denominator = ring.read(constant.reciprocal_of)
            known[constant.text] = 1 / float(denominator.value(so_far))
        else:
            meaning = constant.meaning or Expression.symbol(constant.text)
            known[constant.text] = float(substitute(meaning, values))
    return [known.get(generator.text, 1.0) for generator in ring.generators]


def _term_value(monomial: Monomial, coefficient: Fraction, values: Sequence[float]) -> float:
    """Return a coefficient times the product of generators' values to the exponents."""
    number = float(coefficient)
    for value, exponent in zip(values, monomial, strict=True):
        if exponent:
            number *= value**exponent
    return number


def _with_column(A: list[list[Element]], j: int, column: list[Element]) -> list[list[Element]]:
    """Return a matrix with column j replaced."""
    return [[*row[:j], entry, *row[j + 1 :]] for row, entry in zip(A, column, strict=True)]


def _determinant(A: list[list[Element]]) -> Element:
    """Return a determinant by expansion along the first row: det A = sum of (-1)^j a_0j det(minor j)."""
    if len(A) == 1:
        return A[0][0]
    products = []
    for j, entry in enumerate(A[0]):
        minor = [row[:j] + row[j + 1 :] for row in A[1:]]
        sign = 1 if j % 2 == 0 else -1
        products.append(sign * entry * _determinant(minor))
    return A[0][0].ring.sum(products)
