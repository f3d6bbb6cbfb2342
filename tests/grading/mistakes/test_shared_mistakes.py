"""Arms that differ in numbers of parameters alone share the derivations of mistakes; nothing else differs by that."""

from dataclasses import replace

import pytest

from acceptance import slow_if
from dhkit.description import library_robot, with_parameters
from dhkit.grading import grade_answers
from dhkit.grading.judging.truth import Truth, truth_of
from dhkit.grading.mistakes import diagnosis
from dhkit.grading.mistakes.diagnosis import Variants, variants_of
from grading_answers import written

ROBOTS = ("cart_pendulum", "planar2r", "planar3r", "polar_rp")
SLOW = ("planar2r", "planar3r")
DYNAMICS = ("M", "h", "g", "tau", "K", "V", "L")
SEED = 3


@pytest.fixture(autouse=True)
def _forgotten():
    """Begin without mistakes of other arms, and leave none."""
    forget()
    yield
    forget()


def forget():
    for cache in (diagnosis._mistakes_of, variants_of, truth_of):
        cache.cache_clear()


def with_other_numbers(arm):
    """Return an arm with parameters that are not in the ratio of the first arm's."""
    numbers = {
        name: value.rational * (10 + k) / 13
        for k, (name, value) in enumerate(arm.parameters.items())
    }
    return with_parameters(arm, **numbers)


def table(truth, numbers, quantity):
    """Return the mistakes in a quantity, with the normal forms of what they change."""
    variants = Variants(truth, frozenset(numbers))
    variants.prepare(quantity)
    return [
        (one.variant.made, one.variant.name, one.variant.rarity, one.keys)
        for one in variants._changes[quantity]
    ]


@pytest.mark.parametrize("robot", [slow_if(name in SLOW, name) for name in ROBOTS])
@pytest.mark.parametrize(("absolute", "friction"), [(False, False), (True, True)])
def test_shared_mistakes_are_those_of_the_arm(robot, absolute, friction):
    first = library_robot(robot)
    second = with_other_numbers(first)
    quantities = (*DYNAMICS, "A1", "T", "J")
    own = truth_of(second, absolute, friction)
    some = list(first.parameters)[1:3]
    expected = {}
    for quantity in quantities:
        expected[quantity] = [table(own, numbers, quantity) for numbers in ((), some)]

    forget()
    variants = variants_of(truth_of(first, absolute, friction), frozenset())
    shared = truth_of(second, absolute, friction)
    assert Variants(shared, frozenset()).dynamic is variants.dynamic
    assert Variants(shared, frozenset()).kinematic is variants.kinematic
    for quantity in quantities:
        variants.prepare(quantity)
        found = [table(shared, numbers, quantity) for numbers in ((), some)]
        assert found == expected[quantity]


def wrong_answers(arm):
    """Return answers with the arm's numbers, of which each has another kind of mistake."""
    truth = truth_of(arm)
    variants = Variants(truth, frozenset())
    for variant in variants.dynamic[::9]:
        change = variant.adds_to("g", truth.coordinates)
        for numbers in ((), truth.lagrangian.arm.parameters):
            answer = truth.with_numbers("g", truth.of("g") + change, numbers)
            yield {"g": written(answer, truth.arm("g"))}
    for variant in variants.kinematic[::5]:
        yield {
            "J": written(truth.of("J") + variant.adds_to("J", truth.coordinates), truth.arm("J"))
        }


@pytest.mark.parametrize("robot", [slow_if(True, "planar2r"), "polar_rp"])
def test_reports_do_not_depend_on_who_was_judged_before(robot):
    first = library_robot(robot)
    second = with_other_numbers(first)
    answers = list(wrong_answers(second))
    forget()
    alone = [grade_answers(second, one, seed=SEED) for one in answers]
    forget()
    for one in answers:
        grade_answers(first, one, seed=SEED)
    after = [grade_answers(second, one, seed=SEED) for one in answers]
    assert after == alone
    assert any(report.diagnosis for report in alone)


def test_what_is_not_a_number_of_a_parameter_is_not_shared():
    arm = library_robot("planar2r")
    others = [
        replace(arm, gravity=tuple(-x for x in arm.gravity)),
        replace(arm, joints=(replace(arm.joints[0], d=arm.joints[1].a), arm.joints[1])),
        with_parameters(arm, l2="2*l1"),
        with_parameters(arm, l1=2),
    ]
    lists = []
    for one in (arm, *others):
        truth = truth_of(one)
        lists += [Variants(truth, frozenset()).dynamic]
        lists += [Variants(Truth(one, truth.coordinates, True), frozenset()).dynamic]
    # The last arm has the lists of the first.
    assert len({id(one) for one in lists}) == 2 * len(others)
    assert lists[-2] is lists[0]
    assert lists[-1] is lists[1]
