"""Bounds of derivatives of torques, beside torques themselves: no difference of them exceeds its bound."""

import mpmath
import numpy as np
import pytest

from acceptance import different_robots_first
from dhkit.description import library_robot, robots
from dhkit.dynamics import inverse_dynamics
from dhkit.dynamics.torque_bounds import dry_friction_bounds, torque_derivative_bounds

WITH_BODIES = [
    name for name in robots() if all(joint.bodies for joint in library_robot(name).joints)
]
DEGREE, DURATION = 5, 0.2
STATES = {2: 401, 4: 41}
"""Number of states by the order of the derivative: differences of doubles lose digits where the states lie closer."""
ROUNDING = 1e-4
"""Share of a bound: differences of doubles over half a millisecond, or over 5 ms."""


@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("name", different_robots_first(WITH_BODIES))
def test_no_difference_exceeds_the_bound(name, order, law):
    """A difference of order m over h^m is a mean of the m-th derivative."""
    arm, rng = library_robot(name), np.random.default_rng(0)
    t = np.linspace(0.0, DURATION, STATES[order])
    for trial in range(law.samples(50)):
        size = rng.choice([0.1, 1.0, 3.0])
        joints = [
            np.polynomial.Polynomial(row) for row in rng.normal(size=(arm.n, DEGREE + 1)) * size
        ]
        motion = np.stack(
            [[p.deriv(m)(t) if m else p(t) for p in joints] for m in range(order + 3)]
        )
        tau = inverse_dynamics(arm, *(motion[m].T for m in range(3)))
        seen = np.abs(np.diff(tau, order, axis=0)).max(axis=0) / (t[1] - t[0]) ** order
        bound = torque_derivative_bounds(arm, np.abs(motion).max(axis=2)[:, None, :])[0]
        law.holds(
            "difference over its bound, less 1", float(np.max(seen / bound)) - 1, ROUNDING, trial
        )


def test_no_fourth_derivative_of_friction_exceeds_its_bound(law):
    numbers = library_robot("puma560").numbers
    rng = np.random.default_rng(0)
    least_ratio = np.inf
    for _ in range(law.samples(1000)):
        i = int(rng.integers(6))
        forwards, backwards = numbers.coulomb[i]
        width = 10 ** rng.uniform(-2, 0)
        speed, *others = rng.normal(size=5) * [10 ** rng.uniform(-2, 0.5), 1, 1, 1, 1]

        def friction(
            t, width=width, forwards=forwards, backwards=backwards, terms=(speed, *others)
        ):
            v = sum(term * t**k / mpmath.factorial(k) for k, term in enumerate(terms))
            s = v / mpmath.sqrt(v * v + width * width)
            return (forwards - backwards) / 2 * s + (forwards + backwards) / 2 * s * s

        with mpmath.workdps(60):
            exact = abs(float(mpmath.diff(friction, 0, 4)))
        motion = np.zeros((6, 1, 6))
        motion[1:, 0, i] = np.abs([speed, *others])
        least_speed = np.zeros((1, 6))
        least_speed[0, i] = abs(speed)
        bound = dry_friction_bounds(numbers, width, least_speed, motion)[0, i]
        law.holds("fourth derivative over its bound", exact / bound, 1.0)
        least_ratio = min(least_ratio, bound / exact)
    assert least_ratio < 20  # a bound that is too large by powers of ten would be useless
