"""Robot arms from their Denavit-Hartenberg table: URDF, Pinocchio model, kinematics, and a view in the browser."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from dhkit.errors import (
    AnswerError,
    DescriptionError,
    DhkitError,
    ExpressionError,
    ModelError,
    PlanningError,
    UnreachableError,
)

if TYPE_CHECKING:
    from dhkit.arm import Arm
    from dhkit.description import Description, pose, pose_parts, robots
    from dhkit.dynamics import Friction
    from dhkit.grading import GradeReport, grade
    from dhkit.kinematics import IKFlag, IKSolutions, IKStatus
    from dhkit.planning import (
        Effort,
        Energy,
        Floor,
        Jerk,
        MotorPower,
        Obstacle,
        Payload,
        Time,
        ToolAcceleration,
        ToolDirection,
        ToolOrientation,
        ToolSpeed,
        TorqueSpeedLine,
    )
    from dhkit.trajectories import Limits, Trajectory
    from dhkit.viewer import plot

__version__ = "0.1.0"

__all__ = [
    "AnswerError",
    "Arm",
    "Description",
    "DescriptionError",
    "DhkitError",
    "Effort",
    "Energy",
    "ExpressionError",
    "Floor",
    "Friction",
    "GradeReport",
    "IKFlag",
    "IKSolutions",
    "IKStatus",
    "Jerk",
    "Limits",
    "ModelError",
    "MotorPower",
    "Obstacle",
    "Payload",
    "PlanningError",
    "Time",
    "ToolAcceleration",
    "ToolDirection",
    "ToolOrientation",
    "ToolSpeed",
    "TorqueSpeedLine",
    "Trajectory",
    "UnreachableError",
    "__version__",
    "grade",
    "plot",
    "pose",
    "pose_parts",
    "robots",
]

_HOMES = {
    "Arm": "dhkit.arm",
    "Description": "dhkit.description",
    "Effort": "dhkit.planning",
    "Energy": "dhkit.planning",
    "Floor": "dhkit.planning",
    "Friction": "dhkit.dynamics",
    "GradeReport": "dhkit.grading",
    "IKFlag": "dhkit.kinematics",
    "IKSolutions": "dhkit.kinematics",
    "IKStatus": "dhkit.kinematics",
    "Jerk": "dhkit.planning",
    "Limits": "dhkit.trajectories",
    "MotorPower": "dhkit.planning",
    "Obstacle": "dhkit.planning",
    "Payload": "dhkit.planning",
    "Time": "dhkit.planning",
    "ToolAcceleration": "dhkit.planning",
    "ToolDirection": "dhkit.planning",
    "ToolOrientation": "dhkit.planning",
    "ToolSpeed": "dhkit.planning",
    "TorqueSpeedLine": "dhkit.planning",
    "Trajectory": "dhkit.trajectories",
    "grade": "dhkit.grading",
    "plot": "dhkit.viewer",
    "pose": "dhkit.description",
    "pose_parts": "dhkit.description",
    "robots": "dhkit.description",
}
"""Where the public names live: imported when first used, so that ``import dhkit`` takes no time."""


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'dhkit' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
