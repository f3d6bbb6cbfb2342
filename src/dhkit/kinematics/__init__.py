"""Where an arm is and how it moves: forward kinematics and Jacobians, for one state or a batch."""

from dhkit.kinematics.forward import forward_kinematics, frames
from dhkit.kinematics.jacobian import ReferenceAxes, jacobian, jacobian_dot

__all__ = ["ReferenceAxes", "forward_kinematics", "frames", "jacobian", "jacobian_dot"]
