"""Mistakes with sines and cosines of sums of angles: wrong sum formulas, and wrong derivatives."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import partial
from itertools import pairwise

import numpy as np

from dhkit.grading.judging.truth import Truth, kinematic_quantity, translated_array
from dhkit.grading.mistakes.variants import Addition, Variant
from dhkit.symbolic import ExactArm
from dhkit.symbolic.exact.compact import parallel_runs, shortened
from dhkit.symbolic.mistakes import MadeAt
from dhkit.symbolic.ring import Element, Elements, Ring, translated

_Formula = Callable[[Element, Element, Element, Element], tuple[Element, Element]]
"""Function that returns cosine and sine of a + b from cosine c and sine s of a, and cosine x and sine y of b."""

_FORMULAS: tuple[tuple[str, _Formula], ...] = (
    ("sum_of_angles_split", lambda c, s, x, y: (c + x, s + y)),
    ("sum_of_angles_split", lambda c, s, x, y: (c + x, s * x + c * y)),
    ("sum_of_angles_split", lambda c, s, x, y: (c * x - s * y, s + y)),
    ("sum_formula_sign", lambda c, s, x, y: (c * x + s * y, s * x + c * y)),
    ("sum_formula_sign", lambda c, s, x, y: (c * x - s * y, s * x - c * y)),
    ("sum_formula_sign", lambda c, s, x, y: (c * x + s * y, s * x - c * y)),
    ("sum_formula_sign", lambda c, s, x, y: (c * x - s * y, c * x + s * y)),
    ("angle_difference", lambda c, s, x, y: (c * x + s * y, c * y - s * x)),
)
"""Wrong formulas for the cosine and sine of a sum of two angles, with their mistakes."""


def _right(c: Element, s: Element, x: Element, y: Element) -> tuple[Element, Element]:
    """Return cos(a + b) = cos a cos b - sin a sin b and sin(a + b) = sin a cos b + cos a sin b."""
    return c * x - s * y, s * x + c * y


def sums_of_angles(arm: ExactArm, right: Addition, is_kinematic: bool = False) -> Iterator[Variant]:
    """Yield mistakes by wrong formulas for sines and cosines of sums, wherever such a sum occurs.

    Parameters
    ----------
    arm
        Arm to whose joints the angles belong.
    right
        Function that returns a quantity's right value in the robot's own joint variables.
    is_kinematic
        Whether the quantities are transforms and the Jacobian.
    """
    if not any(len(run) > 1 for run in parallel_runs(arm)):
        return
    for written in (_in_sums, shortened):
        for identity, formula in _FORMULAS:
            change = partial(_with_formula, arm, right, formula, written)
            yield Variant(MadeAt(identity), change, rarity=1, is_kinematic=is_kinematic)


def derivatives_of_cosines(truth: Truth) -> Variant:
    """Return the mistake d/dq cos(q) = sin(q) in the linear half of the Jacobian."""
    arm = truth.kinematics.arm
    kinematics = truth.kinematics

    def change(quantity: str) -> Elements:
        right = kinematic_quantity(kinematics, quantity)
        wrong = right.copy()
        if quantity == "J":
            position = _in_sums(arm, kinematics.T[:3, 3])
            for (row,), element in np.ndenumerate(position):
                for joint in range(arm.n):
                    derivative = _without_minus(element, joint)
                    wrong[row, joint] = _in_angles(arm, derivative, _right)
        return wrong - right

    return Variant(MadeAt("derivative_of_cosine"), change, is_kinematic=True)


def _without_minus(element: Element, joint: int) -> Element:
    """Return a derivative by a joint's variable in which the derivative of a cosine is the sine."""
    ring = element.ring
    if ring.kinds[joint] != "R":
        return element.by_position(joint)
    terms: dict[tuple[int, ...], Fraction] = {}
    for monomial, coefficient in element.terms.items():
        for sine, cosine, joints in ring.turning:
            if joint not in joints:
                continue
            for old, new in ((sine, cosine), (cosine, sine)):
                # d/dq of c x^k is k c x^(k-1) y, for sine x and cosine y, and the reverse.
                k = monomial[old]
                if not k:
                    continue
                exponents = list(monomial)
                exponents[old] -= 1
                exponents[new] += 1
                term = tuple(exponents)
                terms[term] = terms.get(term, Fraction(0)) + k * coefficient
    return ring.from_terms(terms)


def _with_formula(
    arm: ExactArm,
    right: Addition,
    formula: _Formula,
    written: Callable[[ExactArm, Elements], Elements],
    quantity: str,
) -> Elements:
    """Return the change if sines and cosines of sums, as they are written, are computed by another formula."""
    value = right(quantity)
    changed = np.empty(value.shape, dtype=object)
    for place, element in np.ndenumerate(written(arm, value)):
        changed[place] = _in_angles(arm, element, formula) - value[place]
    return changed


def _in_angles(arm: ExactArm, element: Element, formula: _Formula) -> Element:
    """Return an element in single angles that is written in sums of angles, by a formula for the sums."""
    ring = arm.ring
    single: dict[int, Element] = {}
    for sine, cosine, joints in element.ring.turning:
        c = ring.cosine(joints[0])
        s = ring.sine(joints[0])
        for joint in joints[1:]:
            c, s = formula(c, s, ring.cosine(joint), ring.sine(joint))
        single |= {sine: s, cosine: c}
    return translated(element, ring, single)


def _in_sums(arm: ExactArm, array: Elements) -> Elements:
    """Return elements written in sums of the angles of parallel axes, each with a sine and cosine of its own."""
    angles: dict[int, tuple[int, ...]] = {}
    for run in parallel_runs(arm):
        for k, joint in enumerate(run):
            angles[joint] = run[: k + 1]
    ring = Ring(arm.ring.kinds, arm.ring.given, angles)

    # In the new ring a joint has the angle a = b + q, and the joint before it b:
    #   cos q = cos(a - b) = cos a cos b + sin a sin b,    sin q = sin(a - b) = sin a cos b - cos a sin b
    single: dict[int, Element] = {}
    for run in parallel_runs(arm):
        for previous, joint in pairwise(run):
            cos_a = ring.cosine(joint)
            sin_a = ring.sine(joint)
            cos_b = ring.cosine(previous)
            sin_b = ring.sine(previous)
            single[arm.ring.place("cosine", joint)] = cos_a * cos_b + sin_a * sin_b
            single[arm.ring.place("sine", joint)] = sin_a * cos_b - cos_a * sin_b
    return translated_array(array, single, ring)
