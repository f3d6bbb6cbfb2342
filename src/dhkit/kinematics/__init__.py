"""Where an arm is, how it moves and how it gets there: forward and inverse kinematics, Jacobians, workspace."""

from dhkit.kinematics.c_code import export_kinematics
from dhkit.kinematics.closed_form import Classification, classify
from dhkit.kinematics.forward import forward_kinematics, frames
from dhkit.kinematics.inverse import inverse_kinematics
from dhkit.kinematics.jacobian import ReferenceAxes, jacobian, jacobian_dot
from dhkit.kinematics.numeric import solve_numerically
from dhkit.kinematics.path import IKPath, follow_path
from dhkit.kinematics.solutions import IKFlag, IKSolutions, IKStatus

__all__ = [
    "Classification",
    "IKFlag",
    "IKPath",
    "IKSolutions",
    "IKStatus",
    "ReferenceAxes",
    "classify",
    "export_kinematics",
    "follow_path",
    "forward_kinematics",
    "frames",
    "inverse_kinematics",
    "jacobian",
    "jacobian_dot",
    "solve_numerically",
]
