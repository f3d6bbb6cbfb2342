"""What cannot be simulated is refused in one clear line; a wrong controller names the time, and keeps the run."""

import re

import numpy as np
import pytest

from dhkit import (
    LQR,
    PID,
    Arm,
    ComputedTorque,
    FrictionCompensation,
    Push,
    SimulationError,
    Sine,
    Step,
)
from dhkit.control import Plant
from dhkit.errors import DescriptionError

ARM = Arm.load("planar2r")
OTHER = Arm.load("puma560")
RIGHT = ComputedTorque.tuned(ARM)


def run(**options):
    return ARM.simulate(**{"controller": RIGHT, "q0": [0.1, 0.2], "duration": 0.01} | options)


BAD = {
    "a rate of 0": (lambda: run(rate=0), r"rate is 0; expected a positive number"),
    "a negative rate": (lambda: run(rate=-1.0), "rate is -1.0"),
    "a rate that is not a number": (lambda: run(rate=np.nan), "rate is nan"),
    "a plant that is slower": (
        lambda: run(plant_rate=100),
        "plant_rate is 100; expected a multiple of rate, 1000",
    ),
    "a plant that does not fit": (lambda: run(plant_rate=1500), "expected a multiple of rate"),
    "no end": (lambda: run(duration=None), "duration is not given, and the reference has no end"),
    "a duration of years": (
        lambda: run(duration=1e9),
        r"1e\+09 s at 1000 Hz are 1e\+12 steps; expected at most",
    ),
    "an endless duration": (lambda: run(duration=np.inf), "duration is inf"),
    "a duration of 0": (lambda: run(duration=0), "duration is 0"),
    "a state that is not a number": (
        lambda: run(q0=[0, np.nan]),
        "q0 has values that are not finite",
    ),
    "a state of another arm": (lambda: run(q0=np.zeros(6)), r"q0 has shape \(6,\)"),
    "rates of another arm": (lambda: run(qd0=np.zeros(3)), r"qd0 has shape \(3,\)"),
    "a batch of states": (lambda: run(q0=np.zeros((3, 2))), r"q0 has shape \(3, 2\)"),
    "a motion of another arm": (
        lambda: run(reference=OTHER.quintic(np.zeros(6), np.full(6, 0.1), 1.0)),
        r"motion of puma560 \(6 joints\); expected one of planar2r \(2 joints\)",
    ),
    "a reference that is not a configuration": (
        lambda: run(reference="raedy"),
        "reference: .* no configuration 'raedy'",
    ),
    "a step of another arm": (
        lambda: run(reference=Step(np.zeros(6), np.ones(6))),
        r"reference's q has shape \(11, 6\)",
    ),
    "a sine without end": (lambda: run(reference=Sine([0, 0], [np.inf, 1])), "Sine: amplitude is"),
    "a plant of other joints": (
        lambda: run(plant=OTHER),
        "the plant has joints RRRRRR; expected RR",
    ),
    "a stop that gives energy": (
        lambda: run(restitution=1.5),
        "restitution is 1.5; expected 0 to 1",
    ),
    "a stop that takes more than there is": (lambda: run(restitution=-0.1), "restitution is -0.1"),
    "friction that is a word": (lambda: run(friction="much"), "friction is 'much'"),
    "a push on a link that is not there": (
        lambda: run(pushes=[Push([1, 0, 0], link=5)]),
        "link is 5; planar2r has 2",
    ),
    "a push on link 0": (lambda: Push([1, 0, 0], link=0), "link is 0; expected 1 or more"),
    "a push of two numbers": (lambda: Push([1, 0]), "force is"),
    "a push that ends before it begins": (
        lambda: Push([1, 0, 0], begin=2, end=1),
        "ends at 1 s, before it begins",
    ),
    "a push without end": (lambda: Push([np.nan, 0, 0]), "three finite numbers"),
    "a negative gain": (lambda: PID(-1.0), r"kp is -1.0; expected finite numbers, 0 or more"),
    "gains of another arm": (lambda: ComputedTorque(ARM, np.ones(6), 1.0), r"kp has shape \(6,\)"),
    "a gain that is not a number": (lambda: PID(1.0, np.nan), "ki is nan"),
    "a derivative of something else": (lambda: PID(1.0, derivative="both"), "derivative is 'both'"),
    "a bandwidth of 0": (lambda: PID.tuned(ARM, bandwidth=0.0), "bandwidth is 0.0"),
    "a negative damping": (lambda: ComputedTorque.tuned(ARM, damping=-1), "damping is -1"),
    "a cutoff of 0": (lambda: PID(1.0, cutoff=0), "cutoff is 0"),
    "a limit of 0": (lambda: PID(1.0, limit=0.0), "limit is 0.0"),
    "no arm": (lambda: ComputedTorque("planar2r", 1, 1), "found str; expected an arm"),
    "nothing to compensate around": (lambda: FrictionCompensation(3), "expected a controller"),
    "weights of another arm": (lambda: LQR(ARM, [0, 0], Q=np.ones(3)), r"Q has shape \(3, 3\)"),
    "weights that reward": (lambda: LQR(ARM, [0, 0], R=-np.ones(2)), "R positive definite"),
    "weights that are not symmetric": (
        lambda: LQR(ARM, [0, 0], R=[[1, 2], [0, 1]]),
        "R is not symmetric",
    ),
    "linear at no number": (lambda: ARM.linearize([0, np.inf]), "q has values that are not finite"),
}


@pytest.mark.parametrize("name", BAD)
def test_it_is_refused_in_one_line(name):
    call, message = BAD[name]
    with pytest.raises((ValueError, TypeError), match=message) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_an_arm_without_bodies():
    bare = Arm.from_dh([(0, 0, 1, 0)])
    with pytest.raises(DescriptionError, match="no body"):
        bare.simulate(duration=0.1)
    with pytest.raises(DescriptionError, match="no body"):
        Plant(bare.description)


class Late:
    """Does something wrong at 5 ms."""

    def __init__(self, wrong):
        self.wrong = wrong

    def __call__(self, t, q, qd, setpoint):
        return self.wrong() if t > 0.0045 else np.zeros(2)


def stumble():
    raise KeyError("gain")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (stumble, "the controller raised KeyError at 0.005 s: 'gain'"),
        (
            lambda: np.zeros(3),
            r"the controller returned shape \(3,\) at 0.005 s; expected \(2,\) finite torques",
        ),
        (lambda: [0.0, np.nan], r"returned \[0.0, nan\] at 0.005 s"),
        (lambda: None, r"at 0.005 s"),
        (lambda: "ab", "at 0.005 s"),
    ],
)
def test_a_wrong_controller_names_the_time_and_keeps_the_run(wrong, message):
    with pytest.raises(SimulationError, match=message) as caught:
        run(controller=Late(wrong))
    result = caught.value.result
    assert result.t[-1] == pytest.approx(0.004)
    assert np.isfinite(result.q).all()
    assert "\n" not in str(caught.value)


def test_a_run_that_leaves_all_bounds_ends():
    with pytest.raises(SimulationError, match="no longer finite") as caught:
        ARM.simulate(
            lambda t, q, qd, s: 1e6 * qd + 1e4, duration=5.0, restitution=None, saturation=False
        )
    assert np.isfinite(caught.value.result.q).all()


def test_progress_can_end_a_run():
    def stop(done, total):
        assert (done, total) == (1000, 3000)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(duration=3.0, progress=stop)


JUMPING = r"torques jump in step after step, .* a relay, .* a rate in Hz"
MOST_CALLS = 100_000
"""Calls of a controller before its run must have failed: a few seconds of work on any machine."""


def continuous_failure(arm, torques, duration, qd0=(0.0, 0.0)):
    """Return the error of a continuous run, and the number of times that its controller was called."""
    calls = 0

    def counting(t, q, qd, setpoint):
        nonlocal calls
        calls += 1
        return torques(t, q, qd, setpoint)

    with pytest.raises(SimulationError) as caught:
        arm.simulate(counting, [0.5, 0.5], duration, q0=[0.0, 0.0], qd0=qd0, rate=None)
    assert "\n" not in str(caught.value)
    return caught.value, calls


def damped(t, q, qd, setpoint):
    return ARM.gravity_torque(q) + 100 * (setpoint.q - q) - 20 * qd


def test_a_relay_has_no_continuous_solution():
    def relay(t, q, qd, setpoint):
        return ARM.gravity_torque(q) + [20, 8] * np.sign(setpoint.q - q - 0.2 * qd)

    error, calls = continuous_failure(ARM, relay, 0.1)
    assert re.search(JUMPING, str(error))
    assert len(error.result.t) >= 1
    assert calls < 10_000


@pytest.mark.slow
@pytest.mark.parametrize("size", [1e-3, 1e-6])
def test_a_relay_that_is_small_beside_smooth_torques_has_no_continuous_solution(size):
    def relay(t, q, qd, setpoint):
        return damped(t, q, qd, setpoint) + size * np.sign(setpoint.q - q - 0.2 * qd)

    error, calls = continuous_failure(ARM, relay, 3.0)
    assert re.search(JUMPING, str(error))
    assert calls < MOST_CALLS


@pytest.mark.parametrize("size", [1.0, 1e-7])
def test_torques_of_noise_have_no_continuous_solution(size):
    rng = np.random.default_rng(0)

    def noisy(t, q, qd, setpoint):
        return damped(t, q, qd, setpoint) + size * rng.normal(size=2)

    error, calls = continuous_failure(ARM, noisy, 1.0)
    assert re.search(JUMPING, str(error))
    assert calls < MOST_CALLS


@pytest.mark.slow
def test_a_controller_may_switch_at_times():
    def square_wave(t, q, qd, setpoint):
        return damped(t, q, qd, setpoint) + 3 * np.sign(np.sin(200 * t))

    run = ARM.simulate(square_wave, [0.5, 0.5], 0.1, q0=[0.0, 0.0], rate=None)
    assert run.t[-1] == pytest.approx(0.1)


DIVERGING = {
    "quadratic": lambda t, q, qd, setpoint: 5 * qd * np.abs(qd),
    "slow": lambda t, q, qd, setpoint: 2 * qd,
    "fast": lambda t, q, qd, setpoint: 1e6 * qd,
    "wrong sign": lambda t, q, qd, setpoint: 20 * qd - 100 * (setpoint.q - q),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", DIVERGING)
def test_a_smooth_controller_that_diverges_is_not_called_a_relay(name):
    free = ARM.with_limits(lower=[-np.inf] * 2, upper=[np.inf] * 2, torque=[np.inf] * 2)
    error, calls = continuous_failure(free, DIVERGING[name], 5.0, qd0=(0.1, 0.1))
    assert re.search(
        r"the motion diverges: \w+ moves at .* rad/s at .* expected a controller that is stable",
        str(error),
    )
    assert calls < 2 * MOST_CALLS
