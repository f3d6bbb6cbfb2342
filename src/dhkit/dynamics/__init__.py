"""Dynamics of an arm: inverse and forward dynamics, their terms, energies and friction, on batches."""

from dhkit.dynamics.derivatives import (
    ForwardDynamicsDerivatives,
    InverseDynamicsDerivatives,
    forward_dynamics_derivatives,
    inverse_dynamics_derivatives,
)
from dhkit.dynamics.energy import kinetic_energy, potential_energy, power
from dhkit.dynamics.equations import (
    bias,
    coriolis_matrix,
    gravity_torque,
    inverse_dynamics,
    mass_matrix,
    mass_matrix_derivative,
)
from dhkit.dynamics.forward import forward_dynamics, require_inertia
from dhkit.dynamics.loads import friction_torque, wrench_torque
from dhkit.dynamics.programs import dynamic_kernels, dynamics_graph
from dhkit.dynamics.regressor import base_regressor, inertial_parameters, regressor
from dhkit.dynamics.velocity_regressor import (
    ParameterGrouping,
    parameter_grouping,
    velocity_regressor,
)
from dhkit.symbolic import Friction

__all__ = [
    "ForwardDynamicsDerivatives",
    "Friction",
    "InverseDynamicsDerivatives",
    "ParameterGrouping",
    "base_regressor",
    "bias",
    "coriolis_matrix",
    "dynamic_kernels",
    "dynamics_graph",
    "forward_dynamics",
    "forward_dynamics_derivatives",
    "friction_torque",
    "gravity_torque",
    "inertial_parameters",
    "inverse_dynamics",
    "inverse_dynamics_derivatives",
    "kinetic_energy",
    "mass_matrix",
    "mass_matrix_derivative",
    "parameter_grouping",
    "potential_energy",
    "power",
    "regressor",
    "require_inertia",
    "velocity_regressor",
    "wrench_torque",
]
