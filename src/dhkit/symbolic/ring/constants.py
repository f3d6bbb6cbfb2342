"""The constants that a ring needs for a robot file's expressions: generators that do not depend on the state."""

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

    Numbers stay rational. Cosines of multiples of 15 degrees are written with square roots. For other angles, the
    cosine and the sine of the largest common unit u of the multiples m u that occur are two constants whose squares add
    up to 1; those of m u, m whole, are polynomials in them.

    Attributes
    ----------
    found
        The constants by text; each follows those that it depends on.
    notes
        One sentence for each number or function of parameters that becomes a constant because it has no exact form.
    """

    found: dict[str, Constant] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    _units: dict[Monomial, Fraction] = field(default_factory=dict)
    """The common unit of the multiples of each monomial in angles, such as pi, a parameter or 1 (rad); see
    :func:`_common_angles`."""

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
        """Add the constants of an expression, with the reciprocals of its divisors."""
        for monomial, _ in expression.terms:
            for atom, exponent in monomial:
                self._scan_atom(atom)
                if exponent < 0:
                    # A group is a sum in parentheses.
                    denominator = (
                        atom.arguments[0] if atom.name == "group" else Expression.of_atom(atom)
                    )
                    self._add(
                        Constant(reciprocal_text(atom), 1 / denominator, reciprocal_of=denominator)
                    )

    def _scan_atom(self, atom: Atom) -> None:
        """Add the constants of a name, a sum in parentheses or a function of an expression."""
        inside = atom.arguments[0] if atom.arguments else None
        if inside is None:  # a name
            self._add(Constant(atom.text, Expression.of_atom(atom) if atom.name == "pi" else None))
        elif atom.name == "group":
            self._scan(inside)
        elif atom.name in ("sin", "cos"):
            self._scan_angle(inside)
        elif atom.name == "sqrt":
            self._scan(inside)
            self._add(Constant(atom.text, Expression.of_atom(atom), square=inside))
        elif atom.text not in self.found:
            self.notes.append(
                f"{atom.text} is a symbol of its own: identities with it are not seen"
            )
            self._add(Constant(atom.text, Expression.of_atom(atom)))

    def _scan_angle(self, angle: Expression) -> None:
        """Add the constants of which the cosine and the sine of an angle are polynomials, term by term of the angle."""
        for monomial, coefficient in angle.terms:
            if is_exact(monomial, coefficient):
                # A multiple of 15 degrees, whose monomial is pi: only square roots.
                self._scan(cos(PI * coefficient))
                self._scan(sin(PI * coefficient))
                continue

            # cos(m u) and sin(m u), m whole, are polynomials in cos(u) and sin(u). Too large an m gets symbols of its
            # own, which are then unrelated to cos(u).
            unit = self._units[monomial]
            m = abs(coefficient) / unit
            if m > BOUNDS.angle_multiple:
                unit = abs(coefficient)
            unit_angle = Expression(((monomial, unit),))
            cosine = Expression.of_atom(Atom("cos", (unit_angle,)))
            sine = Expression.of_atom(Atom("sin", (unit_angle,)))
            if cosine.text in self.found:  # by another angle
                continue

            # sin^2 u = 1 - cos^2 u
            self._add(Constant(cosine.text, cosine))
            self._add(Constant(sine.text, sine, square=1 - cosine * cosine))
            if not unit_angle.symbols:
                self.notes.append(
                    f"{cosine} and {sine} are symbols, related by {cosine}^2 + {sine}^2 = 1"
                )

    def _add(self, constant: Constant) -> None:
        self.found.setdefault(constant.text, constant)


def value_of(constant: Constant, values: Mapping[str, Expression]) -> float:
    """Return the value of a constant for given parameters; NaN where it has none: 1/0, a root of a negative number."""
    try:
        # A constant without a meaning is a parameter.
        meaning = Expression.symbol(constant.text) if constant.meaning is None else constant.meaning
        return float(substitute(meaning, values))
    except ExpressionError:
        return math.nan


def _common_angles(
    expressions: Iterable[Expression], angles: Iterable[Expression]
) -> dict[Monomial, Fraction]:
    """Return, for each monomial in angles, the largest rational u of which all its coefficients are whole multiples.

    For pi/7 and 3*pi/14, u is 1/14 at the monomial pi.
    """
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

    # The greatest common divisor of reduced fractions a_k / b_k is gcd(a_k) / lcm(b_k).
    units: dict[Monomial, Fraction] = {}
    for monomial, factors in multiples.items():
        numerators = [factor.numerator for factor in factors]
        denominators = [factor.denominator for factor in factors]
        units[monomial] = Fraction(math.gcd(*numerators), math.lcm(*denominators))
    return units
