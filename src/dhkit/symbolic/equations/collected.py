"""Elements of the ring collected for reading: by accelerations and products of rates, then by constants.

All printers print this form. Multiplied out, it has the element's terms and no others.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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
    """Whether a constant is written in a denominator."""
    if generator.meaning is None or len(generator.meaning.terms) != 1:
        return False
    ((monomial, coefficient),) = generator.meaning.terms
    return coefficient == 1 and len(monomial) == 1 and monomial[0][1] == -1


def collected(element: Element) -> Sum:
    """Return an element's terms collected by accelerations, by products of rates, and then by constants."""
    order = _order(element.ring)
    groups: dict[Powers, list[_Term]] = {}
    for monomial, coefficient in element.terms.items():
        powers = sorted((order.positions[k], exponent) for k, exponent in enumerate(monomial) if exponent)
        motion = tuple(power for power in powers if power[0] >= order.motion)
        groups.setdefault(motion, []).append((tuple(powers[: len(powers) - len(motion)]), coefficient))
    products: list[Product] = []
    for collector in _motions(order, groups):
        if collector[0].powers:
            products.append(_factored(order, groups[collector[0].powers], collector))
        else:
            products += _without_brackets(_factored(order, groups[()]))
    return tuple(_in_places(order, product) for product in products)


def _motions(order: _Order, groups: Mapping[Powers, list[_Term]]) -> list[Sum]:
    """Return the products of rates and accelerations to collect by, in order; rates of equal factors are summed."""
    motions: list[Sum] = []
    alike: dict[frozenset[_Term], tuple[int, Fraction]] = {}
    for powers in sorted(groups, key=_motion_key):
        own = Product(Fraction(1), powers)
        if len(powers) != 1 or powers[0][1] > 1 or powers[0][0] < order.rates:
            motions.append((own,))
            continue
        leading = min(groups[powers])[1]
        shape = frozenset((monomial, coefficient / leading) for monomial, coefficient in groups[powers])
        if shape in alike:
            k, first = alike[shape]
            motions[k] += (Product(leading / first, powers),)
        else:
            alike[shape] = len(motions), leading
            motions.append((own,))
    return motions


@lru_cache(maxsize=64)
def _order(ring: Ring) -> _Order:
    def key(place: int) -> tuple[int, tuple[int, ...], int]:
        g = ring.generators[place]
        if g.kind == "constant":
            derived = g.meaning is not None and g.meaning.text not in g.meaning.symbols
            if derived:
                return 2, (), place
            return (0 if _INERTIAL.match(g.text) else 1), (), place
        if g.kind in ("sine", "cosine"):
            return 4, g.joints, int(g.kind == "sine")
        return {"position": 3, "acceleration": 5, "rate": 6}[g.kind], (g.joint,), place

    places = tuple(sorted(range(len(ring.generators)), key=key))
    ranks = [key(place)[0] for place in places]
    positions = [0] * len(places)
    for position, place in enumerate(places):
        positions[place] = position
    constants, inertial, motion, rates = (sum(rank < limit for rank in ranks) for limit in (3, 1, 5, 6))
    return _Order(places, tuple(positions), constants, inertial, motion, rates)


def _motion_key(motion: Powers) -> tuple[bool, Sequence[int]]:
    """Sort accelerations before rates, qd1^2 before qd1*qd2 before qd2^2, and terms without either last."""
    return not motion, [position for position, exponent in motion for _ in range(exponent)]


def _factored(order: _Order, terms: Sequence[_Term], motion: Sum = ()) -> Product:
    """Return terms as a common factor times a sum without common factor."""
    common = dict(terms[0][0])
    for powers, _ in terms[1:]:
        held = dict(powers)
        common = {position: min(e, held[position]) for position, e in common.items() if position in held}
    size = _content([abs(coefficient) for _, coefficient in terms])
    rest = [(_divided(powers, common), coefficient / size) for powers, coefficient in terms]
    front = tuple(sorted(common.items()))
    if len(rest) == 1:
        return Product(size * rest[0][1], front, (), motion)
    products = _sum(order, rest)
    takes_sign = all(abs(coefficient) == size for _, coefficient in terms)
    if all(product.coefficient < 0 for product in products[: 1 if takes_sign else None]):
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
    alike: dict[Powers, list[_Term]] = {}
    for powers, coefficient in rest:
        alike.setdefault(tuple(p for p in powers if p[0] < order.constants), []).append((powers, coefficient))
    for constants, group in alike.items():
        if constants:
            products.append(_factored(order, group))
        else:
            products += [Product(coefficient, powers) for powers, coefficient in group]
    return tuple(sorted(products, key=lambda product: _key(order, product)))


def _content(sizes: Sequence[Fraction]) -> Fraction:
    """Return the number that is factored out of a sum: one that all coefficients share, or their greatest divisor."""
    if all(size == sizes[0] for size in sizes):
        return sizes[0]
    return Fraction(gcd(*(int(size) for size in sizes)) if all(size.denominator == 1 for size in sizes) else 1)


def _without_brackets(product: Product) -> Sum:
    """Return the terms of a product whose brackets are not needed."""
    if not product.factor or product.powers or abs(product.coefficient) != 1:
        return (product,)
    return product.factor if product.coefficient > 0 else tuple(_negative(inner) for inner in product.factor)


def _family(order: _Order, terms: Sequence[_Term]) -> list[int]:
    """Return constants that occur in several terms each, linearly and never two in one term.

    Masses and inertias are tried first: equations of motion are linear in them.
    """
    counts: dict[int, int] = {}
    squared: set[int] = set()
    for powers, _ in terms:
        for position, exponent in powers:
            if position >= order.constants:
                break
            counts[position] = counts.get(position, 0) + 1
            if exponent > 1:
                squared.add(position)
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
    return any(place == position for place, _ in term[0])


def _divided(powers: Powers, common: dict[int, int]) -> Powers:
    return tuple((p, e - common.get(p, 0)) for p, e in powers if e > common.get(p, 0))


def _negative(product: Product) -> Product:
    return Product(-product.coefficient, product.powers, product.factor, product.motion)


def _key(order: _Order, product: Product) -> tuple[int, int, list[int], list[int]]:
    """Sort by the leading mass or inertia, the degree in sines and cosines, these themselves, then other constants."""
    powers: list[int] = []
    leading: Product | None = product
    while leading is not None:
        powers += [position for position, exponent in leading.powers for _ in range(exponent)]
        leading = leading.factor[0] if leading.factor else None
    constants = sorted(position for position in powers if position < order.constants)
    variables = sorted(position for position in powers if position >= order.constants)
    inertial = constants[0] if constants and constants[0] < order.inertial else -1
    return inertial, len(variables), variables, constants


def _in_places(order: _Order, product: Product) -> Product:
    """Return a product with indices in the ring instead of positions in the written order."""

    def placed(powers: Powers) -> Powers:
        return tuple((order.places[position], exponent) for position, exponent in powers)

    factor, motion = (tuple(_in_places(order, inner) for inner in part) for part in (product.factor, product.motion))
    return Product(product.coefficient, placed(product.powers), factor, motion)
