"""Whether decimals that were rounded allow the truth: each may be off by half a unit of its last digit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from dhkit.symbolic.ring import Element, Ring

__all__ = ["Rounding", "rounded"]

STEPS = 4
"""Of Newton's method: products of decimals are nearly linear in so small moves."""
MOST = 1_000
"""Decimals of an entry: a PUMA's longest in numbers has 300."""
RESIDUAL = 1e-13
"""What counts as no difference, relative to a monomial's coefficient: linprog's doubles, one step later squared."""


@dataclass(frozen=True)
class Rounding:
    """How decimals must be moved for an answer to be the truth.

    Attributes
    ----------
    moves
        By how much, by their nodes in the syntax tree.
    share
        The largest move, as a share of half a unit of the decimal's last digit.
    """

    moves: Mapping[int, Fraction]
    share: float


def rounded(
    residuals: Callable[[Mapping[int, Fraction]], Sequence[Element]],
    units: Mapping[int, Fraction],
    slopes_at: Callable[[Mapping[int, Fraction]], Mapping[int, Sequence[Element]]] | None = None,
) -> Rounding | None:
    """Return the smallest moves of decimals that make all residuals zero; None if they must leave their half units.

    Every coefficient of every monomial is an equation in the decimals. They are linearised about the decimals by exact
    differences, and the least largest move solved for; what is left over is of second order, and is solved for again.

    Parameters
    ----------
    residuals
        What must be zero, given by how much decimals are moved.
    units
        Half a unit of the last digit of each decimal.
    slopes_at
        By how much residuals change when one decimal is moved by its unit, for each decimal; differences of residuals
        unless given.
    """
    if not units or len(units) > MOST:
        return None
    moves = dict.fromkeys(units, Fraction(0))
    scale: dict[Any, float] = {}
    for _ in range(STEPS):
        left = residuals(moves)
        here = _coefficients(left)
        if slopes_at is not None:
            slopes = {at: _coefficients(change) for at, change in slopes_at(moves).items()}
        else:
            slopes = {
                at: _difference(_coefficients(residuals({**moves, at: moves[at] + unit})), here)
                for at, unit in units.items()
            }
        for found in (here, *slopes.values()):
            for place, value in found.items():
                scale[place] = max(scale.get(place, 0.0), abs(float(value)))
        step = _least_step(here, slopes, {at: float(moves[at] / units[at]) for at in units}, scale)
        if step is None:
            return None
        moves = {at: moves[at] + Fraction(step[at]) * units[at] for at in units}
        last = _coefficients(residuals(moves))
        if all(abs(float(value)) <= RESIDUAL * max(scale.get(place, 0.0), 1e-300) for place, value in last.items()):
            share = max(abs(float(moves[at] / units[at])) for at in units)
            return Rounding(moves, share) if share <= 1 + 1e-9 else None
    return None


Coefficients = Mapping[Any, Fraction]


def _coefficients(residuals: Sequence[Element]) -> Coefficients:
    """Return coefficients by residual and monomial; roots and cosines that are numbers are part of coefficients."""
    numbers = _numbers(residuals[0].ring) if residuals else {}
    if not numbers:
        return {(k, m): c for k, element in enumerate(residuals) for m, c in element.terms.items()}
    found: dict[Any, Fraction] = {}
    for k, element in enumerate(residuals):
        for monomial, coefficient in element.terms.items():
            rest = tuple(0 if place in numbers else e for place, e in enumerate(monomial))
            for place, number in numbers.items():
                coefficient *= number ** monomial[place]
            found[k, rest] = found.get((k, rest), Fraction(0)) + coefficient
    return found


def _numbers(ring: Ring) -> dict[int, Fraction]:
    """Return the ring's constants that are numbers, by their places."""
    return {
        place: generator.meaning.value()
        for place, generator in enumerate(ring.generators)
        if generator.meaning is not None and not generator.meaning.symbols
    }


def _difference(a: Coefficients, b: Coefficients) -> Coefficients:
    found = {place: a.get(place, Fraction(0)) - b.get(place, Fraction(0)) for place in {*a, *b}}
    return {place: value for place, value in found.items() if value}


def _least_step(
    here: Coefficients, slopes: Mapping[int, Coefficients], done: Mapping[int, float], scale: Mapping[Any, float]
) -> dict[int, float] | None:
    """Minimise the largest move with all equations fulfilled to first order; moves in half units."""
    from scipy.optimize import linprog
    from scipy.sparse import csr_array, eye_array, hstack, vstack

    moved = {place for slope in slopes.values() for place in slope}
    if any(place not in moved for place, value in here.items() if abs(float(value)) > RESIDUAL * scale[place]):
        return None  # a coefficient that no decimal has a part in
    places, ats = sorted(moved, key=repr), list(slopes)
    row_of = {place: k for k, place in enumerate(places)}
    size = np.zeros(len(places))
    for slope in slopes.values():
        for place, value in slope.items():
            size[row_of[place]] = max(size[row_of[place]], abs(float(value)))
    entries = [
        (row_of[place], j, float(value) / size[row_of[place]])
        for j, at in enumerate(ats)
        for place, value in slopes[at].items()
    ]
    right = -np.array([float(here.get(place, 0)) for place in places]) / size
    # Variables: steps, then the largest move; |done + step| <= largest.
    k = len(ats)
    before = np.array([done[at] for at in ats])
    rows, columns, values = zip(*entries, strict=True)
    equations = csr_array((values, (rows, columns)), shape=(len(places), k + 1))
    largest = -np.ones((k, 1))
    bounds = vstack([hstack([eye_array(k), largest]), hstack([-eye_array(k), largest])], format="csr")
    result = linprog(
        np.r_[np.zeros(k), 1.0],
        A_ub=bounds,
        b_ub=np.r_[-before, before],
        A_eq=equations,
        b_eq=right,
        bounds=[(None, None)] * k + [(0, 1.5)],
        method="highs",
    )
    return dict(zip(ats, result.x[:k].tolist(), strict=True)) if result.status == 0 else None
