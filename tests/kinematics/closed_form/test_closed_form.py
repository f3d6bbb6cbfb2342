"""Closed-form inverse kinematics: every branch closes, the original is among them, peers find the same."""

import numpy as np
import pytest
from hypothesis import assume, given

from dhkit.description import library_robot, world_to_tool
from dhkit.errors import ModelError
from dhkit.kinematics import (
    IKFlag,
    classify,
    forward_kinematics,
    inverse_kinematics,
    inverse_kinematics_in_chunks,
)
from dhkit.kinematics.closed_form.classify import FAMILIES
from dhkit.kinematics.singularities import measures as singularity_measures, singular_configurations
from dhkit.verification import random_states
from ik_checks import (
    FAMILY_A,
    FAMILY_B,
    FEW_JOINTS,
    SIX_JOINTS,
    along_plane,
    closure,
    gaps,
    measures,
)
from random_arms import elbow_arms, few_joint_arms, slide_arms, states, three_parallel_arms

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
        law.holds(
            "the original among the branches",
            float(nearest.max()),
            FOUND,
            (name, q[nearest.argmax()]),
        )
        # Of an arm with an offset: left and right are then the same.
        one_shoulder = along_plane(arm, q) < REGULAR
        for i in range(8):
            for j in range(i):
                apart = gaps(arm, solutions.q[:, i], solutions.q[:, j])
                apart = apart[solutions.valid[:, i] & solutions.valid[:, j] & ~one_shoulder]
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


NEAR = 1e-7
"""rad, or m over the reach: how near to a singularity."""
UNSOLVED, UNFLAGGED = 1e-4, 1e-3
"""Shares of a UR's poses at two singularities at once: rounding puts some out of reach, and some past a threshold."""


@pytest.mark.parametrize("kind", ["shoulder", "elbow", "wrist"])
@pytest.mark.parametrize("name", SIX_JOINTS)
def test_every_branch_closes_at_singularities_and_is_flagged(name, kind, law):
    arm = library_robot(name)
    total = law.samples(100_000)
    rng = np.random.default_rng(7)
    for start in range(0, total, CHUNK):
        count = min(CHUNK, total - start)
        q = singular_configurations(arm, kind, count, seed=start)
        # Six joints together then miss the singularity by at most NEAR.
        for size in (
            0.0,
            NEAR / 6,
        ):
            near = q + size * rng.uniform(-1, 1, q.shape)
            if kind != "shoulder":
                assert measures(arm, near)[kind].max() < 2 * NEAR
            T = forward_kinematics(arm, near)
            for seed in (None, near):
                solutions = inverse_kinematics(arm, T, seed=seed)
                law.holds(
                    "closure at a singularity",
                    closure(arm, solutions, T),
                    required(name),
                    (name, kind),
                )
                flagged = (solutions.valid & (solutions.flags & IKFlag[kind] > 0)).any(axis=-1)
                unsolved = ~solutions.valid.any(axis=-1)
                ur = name in FAMILY_B
                law.holds(
                    "share not solved at a singularity",
                    unsolved.mean(),
                    UNSOLVED if ur else 0.0,
                    (name, kind),
                )
                law.holds(
                    "share not flagged", (~flagged).mean(), UNFLAGGED if ur else 0.0, (name, kind)
                )


@pytest.mark.parametrize("name", FAMILY_B)
@pytest.mark.parametrize(
    ("elbow", "wrist"), [(1e-5, 1e-5), (1e-6, 1e-6), (1e-8, 1e-6), (1e-6, 1e-9), (1e-7, 1e-12)]
)
def test_a_stretched_arm_whose_wrist_is_nearly_straight_is_reached(name, elbow, wrist):
    """Rounding of a pose decides there how links 2 to 4 turn together, for the wrist with a flip and without."""
    arm = library_robot(name)
    rng = np.random.default_rng(0)
    q = rng.uniform(-3, 3, (1000, 6))
    q[:, 2] = elbow * rng.uniform(-3, 3, 1000)
    q[:, 4] = wrist * rng.uniform(-3, 3, 1000)
    T = forward_kinematics(arm, q)
    solutions = inverse_kinematics(arm, T)
    # Joints 1 and 5 are well determined, and tell shoulder and flip; joint 6 is nearly free.
    apart = np.abs(np.remainder(solutions.q - q[:, None] + np.pi, 2 * np.pi) - np.pi)[
        ..., [0, 4]
    ].max(axis=-1)
    original = solutions.valid & (apart < FOUND)
    assert original.any(axis=1).all()
    assert closure(arm, solutions, T) < OTHERS_CLOSE
    special = IKFlag.elbow | IKFlag.wrist
    assert np.all(solutions.flags[original] & IKFlag.wrist) or wrist > 1e-6
    assert np.all((solutions.flags[original] & special) != 0) or elbow > 1e-6


@pytest.mark.parametrize("name", SIX_JOINTS)
def test_the_free_joint_of_a_straight_wrist_comes_from_the_seed_or_is_zero(name):
    arm = library_robot(name)
    free = classify(arm).fit.free_joint
    q = singular_configurations(arm, "wrist", 500, seed=3)
    others = [value for key, value in singularity_measures(arm, q).items() if key != "wrist"]
    q = q[np.min(others, axis=0) > 0.05]
    T = forward_kinematics(arm, q)
    with_seed = inverse_kinematics(arm, T, seed=q)
    assert np.nanmin(gaps(arm, with_seed.q, q[:, None]), axis=-1).max() < 1e-9
    angles = np.abs(inverse_kinematics(arm, T).q[..., free])
    if name not in FAMILY_B:  # there the angle decides what is in reach
        assert (np.nanmin(np.minimum(angles, np.abs(angles - np.pi)), axis=-1) < 1e-12).all()


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


def check_family(law, arm, names, tolerance):
    law.samples(1000)
    found = classify(arm)
    # A slide between two parallel axes may bring them together: such an arm has a freedom less than joints.
    assume(found.family is not None or not arm.numbers.prismatic[1:3].any() or arm.n == 6)
    assert found.family is not None, found.words
    assert found.family.name in names, found.words
    assume(
        min(float(np.min(found.fit.parameters.get(key, 1.0))) for key in ("L2", "L3", "L"))
        > 1e-3 * arm.reach
    )
    q = random_states(arm, 50)
    T = world_to_tool(arm, q)
    solutions = inverse_kinematics(arm, T)
    # Rounding of the pose itself: a tool or a base far away turns it into lengths.
    reach = arm.reach or 1.0
    scale = reach + np.abs(T[:, :3, 3]).max()
    law.holds(
        "closure of every branch",
        closure(arm, solutions, T, fk=world_to_tool) * reach / scale,
        tolerance,
        found.words,
    )
    singular = (solutions.flags & (IKFlag.shoulder | IKFlag.elbow | IKFlag.wrist)).any(axis=-1)
    nearest = np.where(
        singular, 0.0, np.nanmin(gaps(arm, solutions.q, q[:, None]), axis=-1, initial=np.inf)
    )
    law.holds("the original among the branches", float(nearest.max()), 1e-4, found.words)


@given(arm=elbow_arms())
def test_any_arm_of_the_pumas_family(law, arm):
    check_family(law, arm, ["elbow_wrist"], CLOSES)


@given(arm=three_parallel_arms())
def test_any_arm_of_the_urs_family(law, arm):
    # Without d5 the wrist is spherical.
    check_family(law, arm, ["three_parallel", "elbow_wrist"], OTHERS_CLOSE)


@given(arm=slide_arms())
def test_any_arm_of_the_stanfords_family(law, arm):
    check_family(law, arm, ["slide_wrist"], OTHERS_CLOSE)


@given(arm=few_joint_arms())
def test_any_arm_of_few_joints(law, arm):
    check_family(law, arm, [family.name for family in FAMILIES], OTHERS_CLOSE)


@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize("seed", [None, "one", "each"])
@pytest.mark.parametrize("size", [1, 7, 100, 1000])
def test_chunks_are_the_batch(size, seed):
    arm = library_robot("puma560")
    q = states(arm, 100)
    q[::5, 4] = 0.0  # the wrist is straight: the seed decides
    T = world_to_tool(arm, q)
    seed = {None: None, "one": q[0], "each": q}[seed]
    whole, seen = inverse_kinematics(arm, T, seed), []
    for rows, found in inverse_kinematics_in_chunks(arm, T, size, seed):
        seen.append(rows)
        assert np.array_equal(found.q, whole.q[rows], equal_nan=True)
        assert np.array_equal(found.status, whole.status[rows])
        assert np.array_equal(found.valid, whole.valid[rows])
    assert np.array_equal(np.concatenate([np.arange(100)[rows] for rows in seen]), np.arange(100))


def test_chunks_of_what_cannot_be_are_refused_at_once():
    arm = library_robot("puma560")
    T = np.broadcast_to(np.eye(4), (10, 4, 4))
    with pytest.raises(ValueError, match="size is 0"):
        inverse_kinematics_in_chunks(arm, T, 0)
    with pytest.raises(ValueError, match=r"T has shape \(4, 4\); expected \(N, 4, 4\)"):
        inverse_kinematics_in_chunks(arm, np.eye(4))
    with pytest.raises(ValueError, match=r"seed has shape \(3, 6\); expected \(6,\) or \(10, 6\)"):
        inverse_kinematics_in_chunks(arm, T, 4, np.zeros((3, 6)))
    with pytest.raises(ModelError, match=r"jaco is .*: how many branches there will be is open"):
        inverse_kinematics_in_chunks(library_robot("jaco"), T)
    with pytest.raises(ValueError, match=r"redundancy has shape \(3,\); expected \(\) or \(10,\)"):
        inverse_kinematics_in_chunks(library_robot("panda"), T, 4, redundancy=np.zeros(3))
    assert not list(inverse_kinematics_in_chunks(arm, T[:0]))
