"""Our dynamics agree with Pinocchio's, for every robot of the library and for any arm."""

import numpy as np
import pytest
from hypothesis import given, settings

from acceptance import different_robots_first
from dhkit.description import library_robot, robots
from dhkit.dynamics import (
    bias,
    coriolis_matrix,
    forward_dynamics,
    gravity_torque,
    inverse_dynamics,
    kinetic_energy,
    mass_matrix,
    potential_energy,
)
from dynamics_reference import ARMS, hold, motions, tilted_arms


def kernels(arm, q, qd, x):
    C, g = coriolis_matrix(arm, q, qd), gravity_torque(arm, q)
    return {
        "M": mass_matrix(arm, q),
        "C": C,
        "g": g,
        "h": np.einsum("kij,kj->ki", C, qd),
        "bias": bias(arm, q, qd),
        "tau": inverse_dynamics(arm, q, qd, x),
        "qdd": forward_dynamics(arm, q, qd, x),
        "K": kinetic_energy(arm, q, qd),
        "V": potential_energy(arm, q),
    }


@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize("name", different_robots_first(robots()))
def test_compiled_dynamics_agree_with_pinocchio(name, law):
    arm = library_robot(name)
    states = motions(arm, law.samples(1000))
    hold(law, arm, kernels(arm, *states), *states, "compiled")


@pytest.mark.usefixtures("interpreted")
@pytest.mark.parametrize("name", different_robots_first(robots()))
def test_interpreted_dynamics_agree_with_pinocchio(name, law):
    arm = library_robot(name)
    states = motions(arm, law.samples(1000), seed=1)
    hold(law, arm, kernels(arm, *states), *states, "interpreted")


@pytest.mark.usefixtures("interpreted")
@settings(max_examples=ARMS)
@given(tilted_arms())
def test_dynamics_of_any_arm_agree_with_pinocchio(law, arm):
    law.samples(1000, quick=ARMS)
    states = motions(arm, 4)
    hold(law, arm, kernels(arm, *states), *states, "interpreted")
