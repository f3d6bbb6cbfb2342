"""Drives that two joints turn: what they add to M, in every path, in files, and where an arm is changed."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings

from acceptance import sample_size
from dhkit import Arm, ComputedTorque
from dhkit.description import Coupling, from_toml, library_robot, lock, to_toml
from dhkit.dynamics import regressor
from dhkit.errors import DescriptionError
from dhkit.expressions import exact
from dhkit.model import urdf_text
from dhkit.symbolic import base_parameters, derive, lagrangian
from dhkit.symbolic.exact.regressor import regressor as exact_regressor
from dynamics_reference import tilted_arms
from exact_checks import errors

MANUTEC = library_robot("manutec_r3")


def test_the_equations_are_those_of_the_published_subroutine(law):
    """M of the Manutec r3 from the constants of R3M2SI (Otter & Tuerk 1988), summed over its bodies by hand.

    About their joints link 2 has (4.9544125, 6.7759085, 2.311496; xz -2.45219) kg m^2 and link 3
    (7.8704812, 8.1077564, 0.4372752; xz -0.0110568), with first moments (9.718, 11.5825) and (1.6884, 12.1806) kg m
    along x and z; x is the axis of joints 2 and 3, z the links' direction, and joint 3 is 0.5 m along z.
    """
    rng = np.random.default_rng(0)
    q = rng.uniform(-3, 3, (law.samples(100), 3))
    a, b = q[:, 1], q[:, 1] + q[:, 2]  # from the vertical
    s, c = np.sin, np.cos
    M = np.zeros((len(q), 3, 3))
    # Of joint 3's lever, about the vertical axis.
    reach = 0.25 * 60.3 * s(a) ** 2 + 2 * 0.5 * 12.1806 * s(a) * s(b)
    links = (
        6.7759085 * s(a) ** 2 + 2.311496 * c(a) ** 2 + 8.1077564 * s(b) ** 2 + 0.4372752 * c(b) ** 2
    )
    M[:, 0, 0] = 1.16 + 14.3325 + links + reach
    M[:, 0, 1] = -2.45219 * c(a) - (0.0110568 + 0) * c(b) - 0.5 * 1.6884 * c(a)
    M[:, 0, 2] = -0.0110568 * c(b)
    elbow = 0.5 * 12.1806 * c(q[:, 2])
    M[:, 1, 1] = 57.33 + 4.9544125 + 7.8704812 + 0.25 * 60.3 + 2 * elbow
    M[:, 1, 2] = 7.8704812 + 0.078 + elbow
    M[:, 2, 2] = 7.8704812 + 4.68
    M = M + np.swapaxes(np.triu(M, 1), 1, 2)
    ours = Arm(MANUTEC).mass_matrix(q)
    law.holds("M of the Manutec r3", np.abs(ours - M).max() / np.abs(M).max(), 1e-12)
    gravity = np.zeros((len(q), 3))
    gravity[:, 2] = -9.81 * 12.1806 * s(b)
    gravity[:, 1] = gravity[:, 2] - 9.81 * (11.5825 + 0.5 * 60.3) * s(a)
    law.holds(
        "g of the Manutec r3", np.abs(Arm(MANUTEC).gravity_torque(q) - gravity).max() / 600, 1e-12
    )


def test_it_is_the_energy_of_a_rotor_that_two_joints_turn():
    """A rotor J on link 1 with a gear of ratio G, its axis parallel to both joints: J (G qd2 + qd1)^2 / 2."""
    text = to_toml(library_robot("planar2r"))
    arm = from_toml(text.replace("[parameters]", "[parameters]\nJ = 0.002\nG = 50", 1))
    with_rotor = from_toml(
        to_toml(arm)
        .replace("rotor_inertia = 0", 'rotor_inertia = "J"')
        .replace("gear = 1", 'gear = "G"')
        + '[[coupling]]\njoints = [2, 1]\ninertia = "J*G"\n'
    )
    added = derive(with_rotor).K - derive_in(arm, with_rotor)
    J, G, a, b = sp.symbols("J G qd1 qd2")
    wanted = J * G**2 * a**2 / 2 + J * G**2 * b**2 / 2 + J * G * a * b
    assert sp.simplify(sp.sympify(str(added).replace("^", "**")) - wanted) == 0


def derive_in(arm, like):
    """Return the kinetic energy of an arm without rotors as an element of the other's ring."""
    textbook = derive(like)
    return textbook.K - textbook.rotors


@settings(max_examples=sample_size(25, quick=8))
@given(tilted_arms(least=2, most=3))
def test_exact_equations_of_any_arm_agree_with_pinocchio(law, description):
    law.samples(100)
    lag = lagrangian(description, "none")
    for quantity, error in errors(lag, 3).items():
        law.holds(f"exact {quantity}", error, 1e-12)
    assert np.array_equal(derive(description, symbols="none").M, lag.M)


def test_regressor_and_base_parameters_contain_it():
    assert "Jc23" in exact_regressor(lagrangian(MANUTEC, "inertial")).names
    assert exact_regressor(lagrangian(MANUTEC, "inertial")).prove()
    # Joints 2 and 3 are parallel: what both turn cannot be told from link 3 and its drive.
    base = base_parameters(MANUTEC)
    assert str(base.definitions["Ia3"]) == "-Jc23 + Jm3*G3^2"
    assert base.prove()
    skew = replace(MANUTEC, couplings=(Coupling((1, 3), exact(0.2)),))
    base = base_parameters(skew)
    assert str(base.definitions["Ic13"]) == "Jc13"
    assert base.prove()
    assert exact_regressor(base.lagrangian).prove()


def test_numeric_regressors_leave_it_to_the_drives():
    arm = Arm(MANUTEC)
    q, qd, qdd = np.random.default_rng(1).uniform(-1, 1, (3, 3))
    B = arm.description.numbers.drive_inertia
    assert np.array_equal(B, B.T)
    assert np.allclose(np.diag(B), [14.3325, 57.33, 4.68], rtol=1e-15)
    tau = (
        regressor(MANUTEC, q, qd, qdd) @ arm.description.numbers.inertial_parameters.ravel()
        + B @ qdd
    )
    assert np.allclose(tau, arm.inverse_dynamics(q, qd, qdd), rtol=1e-13)


def test_a_file_keeps_it_and_says_what_is_odd():
    assert from_toml(to_toml(MANUTEC)) == MANUTEC
    assert "[[coupling]]" in to_toml(MANUTEC)
    assert MANUTEC.couplings[0].joints == (2, 3)
    odd = from_toml(to_toml(MANUTEC).replace("0.078", "17"))
    assert any("rotors alone cannot have such a coupling" in warning for warning in odd.warnings)
    assert "joints 2 and 3 both turn: 0.078" in urdf_text(MANUTEC)


@pytest.mark.parametrize(("locked", "left"), [({0: 0.3}, [(1, 2)]), ({1: 0.3}, []), ({2: 0.3}, [])])
def test_locking_keeps_the_couplings_of_joints_that_move(locked, left, law):
    arm = lock(MANUTEC, locked)
    assert [coupling.joints for coupling in arm.couplings] == left
    moving = [i for i in range(3) if i not in locked]
    q = np.zeros(3)
    q[moving] = np.random.default_rng(2).uniform(-1, 1, 2)
    q[list(locked)] = list(locked.values())
    law.samples(1)
    M = Arm(MANUTEC).mass_matrix(q)[np.ix_(moving, moving)]
    law.holds(
        "M of the locked arm",
        np.abs(Arm(arm).mass_matrix(q[moving]) - M).max() / np.abs(M).max(),
        1e-13,
    )


@pytest.mark.slow
def test_motions_and_controllers_know_it():
    """The certificate, computed torque and the adaptive law use M with the coupling."""
    arm = Arm(MANUTEC)
    ends = [arm.description.numbers.configurations[name] for name in ("start", "goal")]
    motion = arm.plan(*ends)
    # Von Stryk & Schlemmer 1994: 0.49519 s.
    assert motion.duration == pytest.approx(0.4952, abs=2e-4)
    tau = arm.inverse_dynamics(
        *(getattr(motion, x)(motion.duration / 3) for x in ("q", "qd", "qdd"))
    )
    assert np.all(np.abs(tau) <= arm.description.numbers.effort * (1 + 1e-6))
    run = arm.simulate(ComputedTorque.tuned(arm), motion, saturation=False)
    assert np.abs(run.error).max() < 2e-3
    without = Arm(replace(MANUTEC, couplings=()))
    worse = arm.simulate(ComputedTorque.tuned(without), motion, saturation=False)
    assert np.abs(worse.error).max() > 1.01 * np.abs(run.error).max()


@pytest.mark.parametrize("inertia", [30.0, 500.0, -500.0])
def test_a_coupling_that_makes_the_mass_matrix_indefinite_is_refused(inertia):
    arm = Arm(replace(MANUTEC, couplings=(Coupling((2, 3), exact(inertia)),)))
    message = "not positive definite: the coupling of joints 2 and 3 is too large"
    with pytest.raises(DescriptionError, match=message):
        arm.plan("start", "goal")
    with pytest.raises(DescriptionError, match=message):
        arm.forward_dynamics(np.array([0.1, -0.8, 1.2]), np.zeros(3), np.ones(3))
