"""Laws of motions that are sampled for a page."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from dhkit.description import library_robot
from dhkit.viewer.motion import MAX_FRAMES, MIN_FRAMES, check_motion, resample

ARM = library_robot("planar2r")
ROUNDING = 1e-9  # times near 1e3 s, interpolated


@given(st.integers(2, 30), st.floats(1e-3, 1e3), st.integers(0, 1000))
def test_samples_lie_on_the_motion_with_its_ends(count, duration, seed):
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.1, 1, count))
    times = 5.0 + duration * (times - times[0]) / (times[-1] - times[0])
    q = rng.uniform(-3, 3, (count, 2))
    t, samples = resample(times, q)
    assert MIN_FRAMES <= len(t) <= MAX_FRAMES
    assert t[0] == 0
    assert t[-1] == pytest.approx(duration)
    assert np.array_equal(samples[[0, -1]], q[[0, -1]])
    assert np.ptp(np.diff(t)) < ROUNDING
    assert np.abs(samples[:, 0] - np.interp(t + 5.0, times, q[:, 0])).max() < 1e-6


@pytest.mark.parametrize(
    ("times", "q", "complaint"),
    [
        ([0.0], [[0, 0]], r"times has shape \(1,\); expected \(N,\) with N >= 2"),
        ([[0.0, 1.0]], [[0, 0]], r"times has shape \(1, 2\)"),
        ([0, 1], [[0, 0, 0], [1, 1, 1]], r"q has shape \(2, 3\); expected \(\.\.\., 2\)"),
        ([0, 1], [[0, 0]], r"q has shape \(1, 2\); expected \(2, 2\)"),
        ([0, 1], [0, 0], r"q has shape \(2,\)"),
        ([0, 0], [[0, 0], [1, 1]], r"times\[0\] is 0 s, times\[1\] is 0 s"),
        ([0, 2, 1], np.zeros((3, 2)), r"times\[1\] is 2 s, times\[2\] is 1 s"),
        (
            [0, np.nan],
            np.zeros((2, 2)),
            r"times has values that are not finite, the first in row 1",
        ),
        ([0, 1], [[0, 0], [0, np.inf]], r"q has values that are not finite, the first in row 1"),
    ],
)
def test_what_is_no_motion_is_named(times, q, complaint):
    with pytest.raises(ValueError, match=complaint):
        check_motion(ARM, times, q)
