"""Adaptive control: its regressor, an energy that never rises, errors that fall from round to round, bad input."""

import numpy as np
import pytest
from hypothesis import given
from scipy.integrate import solve_ivp

from dhkit import Adaptive, Arm, Sine
from dhkit.control import Setpoint
from dhkit.control.gains import effective_inertia
from dhkit.description import from_dh, library_robot, robots
from dhkit.dynamics import (
    coriolis_matrix,
    forward_dynamics,
    gravity_torque,
    inertial_parameters,
    mass_matrix,
    parameter_grouping,
    regressor,
    velocity_regressor,
)
from dhkit.errors import DescriptionError
from dhkit.symbolic import base_parameters
from dhkit.verification import random_motions
from random_arms import arms

ROUNDING = 1e-11
"""Of torques, over the sum of the parameters' shares in them: two derivations, summed in different orders."""
ROUND = 4.0
"""s: one round of the closed motion."""
ADAPTING = ["planar2r", "puma560", "panda", "stanford"]


def closed_motion(arm):
    """Return a motion that repeats itself every 4 s, in which the joints move at 1, 2 and 3 turns a round."""
    numbers = arm.description.numbers
    lower, upper = (
        np.nan_to_num(numbers.lower, neginf=-1.5),
        np.nan_to_num(numbers.upper, posinf=1.5),
    )
    centre = (lower + upper) / 2
    frequency = np.array([1, 2, 3, 2, 1, 3, 2])[: arm.n] / ROUND
    return Sine(centre, np.minimum(0.7, (upper - lower) / 4), frequency, 2.0 * np.arange(arm.n))


def start(reference):
    q, qd, _ = reference.sampled(np.zeros(1))
    return q[0], qd[0]


def gap_of_the_regressor(description, samples):
    """Return how far Y theta is from M qdd_r + C qd_r + g, over the sizes of its terms."""
    q, qd, qdd_r = random_motions(description, samples)
    qd_r = random_motions(description, samples, seed=1).qd
    theta = inertial_parameters(description)
    Y = velocity_regressor(description, q, qd, qd_r, qdd_r)
    tau = Y @ theta + qdd_r @ description.numbers.drive_inertia
    M, C = mass_matrix(description, q), coriolis_matrix(description, q, qd)
    expected = (
        np.einsum("kij,kj->ki", M, qdd_r)
        + np.einsum("kij,kj->ki", C, qd_r)
        + gravity_torque(description, q)
    )
    terms = (
        np.einsum("kij,j->ki", np.abs(Y), np.abs(theta)).max()
        + np.abs(description.numbers.armature * qdd_r).max()
    )
    return np.abs(tau - expected).max() / terms


@pytest.mark.parametrize("name", robots())
@pytest.mark.slow
def test_the_regressor_gives_the_terms_of_the_equation_of_motion(name, law):
    law.holds(
        "Y theta against M qdd_r + C qd_r + g",
        gap_of_the_regressor(library_robot(name), law.samples(500)),
        ROUNDING,
    )


@given(arms(least=1, most=6))
@pytest.mark.slow
def test_the_regressor_of_any_arm(law, description):
    law.holds(
        "Y theta against M qdd_r + C qd_r + g",
        gap_of_the_regressor(description, law.samples(100)),
        ROUNDING,
    )


@pytest.mark.slow
@given(arms(least=1, most=6))
def test_the_regressor_is_that_of_inverse_dynamics_polarized(law, description):
    q, qd, qdd_r = random_motions(description, law.samples(100))
    qd_r, still = random_motions(description, len(q), seed=1).qd, np.zeros_like(q)
    Y = velocity_regressor(description, q, qd, qd_r, qdd_r)
    # C(q, a) b = (h(a + b) - h(a - b)) / 4, h(a) = C(q, a) a: the terms without rates cancel.
    squares = regressor(description, q, qd + qd_r, still) - regressor(
        description, q, qd - qd_r, still
    )
    expected = regressor(description, q, still, qdd_r) + squares / 4
    size = max(np.abs(squares).max(), np.abs(expected).max())
    law.holds("regressor against polarization", np.abs(Y - expected).max() / size, ROUNDING)


@pytest.mark.parametrize(
    "name", ["planar2r", "cart_pendulum", "puma560", "panda", "stanford", "pan_tilt"]
)
def test_base_parameters_give_the_same_torques(name, law):
    description = library_robot(name)
    grouping = parameter_grouping(description)
    q, qd, qdd = random_motions(description, law.samples(500), seed=3)
    Y = regressor(description, q, qd, qdd)
    theta = np.random.default_rng(0).normal(size=10 * description.n)
    size = np.einsum("kij,j->ki", np.abs(Y), np.abs(theta)).max()
    gap = np.abs(Y @ theta - Y[..., list(grouping.columns)] @ (grouping.matrix @ theta)).max()
    law.holds("torques by base parameters", gap / size, ROUNDING)
    columns = Y[..., list(grouping.columns)].reshape(-1, len(grouping))
    assert np.linalg.matrix_rank(columns) == len(grouping)


@pytest.mark.parametrize("name", ["planar2r", "polar_rp", "stanford"])
def test_base_parameters_are_as_many_as_the_exact_ones(name):
    description = library_robot(name)
    exact = [entry for entry in base_parameters(description).names if not entry.startswith("Ia")]
    assert len(parameter_grouping(description)) == len(exact)


def test_the_regressor_in_batches():
    arm = from_dh([(0, 0.1, 0.3, "pi/2"), (0, 0, 0.2, 0)], kinds="RP")
    Y = velocity_regressor(arm, np.zeros((4, 1, 2)), np.ones((3, 2)), np.ones(2), np.zeros(2))
    assert Y.shape == (4, 3, 2, 20)
    Y = velocity_regressor(arm, [[0, 0], [np.nan, 0]], [0, 0], [0, 0], [0, 0])
    assert np.isfinite(Y[0]).all() and np.isnan(Y[1]).all()
    with pytest.raises(ValueError, match=r"qd_r has shape \(3,\); expected \(..., 2\)"):
        velocity_regressor(arm, [0, 0], [0, 0], [0, 0, 0], [0, 0])


@pytest.mark.slow
@pytest.mark.parametrize("name", ADAPTING)
def test_the_error_of_the_fourth_round_is_a_fifth_of_the_first(name, law):
    """From half the true masses and inertias, called at 1 kHz."""
    law.samples(1)
    arm = Arm.load(name)
    run = arm.simulate(
        Adaptive.tuned(arm, masses=0.5), closed_motion(arm), 4 * ROUND, restitution=None
    )
    assert not run.saturated.any()
    error = np.linalg.norm(run.q - run.reference_q, axis=1)[:-1].reshape(4, -1)
    peak, rms = error.max(axis=1), np.sqrt(np.mean(error**2, axis=1))
    law.holds("peak error of the fourth round over that of the first", peak[3] / peak[0], 0.2)
    law.holds("RMS error of the fourth round over that of the first", rms[3] / rms[0], 0.2)


@pytest.mark.parametrize("name", ADAPTING)
@pytest.mark.slow
def test_the_lyapunov_function_never_rises(name, law):
    """dV/dt = -s^T K_D s under continuous adaptation, from half the true masses and inertias."""
    law.samples(1)
    arm = Arm.load(name)
    description, n, reference = arm.description, arm.n, closed_motion(arm)
    controller = Adaptive.tuned(arm, masses=0.5)

    def asked(t):
        return Setpoint(description, *(x[0] for x in reference.sampled(np.array([t]))))

    def rates(t, x):
        q, qd = x[:n], x[n : 2 * n]
        tau, change = controller.continuous(t, q, qd, asked(t), x[2 * n :])
        return np.concatenate([qd, forward_dynamics(description, q, qd, tau), change])

    begin = np.concatenate([*start(reference), controller.initial_state()])
    t = np.linspace(0, ROUND, 401)
    x = solve_ivp(rates, (0, ROUND), begin, "DOP853", t, rtol=1e-11, atol=1e-12).y.T
    true = parameter_grouping(description).matrix @ inertial_parameters(description)
    V = np.array(
        [
            controller.lyapunov(y[:n], y[n : 2 * n], asked(s), y[2 * n :], true)
            for s, y in zip(t, x, strict=True)
        ]
    )
    law.holds("rise between samples, over its start", np.diff(V).max() / V[0], 1e-9)
    assert 0 < V[-1] < 0.5 * V[0]
    s = np.array(
        [
            asked(u).qd - y[n : 2 * n] + controller.decay * (asked(u).q - y[:n])
            for u, y in zip(t, x, strict=True)
        ]
    )
    lost = np.einsum("ki,i,ki->k", s, controller.kd, s)
    law.holds(
        "V lost over the integral of s^T K_D s, from 1",
        abs((V[0] - V[-1]) / np.trapezoid(lost, t) - 1),
        1e-4,
    )


def test_with_the_right_parameters_the_error_decays_as_its_poles_say(law):
    law.samples(1)
    arm = Arm.load("puma560")
    controller = Adaptive.tuned(arm, bandwidth=15.0, damping=1.25, adaptation=1e-9)
    assert np.allclose(controller.decay, 7.5) and np.allclose(
        controller.kd, 30.0 * effective_inertia(arm.description)
    )
    reference = closed_motion(arm)
    q, qd = start(reference)
    # On s = 0 the error decays with Lambda alone.
    e = np.array([0.01, -0.02, 0.01, 0.02, -0.01, 0.03])
    run = arm.simulate(
        controller,
        reference,
        0.2,
        q - e,
        qd + 7.5 * e,
        rate=8000,
        restitution=None,
        saturation=False,
    )
    decayed = run.reference_q[-1] - run.q[-1]
    law.holds("error after 0.2 s, rad", np.abs(decayed - e * np.exp(-1.5)).max(), 2e-5)


def test_it_begins_anew_with_every_run():
    arm = Arm.load("planar2r")
    controller = Adaptive.tuned(arm, masses=0.5)
    before = controller.estimate.copy()
    first = arm.simulate(controller, closed_motion(arm), 0.2)
    assert not np.allclose(controller.estimate, before)
    second = arm.simulate(controller, closed_motion(arm), 0.2)
    assert np.array_equal(first.tau, second.tau)
    controller.reset()
    assert np.array_equal(controller.estimate, before)
    assert np.array_equal(controller.initial_state(), before)
    given_start = Adaptive(arm, 20.0, 1.0, 0.1, estimate=before)
    assert np.array_equal(given_start.estimate, before)


PLANAR = Arm.load("planar2r")
BAD = {
    "no arm": (lambda: Adaptive.tuned("puma560"), "found str; expected an arm"),
    "a negative gain": (
        lambda: Adaptive(PLANAR, -1.0, 1.0, 1.0),
        "decay is -1.0; expected finite numbers",
    ),
    "gains of another arm": (
        lambda: Adaptive(PLANAR, 1.0, np.ones(6), 1.0),
        r"kd has shape \(6,\)",
    ),
    "no adaptation": (
        lambda: Adaptive(PLANAR, 1, 1, 0.0),
        "adaptation is not symmetric and positive definite",
    ),
    "an adaptation of another arm": (
        lambda: Adaptive(PLANAR, 1, 1, np.ones(36)),
        r"adaptation has shape \(36,\)",
    ),
    "an adaptation of NaN": (
        lambda: Adaptive(PLANAR, 1, 1, np.nan),
        r"adaptation has shape \(\); .* finite",
    ),
    "an adaptation that is a word": (
        lambda: Adaptive(PLANAR, 1, 1, "fast"),
        "adaptation: found 'fast'",
    ),
    "a lopsided matrix": (
        lambda: Adaptive(PLANAR, 1, 1, np.triu(np.ones((6, 6)))),
        "not symmetric",
    ),
    "an estimate of another arm": (
        lambda: Adaptive(PLANAR, 1, 1, 1, estimate=np.ones(36)),
        r"estimate has shape \(36,\); expected \(6,\) finite base parameters",
    ),
    "no masses": (
        lambda: Adaptive(PLANAR, 1, 1, 1, masses=0),
        "masses is 0; expected a positive number",
    ),
    "a damping below 1": (
        lambda: Adaptive.tuned(PLANAR, damping=0.7),
        "damping is 0.7; expected 1 or more",
    ),
    "a bandwidth of 0": (lambda: Adaptive.tuned(PLANAR, bandwidth=0), "bandwidth is 0"),
    "a rate of 0": (lambda: Adaptive.tuned(PLANAR, adaptation=0.0), "adaptation is 0.0"),
}


@pytest.mark.parametrize("name", BAD)
def test_it_is_refused_in_one_line(name):
    call, message = BAD[name]
    with pytest.raises((ValueError, TypeError), match=message) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_an_arm_without_bodies():
    with pytest.raises(DescriptionError, match="no body"):
        Adaptive(Arm.from_dh([(0, 0, 1, 0)]), 1.0, 1.0, 1.0)
