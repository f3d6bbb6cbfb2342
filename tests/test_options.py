"""Options are values: the same whether they are given one by one or whole, checked when they are made."""

from dataclasses import fields, replace
from typing import get_type_hints

import numpy as np
import pytest

import dhkit
from dhkit import Arm
from dhkit.control.options import BatchKeywords, BatchOptions, SimulationKeywords, SimulationOptions
from dhkit.grading.options import GradeKeywords, GradeOptions
from dhkit.planning import PathOptions, PlanOptions
from dhkit.planning.request import PathKeywords, PlanKeywords

KINDS = {
    SimulationOptions: SimulationKeywords,
    BatchOptions: BatchKeywords,
    PathOptions: PathKeywords,
    PlanOptions: PlanKeywords,
    GradeOptions: GradeKeywords,
}
ARM = Arm.load("planar2r")


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_keywords_are_the_fields_with_their_types(kind):
    hints = get_type_hints(kind)
    assert get_type_hints(KINDS[kind]) == {field.name: hints[field.name] for field in fields(kind)}


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_a_method_takes_no_other_keyword_and_names_the_one_that_was_meant(kind):
    with pytest.raises(TypeError, match="unexpected keyword argument 'hurry'; known are "):
        kind.of(None, {"hurry": True})
    with pytest.raises(TypeError, match="options is dict; expected "):
        kind.of({"rate": 1.0}, {})


def test_a_misspelt_keyword_is_named_with_the_right_one():
    with pytest.raises(TypeError, match="'frictoin'; did you mean friction"):
        ARM.simulate(duration=0.01, frictoin=True)
    with pytest.raises(TypeError, match="'obstacle'; did you mean obstacles"):
        ARM.plan([0, 0], [1, 1], obstacle=())


def test_a_run_is_the_same_by_options_and_by_keywords():
    given = {"rate": 500.0, "restitution": None, "plant": ARM.with_payload(0.3)}
    options = SimulationOptions(**given)
    one = ARM.simulate(None, None, 0.05, [0.1, 0.2], **given)
    assert np.array_equal(one.q, ARM.simulate(None, None, 0.05, [0.1, 0.2], options=options).q)
    finer = ARM.simulate(None, None, 0.05, [0.1, 0.2], options=options, rate=1000.0)
    assert len(finer.t) == 2 * len(one.t) - 1 and options.rate == 500.0


def test_a_motion_is_the_same_by_options_and_by_keywords():
    limits = dhkit.Limits.of(ARM.description, acceleration=5.0)
    options = PlanOptions(limits=limits, start_velocity=[0.1, 0.0])
    one = ARM.plan(
        [0, 0], [0.5, 0.3], intervals=12, limits=limits, start_velocity=[0.1, 0.0], compare=False
    )
    other = ARM.plan([0, 0], [0.5, 0.3], intervals=12, options=options)
    assert one.duration == other.duration and other.report.coarse is None
    path = dhkit.trajectories.JointPath.straight(ARM.description, [0.0, 0.0], [0.5, 0.3])
    along = ARM.plan_path(path, intervals=30, options=PlanOptions(limits=limits))
    assert along.duration == ARM.plan_path(path, intervals=30, limits=limits).duration


def test_what_a_motion_along_a_path_cannot_have_is_refused():
    path = dhkit.trajectories.JointPath.straight(ARM.description, [0.0, 0.0], [0.5, 0.3])
    with pytest.raises(TypeError, match="options has start_velocity; expected PathOptions"):
        ARM.plan_path(path, options=PlanOptions(start_velocity=np.zeros(2)))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SimulationOptions(rate=-1.0), "rate is -1.0; expected"),
        (lambda: SimulationOptions(rate=None, tolerance=0.1), "tolerance is 0.1"),
        (
            lambda: SimulationOptions(plant=dhkit.control.Plant(ARM), friction=True),
            "plant is a Plant, which has its own",
        ),
        (lambda: SimulationOptions(plant=3), "plant is int; expected an arm"),
        (lambda: BatchOptions(plant=[ARM, "planar2r"]), "plant is str; expected an arm"),
        (lambda: BatchOptions(threads=0), "threads is 0"),
        (lambda: PathOptions(max_iterations=0), "max_iterations is 0"),
        (lambda: PathOptions(clearance=-1.0), "clearance"),
        (lambda: PathOptions(limits=3), "limits is 3"),
        (lambda: PlanOptions(warm="motion"), "warm is str"),
        (lambda: GradeOptions(task="task.toml"), "task is str"),
        (lambda: GradeOptions(isolation=True), "isolation is bool"),
        (lambda: replace(PlanOptions(), duration=float("nan")), "duration"),
    ],
)
def test_an_option_that_does_not_fit_is_refused_when_it_is_made(make, message):
    with pytest.raises((ValueError, TypeError), match=message):
        make()


def test_options_show_what_is_not_usual():
    assert repr(SimulationOptions()) == "<SimulationOptions>"
    assert repr(PlanOptions(clearance=0.02)) == "<PlanOptions: clearance=0.02>"
