"""The simulated arm obeys mechanics: against Pinocchio, in energy, with friction and at its stops."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from acceptance import ACCEPTING, different_robots_first
from dhkit.control import PID, ComputedTorque, PDGravity, Plant, Push, Sine, simulate
from dhkit.description import library_robot, robots
from dhkit.dynamics import Friction, forward_dynamics, kinetic_energy, mass_matrix, potential_energy
from dhkit.expressions import ZERO
from dhkit.model import pinocchio_model

PUMA = library_robot("puma560")
ROBOTS = [name for name in robots() if all(joint.bodies for joint in library_robot(name).joints)]
START = np.array([0.1, 0.4, -0.6, 0.2, 0.5, -0.3])
AUDIT = 1e-9
"""Of the energy turned over, where torques are held and nothing is sudden."""
SUDDEN = 1e-7
"""The same with friction that is a step."""


def pinocchio_run(arm, q, qd, tau, step, steps):
    """Integrate by the same method over Pinocchio's forward dynamics."""
    model = pinocchio_model(arm)
    data = model.createData()

    def rate(q, qd):
        return pin.aba(model, data, q, qd, tau)

    for _ in range(steps):
        a1 = rate(q, qd)
        a2 = rate(q + step / 2 * qd, qd + step / 2 * a1)
        a3 = rate(q + step / 2 * (qd + step / 2 * a1), qd + step / 2 * a2)
        a4 = rate(q + step * (qd + step / 2 * a2), qd + step * a3)
        q, qd = (
            q + step * qd + step**2 / 6 * (a1 + a2 + a3),
            qd + step / 6 * (a1 + 2 * a2 + 2 * a3 + a4),
        )
    return q, qd


@pytest.mark.parametrize("name", ["puma560", "panda", "stanford", "cart_pendulum", "planar2r"])
def test_states_are_those_over_pinocchio(name, law):
    arm = library_robot(name)
    rng = np.random.default_rng(1)
    for _ in range(law.samples(20)):
        q, qd, tau = rng.normal(size=(3, arm.n)) * 0.3
        run = simulate(
            arm,
            lambda t, q, qd, s, tau=tau: tau,
            q0=q,
            qd0=qd,
            duration=0.1,
            plant=Plant(arm, restitution=None),
        )
        theirs, rates = pinocchio_run(arm, q, qd, tau, 1e-3, 100)
        scale = max(1.0, np.abs(rates).max())
        law.holds("joint values after 0.1 s", np.abs(run.q[-1] - theirs).max() / scale, 1e-10)
        law.holds("rates after 0.1 s", np.abs(run.qd[-1] - rates).max() / scale, 1e-10)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.slow
def test_accelerations_along_a_motion_are_pinocchios(name, law):
    arm = library_robot(name)
    model = pinocchio_model(arm)
    data = model.createData()
    law.samples(1)
    rng = np.random.default_rng(4)
    wave = Sine(rng.normal(size=arm.n) * 0.2, np.full(arm.n, 0.1), 1.5)
    run = simulate(
        arm,
        ComputedTorque.tuned(arm),
        wave,
        0.1,
        plant=Plant(arm, restitution=None),
        saturation=False,
    )
    M = mass_matrix(arm, run.q)
    if arm.couplings:  # which Pinocchio does not know
        bias = np.stack(
            [pin.nonLinearEffects(model, data, *row) for row in zip(run.q, run.qd, strict=True)]
        )
        crba = np.stack([np.triu(pin.crba(model, data, q)) for q in run.q])
        theirs_M = crba + np.swapaxes(np.triu(crba, 1), 1, 2) + arm.numbers.coupling
        theirs = np.linalg.solve(theirs_M, (run.tau - bias)[..., None])[..., 0]
    else:
        theirs = np.stack(
            [pin.aba(model, data, *row) for row in zip(run.q, run.qd, run.tau, strict=True)]
        )
    scale = np.abs(run.tau).max(axis=1) / np.diagonal(M, axis1=1, axis2=2).min(axis=1)
    allowed = np.maximum(1e-12, 4 * np.finfo(float).eps * np.linalg.cond(M))
    law.holds(
        "accelerations over what is allowed",
        (np.abs(run.qdd - theirs).max(axis=1) / scale / allowed).max(),
        1.0,
    )


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.slow
def test_runge_and_kutta_are_of_order_four(name, law):
    arm = library_robot(name)
    plant = Plant(arm, restitution=None)
    seen = 0
    for seed in range(law.samples(20)):
        q, qd = np.random.default_rng(seed).normal(size=(2, arm.n)) * 0.3
        runs = [
            simulate(arm, q0=q, qd0=qd, duration=0.1, plant=plant, **options)
            for options in ({"rate": None, "tolerance": 1e-13}, {"rate": 500}, {"rate": 1000})
        ]
        exact, slow, fast = (np.concatenate([run.q[-1], run.qd[-1]]) for run in runs)
        error = np.linalg.norm(slow - exact)
        if error > 1e-11:
            seen += 1
            law.holds(
                "error at 2 ms over that at 1 ms, from 16",
                abs(error / np.linalg.norm(fast - exact) - 16),
                2.0,
            )
    assert seen or name in ("cobra600", "kuka_kr30_3", "manutec_r3", "puma560_akb"), (
        "no error was large enough to be measured"
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", different_robots_first(ROBOTS))
def test_a_passive_swing_keeps_its_energy(name, law):
    arm = library_robot(name)
    law.samples(1)
    q = np.random.default_rng(1).normal(size=arm.n) * 0.3
    run = simulate(arm, q0=q, duration=5.0, rate=None, plant=Plant(arm, restitution=None))
    kinetic = kinetic_energy(arm, run.q, run.qd)
    energy = kinetic + potential_energy(arm, run.q)
    law.holds(
        "drift over the largest kinetic energy",
        np.abs(energy - energy[0]).max() / kinetic.max(),
        1e-10,
    )
    law.holds("energy without account", run.audit.error, AUDIT)


def test_a_passive_swing_of_a_puma_keeps_its_energy_in_steps_of_a_millisecond(law):
    law.samples(1)
    run = simulate(PUMA, q0=START, duration=5.0, plant=Plant(PUMA, restitution=None))
    kinetic = kinetic_energy(PUMA, run.q, run.qd)
    energy = kinetic + potential_energy(PUMA, run.q)
    law.holds(
        "drift over the largest kinetic energy",
        np.abs(energy - energy[0]).max() / kinetic.max(),
        1e-10,
    )


def test_smooth_friction_takes_its_work(law):
    law.samples(1)
    run = simulate(PUMA, q0=START, duration=3.0, plant=Plant(PUMA, Friction(0.1), None))
    energy = kinetic_energy(PUMA, run.q, run.qd) + potential_energy(PUMA, run.q)
    law.holds("rise of energy, J", np.diff(energy).max(), 1e-9)
    law.holds("energy without account", abs(run.audit.remains) / run.audit.friction, SUDDEN)


@pytest.mark.slow
def test_narrow_friction_takes_shorter_steps_and_ends_no_run_in_a_limit_cycle(law):
    law.samples(1)
    plant = Plant(PUMA, Friction(1e-3), None)
    assert plant.stiffness > 1000
    run = simulate(PUMA, q0=START, duration=1.5, rate=500, plant=plant)
    law.holds("energy without account", run.audit.error, AUDIT)
    # At the end every joint creeps: none goes back and forth.
    assert np.abs(np.diff(np.sign(run.qd[-50:]), axis=0)).max() == 0
    with pytest.raises(
        ValueError, match=r"friction is too stiff: its rate of .* 1/s takes .* steps in 0.001 s"
    ):
        simulate(PUMA, q0=START, duration=0.1, plant=Plant(PUMA, Friction(1e-8), None))
    with pytest.raises(ValueError, match="friction is too stiff"):
        simulate(PUMA, q0=START, duration=10.0, rate=None, plant=Plant(PUMA, Friction(1e-8), None))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["puma560", "puma560_cao"])
def test_dry_friction_brings_an_arm_to_rest_and_keeps_it_there(name, law):
    arm = library_robot(name)
    plant = Plant(arm, Friction())
    assert plant.has_stiction.all()
    rng = np.random.default_rng(3)
    law.samples(4)
    for _ in range(4 if ACCEPTING else 1):
        q = np.clip(rng.normal(size=arm.n) * 0.2, arm.numbers.lower, arm.numbers.upper)
        run = simulate(arm, q0=q, duration=16.0, rate=250, plant=plant, plant_rate=500)
        moves = np.flatnonzero((run.qd != 0).any(axis=1))
        assert len(moves) and run.t[moves[-1]] < 6, "it did not come to rest"
        # Then it stays for the 10 s that are left.
        assert np.all(run.q[moves[-1] + 1 :] == run.q[-1])
        law.holds("energy without account", run.audit.error, SUDDEN)


def test_a_joint_breaks_away_where_friction_cannot_hold_it():
    arm = replace(library_robot("puma560"), gravity=(ZERO,) * 3)
    plant = Plant(arm, Friction())
    for joint in range(6):
        for direction, bound in (
            (1, arm.numbers.coulomb[joint, 0]),
            (-1, arm.numbers.coulomb[joint, 1]),
        ):
            for share, moves in ((0.999, False), (1.001, True)):
                tau = np.zeros(6)
                tau[joint] = share * bound
                run = simulate(
                    arm,
                    lambda t, q, qd, s, tau=tau: tau,
                    q0=np.zeros(6),
                    duration=0.01,
                    plant=plant,
                )
                assert (direction * run.qd[-1, joint] > 0) == moves, (joint, direction, share)


def test_a_joint_that_turns_loads_the_others():
    """Gravity turns the shoulder, which holds joint 1 although its torque is above what its friction bears alone."""
    arm = library_robot("puma560")
    tau = np.zeros(6)
    tau[0] = 1.001 * arm.numbers.coulomb[0, 0]
    contact = Plant(arm, Friction()).contact(np.zeros(6), np.zeros(6), tau)
    assert contact.directions[1] == -1
    assert contact.holds[0]


@pytest.mark.parametrize("restitution", [0.0, 0.3, 0.8, 1.0])
def test_a_stop_leaves_the_share_of_the_rate_that_it_should(restitution, law):
    arm = PUMA
    law.samples(1)
    plant = Plant(arm, restitution=restitution)
    q = np.zeros(6)
    q[2] = arm.numbers.upper[2] - 0.01
    qd = np.zeros(6)
    qd[2] = 2.0
    run = simulate(arm, q0=q, qd0=qd, duration=0.02, rate=20_000, plant=plant)
    beyond = np.maximum(run.q - arm.numbers.upper, arm.numbers.lower - run.q).max()
    law.holds("penetration, rad", beyond, 1e-9)
    impact = int(np.argmax(run.qd[:, 2] <= 0))
    before, after = run.qd[impact - 1, 2], run.qd[impact, 2]
    # A step of gravity lies between.
    law.holds("share of the rate", abs(after / before + restitution), 2e-3)
    law.holds("energy without account", run.audit.error, AUDIT)
    if restitution == 0:
        assert run.audit.impacts > 0
    if restitution == 1:
        law.holds(
            "energy lost by a perfect rebound over the kinetic energy", run.audit.impacts, 1e-12
        )


@pytest.mark.parametrize("rate", [1000.0, None])
@pytest.mark.slow
def test_at_rest_against_a_stop_an_arm_stays(rate):
    """Gravity lets the arm fall on its stops, where it stays, whatever it is pushed with against them."""
    push = Push([0.0, 0.0, -30.0], begin=1.2)
    run = simulate(
        PUMA, q0=START, duration=1.5, rate=rate, plant=Plant(PUMA, Friction(), 0.0, (push,))
    )
    at_stop = (run.q[-1] == PUMA.numbers.lower) | (run.q[-1] == PUMA.numbers.upper)
    assert at_stop.any()
    late = run.t > 1.0
    assert np.all(run.qd[late][:, at_stop] == 0) and np.all(
        run.q[late][:, at_stop] == run.q[-1][at_stop]
    )


@pytest.mark.slow
def test_joints_that_throw_each_other_against_their_stops_come_to_rest(law):
    """Two joints of al5d meet their stops together: each impact lifts the other off by some nrad/s."""
    law.samples(1)
    arm = library_robot("al5d")
    q = np.random.default_rng(1).normal(size=4) * 0.3
    for rate in (1000.0, None):
        run = simulate(arm, q0=q, duration=2.0, rate=rate, plant=Plant(arm))
        law.holds("energy without account", run.audit.error, SUDDEN)
        assert run.audit.impacts > 0


def test_a_joint_that_leaves_its_stop_and_is_back_within_the_step_comes_to_rest():
    """After 1e-12 s the joint has not moved by a unit of rounding."""
    arm = library_robot("ax12_arm")
    q, qd, tau = np.zeros((3, arm.n))
    q[-1], qd[-1], tau[-1] = arm.numbers.lower[-1], 1.2e-4, -arm.numbers.effort[-1]
    run = simulate(
        arm,
        lambda *_: tau,
        q0=q,
        qd0=qd,
        rate=1e6,
        duration=5e-6,
        plant=Plant(arm, restitution=0.0),
    )
    assert np.all(run.qd[1:, -1] == 0) and np.all(run.q[:, -1] == q[-1])


FASTEST = ("ax12_arm", "pan_tilt")


@pytest.mark.slow
def test_any_run_accounts_for_its_energy(law):
    """Robots, states, friction, stops, pushes and controllers at random.

    The fastest joints, those of ax12_arm and pan_tilt, cross the width of the narrowest friction in some 0.01 ms, which
    the plant's steps must resolve. An ax12_arm has 7.6e-8, 4.6e-9 and 2.5e-10 of the work without account at 40, 80 and
    160 kHz: the method's order is 4.
    """
    rng = np.random.default_rng(17)
    for trial in range(law.samples(250)):
        arm = library_robot(str(rng.choice(ROBOTS)))
        lower, upper = (np.clip(x, -np.pi, np.pi) for x in (arm.numbers.lower, arm.numbers.upper))
        friction = (None, Friction(), Friction(0.1), Friction(0.01))[rng.integers(4)]
        restitution = (None, 0.0, 0.4, 1.0)[rng.integers(4)]
        push = Push(
            rng.normal(size=3) * 10,
            rng.normal(size=3),
            begin=0.05 * rng.random(),
            end=0.1 + 0.1 * rng.random(),
        )
        pushes = (push,) if rng.random() < 0.4 else ()
        controller = (None, ComputedTorque.tuned(arm), PID.tuned(arm), PDGravity.tuned(arm))[
            rng.integers(4)
        ]
        run = simulate(
            arm,
            controller,
            rng.uniform(lower, upper),
            duration=0.3,
            q0=rng.uniform(lower, upper),
            qd0=rng.normal(size=arm.n) * rng.choice([0.0, 0.1, 2.0]),
            rate=None if rng.random() < 0.2 else 1000.0,
            plant_rate=10_000.0
            if friction != Friction(0.01)
            else 160_000.0
            if arm.name in FASTEST
            else 80_000.0,
            plant=Plant(arm, friction, restitution, pushes),
        )
        sudden = friction is not None and friction.width == 0
        where = f"trial {trial}: {arm.name}, {friction}, restitution {restitution}"
        law.holds(
            f"energy without account, stiction {sudden}",
            run.audit.error,
            SUDDEN if sudden else AUDIT,
            where,
        )
        if restitution is not None:
            beyond = np.maximum(run.q - arm.numbers.upper, arm.numbers.lower - run.q).max()
            law.holds("penetration, rad or m", beyond, 1e-9, where)


def test_pushes_do_work(law):
    law.samples(1)
    push = Push([30.0, -10.0, 5.0], [1.0, 2.0, -3.0], begin=0.1003, end=0.3017)
    on_link = Push([0.0, 20.0, 0.0], link=2, point=[-0.2, 0.05, 0.0], begin=0.05, end=0.2)
    plant = Plant(PUMA, restitution=None, pushes=(push, on_link))
    run = simulate(PUMA, ComputedTorque.tuned(PUMA), reference=START, duration=0.5, plant=plant)
    assert run.audit.pushes > 0
    law.holds("energy without account", run.audit.error, AUDIT)
    qdd = forward_dynamics(
        PUMA, run.q[200], run.qd[200], run.tau[200], wrench=[30, -10, 5, 1, 2, -3]
    )
    assert np.abs(run.qdd[200] - qdd).max() < 1e-9 * np.abs(qdd).max()


@pytest.mark.slow
def test_the_audit_closes_under_control(law):
    law.samples(1)
    control = ComputedTorque.tuned(PUMA)
    for friction, rate, required in (
        (None, 1000, AUDIT),
        (Friction(), 1000, SUDDEN),
        (Friction(0.05), 4000, AUDIT),
    ):
        plant = Plant(PUMA, friction)
        run = simulate(
            PUMA,
            control,
            reference=START,
            q0=np.zeros(6),
            duration=1.0,
            plant=plant,
            plant_rate=rate,
        )
        law.holds("energy without account", run.audit.error, required)


@pytest.mark.slow
def test_continuous_and_sampled_runs_meet(law):
    """Without torques both integrate the same motion, through stiction, stops and pushes."""
    law.samples(1)
    push = Push([0.0, 40.0, 10.0], begin=0.1503, end=0.2517)
    cases = {
        "stiction": (Plant(PUMA, Friction(), None), START, 1.5 if ACCEPTING else 0.5),
        "stops": (Plant(PUMA, restitution=0.5), START, 0.4),
        "a push and stiction": (Plant(PUMA, Friction(), 0.0, (push,)), np.zeros(6), 0.5),
    }
    for name, (plant, q, duration) in cases.items():
        continuous = simulate(PUMA, q0=q, duration=duration, rate=None, plant=plant)
        sampled = simulate(PUMA, q0=q, duration=duration, plant_rate=4000, plant=plant)
        law.holds(f"{name}: joint values", np.abs(continuous.q - sampled.q).max(), 1e-8)
        law.holds(f"{name}: energy without account, continuous", continuous.audit.error, AUDIT)
        law.holds(f"{name}: energy without account, sampled", sampled.audit.error, SUDDEN)
        beyond = np.maximum(
            continuous.q - PUMA.numbers.upper, PUMA.numbers.lower - continuous.q
        ).max()
        if plant.restitution is not None:
            law.holds(f"{name}: penetration, rad", beyond, 1e-9)
