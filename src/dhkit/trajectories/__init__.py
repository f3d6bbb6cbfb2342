"""Motions over time: exact piecewise polynomials, limits, files, and the classical motions of textbooks."""

from dhkit.formats import register_formats
from dhkit.trajectories.cartesian import circle, straight_line
from dhkit.trajectories.files import read_motion, written_by_dhkit
from dhkit.trajectories.following import joint_path
from dhkit.trajectories.limits import Limits
from dhkit.trajectories.paths import JointPath
from dhkit.trajectories.point_to_point import cubic, quintic, trapezoidal
from dhkit.trajectories.samples import Samples
from dhkit.trajectories.slowdown import Torques, least_slowdown, require_inside
from dhkit.trajectories.spline import spline
from dhkit.trajectories.tool_paths import ToolCircle, ToolLine, ToolPath, tool_circle, tool_line
from dhkit.trajectories.trajectory import Trajectory

__all__ = [
    "JointPath",
    "Limits",
    "Samples",
    "ToolCircle",
    "ToolLine",
    "ToolPath",
    "Torques",
    "Trajectory",
    "circle",
    "cubic",
    "joint_path",
    "least_slowdown",
    "quintic",
    "read_motion",
    "require_inside",
    "spline",
    "straight_line",
    "tool_circle",
    "tool_line",
    "trapezoidal",
    "written_by_dhkit",
]

register_formats("dhkit.trajectories.files", "save_trajectory", "load_trajectory", "read_samples")
