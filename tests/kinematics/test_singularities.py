"""Laws of singularities in closed form: a determinant that is a product, and configurations where it vanishes."""

import json
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given, strategies as st

from dhkit.cli import main
from dhkit.description import from_dh, library_robot, robots
from dhkit.errors import ModelError
from dhkit.expressions import exact
from dhkit.kinematics import IKFlag, classify, forward_kinematics, inverse_kinematics, jacobian
from dhkit.kinematics.manipulability import freedoms, manipulability
from dhkit.kinematics.singularities import (
    determinant,
    measures,
    singular_configurations,
    singularities,
)
from dhkit.model import pinocchio_model
from dhkit.verification import random_states
from random_arms import elbow_arms, few_joint_arms, slide_arms, states, three_parallel_arms

PRODUCT = 1e-12  # of the determinant, as a share of its factors' sizes
SINGULAR = 1e-12  # of a singular configuration's smallest singular value, as a share of the largest
UNKNOWN = {"jaco", "panda", "pan_tilt", "cart_pendulum"}
KNOWN = [name for name in robots() if name not in UNKNOWN]
SIX_JOINTS = [name for name in KNOWN if library_robot(name).n == 6]
EACH = [(name, kind) for name in KNOWN for kind in singularities(library_robot(name)).kinds]
ARMS = st.one_of(elbow_arms(), three_parallel_arms(), slide_arms(), few_joint_arms())


def controlled(arm, q):
    """Return the square Jacobian of what an arm controls."""
    return singularities(arm).task @ jacobian(arm, q, "tool")


def size(arm, J):
    """Return what rounding of a determinant is measured by: the factors' sizes, and Hadamard's bound."""
    factors = np.prod([factor.size for factor in singularities(arm).factors])
    return np.maximum(factors, np.linalg.norm(J, axis=-2).prod(axis=-1))


@pytest.mark.parametrize("name", KNOWN)
def test_the_determinant_is_the_product_of_its_factors(name, law):
    arm = library_robot(name)
    q = random_states(arm, law.samples(100_000))
    seen = np.abs(np.linalg.det(controlled(arm, q)))
    factors = np.prod([factor.size for factor in singularities(arm).factors])
    law.holds("determinant", np.abs(seen - determinant(arm, q)).max() / factors, PRODUCT, name)


@pytest.mark.parametrize("name", SIX_JOINTS)
def test_pinocchio_has_that_determinant(name):
    arm = library_robot(name)
    model = pinocchio_model(arm)
    data, tool = model.createData(), model.getFrameId("tool")
    factors = np.prod([factor.size for factor in singularities(arm).factors])
    for q in random_states(arm, 20):
        J = pin.computeFrameJacobian(model, data, q, tool, pin.LOCAL_WORLD_ALIGNED)
        assert abs(abs(np.linalg.det(J)) - determinant(arm, q)) < PRODUCT * factors


@given(arm=ARMS)
def test_any_arm_of_the_families(law, arm):
    law.samples(1000)
    family = classify(arm).family
    # Links that cancel have none.
    assume(family is not None and family.name not in ("pan_tilt", "slider"))
    q = states(arm, 20)
    J = controlled(arm, q)
    error = np.abs(np.abs(np.linalg.det(J)) - determinant(arm, q)) / size(arm, J)
    law.holds("determinant of a random arm", error.max(), PRODUCT, arm.joints)
    for kind, text in singularities(arm).words.items():
        if text.startswith("never"):
            continue
        sigma = np.linalg.svd(
            controlled(arm, singular_configurations(arm, kind, 5)), compute_uv=False
        )
        law.holds(
            f"{kind} of a random arm", (sigma[:, -1] / sigma[:, 0]).max(), SINGULAR, arm.joints
        )


@pytest.mark.parametrize(("name", "kind"), EACH)
def test_configurations_are_singular_and_inverse_kinematics_say_so(name, kind):
    arm = library_robot(name)
    q = singular_configurations(arm, kind, 40, seed=3)
    assert q.shape == (40, arm.n)
    assert np.linalg.svd(controlled(arm, q), compute_uv=False)[:, -1].max() < SINGULAR
    assert measures(arm, q)[kind].max() < SINGULAR
    # Of a UR whose q6 is free, q6 = 0 may be out of reach.
    solutions = inverse_kinematics(arm, forward_kinematics(arm, q), seed=q)
    assert set(solutions.status) == {"singular"}
    assert np.all((solutions.valid & (solutions.flags & IKFlag[kind] > 0)).any(axis=-1))


@pytest.mark.parametrize(("name", "kind"), EACH)
def test_configurations_are_inside_the_limits_where_they_can_be(name, kind):
    arm = library_robot(name)
    q = singular_configurations(arm, kind, 200)
    within = np.all((q >= arm.numbers.lower) & (q <= arm.numbers.upper), axis=1)
    # The Stanford's boom cannot be drawn in all the way to axis 2.
    assert within.all() if (name, kind) != ("stanford", "elbow") else not within.any()
    assert np.sum(np.ptp(q, axis=0) < SINGULAR) <= 1  # only one joint stands still, if any
    assert np.array_equal(q, singular_configurations(arm, kind, 200))


def test_puma_words_are_those_of_the_textbook():
    """Siciliano et al. 2009, section 3.3.3, for an elbow manipulator: q3 in {0, pi}, and a2 c2 + a3 c23 = 0."""
    found = singularities(library_robot("puma560_cao"))
    assert found.kinds == ("shoulder", "elbow", "wrist")
    assert found.words["elbow"] == "q3 = -90° (stretched) or 90° (folded)"
    assert found.words["wrist"] == "q5 = 0° or 180°: axes 4 and 6 coincide"
    assert found.words["shoulder"].endswith(
        "cylinder of radius 0.17145 m about axis 1: 0.416306 cos q2 - 0.497332 sin(q2 + q3) = 0"
    )
    assert str(found).splitlines()[1].startswith("elbow: q3")


def test_the_elbow_of_corkes_puma_knows_its_offsets():
    """Elbow and wrist are stretched where a forearm of d4 with an offset a3 lies along the upper arm."""
    found = singularities(library_robot("puma560"))
    assert found.values["elbow"] == pytest.approx(
        (np.arctan2(-0.4318, 0.0203), np.arctan2(0.4318, -0.0203)), abs=1e-15
    )
    assert found.values["wrist"] == pytest.approx((0, np.pi), abs=1e-15)
    assert found.joints == {"shoulder": None, "elbow": 2, "wrist": 4}


@pytest.mark.parametrize("name", KNOWN)
def test_the_shoulders_equation_is_the_arms(name):
    """What the words say, evaluated as it stands, vanishes where the arm is singular."""
    arm = library_robot(name)
    words = singularities(arm).words.get("shoulder")
    if words is None:
        return
    equation = words.split(": ")[1].removesuffix(" = 0")
    for old, new in (
        ("cos q2", "cos(q2)"),
        ("sin q2", "sin(q2)"),
        (" cos", "*cos"),
        (" sin", "*sin"),
    ):
        equation = equation.replace(old, new)
    for sign in "+-":
        equation = equation.replace(f"{sign}*", f"{sign} ")
    for q in singular_configurations(arm, "shoulder", 10):
        values = {f"q{i + 1}": value for i, value in enumerate(q)} | {"cos": np.cos, "sin": np.sin}
        assert abs(eval(equation.lstrip("*"), values)) < 2e-6  # numbers are printed to six digits


@pytest.mark.parametrize("name", ["ax12_arm", "planar2r"])
def test_for_arms_that_only_place_their_tool_it_is_the_manipulability(name):
    arm = library_robot(name)
    q = states(arm, 50)
    assert len(singularities(arm).task) == freedoms(arm)
    assert np.allclose(determinant(arm, q), manipulability(arm, q), rtol=0, atol=1e-14)


def test_measures_and_determinants_keep_the_shape_of_a_batch():
    arm = library_robot("stanford")
    q = states(arm, 6).reshape(2, 3, 6)
    q[1, 2] = np.nan
    for array in (*measures(arm, q).values(), determinant(arm, q)):
        assert array.shape == (2, 3)
        assert np.isfinite(array).sum() == 5
    assert np.ndim(determinant(arm, q[0, 0])) == 0
    assert singular_configurations(arm, "wrist", 0).shape == (0, 6)


def turntable(a1, limits=None):
    """Return an arm of links 0.9 m and 0.5 m, with a spherical wrist, on a turntable of radius a1; joint 3 limited."""
    right = np.pi / 2
    wrist = [(0, 0.5, 0, -right), (0, 0, 0, right), (0, 0, 0, 0)]
    arm = from_dh([(0, 0, a1, right), (0, 0, 0.9, 0), (right, 0, 0, right), *wrist])
    if limits is None:
        return arm
    joints = list(arm.joints)
    joints[2] = replace(joints[2], limits=tuple(map(exact, limits)))
    return replace(arm, joints=tuple(joints))


def test_a_turntable_wider_than_its_arm_is_long_has_no_shoulder_singularity():
    arm = turntable(1.5)
    assert singularities(arm).words["shoulder"] == "never: the wrist centre cannot come to axis 1"
    assert measures(arm, states(arm, 100))["shoulder"].min() > 0
    with pytest.raises(ModelError, match=r"found 0 of 3 shoulder singularities \(never"):
        singular_configurations(arm, "shoulder", 3)


def test_limits_that_exclude_a_singularity_are_left_aside():
    """With its elbow bent at a right angle or more, this arm does not reach back to axis 1."""
    arm = turntable(1.2, limits=(1.6, 3.0))
    for kind in ("shoulder", "elbow"):
        q = singular_configurations(arm, kind, 20)
        assert measures(arm, q)[kind].max() < SINGULAR
        assert not np.all((q >= arm.numbers.lower) & (q <= arm.numbers.upper), axis=1).any()


def test_what_is_not_known_is_said():
    for name in UNKNOWN:
        with pytest.raises(ModelError, match="singular_values find them numerically"):
            singularities(library_robot(name))
    with pytest.raises(
        ValueError, match="kind is 'knee'; puma560 has 'shoulder', 'elbow', 'wrist'"
    ):
        singular_configurations(library_robot("puma560"), "knee", 1)
    with pytest.raises(ValueError, match=r"q has shape \(5,\)"):
        measures(library_robot("puma560"), np.zeros(5))


@pytest.mark.slow
def test_the_workspace_command_says_where(capsys, tmp_path):
    arguments = ("workspace", "puma560", "--samples", "500", "--output", str(tmp_path))
    found = singularities(library_robot("puma560"))
    for more in ((), ("--json",)):
        with pytest.raises(SystemExit):
            main((*arguments, *more))
        out = capsys.readouterr().out
        if not more:
            assert all(f"{kind}: {words}" in out for kind, words in found.words.items())
            continue
        told = json.loads(out)["singularities"]
        assert told["elbow"] == {
            "joint": 3,
            "values_rad": list(found.values["elbow"]),
            "words": found.words["elbow"],
        }
        assert told["shoulder"]["joint"] is None
