"""A batch of arms moves as each of them does alone, and one that fails does not touch the others."""

import numpy as np
import pytest

from dhkit import (
    LQR,
    PID,
    Arm,
    ComputedTorque,
    FeedForward,
    Friction,
    FrictionCompensation,
    OperationalSpace,
    PDGravity,
    Sensors,
    Sine,
)
from dhkit.control.batch_run import BLOCK
from dhkit.control.law import law_of
from dhkit.errors import SimulationError

PLANT_RATE = 4000.0
"""Hz: fine enough for the energy of the smallest arms to be kept to 1e-9."""
AGREE = 1e-11
"""Of states up to some rad and rad/s: the batch's program adds in another order than the single one."""


def states(arm, count, seed=3):
    return np.random.default_rng(seed).normal(size=(2, count, arm.n)) * 0.3


def same_as_alone(arm, law, controller, reference, q, qd, singles=None, friction=False, **options):
    """Compare a batch with its runs one by one."""
    plant = options.get("plant")
    batch = arm.simulate_batch(
        controller,
        reference,
        0.05,
        q,
        qd,
        plant=plant,
        plant_rate=PLANT_RATE,
        keep="all",
        friction=friction or None,
    )
    for i in range(len(batch)):
        alone = (singles or [controller] * len(batch))[i]
        run = arm.simulate(
            alone,
            reference[i]
            if isinstance(reference, np.ndarray) and reference.ndim == 2
            else reference,
            q0=q[i] if q.ndim == 2 else q,
            qd0=qd[i] if qd.ndim == 2 else qd,
            plant=plant[i] if isinstance(plant, list) else plant,
            friction=friction,
            duration=0.05,
            plant_rate=PLANT_RATE,
            restitution=None,
        )
        rate, torque, pull = (max(1.0, np.abs(x).max()) for x in (run.qd, run.tau, run.qdd))
        for name in ("q", "qd", "reference_q"):
            difference = np.abs(getattr(batch[i], name) - getattr(run, name)).max()
            law.holds(
                f"{name}, batch against single, over the largest rate", difference / rate, AGREE
            )
        law.holds("torques over the largest", np.abs(batch[i].tau - run.tau).max() / torque, 1e-9)
        law.holds("qdd over the largest", np.abs(batch[i].qdd - run.qdd).max() / pull, 1e-9)
        assert np.allclose(batch.peak_error[i], run.peak_error, rtol=1e-8, atol=1e-12)
        assert np.allclose(batch.rms_error[i], run.rms_error, rtol=1e-8, atol=1e-12)
        assert np.allclose(batch.final_error[i], run.final_error, rtol=1e-8, atol=1e-12)
        assert np.array_equal(batch.saturated[i], run.saturated)
        law.holds("energy without account", batch.audit(i).error, 1e-9)
    return batch


@pytest.mark.parametrize("name", ["puma560", "panda", "stanford", "planar2r", "cart_pendulum"])
@pytest.mark.slow
def test_states_advance_as_each_alone(name, law):
    arm = Arm.load(name)
    law.samples(1)
    q, qd = states(arm, 3)
    same_as_alone(arm, law, None, None, q, qd)
    for controller in (
        PID.tuned(arm),
        ComputedTorque.tuned(arm),
        PDGravity.tuned(arm),
        FeedForward.tuned(arm),
    ):
        same_as_alone(arm, law, controller, np.zeros(arm.n), q, qd)
    same_as_alone(arm, law, LQR(arm, np.zeros(arm.n)), np.zeros(arm.n), q, qd)


@pytest.mark.slow
def test_motions_friction_and_setpoints_of_their_own(law):
    arm = Arm.load("puma560")
    law.samples(1)
    q, qd = states(arm, 3)
    wave = Sine(np.zeros(6), np.full(6, 0.2), 2.0)
    same_as_alone(
        arm,
        law,
        FrictionCompensation(ComputedTorque.tuned(arm)),
        wave,
        q,
        qd,
        friction=Friction(0.05),
    )
    # Narrow friction takes more steps than there are control periods.
    narrow = same_as_alone(
        arm, law, ComputedTorque.tuned(arm), wave, q, qd, friction=Friction(1e-3)
    )
    assert narrow[0].audit.friction > 0
    same_as_alone(arm, law, PDGravity.tuned(arm), q + 0.1, q, qd)


def test_gains_of_their_own(law):
    arm = Arm.load("puma560")
    law.samples(1)
    w = np.array([5.0, 10.0, 20.0, 40.0])
    q, qd = np.full(6, 0.1), np.zeros(6)
    gains = np.ones((4, 6)) * w[:, None]
    singles = [ComputedTorque.tuned(arm, bandwidth=x) for x in w]
    batch = same_as_alone(
        arm, law, ComputedTorque(arm, gains**2, 2 * gains), np.zeros(6), q, qd, singles
    )
    assert len(batch) == 4
    singles = [PID(100 * x, 50.0, x) for x in w]
    same_as_alone(arm, law, PID(100 * gains, 50.0, gains), np.zeros(6), q, qd, singles)


@pytest.mark.parametrize("friction", [False, Friction(0.05)])
@pytest.mark.slow
def test_arms_of_their_own(friction, law):
    arm = Arm.load("puma560")
    law.samples(1)
    q, qd = states(arm, 3)
    plants = [arm, arm.with_payload(1.0), arm.with_payload(2.5, com=(0, 0, 0.1))]
    batch = same_as_alone(
        arm, law, ComputedTorque.tuned(arm), np.zeros(6), q, qd, friction=friction, plant=plants
    )
    assert batch.arm(2).digest == plants[2].description.digest
    one = same_as_alone(
        arm, law, ComputedTorque.tuned(arm), np.zeros(6), q, qd, friction=friction, plant=plants[2]
    )
    assert len(one.arms) == 1


def test_one_that_fails_leaves_the_others_alone():
    arm = Arm.load("planar2r")
    q, qd = states(arm, 100)
    qd[17] = 1e200
    batch = arm.simulate_batch(ComputedTorque.tuned(arm), np.zeros(2), 0.05, q, qd)
    assert np.flatnonzero(batch.failed).tolist() == [17]
    others = np.arange(100) != 17
    alone = arm.simulate_batch(ComputedTorque.tuned(arm), np.zeros(2), 0.05, q[others], qd[others])
    assert np.array_equal(batch.q[others], alone.q)


def test_what_is_kept():
    arm = Arm.load("planar2r")
    q, _ = states(arm, 5)
    q[1] = 100.0
    called = []
    options = {"duration": 2.0, "progress": lambda k, n: called.append((k, n))}
    final, errors, everything = (
        arm.simulate_batch(PDGravity.tuned(arm), np.zeros(2), q0=q, keep=keep, **options)
        for keep in ("final", "errors", "all")
    )
    assert called[:2] == [(1000, 2000), (2000, 2000)]
    assert np.array_equal(final.q, everything.q) and np.array_equal(final.q, errors.q)
    assert final.peak_error is None and final.outside is None and errors.history is None
    assert np.array_equal(everything[2].q[-1], everything.q[2])
    assert np.array_equal(everything[-1].q, everything[4].q)
    lower, upper = arm.description.numbers.lower, arm.description.numbers.upper
    if np.isfinite(lower).all():
        assert np.array_equal(errors.outside, ((q < lower) | (q > upper)).any(axis=1))
    assert "5 x planar2r: 2 s in 2000 steps, largest error" in repr(errors)
    with pytest.raises(ValueError, match='expected keep="all"'):
        final[0]
    with pytest.raises(IndexError, match="run 5 of 5"):
        everything[5]


@pytest.mark.slow
def test_threads_and_sensors(compiled):
    arm = Arm.load("puma560")
    q, _ = states(arm, 9000)
    control = PDGravity.tuned(arm)
    one = arm.simulate_batch(control, np.zeros(6), 0.005, q, keep="final")
    two = arm.simulate_batch(control, np.zeros(6), 0.005, q, keep="final", threads=2)
    assert np.array_equal(one.q, two.q)
    noisy = arm.simulate_batch(control, np.zeros(6), 0.005, q[:3], sensors=Sensors(noise=1e-3))
    again = arm.simulate_batch(control, np.zeros(6), 0.005, q[:3], sensors=Sensors(noise=1e-3))
    assert np.array_equal(noisy.q, again.q) and not np.array_equal(noisy.q, one.q[:3])


@pytest.mark.parametrize(
    "kind",
    [
        PDGravity,
        pytest.param(ComputedTorque, marks=pytest.mark.slow),
        pytest.param(FeedForward, marks=pytest.mark.slow),
    ],
)
def test_a_law_in_the_program_is_the_controller(kind, compiled, law):
    """Blocks with the law in the program, and one batch for which the controller is called; two arms, two steps."""
    arm = Arm.load("puma560")
    law.samples(1)
    q, qd = states(arm, 5000)
    control = kind.tuned(arm)
    plants = [arm.with_payload(1.0)] * 2500 + [arm.with_payload(2.0)] * 2500
    for reference in (Sine(np.zeros(6), np.full(6, 0.2), 2.0), q + 0.1):
        for plant in (None, plants):
            options = {"plant": plant, "friction": Friction(0.05), "plant_rate": 2000.0}
            inside = arm.simulate_batch(control, reference, 0.01, q, qd, **options)
            called = arm.simulate_batch(lambda *a: control(*a), reference, 0.01, q, qd, **options)
            for name in ("q", "qd", "peak_error", "rms_error", "saturated"):
                difference = np.abs(getattr(inside, name) - getattr(called, name)).max()
                law.holds(f"{name}, in the program against called", difference, 1e-10)
            assert np.allclose(inside.works, called.works, rtol=1e-9, atol=1e-12)


def test_a_controller_of_ones_own_on_top_of_ours_keeps_its_say():
    class Lazy(PDGravity):
        def __call__(self, t, q, qd, setpoint):
            return 0.5 * super().__call__(t, q, qd, setpoint)

    assert law_of(PDGravity.tuned(ARM)) is not None
    assert law_of(Lazy.tuned(ARM)) is None
    q, _ = states(ARM, 3)
    lazy = ARM.simulate_batch(Lazy.tuned(ARM), np.zeros(2), 0.05, q)
    alone = ARM.simulate(Lazy.tuned(ARM), np.zeros(2), 0.05, q[1], restitution=None)
    assert np.allclose(lazy.q[1], alone.q[-1], atol=1e-12)


@pytest.mark.slow
def test_blocks_tell_how_far_the_whole_is():
    told = []
    q, _ = states(ARM, 3 * BLOCK)
    ARM.simulate_batch(
        PDGravity.tuned(ARM), np.zeros(2), 1.0, q, progress=lambda k, n: told.append((k, n))
    )
    assert told == [(333, 1000), (666, 1000), (1000, 1000)]

    def stop(k, n):
        raise KeyboardInterrupt

    for threads in (1, 2):
        with pytest.raises(KeyboardInterrupt):
            ARM.simulate_batch(
                PDGravity.tuned(ARM), np.zeros(2), 1.0, q, threads=threads, progress=stop
            )


ARM = Arm.load("planar2r")


def run(**options):
    return ARM.simulate_batch(
        **{"controller": ComputedTorque.tuned(ARM), "q0": np.zeros((3, 2)), "duration": 0.01}
        | options
    )


BAD = {
    "one arm at a time": (
        {"controller": OperationalSpace.tuned(Arm.load("planar2r"))},
        "OperationalSpace controls one arm at a time; expected another controller, or simulate\\(\\) for each arm",
    ),
    "friction that is a step": ({"friction": Friction()}, "a batch has no stiction"),
    "something else to keep": (
        {"keep": "some"},
        "keep is 'some'; expected one of final, errors, all",
    ),
    "batches that do not fit": ({"qd0": np.zeros((4, 2))}, "batches of 3, 4; expected one"),
    "gains that do not fit": (
        {"controller": PID(np.ones((5, 2)))},
        "batches of 3, 5; expected one",
    ),
    "states of another arm": ({"q0": np.zeros((3, 6))}, r"q0 has shape \(3, 6\)"),
    "states on a grid": (
        {"q0": np.zeros((3, 3, 2))},
        r"q0 has shape \(3, 3, 2\); expected \(2,\) or \(B, 2\)",
    ),
    "a state that is not a number": ({"q0": np.full((3, 2), np.nan)}, "finite"),
    "a plant of other joints": (
        {"plant": Arm.load("puma560")},
        "a plant has joints RRRRRR; expected RR",
    ),
    "no end": ({"duration": None}, "duration is not given"),
    "a rate of 0": ({"rate": 0}, "rate is 0"),
    "no threads": ({"threads": 0}, "threads is 0"),
    "more than fits": (
        {"keep": "all", "duration": 9000.0, "q0": np.zeros((1000, 2))},
        "all states are 576 GB",
    ),
    "a reference that is a word": ({"reference": "raedy"}, "no configuration 'raedy'"),
}


@pytest.mark.parametrize("name", BAD)
def test_it_is_refused_in_one_line(name):
    options, message = BAD[name]
    with pytest.raises((ValueError, TypeError), match=message) as caught:
        run(**options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("controller", "message"),
    [
        (
            lambda t, q, qd, s: np.zeros((3, 5)),
            r"returned ndarray of shape \(3, 5\) at 0 s; expected torques \(3, 2\)",
        ),
        (lambda t, q, qd, s: "much", "returned str"),
        (
            lambda t, q, qd, s: np.array([[0, 0], [0, np.nan], [0, 0]]),
            "torques of run 1 are not finite at 0 s",
        ),
        (lambda t, q, qd, s: q.fill(0), "raised ValueError at 0 s"),
        (lambda t, q, qd, s: 1 / 0, "raised ZeroDivisionError at 0 s"),
    ],
)
def test_a_wrong_controller_names_the_time(controller, message):
    with pytest.raises(SimulationError, match=message):
        run(controller=controller)
