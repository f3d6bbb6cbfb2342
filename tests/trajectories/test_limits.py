"""Facts of limits."""

import pickle

import numpy as np
import pytest

from dhkit.description import library_robot
from dhkit.trajectories import Limits

ARM = library_robot("planar2r")


def test_a_robots_limits_are_its_numbers():
    limits, numbers = Limits.of(ARM), ARM.numbers
    for ours, theirs in (
        ("lower", "lower"),
        ("upper", "upper"),
        ("velocity", "velocity"),
        ("torque", "effort"),
    ):
        assert np.array_equal(getattr(limits, ours), getattr(numbers, theirs))
    assert np.isinf(limits.acceleration).all()
    assert np.isinf(limits.jerk).all()


def test_limits_are_replaced_scaled_copied_and_read_only():
    limits = Limits.of(ARM, acceleration=5, torque=[1, np.inf])
    assert np.array_equal(limits.acceleration, [5, 5])
    half = limits.scaled(acceleration=0.5, torque=0.1)
    assert np.allclose(half.acceleration, 2.5)
    assert np.array_equal(half.torque, [0.1, np.inf])
    assert np.array_equal(half.lower, limits.lower)
    copy = pickle.loads(pickle.dumps(limits))
    assert np.array_equal(copy.torque, limits.torque)
    for each in (limits, half, copy):
        with pytest.raises(ValueError, match="read-only"):
            each.torque[0] = 7


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        ({"velocity": 0}, r"velocity of joint 1 is 0; expected a positive number, or inf"),
        ({"jerk": [1, -1]}, r"jerk of joint 2 is -1"),
        ({"torque": np.nan}, r"torque of joint 1 is nan"),
        ({"lower": [0, np.nan]}, r"lower of joint 2 is nan; expected a number"),
        ({"lower": 1, "upper": 0}, r"lower of joint 1 is 1, above upper, 0"),
        ({"velocity": [1, 2, 3]}, r"velocity has shape \(3,\); expected \(2,\) or one number"),
    ],
)
def test_what_are_no_limits_is_named(given, complaint):
    with pytest.raises(ValueError, match=complaint):
        Limits.of(ARM, **given)


def test_shares_are_positive():
    with pytest.raises(ValueError, match="velocity of joint 1"):
        Limits.of(ARM).scaled(velocity=0)
