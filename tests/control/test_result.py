"""Norms of a simulation's errors: of the joints, and of the tool against a second computation of the angle."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dhkit.description import library_robot
from simulation_results import swinging

ROUNDING = 1e-12
SMALL = 1e-9  # rad: an error of which the cosine alone would keep no digit


@pytest.mark.parametrize("name", ["planar2r", "puma560", "stanford"])
def test_norms_are_those_of_the_errors(name):
    result = swinging(library_robot(name))
    errors = result.reference_q - result.q
    assert np.array_equal(result.peak_error, np.abs(errors).max(axis=0))
    assert np.allclose(
        result.rms_error, np.linalg.norm(errors, axis=0) / np.sqrt(len(errors)), rtol=ROUNDING
    )
    assert np.array_equal(result.final_error, errors[-1])
    for norms, error in (
        (result.tool_norms, result.tool_error),
        (result.tool_rotation_norms, result.tool_rotation_error),
    ):
        assert error.shape == result.t.shape
        assert norms.peak == error.max()
        assert norms.rms == pytest.approx(np.linalg.norm(error) / np.sqrt(len(error)), rel=ROUNDING)
        assert norms.final == error[-1]


@pytest.mark.parametrize("name", ["puma560", "panda"])
def test_the_tools_angle_is_scipys(name):
    result = swinging(library_robot(name), error=0.5)
    between = Rotation.from_matrix(result.T[:, :3, :3]).inv() * Rotation.from_matrix(
        result.reference_T[:, :3, :3]
    )
    assert np.abs(result.tool_rotation_error - between.magnitude()).max() < 1e-8
    assert result.tool_rotation_error.max() > 0.1


def test_a_small_angle_keeps_its_digits():
    arm = library_robot("planar2r")
    result = swinging(arm)
    turned = replace(result, q=result.reference_q + np.array([SMALL, 0.0]))
    assert turned.tool_rotation_error == pytest.approx(np.full(len(result.t), SMALL), rel=1e-6)


def test_a_perfect_run_has_no_error():
    result = swinging(library_robot("puma560"), error=0.0)
    assert result.tool_norms == (0.0, 0.0, 0.0)
    assert result.tool_rotation_norms == (0.0, 0.0, 0.0)
