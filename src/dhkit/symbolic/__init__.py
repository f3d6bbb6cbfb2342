"""An arm's mechanics as expressions: CasADi frames and Jacobians, straight-line programs, and their source text."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dhkit.formats import register_formats
from dhkit.lazy import lazy_names

if TYPE_CHECKING:
    from dhkit.symbolic.differentiable.casadi_functions import CasadiFunctions
    from dhkit.symbolic.differentiable.composite_bodies import composite_coriolis_matrix, composite_mass_matrix
    from dhkit.symbolic.differentiable.energies import (
        kinetic_energy,
        lagrange_coriolis_matrix,
        lagrange_gravity_torque,
        lagrange_inverse_dynamics,
        lagrange_mass_matrix,
        lagrange_torque,
        potential_energy,
    )
    from dhkit.symbolic.differentiable.forward_dynamics import (
        SINGULAR,
        recursive_forward_dynamics,
        solve_for_acceleration,
    )
    from dhkit.symbolic.differentiable.frames import (
        ReferenceAxes,
        SymbolicTable,
        jacobian,
        jacobian_dot,
        joint_symbols,
        table_pattern,
    )
    from dhkit.symbolic.differentiable.friction import Friction, friction_torque, smooth_direction
    from dhkit.symbolic.differentiable.inertial_table import InertialTable, inertial_pattern
    from dhkit.symbolic.differentiable.moments import Moments
    from dhkit.symbolic.differentiable.recursive import recursive_bias, recursive_gravity, recursive_inverse_dynamics
    from dhkit.symbolic.differentiable.velocity_regressor import velocity_regressor
    from dhkit.symbolic.exact.base_parameters import BaseParameters, base_parameters
    from dhkit.symbolic.exact.exact_arm import ExactArm, exact_arm
    from dhkit.symbolic.exact.lagrangian import Lagrangian, Proof, lagrangian
    from dhkit.symbolic.exact.naming import Symbols
    from dhkit.symbolic.exact.regressor import Regressor
    from dhkit.symbolic.kinematics import SymbolicKinematics, SymbolicMatrix, symbolic_kinematics
    from dhkit.symbolic.mistakes import MISTAKES, MadeAt, Mistake, Subject
    from dhkit.symbolic.programs.graph import Graph, Node, Variable, operation_count
    from dhkit.symbolic.programs.printers import c_source, export_c
    from dhkit.symbolic.ring.elements import Element, Elements, RingError
    from dhkit.symbolic.textbook import TextbookDerivation, derive

__all__ = [
    "MISTAKES",
    "SINGULAR",
    "BaseParameters",
    "CasadiFunctions",
    "Element",
    "Elements",
    "ExactArm",
    "Friction",
    "Graph",
    "InertialTable",
    "Lagrangian",
    "MadeAt",
    "Mistake",
    "Moments",
    "Node",
    "Proof",
    "ReferenceAxes",
    "Regressor",
    "RingError",
    "Subject",
    "SymbolicKinematics",
    "SymbolicMatrix",
    "SymbolicTable",
    "Symbols",
    "TextbookDerivation",
    "Variable",
    "base_parameters",
    "c_source",
    "composite_coriolis_matrix",
    "composite_mass_matrix",
    "derive",
    "exact_arm",
    "export_c",
    "friction_torque",
    "inertial_pattern",
    "jacobian",
    "jacobian_dot",
    "joint_symbols",
    "kinetic_energy",
    "lagrange_coriolis_matrix",
    "lagrange_gravity_torque",
    "lagrange_inverse_dynamics",
    "lagrange_mass_matrix",
    "lagrange_torque",
    "lagrangian",
    "operation_count",
    "potential_energy",
    "recursive_bias",
    "recursive_forward_dynamics",
    "recursive_gravity",
    "recursive_inverse_dynamics",
    "smooth_direction",
    "solve_for_acceleration",
    "symbolic_kinematics",
    "table_pattern",
    "velocity_regressor",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "dhkit.symbolic.differentiable.moments": ("Moments",),
        "dhkit.symbolic.differentiable.casadi_functions": ("CasadiFunctions",),
        "dhkit.symbolic.differentiable.composite_bodies": ("composite_coriolis_matrix", "composite_mass_matrix"),
        "dhkit.symbolic.differentiable.energies": (
            "kinetic_energy",
            "lagrange_coriolis_matrix",
            "lagrange_gravity_torque",
            "lagrange_inverse_dynamics",
            "lagrange_mass_matrix",
            "lagrange_torque",
            "potential_energy",
        ),
        "dhkit.symbolic.differentiable.forward_dynamics": (
            "SINGULAR",
            "recursive_forward_dynamics",
            "solve_for_acceleration",
        ),
        "dhkit.symbolic.differentiable.frames": (
            "ReferenceAxes",
            "SymbolicTable",
            "jacobian",
            "jacobian_dot",
            "joint_symbols",
            "table_pattern",
        ),
        "dhkit.symbolic.differentiable.friction": ("Friction", "friction_torque", "smooth_direction"),
        "dhkit.symbolic.differentiable.inertial_table": ("InertialTable", "inertial_pattern"),
        "dhkit.symbolic.differentiable.recursive": (
            "recursive_bias",
            "recursive_gravity",
            "recursive_inverse_dynamics",
        ),
        "dhkit.symbolic.differentiable.velocity_regressor": ("velocity_regressor",),
        "dhkit.symbolic.exact.base_parameters": ("BaseParameters", "base_parameters"),
        "dhkit.symbolic.exact.exact_arm": ("ExactArm", "exact_arm"),
        "dhkit.symbolic.exact.naming": ("Symbols",),
        "dhkit.symbolic.exact.lagrangian": ("Lagrangian", "Proof", "lagrangian"),
        "dhkit.symbolic.exact.regressor": ("Regressor",),
        "dhkit.symbolic.kinematics": ("SymbolicKinematics", "SymbolicMatrix", "symbolic_kinematics"),
        "dhkit.symbolic.mistakes": ("MISTAKES", "MadeAt", "Mistake", "Subject"),
        "dhkit.symbolic.programs.graph": ("Graph", "Node", "Variable", "operation_count"),
        "dhkit.symbolic.programs.printers": ("c_source", "export_c"),
        "dhkit.symbolic.ring.elements": ("Element", "Elements", "RingError"),
        "dhkit.symbolic.textbook": ("TextbookDerivation", "derive"),
    },
)

register_formats("dhkit.symbolic.equations.text", "plain_text", "equations_text")
register_formats("dhkit.symbolic.equations.latex", "latex_text", "equations_latex")
register_formats("dhkit.symbolic.equations.sympy_objects", "equations_sympy")
register_formats("dhkit.symbolic.equations.python_code", "equations_python")
register_formats("dhkit.symbolic.equations.c_code", "equations_c")
register_formats("dhkit.symbolic.equations.matlab_code", "equations_matlab")
register_formats("dhkit.symbolic.equations.quantities", "readable", "quantities", "kinematic_quantities")
