"""Polynomials with rational coefficients in many generators: sympy's, or python-flint's where it is installed."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from operator import itemgetter
from typing import Any, Protocol, TypeAlias

Monomial: TypeAlias = tuple[int, ...]
"""Exponents, one for each generator."""


@dataclass(frozen=True)
class Relation:
    """A polynomial that equals zero, used to replace a power of a generator.

    Attributes
    ----------
    place
        Index of the generator.
    power
        2 for x^2 = replacement; 1 for x * (a sum) = 1.
    polynomial
        The polynomial that is zero. Its leading term, in lexicographic order of the generators, contains that power.
    """

    place: int
    power: int
    polynomial: Any


class Polynomials(Protocol):
    """A polynomial ring over the rationals; its polynomials have ``+``, ``-``, ``*``, ``==`` and ``len``."""

    def constant(self, value: int | Fraction) -> Any:
        """Return a rational number."""

    def generator(self, k: int) -> Any:
        """Return generator k."""

    def from_terms(self, terms: Mapping[Monomial, Any]) -> Any:
        """Return the polynomial with this coefficient of each monomial."""

    def terms(self, polynomial: Any) -> Mapping[Monomial, Any]:
        """Return the coefficient of each monomial; coefficients have ``numerator`` and ``denominator``."""

    def derivative(self, polynomial: Any, k: int) -> Any:
        """Return the derivative by generator k."""

    def reduced(self, polynomial: Any, relations: Sequence[Relation]) -> Any:
        """Return the remainder after applying all relations, in their order, as often as possible."""

    def quotient(self, dividend: Any, divisor: Any) -> Any:
        """Return the quotient of an exact division; None if a remainder is left."""


def polynomials(count: int) -> Polynomials:
    """Return the ring in ``count`` generators: python-flint's, or sympy's if missing or ``DHKIT_FLINT=off``."""
    if os.environ.get("DHKIT_FLINT", "").lower() != "off":
        try:
            return _Flint(count)
        except ImportError:
            pass
    return _Sympy(count)


class _Flint:
    """Polynomials of python-flint, which is written in C."""

    def __init__(self, count: int) -> None:
        import flint

        self._ring = flint.fmpq_mpoly_ctx.get([f"x{k}" for k in range(count)], flint.Ordering.lex)
        self._number = flint.fmpq
        self._generators = self._ring.gens()

    def constant(self, value: int | Fraction) -> Any:
        return self._ring.constant(self._number(value.numerator, value.denominator))

    def generator(self, k: int) -> Any:
        return self._generators[k]

    def from_terms(self, terms: Mapping[Monomial, Any]) -> Any:
        return self._ring.from_dict(
            {m: self._number(c.numerator, c.denominator) for m, c in terms.items()}
        )

    def terms(self, polynomial: Any) -> Mapping[Monomial, Any]:
        return {
            tuple(map(int, monomial)): Fraction(int(c.p), int(c.q))
            for monomial, c in polynomial.to_dict().items()
        }

    def derivative(self, polynomial: Any, k: int) -> Any:
        return polynomial.derivative(k)

    def reduced(self, polynomial: Any, relations: Sequence[Relation]) -> Any:
        if not len(polynomial):
            return polynomial
        degrees = polynomial.degrees()
        for relation in relations:
            if degrees[relation.place] < relation.power:
                continue
            polynomial = divmod(polynomial, relation.polynomial)[1]
            if not len(polynomial):
                return polynomial

            # A root's square may contain other roots, and so raise their degrees: x^2 = 2 + y, y^2 = 3.
            degrees = polynomial.degrees()
        return polynomial

    def quotient(self, dividend: Any, divisor: Any) -> Any:
        quotient, remainder = divmod(dividend, divisor)
        return None if len(remainder) else quotient


class _Sympy:
    """Polynomials of sympy, as dictionaries from monomials to coefficients."""

    def __init__(self, count: int) -> None:
        from sympy import QQ
        from sympy.polys.orderings import lex
        from sympy.polys.rings import PolyRing

        self._ring = PolyRing([f"x{k}" for k in range(count)], QQ, lex)
        self._number = QQ

    def constant(self, value: int | Fraction) -> Any:
        return self._ring.ground_new(self._number(value.numerator, value.denominator))

    def generator(self, k: int) -> Any:
        return self._ring.gens[k]

    def from_terms(self, terms: Mapping[Monomial, Any]) -> Any:
        return self._ring.from_dict(
            {m: self._number(int(c.numerator), int(c.denominator)) for m, c in terms.items()}
        )

    def terms(self, polynomial: Any) -> Mapping[Monomial, Any]:
        return {
            monomial: Fraction(int(c.numerator), int(c.denominator))
            for monomial, c in polynomial.items()
        }

    def derivative(self, polynomial: Any, k: int) -> Any:
        return polynomial.diff(k)

    def reduced(self, polynomial: Any, relations: Sequence[Relation]) -> Any:
        squares = [relation for relation in relations if relation.power == 2]
        places = [relation.place for relation in squares]

        # All squares are replaced at once: x^(2 a + e) y^(2 b + f) = r_x^a r_y^b x^e y^f, with e and f 0 or 1. That is
        # much faster than the division algorithm. A replacement may contain squares of other generators: repeat.
        while squares and polynomial:
            low, high = self._split(polynomial, places)
            if not high:
                break
            polynomial = self._ring.from_dict(low)
            for halves, factor in high.items():
                product = self._ring.from_dict(factor)
                for half, relation in zip(halves, squares, strict=True):
                    if half:
                        # The relation is the polynomial x^2 - r_x.
                        r_x = self._ring.gens[relation.place] ** 2 - relation.polynomial
                        product *= r_x**half
                polynomial += product

        for relation in relations:
            if relation.power == 1 and any(monomial[relation.place] for monomial in polynomial):
                polynomial = polynomial.rem(relation.polynomial)
        return polynomial

    @staticmethod
    def _split(
        polynomial: Any, places: Sequence[int]
    ) -> tuple[dict[Monomial, Any], dict[Monomial, dict[Monomial, Any]]]:
        """Return the terms without squares, and the others by the number of squares, which are divided out.

        The keys of the second dictionary are floor(exponent / 2) of the generators at ``places``.
        """
        low: dict[Monomial, Any] = {}
        high: dict[Monomial, dict[Monomial, Any]] = {}

        # The first place is asked for twice: with a single place, itemgetter would not return a tuple.
        exponents = itemgetter(*places, places[0])
        for monomial, coefficient in polynomial.items():
            if max(exponents(monomial)) < 2:
                low[monomial] = coefficient
                continue
            halves = tuple(monomial[k] // 2 for k in places)
            rest = list(monomial)
            for k, half in zip(places, halves, strict=True):
                rest[k] -= 2 * half
            high.setdefault(halves, {})[tuple(rest)] = coefficient
        return low, high

    def quotient(self, dividend: Any, divisor: Any) -> Any:
        quotient, remainder = dividend.div(divisor)
        return None if remainder else quotient
