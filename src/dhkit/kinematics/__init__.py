"""Kinematics of an arm: forward and inverse kinematics, Jacobians, singularities, manipulability, workspace."""

from dhkit.kinematics.boundaries import Boundary, boundaries
from dhkit.kinematics.closed_form import Classification, classify
from dhkit.kinematics.forward import forward_kinematics, frames
from dhkit.kinematics.intervals import redundancy_intervals
from dhkit.kinematics.inverse import inverse_kinematics, inverse_kinematics_in_chunks
from dhkit.kinematics.jacobian import jacobian, jacobian_derivative, jacobian_dot
from dhkit.kinematics.manipulability import (
    Ellipsoid,
    Motion,
    condition_number,
    force_ellipsoid,
    freedoms,
    isotropy,
    manipulability,
    singular_values,
    velocity_ellipsoid,
)
from dhkit.kinematics.nearest import nearest_pose
from dhkit.kinematics.numeric import solve_numerically
from dhkit.kinematics.path import IKPath, follow_path
from dhkit.kinematics.preference import Preference
from dhkit.kinematics.programs import export_kinematics, kinematic_kernels
from dhkit.kinematics.redundant import redundancy_of
from dhkit.kinematics.singularities import (
    Singularities,
    determinant,
    measures,
    singular_configurations,
    singularities,
)
from dhkit.kinematics.solutions import IKFlag, IKSolutions, IKStatus
from dhkit.kinematics.workspace import Estimate, Grid, Workspace, tool_reach, workspace
from dhkit.symbolic import ReferenceAxes

__all__ = [
    "Boundary",
    "Classification",
    "Ellipsoid",
    "Estimate",
    "Grid",
    "IKFlag",
    "IKPath",
    "IKSolutions",
    "IKStatus",
    "Motion",
    "Preference",
    "ReferenceAxes",
    "Singularities",
    "Workspace",
    "boundaries",
    "classify",
    "condition_number",
    "determinant",
    "export_kinematics",
    "follow_path",
    "force_ellipsoid",
    "forward_kinematics",
    "frames",
    "freedoms",
    "inverse_kinematics",
    "inverse_kinematics_in_chunks",
    "isotropy",
    "jacobian",
    "jacobian_derivative",
    "jacobian_dot",
    "kinematic_kernels",
    "manipulability",
    "measures",
    "nearest_pose",
    "redundancy_intervals",
    "redundancy_of",
    "singular_configurations",
    "singular_values",
    "singularities",
    "solve_numerically",
    "tool_reach",
    "velocity_ellipsoid",
    "workspace",
]
