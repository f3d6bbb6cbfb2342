"""Optimal trajectories: objectives, constraints, the planner, and certificates of the limits of a motion."""

from dhkit.description import Payload
from dhkit.planning.along import along_path
from dhkit.planning.certificate import Certificate, certify
from dhkit.planning.criteria import (
    Constraint,
    Effort,
    Energy,
    Jerk,
    MotorPower,
    Objective,
    ObjectiveLike,
    Time,
    ToolAcceleration,
    ToolDirection,
    ToolOrientation,
    ToolSpeed,
    TorqueSpeedLine,
)
from dhkit.planning.obstacles import Distances, Floor, Obstacle, Scene, distance
from dhkit.planning.planner import Planner
from dhkit.planning.program import Progress
from dhkit.planning.report import BranchReport, PlanReport

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
    "Payload",
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
