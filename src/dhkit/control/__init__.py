"""Simulation and controllers: plants, controllers, references, sensors and results."""

from dhkit.control.adaptive import Adaptive
from dhkit.control.batch import simulate_batch
from dhkit.control.batch_result import BatchResult
from dhkit.control.comparison import CONTROLLERS, Comparison, compare, make_controller
from dhkit.control.controller import ContinuousController, Controller
from dhkit.control.joint_controllers import PID
from dhkit.control.linear import LQR, linearize
from dhkit.control.model_controllers import (
    ComputedTorque,
    FeedForward,
    FrictionCompensation,
    PDGravity,
)
from dhkit.control.operational_space import OperationalSpace
from dhkit.control.options import BatchOptions, SimulationOptions
from dhkit.control.plant import Plant
from dhkit.control.pushes import Push
from dhkit.control.references import Held, Reference, Setpoint, Sine, Step
from dhkit.control.result import EnergyAudit, ErrorNorms, SimulationResult
from dhkit.control.sensors import Sensors
from dhkit.control.simulation import simulate
from dhkit.control.tool_poses import ToolPoses
from dhkit.formats import register_formats

__all__ = [
    "CONTROLLERS",
    "LQR",
    "PID",
    "Adaptive",
    "BatchOptions",
    "BatchResult",
    "Comparison",
    "ComputedTorque",
    "ContinuousController",
    "Controller",
    "EnergyAudit",
    "ErrorNorms",
    "FeedForward",
    "FrictionCompensation",
    "Held",
    "OperationalSpace",
    "PDGravity",
    "Plant",
    "Push",
    "Reference",
    "Sensors",
    "Setpoint",
    "SimulationOptions",
    "SimulationResult",
    "Sine",
    "Step",
    "ToolPoses",
    "compare",
    "linearize",
    "make_controller",
    "simulate",
    "simulate_batch",
]

register_formats("dhkit.control.result_files", "save_result", "load_result")
