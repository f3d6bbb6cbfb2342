"""Closed-form inverse kinematics: every branch closes, the original is among them, peers find the same."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from ik_checks import FAMILY_A, FEW_JOINTS, SIX_JOINTS, closure, gaps, measures

from dhkit.description import from_dh, library_robot, pose, with_base, with_tool, world_to_tool
from dhkit.kinematics import IKFlag, classify, forward_kinematics, inverse_kinematics
from dhkit.kinematics.closed_form.classify import FAMILIES
from dhkit.verification import random_states

CLOSES = 1e-12
"""Of family a, lengths over the reach."""
OTHERS_CLOSE = 1e-10
FOUND = 1e-6
"""rad: how near the original must be among the branches."""
REGULAR = 1e-3
"""The least singularity measure from which on it must be found."""
CHUNK = 50_000


def required(name):
    return CLOSES if name in FAMILY_A else OTHERS_CLOSE


def regular(arm, q):
    return np.min(list(measures(arm, q).values()), axis=0) > REGULAR


@pytest.mark.parametrize("name", [*SIX_JOINTS, *FEW_JOINTS])
def test_every_branch_closes_forward_kinematics(name, law):
    arm = library_robot(name)
    total = law.samples(1_000_000 if name == "puma560" else 100_000)
    for start in range(0, total, CHUNK):
        q = random_states(arm, min(CHUNK, total - start), seed=start)
        T = forward_kinematics(arm, q)
        solutions = inverse_kinematics(arm, T)
        assert solutions.valid.any(axis=-1).all(), "a pose that the arm takes was not solved"
        assert np.array_equal(solutions.valid, ~np.isnan(solutions.q).any(axis=-1))
        assert np.isnan(solutions.q[~solutions.valid]).all()
        law.holds("closure of every branch", closure(arm, solutions, T), required(name), name)
        angles = solutions.q[..., ~arm.numbers.prismatic]
        assert np.nanmax(angles) <= np.pi
        assert np.nanmin(angles) > -np.pi


@pytest.mark.parametrize("name", SIX_JOINTS)
def test_the_original_is_among_the_branches_and_they_are_distinct(name, law):
    arm = library_robot(name)
    total = law.samples(1_000_000 if name == "puma560" else 100_000)
    for start in range(0, total, CHUNK):
        q = random_states(arm, min(CHUNK, total - start), seed=start + 1)
        q = q[regular(arm, q)]
        solutions = inverse_kinematics(arm, forward_kinematics(arm, q))
        nearest = np.nanmin(gaps(arm, solutions.q, q[:, None]), axis=-1)
        law.holds("the original among the branches", float(nearest.max()), FOUND, (name, q[nearest.argmax()]))
        for i in range(8):
            for j in range(i):
                apart = gaps(arm, solutions.q[:, i], solutions.q[:, j])
                apart = apart[solutions.valid[:, i] & solutions.valid[:, j]]
                assert (apart > FOUND).all(), f"branches {i} and {j} are the same"


@pytest.mark.parametrize("name", FEW_JOINTS)
def test_the_original_is_among_the_branches_of_arms_of_few_joints(name, law):
    arm = library_robot(name)
    q = random_states(arm, law.samples(100_000), seed=1)
    solutions = inverse_kinematics(arm, forward_kinematics(arm, q))
    singular = solutions.flags & (IKFlag.shoulder | IKFlag.elbow | IKFlag.wrist)
    usual = ~singular.any(axis=-1)
    nearest = np.nanmin(gaps(arm, solutions.q, q[:, None]), axis=-1)[usual]
    law.holds("the original among the branches", float(nearest.max()), FOUND, name)


@pytest.mark.parametrize("name", FEW_JOINTS)
def test_what_is_met_is_met(name):
    """Position always (a direction for pan and tilt), yaw or pitch where a fourth joint allows it."""
    arm = library_robot(name)
    q = random_states(arm, 200)
    T = forward_kinematics(arm, q)
    solutions = inverse_kinematics(arm, T)
    reached = forward_kinematics(arm, solutions.q[solutions.valid])
    asked = np.broadcast_to(T[:, None], (*solutions.valid.shape, 4, 4))[solutions.valid]
    if solutions.met[-1] == "yaw":
        assert np.abs(reached - asked).max() < OTHERS_CLOSE
    if solutions.met[-1].startswith("pitch"):
        axis = 0 if "x axis" in solutions.met[-1] else 2
        assert np.abs(reached[:, :3, axis] - asked[:, :3, axis]).max() < OTHERS_CLOSE


def test_an_arm_in_a_plane_says_how_far_a_pose_is_off_it():
    arm = library_robot("planar2r")
    T = forward_kinematics(arm, [0.3, 0.4])
    T[2, 3] = 0.25
    solutions = inverse_kinematics(arm, T)
    assert solutions.status == "out_of_reach"
    assert solutions.distance == pytest.approx(0.25)


def test_pan_and_tilt_aim_at_points_at_any_distance():
    arm = library_robot("pan_tilt")
    near = forward_kinematics(arm, [0.7, -0.4])
    far = near.copy()
    far[:3, 3] = np.array([0, 0, 0.08]) + 30 * (near[:3, 3] - [0, 0, 0.08])
    assert gaps(arm, inverse_kinematics(arm, far).q, np.array([0.7, -0.4])).min() < 1e-12


# Families from random geometry. Kernels are parametric: no compilation per example.

signed = st.sampled_from([-1, 1])
length = st.one_of(st.floats(0.05, 1.0), st.just(0.3)).map(lambda x: round(x, 6))
offset = st.one_of(st.just(0.0), st.floats(-0.5, 0.5).map(lambda x: round(x, 6)))
turn = st.one_of(st.sampled_from([0.0, np.pi / 2, -np.pi / 2, np.pi]), st.floats(-3.1, 3.1))


@st.composite
def placed(draw, arm):
    for change in (with_base, with_tool):
        if draw(st.booleans()):
            xyz = [draw(offset) for _ in range(3)]
            arm = change(arm, pose(xyz, euler=[draw(turn) for _ in range(3)]))
    return arm


@st.composite
def elbow_arms(draw):
    """Draw an arm of the PUMA's family: twists of any signs, offsets, either convention."""
    right = [draw(signed) * np.pi / 2 for _ in range(4)]
    a1, a3, d1, d2, d3, d6 = (draw(offset) for _ in range(6))
    a2, d4 = draw(signed) * draw(length), draw(signed) * draw(length)
    theta = [draw(turn) for _ in range(6)]
    flat = draw(st.sampled_from([0.0, np.pi]))
    last = draw(turn)
    if draw(st.booleans()):
        alpha, a, d = [right[0], flat, *right[1:], last], [a1, a2, a3, 0, 0, draw(offset)], [d1, d2, d3, d4, 0, d6]
        arm = from_dh(list(zip(theta, d, a, alpha, strict=True)))
    else:
        alpha, a, d = [0, right[0], flat, *right[1:]], [0, a1, a2, a3, 0, 0], [d1, d2, d3, d4, 0, d6]
        arm = from_dh(list(zip(theta, d, a, alpha, strict=True)), convention="modified")
    return draw(placed(arm))


@st.composite
def three_parallel_arms(draw):
    """Draw an arm of the UR's family."""
    right = [draw(signed) * np.pi / 2 for _ in range(3)]
    flat = [draw(st.sampled_from([0.0, np.pi])) for _ in range(2)]
    a1, d1, d2, d3, d4, d5, d6 = (draw(offset) for _ in range(7))
    a = [a1, draw(signed) * draw(length), draw(signed) * draw(length), 0, 0, draw(offset)]
    theta = [draw(turn) for _ in range(6)]
    alpha = [right[0], *flat, right[1], right[2], draw(turn)]
    return draw(placed(from_dh(list(zip(theta, [d1, d2, d3, d4, d5, d6], a, alpha, strict=True)))))


@st.composite
def slide_arms(draw):
    """Draw an arm of the Stanford's family."""
    right = [draw(signed) * np.pi / 2 for _ in range(4)]
    a = [draw(offset), draw(offset), draw(offset), 0, 0, draw(offset)]
    d = [draw(offset), draw(offset), 0, draw(offset), 0, draw(offset)]
    theta = [draw(turn) for _ in range(6)]
    alpha = [right[0], right[1], draw(st.sampled_from([0.0, np.pi])), right[2], right[3], draw(turn)]
    return draw(placed(from_dh(list(zip(theta, d, a, alpha, strict=True)), kinds="RRPRRR")))


@st.composite
def few_joint_arms(draw):
    """Draw a planar arm, a SCARA, a turret, or one with a slide."""
    kinds = draw(st.sampled_from(["RR", "RRR", "RRPR", "RRRP", "PRRR", "turret2", "turret3", "pan", "RP", "PR"]))
    flats = [draw(st.sampled_from([0.0, np.pi])) for _ in range(4)]
    right = draw(signed) * np.pi / 2
    lengths = [draw(signed) * draw(length) for _ in range(4)]
    theta, d = [draw(turn) for _ in range(4)], [draw(offset) for _ in range(4)]
    if kinds in ("turret2", "turret3", "pan"):
        n = {"turret2": 3, "turret3": 4, "pan": 2}[kinds]
        rows = [(theta[i], d[i], draw(offset) if i == 0 else lengths[i], right if i == 0 else flats[i]) for i in range(n)]
        return draw(placed(from_dh(rows)))
    if kinds in ("RP", "PR"):
        rows = [(theta[0], d[0], 0.0 if kinds == "RP" else draw(offset), right), (theta[1], d[1], lengths[1], flats[0])]
        return draw(placed(from_dh(rows, kinds=kinds)))
    # A slide's length keeps the axes around it apart, or there would be two coincident ones.
    rows = [(theta[i], d[i], lengths[i], flats[i]) for i in range(len(kinds))]
    return draw(placed(from_dh(rows, kinds=kinds)))


def check_family(law, arm, names, tolerance):
    law.samples(1000)
    found = classify(arm)
    # A slide between two parallel axes may bring them together: such an arm has a freedom less than joints.
    assume(found.family is not None or not arm.numbers.prismatic[1:3].any() or arm.n == 6)
    assert found.family is not None, found.words
    assert found.family.name in names, found.words
    assume(min(float(np.min(found.fit.parameters.get(key, 1.0))) for key in ("L2", "L3", "L")) > 1e-3 * arm.reach)
    q = random_states(arm, 50)
    T = world_to_tool(arm, q)
    solutions = inverse_kinematics(arm, T)
    # Rounding of the pose itself: a tool or a base far away turns it into lengths.
    reach = arm.reach or 1.0
    scale = reach + np.abs(T[:, :3, 3]).max()
    law.holds("closure of every branch", closure(arm, solutions, T) * reach / scale, tolerance, found.words)
    singular = (solutions.flags & (IKFlag.shoulder | IKFlag.elbow | IKFlag.wrist)).any(axis=-1)
    nearest = np.where(singular, 0.0, np.nanmin(gaps(arm, solutions.q, q[:, None]), axis=-1, initial=np.inf))
    law.holds("the original among the branches", float(nearest.max()), 1e-4, found.words)


@given(arm=elbow_arms())
def test_any_arm_of_the_pumas_family(law, arm):
    check_family(law, arm, ["elbow_wrist"], CLOSES)


@given(arm=three_parallel_arms())
def test_any_arm_of_the_urs_family(law, arm):
    check_family(law, arm, ["three_parallel", "elbow_wrist"], OTHERS_CLOSE)  # without d5 the wrist is spherical


@given(arm=slide_arms())
def test_any_arm_of_the_stanfords_family(law, arm):
    check_family(law, arm, ["slide_wrist"], OTHERS_CLOSE)


@given(arm=few_joint_arms())
def test_any_arm_of_few_joints(law, arm):
    check_family(law, arm, [family.name for family in FAMILIES], OTHERS_CLOSE)
