"""Optimal trajectories: objectives, constraints, the planner, and certificates of what it found."""

from dhkit.planning.constraints import (
    Constraint,
    MotorPower,
    ToolAcceleration,
    ToolDirection,
    ToolOrientation,
    ToolSpeed,
    TorqueSpeedLine,
)
from dhkit.planning.objectives import Effort, Energy, Jerk, Objective, Time
from dhkit.planning.obstacles import Distances, Floor, Obstacle, distance
from dhkit.planning.payload import Payload
from dhkit.planning.planner import Planner
from dhkit.planning.report import BranchReport, PlanReport

__all__ = [
    "BranchReport",
    "Constraint",
    "Distances",
    "Effort",
    "Energy",
    "Floor",
    "Jerk",
    "MotorPower",
    "Objective",
    "Obstacle",
    "Payload",
    "PlanReport",
    "Planner",
    "Time",
    "ToolAcceleration",
    "ToolDirection",
    "ToolOrientation",
    "ToolSpeed",
    "TorqueSpeedLine",
    "distance",
]
