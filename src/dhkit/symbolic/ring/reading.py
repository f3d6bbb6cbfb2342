"""Exact expressions of a robot file as elements of a ring."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

from dhkit.expressions import PI, Atom, Expression, cos, sin
from dhkit.expressions.exact import Monomial
from dhkit.symbolic.ring.elements import Element, PolynomialRing

Direction: TypeAlias = tuple[Element, Element]
"""Cosine and sine of an angle."""

_EXACT_STEP = Fraction(1, 12)
"""15 degrees in half turns: cosines of multiples of 15 degrees are in Q(sqrt 2, sqrt 3)."""


@dataclass(frozen=True)
class ExpressionReader:
    """Reads expressions into a ring.

    Attributes
    ----------
    ring
        The ring of the elements that are returned.
    units
        Rational factors u by monomial (pi, a parameter or 1): the ring has constants cos(u monomial) and
        sin(u monomial), from which those of whole multiples are computed.
    """

    ring: PolynomialRing
    units: Mapping[Monomial, Sequence[Fraction]]

    def expression(self, expression: Expression) -> Element:
        """Return an expression in the ring's constants.

        Raises
        ------
        RingError
            A name or function in it is not a constant of the ring.
        """
        products = []
        for monomial, coefficient in expression.terms:
            product = self.ring.number(coefficient)
            for atom, exponent in monomial:
                product = product * self._power(atom, exponent)
            products.append(product)
        return self.ring.sum(products)

    def angle(self, angle: Expression) -> Direction:
        """Return cosine and sine of an angle: sums by the addition theorem, multiples of 15 degrees exactly.

        Raises
        ------
        RingError
            As for :meth:`expression`.
        """
        total = (self.ring.one, self.ring.zero)
        for monomial, coefficient in angle.terms:
            if is_exact(monomial, coefficient):
                exact = PI * coefficient
                direction = (self.expression(cos(exact)), self.expression(sin(exact)))
            else:
                direction = self._multiple(monomial, coefficient)
            total = sum_of_angles(total, direction)
        return total

    def _multiple(self, monomial: Monomial, coefficient: Fraction) -> Direction:
        """Return cosine and sine of a whole multiple of an angle whose cosine and sine are constants."""
        units = [
            unit for unit in self.units.get(monomial, ()) if (coefficient / unit).denominator == 1
        ]
        unit = max(units, default=abs(coefficient))
        angle = Expression(((monomial, unit),))
        cosine = self.ring.constant(f"cos({angle.text})")
        sine = self.ring.constant(f"sin({angle.text})")

        c, s = (self.ring.one, self.ring.zero)
        for _ in range(int(abs(coefficient) / unit)):
            c, s = sum_of_angles((c, s), (cosine, sine))

        # cos(-x) = cos(x) and sin(-x) = -sin(x)
        return (c, s) if coefficient > 0 else (c, -s)

    def _power(self, atom: Atom, exponent: int) -> Element:
        """Return an atom to a whole power, positive or negative."""
        if exponent < 0:
            return self.ring.constant(reciprocal_text(atom)) ** -exponent
        if atom.name in ("sin", "cos") and atom.arguments:
            cosine, sine = self.angle(atom.arguments[0])
            return (cosine if atom.name == "cos" else sine) ** exponent
        return self.ring.constant(atom.text) ** exponent


def sum_of_angles(a: Direction, b: Direction) -> Direction:
    """Return cosine and sine of the sum of two angles, from the cosine and sine of each."""
    c_a, s_a = a
    c_b, s_b = b
    # cos(a + b) = cos a cos b - sin a sin b,  sin(a + b) = sin a cos b + cos a sin b
    return c_a * c_b - s_a * s_b, s_a * c_b + c_a * s_b


def difference_of_angles(a: Direction, b: Direction) -> Direction:
    """Return cosine and sine of the difference of two angles, from the cosine and sine of each."""
    c_a, s_a = a
    c_b, s_b = b
    # cos(a - b) = cos a cos b + sin a sin b,  sin(a - b) = sin a cos b - cos a sin b
    return c_a * c_b + s_a * s_b, s_a * c_b - c_a * s_b


def is_exact(monomial: Monomial, coefficient: Fraction) -> bool:
    """Return whether a term of an angle is a multiple of 15 degrees."""
    return monomial == ((Atom("pi"), 1),) and (coefficient / _EXACT_STEP).denominator == 1


def reciprocal_text(atom: Atom) -> str:
    """Return the text of the constant that stands for an atom's reciprocal."""
    return f"1/{atom.text}"
