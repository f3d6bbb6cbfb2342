"""A robot as data: its table, bodies, drives and shapes with exact numbers; robot files, the library, frames, poses."""

from dhkit.description.assets import asset
from dhkit.description.bodies import require_bodies
from dhkit.description.changes import (
    with_base,
    with_limits,
    with_parameters,
    with_payload,
    with_tool,
    with_uniform_links,
)
from dhkit.description.files import write_atomically
from dhkit.description.frames import joint_array, joint_vector, link_transforms, world_to_frames, world_to_tool
from dhkit.description.library import library_robot, robots
from dhkit.description.locking import lock
from dhkit.description.named import Named
from dhkit.description.numbers import Array, Numbers
from dhkit.description.payload import Payload
from dhkit.description.poses import check_pose, pose, pose_parts, pose_quaternion
from dhkit.description.robot import Description, Robot, description_of
from dhkit.description.robot_file import from_toml, read_robot
from dhkit.description.table import DHTable, from_dh
from dhkit.description.toml_writer import to_toml, write_robot
from dhkit.description.values import (
    INERTIA_PLACES,
    Base,
    Body,
    Box,
    Capsule,
    Convention,
    Cylinder,
    Drive,
    Geometry,
    Inertia,
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
