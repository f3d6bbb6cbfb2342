"""Base parameters and the regressor: as many as the numeric rank, and the same equations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

import dhkit
from acceptance import different_robots_first, sample_size, slow_if
from dhkit.description import from_dh, library_robot, with_uniform_links
from dhkit.model import pinocchio_model
from dhkit.symbolic.exact.base_parameters import base_parameters
from dhkit.symbolic.exact.lagrangian import lagrangian
from dhkit.symbolic.exact.regressor import regressor
from dhkit.symbolic.ring import RingError
from exact_checks import errors, states
from random_arms import arms, random_body


def in_general_position(description) -> bool:
    """Whether no length or cosine is so near to zero that a numeric rank cannot tell."""
    numbers = description.numbers
    sizes = np.abs(
        [
            numbers.a,
            numbers.d,
            numbers.cos_alpha,
            numbers.sin_alpha,
            numbers.cos_theta,
            numbers.sin_theta,
        ]
    )
    sizes = np.concatenate([sizes.ravel(), np.abs(numbers.T_world_base[:3].ravel())])
    return bool(np.all((sizes == 0) | (sizes > 1e-2)))


NOISE = 1e-9
"""Singular values and columns below this, of the largest, are roundings of 0: the smallest that count are 1e-4."""


@pytest.mark.slow
@pytest.mark.parametrize("name", different_robots_first(dhkit.robots()))
def test_as_many_as_the_regressors_rank(name):
    description = library_robot(name)
    base = base_parameters(description)
    assert sum(not parameter.startswith("Ia") for parameter in base.names) == numeric_rank(
        description
    )


def test_a_puma_has_36_of_60():
    base = base_parameters(library_robot("puma560"))
    assert sum(not parameter.startswith("Ia") for parameter in base.names) == 36
    assert numeric_rank(library_robot("puma560")) == 36


@pytest.mark.parametrize("name", different_robots_first(dhkit.robots()))
def test_equations_in_base_parameters_are_the_full_ones(name):
    assert base_parameters(library_robot(name)).prove()


@pytest.mark.parametrize(
    "name", ["planar3r", "stanford", "cobra600", "al5d", slow_if(True, "puma560")]
)
def test_base_parameters_agree_with_pinocchio(name):
    lag = base_parameters(library_robot(name)).lagrangian
    for error in errors(lag, 5, ("M", "C", "h", "g", "tau", "K")).values():
        assert error <= 1e-12


@pytest.mark.slow
@settings(max_examples=sample_size(20, quick=8))
@given(arms(least=1, most=3).filter(in_general_position))
def test_random_arms(description):
    base = base_parameters(description)
    assert base.prove()
    assert sum(not parameter.startswith("Ia") for parameter in base.names) == numeric_rank(
        description
    )


def test_a_wrong_definition_is_found():
    base = base_parameters(library_robot("planar2r"))
    definitions = dict(base.definitions)
    definitions["ZZ1"] = definitions["ZZ1"] * 2
    assert not type(base)(definitions, base.lagrangian, base.full).prove()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["planar2r", "stanford", "puma560"])
def test_torques_are_linear_in_the_parameters(name):
    for lag in (
        lagrangian(library_robot(name), "inertial"),
        base_parameters(library_robot(name)).lagrangian,
    ):
        found = regressor(lag)
        assert found.prove()
        q, qd, qdd = states(lag.description, 3)
        theta = np.array([lag.constants[parameter] for parameter in found.names])
        tau = lag.evaluate(found.Y, q, qd, qdd) @ theta
        assert tau == pytest.approx(lag.evaluate(lag.tau, q, qd, qdd), rel=1e-12, abs=1e-12)


def test_numbers_have_no_regressor():
    with pytest.raises(RingError, match="symbols='inertial'"):
        regressor(lagrangian(library_robot("puma560")))


def numeric_rank(description) -> int:
    """The rank of Pinocchio's regressors at many states, which leave armature out."""
    import pinocchio as pin

    model = pinocchio_model(description)
    data = model.createData()
    rows = [
        np.reshape(pin.computeJointTorqueRegressor(model, data, *state), (description.n, -1))
        for state in zip(*states(description, 60), strict=True)
    ]
    Y = np.concatenate(rows)
    size = np.linalg.norm(Y, axis=0)
    used = size > NOISE * size.max()
    return int(np.linalg.matrix_rank(Y[:, used] / size[used], tol=NOISE))


def test_names_that_the_file_has_are_left_to_it():
    description = from_dh([(0, 0, "M2", 0), (0, 0, "ZZ1", 0)], parameters={"M2": 0.3, "ZZ1": 0.2})
    base = base_parameters(with_uniform_links(description))
    assert base.names == ("ZZ1_", "ZZ2_", "MX2_", "MY2_")
    assert base.prove()
    assert max(errors(base.lagrangian, 5, ("M", "h", "g")).values()) <= 1e-12


@pytest.mark.parametrize(
    ("kinds", "twists"),
    [
        ("RP", (20, 0)),
        ("RPR", (30, 0, 0)),
        ("RPR", ("beta", 0, 0)),
        ("RRP", (0, 20, 0)),
        ("PRP", (20, 30, 0)),
    ],
)
def test_sliding_joints_behind_any_twist(kinds, twists):
    rows = [(0, 0.2, 0.3, twist) for twist in twists]
    bare = from_dh(rows, kinds=kinds, angle="deg", parameters={"beta": 0.3})
    rng = np.random.default_rng(0)
    arm = replace(
        bare, joints=tuple(replace(joint, bodies=(random_body(rng),)) for joint in bare.joints)
    )
    base = base_parameters(arm)
    assert base.prove()
    assert len(base) == numeric_rank(arm)
    assert max(errors(base.lagrangian, 5, ("M", "h", "g")).values()) <= 1e-12
