"""Laws of the cubic spline from rest to rest."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from dhkit.description import library_robot
from dhkit.errors import PlanningError
from dhkit.trajectories import Limits, cubic, least_slowdown, spline

ARM, PUMA = library_robot("planar2r"), library_robot("puma560")


@given(st.integers(2, 8), st.integers(0, 1000))
def test_points_are_met_smoothly_from_rest_to_rest(count, seed):
    rng = np.random.default_rng(seed)
    times, points = 2.0 + np.cumsum(rng.uniform(0.3, 1, count)), rng.uniform(-0.3, 0.3, (count, 2))
    motion = spline(ARM, points, times)
    t = motion.breaks
    assert t == pytest.approx(times - times[0])
    assert np.abs(motion.q(t) - points).max() < 1e-12
    assert np.abs(motion.qd([0, motion.duration])).max() < 1e-11
    for derivative in (motion.q, motion.qd, motion.qdd):
        assert np.abs(derivative(t[1:-1]) - derivative(t[1:-1], "left")).max(initial=0) < 1e-10


def test_through_two_points_it_is_the_cubic():
    q0, q1 = np.zeros(6), np.full(6, 0.4)
    motion, expected = spline(PUMA, [q0, q1], [0, 2]), cubic(PUMA, q0, q1, 2.0)
    assert np.allclose(motion.coefficients, expected.coefficients, rtol=0, atol=1e-15)


def test_without_times_the_limits_are_just_kept():
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (5, 6))
    motion = spline(PUMA, points)
    assert np.abs(motion.q(motion.breaks) - points).max() < 1e-12
    assert least_slowdown(motion, Limits.of(PUMA)) == pytest.approx(1, rel=1e-6)


def test_an_overshoot_between_points_is_named():
    with pytest.raises(PlanningError, match="shoulder leaves its upper limit"):
        spline(ARM, [[0, 0], [3.1, 0], [3.1, 0.1]], [0, 1, 2])


@pytest.mark.parametrize(
    ("points", "times", "complaint"),
    [
        ([[0, 0]], None, r"points has shape \(1, 2\); expected \(m, 2\) with m >= 2"),
        ([[0, 0], [1, 1]], [0], r"times has shape \(1,\)"),
        (
            [[0, 0], [1, 1]],
            [0, 1, 2],
            r"times has shape \(3,\); expected \(2,\), one for each point",
        ),
        ([[0, 0], [1, 1]], [1, 1], r"times do not increase"),
        (
            [[0, 0], [0, 0]],
            None,
            r"points\[1\] is the same as points\[0\]; expected another, or times",
        ),
        ([[0, 0], [0, np.inf]], None, r"points\[1\] is not finite"),
    ],
)
def test_what_cannot_be_is_named(points, times, complaint):
    with pytest.raises(ValueError, match=complaint):
        spline(ARM, points, times)
