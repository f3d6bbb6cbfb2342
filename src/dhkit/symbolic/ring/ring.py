"""The exact ring: polynomials in an arm's parameters and the sines and cosines of its joints, in a normal form.

Elements are polynomials with rational coefficients in sines and cosines of joint angles, positions of prismatic joints,
joint rates and accelerations, and constants (parameters, square roots, functions of parameters, reciprocals). The
normal form replaces the square of a sine by 1 - c^2, the square of a square root by its argument, and the product of a
reciprocal with its denominator by 1. So equality is decided, not sampled. One limit: among angles whose cosine has no
exact form, relations are known only between multiples of a common angle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

from dhkit.expressions import Expression
from dhkit.expressions.exact import Monomial as TermMonomial
from dhkit.symbolic.ring.elements import Element, Generator, PolynomialRing
from dhkit.symbolic.ring.polynomials import Monomial, Relation, polynomials
from dhkit.symbolic.ring.reading import (
    Direction,
    ExpressionReader,
    difference_of_angles,
    sum_of_angles,
)


@dataclass(frozen=True)
class Constant:
    """A generator that does not depend on the state.

    Attributes
    ----------
    text
        Its text in equations: ``m2``, ``sqrt(2)``, ``cos(beta)``, ``1/(m1 + m2)``.
    meaning
        The expression that it stands for; None for a parameter, whose text is its name.
    square
        The expression that its square equals; None where no relation is known.
    reciprocal_of
        The denominator of a reciprocal; None for other constants.
    """

    text: str
    meaning: Expression | None = None
    square: Expression | None = None
    reciprocal_of: Expression | None = None

    @property
    def symbols(self) -> frozenset[str]:
        """The names of the parameters that it depends on."""
        return frozenset({self.text}) if self.meaning is None else self.meaning.symbols


class Ring(PolynomialRing):
    """Q[constants, q, qd, qdd, s_i, c_i] / (s_i^2 + c_i^2 - 1, ...), for an arm's joints.

    Parameters
    ----------
    kinds
        One letter a joint, R or P.
    constants
        Generators that do not depend on the state; each may depend on those before it.
    angles
        For each revolute joint, the joints whose variables add up to the angle of its sine and cosine, the joint itself
        last; the joint alone unless given. With parallel axes, sums make expressions shorter: c23 for c2*c3 - s2*s3.
    sums
        Further sums of angles that have a sine and a cosine, for printing. Elements that contain them are compared
        after :meth:`expanded`.

    Examples
    --------
    >>> ring = Ring("R", [Constant("l1")])
    >>> c, s = ring.cosine(0), ring.sine(0)
    >>> c * c + s * s == 1
    True
    >>> str((ring.constant("l1") * s).by_position(0))
    'l1*c1'
    """

    def __init__(
        self,
        kinds: str,
        constants: Sequence[Constant] = (),
        angles: Mapping[int, tuple[int, ...]] | None = None,
        sums: Sequence[tuple[int, ...]] = (),
    ) -> None:
        self.kinds = kinds
        self.given = tuple(constants)
        given_angles = angles or {}
        self.angles = {i: given_angles.get(i, (i,)) for i, kind in enumerate(kinds) if kind == "R"}
        self.sums = tuple(joints for joints in sums if joints not in self.angles.values())

        reciprocals = [c for c in constants if c.reciprocal_of is not None]
        others = [c for c in constants if c.reciprocal_of is None]
        with_square = [c for c in others if c.square is not None]
        without_square = [c for c in others if c.square is None]

        # Joint (-1 for an angle that is only printed), the joints that it sums, and the index text of each angle.
        summed = [(-1, joints, angle_name(joints)) for joints in self.sums]
        turning = [(i, joints, angle_name(joints)) for i, joints in self.angles.items()]
        all_angles = [*summed, *turning]

        # A relation replaces its first generator in this order: reciprocals come first, the last one foremost.
        self.generators: tuple[Generator, ...] = (
            *(Generator("constant", c.text, meaning=c.meaning) for c in reversed(reciprocals)),
            *(Generator("constant", c.text, meaning=c.meaning) for c in reversed(with_square)),
            *(Generator("sine", f"s{name}", i, joints) for i, joints, name in all_angles),
            *(Generator("cosine", f"c{name}", i, joints) for i, joints, name in all_angles),
            *(Generator("position", f"q{i + 1}", i) for i, kind in enumerate(kinds) if kind != "R"),
            *(Generator("rate", f"qd{i + 1}", i) for i in range(len(kinds))),
            *(Generator("acceleration", f"qdd{i + 1}", i) for i in range(len(kinds))),
            *(Generator("constant", c.text, meaning=c.meaning) for c in without_square),
        )
        self._places = {generator.key: k for k, generator in enumerate(self.generators)}
        self.polynomials = polynomials(len(self.generators))

        # s_i^2 = 1 - c_i^2, root^2 = its argument, reciprocal * denominator = 1. Earlier relations apply to later ones.
        self.relations: tuple[Relation, ...] = ()
        for i in self.angles:
            self._relate_square(("sine", i), 1 - self.cosine(i) * self.cosine(i))
        for constant in constants:
            key = ("constant", constant.text)
            if constant.square is not None:
                self._relate_square(key, self.read(constant.square))
            if constant.reciprocal_of is not None:
                self._relate_reciprocal(key, self.read(constant.reciprocal_of))

    def _relate_square(self, key: tuple[str, int | str], square: Element) -> None:
        """Add the relation x^2 - square = 0 for the generator x with this key."""
        x = self._element(key).polynomial
        self._add_relation(Relation(self._places[key], 2, x * x - square.polynomial))

    def _relate_reciprocal(self, key: tuple[str, int | str], denominator: Element) -> None:
        """Add the relation x * denominator - 1 = 0 for the generator x with this key."""
        x = self._element(key).polynomial
        self._add_relation(
            Relation(
                self._places[key], 1, x * denominator.polynomial - self.polynomials.constant(1)
            )
        )

    def _add_relation(self, relation: Relation) -> None:
        relations = [*self.relations, relation]
        self.relations = tuple(sorted(relations, key=lambda each: each.place))

    def _key(self) -> tuple[Any, ...]:
        """Everything that the ring is made from; rings with equal keys are equal."""
        return self.kinds, self.given, tuple(self.angles.items()), self.sums

    def __eq__(self, other: object) -> bool:
        return self is other or (isinstance(other, Ring) and self._key() == other._key())

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        return hash(self._key())

    def __reduce__(self) -> tuple[type[Ring], tuple[Any, ...]]:
        return Ring, (self.kinds, self.given, self.angles, self.sums)

    def read(self, expression: Expression) -> Element:
        """Return an exact expression in the ring's constants.

        Raises
        ------
        RingError
            A name or function in it is not a constant of the ring.
        """
        return ExpressionReader(self, self.units).expression(expression)

    def direction(self, angle: Expression) -> tuple[Element, Element]:
        """Return cosine and sine of an angle that does not depend on the state.

        Raises
        ------
        RingError
            As for :meth:`read`.
        """
        return ExpressionReader(self, self.units).angle(angle)

    @cached_property
    def _expansions(self) -> dict[int, Element]:
        """Sines and cosines of :attr:`sums` in terms of those of the ring's own angles, by index."""
        expansions: dict[int, Element] = {}
        for sine, cosine, joints in self.turning:
            if joints in self.sums:
                expansions[cosine], expansions[sine] = self._direction_of_sum(joints)
        return expansions

    def _direction_of_sum(self, joints: tuple[int, ...]) -> Direction:
        """Return cosine and sine of q_i + q_j + ..., in those of the ring's own angles."""
        total = (self.one, self.zero)
        for i in joints:
            own = self.angles[i]
            direction = (self.cosine(i), self.sine(i))
            if len(own) > 1:
                # The angle of joint i is a sum that ends with q_i: q_i = (... + q_h + q_i) - (... + q_h)
                direction = difference_of_angles(direction, self._direction_of_sum(own[:-1]))
            total = sum_of_angles(total, direction)
        return total

    def expanded(self, element: Element) -> Element:
        """Return an element in the sines and cosines of the ring's own angles alone: its normal form."""
        return translated(element, self, self._expansions) if self.sums else element

    @cached_property
    def units(self) -> Mapping[TermMonomial, Sequence[Fraction]]:
        """Angles whose cosines are constants: factors by the monomial (pi, a parameter, 1) that they multiply."""
        units: dict[TermMonomial, list[Fraction]] = {}
        for constant in self.given:
            if constant.meaning is not None and constant.text.startswith("cos("):
                # The meaning is one term, 1 * cos(angle)^1, and the angle is one term, unit * monomial.
                ((product, _),) = constant.meaning.terms
                ((atom, _),) = product
                ((monomial, unit),) = atom.arguments[0].terms
                units.setdefault(monomial, []).append(unit)
        return units


def translated(
    element: Element, ring: PolynomialRing, replacements: Mapping[int, Element]
) -> Element:
    """Return an element in another ring.

    Parameters
    ----------
    element
        An element of any ring.
    ring
        The ring of the result.
    replacements
        Elements that replace generators, by index in the element's ring; other generators keep their kind and name.
    """
    own = element.ring.generators
    kept = [k for k in range(len(own)) if k not in replacements]

    # Terms are collected by their exponents of the replaced generators y_k:
    #   sum over exponents e of  (part of the kept generators, moved to the new ring) * product of y_k^e_k
    targets: dict[int, int] = {}  # index in the new ring of each kept generator that occurs
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

    # Powers of replacements so far, by index and exponent.
    powers: dict[tuple[int, int], Element] = {}
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


def angle_name(joints: Sequence[int]) -> str:
    """Return the index text of a sum of joint angles: 23 for q2 + q3; 9_10 where a joint number has two digits."""
    numbers = [str(joint + 1) for joint in joints]
    has_two_digits = any(len(number) > 1 for number in numbers)
    return ("_" if has_two_digits else "").join(numbers)
