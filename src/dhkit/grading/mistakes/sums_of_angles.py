"""Mistakes with the sines and cosines of sums of angles: wrong formulas for them, and wrong derivatives."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import partial
from itertools import pairwise

import numpy as np

from dhkit.grading.judging.truth import Truth, kinematic_quantity
from dhkit.grading.mistakes.variants import Make, Variant
from dhkit.symbolic import ExactArm
from dhkit.symbolic.exact.compact import parallel_runs, shortened
from dhkit.symbolic.mistakes import MadeAt
from dhkit.symbolic.ring import Element, Elements, Ring, translated

Formula = Callable[[Element, Element, Element, Element], tuple[Element, Element]]
"""Gives cosine and sine of a + b from cosine and sine of a, and of b."""

FORMULAS: tuple[tuple[str, Formula], ...] = (
    ("sum_of_angles_split", lambda c, s, x, y: (c + x, s + y)),
    ("sum_of_angles_split", lambda c, s, x, y: (c + x, s * x + c * y)),
    ("sum_of_angles_split", lambda c, s, x, y: (c * x - s * y, s + y)),
    ("sum_formula_sign", lambda c, s, x, y: (c * x + s * y, s * x + c * y)),
    ("sum_formula_sign", lambda c, s, x, y: (c * x - s * y, s * x - c * y)),
    ("sum_formula_sign", lambda c, s, x, y: (c * x + s * y, s * x - c * y)),
    ("sum_formula_sign", lambda c, s, x, y: (c * x - s * y, c * x + s * y)),
    ("angle_difference", lambda c, s, x, y: (c * x + s * y, c * y - s * x)),
)


def _right(c: Element, s: Element, x: Element, y: Element) -> tuple[Element, Element]:
    return c * x - s * y, s * x + c * y


def sums_of_angles(arm: ExactArm, right: Make, is_kinematic: bool = False) -> Iterator[Variant]:
    """Yield wrong formulas for the sines and cosines of sums, wherever such a sum stands.

    Parameters
    ----------
    arm
        Whose angles they are.
    right
        Returns a quantity's right value in the robot's own joint variables.
    is_kinematic
        Whether the quantities are transforms and the Jacobian.
    """
    if any(len(run) > 1 for run in parallel_runs(arm)):
        for written in (_in_sums, shortened):
            for identity, formula in FORMULAS:
                change = partial(_with_formula, arm, right, formula, written)
                yield Variant(MadeAt(identity), change, rarity=1, is_kinematic=is_kinematic)


def derivatives_of_cosines(truth: Truth) -> Variant:
    """Return the Jacobian whose linear half is differentiated with d/dq cos(q) = sin(q)."""
    arm, kinematics = truth.kinematics.arm, truth.kinematics

    def change(quantity: str) -> Elements:
        right = kinematic_quantity(kinematics, quantity)
        wrong = right.copy()
        if quantity == "J":
            for place, element in np.ndenumerate(_in_sums(arm, kinematics.T[:3, 3])):
                for joint in range(arm.n):
                    derivative = _without_minus(element, joint)
                    wrong[place[0], joint] = _in_angles(arm, derivative, _right)
        return wrong - right

    return Variant(MadeAt("derivative_of_cosine"), change, is_kinematic=True)


def _without_minus(element: Element, joint: int) -> Element:
    """Return a derivative by a joint's variable in which that of a cosine is the sine."""
    ring = element.ring
    if ring.kinds[joint] != "R":
        return element.by_position(joint)
    terms: dict[tuple[int, ...], Fraction] = {}
    for monomial, coefficient in element.terms.items():
        for sine, cosine, joints in ring.turning:
            for old, new in ((sine, cosine), (cosine, sine)):
                if joint in joints and monomial[old]:
                    powers = list(monomial)
                    powers[old] -= 1
                    powers[new] += 1
                    term = coefficient * monomial[old]
                    terms[tuple(powers)] = terms.get(tuple(powers), Fraction(0)) + term
    return ring.from_terms(terms)


def _with_formula(
    arm: ExactArm,
    right: Make,
    formula: Formula,
    written: Callable[[ExactArm, Elements], Elements],
    quantity: str,
) -> Elements:
    """Return what changes where sines and cosines of sums, as they are written, are worked out by another formula."""
    value = right(quantity)
    changed = np.empty(value.shape, dtype=object)
    for place, element in np.ndenumerate(written(arm, value)):
        changed[place] = _in_angles(arm, element, formula) - value[place]
    return changed


def _in_angles(arm: ExactArm, element: Element, formula: Formula) -> Element:
    """Return an element of sums of angles in the single angles, by a formula for the sums."""
    ring = arm.ring
    single: dict[int, Element] = {}
    for sine, cosine, joints in element.ring.turning:
        c, s = ring.cosine(joints[0]), ring.sine(joints[0])
        for joint in joints[1:]:
            c, s = formula(c, s, ring.cosine(joint), ring.sine(joint))
        single |= {sine: s, cosine: c}
    return translated(element, ring, single)


def _in_sums(arm: ExactArm, array: Elements) -> Elements:
    """Return elements with a sine and a cosine of their own for the angles of parallel axes, counted from the first."""
    angles = {joint: run[: k + 1] for run in parallel_runs(arm) for k, joint in enumerate(run)}
    ring = Ring(arm.ring.kinds, arm.ring.given, angles)
    turned: dict[int, Element] = {}
    for run in parallel_runs(arm):
        for before, joint in pairwise(run):
            c, s = ring.cosine(joint), ring.sine(joint)
            x, y = ring.cosine(before), ring.sine(before)
            turned[arm.ring.place("cosine", joint)] = c * x + s * y
            turned[arm.ring.place("sine", joint)] = s * x - c * y
    written = np.empty(array.shape, dtype=object)
    for place, element in np.ndenumerate(array):
        written[place] = translated(element, ring, turned)
    return written
