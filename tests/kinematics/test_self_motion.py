"""Redundant arms: a solution by iteration is moved along the self-motion to a local maximum of a score."""

from __future__ import annotations

import numpy as np
import pytest

from dhkit import Arm
from dhkit.description import from_dh
from dhkit.kinematics import manipulability
from dhkit.kinematics.newton import descent_kernel
from dhkit.kinematics.preference import share_of_limits

SMALL = 1e-3
"""Length of a step along the self-motion, rad, at which scores are compared."""
FLAT = 1e-6
"""Largest gain of such a step at a maximum: its square, and the curvature of the score."""


@pytest.fixture(scope="module")
def panda():
    return Arm.load("panda")


def random_states(arm, count):
    numbers = arm.description.numbers
    shares = np.random.default_rng(3).uniform(0.05, 0.95, (count, arm.n))
    return numbers.lower + (numbers.upper - numbers.lower) * shares


def scores(arm, aim, q):
    numbers = arm.description.numbers
    if aim == "limits":
        return np.min(np.minimum(q - numbers.lower, numbers.upper - q) * 2, axis=-1)
    if aim == "manipulability":
        return manipulability(arm, q, "whole")
    return -np.sum((q - arm.configurations[aim]) ** 2, axis=-1)


@pytest.mark.parametrize("aim", ["limits", "manipulability", "ready"])
def test_pose_and_limits_are_kept_and_scores_rise(panda, aim):
    descent_kernel(panda.description, 6)[0].compile()
    T = panda.fk(random_states(panda, 100))
    plain = panda.ik_numeric(T)
    found = panda.ik_numeric(T, prefer=aim)
    assert found.allowed.all()
    assert np.abs(panda.fk(found.q[:, 0]) - T).max() < 1e-10
    gain = scores(panda, aim, found.q[:, 0]) - scores(panda, aim, plain.q[:, 0])
    if aim == "limits":
        # A smooth score stands for the smallest distance.
        assert np.median(gain) > 0.1
    else:
        assert gain.min() > -1e-9
        assert np.median(gain) > 1e-3


@pytest.mark.parametrize("aim", ["manipulability", "ready"])
def test_the_end_is_a_local_maximum(panda, aim):
    """No neighbour with the same pose is better, found by searches from a step along the null space."""
    T = panda.fk(random_states(panda, 60))
    q = panda.ik_numeric(T, prefer=aim).q[:, 0]
    numbers = panda.description.numbers
    is_inside = ((q > numbers.lower + 0.02) & (q < numbers.upper - 0.02)).all(axis=1)
    assert is_inside.sum() > 5
    q = q[is_inside]
    along = np.linalg.svd(panda.jacobian(q))[2][:, -1]
    for side in (-SMALL, SMALL):
        near = panda.ik_numeric(T[is_inside], q0=q + side * along)
        gain = scores(panda, aim, near.q[:, 0]) - scores(panda, aim, q)
        assert gain.max() < FLAT


def test_of_a_posture_on_the_self_motion_that_posture_is_found(panda):
    q = random_states(panda, 50)
    found = [panda.ik_numeric(panda.fk(x), q0=x + 0.05, prefer=x).q[0] for x in q]
    assert np.abs(found - q).max(axis=1).max() < 1e-4


def test_positions_of_planar_arms_have_self_motions_too():
    arm = Arm.load("planar3r")
    q = np.array([[0.3, 0.8, -0.5], [1.0, -0.4, 0.9]])
    T = arm.fk(q)
    found = arm.ik_numeric(T, q0=q, position_only=True, prefer="manipulability").q[:, 0]
    assert np.abs(arm.fk(found)[:, :3, 3] - T[:, :3, 3]).max() < 1e-10
    # Against all solutions for 2,000 directions of the last link.
    for k in range(2):
        best = 0.0
        for angle in np.linspace(-np.pi, np.pi, 2_000):
            c, s = np.cos(angle), np.sin(angle)
            turned = T[k].copy()
            turned[:2, :2] = [[c, -s], [s, c]]
            solutions = arm.ik(turned)
            values = manipulability(arm, solutions.q[solutions.valid])
            best = max(best, values.max(initial=0.0))
        assert manipulability(arm, found[k]) > 0.999 * best


def test_a_batch_and_single_poses_agree(panda):
    T = panda.fk(random_states(panda, 10))
    batch = panda.ik_numeric(T, prefer="limits", threads=2).q
    single = np.array([panda.ik_numeric(pose, prefer="limits").q for pose in T])
    assert np.abs(batch - single).max() < 1e-6


def test_prismatic_joints_and_poses_that_are_not_reached():
    rail = from_dh(
        [(0, 0, 0, "-pi/2"), (0, 0, 0.4, 0), (0, 0, 0.3, 0), (0, 0, 0.2, 0)],
        kinds="PRRR",
    )
    arm = Arm(rail)
    q = np.array([0.2, 0.4, -0.7, 0.5])
    T = np.stack([arm.fk(q), np.diag([1.0, 1.0, 1.0, 0.0])])
    found = arm.ik_numeric(T, position_only=True, prefer=q)
    assert list(found.status) == ["ok", "not_a_pose"]
    assert np.abs(arm.fk(found.q[0, 0])[:3, 3] - T[0, :3, 3]).max() < 1e-10


def test_a_preference_that_does_not_fit_is_refused(panda):
    T = panda.fk("ready")
    with pytest.raises(ValueError, match="prefer is 'speed'; expected 'limits'"):
        panda.ik_numeric(T, prefer="speed")
    with pytest.raises(ValueError, match="prefer"):
        panda.ik_numeric(T, prefer=[0.0, 1.0])
    puma = Arm.load("puma560")
    with pytest.raises(
        ValueError, match="puma560 is not redundant: 6 joints move the tool in 6 directions"
    ):
        puma.ik_numeric(puma.fk("nominal"), prefer="limits")


def test_a_joint_whose_limits_leave_no_room_does_not_move(panda):
    numbers = panda.description.numbers
    lower = numbers.lower.copy()
    upper = numbers.upper.copy()
    lower[2] = upper[2] = 0.3
    arm = panda.with_limits(lower=lower, upper=upper)
    q = random_states(panda, 20)
    q[:, 2] = 0.3
    T = arm.fk(q)
    for aim in ("limits", "ready"):
        plain = arm.ik_numeric(T)
        found = arm.ik_numeric(T, prefer=aim)
        assert (found.valid == plain.valid).all()
        solved = found.valid[:, 0]
        assert solved.mean() > 0.9
        assert (found.q[solved, 0, 2] == 0.3).all()
    far = panda.ik_numeric(panda.fk("ready"), prefer=np.full(7, 1e300))
    assert far.valid.all()


def test_whole_turns_bring_angles_near_to_a_posture():
    arm = Arm.load("panda").with_limits(lower=-6.0, upper=6.0)
    q = np.array([0.3, 0.5, 0.2, -1.2, 0.4, 1.0, 0.1])
    posture = q + 2 * np.pi * np.array([0, 0, 0, 1, 0, -1, 0])
    found = arm.ik_numeric(arm.fk(q), q0=q, prefer=posture).q[0]
    assert np.abs(found - posture).max() < 1e-4


def test_the_distance_from_limits_never_falls(panda):
    # Were it compiled between the two calls, other solutions might be found.
    descent_kernel(panda.description, 6)[0].compile()
    T = panda.fk(random_states(panda, 300))
    plain = panda.ik_numeric(T).q[:, 0]
    found = panda.ik_numeric(T, prefer="limits").q[:, 0]
    numbers = panda.description.numbers
    before, after = (share_of_limits(numbers.lower, numbers.upper, q) for q in (plain, found))
    assert (after >= before).all()
