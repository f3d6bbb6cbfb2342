"""No run is called fine that is not: what controllers and references could change, hide or step over."""

import numpy as np
import pytest

from acceptance import only_accepting
from dhkit import (
    LQR,
    PID,
    Arm,
    ComputedTorque,
    Friction,
    FrictionCompensation,
    OperationalSpace,
    PDGravity,
    Push,
    SimulationError,
    SimulationResult,
    Step,
    Trajectory,
)
from dhkit.control import EnergyAudit, Plant, simulate
from dhkit.kinematics import forward_kinematics

ARM = Arm.load("puma560")
START = ARM.configurations["nominal"]
SMALL = Arm.load("planar2r")
HOLD = PDGravity.tuned(ARM)


@pytest.mark.parametrize("run", ["simulate", "simulate_batch"])
def test_a_controller_cannot_rewrite_what_it_is_judged_by(run):
    def cheating(t, q, qd, setpoint):
        setpoint.q[:] = q
        return 0 * q

    with pytest.raises(SimulationError, match="read-only"):
        getattr(ARM, run)(cheating, START, 0.1, START)

    class Cached:
        duration = None

        def __init__(self):
            self.q = np.tile([0.1, 0.2], (11, 1))

        def sampled(self, t):
            return self.q[: len(t)], np.zeros((len(t), 2)), np.zeros((len(t), 2))

    reference = Cached()
    SMALL.simulate(ComputedTorque.tuned(SMALL), reference, duration=0.01)
    assert np.array_equal(reference.q, np.tile([0.1, 0.2], (11, 1)))


def test_a_reference_cannot_change_the_time_of_the_run():
    class Late:
        duration = None

        def sampled(self, t):
            t -= 0.1
            return (
                START + 0.2 * np.clip(t, 0, None)[:, None],
                np.zeros((len(t), 6)),
                np.zeros((len(t), 6)),
            )

    for rate in (1000.0, None):
        run = ARM.simulate(HOLD, Late(), duration=0.3, rate=rate)
        assert run.t[0] == 0 and run.t[-1] == pytest.approx(0.3)


def test_the_tool_is_measured_against_the_arm_that_the_reference_is_of(tmp_path):
    longer = SMALL.with_parameters(l1=0.52)
    T = SMALL.fk([0.3, 0.5])
    run = SMALL.simulate(ComputedTorque.tuned(longer), T, duration=0.1, plant=longer, q0=[0.3, 0.5])
    assert run.tool_norms.final == pytest.approx(
        np.linalg.norm(T[:3, 3] - run.T[-1][:3, 3]), rel=1e-12
    )
    assert run.tool_norms.final > 0.019
    again = SimulationResult.load(run.save(tmp_path / "run.npz"))
    assert again.tool_norms == run.tool_norms
    with pytest.raises(ValueError, match="no room for the reference's poses"):
        run.save(tmp_path / "run.csv")
    assert not len(
        SMALL.simulate(
            None, q0=[0.3, 0.5], duration=0.01, plant=SMALL.with_payload(0.1)
        ).reference_poses
    )


def test_a_kernel_that_is_compiled_meanwhile_makes_no_other_arm(monkeypatch):
    """The poses of two calls differ by roundings if a compiled kernel replaces the interpreter between them."""
    roundings = iter([1e-16, 2e-16])

    def poses(description, q):
        return forward_kinematics(description, q) + next(roundings)

    monkeypatch.setattr("dhkit.control.runs.forward_kinematics", poses)
    assert not len(SMALL.simulate(None, q0=[0.3, 0.5], duration=0.01).reference_poses)


@pytest.mark.parametrize("length", [0.05, 0.01])
@pytest.mark.slow
def test_a_continuous_run_does_not_step_over_a_pulse(length):
    def pulse(t, q, qd, setpoint):
        return HOLD(t, q, qd, setpoint) + np.array([50.0 * (0.9 < t < 0.9 + length), 0, 0, 0, 0, 0])

    moved = [
        np.abs(ARM.simulate(pulse, START, 1.2, rate=rate).q - START).max()
        for rate in (None, 4000.0)
    ]
    assert moved[0] == pytest.approx(moved[1], rel=0.05) and moved[0] > 1e-4


@pytest.mark.slow
def test_a_joint_does_not_break_away_between_two_rows_unseen():
    numbers = ARM.description.numbers

    def shove(t, q, qd, setpoint):
        size = 3 * numbers.coulomb[0, 0] * np.exp(-(((t - 0.25) / 0.05) ** 2))
        return ARM.gravity_torque(q) + np.array([size, 0, 0, 0, 0, 0])

    sparse = ARM.simulate(shove, START, 0.5, rate=None, friction=True, plant_rate=2)
    dense = ARM.simulate(shove, START, 0.5, rate=None, friction=True, plant_rate=100)
    assert abs(dense.q[-1, 0]) > 0.01
    assert sparse.q[-1, 0] == pytest.approx(dense.q[-1, 0], abs=1e-9)


def test_an_audit_of_what_failed_is_not_fine():
    batch = SMALL.simulate_batch(
        None, q0=[[0, 0], [1, 1]], qd0=[[1e200, 1e200], [0, 0]], duration=0.05
    )
    assert batch.failed.tolist() == [True, False] and batch.outside[0]
    assert not batch.audit(0).error <= 1e-9
    assert "1 failed" in repr(batch)
    assert EnergyAudit(100.0, 0, 0, 0, 0, 0).error == np.inf
    assert EnergyAudit(0.0, 0, 0, 0, 0, 0).error == 0
    assert "residual" in str(EnergyAudit(1.0, 1.0, 0, 0, 0, 1.0))


def test_a_pose_is_not_four_arms():
    arm = Arm.load("cobra600")
    T = arm.fk([0.3, 0.4, 0.1, 0.2])
    with pytest.raises(
        ValueError, match="looks like a pose of the tool; a batch holds joint values"
    ):
        arm.simulate_batch(PDGravity.tuned(arm), T, duration=0.05, q0=np.zeros(4))


def test_an_arm_begins_inside_its_stops():
    upper = ARM.description.numbers.upper
    q = START.copy()
    q[1] = upper[1] + 10
    with pytest.raises(
        ValueError,
        match=r"q0: shoulder is 13\.93 rad \(2\.22 turns; were degrees meant\?\), above its upper limit, 3\.927 rad",
    ):
        ARM.simulate(HOLD, START, 0.01, q)
    with pytest.raises(ValueError, match="the reference's first state: shoulder is 45"):
        ARM.simulate(HOLD, [0, 45, 0, 0, 0, 0], 0.01)
    assert np.array_equal(ARM.simulate(HOLD, START, 0.01, q, restitution=None).q[0], q)


def test_a_reference_beyond_the_stops_is_told_of(caplog):
    far = START.copy()
    far[1] += 10
    ARM.simulate(HOLD, Step(START, far, 0.005), 0.01)
    assert "the reference leads shoulder by" in caplog.text and "degrees?" in caplog.text


def test_a_joint_that_passes_its_stop_and_comes_back_within_a_step_is_stopped():
    arm = Arm.load("cart_pendulum")
    upper = arm.description.numbers.upper
    q, qd = np.zeros(2), np.zeros(2)
    assert np.isfinite(upper[0])
    pull = -1000.0
    M = 1 / np.linalg.inv(arm.mass_matrix(q))[0, 0]  # the pendulum swings freely
    # Thrown so that it turns a little beyond its stop, between two steps.
    for depth in (1e-6, 1e-5):
        q[0] = upper[0] - 3e-5
        qd[0] = np.sqrt(2 * abs(pull) / M * (3e-5 + depth))
        run = arm.simulate(
            lambda t, q, qd, s: [pull, 0.0], q0=q, qd0=qd, duration=0.01, rate=100, saturation=False
        )
        assert run.audit.impacts > 0, depth


def test_states_of_a_continuous_controller_are_its_own_only_by_their_rates():
    law = PDGravity.tuned(SMALL)

    class Meddling:
        def __init__(self, meddles):
            self.meddles = meddles

        def initial_state(self, q):
            return np.ones(1)

        def continuous(self, t, q, qd, setpoint, state):
            torque = law(t, q, qd, setpoint) + 0.1 * state
            if self.meddles:
                state *= 50
            return torque, -state * (1 / 50 if self.meddles else 1)

        def __call__(self, t, q, qd, setpoint):
            return np.zeros(2)

    runs = [SMALL.simulate(Meddling(x), [0.1, 0.2], 0.1, rate=None).q for x in (False, True)]
    assert np.array_equal(*runs)


def test_the_name_of_a_column_counts_before_its_capitals(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,q1,q2,Q1\n0,0,0,5\n1,.1,.1,5\n")
    assert np.allclose(Trajectory.read(path, SMALL.description).q(1.0), [0.1, 0.1])


@pytest.mark.parametrize(
    "controller",
    [
        ComputedTorque,
        *(pytest.param(law, marks=only_accepting) for law in (PDGravity, OperationalSpace)),
    ],
)
@pytest.mark.slow
def test_continuous_runs_go_on_after_a_rest(controller):
    step = Step(START, START + 0.1, time=1.5)
    run = ARM.simulate(controller.tuned(ARM), step, duration=2.5, rate=None, restitution=None)
    assert np.abs(run.final_error).max() < 1e-3


def test_a_run_that_is_lost_says_so_and_keeps_what_there_was():
    with pytest.raises(SimulationError, match="no longer finite after") as caught:
        ARM.simulate(
            ComputedTorque.tuned(ARM, bandwidth=100),
            START + 0.1,
            10.0,
            START,
            rate=3,
            restitution=None,
        )
    assert len(caught.value.result.t) >= 1


def test_an_arm_without_inertia_is_refused_by_everything_that_needs_one():
    arm = Arm.from_dh([(0, 0, 0.3, "pi/2"), (0, 0.126, 0, 0)], name="flange").with_uniform_links(
        [1, 1]
    )
    calls = [
        lambda: arm.simulate(q0=[0.1, 0.2], duration=0.1),
        lambda: arm.simulate(q0=[0.1, 0.2], duration=0.1, rate=None),
        lambda: arm.simulate_batch(q0=[[0.1, 0.2]], duration=0.1),
        lambda: OperationalSpace.tuned(arm),
        lambda: LQR(arm, [0.1, 0.2]),
        lambda: arm.linearize([0.1, 0.2]),
    ]
    for call in calls:
        with pytest.raises(Exception, match=r"joint 2 .*carries no inertia; give .* rotor inertia"):
            call()


class Pairless:
    def __init__(self, state=0.0, rates=(0.0,)):
        self.state, self.rates = state, rates

    def initial_state(self, q):
        return self.state

    def continuous(self, t, q, qd, setpoint, state):
        return self.rates if self.rates is None else (np.zeros(2), self.rates)

    def __call__(self, *arguments):
        return np.zeros(2)


class Resetting:
    def reset(self):
        raise OSError("no\nway")

    def __call__(self, *arguments):
        return np.zeros(2)


class Returning:
    duration = None

    def __init__(self, value):
        self.value = value

    def sampled(self, t):
        if isinstance(self.value, Exception):
            raise self.value
        return self.value


class Backwards(Returning):
    duration = -1.0


def run(**options):
    usual = {"controller": ComputedTorque.tuned(SMALL), "q0": [0.1, 0.2], "duration": 0.01}
    return SMALL.simulate(**usual | options)


def many(**options):
    return SMALL.simulate_batch(
        **{"controller": ComputedTorque.tuned(SMALL), "q0": np.zeros((3, 2)), "duration": 0.01}
        | options
    )


BAD = {
    "too many steps of the plant": (
        lambda: run(plant_rate=1e12),
        "makes 1.1e.10 steps; expected at most",
    ),
    "rates that are NaN": (
        lambda: run(controller=Pairless(rates=[np.nan]), rate=None),
        "derivatives that are not finite",
    ),
    "no pair": (
        lambda: run(controller=Pairless(rates=None), rate=None),
        "returned NoneType at 0 s",
    ),
    "a state that is a word": (
        lambda: run(controller=Pairless(state="abc"), rate=None),
        "initial_state",
    ),
    "a state that is NaN": (
        lambda: run(controller=Pairless(state=np.nan), rate=None),
        "initial_state",
    ),
    "a reset that fails": (
        lambda: run(controller=Resetting()),
        r"reset\(\) of the controller raised OSError: no way",
    ),
    "less than a period": (lambda: run(duration=1.0, rate=0.1), "less than half a period"),
    "a reference of no time": (
        lambda: run(reference=Backwards(0), duration=None),
        "reference's duration is -1",
    ),
    "weights that are nothing": (
        lambda: LQR(SMALL, [0, 0], Q=np.zeros(4)),
        "leave the arm unstable",
    ),
    "complex torques": (
        lambda: run(controller=lambda *a: np.zeros(2, complex)),
        "returned complex128",
    ),
    "torques in words": (lambda: run(controller=lambda *a: ["1", "2"]), "returned list"),
    "masked torques": (
        lambda: run(controller=lambda *a: np.ma.masked_array([1.0, 2.0], [0, 1])),
        "returned float64|masked",
    ),
    "nothing": (lambda: run(controller=lambda *a: None), "returned None at 0 s"),
    "a class": (lambda: run(controller=PID), "controller is the class PID"),
    "a number": (lambda: run(controller=3), "controller is int"),
    "saturation in words": (lambda: run(saturation="no"), "saturation is 'no'"),
    "a rate that is true": (lambda: run(rate=True), "rate is True"),
    "a link that is not a number": (lambda: Push([1, 0, 0], link=1.5), "link is 1.5"),
    "a link of another arm": (
        lambda: run(pushes=[Push([1, 0, 0], link=9, begin=5)]),
        "link is 9; planar2r has 2",
    ),
    "no push": (lambda: run(pushes=[(0, 0, 1)]), "pushes has tuple; expected Push"),
    "a controller of another arm": (
        lambda: run(controller=HOLD),
        "one of puma560, joints RRRRRR; expected RR",
    ),
    "one of another arm in a batch": (lambda: many(controller=HOLD), "one of puma560"),
    "friction compensated around one at a time": (
        lambda: many(controller=FrictionCompensation(OperationalSpace.tuned(SMALL))),
        "controls one arm at a time",
    ),
    "friction of a number": (
        lambda: FrictionCompensation(ComputedTorque.tuned(SMALL), friction=0.01),
        "friction is 0.01",
    ),
    "a batch with stiction": (lambda: many(friction=True), "a batch has no stiction"),
    "a batch in continuous time": (lambda: many(rate=None), "rate is None"),
    "a plant by name": (
        lambda: simulate(SMALL.description, plant="planar2r", q0=[0, 0], duration=1),
        "plant is str",
    ),
    "sensors that are a number": (lambda: run(sensors=3), "sensors is int"),
    "a reference of two arrays": (lambda: run(reference=Returning((1, 2))), "returned 2 arrays"),
    "a reference of nothing": (
        lambda: run(reference=Returning(None)),
        "the reference raised TypeError",
    ),
    "a reference that raises": (
        lambda: run(reference=Returning(OSError("far\naway"))),
        "raised OSError: far away",
    ),
    "a reference that is a class": (lambda: run(reference=Step), "reference is the class Step"),
    "a step of two lengths": (lambda: Step([0, 0], [0, 0, 0]), "do not fit together"),
    "gains of two batches": (
        lambda: PID(np.ones((3, 2)), np.ones((4, 2))),
        "gains are of batches of 3, 4",
    ),
    "gains of another arm": (lambda: run(controller=PID([1, 2, 3])), "kp has 3 gains; expected 2"),
    "a limit in words": (lambda: PID(1.0, limit="a"), "limit"),
    "many bandwidths, one wrong": (
        lambda: PID.tuned(SMALL, bandwidth=np.append(np.ones(1000), -1)),
        "for a batch",
    ),
    "a slice of a batch": (lambda: many(keep="all")[0:2], "expected the number of one run"),
}


@pytest.mark.parametrize("name", BAD)
def test_it_is_refused_in_one_line(name):
    call, message = BAD[name]
    with pytest.raises((ValueError, TypeError, SimulationError), match=message) as caught:
        call()
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 300


def test_friction_false_is_none_for_a_batch_too():
    assert many(friction=False).failed.sum() == 0
    assert Plant(SMALL.description, Friction(0.01)).friction is not None


def test_bandwidths_are_swept():
    w = np.array([10.0, 20.0, 40.0])
    for kind in (ComputedTorque, PDGravity, PID):
        batch = SMALL.simulate_batch(kind.tuned(SMALL, w), [0.2, 0.3], 0.1, [0.1, 0.2])
        for k, x in enumerate(w):
            alone = SMALL.simulate(
                kind.tuned(SMALL, x), [0.2, 0.3], 0.1, [0.1, 0.2], restitution=None
            )
            assert np.allclose(batch.q[k], alone.q[-1], atol=1e-10)


def test_a_first_state_beyond_its_stop_by_rounding_is_at_the_stop():
    upper = ARM.description.numbers.upper
    q = START.copy()
    q[1] = np.nextafter(upper[1], np.inf)
    assert ARM.simulate(HOLD, START, 0.002, q).q[0, 1] == upper[1]
