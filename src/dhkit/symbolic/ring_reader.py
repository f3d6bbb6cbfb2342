"""From a robot file's exact expressions to elements of the ring that they need."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction

from dhkit.errors import ExpressionError
from dhkit.expressions import PI, Atom, Expression, cos, sin, substitute
from dhkit.symbolic.ring import Constant, Element, Ring

__all__ = ["Direction", "RingReader"]

Direction = tuple[Element, Element]
"""Cosine and sine of an angle."""

STEP = Fraction(1, 12)
"""Of half a turn: cosines of multiples of 15 degrees are in Q(sqrt 2, sqrt 3)."""
MOST = 8
"""The largest multiple of an angle that is written in the cosine and sine of the angle itself."""


class RingReader:
    """Finds the constants of expressions, then reads expressions into the ring made of them.

    Numbers stay rational. Of angles only multiples of 15 degrees have cosines that can be written exactly; the cosine
    and the sine of another angle are two constants, related by the sum of their squares.

    Parameters
    ----------
    kinds
        One letter a joint, R or P.
    expressions
        What will be read.
    angles
        Whose cosines and sines will be read.
    """

    def __init__(self, kinds: str, expressions: Iterable[Expression], angles: Iterable[Expression]) -> None:
        self._constants: dict[str, Constant] = {}
        self.notes: list[str] = []
        """What is a constant of its own though it is a number."""
        self._multiples: dict[object, set[Fraction]] = {}
        self._units: dict[object, Fraction] = {}
        expressions, angles = list(expressions), list(angles)
        for expression in expressions:
            self._collect_angles(expression)
        for angle in angles:
            self._collect_multiples(angle)
        for monomial, multiples in self._multiples.items():
            self._units[monomial] = _common(multiples)
        for angle in angles:
            self._scan_angle(angle)
        for expression in expressions:
            self._scan(expression)
        self.ring = Ring(kinds, list(self._constants.values()))

    # Reading

    def element(self, expression: Expression) -> Element:
        """Return an expression as an element of the ring."""
        ring = self.ring
        total = []
        for monomial, coefficient in expression.terms:
            product = ring.number(coefficient)
            for atom, exponent in monomial:
                product = product * self._power(atom, exponent)
            total.append(product)
        return ring.sum(total)

    def direction(self, angle: Expression) -> Direction:
        """Return the cosine and the sine of an angle."""
        ring = self.ring
        c, s = ring.one, ring.zero
        for monomial, coefficient in angle.terms:
            if _is_exact(monomial, coefficient):
                known = PI * coefficient
                turn = self.element(cos(known)), self.element(sin(known))
            else:
                turn = self._multiple(monomial, coefficient)
            c, s = c * turn[0] - s * turn[1], s * turn[0] + c * turn[1]
        return c, s

    def number(self, text: str, values: Mapping[str, Expression]) -> float:
        """Return the value of a constant, given those of the parameters; NaN of the reciprocal of 0."""
        try:
            return float(substitute(self._constants[text].meaning or Expression.symbol(text), values))
        except ExpressionError:
            return math.nan

    def _multiple(self, monomial: object, coefficient: Fraction) -> Direction:
        unit = self._unit(monomial, coefficient)
        one = Expression(((monomial, unit),))  # type: ignore[arg-type]
        cosine, sine = self.ring.constant(f"cos({one.text})"), self.ring.constant(f"sin({one.text})")
        c, s = self.ring.one, self.ring.zero
        for _ in range(int(abs(coefficient) / unit)):
            c, s = c * cosine - s * sine, s * cosine + c * sine
        return (c, s) if coefficient > 0 else (c, -s)

    def _power(self, atom: Atom, exponent: int) -> Element:
        if exponent < 0:
            return self.ring.constant(_reciprocal_text(atom)) ** -exponent
        if atom.name in ("sin", "cos") and atom.arguments:
            cosine, sine = self.direction(atom.arguments[0])
            return (cosine if atom.name == "cos" else sine) ** exponent
        return self.ring.constant(atom.text) ** exponent

    # Finding constants

    def _collect_angles(self, expression: Expression) -> None:
        for monomial, _ in expression.terms:
            for atom, _ in monomial:
                if atom.name in ("sin", "cos") and atom.arguments:
                    self._collect_multiples(atom.arguments[0])
                elif atom.name in ("group", "sqrt") and atom.arguments:
                    self._collect_angles(atom.arguments[0])

    def _collect_multiples(self, angle: Expression) -> None:
        for monomial, coefficient in angle.terms:
            if not _is_exact(monomial, coefficient):
                self._multiples.setdefault(monomial, set()).add(abs(coefficient))

    def _unit(self, monomial: object, coefficient: Fraction) -> Fraction:
        unit = self._units[monomial]
        return unit if abs(coefficient) / unit <= MOST else abs(coefficient)

    def _scan_angle(self, angle: Expression) -> None:
        for monomial, coefficient in angle.terms:
            if _is_exact(monomial, coefficient):
                self._scan(cos(PI * coefficient))
                self._scan(sin(PI * coefficient))
                continue
            one = Expression(((monomial, self._unit(monomial, coefficient)),))
            c, s = f"cos({one.text})", f"sin({one.text})"
            if c in self._constants:
                continue
            cosine, sine = (Expression.of_atom(Atom(name, (one,))) for name in ("cos", "sin"))
            self._add(c, cosine)
            square = lambda ring, c=c: 1 - ring.constant(c) * ring.constant(c)  # noqa: E731
            self._add(s, sine, square=square)
            if not one.symbols:
                self.notes.append(f"{c} and {s} are symbols, related by {c}^2 + {s}^2 = 1")

    def _scan(self, expression: Expression) -> None:
        for monomial, _ in expression.terms:
            for atom, exponent in monomial:
                self._scan_atom(atom)
                if exponent < 0:
                    whole = atom.arguments[0] if atom.name == "group" else Expression.of_atom(atom)
                    of = lambda ring, whole=whole: self._within(ring, whole)  # noqa: E731
                    self._add(_reciprocal_text(atom), 1 / whole, reciprocal_of=of)

    def _scan_atom(self, atom: Atom) -> None:
        if atom.name == "group" and atom.arguments:
            self._scan(atom.arguments[0])
        elif atom.name in ("sin", "cos") and atom.arguments:
            self._scan_angle(atom.arguments[0])
        elif atom.name == "sqrt" and atom.arguments:
            inside = atom.arguments[0]
            self._scan(inside)
            self._add(atom.text, Expression.of_atom(atom), square=lambda ring: self._within(ring, inside))
        else:
            if atom.arguments:
                self.notes.append(f"{atom.text} is a symbol of its own")
            self._add(atom.text, Expression.of_atom(atom))

    def _within(self, ring: Ring, expression: Expression) -> Element:
        """Read while the ring is being made."""
        self.ring = ring
        return self.element(expression)

    def _add(self, text: str, meaning: Expression, **relation: Callable[[Ring], Element]) -> None:
        self._constants.setdefault(text, Constant(text, meaning, **relation))


def _is_exact(monomial: object, coefficient: Fraction) -> bool:
    return monomial == ((Atom("pi"), 1),) and (coefficient / STEP).denominator == 1


def _reciprocal_text(atom: Atom) -> str:
    return f"1/{atom.text}"


def _common(multiples: Iterable[Fraction]) -> Fraction:
    """Return the largest number that all are whole multiples of."""
    listed = list(multiples)
    return (
        Fraction(math.gcd(*(x.numerator for x in listed)), 1) / math.lcm(*(x.denominator for x in listed))
        if (listed)
        else Fraction(1)
    )
