"""Classical motions against their textbooks, and the best blend against all others."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from dhkit import Arm
from dhkit.description import library_robot
from dhkit.errors import PlanningError
from dhkit.trajectories import Limits, cubic, least_slowdown, quintic, trapezoidal

ARM, PUMA = library_robot("planar2r"), library_robot("puma560")
ROUNDING = 1e-11
GRID = 2e-5  # of the duration: what the search for a blend leaves
seeds = st.integers(0, 10_000)


def ends(seed, count):
    return np.random.default_rng(seed).uniform(-1, 1, (count, 2))


@given(seeds, st.floats(0.1, 10))
def test_both_ends_are_met(seed, T):
    q0, q1, qd0, qd1, qdd0, qdd1 = 0.1 * ends(seed, 6)
    third = cubic(ARM, q0, q1, T, qd0, qd1)
    fifth = quintic(ARM, q0, q1, T, qd0, qd1, qdd0, qdd1)
    for motion in (third, fifth):
        assert motion.duration == pytest.approx(T)
        assert np.abs(motion.q([0, T]) - [q0, q1]).max() < ROUNDING
        assert np.abs(motion.qd([0, motion.duration]) - [qd0, qd1]).max() < ROUNDING / T
    assert np.abs(fifth.qdd([0, fifth.duration]) - [qdd0, qdd1]).max() < 100 * ROUNDING / T**2
    assert (third.coefficients.shape[1], fifth.coefficients.shape[1]) == (4, 6)


def test_craigs_cubic():
    """Craig 2005, Introduction to Robotics, example 7.1: 15 to 75 degrees in 3 s is 15 + 20 t^2 - 4.44 t^3."""
    motion = cubic(ARM, np.radians([15, 0]), np.radians([75, 0]), 3.0)
    assert np.degrees(motion.coefficients[0, :, 0]) == pytest.approx([15, 0, 20, -40 / 9])


@given(seeds, st.floats(0.1, 10), st.floats(0.01, 0.5))
def test_trapezoidal_is_the_textbooks(seed, T, blend):
    """Spong, Hutchinson and Vidyasagar 2006, section 5.5.3, with tb the blend's time and V = (q1 - q0) / (T - tb)."""
    q0, q1 = ends(seed, 2)
    motion = trapezoidal(ARM, q0, q1, T, blend)
    tb, t = blend * T, np.linspace(0, T, 101)[:, None]
    V = (q1 - q0) / (T - tb)
    a = V / tb
    early, late = q0 + a / 2 * t**2, q1 - a * T**2 / 2 + a * T * t - a / 2 * t**2
    middle = (q1 + q0 - V * T) / 2 + V * t
    expected = np.where(t <= tb, early, np.where(t <= T - tb, middle, late))
    assert np.abs(motion.q(t[:, 0]) - expected).max() < 1e-9 / blend
    assert np.abs(motion.qd(motion.duration / 2) - V).max() < ROUNDING / T
    assert np.abs(motion.qdd(0.0) - a).max() < 100 * ROUNDING / tb / T


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", ["planar2r", "puma560", "cobra600"])
@pytest.mark.slow
def test_no_other_blend_is_faster(name, seed):
    arm, rng = library_robot(name), np.random.default_rng(seed)
    lower, upper = np.maximum(arm.numbers.lower, -1), np.minimum(arm.numbers.upper, 1)
    q0, q1 = lower + (upper - lower) * rng.uniform(0.1, 0.9, (2, arm.n))
    found = trapezoidal(arm, q0, q1).duration
    others = [
        trapezoidal(arm, q0, q1, blend=blend).duration for blend in np.linspace(0.01, 0.5, 150)
    ]
    assert found <= min(others) * (1 + GRID)


def test_under_velocity_and_acceleration_the_duration_is_known():
    """d / v + v / a where v is reached (Siciliano et al. 2009, section 4.2.1)."""
    limits = Limits.of(ARM, velocity=1.0, acceleration=4.0, torque=np.inf)
    assert trapezoidal(ARM, [0, 0], [1, 0.5], limits=limits).duration == pytest.approx(
        1.25, rel=1e-5
    )
    short = Limits.of(ARM, velocity=10.0, acceleration=4.0, torque=np.inf)
    assert trapezoidal(ARM, [0, 0], [1, 0.5], limits=short).duration == pytest.approx(1.0, rel=1e-9)
    assert cubic(ARM, [0, 0], [1, 0.5], limits=limits).duration == pytest.approx(1.5)
    assert quintic(ARM, [0, 0], [1, 0.5], limits=limits).duration == pytest.approx(1.875)


@pytest.mark.parametrize("law", [cubic, quintic, trapezoidal])
def test_the_shortest_duration_just_keeps_the_limits(law):
    q0, q1 = PUMA.numbers.configurations["zero"], PUMA.numbers.configurations["nominal"]
    motion = law(PUMA, q0, q1)
    assert least_slowdown(motion, Limits.of(PUMA)) == pytest.approx(1, rel=1e-6)
    slower = law(PUMA, q0, q1, duration=motion.duration * 1.5, limits=Limits.of(PUMA))
    assert slower.duration == pytest.approx(1.5 * motion.duration)
    with pytest.raises(
        PlanningError, match=r"0.1 s are too short: the limits allow the motion in "
    ):
        law(PUMA, q0, q1, duration=0.1, limits=Limits.of(PUMA))
    law(PUMA, q0, q1, duration=0.1)  # without limits a given duration is not held against any


def test_overshooting_a_joint_limit_is_named():
    with pytest.raises(
        PlanningError, match=r"shoulder leaves its upper limit, 3.14159 rad: it comes to .* at"
    ):
        cubic(ARM, [3.0, 0], [3.1, 0], 1.0, qd0=[5, 0])
    with pytest.raises(PlanningError, match=r"elbow leaves its lower limit"):
        trapezoidal(ARM, [0, 0], [0, -3])


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (lambda: cubic(ARM, [0], [1, 1]), r"q0 has shape \(1,\); expected"),
        (lambda: cubic(ARM, [[0, 0]], [1, 1]), r"q0 has shape \(1, 2\); expected \(2,\)"),
        (lambda: cubic(ARM, [0, 0], [1, np.nan]), r"q1 is \[1.0, nan\]; expected finite values"),
        (
            lambda: cubic(ARM, [0, 0], [1, 1], duration=0),
            r"duration is 0; expected 1e-06 to 1e\+06 s",
        ),
        (lambda: cubic(ARM, [0, 0], [1, 1], qd0=[1, 0]), r"no duration; expected a duration"),
        (lambda: quintic(ARM, [0, 0], [1, 1], qdd1=[1, 0]), r"no duration; expected a duration"),
        (
            lambda: trapezoidal(ARM, [0, 0], [1, 1], blend=0.6),
            r"blend is 0.6; expected more than 0 and at most 0.5",
        ),
        (lambda: trapezoidal(ARM, [0, 0], [1, 1], blend=0.0), r"blend is 0.0"),
        (
            lambda: cubic(ARM, [0.1, 0], [0.1, 0]),
            r"the motion ends where it begins; expected a duration",
        ),
        (lambda: trapezoidal(ARM, [0.1, 0], [0.1, 0]), r"the motion ends where it begins"),
    ],
)
def test_what_cannot_be_is_named(call, complaint):
    with pytest.raises(ValueError, match=complaint):
        call()


def test_a_trapezoid_that_nothing_limits_has_a_usual_blend():
    arm = Arm.from_dh([(0, 0, 0.5, 0), (0, 0, 0.4, 0)])
    motion = arm.trapezoidal([0, 0], [1.0, 0.5], 2.0)
    assert np.allclose(motion.breaks, [0, 0.5, 1.5, 2.0])
    with pytest.raises(PlanningError, match="nothing limits"):
        arm.trapezoidal([0, 0], [1.0, 0.5])
