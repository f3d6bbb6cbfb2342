"""Equations written with sums of joint angles, c23 for c2*c3 - s2*s3, where parallel axes make that shorter.

Proofs use the ring's normal form in single angles; for reading, each entry is written in the angles that give it the
fewest terms.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import islice, product

import numpy as np

from dhkit.symbolic.exact.exact_arm import ExactArm
from dhkit.symbolic.ring import Element, Elements, Ring, translated
from dhkit.symbolic.ring.bounds import BOUNDS
from dhkit.symbolic.ring.polynomials import Monomial


def parallel_runs(arm: ExactArm) -> list[tuple[int, ...]]:
    """Return runs of revolute joints, counted from 0, whose axes are parallel and point the same way.

    Prismatic joints between them are skipped: they leave the axes parallel.
    """
    runs: list[list[int]] = [[]]
    for i, row in enumerate(arm.rows):
        twist = row.alpha[0] if not arm.is_standard else arm.rows[i - 1].alpha[0] if i else arm.ring.one
        if not (twist - 1).is_zero:
            runs.append([])
        if arm.ring.kinds[i] == "R":
            runs[-1].append(i)
    return [tuple(run) for run in runs if len(run) > 1]


def shortened(arm: ExactArm, elements: Elements) -> Elements:
    """Return equal elements, each in the angles that give it the fewest terms.

    Parameters
    ----------
    arm
        The arm of whose ring they are.
    elements
        An array of elements.
    """
    runs = parallel_runs(arm)
    if not runs:
        return elements
    writings = _rings_in_other_angles(arm.ring, tuple(runs))
    shortest = np.empty(elements.shape, dtype=object)
    for place, element in np.ndenumerate(elements):
        written = (_merge_angles(translated(element, ring, turns)) for ring, turns in writings)
        shortest[place] = min([element, *written], key=len)
    return shortest


def shortened_alike(arm: ExactArm, elements: Sequence[Element]) -> list[Element]:
    """Return elements in one choice of angles for all, the one with the fewest terms together, to compare them."""
    runs = parallel_runs(arm)
    ways = [list(elements)]
    for ring, turns in _rings_in_other_angles(arm.ring, tuple(runs)) if runs else []:
        ways.append([_merge_angles(translated(element, ring, turns)) for element in elements])
    return min(ways, key=lambda written: sum(map(len, written)))


@lru_cache(maxsize=64)
def _rings_in_other_angles(ring: Ring, runs: tuple[tuple[int, ...], ...]) -> list[tuple[Ring, dict[int, Element]]]:
    """Return rings in other angles, each with the sines and cosines of the given ring's joints in its own."""
    sums = [run[a:b] for run in runs for a in range(len(run)) for b in range(a + 1, len(run) + 1)]
    rings = [
        Ring(ring.kinds, ring.given, angles, sums) for angles in islice(_choices_of_angles(runs), BOUNDS.angle_choices)
    ]
    return [(other, _sines_and_cosines(ring, other)) for other in rings]


def _choices_of_angles(runs: Sequence[tuple[int, ...]]) -> Iterator[dict[int, tuple[int, ...]]]:
    """Yield choices of angles, as the joints that each angle sums: in each run, sums begin at some joint or nowhere."""
    for starts in product(*(range(len(run)) for run in runs)):
        angles: dict[int, tuple[int, ...]] = {}
        for run, start in zip(runs, starts, strict=True):
            summed = len(run) - 1 - start  # the first choice has no sums
            angles |= {run[k]: run[summed : k + 1] for k in range(summed + 1, len(run))}
        yield angles


def _sines_and_cosines(old: Ring, new: Ring) -> dict[int, Element]:
    """Return the sines and cosines of the old ring's joints in the new ring's angles, by index in the old ring."""
    turns: dict[int, Element] = {}
    for i, joints in new.angles.items():
        s = new.sine(i)
        c = new.cosine(i)
        if len(joints) > 1:
            before = joints[-2]
            s_before = new.sine(before)
            c_before = new.cosine(before)
            s, c = s * c_before - c * s_before, c * c_before + s * s_before
        turns[old.place("sine", i)] = s
        turns[old.place("cosine", i)] = c
    return turns


def _merge_angles(element: Element) -> Element:
    """Return the element with products merged into sums of angles (addition theorem) wherever that shortens it."""
    ring = element.ring
    terms = dict(element.terms)
    angles = {joints: (sine, cosine) for sine, cosine, joints in ring.turning}
    changed = True
    while changed:
        changed = False
        for first, second in product(angles, angles):
            if first[-1] < second[0] and first + second in angles:
                changed |= _add(terms, angles[first], angles[second], angles[first + second])
            elif len(first) > len(second) and first[: len(second)] == second:
                changed |= _subtract(terms, angles[first], angles[second], angles[first[len(second) :]])
    return ring.from_terms(terms)


_Places = tuple[int, int]
"""Indices of an angle's sine and cosine in a monomial."""


def _add(terms: dict[Monomial, Fraction], a: _Places, b: _Places, total: _Places) -> bool:
    """Write cos a cos b - sin a sin b as cos(a + b), and sin a cos b + cos a sin b as sin(a + b)."""
    sa, ca = a
    sb, cb = b
    s, c = total
    one = _paired(terms, (ca, cb), (sa, sb), c, -1)
    return _paired(terms, (sa, cb), (ca, sb), s, 1) or one


def _subtract(terms: dict[Monomial, Fraction], a: _Places, b: _Places, difference: _Places) -> bool:
    """Write cos a cos b + sin a sin b as cos(a - b), and sin a cos b - cos a sin b as sin(a - b)."""
    sa, ca = a
    sb, cb = b
    s, c = difference
    one = _paired(terms, (ca, cb), (sa, sb), c, 1)
    return _paired(terms, (sa, cb), (ca, sb), s, -1) or one


def _paired(terms: dict[Monomial, Fraction], first: _Places, second: _Places, merged: int, sign: int) -> bool:
    """Replace x first + sign x second by x merged for every monomial x; return whether any was replaced."""
    found = False
    for monomial in [m for m in terms if m[first[0]] and m[first[1]]]:
        coefficient = terms.get(monomial)
        rest = list(monomial)
        for k in first:
            rest[k] -= 1
        partner = list(rest)
        for k in second:
            partner[k] += 1
        if coefficient is None or terms.get(tuple(partner)) != sign * coefficient:
            continue
        rest[merged] += 1
        del terms[monomial], terms[tuple(partner)]
        terms[tuple(rest)] = terms.get(tuple(rest), Fraction(0)) + coefficient
        if not terms[tuple(rest)]:
            del terms[tuple(rest)]
        found = True
    return found
