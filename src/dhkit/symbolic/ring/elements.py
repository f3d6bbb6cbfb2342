"""Elements of the exact ring: polynomials in normal form, compared and differentiated exactly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from numbers import Real
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dhkit.display import LONGEST_LINE, plain, repr_line
from dhkit.errors import DhkitError
from dhkit.expressions import exact
from dhkit.symbolic.ring.polynomials import Monomial

if TYPE_CHECKING:
    from dhkit.symbolic.ring.ring import Ring

READABLE = 200
"""Terms that are shown unasked."""
MAX_TERMS = 300_000
"""Terms of a product: ten times the longest of the library, a Jaco's with every inertial parameter a symbol."""
TOO_LONG = "too long to be derived exactly; numbers in place of symbols, or fewer joints (lock), make it shorter"
MAX_PAIRS = 500_000
"""Pairs of terms that one product may have: six times that Jaco's; seconds on sympy's rings."""


class RingError(DhkitError):
    """An expression that the exact ring does not have, or one too long for it."""


@dataclass(frozen=True, eq=False)
class Element:
    """An element of a ring, in normal form."""

    ring: Ring
    polynomial: Any

    # Arithmetic

    def __add__(self, other: Scalar) -> Element:
        if not isinstance(other, Element | Real):
            return NotImplemented
        return Element(self.ring, self.polynomial + self._coerced(other))

    __radd__ = __add__

    def __neg__(self) -> Element:
        return Element(self.ring, -self.polynomial)

    def __sub__(self, other: Scalar) -> Element:
        if not isinstance(other, Element | Real):
            return NotImplemented
        return Element(self.ring, self.polynomial - self._coerced(other))

    def __rsub__(self, other: Scalar) -> Element:
        if not isinstance(other, Element | Real):
            return NotImplemented
        return Element(self.ring, self._coerced(other) - self.polynomial)

    def __mul__(self, other: Scalar) -> Element:
        if not isinstance(other, Element | Real):
            return NotImplemented
        if len(self.polynomial) == 0:
            return self
        factor = self._coerced(other)
        if len(self.polynomial) * len(factor) > MAX_PAIRS:
            raise RingError(f"a product of {len(self.polynomial)} by {len(factor)} terms: {TOO_LONG}")
        product = Element(self.ring, self.polynomial * factor).reduced()
        if len(product.polynomial) > MAX_TERMS:
            raise RingError(f"an expression of {len(product.polynomial)} terms, beyond {MAX_TERMS}: {TOO_LONG}")
        return product

    __rmul__ = __mul__

    def __pow__(self, exponent: int) -> Element:
        result = self.ring.one
        for _ in range(exponent):
            result = result * self
        return result

    def _coerced(self, other: Scalar) -> Any:
        if isinstance(other, Element):
            if other.ring != self.ring:
                raise RingError("elements of two rings; derive both from one description and with equal symbols")
            return other.polynomial
        return self.ring.polynomials.constant(_rational(other))

    def __truediv__(self, other: Scalar) -> Element:
        if isinstance(other, Element) or not isinstance(other, Real):
            return NotImplemented
        return self * (1 / _rational(other))

    def reduced(self) -> Element:
        """Return the normal form under the ring's relations."""
        return Element(self.ring, self.ring.polynomials.reduced(self.polynomial, self.ring.relations))

    # Comparing

    @property
    def is_zero(self) -> bool:
        """Whether this is zero for every state and every value of the parameters."""
        return not self or not self.ring.expanded(self)._cleared()

    def __bool__(self) -> bool:
        """Whether the normal form has a term."""
        return len(self.polynomial) > 0

    def __eq__(self, other: object) -> bool:
        if isinstance(other, Element) and other.ring != self.ring:
            return False
        if isinstance(other, Element | Real):
            return Element(self.ring, self.polynomial - self._coerced(other)).is_zero  # type: ignore[arg-type]
        return NotImplemented

    def __hash__(self) -> int:
        # Equal elements may be written in two ways, with reciprocals or sums of angles.
        return hash(self.ring)

    def _cleared(self) -> Element:
        """Return this times what its reciprocals are the reciprocals of: zero only together with this.

        Reciprocals of sums that share parameters have more than one form (partial fractions).
        """
        element = self
        for relation in self.ring.relations:
            if relation.power != 1:
                continue
            generator = self.ring.polynomials.generator(relation.place)
            while any(monomial[relation.place] for monomial in element.terms):
                whole = relation.polynomial + self.ring.polynomials.constant(1)
                divisor = self.ring.polynomials.quotient(whole, generator)
                element = _without(element, relation.place, divisor)
        return element

    # Reading

    @cached_property
    def terms(self) -> Mapping[Monomial, Fraction]:
        """The coefficients by monomial, exponents in the order of the ring's generators."""
        return self.ring.polynomials.terms(self.polynomial)

    @cached_property
    def _products(self) -> list[tuple[float, list[tuple[int, int]]]]:
        """Of each term its coefficient, and its generators with their exponents."""
        return [(float(c), [(k, e) for k, e in enumerate(m) if e]) for m, c in self.terms.items()]

    def __len__(self) -> int:
        return len(self.polynomial)

    def __reduce__(self) -> tuple[Any, tuple[Ring, dict[Monomial, Fraction]]]:
        return _from_terms, (self.ring, dict(self.terms))

    def __str__(self) -> str:
        from dhkit.symbolic.equations import plain_text

        return plain_text(self)

    def __repr__(self) -> str:
        if len(self) > READABLE:
            return repr_line("Element", f"{len(self)} terms")
        return f"Element({plain(str(self), LONGEST_LINE - len('Element()'))})"

    def _repr_latex_(self) -> str | None:
        from dhkit.symbolic.equations import latex_text

        return f"${latex_text(self)}$" if len(self) <= READABLE else None

    # Calculus

    def by_position(self, i: int) -> Element:
        """Return the partial derivative by joint i's variable."""
        ring, derivative = self.ring, self.ring.polynomials.derivative
        if ring.kinds[i] != "R":
            return Element(ring, derivative(self.polynomial, ring.place("position", i)))
        change = ring.zero.polynomial
        for sine, cosine, joints in ring.turning:
            if i in joints:
                generator = ring.polynomials.generator
                change = change + derivative(self.polynomial, sine) * generator(cosine)
                change = change - derivative(self.polynomial, cosine) * generator(sine)
        return Element(ring, change).reduced()

    def by_rate(self, i: int) -> Element:
        """Return the partial derivative by joint i's rate."""
        return Element(self.ring, self.ring.polynomials.derivative(self.polynomial, self.ring.place("rate", i)))

    def by_constant(self, text: str) -> Element:
        """Return the partial derivative by a constant that nothing else is written in."""
        place = self.ring.place("constant", text)
        return Element(self.ring, self.ring.polynomials.derivative(self.polynomial, place))

    def by_time(self) -> Element:
        """Return the time derivative along the motion: qd by qdd, q by qd."""
        ring = self.ring
        parts = [self.by_position(i) * ring.rate(i) for i in range(ring.n)]
        return ring.sum([*parts, *(self.by_rate(i) * ring.acceleration(i) for i in range(ring.n))])

    def value(self, values: Sequence[Any]) -> Any:
        """Return the number, or array (...), at values of the generators; see :meth:`Ring.values`."""
        total: Any = 0.0
        for coefficient, powers in self._products:
            product: Any = coefficient
            for k, exponent in powers:
                product = product * (values[k] if exponent == 1 else values[k] ** exponent)
            total = total + product
        return total


Elements: TypeAlias = NDArray[Any]
"""An array whose entries are elements of one ring."""


def element_array(value: Any) -> Elements:
    """Return an element, a list of them, or an array, as an array of the same shape."""
    array: Elements = np.empty(np.shape(value), dtype=object)
    array[...] = value
    return array


Scalar: TypeAlias = "Element | int | float | Fraction"


def _without(element: Element, place: int, divisor: Any) -> Element:
    """Multiply by what the generator at ``place`` is the reciprocal of, once."""
    ring = element.ring
    with_it = {m: c for m, c in element.terms.items() if m[place]}
    rest = {m: c for m, c in element.terms.items() if not m[place]}
    lowered = {(*m[:place], m[place] - 1, *m[place + 1 :]): c for m, c in with_it.items()}
    product = ring.polynomials.from_terms(rest) * divisor
    return Element(ring, product + ring.polynomials.from_terms(lowered)).reduced()


def _rational(number: Any) -> Fraction:
    """Return a number as the rational that it was written for: 1e-9 is 1/10^9.

    Raises
    ------
    ExpressionError
        It is not finite.
    """
    if isinstance(number, int | Fraction):
        return Fraction(number)
    rational = exact(number).rational
    return Fraction(0) if rational is None else rational


def _from_terms(ring: Ring, terms: Mapping[Monomial, Fraction]) -> Element:
    return ring.from_terms(terms)


def translated(element: Element, ring: Ring, replacements: Mapping[int, Element]) -> Element:
    """Return an element in another ring.

    Parameters
    ----------
    element
        Of any ring.
    ring
        Where the result is.
    replacements
        What generators become, by their place in the element's ring; others become those of the same kind and name.
    """
    own = element.ring.generators
    powers: dict[tuple[int, int], Element] = {}
    kept = [k for k in range(len(own)) if k not in replacements]
    targets: dict[int, int] = {}
    parts: dict[Monomial, dict[Monomial, Fraction]] = {}
    for monomial, coefficient in element.terms.items():
        replaced = tuple(monomial[k] for k in replacements)
        moved = [0] * len(ring.generators)
        for k in kept:
            if monomial[k]:
                if k not in targets:
                    targets[k] = ring.place(*own[k].key)
                moved[targets[k]] = monomial[k]
        parts.setdefault(replaced, {})[tuple(moved)] = coefficient
    total = []
    for exponents, group in parts.items():
        product = ring.one
        for k, exponent in zip(replacements, exponents, strict=True):
            if exponent:
                if (k, exponent) not in powers:
                    powers[k, exponent] = replacements[k] ** exponent
                product = product * powers[k, exponent]
        total.append(ring.from_terms(group) * product)
    return ring.sum(total)
