"""The regressor in numbers: linear, equal to the exact one and to Pinocchio's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given

from acceptance import slow_if
from dhkit.description import from_dh, library_robot
from dhkit.dynamics import inertial_parameters, inverse_dynamics, regressor
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


def test_batches_and_bad_input():
    arm = from_dh([(0, 0.1, 0.3, "pi/2"), (0, 0, 0.2, 0)], kinds="RP")
    assert regressor(arm, np.zeros((4, 1, 2)), np.ones((3, 2)), np.ones(2)).shape == (4, 3, 2, 20)
    assert regressor(arm, np.zeros((0, 2)), np.zeros(2), np.zeros(2)).shape == (0, 2, 20)
    Y = regressor(arm, [[0, 0], [np.nan, 0]], [0, 0], [0, 0])
    assert np.isfinite(Y[0]).all()
    assert np.isnan(Y[1]).any()
    with pytest.raises(ValueError, match=r"qd has shape \(3,\); expected \(..., 2\)"):
        regressor(arm, [0, 0], [0, 0, 0], [0, 0])
