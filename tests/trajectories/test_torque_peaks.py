"""Proved bounds of torques between states: never below Pinocchio's at dense samples, and hardly above them."""

import numpy as np
import pinocchio as pin
import pytest

import dhkit
from acceptance import different_robots_first
from dhkit.description import library_robot, robots
from dhkit.symbolic import Friction
from dhkit.trajectories import Trajectory
from dhkit.trajectories.torque_peaks import torque_peaks

WITH_BODIES = [
    name for name in robots() if all(joint.bodies for joint in library_robot(name).joints)
]
DENSE = 20_001
BELOW, ABOVE = 1e-9, 2e-6
"""Shares by which a bound may be below the largest sample (rounding) and above it (samples miss the peak)."""


def largest_torques(arm, motion, friction=False):
    """Return the largest torques by Pinocchio at dense samples, on both sides of breaks: shape (n,), N m and N."""
    model = arm.model
    data = model.createData()
    points = DENSE // (len(motion.breaks) - 1)
    q, qd, qdd = (
        motion.pieces.differentiated(order).inside(points)[1].reshape(-1, arm.n)
        for order in range(3)
    )
    rows = [pin.rnea(model, data, *state).copy() for state in zip(q, qd, qdd, strict=True)]
    numbers = arm.description.numbers
    tau = np.reshape(rows, qd.shape) + qdd @ numbers.coupling
    if friction:
        forwards, backwards = numbers.coulomb.T
        tau = (
            tau
            + numbers.viscous * qd
            + np.where(qd > 0, forwards, np.where(qd < 0, backwards, 0.0))
        )
    return np.abs(tau).max(axis=0)


def random_motion(arm, rng, kind):
    lower, upper = arm.limits.lower.clip(-3), arm.limits.upper.clip(None, 3)
    return getattr(arm, kind)(
        rng.uniform(lower, upper), rng.uniform(lower, upper), duration=rng.uniform(0.3, 2.0)
    )


@pytest.mark.parametrize("name", different_robots_first(WITH_BODIES))
def test_bounds_are_the_largest_torques(name, law):
    arm = dhkit.Arm.load(name)
    rng = np.random.default_rng(0)
    for trial in range(law.samples(60, quick=3)):
        motion = random_motion(arm, rng, ("quintic", "cubic", "trapezoidal")[trial % 3])
        seen = largest_torques(arm, motion)
        moved = seen > 1e-6
        peaks = torque_peaks(arm.description, motion, np.where(moved, seen, np.inf))
        assert peaks.is_proved.all()
        law.holds(
            "largest sample over its bound, less 1",
            np.max(1 / peaks.largest[moved], initial=0.0) - 1,
            BELOW,
            trial,
        )
        law.holds(
            "bound over the largest sample, less 1",
            np.max(peaks.largest[moved], initial=0.0) - 1,
            ABOVE,
            trial,
        )


def test_dry_friction_is_in_the_bounds():
    """A quintic between two rests goes one way, so that dry friction is constant."""
    arm = dhkit.Arm.load("puma560")
    rng = np.random.default_rng(0)
    motion = random_motion(arm, rng, "quintic")
    seen = largest_torques(arm, motion, friction=True)
    peaks = torque_peaks(arm.description, motion, seen, Friction())
    assert peaks.is_proved.all()
    assert np.abs(peaks.largest - 1).max() < ABOVE


def test_where_a_joint_turns_back_dry_friction_is_bounded_and_not_proved():
    arm = dhkit.Arm.load("puma560")
    there = np.array([0.3, 0.2, -0.2, 0.4, 0.3, 0.2])
    back = Trajectory(arm.description, [0, 1], [[0 * there, there, -there]])
    seen = largest_torques(arm, back, friction=True)
    peaks = torque_peaks(arm.description, back, seen, Friction())
    assert (peaks.largest > 1 - BELOW).all() and (peaks.seen < 1 + BELOW).all()
    loose = torque_peaks(arm.description, back, 3 * seen, Friction())
    assert loose.is_proved.all()


@pytest.mark.parametrize(
    ("name", "joint", "duration"), [("ur5", 0, 2.13), ("stanford", 0, 0.91), ("panda", 1, 1.2)]
)
def test_a_torque_between_states_is_certified_or_refused_to_a_millionth(name, joint, duration):
    arm = dhkit.Arm.load(name)
    rng = np.random.default_rng(3)
    lower, upper = arm.limits.lower, arm.limits.upper
    motion = arm.quintic(rng.uniform(lower, upper), rng.uniform(lower, upper), duration=duration)
    peak = largest_torques(arm, motion)[joint]
    free = np.full(arm.n, np.inf)

    def is_certified(limit):
        torque = free.copy()
        torque[joint] = limit
        return arm.certify(
            motion, limits=dhkit.Limits(-free, free, free, free, free, torque), friction=False
        ).ok

    assert is_certified(peak * (1 + 2e-6))
    assert not is_certified(peak * (1 - 2e-6))


def test_whole_turns_between_two_states_are_seen():
    """A pendulum that turns once from state to state of a certificate passes its largest torque between them."""
    body = {"mass": 1, "com": [0, 0, 0], "inertia": [[0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.01]]}
    arm = dhkit.Arm.from_dh([(0, 0, 0.5, 0)], kinds="R", bodies=[body])
    arm = arm.with_base(dhkit.pose((0, 0, 0), euler=(np.pi / 2, 0, 0))).with_limits(torque=[1.0])
    turns = 19_999 * 2 * np.pi
    motion = Trajectory(arm.description, [0, 1e4], [[[np.pi / 2], [turns / 1e4]]])
    assert not arm.certify(motion).ok


@pytest.mark.slow
def test_a_cubic_as_fast_as_torques_allow_keeps_them_between_samples():
    arm = dhkit.Arm.load("ur5").with_limits(velocity=np.full(6, 1e3))
    rng = np.random.default_rng(1)
    for kind in ("cubic", "quintic"):
        for _ in range(3):
            start, goal = rng.uniform(-6, 6, (2, 6))
            motion = getattr(arm, kind)(start, goal)
            used = largest_torques(arm, motion) / arm.description.numbers.effort
            assert 1 - 1e-6 < used.max() < 1 + 2e-7
