"""Lagrange's equations by differentiation, and the recursions beside them, agree with Pinocchio's dynamics."""

import casadi
import numpy as np
import pytest
from hypothesis import given, settings

from acceptance import different_robots_first
from dhkit.description import library_robot, robots
from dhkit.symbolic import (
    InertialTable,
    composite_coriolis_matrix,
    composite_mass_matrix,
    joint_symbols,
    kinetic_energy,
    lagrange_coriolis_matrix,
    lagrange_gravity_torque,
    lagrange_inverse_dynamics,
    lagrange_mass_matrix,
    lagrange_torque,
    potential_energy,
    recursive_bias,
    recursive_forward_dynamics,
    recursive_gravity,
    recursive_inverse_dynamics,
)
from dynamics_reference import ARMS, hold, motions, tilted_arms

LAGRANGE = {
    "M by Lagrange": (lagrange_mass_matrix, 1),
    "C by Lagrange": (lagrange_coriolis_matrix, 2),
    "g by Lagrange": (lagrange_gravity_torque, 1),
    "tau by Lagrange's matrices": (lagrange_inverse_dynamics, 3),
    "tau by Lagrange's equations": (lagrange_torque, 3),
    "K": (kinetic_energy, 2),
    "V": (potential_energy, 1),
}
RECURSIVE = {
    "M by composite bodies": (composite_mass_matrix, 1),
    "C by composite bodies": (composite_coriolis_matrix, 2),
    "g by recursion": (recursive_gravity, 1),
    "bias by recursion": (recursive_bias, 2),
    "tau by recursion": (recursive_inverse_dynamics, 3),
    "qdd by elimination": (recursive_forward_dynamics, 3),
}


def evaluated(arm, expressions, states):
    """Return each expression's values at N states, shapes (N, ...)."""
    table, n = InertialTable.of(arm), arm.n
    symbols = [joint_symbols(name, n) for name in ("q", "qd", "x")]
    outputs = [
        casadi.densify(function(table, *symbols[:count]))
        for function, count in expressions.values()
    ]
    function = casadi.Function("dynamics", symbols, outputs)
    rows = [function(*row) for row in zip(*states, strict=True)]
    shapes = {"M": (n, n), "C": (n, n), "K": (), "V": ()}
    return {
        name: np.array([np.array(row[k]).reshape(shapes.get(name[0], (n,))) for row in rows])
        for k, name in enumerate(expressions)
    }


@pytest.mark.parametrize("name", different_robots_first(robots()))
def test_library_robots(name, law):
    arm = library_robot(name)
    states = motions(arm, law.samples(1000))
    hold(law, arm, evaluated(arm, LAGRANGE | RECURSIVE, states), *states, "in CasADi")


@pytest.mark.slow
@settings(max_examples=ARMS)
@given(tilted_arms())
def test_any_arm(law, arm):
    law.samples(1000, quick=ARMS)
    states = motions(arm, 3)
    hold(law, arm, evaluated(arm, LAGRANGE | RECURSIVE, states), *states, "in CasADi")
