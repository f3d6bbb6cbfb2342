"""All controllers on one motion: the tables of docs/control.md, made anew, and how large errors may be."""

from functools import cache
from math import floor, log10
from pathlib import Path

import numpy as np
import pytest
from benchmarks.controllers import (
    BEGIN,
    COMPENSATED,
    END,
    HEADINGS,
    Errors,
    cases,
    errors_of,
    table,
    with_tables,
)

from acceptance import only_accepting
from dhkit.control import CONTROLLERS, PID, Plant, compare, make_controller
from dhkit.description import library_robot
from dhkit.trajectories import quintic

PAGE = Path(__file__).resolve().parents[2] / "docs" / "control.md"
LAST_DIGIT = 0.6
"""Of the last printed digit: a half from rounding, and a tenth for rounding on another machine."""
QUICK = ("pid", "computed-torque")
"""Controllers whose rows are made again in `make test`, for two rods."""
ARMS = ("puma560", "planar2r", "puma560_cao")
ALL_ROWS = [pytest.param(name, marks=only_accepting) for name in ARMS]
"""All rows take half a minute an arm: they are made again in `make accept`."""

BOUNDS = {
    "puma560": {
        "pd": (5.5e-2, 1.2e-1, 1.2e-1),
        "pid": (1e-2, 3.6e-2, 3.2e-2),
        "pd-gravity": (1.6e-2, 7e-2, 7.5e-2),
        "feed-forward": (5.2e-5, 6e-2, 7e-2),
        "computed-torque": (3e-5, 5.2e-2, 6e-2),
        "operational-space": (8.1e-5, 8.3e-2, 1.3e-1),
        "adaptive": (2.4e-5, 2.7e-2, 4.2e-2),
        "lqr": (3.2e-2, 3.9e-2, 3.8e-2),
    },
    "planar2r": {
        "pd": (2.1e-1, 3.6e-1, 2.1e-1),
        "pid": (8.8e-2, 1.5e-1, 8.8e-2),
        "pd-gravity": (3.2e-2, 1.5e-1, 3.3e-2),
        "feed-forward": (2.8e-4, 1.3e-1, 1.8e-3),
        "computed-torque": (2.3e-4, 1.3e-1, 1.7e-3),
        "operational-space": (1.8e-4, 1.2e-1, 1.4e-3),
        "adaptive": (1.1e-4, 6.2e-2, 7.7e-4),
        "lqr": (4.8e-2, 7.3e-2, 4.8e-2),
    },
    "puma560_cao": {
        "pd": (6e-2, 1.3e-1, 1.1e-1),
        "pid": (2e-2, 4.4e-2, 3e-2),
        "pd-gravity": (1.5e-2, 7.2e-2, 5.4e-2),
        "feed-forward": (4.7e-5, 6.5e-2, 5.1e-2),
        "computed-torque": (3.7e-5, 5.9e-2, 3.9e-2),
        "operational-space": (3.3e-5, 7.8e-2, 5.8e-2),
        "adaptive": (2.4e-5, 3.6e-2, 2.3e-2),
        "lqr": (4.6e-2, 5.3e-2, 4.9e-2),
    },
}
"""Largest joint errors, rad, about twice those seen: with the right model, an unknown payload, and friction."""
COMPENSATED_BOUND = {"puma560": 5e-5, "planar2r": 2.3e-4, "puma560_cao": 4.5e-5}
"""Largest joint error of computed torque with friction that is compensated, rad, twice that seen."""
MODEL_BASED = ("feed-forward", "computed-torque", "operational-space", "adaptive")


def case_of(name):
    return next(case for case in cases() if case.arm.description.name == name)


@cache
def all_errors(name):
    return errors_of(case_of(name))


def printed_rows(name):
    """Return the numbers of an arm's table in the page, rows by their controllers' names."""
    page = PAGE.read_text("utf-8").split(BEGIN)[1].split(END)[0]
    lines = page.split(case_of(name).text)[1].strip().split("\n\n")[0].splitlines()
    assert [cell.strip() for cell in lines[0].strip("|").split("|")] == [
        "controller",
        *HEADINGS.values(),
    ]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]
    return {row[0]: row[1:] for row in rows}


def check_row(printed, errors, where):
    for cell, field in zip(printed, HEADINGS, strict=True):
        value = getattr(errors, field)
        if value is None:
            assert cell == "", where
            continue
        digit = 10.0 ** (floor(log10(float(cell))) - 1)
        assert abs(value - float(cell)) <= LAST_DIGIT * digit, (
            f"{where}, {field}: {value:.3g}; the page has {cell}"
        )


@pytest.mark.slow
def test_some_rows_of_the_page_are_made_again():
    """Run `make assets` when this or the next test fails."""
    printed, errors = printed_rows("planar2r"), errors_of(case_of("planar2r"), QUICK)
    for name in (*QUICK, COMPENSATED):
        check_row(printed[name], errors[name], f"planar2r, {name}")


@pytest.mark.slow
@pytest.mark.parametrize("name", ALL_ROWS)
def test_the_tables_of_the_page_are_made_again(name):
    printed, errors = printed_rows(name), all_errors(name)
    assert list(printed) == list(errors)
    for controller, row in errors.items():
        check_row(printed[controller], row, f"{name}, {controller}")


@pytest.mark.slow
@pytest.mark.parametrize("name", ALL_ROWS)
def test_errors_are_as_small_as_controllers_can_make_them(name, law):
    law.samples(1)
    errors = all_errors(name)
    assert set(BOUNDS[name]) == set(CONTROLLERS)
    for controller, bounds in BOUNDS[name].items():
        row = errors[controller]
        for kind, seen, bound in zip(
            ("right model", "unknown payload", "friction"),
            (row.peak, row.payload, row.friction),
            bounds,
            strict=True,
        ):
            law.holds(f"{name}: {controller}, {kind}, rad", seen, bound)
    law.holds(f"{name}: {COMPENSATED}, rad", errors[COMPENSATED].friction, COMPENSATED_BOUND[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", ALL_ROWS)
def test_what_the_page_says_of_the_tables(name):
    errors = all_errors(name)
    for controller in MODEL_BASED:
        assert errors[controller].peak < errors["pid"].peak / 100
        assert errors[controller].payload > 100 * errors[controller].peak
    assert errors["adaptive"].payload == min(
        errors[controller].payload for controller in CONTROLLERS
    )
    if name != "planar2r":
        assert errors["pid"].payload < errors["computed-torque"].payload
        assert errors["pid"].friction < errors["computed-torque"].friction
    assert errors[COMPENSATED].friction < 2 * errors["computed-torque"].peak


def test_a_page_keeps_what_stands_around_its_tables(monkeypatch):
    some = Errors(0.012345, 1.7e-5, 1e-5, 97.0, 0.1, 7.0)
    monkeypatch.setattr("benchmarks.controllers.errors_of", lambda case, progress: {"pid": some})
    text = with_tables(f"before\n{BEGIN}\nold\n{END}\nafter")
    assert text.startswith(f"before\n{BEGIN}\n\n**`puma560`**") and text.endswith(
        f"|\n\n{END}\nafter"
    )
    assert text.count("| pid | 0.012 | 1.7e-05 | 1.0e-05 | 97 | 0.10 | 7.0 |") == 3
    assert with_tables(text) == text
    assert table({"x": Errors(None, None, None, None, None, 1.0)}).endswith(
        "| x |  |  |  |  |  | 1.0 |"
    )
    for wrong in ("", BEGIN, f"{END}{BEGIN}", f"{BEGIN}{BEGIN}{END}", f"{BEGIN}{END}{END}"):
        with pytest.raises(ValueError, match="expected one line"):
            with_tables(wrong)


RODS = library_robot("planar2r")
MOTION = quintic(RODS, [0.0, 0.5], [0.2, 0.7], 0.1)


def test_controllers_are_compared_on_the_same_motion():
    seen = []
    plant = Plant(RODS, restitution=None)
    comparison = compare(
        RODS, MOTION, ("pid", "lqr"), bandwidth=10.0, done=seen.append, plant=plant, rate=500
    )
    assert seen == list(comparison.results) == ["pid", "lqr"]
    assert not comparison.failures
    for run in comparison.results.values():
        assert len(run.t) == 51
        assert np.array_equal(run.reference_q[-1], MOTION.q(MOTION.duration))


def test_one_that_fails_is_named_and_the_others_go_on(monkeypatch):
    def broken(arm, w, z, q):
        return lambda *given: [np.nan] * 2

    monkeypatch.setitem(CONTROLLERS, "lqr", broken)
    comparison = compare(RODS, MOTION, ("lqr", "pd"))
    assert list(comparison.results) == ["pd"]
    assert comparison.failures == {
        "lqr": "the controller returned [nan, nan] at 0 s; expected (2,) finite torques",
    }


def test_a_controller_by_its_name_has_the_gains_that_were_asked_for():
    made, own = make_controller("pid", RODS, 15.0, 0.8), PID.tuned(RODS, 15.0, 0.8)
    assert (
        np.array_equal(made.kp, own.kp)
        and np.array_equal(made.ki, own.ki)
        and np.array_equal(made.kd, own.kd)
    )
    # An adaptive controller has real poles.
    adaptive = make_controller("adaptive", RODS, 15.0, 0.8)
    assert np.allclose(adaptive.decay, 15.0)
    with pytest.raises(
        ValueError, match="controller is 'bang'; expected one of pd, pid, pd-gravity"
    ):
        make_controller("bang", RODS)


def test_controllers_in_a_list_are_refused_with_what_is_expected():
    robot = library_robot("planar2r")
    motion = quintic(robot, [0.0, 0.3], [1.2, -0.8], duration=1.5)
    with pytest.raises(TypeError, match="found PID in a list; expected names, or a mapping"):
        compare(robot, motion, [PID.tuned(robot)])
