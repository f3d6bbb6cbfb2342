"""The constants that a ring needs for a robot file's expressions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from dhkit.errors import ExpressionError
from dhkit.expressions import PI, Atom, Expression, cos, sin, substitute
from dhkit.expressions.exact import Monomial
from dhkit.symbolic.ring.bounds import BOUNDS
from dhkit.symbolic.ring.reading import is_exact, reciprocal_text
from dhkit.symbolic.ring.ring import Constant


@dataclass
class Constants:
    """Finds the constants of expressions and of cosines and sines of angles.

    Numbers stay rational. Cosines of multiples of 15 degrees are written with square roots; the cosine and the sine of
    any other angle are two constants whose squares add up to 1.

    Attributes
    ----------
    found
        The constants by text; each follows those that it depends on.
    notes
        One sentence for each number that becomes a constant because it has no exact form.
    """

    found: dict[str, Constant] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    _units: dict[Monomial, Fraction] = field(default_factory=dict)

    @classmethod
    def of(cls, expressions: Iterable[Expression], angles: Iterable[Expression]) -> Constants:
        """Return the constants of expressions, and of the cosines and sines of angles."""
        expressions = list(expressions)
        angles = list(angles)
        constants = cls()
        constants._units = _common_angles(expressions, angles)
        for angle in angles:
            constants._scan_angle(angle)
        for expression in expressions:
            constants._scan(expression)
        return constants

    def _scan(self, expression: Expression) -> None:
        for monomial, _ in expression.terms:
            for atom, exponent in monomial:
                self._scan_atom(atom)
                if exponent < 0:
                    whole = atom.arguments[0] if atom.name == "group" else Expression.of_atom(atom)
                    self._add(Constant(reciprocal_text(atom), 1 / whole, reciprocal_of=whole))

    def _scan_atom(self, atom: Atom) -> None:
        inside = atom.arguments[0] if atom.arguments else None
        if inside is None:
            self._add(Constant(atom.text, Expression.of_atom(atom) if atom.name == "pi" else None))
        elif atom.name == "group":
            self._scan(inside)
        elif atom.name in ("sin", "cos"):
            self._scan_angle(inside)
        elif atom.name == "sqrt":
            self._scan(inside)
            self._add(Constant(atom.text, Expression.of_atom(atom), square=inside))
        else:
            self.notes.append(f"{atom.text} is a symbol of its own")
            self._add(Constant(atom.text, Expression.of_atom(atom)))

    def _scan_angle(self, angle: Expression) -> None:
        for monomial, coefficient in angle.terms:
            if is_exact(monomial, coefficient):
                self._scan(cos(PI * coefficient))
                self._scan(sin(PI * coefficient))
                continue
            unit = self._units[monomial]
            one = Expression(
                ((monomial, unit if abs(coefficient) / unit <= BOUNDS.angle_multiple else abs(coefficient)),)
            )
            cosine, sine = (Expression.of_atom(Atom(name, (one,))) for name in ("cos", "sin"))
            if cosine.text in self.found:
                continue
            self._add(Constant(cosine.text, cosine))
            self._add(Constant(sine.text, sine, square=1 - cosine * cosine))
            if not one.symbols:
                self.notes.append(f"{cosine} and {sine} are symbols, related by {cosine}^2 + {sine}^2 = 1")

    def _add(self, constant: Constant) -> None:
        self.found.setdefault(constant.text, constant)


def value_of(constant: Constant, values: Mapping[str, Expression]) -> float:
    """Return the value of a constant for given parameters; NaN for the reciprocal of 0."""
    try:
        return float(substitute(constant.meaning or Expression.symbol(constant.text), values))
    except ExpressionError:
        return math.nan


def _common_angles(expressions: Iterable[Expression], angles: Iterable[Expression]) -> dict[Monomial, Fraction]:
    """Return, for each monomial in angles, the largest factor of which all factors that occur are whole multiples."""
    multiples: dict[Monomial, set[Fraction]] = {}

    def collect(angle: Expression) -> None:
        for monomial, coefficient in angle.terms:
            if not is_exact(monomial, coefficient):
                multiples.setdefault(monomial, set()).add(abs(coefficient))

    def search(expression: Expression) -> None:
        for monomial, _ in expression.terms:
            for atom, _ in monomial:
                if atom.name in ("sin", "cos") and atom.arguments:
                    collect(atom.arguments[0])
                elif atom.name in ("group", "sqrt") and atom.arguments:
                    search(atom.arguments[0])

    for angle in angles:
        collect(angle)
    for expression in expressions:
        search(expression)
    return {
        monomial: Fraction(math.gcd(*(x.numerator for x in found)), math.lcm(*(x.denominator for x in found)))
        for monomial, found in multiples.items()
    }
