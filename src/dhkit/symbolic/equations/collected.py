"""Elements of the ring collected for reading: by accelerations and products of rates, then by constants.

All printers print this form. Multiplied out, it has the element's terms and no others.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from fractions import Fraction
from functools import lru_cache
from math import gcd
from typing import TypeAlias

from dhkit.symbolic.ring import Element, Generator, Ring

Powers: TypeAlias = tuple[tuple[int, int], ...]
"""Indices of generators in the ring, with exponents, in the order in which a product is written."""

_INERTIAL = re.compile(r"[mIJ]|(XX|YY|ZZ|XY|YZ|XZ|MX|MY|MZ|r[xyz])\d")
"""Names that are written first in a product: masses, inertias and first moments. They decide only about the order."""


@dataclass(frozen=True)
class Product:
    """``coefficient * powers * (factor) * (motion)``.

    Attributes
    ----------
    coefficient
        A rational number other than zero.
    powers
        Factors written first: constants, then sines and cosines.
    factor
        A sum in brackets; empty if there is none.
    motion
        Rates and accelerations: one product of them, or a sum in brackets.
    """

    coefficient: Fraction
    powers: Powers = ()
    factor: Sum = ()
    motion: Sum = ()


Sum: TypeAlias = tuple[Product, ...]

_Term: TypeAlias = tuple[Powers, Fraction]


@dataclass(frozen=True)
class _Order:
    """The order in which a ring's generators are written: constants, then positions, sines and cosines, then rates."""

    places: tuple[int, ...]
    """Index of the generator that is written first, second, ..."""
    positions: tuple[int, ...]
    """Position in the written order of each generator: the inverse of ``places``."""
    constants: int
    """Positions before this one are constants."""
    inertial: int
    """Positions before this one are masses and inertias."""
    motion: int
    """Positions from this one on are rates and accelerations."""
    rates: int
    """Positions from this one on are rates."""


def is_reciprocal(generator: Generator) -> bool:
    """Return whether a constant is written in a denominator."""
    if generator.meaning is None or len(generator.meaning.terms) != 1:
        return False
    ((monomial, coefficient),) = generator.meaning.terms
    return coefficient == 1 and len(monomial) == 1 and monomial[0][1] == -1


def collected(element: Element) -> Sum:
    """Return an element's terms collected by accelerations, by products of rates, and then by constants."""
    order = _order(element.ring)

    # Terms by their rates and accelerations, which are written last.
    groups: dict[Powers, list[_Term]] = {}
    for monomial, coefficient in element.terms.items():
        powers = sorted(
            (order.positions[k], exponent) for k, exponent in enumerate(monomial) if exponent
        )
        motion = tuple(power for power in powers if power[0] >= order.motion)
        rest = tuple(powers[: len(powers) - len(motion)])
        groups.setdefault(motion, []).append((rest, coefficient))

    products: list[Product] = []
    for motion_sum in _motions(order, groups):
        motion = motion_sum[0].powers
        if motion:
            products.append(_factored(order, groups[motion], motion_sum))
        else:
            products += _without_brackets(_factored(order, groups[()]))
    return tuple(_in_places(order, product) for product in products)


def _motions(order: _Order, groups: Mapping[Powers, list[_Term]]) -> list[Sum]:
    """Return the products of rates and accelerations to collect by, in order; rates of equal factors are summed."""
    motions: list[Sum] = []
    # Of each factor that a single rate has: the index in the result, and the number that it was divided by.
    by_factor: dict[frozenset[_Term], tuple[int, Fraction]] = {}
    for powers in sorted(groups, key=_motion_key):
        own = Product(Fraction(1), powers)
        is_single_rate = len(powers) == 1 and powers[0][1] == 1 and powers[0][0] >= order.rates
        if not is_single_rate:
            motions.append((own,))
            continue

        # Factors are compared up to a number: m qd1 + 2 m qd2 is written m (qd1 + 2 qd2).
        _, leading = min(groups[powers])
        factor = frozenset(
            (monomial, coefficient / leading) for monomial, coefficient in groups[powers]
        )
        if factor in by_factor:
            k, first_leading = by_factor[factor]
            motions[k] += (Product(leading / first_leading, powers),)
        else:
            by_factor[factor] = (len(motions), leading)
            motions.append((own,))
    return motions


class _Rank(IntEnum):
    """The kinds of generators in the order in which they are written."""

    INERTIAL = 0
    NAME = 1
    DERIVED = 2
    POSITION = 3
    ANGLE = 4
    ACCELERATION = 5
    RATE = 6


_RANKS = {"position": _Rank.POSITION, "acceleration": _Rank.ACCELERATION, "rate": _Rank.RATE}


def _rank(generator: Generator) -> _Rank:
    """Return the kind by which a generator is ordered."""
    if generator.kind in ("sine", "cosine"):
        return _Rank.ANGLE
    if generator.kind != "constant":
        return _RANKS[generator.kind]
    meaning = generator.meaning
    if meaning is not None and meaning.text not in meaning.symbols:
        return _Rank.DERIVED
    return _Rank.INERTIAL if _INERTIAL.match(generator.text) else _Rank.NAME


@lru_cache(maxsize=64)
def _order(ring: Ring) -> _Order:
    """Return the order in which a ring's generators are written."""

    def key(place: int) -> tuple[_Rank, tuple[int, ...], int]:
        generator = ring.generators[place]
        rank = _rank(generator)
        if rank is _Rank.ANGLE:
            return rank, generator.joints, int(generator.kind == "sine")
        if generator.kind == "constant":
            return rank, (), place
        return rank, (generator.joint,), place

    places = tuple(sorted(range(len(ring.generators)), key=key))
    positions = [0] * len(places)
    for position, place in enumerate(places):
        positions[place] = position

    ranks = [_rank(ring.generators[place]) for place in places]
    return _Order(
        places=places,
        positions=tuple(positions),
        constants=sum(rank < _Rank.POSITION for rank in ranks),
        inertial=sum(rank == _Rank.INERTIAL for rank in ranks),
        motion=sum(rank < _Rank.ACCELERATION for rank in ranks),
        rates=sum(rank < _Rank.RATE for rank in ranks),
    )


def _repeated(powers: Powers) -> list[int]:
    """Return each position as often as its exponent says."""
    positions: list[int] = []
    for position, exponent in powers:
        positions += [position] * exponent
    return positions


def _motion_key(motion: Powers) -> tuple[bool, Sequence[int]]:
    """Sort accelerations before rates, qd1^2 before qd1*qd2 before qd2^2, and terms without either last."""
    return not motion, _repeated(motion)


def _factored(order: _Order, terms: Sequence[_Term], motion: Sum = ()) -> Product:
    """Return terms as a common factor times a sum without common factor."""
    # The common factor: the powers that all terms share, and a number.
    common = dict(terms[0][0])
    for powers, _ in terms[1:]:
        own = dict(powers)
        common = {
            position: min(e, own[position]) for position, e in common.items() if position in own
        }
    size = _content([abs(coefficient) for _, coefficient in terms])
    rest = [(_divided(powers, common), coefficient / size) for powers, coefficient in terms]
    front = tuple(sorted(common.items()))
    if len(rest) == 1:
        return Product(size * rest[0][1], front, (), motion)

    # The sign is factored out of a sum without a positive term; with coefficients +-1, of one that begins negative.
    products = _sum(order, rest)
    all_are_units = all(abs(coefficient) == size for _, coefficient in terms)
    decisive = products[:1] if all_are_units else products
    if all(product.coefficient < 0 for product in decisive):
        size = -size
        products = tuple(_negative(product) for product in products)
    return Product(size, front, products, motion)


def _sum(order: _Order, terms: Sequence[_Term]) -> Sum:
    """Return a sum of terms without common factor, grouped by constants that never occur together."""
    products = []
    rest = list(terms)
    for position in _family(order, terms):
        group = [term for term in rest if _has(term, position)]
        rest = [term for term in rest if not _has(term, position)]
        products.append(_factored(order, group))

    # The terms that are left, by their constants.
    by_constants: dict[Powers, list[_Term]] = {}
    for powers, coefficient in rest:
        constants = tuple(power for power in powers if power[0] < order.constants)
        by_constants.setdefault(constants, []).append((powers, coefficient))
    for constants, group in by_constants.items():
        if constants:
            products.append(_factored(order, group))
        else:
            products += [Product(coefficient, powers) for powers, coefficient in group]
    return tuple(sorted(products, key=lambda product: _key(order, product)))


def _content(sizes: Sequence[Fraction]) -> Fraction:
    """Return the number that is factored out of a sum: one that all coefficients share, or their greatest divisor."""
    if all(size == sizes[0] for size in sizes):
        return sizes[0]
    if all(size.denominator == 1 for size in sizes):
        return Fraction(gcd(*(size.numerator for size in sizes)))
    return Fraction(1)


def _without_brackets(product: Product) -> Sum:
    """Return the terms of a product whose brackets are not needed."""
    needs_brackets = product.powers or abs(product.coefficient) != 1
    if not product.factor or needs_brackets:
        return (product,)
    if product.coefficient > 0:
        return product.factor
    return tuple(_negative(inner) for inner in product.factor)


def _family(order: _Order, terms: Sequence[_Term]) -> list[int]:
    """Return constants that occur in several terms each, linearly and never two in one term.

    Masses and inertias are tried first: equations of motion are linear in them.
    """
    counts: dict[int, int] = {}  # number of terms that contain a constant
    squared: set[int] = set()
    for powers, _ in terms:
        for position, exponent in powers:
            if position >= order.constants:
                break
            counts[position] = counts.get(position, 0) + 1
            if exponent > 1:
                squared.add(position)

    # A constant joins the family if none of its terms contains another member.
    family: list[int] = []
    free = list(terms)
    for position in sorted(counts, key=lambda p: (p >= order.inertial, -counts[p], p)):
        if counts[position] < 2 or position in squared:
            continue
        without = [term for term in free if not _has(term, position)]
        if len(free) - len(without) == counts[position]:
            family.append(position)
            free = without
    return family


def _has(term: _Term, position: int) -> bool:
    """Return whether a generator occurs in a term."""
    powers, _ = term
    return any(place == position for place, _ in powers)


def _divided(powers: Powers, common: dict[int, int]) -> Powers:
    """Return powers divided by common ones."""
    return tuple((p, e - common.get(p, 0)) for p, e in powers if e > common.get(p, 0))


def _negative(product: Product) -> Product:
    """Return a product with the other sign."""
    return Product(-product.coefficient, product.powers, product.factor, product.motion)


def _key(order: _Order, product: Product) -> tuple[int, int, list[int], list[int]]:
    """Sort by the leading mass or inertia, the degree in sines and cosines, these themselves, then other constants."""
    powers: list[int] = []
    leading: Product | None = product
    while leading is not None:
        powers += _repeated(leading.powers)
        leading = leading.factor[0] if leading.factor else None
    constants = sorted(position for position in powers if position < order.constants)
    variables = sorted(position for position in powers if position >= order.constants)
    inertial = constants[0] if constants and constants[0] < order.inertial else -1
    return inertial, len(variables), variables, constants


def _in_places(order: _Order, product: Product) -> Product:
    """Return a product with indices in the ring instead of positions in the written order."""
    return Product(
        coefficient=product.coefficient,
        powers=tuple((order.places[position], exponent) for position, exponent in product.powers),
        factor=tuple(_in_places(order, inner) for inner in product.factor),
        motion=tuple(_in_places(order, inner) for inner in product.motion),
    )
