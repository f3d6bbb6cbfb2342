"""The textbook kinematics: right they are the arm's, and each mistake shows."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from dhkit.description import (
    Tool,
    from_dh,
    library_robot,
    link_transforms,
    lock,
    pose,
    robots,
    with_base,
    with_tool,
    world_to_tool,
)
from dhkit.description.values import Placement
from dhkit.expressions import parse
from dhkit.kinematics import jacobian
from dhkit.symbolic import MadeAt, exact_arm
from dhkit.symbolic.textbook_kinematics import (
    JACOBIAN_MISTAKES,
    KINEMATIC_MISTAKES,
    LINK_MISTAKES,
    POSE_MISTAKES,
    derive_kinematics,
    with_massless_links,
)

ROUNDING = 1e-12  # of sums of a few hundred terms of order one

ODD_BASE = pose((0.1, -0.2, 0.3), euler=(0.3, -0.7, 1.1))
ODD_TOOL = pose((0.05, 0.02, -0.11), euler=(-0.4, 0.9, 0.2))


@cache
def placed(name):
    """A library robot on a turned base and with a turned tool."""
    turned = pose((0.1, -0.2, 0.3), euler=(90, 0, 0), degrees=True)
    held = pose((0.05, 0.02, -0.11), euler=(0, 90, 0), degrees=True)
    return with_tool(with_base(library_robot(name), turned), held)


def states(description, count=5):
    return np.random.default_rng(1).uniform(-2, 2, (count, description.n))


def check(description, symbols="file"):
    derived, q = derive_kinematics(description, symbols=symbols), states(description)
    A = derived.arm.evaluate(np.array(derived.A), q)
    np.testing.assert_allclose(A, link_transforms(description, q), atol=ROUNDING)
    np.testing.assert_allclose(
        derived.arm.evaluate(derived.T, q), world_to_tool(description, q), atol=ROUNDING
    )
    np.testing.assert_allclose(
        derived.arm.evaluate(derived.J, q), jacobian(description, q), atol=ROUNDING
    )


@pytest.mark.parametrize("name", robots())
def test_right_kinematics_are_the_arms_own(name):
    check(library_robot(name))


@pytest.mark.parametrize("name", ["planar2r", "stanford", "al5d", "polar_rp", "cobra600"])
def test_base_and_tool_may_stand_anyhow(name):
    check(with_tool(with_base(library_robot(name), ODD_BASE), ODD_TOOL))


@pytest.mark.parametrize("symbols", ["none", "inertial"])
def test_other_choices_of_symbols(symbols):
    check(placed("planar3r"), symbols)
    check(placed("polar_rp"), symbols)


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_links_need_no_bodies(convention):
    rows = [(0.3, "h", 0.1, "pi/2"), ("pi/3", 0.1, 0.2, 0.4), (0, "h/2", "l", "-pi/2")]
    arm = from_dh(rows, kinds="RPR", convention=convention, parameters={"h": 0.4, "l": 0.7})
    check(arm)
    assert with_massless_links(arm).joints[0].body is not None


def test_the_jacobian_is_the_derivative_of_the_position():
    derived = derive_kinematics(placed("stanford"))
    for i in range(derived.arm.n):
        assert all(derived.T[k, 3].by_position(i) == derived.J[k, i] for k in range(3))


@pytest.mark.parametrize("name", ["planar2r", "puma560"])
def test_the_ring_is_that_of_the_dynamics(name):
    description = library_robot(name)
    assert with_massless_links(description) is description
    assert derive_kinematics(description).arm is exact_arm(description, "file")
    assert derive_kinematics(placed(name)).arm is exact_arm(placed(name), "file")


def test_a_tool_turned_by_a_parameter():
    arm = from_dh([(0, 0, "l", 0), (0, 0, 0, "pi/2")], parameters={"l": 0.5, "tilt": 0.3})
    tilt, zero = parse("2*tilt + pi/4", ["tilt"]), parse("0")
    check(replace(arm, tool=Tool(Placement((zero, zero, zero), (tilt, zero, tilt)))))


def changed(name, mistake):
    """Which of A, T and J a mistake changes."""
    right, wrong = derive_kinematics(placed(name)), derive_kinematics(placed(name), {mistake})
    equal = {
        "A": all((a == b).all() for a, b in zip(right.A, wrong.A, strict=True)),
        "T": (right.T == wrong.T).all(),
        "J": (right.J == wrong.J).all(),
    }
    return {quantity for quantity, same in equal.items() if not same}


@pytest.mark.parametrize("mistake", KINEMATIC_MISTAKES)
def test_every_mistake_changes_something(mistake):
    """On an arm with a prismatic joint, offsets and lengths, or on a modified one."""
    found = changed("stanford", mistake) | changed("polar_rp", mistake) | changed("al5d", mistake)
    assert "J" in found or mistake in ("theta_sin_cos", "pose_inverted")
    assert ("T" in found) == (mistake not in JACOBIAN_MISTAKES)
    in_product = {"translations_unrotated", *POSE_MISTAKES} - {"convention_exchanged"}
    assert ("A" in found) == (
        mistake in LINK_MISTAKES.keys() | {"convention_exchanged"} and mistake not in in_product
    )


@pytest.mark.parametrize("mistake", sorted(LINK_MISTAKES))
def test_at_one_link_the_other_links_stay_right(mistake):
    right = derive_kinematics(placed("stanford"))
    wrong = derive_kinematics(placed("stanford"), {MadeAt(mistake, 3)})
    assert all((right.A[i] == wrong.A[i]).all() for i in range(6) if i != 2)
    assert all((right.frames[i] == wrong.frames[i]).all() for i in range(3))


def test_the_other_convention_read_twice_is_right():
    """The elementary motions of a modified table, put in reverse, are the standard ones'."""
    rows = [(0, 0.3, 0.1, "pi/2"), (0, 0.1, 0.2, "-pi/2")]
    standard = derive_kinematics(from_dh(rows))
    wrong = derive_kinematics(from_dh(rows, convention="modified"), {"convention_exchanged"})
    assert (standard.T == wrong.T).all()
    assert (standard.J == wrong.J).all()


def test_a_locked_arm_keeps_its_kinematics():
    check(lock(library_robot("puma560"), {3: 0.3, 5: -0.2}))


@pytest.mark.parametrize(
    ("mistakes", "error", "complaint"),
    [
        ("tool_forgotten", TypeError, "expected a set of identities"),
        ({3}, TypeError, "expected MadeAt"),
        ({"tool"}, ValueError, "no mistake 'tool'"),
        ({MadeAt("alpha_sign", 3)}, ValueError, "no link 3; expected 1 to 2"),
        ({"alpha_sign@x"}, ValueError, "no mistake 'alpha_sign@x'"),
        ({MadeAt("tool_forgotten", 1)}, ValueError, "concerns the whole arm"),
    ],
)
def test_unknown_mistakes_are_refused(mistakes, error, complaint):
    with pytest.raises(error, match=complaint):
        derive_kinematics(library_robot("planar2r"), mistakes)
