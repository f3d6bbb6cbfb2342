"""Elements of the exact ring: polynomials in normal form, compared and differentiated exactly."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from numbers import Real
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.display import LONGEST_LINE, plain, repr_line
from dhkit.errors import DhkitError
from dhkit.expressions import Expression, exact
from dhkit.formats import format_function
from dhkit.symbolic.ring.bounds import BOUNDS
from dhkit.symbolic.ring.polynomials import Monomial, Polynomials, Relation

READABLE = 200
"""Longest element, in terms, that is printed without being asked for."""
_TOO_LONG = "too long to be derived exactly; numbers instead of symbols, or fewer joints (lock), make it shorter"


class RingError(DhkitError):
    """An expression that the exact ring does not contain, or one that is too long for it."""


@dataclass(frozen=True)
class Generator:
    """A generator of the ring.

    Attributes
    ----------
    kind
        One of sine, cosine, position (of a prismatic joint), rate, acceleration and constant.
    text
        Its text in equations: s1, c23, q2, qd1, qdd1, or the constant's text.
    joint
        Index of the joint, from 0; -1 for constants and for sums of angles that are only printed.
    joints
        For a sine or cosine, the joints whose variables add up to its angle: (1, 2) for c23.
    meaning
        The expression that a constant stands for; None for a parameter, whose text is its name.
    """

    kind: str
    text: str
    joint: int = -1
    joints: tuple[int, ...] = ()
    meaning: Expression | None = None

    @property
    def key(self) -> tuple[str, int | str]:
        """Key of the same generator in every ring of the arm: its kind, and its joint or, for constants, its text."""
        return (self.kind, self.text if self.joint < 0 else self.joint)


@dataclass(frozen=True, eq=False)
class Element:
    """An element of a ring, in normal form."""

    ring: PolynomialRing
    polynomial: Any

    # Arithmetic

    def __add__(self, other: _Scalar) -> Element:
        if not isinstance(other, Element | Real):
            return NotImplemented
        return Element(self.ring, self.polynomial + self._coerced(other))

    __radd__ = __add__

    def __neg__(self) -> Element:
        return Element(self.ring, -self.polynomial)

    def __sub__(self, other: _Scalar) -> Element:
        if not isinstance(other, Element | Real):
            return NotImplemented
        return Element(self.ring, self.polynomial - self._coerced(other))

    def __rsub__(self, other: _Scalar) -> Element:
        if not isinstance(other, Element | Real):
            return NotImplemented
        return Element(self.ring, self._coerced(other) - self.polynomial)

    def __mul__(self, other: _Scalar) -> Element:
        if not isinstance(other, Element | Real):
            return NotImplemented
        if len(self.polynomial) == 0:
            return self
        factor = self._coerced(other)
        if len(factor) == 0:
            return Element(self.ring, factor)
        if len(self.polynomial) * len(factor) > BOUNDS.pairs:
            raise RingError(
                f"a product of {len(self.polynomial)} by {len(factor)} terms: {_TOO_LONG}"
            )
        product = Element(self.ring, self.polynomial * factor).reduced()
        if len(product.polynomial) > BOUNDS.terms:
            raise RingError(
                f"an expression of {len(product.polynomial)} terms, beyond {BOUNDS.terms}: {_TOO_LONG}"
            )
        return product

    __rmul__ = __mul__

    def __pow__(self, exponent: int) -> Element:
        result = self.ring.one
        for _ in range(exponent):
            result = result * self
        return result

    def _coerced(self, other: _Scalar) -> Any:
        if isinstance(other, Element):
            if other.ring != self.ring:
                raise RingError(
                    "elements of two rings; derive both from one description and with equal symbols"
                )
            return other.polynomial
        return self.ring.polynomials.constant(_rational(other))

    def __truediv__(self, other: _Scalar) -> Element:
        if isinstance(other, Element) or not isinstance(other, Real):
            return NotImplemented
        return self * (1 / _rational(other))

    def reduced(self) -> Element:
        """Return the normal form under the ring's relations."""
        return Element(
            self.ring, self.ring.polynomials.reduced(self.polynomial, self.ring.relations)
        )

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
        # Equal elements may have different terms: with reciprocals, or with sums of angles.
        return hash(self.ring)

    def _cleared(self) -> Element:
        """Return this element times the denominators of all its reciprocals; it is zero exactly when this element is.

        The normal form does not decide equality alone: reciprocals of sums that share parameters have several forms
        (partial fractions). With y = 1/d and an element a + b y, d (a + b y) = a d + b has one y less.
        """
        element = self
        for relation in self.ring.relations:
            if relation.power != 1:
                continue
            y = self.ring.polynomials.generator(relation.place)
            while any(monomial[relation.place] for monomial in element.terms):
                # The relation is y d - 1 = 0, so d = (relation + 1) / y.
                y_d = relation.polynomial + self.ring.polynomials.constant(1)
                denominator = self.ring.polynomials.quotient(y_d, y)
                element = _times_denominator(element, relation.place, denominator)
        return element

    # Reading

    @cached_property
    def terms(self) -> Mapping[Monomial, Fraction]:
        """The coefficient of each monomial; exponents are in the order of the ring's generators."""
        return self.ring.polynomials.terms(self.polynomial)

    @property
    def used_generators(self) -> set[int]:
        """Indices of the ring's generators that occur in the normal form."""
        used: set[int] = set()
        for monomial in self.terms:
            used.update(k for k, exponent in enumerate(monomial) if exponent)
        return used

    def contains_any(self, generators: Iterable[int]) -> bool:
        """Whether a term of the normal form contains one of some generators, given by their indices in the ring."""
        listed = list(generators)

        def contains(monomial: Monomial) -> bool:
            return any(monomial[k] for k in listed)

        return any(map(contains, self.terms))

    @cached_property
    def _products(self) -> list[tuple[float, list[tuple[int, int]]]]:
        """Coefficient of each term, with the indices of its generators and their exponents."""
        products = []
        for monomial, coefficient in self.terms.items():
            powers = [(k, exponent) for k, exponent in enumerate(monomial) if exponent]
            products.append((float(coefficient), powers))
        return products

    def __len__(self) -> int:
        return len(self.polynomial)

    def __reduce__(self) -> tuple[Any, tuple[PolynomialRing, dict[Monomial, Fraction]]]:
        return PolynomialRing.from_terms, (self.ring, dict(self.terms))

    def __str__(self) -> str:
        return str(format_function("plain_text")(self))

    def __repr__(self) -> str:
        if len(self) > READABLE:
            return repr_line("Element", f"{len(self)} terms")
        return f"Element({plain(str(self), LONGEST_LINE - len('Element()'))})"

    def _repr_latex_(self) -> str | None:
        return f"${format_function('latex_text')(self)}$" if len(self) <= READABLE else None

    # Calculus

    def by_position(self, i: int) -> Element:
        """Return the partial derivative by joint i's variable.

        Parameters
        ----------
        i
            Joint, from 0.
        """
        ring = self.ring
        f = self.polynomial
        derivative = ring.polynomials.derivative
        if ring.kinds[i] != "R":
            return Element(ring, derivative(f, ring.place("position", i)))

        # df/dq_i = sum of df/ds c - df/dc s, over the angles that contain q_i
        total = ring.zero.polynomial
        for sine, cosine, joints in ring.turning:
            if i in joints:
                s = ring.polynomials.generator(sine)
                c = ring.polynomials.generator(cosine)
                total = total + derivative(f, sine) * c
                total = total - derivative(f, cosine) * s
        return Element(ring, total).reduced()

    def by_rate(self, i: int) -> Element:
        """Return the partial derivative by joint i's rate.

        Parameters
        ----------
        i
            Joint, from 0.
        """
        return Element(
            self.ring, self.ring.polynomials.derivative(self.polynomial, self.ring.place("rate", i))
        )

    def by_constant(self, text: str) -> Element:
        """Return the partial derivative by a constant that no other constant depends on.

        Parameters
        ----------
        text
            Name of the constant.
        """
        place = self.ring.place("constant", text)
        return Element(self.ring, self.ring.polynomials.derivative(self.polynomial, place))

    def by_time(self) -> Element:
        """Return the time derivative: that of q is qd, that of qd is qdd."""
        ring = self.ring
        # df/dt = sum of df/dq_i qd_i + df/dqd_i qdd_i
        by_positions = [self.by_position(i) * ring.rate(i) for i in range(ring.n)]
        by_rates = [self.by_rate(i) * ring.acceleration(i) for i in range(ring.n)]
        return ring.sum([*by_positions, *by_rates])

    def value(self, values: Sequence[Any]) -> Any:
        """Return the element's value, a number or an array (...), at :meth:`PolynomialRing.values` of a state.

        Parameters
        ----------
        values
            Values of the ring's generators.
        """
        total: Any = 0.0
        for coefficient, powers in self._products:
            product: Any = coefficient
            for k, exponent in powers:
                product = product * (values[k] if exponent == 1 else values[k] ** exponent)
            total = total + product
        return total


class PolynomialRing(ABC):
    """The part of a ring that its elements use: generators, relations between them, and construction of elements."""

    kinds: str
    """One letter a joint, R or P."""
    generators: tuple[Generator, ...]
    polynomials: Polynomials
    """Arithmetic of polynomials in the generators."""
    relations: tuple[Relation, ...]
    """Polynomials that are zero, in the order of the generators that they replace."""
    _places: dict[tuple[str, int | str], int]
    """Index of each generator by its key."""

    @abstractmethod
    def expanded(self, element: Element) -> Element:
        """Return an element in the sines and cosines of the ring's own angles alone: its normal form."""

    def _element(self, key: tuple[str, int | str]) -> Element:
        """Return the generator with this key as an element."""
        return Element(self, self.polynomials.generator(self._places[key]))

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
            The ring has no constant of that text.
        """
        if ("constant", text) not in self._places:
            raise RingError(
                f"no {text!r} in the ring; it has {', '.join(self.constants) or 'no constants'}"
            )
        return self._element(("constant", text))

    def sine(self, i: int) -> Element:
        """Return the sine of joint i's angle; joints count from 0."""
        return self._element(("sine", i))

    def cosine(self, i: int) -> Element:
        """Return the cosine of joint i's angle."""
        return self._element(("cosine", i))

    def position(self, i: int) -> Element:
        """Return the position of prismatic joint i, m."""
        return self._element(("position", i))

    def rate(self, i: int) -> Element:
        """Return joint i's rate, rad/s or m/s."""
        return self._element(("rate", i))

    def acceleration(self, i: int) -> Element:
        """Return joint i's acceleration, rad/s^2 or m/s^2."""
        return self._element(("acceleration", i))

    def sum(self, elements: Iterable[Element]) -> Element:
        """Return the sum of elements."""
        total = self.zero.polynomial
        for element in elements:
            total = total + element.polynomial
        return Element(self, total)

    def from_terms(self, terms: Mapping[Monomial, Any]) -> Element:
        """Return the element with these coefficients of monomials; exponents are in the order of :attr:`generators`."""
        return Element(self, self.polynomials.from_terms(terms)).reduced()

    @cached_property
    def turning(self) -> tuple[tuple[int, int, tuple[int, ...]], ...]:
        """Indices of each angle's sine and cosine among the generators, and the joints whose variables add up to it."""
        cosine_of = {g.joints: k for k, g in enumerate(self.generators) if g.kind == "cosine"}
        return tuple(
            (k, cosine_of[g.joints], g.joints)
            for k, g in enumerate(self.generators)
            if g.kind == "sine"
        )

    @property
    def n(self) -> int:
        """The number of joints."""
        return len(self.kinds)

    @property
    def constants(self) -> tuple[str, ...]:
        """The constants' texts."""
        return tuple(g.text for g in self.generators if g.kind == "constant")

    def place(self, kind: str, which: int | str) -> int:
        """Return the index of a generator in a monomial, by its kind and its joint or, for a constant, its text."""
        return self._places[kind, which]

    def values(
        self,
        constants: Mapping[str, float],
        q: Array,
        qd: Array | None = None,
        qdd: Array | None = None,
    ) -> list[Any]:
        """Return the value of each generator, a number or an array (...), at states (..., n), rad, m and seconds."""
        zero = np.zeros_like(q)
        states = {
            "position": q,
            "rate": zero if qd is None else qd,
            "acceleration": zero if qdd is None else qdd,
        }
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


Elements: TypeAlias = NDArray[Any]
"""An object array whose entries are elements of one ring."""


def element_array(value: Any) -> Elements:
    """Return an element, a list of elements or an array of them as an object array of the same shape."""
    array: Elements = np.empty(np.shape(value), dtype=object)
    array[...] = value
    return array


_Scalar: TypeAlias = "Element | int | float | Fraction"


def _times_denominator(element: Element, place: int, denominator: Any) -> Element:
    """Return d times an element, where the generator y at index ``place`` is the reciprocal of the denominator d."""
    # The element is a + b y, where a does not contain y. d (a + b y) = a d + b, because d y = 1.
    a: dict[Monomial, Fraction] = {}
    b: dict[Monomial, Fraction] = {}
    for monomial, coefficient in element.terms.items():
        exponent = monomial[place]
        if exponent:
            b[(*monomial[:place], exponent - 1, *monomial[place + 1 :])] = coefficient
        else:
            a[monomial] = coefficient

    ring = element.ring
    product = ring.polynomials.from_terms(a) * denominator
    return Element(ring, product + ring.polynomials.from_terms(b)).reduced()


def _rational(number: Any) -> Fraction:
    """Return the rational that a number was written as: 1e-9 is 1/10^9.

    Raises
    ------
    ExpressionError
        The number is not finite.
    """
    if isinstance(number, int | Fraction):
        return Fraction(number)
    rational = exact(number).rational
    return Fraction(0) if rational is None else rational
