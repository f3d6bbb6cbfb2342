"""The law of time scaling, held against Pinocchio's torques on a fine grid."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from dhkit.description import from_dh, library_robot
from dhkit.errors import DescriptionError, PlanningError
from dhkit.trajectories import Limits, Trajectory, cubic, least_slowdown, quintic, require_inside
from trajectories_reference import reference_torques

ARM, PUMA = library_robot("planar2r"), library_robot("puma560")
FINE = 2001  # samples of the check
SEEN = 2e-6  # what lies between its samples, of a limit
NONE = np.inf


def used(motion, limits, torques):
    """Return the largest share of each kind of limit over a fine grid."""
    t = np.linspace(0, motion.duration, FINE)
    q, qd, qdd = motion.q(t), motion.qd(t), motion.qdd(t)
    kinds = (
        (qd, limits.velocity),
        (qdd, limits.acceleration),
        (motion.jerk(t), limits.jerk),
        (torques(q, qd, qdd), limits.torque),
    )
    return np.array([np.abs(values / limit).max() for values, limit in kinds])


@pytest.mark.parametrize("name", ["planar2r", "puma560", "cobra600", "panda", "ur5", "stanford"])
@pytest.mark.parametrize("law", [cubic, quintic])
def test_slowed_down_so_much_some_limit_is_just_met(name, law):
    arm = library_robot(name)
    torques, rng = reference_torques(arm), np.random.default_rng(1)
    lower, upper = np.maximum(arm.numbers.lower, -1.5), np.minimum(arm.numbers.upper, 1.5)
    for _ in range(3):
        q0, q1 = lower + (upper - lower) * rng.uniform(0.05, 0.95, (2, arm.n))
        # One kind of limit at a time can be the tightest.
        for bounds in (
            {},
            {"velocity": NONE},
            {"torque": NONE, "acceleration": 3.0},
            {"velocity": NONE, "jerk": 5.0},
        ):
            limits = Limits.of(arm, **bounds)
            motion = law(arm, q0, q1, duration=1.0)
            share = used(motion.slowed(least_slowdown(motion, limits)), limits, torques)
            assert share.max() == pytest.approx(1, abs=SEEN)


@given(st.floats(0.1, 10))
def test_slowing_first_changes_nothing(c):
    motion, limits = quintic(PUMA, np.zeros(6), np.full(6, 0.5), duration=1.0), Limits.of(PUMA)
    assert least_slowdown(motion.slowed(c), limits) * c == pytest.approx(
        least_slowdown(motion, limits), rel=1e-9
    )


def test_other_torques_may_be_given():
    motion = cubic(PUMA, np.zeros(6), np.full(6, 0.5), duration=1.0)
    limits = Limits.of(PUMA, velocity=NONE)
    expected = least_slowdown(motion, limits)
    assert least_slowdown(motion, limits, reference_torques(PUMA)) == pytest.approx(
        expected, rel=1e-9
    )
    doubled = reference_torques(PUMA)
    assert least_slowdown(motion, limits, lambda *state: 2 * doubled(*state)) > expected


def test_an_arm_without_bodies_needs_no_torques():
    arm = from_dh([(0, 0, 1, 0), (0, 0, 1, 0)])
    motion = Trajectory(arm, [0, 1], [[[0, 0], [0, 0], [3, 0], [-2, 0]]])
    assert least_slowdown(motion, Limits.of(arm, velocity=1.5)) == pytest.approx(1, rel=1e-12)
    with pytest.raises(DescriptionError, match="body"):
        least_slowdown(motion, Limits.of(arm, torque=1.0))


def test_a_motion_that_stands_still_needs_no_time():
    still = Trajectory(PUMA, [0, 1], np.zeros((1, 1, 6)))
    assert least_slowdown(still, Limits.of(PUMA)) == 0


def test_an_arm_too_weak_to_hold_itself_is_named():
    motion = cubic(PUMA, np.zeros(6), np.full(6, 0.5), duration=1.0)
    with pytest.raises(
        PlanningError,
        match=r"shoulder cannot hold the arm while it moves at 0.* s, at any speed: that takes .* N m of 1 N m",
    ):
        least_slowdown(motion, Limits.of(PUMA, torque=[1e3, 1, 1e3, 1e3, 1e3, 1e3]))


def test_a_joint_that_nothing_limits_is_named():
    motion = cubic(PUMA, np.zeros(6), [0, 0, 0, 0.5, 0, 0], duration=1.0)
    with pytest.raises(
        PlanningError, match="nothing limits the motion: wrist_roll moves, and has neither"
    ):
        least_slowdown(motion, Limits.of(PUMA, velocity=NONE, torque=NONE))


def test_a_jump_is_no_matter_of_speed():
    corner = Trajectory(ARM, [0, 1, 2], [[[0, 0], [1, 0]], [[1, 0], [2, 0]]])
    with pytest.raises(
        PlanningError,
        match=r"the velocity of shoulder jumps at 1 s; at no speed .* limit of acceleration",
    ):
        least_slowdown(corner, Limits.of(ARM, acceleration=1.0, torque=NONE))
    blends = Trajectory(ARM, [0, 1, 2], [[[0, 0], [0, 0], [1, 1]], [[1, 1], [2, 2], [-1, -1]]])
    with pytest.raises(PlanningError, match="the acceleration of shoulder jumps at 1 s"):
        least_slowdown(blends, Limits.of(ARM, jerk=1.0))
    assert least_slowdown(
        blends, Limits.of(ARM, acceleration=2.0, velocity=NONE, torque=NONE)
    ) == pytest.approx(1)


def test_leaving_the_joint_limits_is_named():
    # Both ends are inside, and the way leads outside between them.
    motion = Trajectory(ARM, [0, 2], [[[3, 0], [1, 0], [-0.5, 0]]])
    with pytest.raises(
        PlanningError,
        match=r"shoulder leaves its upper limit, 3.14159 rad: it comes to 3.5 rad at 1 s",
    ):
        require_inside(motion, Limits.of(ARM))
    require_inside(motion, Limits.of(ARM, upper=3.5))


def test_limits_of_another_number_of_joints_are_named():
    with pytest.raises(ValueError, match="limits are of 6 joints; expected 2"):
        cubic(ARM, [0, 0], [1, 1], limits=Limits.of(PUMA))
