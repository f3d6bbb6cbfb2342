"""Derivatives of inverse and forward dynamics: Pinocchio's, and differences of the functions themselves."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings, strategies as st

from acceptance import ACCEPTING, different_robots_first
from dhkit.description import (
    Coupling,
    library_robot,
    pose,
    robots,
    with_base,
    with_tool,
)
from dhkit.dynamics import (
    coriolis_matrix,
    forward_dynamics,
    forward_dynamics_derivatives,
    inertial_parameters,
    inverse_dynamics,
    inverse_dynamics_derivatives,
    mass_matrix_derivative,
    regressor,
)
from dhkit.expressions import exact
from dhkit.kinematics import jacobian_derivative, jacobian_dot
from dhkit.model import pinocchio_model
from dynamics_reference import motions
from random_arms import random_body, random_drive, tables

AGREEMENT = 1e-11
REGRESSOR_AGREEMENT = 1e-13
"""Relative to the largest torque of an arm's motions: some hundred roundings."""

STRUCTURES = 250 if ACCEPTING else 3
"""Number of random structures: kinds of joints, convention, and the lengths and angles that are special.

Hypothesis draws some twice: 1,250 arms are drawn for more than 1,000 different ones.
"""
ARMS_OF_A_STRUCTURE = 5
"""Number of random arms of each structure. They share the derived programs, which take nearly all of the time."""
ARMS = STRUCTURES * ARMS_OF_A_STRUCTURE


@st.composite
def arms_of_a_structure(draw, coupled):
    """Draw arms of 3 to 7 joints that differ in every number but zeros and right angles."""
    table = draw(tables(3, 7))
    pairs = list(combinations(range(table.n), 2))
    pairs = [pair for pair in pairs if coupled and draw(st.booleans())]

    # Hypothesis repeats seeds: with the table's digest, two tables of one structure give different arms.
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng([seed, int(table.digest, 16)])
    return [random_arm(table, pairs, rng) for _ in range(ARMS_OF_A_STRUCTURE)]


def random_arm(table, pairs, rng):
    """Return an arm of a table's structure, in a field of gravity of any direction; drives couple pairs of joints."""
    joints = []
    for joint in table.joints:
        joint = replace(
            joint,
            a=random_length(joint.a, rng),
            alpha=random_angle(joint.alpha, rng),
            d=random_length(joint.d, rng),
            theta=random_angle(joint.theta, rng),
            bodies=(random_body(rng),),
            drive=random_drive(rng),
        )
        joints.append(joint)
    gravity = tuple(exact(x) for x in rng.uniform(-10, 10, 3).tolist())
    arm = replace(table, joints=tuple(joints), gravity=gravity)
    arm = with_base(arm, random_pose(rng))
    arm = with_tool(arm, random_pose(rng))

    # Below sqrt(J_i J_j) / n, the matrix of drives stays positive definite.
    J = arm.numbers.armature
    couplings = []
    for i, j in pairs:
        inertia = rng.uniform(-0.9, 0.9) * np.sqrt(J[i] * J[j]) / arm.n
        couplings.append(Coupling((i + 1, j + 1), exact(float(inertia))))
    return replace(arm, couplings=tuple(couplings))


def random_length(length, rng):
    """Return another length, m; zero stays, because programs leave it out."""
    return exact(float(rng.uniform(-1, 1))) if float(length) else length


def random_angle(angle, rng):
    """Return another angle, rad; right angles and those near them stay, because programs leave their sines out."""
    is_special = abs(np.sin(2 * float(angle))) < 1e-8
    return angle if is_special else exact(float(rng.uniform(-np.pi, np.pi)))


def random_pose(rng):
    return pose(rng.uniform(-1, 1, 3).tolist(), euler=rng.uniform(-np.pi, np.pi, 3).tolist())


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
        condition = np.linalg.cond(inverse[2])
        ours = forward_dynamics_derivatives(description, q, qd, x)
        for name, found, expected in zip(ours._fields, ours, forward, strict=True):
            law.holds(name, relative(found, expected) / max(1.0, condition / 1e4), AGREEMENT)


def compare_regressor(law, description, states):
    """Torques are linear in the inertial parameters: their derivatives by those are the regressor."""
    drives = states[2] @ description.numbers.drive_inertia
    torques = regressor(description, *states) @ inertial_parameters(description) + drives

    expected = inverse_dynamics(description, *states)
    largest = np.abs(expected).max()
    error = float(np.abs(torques - expected).max() / largest)
    law.holds("regressor times parameters", error, REGRESSOR_AGREEMENT)
    if description.couplings:
        return

    model = pinocchio_model(description)
    data = model.createData()
    theirs = [pin.rnea(model, data, *state).copy() for state in zip(*states, strict=True)]
    error = float(np.abs(torques - np.array(theirs)).max() / largest)
    law.holds("regressor times parameters against Pinocchio", error, REGRESSOR_AGREEMENT)


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


@pytest.mark.parametrize("name", different_robots_first(robots()))
def test_regressor_times_parameters_is_inverse_dynamics(name, law):
    description = library_robot(name)
    compare_regressor(law, description, motions(description, law.samples(50)))


@pytest.mark.slow
@settings(max_examples=STRUCTURES)
@given(arms_of_a_structure(coupled=False))
def test_derivatives_of_random_arms(law, descriptions):
    law.samples(ARMS, quick=ARMS)
    for description in descriptions:
        states = motions(description, 3)
        compare(law, description, states)
        compare_regressor(law, description, states)


@pytest.mark.slow
@settings(max_examples=STRUCTURES)
@given(arms_of_a_structure(coupled=True))
def test_derivatives_are_limits_of_differences(law, descriptions):
    """With couplings, which Pinocchio does not have: central differences of fourth order."""
    law.samples(ARMS, quick=ARMS)
    for description in descriptions:
        compare_with_differences(law, description)


def compare_with_differences(law, description):
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


@pytest.mark.parametrize("name", different_robots_first(robots()))
def test_the_derivative_of_the_mass_matrix_gives_the_coriolis_matrix(name, law):
    """The Christoffel symbols: C_ij = sum_k (dM_ij/dq_k + dM_ik/dq_j - dM_jk/dq_i) qd_k / 2."""
    description = library_robot(name)
    q, qd, _ = motions(description, law.samples(50))
    dM = mass_matrix_derivative(description, q)
    by_k = np.einsum("nkij,nk->nij", dM, qd)
    by_j = np.einsum("njik,nk->nij", dM, qd)
    by_i = np.einsum("nijk,nk->nij", dM, qd)
    C = coriolis_matrix(description, q, qd)
    error = np.abs((by_k + by_j - by_i) / 2 - C).max() / max(1.0, np.abs(C).max())
    law.holds("Coriolis matrix from dM/dq", error, 1e-12, name)
    assert np.array_equal(dM[0], mass_matrix_derivative(description, q[0]))


@pytest.mark.parametrize("frame", ["world", "tool"])
@pytest.mark.parametrize("name", different_robots_first(robots()))
def test_the_derivative_of_the_jacobian_gives_its_rate(name, frame, law):
    description = library_robot(name)
    q, qd, _ = motions(description, law.samples(50))
    rate = np.einsum("nkij,nk->nij", jacobian_derivative(description, q, frame), qd)
    expected = jacobian_dot(description, q, qd, frame)
    error = np.abs(rate - expected).max() / max(1.0, np.abs(expected).max())
    law.holds("rate of the Jacobian from dJ/dq", error, 1e-12, name)
