"""The simulated arm obeys mechanics: against Pinocchio, in energy, with friction and at its stops."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from dhkit.control import ComputedTorque, Plant, Push, simulate
from dhkit.description import library_robot
from dhkit.dynamics import Friction, forward_dynamics, kinetic_energy, potential_energy
from dhkit.expressions import ZERO
from dhkit.model import pinocchio_model

PUMA = library_robot("puma560")
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
            arm, lambda t, q, qd, s, tau=tau: tau, q0=q, qd0=qd, duration=0.1, plant=Plant(arm, restitution=None)
        )
        theirs, rates = pinocchio_run(arm, q, qd, tau, 1e-3, 100)
        scale = max(1.0, np.abs(rates).max())
        law.holds("joint values after 0.1 s", np.abs(run.q[-1] - theirs).max() / scale, 1e-10)
        law.holds("rates after 0.1 s", np.abs(run.qd[-1] - rates).max() / scale, 1e-10)


def test_the_method_is_of_order_four(law):
    fine = simulate(PUMA, q0=START, duration=0.1, rate=16_000, plant=Plant(PUMA, restitution=None)).q[-1]
    errors = [
        np.abs(
            simulate(PUMA, q0=START, duration=0.1, rate=rate, plant=Plant(PUMA, restitution=None)).q[-1] - fine
        ).max()
        for rate in (500, 1000)
    ]
    law.samples(1)
    law.holds("error at 2 ms over that at 1 ms, from 16", abs(errors[0] / errors[1] - 16), 2.0)


def test_a_passive_swing_keeps_its_energy(law):
    law.samples(1)
    run = simulate(PUMA, q0=START, duration=5.0, plant=Plant(PUMA, restitution=None))
    energy = kinetic_energy(PUMA, run.q, run.qd) + potential_energy(PUMA, run.q)
    largest = kinetic_energy(PUMA, run.q, run.qd).max()
    law.holds("drift over the largest kinetic energy", np.abs(energy - energy[0]).max() / largest, 1e-10)


def test_smooth_friction_takes_its_work(law):
    law.samples(1)
    run = simulate(PUMA, q0=START, duration=3.0, plant=Plant(PUMA, Friction(0.1), None))
    energy = kinetic_energy(PUMA, run.q, run.qd) + potential_energy(PUMA, run.q)
    law.holds("rise of energy, J", np.diff(energy).max(), 1e-9)
    law.holds("energy without account", abs(run.audit.remains) / run.audit.friction, SUDDEN)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["puma560", "puma560_cao"])
def test_dry_friction_brings_an_arm_to_rest_and_keeps_it_there(name, law):
    arm = library_robot(name)
    plant = Plant(arm, Friction())
    assert plant.dry.all()
    rng = np.random.default_rng(3)
    for _ in range(max(1, law.samples(20) // 5)):
        q = np.clip(rng.normal(size=arm.n) * 0.2, arm.numbers.lower, arm.numbers.upper)
        run = simulate(arm, q0=q, duration=8.0, rate=500, plant=plant)
        moves = np.flatnonzero((run.qd != 0).any(axis=1))
        assert len(moves) and moves[-1] < 3000, "it did not come to rest"
        assert np.all(run.q[moves[-1] + 1 :] == run.q[-1])
        law.holds("energy without account", run.audit.error, SUDDEN)


def test_a_joint_breaks_away_where_friction_cannot_hold_it():
    arm = replace(library_robot("puma560"), gravity=(ZERO,) * 3)
    plant = Plant(arm, Friction())
    for joint in range(6):
        for direction, bound in ((1, arm.numbers.coulomb[joint, 0]), (-1, arm.numbers.coulomb[joint, 1])):
            for share, moves in ((0.999, False), (1.001, True)):
                tau = np.zeros(6)
                tau[joint] = share * bound
                run = simulate(arm, lambda t, q, qd, s, tau=tau: tau, q0=np.zeros(6), duration=0.01, plant=plant)
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
    law.holds("share of the rate", abs(after / before + restitution), 2e-3)  # a step of gravity lies between
    law.holds("energy without account", run.audit.error, AUDIT)
    if restitution == 0:
        assert run.audit.impacts > 0
    if restitution == 1:
        law.holds("energy lost by a perfect rebound over the kinetic energy", run.audit.impacts, 1e-12)


def test_pushes_do_work(law):
    law.samples(1)
    push = Push([30.0, -10.0, 5.0], [1.0, 2.0, -3.0], begin=0.1003, end=0.3017)
    on_link = Push([0.0, 20.0, 0.0], link=2, point=[-0.2, 0.05, 0.0], begin=0.05, end=0.2)
    plant = Plant(PUMA, restitution=None, pushes=(push, on_link))
    run = simulate(PUMA, ComputedTorque.tuned(PUMA), reference=START, duration=0.5, plant=plant)
    assert run.audit.pushes > 0
    law.holds("energy without account", run.audit.error, AUDIT)
    qdd = forward_dynamics(PUMA, run.q[200], run.qd[200], run.tau[200], wrench=[30, -10, 5, 1, 2, -3])
    assert np.abs(run.qdd[200] - qdd).max() < 1e-9 * np.abs(qdd).max()


def test_the_audit_closes_under_control(law):
    law.samples(1)
    control = ComputedTorque.tuned(PUMA)
    for friction, rate, required in ((None, 1000, AUDIT), (Friction(), 1000, SUDDEN), (Friction(0.05), 4000, AUDIT)):
        plant = Plant(PUMA, friction)
        run = simulate(PUMA, control, reference=START, q0=np.zeros(6), duration=1.0, plant=plant, plant_rate=rate)
        law.holds("energy without account", run.audit.error, required)
