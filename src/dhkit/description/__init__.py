"""A robot as data: its table, bodies, drives and shapes with exact numbers; robot files, the library, frames, poses."""

from dhkit.description.arrays import Array
from dhkit.description.assets import asset
from dhkit.description.bodies import INERTIA_PLACES, Body, Inertia
from dhkit.description.changes import (
    with_base,
    with_limits,
    with_parameters,
    with_payload,
    with_tool,
    with_uniform_links,
)
from dhkit.description.files import write_atomically
from dhkit.description.frames import (
    joint_array,
    joint_vector,
    link_transforms,
    world_to_frames,
    world_to_tool,
)
from dhkit.description.library import library_robot, robots
from dhkit.description.locking import lock
from dhkit.description.named import Named
from dhkit.description.numbers import Numbers
from dhkit.description.payload import Payload
from dhkit.description.poses import check_pose, pose, pose_parts, pose_quaternion
from dhkit.description.robot import Description, description_of, require_bodies, takes_robot
from dhkit.description.robot_data import Robot
from dhkit.description.robot_file import from_toml, read_robot, to_toml, write_robot
from dhkit.description.table import DHTable
from dhkit.description.table_rows import from_dh
from dhkit.description.values import (
    Base,
    Box,
    Capsule,
    Convention,
    Coupling,
    Cylinder,
    Drive,
    Geometry,
    Joint,
    JointType,
    Mesh,
    Placement,
    Shape,
    Sphere,
    Tool,
    Units,
)

__all__ = [
    "INERTIA_PLACES",
    "Array",
    "Base",
    "Body",
    "Box",
    "Capsule",
    "Convention",
    "Coupling",
    "Cylinder",
    "DHTable",
    "Description",
    "Drive",
    "Geometry",
    "Inertia",
    "Joint",
    "JointType",
    "Mesh",
    "Named",
    "Numbers",
    "Payload",
    "Placement",
    "Robot",
    "Shape",
    "Sphere",
    "Tool",
    "Units",
    "asset",
    "check_pose",
    "description_of",
    "from_dh",
    "from_toml",
    "joint_array",
    "joint_vector",
    "library_robot",
    "link_transforms",
    "lock",
    "pose",
    "pose_parts",
    "pose_quaternion",
    "read_robot",
    "require_bodies",
    "robots",
    "takes_robot",
    "to_toml",
    "with_base",
    "with_limits",
    "with_parameters",
    "with_payload",
    "with_tool",
    "with_uniform_links",
    "world_to_frames",
    "world_to_tool",
    "write_atomically",
    "write_robot",
]
