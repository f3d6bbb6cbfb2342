"""Robot arms from their Denavit-Hartenberg table: URDF, Pinocchio model, kinematics, and a view in the browser."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dhkit.errors import (
    AnswerError,
    DescriptionError,
    DhkitError,
    ExpressionError,
    ModelError,
    PlanningError,
    SimulationError,
    UnreachableError,
)
from dhkit.lazy import lazy_names

if TYPE_CHECKING:
    from dhkit.arm import Arm
    from dhkit.control import (
        LQR,
        PID,
        Adaptive,
        ComputedTorque,
        FeedForward,
        FrictionCompensation,
        OperationalSpace,
        PDGravity,
        Push,
        Sensors,
        SimulationResult,
        Sine,
        Step,
        ToolPoses,
    )
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
    "LQR",
    "PID",
    "Adaptive",
    "AnswerError",
    "Arm",
    "ComputedTorque",
    "Description",
    "DescriptionError",
    "DhkitError",
    "Effort",
    "Energy",
    "ExpressionError",
    "FeedForward",
    "Floor",
    "Friction",
    "FrictionCompensation",
    "GradeReport",
    "IKFlag",
    "IKSolutions",
    "IKStatus",
    "Jerk",
    "Limits",
    "ModelError",
    "MotorPower",
    "Obstacle",
    "OperationalSpace",
    "PDGravity",
    "Payload",
    "PlanningError",
    "Push",
    "Sensors",
    "SimulationError",
    "SimulationResult",
    "Sine",
    "Step",
    "Time",
    "ToolAcceleration",
    "ToolDirection",
    "ToolOrientation",
    "ToolPoses",
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

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "dhkit.arm": ("Arm",),
        "dhkit.control": (
            "LQR",
            "PID",
            "Adaptive",
            "ComputedTorque",
            "FeedForward",
            "FrictionCompensation",
            "OperationalSpace",
            "PDGravity",
            "Push",
            "Sensors",
            "SimulationResult",
            "Sine",
            "Step",
            "ToolPoses",
        ),
        "dhkit.description": (
            "Description",
            "pose",
            "pose_parts",
            "robots",
        ),
        "dhkit.planning": (
            "Effort",
            "Energy",
            "Floor",
            "Jerk",
            "MotorPower",
            "Obstacle",
            "Payload",
            "Time",
            "ToolAcceleration",
            "ToolDirection",
            "ToolOrientation",
            "ToolSpeed",
            "TorqueSpeedLine",
        ),
        "dhkit.dynamics": ("Friction",),
        "dhkit.grading": (
            "GradeReport",
            "grade",
        ),
        "dhkit.kinematics": (
            "IKFlag",
            "IKSolutions",
            "IKStatus",
        ),
        "dhkit.trajectories": (
            "Limits",
            "Trajectory",
        ),
        "dhkit.viewer": ("plot",),
    },
    (
        "control",
        "description",
        "dynamics",
        "grading",
        "kinematics",
        "lab",
        "planning",
        "symbolic",
        "trajectories",
        "verification",
        "viewer",
    ),
)
