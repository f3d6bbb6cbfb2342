"""Every mistake of the library, made on every robot of the corpus: judged wrong, and named."""

import numpy as np
import pytest

from dhkit.grading import grade_answers
from dhkit.grading.judging.truth import kinematic_quantity, truth_of
from dhkit.grading.mistakes.diagnosis import variants_of
from dhkit.symbolic.mistakes import MISTAKES
from dhkit.symbolic.ring import element_array
from dhkit.symbolic.textbook import derive
from grading_answers import ROBOTS, constants_dropped, corpus_robot, is_zero, named, written

pytestmark = pytest.mark.slow

DYNAMICS = ("M", "h", "g", "tau", "K", "V")


def mutated(description, variant, quantity):
    """Return a quantity of a derivation with a mistake: derived anew where the textbook makes it."""
    truth = truth_of(description)
    if variant.identity in MISTAKES:
        wrong = derive(description, {variant.made})
        return element_array(getattr(wrong, quantity)) - truth.of(quantity)
    return variant.adds_to(quantity, truth.coordinates)


@pytest.mark.parametrize("robot", ROBOTS)
def test_every_mistake_is_found_and_named(robot, law):
    """Exactly for every quantity that it changes; an equivalent mistake's name is as good."""
    description = corpus_robot(robot)
    truth = truth_of(description)
    cases = [
        (variant, quantity)
        for variant in variants_of(truth, frozenset()).dynamic
        for quantity in DYNAMICS
    ]
    size = law.samples(len(cases))
    chosen = np.random.default_rng(0).permutation(len(cases))[:size]
    missed = []
    for k in sorted(chosen):
        variant, quantity = cases[k]
        change = element_array(mutated(description, variant, quantity))
        if quantity == "V":
            change = element_array(constants_dropped(change.item()))
        if is_zero(change):
            continue
        answer = element_array(truth.of(quantity) + change)
        report = grade_answers(description, {quantity: written(answer, truth.arm(quantity))})
        found = named(report)
        if report.verdict.value != "wrong" or not {variant.identity, variant.name} & found:
            missed.append((variant.name, quantity, str(report)))
    law.holds("mistakes that are not found or not named", len(missed), 0, missed[:3])


@pytest.mark.parametrize("robot", [*ROBOTS, "puma560"])
def test_every_kinematic_mistake_is_found_and_named(robot, law):
    description = corpus_robot(robot)
    truth = truth_of(description)
    quantities = [*(f"A{i + 1}" for i in range(description.n)), "T", "J"]
    cases = [
        (variant, quantity)
        for variant in variants_of(truth, frozenset()).kinematic
        for quantity in quantities
    ]
    size = law.samples(min(len(cases), 400))
    missed = []
    for k in sorted(np.random.default_rng(1).permutation(len(cases))[:size]):
        variant, quantity = cases[k]
        change = element_array(variant.adds_to(quantity, truth.coordinates))
        if is_zero(change):
            continue
        answer = kinematic_quantity(truth.kinematics, quantity) + change
        report = grade_answers(description, {quantity: written(answer, truth.arm(quantity))})
        if report.verdict.value != "wrong" or variant.identity not in named(report):
            missed.append((variant.name, quantity, str(report)))
    law.holds("mistakes that are not found or not named", len(missed), 0, missed[:3])
