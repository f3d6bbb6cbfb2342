"""Derivatives of inverse and forward dynamics: Pinocchio's, and differences of the functions themselves."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings

from acceptance import different_robots_first
from dhkit.description import library_robot, robots
from dhkit.dynamics import (
    forward_dynamics,
    forward_dynamics_derivatives,
    inverse_dynamics,
    inverse_dynamics_derivatives,
    mass_matrix,
)
from dhkit.model import pinocchio_model
from dynamics_reference import ARMS, motions, tilted_arms

AGREEMENT = 1e-11


def symmetric(upper, n):
    upper = np.triu(np.reshape(upper, (n, n)))
    return upper + np.triu(upper, 1).T


def pinocchio_derivatives(description, q, qd, x):
    """Return Pinocchio's six matrices at a state; x is acceleration for the first three, torque for the others."""
    model = pinocchio_model(description)
    data = model.createData()
    n = description.n
    pin.computeRNEADerivatives(model, data, q, qd, x)
    inverse = (data.dtau_dq.copy(), data.dtau_dv.copy(), symmetric(data.M, n))
    pin.computeABADerivatives(model, data, q, qd, x)
    forward = (data.ddq_dq.copy(), data.ddq_dv.copy(), symmetric(data.Minv, n))
    return inverse, forward


def compare(law, description, states):
    for k in range(len(states[0])):
        q, qd, x = (state[k] for state in states)
        inverse, forward = pinocchio_derivatives(description, q, qd, x)
        ours = inverse_dynamics_derivatives(description, q, qd, x)
        for name, found, expected in zip(ours._fields, ours, inverse, strict=True):
            law.holds(name, relative(found, expected), AGREEMENT)

        # Pinocchio leaves out couplings of drives; solving with M loses digits by its condition.
        condition = np.linalg.cond(mass_matrix(description, q))
        ours = forward_dynamics_derivatives(description, q, qd, x)
        for name, found, expected in zip(ours._fields, ours, forward, strict=True):
            law.holds(name, relative(found, expected) / max(1.0, condition / 1e4), AGREEMENT)


def relative(found, expected):
    expected = np.reshape(expected, found.shape)
    return float(np.abs(found - expected).max() / max(np.abs(expected).max(), 1.0))


@pytest.mark.parametrize(
    "name",
    different_robots_first([name for name in robots() if not library_robot(name).couplings]),
)
def test_derivatives_are_pinocchios(name, law):
    description = library_robot(name)
    compare(law, description, motions(description, law.samples(50)))


@pytest.mark.slow
@settings(max_examples=ARMS)
@given(tilted_arms())
def test_derivatives_of_random_arms(law, description):
    if not description.couplings:
        compare(law, description, motions(description, 3))


@pytest.mark.slow
@settings(max_examples=ARMS)
@given(tilted_arms())
def test_derivatives_are_limits_of_differences(law, description):
    """With couplings, which Pinocchio does not have: central differences of fourth order."""
    q, qd, x = (state[0] for state in motions(description, 1))
    for function, derivatives in (
        (inverse_dynamics, inverse_dynamics_derivatives),
        (forward_dynamics, forward_dynamics_derivatives),
    ):
        found = derivatives(description, q, qd, x)
        for place, matrix in enumerate(found):
            differences = differentiated(function, description, (q, qd, x), place)
            largest = max(np.abs(matrix).max(), np.abs(function(description, q, qd, x)).max(), 1.0)
            law.holds(
                f"{found._fields[place]} by differences",
                float(np.abs(matrix - differences).max() / largest),
                1e-7,
            )


def differentiated(function, description, states, place, step=1e-3):
    columns = []
    for j in range(description.n):
        values = []
        for count in (-2, -1, 1, 2):
            moved = [state.copy() for state in states]
            moved[place][j] += count * step
            values.append(function(description, *moved))
        columns.append((values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * step))
    return np.stack(columns, axis=-1)


def test_a_batch_is_its_states_and_out_is_filled():
    description = library_robot("puma560")
    states = motions(description, 40)
    for function in (inverse_dynamics_derivatives, forward_dynamics_derivatives):
        out = np.empty((40, 3, 6, 6))
        found = function(description, *states, out=out)
        assert all(np.shares_memory(matrix, out) for matrix in found)
        for k in range(0, 40, 7):
            for one, all_of_them in zip(
                function(description, *(x[k] for x in states)), found, strict=True
            ):
                assert np.allclose(one, all_of_them[k], rtol=1e-12, atol=1e-10)


def test_what_is_not_finite_or_singular_gives_nan():
    description = library_robot("puma560")
    q = np.zeros(6)
    for function in (inverse_dynamics_derivatives, forward_dynamics_derivatives):
        assert np.isnan(np.array(function(description, np.full(6, np.nan), q, q))).all()
        assert np.isnan(np.array(function(description, q, q, np.full(6, np.inf)))).all()
