"""From a robot file's exact expressions to elements of a ring."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, TypeAlias

from dhkit.expressions import PI, Atom, Expression, cos, sin
from dhkit.symbolic.ring.elements import Element

if TYPE_CHECKING:
    from dhkit.expressions.exact import Monomial
    from dhkit.symbolic.ring.ring import Ring

Direction: TypeAlias = tuple[Element, Element]
"""Cosine and sine of an angle."""

STEP = Fraction(1, 12)
"""Of half a turn: cosines of multiples of 15 degrees are in Q(sqrt 2, sqrt 3)."""


def read_expression(ring: Ring, expression: Expression) -> Element:
    """Return an expression in a ring's constants.

    Raises
    ------
    RingError
        It has a name or a function that the ring has not.
    """
    total = []
    for monomial, coefficient in expression.terms:
        product = ring.number(coefficient)
        for atom, exponent in monomial:
            product = product * _power(ring, atom, exponent)
        total.append(product)
    return ring.sum(total)


def read_angle(ring: Ring, angle: Expression) -> Direction:
    """Return cosine and sine of an angle: sums by the addition theorem, multiples of 15 degrees exactly.

    Raises
    ------
    RingError
        As for :func:`read_expression`.
    """
    c, s = ring.one, ring.zero
    for monomial, coefficient in angle.terms:
        turn = _right(ring, coefficient) if is_exact(monomial, coefficient) else _multiple(ring, monomial, coefficient)
        c, s = c * turn[0] - s * turn[1], s * turn[0] + c * turn[1]
    return c, s


def is_exact(monomial: Monomial, coefficient: Fraction) -> bool:
    """Return whether a term of an angle is a multiple of 15 degrees."""
    return monomial == ((Atom("pi"), 1),) and (coefficient / STEP).denominator == 1


def reciprocal_text(atom: Atom) -> str:
    """Return what the reciprocal of an atom is called."""
    return f"1/{atom.text}"


def _right(ring: Ring, half_turns: Fraction) -> Direction:
    return read_expression(ring, cos(PI * half_turns)), read_expression(ring, sin(PI * half_turns))


def _multiple(ring: Ring, monomial: Monomial, coefficient: Fraction) -> Direction:
    """Return cosine and sine of a whole multiple of an angle that has constants of its own."""
    units = [unit for unit in ring.units.get(monomial, ()) if (coefficient / unit).denominator == 1]
    unit = max(units, default=abs(coefficient))
    one = Expression(((monomial, unit),))
    cosine, sine = ring.constant(f"cos({one.text})"), ring.constant(f"sin({one.text})")
    c, s = ring.one, ring.zero
    for _ in range(int(abs(coefficient) / unit)):
        c, s = c * cosine - s * sine, s * cosine + c * sine
    return (c, s) if coefficient > 0 else (c, -s)


def _power(ring: Ring, atom: Atom, exponent: int) -> Element:
    if exponent < 0:
        return ring.constant(reciprocal_text(atom)) ** -exponent
    if atom.name in ("sin", "cos") and atom.arguments:
        cosine, sine = read_angle(ring, atom.arguments[0])
        return (cosine if atom.name == "cos" else sine) ** exponent
    return ring.constant(atom.text) ** exponent
