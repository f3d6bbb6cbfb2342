"""Limits as constraints: uses from states, bounds with margins, and one that a joint does not have."""

import numpy as np
import pytest

from dhkit.description import library_robot
from dhkit.planning.criteria import Limit, States, joint_limits, loaded
from dhkit.trajectories import Limits

ARM = library_robot("planar2r")
LIMITS = Limits.of(ARM, velocity=[2.0, np.inf], acceleration=np.inf, jerk=50.0, torque=[40.0, 10.0])


def states(q, qd=(0, 0), qdd=(0, 0), jerk=(0, 0)):
    rows = [np.array([row], dtype=float) for row in (q, qd, qdd)]
    return States(loaded(ARM), np.zeros(1), *rows, jerk=np.array([jerk], dtype=float))


def test_they_stand_in_the_order_of_their_names():
    found = joint_limits(LIMITS)
    assert [constraint.what for constraint in found] == [
        limit.what for limit in list(Limit)[: len(found)]
    ]
    assert [constraint.is_limiting for constraint in found] == [True, True, False, True, True]
    assert all(constraint.of_joints for constraint in found)


@pytest.mark.parametrize(
    ("limit", "state", "use"),
    [
        (Limit.VELOCITY, {"qd": (-1.0, 9.0)}, (0.5, 0.0)),
        (Limit.ACCELERATION, {"qdd": (5.0, 5.0)}, (0.0, 0.0)),
        (Limit.JERK, {"jerk": (25.0, -50.0)}, (0.5, 1.0)),
    ],
)
def test_uses_are_shares_of_the_limits(limit, state, use):
    constraint = joint_limits(LIMITS)[limit]
    given = constraint.values(ARM, np.eye(4))
    np.testing.assert_allclose(constraint.use(states((0, 0), **state), given)[0], use)


def test_positions_outside_their_range_count_in_its_size():
    limits = Limits.of(ARM, lower=[-2.0, -np.inf], upper=[1.0, np.inf])
    constraint = joint_limits(limits)[Limit.POSITION]
    assert constraint.use(states((1.0, 99.0)), np.zeros(0))[0].tolist() == [1.0, 0.0]
    assert constraint.use(states((1.5, 0.0)), np.zeros(0))[0, 0] == pytest.approx(1.25)
    low, high = constraint.bounds(np.zeros(0), np.array([[0.1, 0.1]]))
    assert (low[0].tolist(), high[0].tolist()) == ([-1.8, -np.inf], [0.8, np.inf])
