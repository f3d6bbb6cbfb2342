"""The exact ring: polynomials in an arm's parameters and the sines and cosines of its joints, in a normal form.

Elements are polynomials over the rationals in sines and cosines of the joint angles, the values of sliding joints,
joint rates and accelerations, and constants (parameters, roots, functions of parameters, reciprocals). Squares of sines
become 1 - c^2, squares of roots what stands below them, and a reciprocal cancels against what it is the reciprocal of,
so that equality is decided, not sampled. Of angles whose cosine cannot be written exactly, only multiples of a common
one are known to be related.
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
from dhkit.symbolic.ring.reading import Reader


@dataclass(frozen=True)
class Constant:
    """A generator that does not depend on the state.

    Attributes
    ----------
    text
        What it is written as: ``m2``, ``sqrt(2)``, ``cos(beta)``, ``1/(m1 + m2)``.
    meaning
        The expression that it stands for; None where its text is its name.
    square
        What its square is; None where nothing is known of it.
    reciprocal_of
        What it is the reciprocal of; None for all others.
    """

    text: str
    meaning: Expression | None = None
    square: Expression | None = None
    reciprocal_of: Expression | None = None

    @property
    def symbols(self) -> frozenset[str]:
        """The names that it is made of."""
        return frozenset({self.text}) if self.meaning is None else self.meaning.symbols


class Ring(PolynomialRing):
    """Q[constants, q, qd, qdd, s_i, c_i] / (s_i^2 + c_i^2 - 1, ...), for an arm's joints.

    Parameters
    ----------
    kinds
        One letter a joint, R or P.
    constants
        What else there is; each may be written in those before it.
    angles
        Of each turning joint the joints, itself the last, whose variables the angle of its sine and cosine is the sum
        of; itself alone unless given. Frames of parallel axes turn by sums of joint values, which makes c23 of
        c2*c3 - s2*s3.
    sums
        Angles that have a sine and a cosine besides, to print with. Elements in them are compared after
        :meth:`expanded` has put in what they are.

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
        self.angles = {i: (angles or {}).get(i, (i,)) for i, kind in enumerate(kinds) if kind == "R"}
        reciprocals = [c for c in constants if c.reciprocal_of is not None]
        others = [c for c in constants if c.reciprocal_of is None]
        self.sums = tuple(joints for joints in sums if joints not in self.angles.values())
        turning = [(i, joints, angle_name(joints)) for i, joints in self.angles.items()]
        summed = [(-1, joints, angle_name(joints)) for joints in self.sums]
        # Relations rewrite the greatest generator that they hold: reciprocals first, the last made foremost.
        self.generators: tuple[Generator, ...] = (
            *(Generator("constant", c.text, meaning=c.meaning) for c in reversed(reciprocals)),
            *(Generator("constant", c.text, meaning=c.meaning) for c in reversed(others) if c.square is not None),
            *(Generator("sine", f"s{name}", i, joints) for i, joints, name in [*summed, *turning]),
            *(Generator("cosine", f"c{name}", i, joints) for i, joints, name in [*summed, *turning]),
            *(Generator("position", f"q{i + 1}", i) for i, kind in enumerate(kinds) if kind != "R"),
            *(Generator("rate", f"qd{i + 1}", i) for i in range(len(kinds))),
            *(Generator("acceleration", f"qdd{i + 1}", i) for i in range(len(kinds))),
            *(Generator("constant", c.text, meaning=c.meaning) for c in others if c.square is None),
        )
        self._places = {generator.key: k for k, generator in enumerate(self.generators)}
        self.polynomials = polynomials(len(self.generators))
        self.relations: tuple[Relation, ...] = ()
        for i in self.angles:
            self._relate(("sine", i), 2, 1 - self.cosine(i) * self.cosine(i))
        for constant in constants:
            place = ("constant", constant.text)
            if constant.square is not None:
                self._relate(place, 2, self.read(constant.square))
            if constant.reciprocal_of is not None:
                self._relate(place, 1, self.read(constant.reciprocal_of))

    def _relate(self, place: tuple[str, int | str], power: int, other: Element) -> None:
        """Add x^2 = other (power 2), or x other = 1 (power 1)."""
        x = self._element(place).polynomial
        zero = x * x - other.polynomial if power == 2 else x * other.polynomial - self.polynomials.constant(1)
        relations = [*self.relations, Relation(self._places[place], power, zero)]
        self.relations = tuple(sorted(relations, key=lambda relation: relation.place))

    def _key(self) -> tuple[Any, ...]:
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
            It has a name or a function that the ring has not.
        """
        return Reader(self, self.units).expression(expression)

    def direction(self, angle: Expression) -> tuple[Element, Element]:
        """Return cosine and sine of an angle that does not depend on the state.

        Raises
        ------
        RingError
            As for :meth:`read`.
        """
        return Reader(self, self.units).angle(angle)

    @cached_property
    def _expansions(self) -> dict[int, Element]:
        """What sines and cosines of :attr:`sums` are in those of the ring's own angles."""
        single = {joints: (self.sine(i), self.cosine(i)) for i, joints in self.angles.items()}
        expansions: dict[int, Element] = {}
        for sine, cosine, joints in self.turning:
            if joints in self.sums:
                expansions[sine], expansions[cosine] = _sum_of_angles(self, joints, single)
        return expansions

    def expanded(self, element: Element) -> Element:
        """Return an element in the sines and cosines of the ring's own angles alone: its normal form."""
        return translated(element, self, self._expansions) if self.sums else element

    @cached_property
    def units(self) -> Mapping[TermMonomial, Sequence[Fraction]]:
        """Angles whose cosines are constants, as multiples by what they are multiples of: pi, a parameter, 1."""
        units: dict[TermMonomial, list[Fraction]] = {}
        for constant in self.given:
            if constant.meaning is not None and constant.text.startswith("cos("):
                ((((atom, _),), _),) = constant.meaning.terms
                ((monomial, unit),) = atom.arguments[0].terms
                units.setdefault(monomial, []).append(unit)
        return units


def _sum_of_angles(
    ring: Ring, joints: tuple[int, ...], single: Mapping[tuple[int, ...], tuple[Element, Element]]
) -> tuple[Element, Element]:
    """Return sine and cosine of a sum of joint angles; an angle that begins earlier takes off what is too much."""
    s, c = ring.zero, ring.one
    for i in joints:
        own = ring.angles[i]
        s_own, c_own = single[own]
        if len(own) > 1:
            s_less, c_less = _sum_of_angles(ring, own[:-1], single)
            s_own, c_own = s_own * c_less - c_own * s_less, c_own * c_less + s_own * s_less
        s, c = s * c_own + c * s_own, c * c_own - s * s_own
    return s, c


def translated(element: Element, ring: PolynomialRing, replacements: Mapping[int, Element]) -> Element:
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


def angle_name(joints: Sequence[int]) -> str:
    """Return what a sum of joint angles is called: 23 for q2 + q3; 9_10 where a number has two digits."""
    numbers = [str(joint + 1) for joint in joints]
    return ("_" if any(len(number) > 1 for number in numbers) and len(numbers) > 1 else "").join(numbers)
