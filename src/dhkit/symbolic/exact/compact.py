"""Equations written with sums of joint angles, c23 for c2*c3 - s2*s3, where parallel axes make that shorter.

Proofs use the ring's normal form in single angles; for reading, each entry is written in the angles that give it the
fewest terms.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import islice, product
from typing import TypeAlias

import numpy as np

from dhkit.symbolic.exact.exact_arm import ExactArm
from dhkit.symbolic.ring import Element, Elements, Ring, translated
from dhkit.symbolic.ring.bounds import BOUNDS
from dhkit.symbolic.ring.polynomials import Monomial
from dhkit.symbolic.ring.reading import difference_of_angles


def parallel_runs(arm: ExactArm) -> list[tuple[int, ...]]:
    """Return runs of revolute joints, counted from 0, whose axes are parallel and point the same way.

    Prismatic joints between them are skipped: they leave the axes parallel.
    """
    runs: list[list[int]] = [[]]
    for i, cosine in enumerate(_cosines_of_twists(arm)):
        if not (cosine - 1).is_zero:
            runs.append([])
        if arm.ring.kinds[i] == "R":
            runs[-1].append(i)
    return [tuple(run) for run in runs if len(run) > 1]


def _cosines_of_twists(arm: ExactArm) -> list[Element]:
    """Return the cosine of the angle from each joint's axis before (z of frame 0 for the first) to its own."""
    cosines = [row.alpha[0] for row in arm.rows]
    # In a standard row alpha leads to the next joint's axis, in a modified one from the axis before.
    return [arm.ring.one, *cosines[:-1]] if arm.is_standard else cosines


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
        candidates = [element]
        candidates += [
            _merge_angles(translated(element, ring, directions)) for ring, directions in writings
        ]
        shortest[place] = min(candidates, key=len)
    return shortest


def shortened_alike(arm: ExactArm, elements: Sequence[Element]) -> list[Element]:
    """Return elements in one choice of angles for all, the one with the fewest terms together, to compare them."""
    runs = parallel_runs(arm)
    candidates = [list(elements)]
    if runs:
        for ring, directions in _rings_in_other_angles(arm.ring, tuple(runs)):
            candidates.append(
                [_merge_angles(translated(element, ring, directions)) for element in elements]
            )
    return min(candidates, key=lambda written: sum(map(len, written)))


@lru_cache(maxsize=64)
def _rings_in_other_angles(
    ring: Ring, runs: tuple[tuple[int, ...], ...]
) -> list[tuple[Ring, dict[int, Element]]]:
    """Return rings in other angles, each with the sines and cosines of the given ring's joints in its own."""
    sums: list[tuple[int, ...]] = []
    for run in runs:
        for a in range(len(run)):
            sums += [run[a:b] for b in range(a + 1, len(run) + 1)]

    choices = islice(_choices_of_angles(runs), BOUNDS.angle_choices)
    rings = [Ring(ring.kinds, ring.given, angles, sums) for angles in choices]
    return [(other, _sines_and_cosines(ring, other)) for other in rings]


def _choices_of_angles(runs: Sequence[tuple[int, ...]]) -> Iterator[dict[int, tuple[int, ...]]]:
    """Yield choices of angles, as the joints that each angle sums: in each run, sums begin at some joint or nowhere.

    For the run of joints 1, 2, 3 these are (q1, q2, q3), (q1, q2, q2 + q3) and (q1, q1 + q2, q1 + q2 + q3).
    """
    for starts in product(*(range(len(run)) for run in runs)):
        angles: dict[int, tuple[int, ...]] = {}
        for run, start in zip(runs, starts, strict=True):
            # Place in the run of the joint at which the sums begin; the last joint alone is not a sum.
            first = len(run) - 1 - start
            for k in range(first + 1, len(run)):
                angles[run[k]] = run[first : k + 1]
        yield angles


def _sines_and_cosines(old: Ring, new: Ring) -> dict[int, Element]:
    """Return the sines and cosines of the old ring's joints in the new ring's angles, by index in the old ring."""
    replacements: dict[int, Element] = {}
    for i, joints in new.angles.items():
        direction = (new.cosine(i), new.sine(i))
        if len(joints) > 1:
            # q_i = (q_a + ... + q_h + q_i) - (q_a + ... + q_h), two angles of the new ring
            before = joints[-2]
            direction = difference_of_angles(direction, (new.cosine(before), new.sine(before)))
        c, s = direction
        replacements[old.place("sine", i)] = s
        replacements[old.place("cosine", i)] = c
    return replacements


def _merge_angles(element: Element) -> Element:
    """Return the element with products merged into sums of angles (addition theorem) wherever that shortens it."""
    ring = element.ring
    terms = dict(element.terms)
    angles = {joints: (sine, cosine) for sine, cosine, joints in ring.turning}
    changed = True
    while changed:
        changed = False
        for first, second in product(angles, angles):
            a = angles[first]
            b = angles[second]
            if first[-1] < second[0] and first + second in angles:
                changed |= _add(terms, a, b, angles[first + second])
            elif len(first) > len(second) and first[: len(second)] == second:
                rest = first[len(second) :]
                changed |= _subtract(terms, a, b, angles[rest])
    return ring.from_terms(terms)


_Places: TypeAlias = tuple[int, int]
"""Indices of an angle's sine and cosine in a monomial."""
_Pair: TypeAlias = tuple[int, int]
"""Indices of two generators that are multiplied."""


def _add(terms: dict[Monomial, Fraction], a: _Places, b: _Places, total: _Places) -> bool:
    """Write cos a cos b - sin a sin b as cos(a + b), and sin a cos b + cos a sin b as sin(a + b)."""
    sa, ca = a
    sb, cb = b
    s, c = total
    cosines = _merge_pairs(terms, (ca, cb), (sa, sb), c, -1)
    sines = _merge_pairs(terms, (sa, cb), (ca, sb), s, 1)
    return cosines or sines


def _subtract(terms: dict[Monomial, Fraction], a: _Places, b: _Places, difference: _Places) -> bool:
    """Write cos a cos b + sin a sin b as cos(a - b), and sin a cos b - cos a sin b as sin(a - b)."""
    sa, ca = a
    sb, cb = b
    s, c = difference
    cosines = _merge_pairs(terms, (ca, cb), (sa, sb), c, 1)
    sines = _merge_pairs(terms, (sa, cb), (ca, sb), s, -1)
    return cosines or sines


def _merge_pairs(
    terms: dict[Monomial, Fraction], first: _Pair, second: _Pair, merged: int, sign: int
) -> bool:
    """Replace k x first + sign k x second by k x merged, for each monomial x; return whether any was replaced.

    ``first`` and ``second`` are products of two generators, ``merged`` is one generator.
    """
    found = False
    for monomial in [m for m in terms if m[first[0]] and m[first[1]]]:
        coefficient = terms.get(monomial)
        if coefficient is None:
            continue  # an earlier merge removed this term

        x = list(monomial)
        for place in first:
            x[place] -= 1
        with_second = list(x)
        for place in second:
            with_second[place] += 1
        partner = tuple(with_second)
        if terms.get(partner) != sign * coefficient:
            continue

        x[merged] += 1
        with_merged = tuple(x)
        del terms[monomial], terms[partner]
        terms[with_merged] = terms.get(with_merged, Fraction(0)) + coefficient
        if not terms[with_merged]:
            del terms[with_merged]
        found = True
    return found
