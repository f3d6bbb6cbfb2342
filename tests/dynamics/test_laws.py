"""Laws of mechanics that dynamics must keep, whatever the arm."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from dhkit.description import library_robot
from dhkit.dynamics import (
    Friction,
    bias,
    coriolis_matrix,
    forward_dynamics,
    friction_torque,
    gravity_torque,
    inverse_dynamics,
    kinetic_energy,
    mass_matrix,
    potential_energy,
    power,
    wrench_torque,
)
from dhkit.kinematics import jacobian
from dhkit.verification.measure import Floors, forward_tolerance, relative_error
from dynamics_reference import ARMS, motions, tilted_arms

ROUNDINGS = 1e-12
RATES = 1e-9  # what central differences leave
STEP = 2e-3  # s: of the sixth order, they err by STEP^6 times the seventh derivative, and by 1e-16 / STEP
WEIGHTS = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60


def smooth_motion(arm, count):
    """Return q, qd, qdd of seven neighbouring times around each of N, shapes (N, 7, n)."""
    rng = np.random.default_rng(3)
    size, rate, phase = (
        rng.uniform(0.3, 1, arm.n),
        rng.uniform(0.3, 1, arm.n),
        rng.uniform(0, 6, arm.n),
    )
    t = (rng.uniform(0, 10, (count, 1)) + STEP * np.arange(-3, 4))[..., None]
    angle = rate * t + phase
    return size * np.sin(angle), size * rate * np.cos(angle), -size * rate**2 * np.sin(angle)


def derivative(values):
    """Return the time derivative at the middle of seven neighbours, axis 1."""
    return np.tensordot(WEIGHTS / STEP, values, axes=(0, 1))


@settings(max_examples=ARMS)
@given(tilted_arms(least=1))
def test_power_is_the_change_of_energy(law, arm):
    q, qd, qdd = smooth_motion(arm, law.samples(1000) // 10)
    energy = kinetic_energy(arm, q, qd) + potential_energy(arm, q)
    q, qd, qdd = q[:, 3], qd[:, 3], qdd[:, 3]
    tau = inverse_dynamics(arm, q, qd, qdd)
    floors = Floors.of(arm, mass_matrix(arm, q), qd, qdd, tau)
    floor = floors.tau * np.abs(qd).max(axis=1)
    error = relative_error(derivative(energy), power(arm, qd, tau), floor)
    law.holds("dE/dt against qd . tau", error.max(), RATES, arm)


@settings(max_examples=ARMS)
@given(tilted_arms(least=1))
def test_the_rate_of_M_less_2_C_is_skew(law, arm):
    q, qd, _ = smooth_motion(arm, law.samples(1000) // 10)
    M = mass_matrix(arm, q)
    q, qd = q[:, 3], qd[:, 3]
    S = derivative(M) - 2 * coriolis_matrix(arm, q, qd)
    error = relative_error(
        S + np.swapaxes(S, 1, 2), np.zeros_like(S), np.abs(M[:, 3]).max(axis=(1, 2))
    )
    law.holds("Mdot - 2 C, skew", error.max(), RATES, arm)


@pytest.mark.slow
@settings(max_examples=ARMS)
@given(tilted_arms(least=1))
def test_terms_belong_together(law, arm):
    law.samples(1000, quick=ARMS)
    q, qd, qdd = motions(arm, 4)
    M, C, g = mass_matrix(arm, q), coriolis_matrix(arm, q, qd), gravity_torque(arm, q)
    assert np.array_equal(M, np.swapaxes(M, 1, 2))
    assert np.all(np.linalg.eigvalsh(M) > 0)
    tau = inverse_dynamics(arm, q, qd, qdd)
    floors = Floors.of(arm, M, qd, qdd, tau)
    h = np.einsum("kij,kj->ki", C, qd)
    of_terms = np.einsum("kij,kj->ki", M, qdd) + h + g
    law.holds("M qdd + C qd + g", relative_error(tau, of_terms, floors.tau).max(), ROUNDINGS, arm)
    law.holds(
        "C qd + g", relative_error(bias(arm, q, qd), h + g, floors.bias).max(), ROUNDINGS, arm
    )
    K = np.einsum("ki,kij,kj->k", qd, M, qd) / 2
    law.holds(
        "K of M", relative_error(K, kinetic_energy(arm, q, qd), floors.h).max(), ROUNDINGS, arm
    )
    back = forward_dynamics(arm, q, qd, tau)
    error = relative_error(back, qdd, Floors.of(arm, M, qd, qdd, tau).qdd) / forward_tolerance(M)
    law.holds("forward of inverse, of the tolerance", error.max(), 1.0, arm)


@settings(max_examples=ARMS)
@given(tilted_arms(least=1))
def test_a_wrench_works_through_the_jacobian(law, arm):
    law.samples(1000, quick=ARMS)
    q, qd, qdd = motions(arm, 4)
    wrench = np.random.default_rng(9).uniform(-10, 10, (4, 6))
    pushed = np.einsum("kij,ki->kj", jacobian(arm, q), wrench)
    scale = np.abs(wrench).max() * max(1.0, arm.reach)
    error = relative_error(wrench_torque(arm, q, wrench), pushed, scale)
    law.holds("J^T w", error.max(), ROUNDINGS, arm)
    tau = inverse_dynamics(arm, q, qd, qdd, wrench=wrench)
    floors = Floors.of(arm, mass_matrix(arm, q), qd, qdd, tau)
    error = relative_error(tau + pushed, inverse_dynamics(arm, q, qd, qdd), floors.tau + scale)
    law.holds("tau with a wrench", error.max(), ROUNDINGS, arm)
    back = forward_dynamics(arm, q, qd, tau, wrench=wrench)
    tolerance = forward_tolerance(mass_matrix(arm, q))
    error = relative_error(
        back, qdd, floors.qdd + scale / np.diagonal(mass_matrix(arm, q), 0, 1, 2).min(axis=1)
    )
    law.holds(
        "forward of inverse with a wrench, of the tolerance", (error / tolerance).max(), 1.0, arm
    )


widths = st.one_of(st.none(), st.floats(1e-6, 10).map(Friction))
dry = st.tuples(st.floats(0, 2), st.floats(-2, 0))


@given(st.lists(dry, min_size=6, max_size=6), widths, st.integers(0, 1000))
def test_friction_never_does_work(law, coulomb, friction, seed):
    law.samples(1000)
    arm = with_friction(coulomb)
    qd = np.random.default_rng(seed).uniform(-1, 1, (20, 6)) * 10.0 ** np.arange(-10, 10)[:, None]
    loss = friction_torque(arm, qd, friction)
    law.holds("work that friction does", -power(arm, qd, loss).min(), 0.0, (coulomb, friction))
    far = np.array([[1e7] * 6, [-1e7] * 6])
    limit = friction_torque(arm, far, friction) - arm.numbers.viscous * far
    expected = np.swapaxes(arm.numbers.coulomb, 0, 1)
    assert np.allclose(limit, expected, rtol=1e-6, atol=1e-6)
    assert np.all(friction_torque(arm, np.zeros(6), friction) == 0)


def with_friction(coulomb):
    from dhkit.expressions import exact

    arm = library_robot("puma560")
    joints = [
        replace(joint, drive=replace(joint.drive, coulomb=(exact(c[0]), exact(c[1]))))
        for joint, c in zip(arm.joints, coulomb, strict=True)
    ]
    return replace(arm, joints=tuple(joints))
