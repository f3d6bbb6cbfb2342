"""The exact ring: polynomials in an arm's parameters and the sines and cosines of its joints, in a normal form.

Elements are polynomials over the rationals in sines and cosines of the joint angles, the values of sliding joints,
joint rates and accelerations, and constants (parameters, roots, functions of parameters, reciprocals). Squares of sines
become 1 - c^2, squares of roots what stands below them, and a reciprocal cancels against what it is the reciprocal of,
so that two elements are equal if, and only if, they are the same function of the state: equality is decided, not
sampled.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.errors import DhkitError
from dhkit.expressions import Expression
from dhkit.symbolic.polynomials import Monomial, Relation, polynomials

__all__ = ["Constant", "Element", "Elements", "Generator", "Ring", "RingError", "translated"]

MAX_TERMS = 400_000
"""Terms of one element: some hundred times those of a PUMA's longest, a few hundred megabytes."""


class RingError(DhkitError):
    """An expression that the exact ring does not have, or one too long for it."""


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
        What its square is, given the ring; None where nothing is known of it.
    reciprocal_of
        What it is the reciprocal of, given the ring; None for all others.
    """

    text: str
    meaning: Expression | None = None
    square: Callable[[Ring], Element] | None = field(default=None, compare=False)
    reciprocal_of: Callable[[Ring], Element] | None = field(default=None, compare=False)


@dataclass(frozen=True)
class Generator:
    """A generator of the ring.

    Attributes
    ----------
    kind
        One of sine, cosine, position (of a sliding joint), rate, acceleration and constant.
    text
        What it is written as: s1, c23, q2, qd1, qdd1, or the constant's text.
    joint
        Which joint, from 0; -1 for constants.
    joints
        Of a sine or a cosine the joints whose variables its angle is the sum of: (1, 2) for c23.
    meaning
        The expression that a constant stands for; None where its text is its name.
    """

    kind: str
    text: str
    joint: int = -1
    joints: tuple[int, ...] = ()
    meaning: Expression | None = None


class Ring:
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
        self._places = {(g.kind, g.text if g.joint < 0 else g.joint): k for k, g in enumerate(self.generators)}
        self.polynomials = polynomials(len(self.generators))
        self._relations: tuple[Relation, ...] = ()
        relations = [self._square(("sine", i), 1 - self.cosine(i) * self.cosine(i)) for i in self.angles]
        for constant in constants:
            place = ("constant", constant.text)
            self._relations = tuple(sorted(relations, key=lambda relation: relation.place))
            if constant.square is not None:
                relations.append(self._square(place, constant.square(self)))
            if constant.reciprocal_of is not None:
                product = self._element(place).polynomial * constant.reciprocal_of(self).polynomial
                relations.append(Relation(self._places[place], 1, product - self.polynomials.constant(1)))
        self._relations = tuple(sorted(relations, key=lambda relation: relation.place))

    def _square(self, place: tuple[str, int | str], value: Element) -> Relation:
        generator = self._element(place).polynomial
        return Relation(self._places[place], 2, generator * generator - value.polynomial)

    def _element(self, place: tuple[str, int | str]) -> Element:
        return Element(self, self.polynomials.generator(self._places[place]))

    # Elements

    def number(self, value: int | Fraction) -> Element:
        """Return a rational number."""
        return Element(self, self.polynomials.constant(value))

    @cached_property
    def zero(self) -> Element:
        """The number 0."""
        return self.number(0)

    @cached_property
    def one(self) -> Element:
        """The number 1."""
        return self.number(1)

    def constant(self, text: str) -> Element:
        """Return a constant by its text.

        Raises
        ------
        RingError
            The ring has none of that name.
        """
        if ("constant", text) not in self._places:
            raise RingError(f"no {text!r} in the ring; it has {', '.join(self.constants) or 'no constants'}")
        return self._element(("constant", text))

    def sine(self, i: int) -> Element:
        """Return the sine of joint i's variable, from 0."""
        return self._element(("sine", i))

    def cosine(self, i: int) -> Element:
        """Return the cosine of joint i's variable."""
        return self._element(("cosine", i))

    def position(self, i: int) -> Element:
        """Return the variable of a sliding joint."""
        return self._element(("position", i))

    def rate(self, i: int) -> Element:
        """Return joint i's rate."""
        return self._element(("rate", i))

    def acceleration(self, i: int) -> Element:
        """Return joint i's acceleration."""
        return self._element(("acceleration", i))

    def sum(self, elements: Iterable[Element]) -> Element:
        """Return the sum of elements."""
        total = self.zero.polynomial
        for element in elements:
            total = total + element.polynomial
        return Element(self, total)

    def from_terms(self, terms: Mapping[Monomial, Any]) -> Element:
        """Return the element of coefficients by monomial, in the order of :attr:`generators`."""
        return Element(self, self.polynomials.from_terms(terms)).reduced()

    @cached_property
    def turning(self) -> tuple[tuple[int, int, tuple[int, ...]], ...]:
        """Places of each angle's sine and cosine, and the joints that it is the sum of."""
        cosines = {g.joints: k for k, g in enumerate(self.generators) if g.kind == "cosine"}
        return tuple((k, cosines[g.joints], g.joints) for k, g in enumerate(self.generators) if g.kind == "sine")

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

    @property
    def n(self) -> int:
        """The number of joints."""
        return len(self.kinds)

    @property
    def constants(self) -> tuple[str, ...]:
        """The constants' texts."""
        return tuple(g.text for g in self.generators if g.kind == "constant")

    def place(self, kind: str, which: int | str) -> int:
        """Return the place of a generator in a monomial, by its kind and its joint or, for a constant, its text."""
        return self._places[kind, which]

    # Values

    def values(
        self,
        constants: Mapping[str, float],
        q: Array,
        qd: Array | None = None,
        qdd: Array | None = None,
    ) -> list[Any]:
        """Return a number or an array (...) for each generator, for states (..., n)."""
        zero = np.zeros_like(q)
        states = {"rate": zero if qd is None else qd, "acceleration": zero if qdd is None else qdd, "position": q}
        values: list[Any] = []
        for g in self.generators:
            if g.kind == "constant":
                values.append(constants[g.text])
            elif g.kind in ("sine", "cosine"):
                angle = sum(q[..., joint] for joint in g.joints)
                values.append(np.sin(angle) if g.kind == "sine" else np.cos(angle))
            else:
                values.append(states[g.kind][..., g.joint])
        return values


@dataclass(frozen=True, eq=False, slots=True)
class Element:
    """An element of a ring, in normal form."""

    ring: Ring
    polynomial: Any

    # Arithmetic

    def __add__(self, other: Scalar) -> Element:
        if not isinstance(other, Element | int | Fraction):
            return NotImplemented
        return Element(self.ring, self.polynomial + self._coerced(other))

    __radd__ = __add__

    def __neg__(self) -> Element:
        return Element(self.ring, -self.polynomial)

    def __sub__(self, other: Scalar) -> Element:
        if not isinstance(other, Element | int | Fraction):
            return NotImplemented
        return Element(self.ring, self.polynomial - self._coerced(other))

    def __rsub__(self, other: Scalar) -> Element:
        if not isinstance(other, Element | int | Fraction):
            return NotImplemented
        return Element(self.ring, self._coerced(other) - self.polynomial)

    def __mul__(self, other: Scalar) -> Element:
        if not isinstance(other, Element | int | Fraction):
            return NotImplemented
        if len(self.polynomial) == 0:
            return self
        factor = self._coerced(other)
        if len(self.polynomial) * len(factor) > MAX_TERMS * 16:
            raise RingError(
                f"a product of {len(self.polynomial)} by {len(factor)} terms: too long to be derived exactly; "
                "fewer symbols (symbols='none'), or fewer joints (lock), make it shorter"
            )
        product = Element(self.ring, self.polynomial * factor).reduced()
        if len(product.polynomial) > MAX_TERMS:
            raise RingError(
                f"an expression of {len(product.polynomial)} terms, beyond {MAX_TERMS}: too long to be derived exactly;"
                " fewer symbols (symbols='none'), or fewer joints (lock), make it shorter"
            )
        return product

    __rmul__ = __mul__

    def __pow__(self, exponent: int) -> Element:
        result = self.ring.one
        for _ in range(exponent):
            result = result * self
        return result

    def _coerced(self, other: Scalar) -> Any:
        if isinstance(other, Element):
            if other.ring is not self.ring:
                raise RingError("elements of two rings; derive both from one description and with equal symbols")
            return other.polynomial
        return self.ring.polynomials.constant(other)

    def reduced(self) -> Element:
        """Return the normal form under the ring's relations."""
        return Element(self.ring, self.ring.polynomials.reduced(self.polynomial, self.ring._relations))

    # Comparing

    @property
    def is_zero(self) -> bool:
        """Whether this is zero for every state and every value of the parameters."""
        return not self or not self.ring.expanded(self)._cleared()

    def __bool__(self) -> bool:
        """Whether the normal form has a term."""
        return len(self.polynomial) > 0

    def __eq__(self, other: object) -> bool:
        if isinstance(other, Element | int | Fraction):
            return (self - other).is_zero
        return NotImplemented

    def __hash__(self) -> int:
        return hash(str(self))

    def _cleared(self) -> Element:
        """Return this times what its reciprocals are the reciprocals of: zero only together with this.

        Reciprocals of sums that share parameters have more than one form (partial fractions).
        """
        element = self
        for relation in self.ring._relations:
            if relation.power != 1:
                continue
            generator = self.ring.polynomials.generator(relation.place)
            while any(monomial[relation.place] for monomial in element.terms):
                whole = relation.polynomial + self.ring.polynomials.constant(1)
                divisor = self.ring.polynomials.quotient(whole, generator)
                element = _without(element, relation.place, divisor)
        return element

    # Reading

    @property
    def terms(self) -> Mapping[Monomial, Fraction]:
        """The coefficients by monomial, exponents in the order of the ring's generators."""
        return self.ring.polynomials.terms(self.polynomial)

    def __len__(self) -> int:
        return len(self.polynomial)

    def __str__(self) -> str:
        from dhkit.symbolic.equations import plain_text

        return plain_text(self)

    def __repr__(self) -> str:
        return f"Element({self})"

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
        for monomial, coefficient in self.terms.items():
            product: Any = float(coefficient)
            for k, exponent in enumerate(monomial):
                if exponent:
                    product = product * (values[k] if exponent == 1 else values[k] ** exponent)
            total = total + product
        return total


Elements: TypeAlias = NDArray[Any]
"""An array whose entries are elements of one ring."""

Scalar: TypeAlias = "Element | int | Fraction"


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


def angle_name(joints: Sequence[int]) -> str:
    """Return what a sum of joint angles is called: 23 for q2 + q3; 9_10 where a number has two digits."""
    numbers = [str(joint + 1) for joint in joints]
    return ("_" if any(len(number) > 1 for number in numbers) and len(numbers) > 1 else "").join(numbers)


def _without(element: Element, place: int, divisor: Any) -> Element:
    """Multiply by what the generator at ``place`` is the reciprocal of, once."""
    ring = element.ring
    with_it = {m: c for m, c in element.terms.items() if m[place]}
    rest = {m: c for m, c in element.terms.items() if not m[place]}
    lowered = {(*m[:place], m[place] - 1, *m[place + 1 :]): c for m, c in with_it.items()}
    product = ring.polynomials.from_terms(rest) * divisor
    return Element(ring, product + ring.polynomials.from_terms(lowered)).reduced()


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
    parts: dict[Monomial, dict[Monomial, Fraction]] = {}
    for monomial, coefficient in element.terms.items():
        replaced = tuple(monomial[k] for k in replacements)
        moved = [0] * len(ring.generators)
        for k in kept:
            if monomial[k]:
                moved[ring.place(own[k].kind, own[k].text if own[k].joint < 0 else own[k].joint)] = monomial[k]
        parts.setdefault(replaced, {})[tuple(moved)] = coefficient
    total = []
    for exponents, group in parts.items():
        product = ring.one
        for k, exponent in zip(replacements, exponents, strict=True):
            if exponent:
                product = product * powers.setdefault((k, exponent), replacements[k] ** exponent)
        total.append(ring.from_terms(group) * product)
    return ring.sum(total)
