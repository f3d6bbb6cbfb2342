"""Optimal trajectories: objectives, constraints, the planner, and certificates of the limits of a motion."""

from dhkit.description import Payload
from dhkit.planning.along import along_path
from dhkit.planning.certificate import Certificate, certify
from dhkit.planning.constraints import Constraint, MotorPower, TorqueSpeedLine
from dhkit.planning.objectives import Effort, Energy, Jerk, Objective, ObjectiveLike, Time
from dhkit.planning.obstacles import Distances, Floor, Obstacle, Scene, distance
from dhkit.planning.options import PathOptions, PlanOptions
from dhkit.planning.planner import Planner
from dhkit.planning.report import BranchReport, PlanReport
from dhkit.planning.solver import Progress
from dhkit.planning.tool_constraints import ToolAcceleration, ToolDirection, ToolOrientation, ToolSpeed

__all__ = [
    "BranchReport",
    "Certificate",
    "Constraint",
    "Distances",
    "Effort",
    "Energy",
    "Floor",
    "Jerk",
    "MotorPower",
    "Objective",
    "ObjectiveLike",
    "Obstacle",
    "PathOptions",
    "Payload",
    "PlanOptions",
    "PlanReport",
    "Planner",
    "Progress",
    "Scene",
    "Time",
    "ToolAcceleration",
    "ToolDirection",
    "ToolOrientation",
    "ToolSpeed",
    "TorqueSpeedLine",
    "along_path",
    "certify",
    "distance",
]
