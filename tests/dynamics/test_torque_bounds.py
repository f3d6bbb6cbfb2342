"""Bounds of the second derivative of torques, beside torques themselves: no difference of them exceeds its bound."""

import numpy as np
import pytest

from acceptance import different_robots_first
from dhkit.description import library_robot, robots
from dhkit.dynamics import inverse_dynamics
from dhkit.dynamics.torque_bounds import torque_curvature_bounds

WITH_BODIES = [name for name in robots() if all(joint.bodies for joint in library_robot(name).joints)]
DEGREE, DURATION = 5, 0.2
ROUNDING = 1e-4
"""Share of a bound: second differences of doubles over half a millisecond."""


@pytest.mark.parametrize("name", different_robots_first(WITH_BODIES))
def test_no_second_difference_exceeds_the_bound(name, law):
    """A second difference over h^2 is a mean of the second derivative."""
    arm, rng = library_robot(name), np.random.default_rng(0)
    t = np.linspace(0.0, DURATION, 401)
    for trial in range(law.samples(50)):
        size = rng.choice([0.1, 1.0, 3.0])
        joints = [np.polynomial.Polynomial(row) for row in rng.normal(size=(arm.n, DEGREE + 1)) * size]
        motion = np.stack([[p.deriv(order)(t) if order else p(t) for p in joints] for order in range(5)])
        tau = inverse_dynamics(arm, *(motion[order].T for order in range(3)))
        seen = np.abs(np.diff(tau, 2, axis=0)).max(axis=0) / (t[1] - t[0]) ** 2
        bound = torque_curvature_bounds(arm, np.abs(motion).max(axis=2)[:, None, :])[0]
        law.holds("second difference over its bound, less 1", float(np.max(seen / bound)) - 1, ROUNDING, trial)
