"""Simulation and controllers: an arm as a plant, what drives it, and what becomes of it."""

from dhkit.control.joint_controllers import PID
from dhkit.control.linear import LQR, linearize
from dhkit.control.model_controllers import ComputedTorque, FeedForward, FrictionCompensation, PDGravity
from dhkit.control.plant import Plant
from dhkit.control.pushes import Push
from dhkit.control.references import Held, Reference, Setpoint, Sine, Step
from dhkit.control.result import EnergyAudit, SimulationResult
from dhkit.control.simulation import Controller, simulate

__all__ = [
    "LQR",
    "PID",
    "ComputedTorque",
    "Controller",
    "EnergyAudit",
    "FeedForward",
    "FrictionCompensation",
    "Held",
    "PDGravity",
    "Plant",
    "Push",
    "Reference",
    "Setpoint",
    "SimulationResult",
    "Sine",
    "Step",
    "linearize",
    "simulate",
]
