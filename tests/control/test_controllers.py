"""Controllers on a PUMA: what each is good for, gains as their formulas say, and one's own."""

import numpy as np
import pytest

import dhkit
from dhkit import (
    LQR,
    PID,
    Arm,
    ComputedTorque,
    FeedForward,
    FrictionCompensation,
    PDGravity,
    Sensors,
    Step,
)
from dhkit.control.gains import effective_inertia

ARM = Arm.load("puma560")
MOTION = ARM.quintic(ARM.configurations["nominal"], ARM.configurations["ready"], duration=2.0)


def peak(controller, **options):
    return ARM.simulate(controller, MOTION, **{"restitution": None} | options).peak_error.max()


def test_computed_torque_follows_and_twice_the_rate_halves_its_error(law):
    law.samples(1)
    once, twice = peak(ComputedTorque.tuned(ARM)), peak(ComputedTorque.tuned(ARM), rate=2000)
    law.holds("rad, computed torque at 1 kHz", once, 3e-5)
    law.holds("error at 2 kHz over that at 1 kHz, from a half", abs(twice / once - 0.5), 0.05)
    law.holds("rad, feed-forward", peak(FeedForward.tuned(ARM)), 1e-4)


@pytest.mark.slow
def test_continuous_controllers_follow_to_rounding(law):
    law.samples(1)
    for controller in (ComputedTorque.tuned(ARM), FeedForward.tuned(ARM)):
        run = ARM.simulate(controller, MOTION, 0.5, rate=None, restitution=None)
        law.holds("rad, continuous", run.peak_error.max(), 1e-9)
        law.holds("energy without account", run.audit.error, 1e-9)


@pytest.mark.slow
def test_a_sampled_controller_tends_to_the_continuous_one(law):
    law.samples(1)
    step = Step(np.zeros(6), np.full(6, 0.05), 0.0105)
    for pid in (PID.tuned(ARM, bandwidth=10), PID.tuned(ARM, bandwidth=10, cutoff=300.0)):
        controller = FrictionCompensation(pid, ARM)
        options = {
            "reference": step,
            "duration": 0.2,
            "q0": np.zeros(6),
            "restitution": None,
            "saturation": False,
        }
        exact = ARM.simulate(controller, rate=None, **options).q[-1]
        slow, fast = (
            np.abs(ARM.simulate(controller, rate=rate, **options).q[-1] - exact).max()
            for rate in (2e3, 4e3)
        )
        law.holds(
            "error at twice the rate over that at the rate, from a half",
            abs(fast / slow - 0.5),
            0.1,
        )


def test_what_the_sensors_make_of_a_state():
    rate = 1000.0
    seen = []

    def spy(t, q, qd, setpoint):
        seen.append((q, qd))
        return np.zeros(6)

    start, speed = np.full(6, 0.1), np.full(6, 0.2)
    options = {"q0": start, "qd0": speed, "duration": 0.05, "rate": rate, "restitution": None}
    coarse = Sensors(resolution=1e-3, differences=True)
    run = ARM.simulate(spy, sensors=coarse, **options)
    q, qd = (np.array(x) for x in zip(*seen, strict=True))
    assert (
        np.allclose(q / 1e-3, np.round(q / 1e-3), atol=1e-9)
        and np.abs(q - run.q).max() <= 0.5001e-3
    )
    assert np.all(qd[0] == 0) and np.allclose(qd[1:], np.diff(q, axis=0) * rate)
    seen.clear()
    run = ARM.simulate(spy, sensors=Sensors(noise=1e-3, rate_noise=0.1, seed=5), **options)
    q, qd = (np.array(x) for x in zip(*seen, strict=True))
    assert 0.8e-3 < np.std(q - run.q) < 1.2e-3 and 0.08 < np.std(qd - run.qd) < 0.12
    first = q.copy()
    seen.clear()
    ARM.simulate(spy, sensors=Sensors(noise=1e-3, rate_noise=0.1, seed=5), **options)
    assert np.array_equal(np.array([x for x, _ in seen]), first)


@pytest.mark.slow
def test_independent_joints_and_gravity(law):
    law.samples(1)
    law.holds("rad, PID", peak(PID.tuned(ARM)), 1e-2)
    assert peak(PID.tuned(ARM)) < peak(PID.tuned(ARM, integral=0.0))
    law.holds("rad, PD and gravity", peak(PDGravity.tuned(ARM)), 2e-2)


@pytest.mark.slow
def test_friction_is_compensated(law):
    law.samples(1)
    plain = peak(ComputedTorque.tuned(ARM), friction=True)
    helped = peak(FrictionCompensation(ComputedTorque.tuned(ARM)), friction=True)
    law.holds("rad, computed torque and friction compensated", helped, 2e-3)
    assert helped < plain / 10


@pytest.mark.slow
def test_a_load_that_nobody_told_of():
    loaded = ARM.with_payload(2.5)
    wrong = peak(ComputedTorque.tuned(ARM), plant=loaded)
    assert wrong > 100 * peak(ComputedTorque.tuned(loaded), plant=loaded)
    assert peak(ComputedTorque.tuned(ARM, bandwidth=60), plant=loaded) < wrong / 4


def test_pd_gravity_holds_a_configuration_exactly_at_rest():
    q = ARM.configurations["ready"] * 0.5
    run = ARM.simulate(PDGravity.tuned(ARM), q, duration=3.0, q0=q + 0.05, restitution=None)
    assert np.abs(run.q[-1] - q).max() < 1e-8


def test_gains_are_those_of_the_formulas():
    q = np.array([0.1, -0.3, 0.2, 0.4, 0.5, -0.6])
    m = np.diagonal(ARM.mass_matrix(q))
    assert np.allclose(effective_inertia(ARM.description, q), m, rtol=1e-14)
    pid = PID.tuned(ARM, bandwidth=10, damping=0.8, integral=0.25, q=q)
    # The closed loop of one joint: m s^3 + kd s^2 + kp s + ki.
    for joint in range(6):
        roots = np.roots([m[joint], pid.kd[joint], pid.kp[joint], pid.ki[joint]])
        wanted = [-2.5, *np.roots([1, 16, 100])]
        assert np.allclose(np.sort_complex(roots), np.sort_complex(wanted), rtol=1e-9)
    computed = ComputedTorque.tuned(ARM, bandwidth=10, damping=0.8)
    assert (computed.kp, computed.kd) == (100, 16)


def test_the_integral_stands_still_in_a_drive_that_gives_all_it_can():
    wound = PID(100, 1000, 10)
    careful = PID(100, 1000, 10, limit=1.0)
    at = dhkit.control.Setpoint(ARM.description, np.ones(6), np.zeros(6), np.zeros(6))
    for controller in (wound, careful):
        for k in range(100):
            controller(k * 1e-3, np.zeros(6), np.zeros(6), at)
    assert np.all(careful._integral == 0)
    assert np.allclose(wound._integral, 0.099)
    careful.reset()
    assert careful._time is None


def test_a_filter_and_a_derivative_of_the_measurement():
    moving = dhkit.control.Setpoint(ARM.description, np.zeros(6), np.ones(6), np.zeros(6))
    assert np.all(PID(0, 0, 2.0)(0.0, np.zeros(6), np.zeros(6), moving) == 2)
    assert np.all(
        PID(0, 0, 2.0, derivative="measurement")(0.0, np.zeros(6), np.zeros(6), moving) == 0
    )
    slow = PID(0, 0, 1.0, cutoff=10.0)
    slow(0.0, np.zeros(6), np.zeros(6), moving)
    assert np.allclose(slow(0.1, np.zeros(6), np.ones(6), moving), np.exp(-1.0))


def test_linear_systems_are_those_of_differences(law):
    rng = np.random.default_rng(5)
    step = 1e-5
    for _ in range(law.samples(20)):
        q, qd = rng.normal(size=(2, 6))
        A, B = ARM.linearize(q, qd)
        tau = ARM.bias(q, qd)

        def rate(x, u, tau=tau):
            return np.concatenate([x[6:], ARM.forward_dynamics(x[:6], x[6:], tau + u)])

        x, zero = np.concatenate([q, qd]), np.zeros(6)
        byx = np.stack(
            [(rate(x + d, zero) - rate(x - d, zero)) / (2 * step) for d in step * np.eye(12)],
            axis=1,
        )
        byu = np.stack([(rate(x, d) - rate(x, -d)) / (2 * step) for d in step * np.eye(6)], axis=1)
        law.holds("A against differences", np.abs(A - byx).max() / np.abs(A).max(), 1e-7)
        law.holds("B against differences", np.abs(B - byu).max() / np.abs(B).max(), 1e-7)


def test_a_regulator_decays_as_its_slowest_eigenvalue(law):
    law.samples(1)
    q = np.array([0.2, 0.5, -0.8, 0.3, 0.6, 0.1])
    lqr = LQR(ARM, q)
    residual = (
        lqr.A.T @ lqr.P
        + lqr.P @ lqr.A
        - lqr.P @ lqr.B @ np.linalg.solve(lqr.R, lqr.B.T @ lqr.P)
        + lqr.Q
    )
    law.holds("Riccati's residual over Q", np.abs(residual).max(), 1e-9)
    values, vectors = np.linalg.eig(lqr.A - lqr.B @ lqr.K)
    slowest = int(np.argmax(values.real))
    assert values.real[slowest] < 0
    offset = np.real(vectors[:, slowest])
    offset *= 1e-4 / np.abs(offset).max()
    run = ARM.simulate(
        lqr, q, 1.0, q + offset[:6], offset[6:], rate=4000, restitution=None, saturation=False
    )
    if abs(values[slowest].imag) < 1e-9:
        size = np.linalg.norm(run.q - q, axis=1)
        decay = np.log(size[-1] / size[0]) / run.t[-1]
        law.holds(
            "decay over the slowest eigenvalue, from 1", abs(decay / values.real[slowest] - 1), 0.02
        )


def test_ones_own_controller():
    class Bang:
        def __init__(self):
            self.runs = 0

        def reset(self):
            self.runs += 1

        def __call__(self, t, q, qd, setpoint):
            assert setpoint.T.shape == (4, 4)
            return (10.0 * np.sign(setpoint.q - q)).tolist()

    own = Bang()
    run = ARM.simulate(own, ARM.configurations["ready"], duration=0.05)
    assert own.runs == 1
    assert run.q.shape == run.tau.shape == (51, 6)
    assert "puma560: 0.05 s in 50 steps" in repr(run)


def test_torques_are_cut_off_at_what_drives_can_give():
    run = ARM.simulate(lambda t, q, qd, s: np.full(6, 1e6), duration=0.01)
    effort = ARM.description.numbers.effort
    assert np.all(run.tau == effort) and np.all(run.tau_asked == 1e6)
    assert np.all(run.saturated == 1.0)
