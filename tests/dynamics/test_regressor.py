"""The regressor in numbers: linear, equal to the exact one and to Pinocchio's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given

from acceptance import slow_if
from dhkit import Arm
from dhkit.description import from_dh, library_robot
from dhkit.dynamics import inertial_parameters, inverse_dynamics, parameter_grouping, regressor
from dhkit.errors import DescriptionError
from dhkit.model import pinocchio_model
from dhkit.symbolic import lagrangian
from dhkit.symbolic.exact.regressor import regressor as exact_regressor
from dhkit.verification.measure import relative_error
from dhkit.verification.reference import PinocchioResults
from dhkit.verification.states import random_motions
from random_arms import arms


@pytest.mark.slow
@given(arms(least=1, most=7))
def test_torques_are_linear_in_the_parameters(law, description):
    motion = random_motions(description, law.samples(100))
    Y = regressor(description, *motion)
    tau = Y @ inertial_parameters(description) + description.numbers.armature * motion.qdd
    size = np.einsum("nij,j->ni", np.abs(Y), np.abs(inertial_parameters(description))).max()
    assert np.abs(tau - inverse_dynamics(description, *motion)).max() <= 1e-12 * size
    reference = PinocchioResults(pinocchio_model(description), motion).regressor()
    falling = float(np.linalg.norm(description.numbers.gravity))
    law.holds(
        "regressor against Pinocchio's", float(relative_error(Y, reference, falling).max()), 1e-12
    )


@pytest.mark.parametrize(
    "name", ["planar2r", "cart_pendulum", "stanford", slow_if(True, "puma560_akb")]
)
def test_the_exact_regressor_is_the_numeric_one(name):
    description = library_robot(name)
    found = exact_regressor(lagrangian(description, "inertial"))
    motion = random_motions(description, 5)
    links = [k for k, parameter in enumerate(found.names) if not parameter.startswith("Jm")]
    ours = found.lagrangian.evaluate(found.Y, *motion)[..., links]
    assert relative_error(ours, regressor(description, *motion)).max() < 1e-12


ROBOTS = [
    "planar2r",
    "cart_pendulum",  # prismatic, then revolute
    "polar_rp",
    "stanford",  # prismatic third joint
    "cobra600",  # prismatic third joint, parallel axes
    "puma560",
    "puma560_akb",  # modified convention
    "al5d",
    "manutec_r3",  # a drive that two joints turn
]
RELATIVE_TOLERANCE = 1e-12
"""Some thousand roundings, relative to the largest torque of a robot's motions."""


def largest(torques):
    return np.abs(torques).max()


@pytest.mark.parametrize("name", ROBOTS)
def test_regressor_times_parameters_is_inverse_dynamics(name):
    arm = Arm.load(name)
    motion = random_motions(arm.description, 200)
    tau = arm.inverse_dynamics(*motion)
    drives = motion.qdd @ arm.description.numbers.drive_inertia

    ours = arm.regressor(*motion) @ inertial_parameters(arm) + drives
    assert largest(ours - tau) <= RELATIVE_TOLERANCE * largest(tau)

    base = arm.base_parameters()
    in_base = arm.regressor(*motion, base=True) @ base.values()
    assert largest(in_base - tau) <= RELATIVE_TOLERANCE * largest(tau)


@pytest.mark.parametrize("name", ROBOTS)
def test_regressor_is_that_of_pinocchio(name):
    """Pinocchio's parameters of a link: m, m c, then Ixx, Ixy, Iyy, Ixz, Iyz, Izz about its joint frame's origin."""
    import pinocchio as pin

    arm = Arm.load(name)
    motion = random_motions(arm.description, 50)
    data = arm.model.createData()
    parameters = np.concatenate([link.toDynamicParameters() for link in arm.model.inertias[1:]])
    theirs = [
        pin.computeJointTorqueRegressor(arm.model, data, *state).copy() @ parameters
        for state in zip(*motion, strict=True)
    ]
    torques = arm.regressor(*motion) @ inertial_parameters(arm)
    assert largest(torques - theirs) <= RELATIVE_TOLERANCE * largest(theirs)

    # The same columns, after Pinocchio's parameters are expressed by those of the DH frames.
    Y = arm.regressor(*motion)
    reference = PinocchioResults(arm.model, motion).regressor()
    assert largest(Y - reference) <= RELATIVE_TOLERANCE * largest(reference)


@pytest.mark.parametrize("name", ROBOTS)
def test_columns_of_base_parameters_are_independent(name):
    arm = Arm.load(name)
    base = arm.base_parameters()
    columns = arm.regressor(*random_motions(arm.description, 100), base=True).reshape(-1, len(base))
    assert np.linalg.matrix_rank(columns) == len(base)
    # Without drives, the number is that of the numeric grouping.
    without = [parameter for parameter in base.names if not parameter.startswith(("Ia", "Ic"))]
    assert len(without) == len(parameter_grouping(arm))


@pytest.mark.parametrize("name", ROBOTS)
def test_base_regressor_is_that_of_the_exact_equations(name):
    """The compiled columns come from the numeric regressor, these from the proved equations of motion."""
    arm = Arm.load(name)
    motion = random_motions(arm.description, 50)
    exact = arm.base_parameters().regressor(*motion)
    compiled = arm.regressor(*motion, base=True)
    assert largest(compiled - exact) <= RELATIVE_TOLERANCE * largest(exact)

    out = np.empty_like(compiled)
    assert arm.regressor(*motion, base=True, out=out, threads=2) is out
    assert largest(out - compiled) <= RELATIVE_TOLERANCE * largest(exact)


def test_base_regressor_says_what_is_missing():
    arm = Arm(from_dh([(0, 0.1, 0.3, "pi/2"), (0, 0, 0.2, 0)], kinds="RP"))
    with pytest.raises(DescriptionError, match="bod"):
        arm.regressor([0, 0], [0, 0], [0, 0], base=True)


def test_base_regressor_takes_batches_and_refuses_bad_input():
    base = Arm.load("cart_pendulum").base_parameters()
    assert base.regressor(np.zeros((4, 1, 2)), np.ones((3, 2)), np.ones(2)).shape == (4, 3, 2, 4)
    Y = base.regressor([[0, 0], [np.nan, 0], [0, np.inf]], [0, 0], [0, 0])
    assert np.isfinite(Y[0]).all()
    assert np.isnan(Y[1:]).all()
    with pytest.raises(ValueError, match=r"qd has shape \(3,\); expected \(..., 2\)"):
        base.regressor([0, 0], [0, 0, 0], [0, 0])


def test_batches_and_bad_input():
    arm = from_dh([(0, 0.1, 0.3, "pi/2"), (0, 0, 0.2, 0)], kinds="RP")
    assert regressor(arm, np.zeros((4, 1, 2)), np.ones((3, 2)), np.ones(2)).shape == (4, 3, 2, 20)
    assert regressor(arm, np.zeros((0, 2)), np.zeros(2), np.zeros(2)).shape == (0, 2, 20)
    Y = regressor(arm, [[0, 0], [np.nan, 0]], [0, 0], [0, 0])
    assert np.isfinite(Y[0]).all()
    assert np.isnan(Y[1]).any()
    with pytest.raises(ValueError, match=r"qd has shape \(3,\); expected \(..., 2\)"):
        regressor(arm, [0, 0], [0, 0, 0], [0, 0])
