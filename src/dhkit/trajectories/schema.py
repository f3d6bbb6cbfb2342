"""JSON Schema of motion files in YAML: the ROS JointTrajectory as it is written and read."""

from __future__ import annotations

from dhkit.description.schema import titled_schema
from dhkit.trajectories.bounds import BOUNDS
from dhkit.trajectories.files import LEFT_OUT
from dhkit.trajectories.ros_yaml import ROWS, TIMES

_NUMBER = {
    "type": ["number", "string"],
    "pattern": r"^[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?$",
}
"""A number, or its text: YAML 1.1 reads 1e-05 as text."""
_WHOLE = {
    "type": ["integer", "string"],
    "minimum": 0,
    "maximum": 10**BOUNDS.digits - 1,
    "pattern": f"^[0-9]{{1,{BOUNDS.digits}}}$",
}
_ROW = {"type": "array", "items": _NUMBER, "minItems": 1}
_ROW_OR_NONE = {"anyOf": [_ROW, {"enum": [*LEFT_OUT]}]}


def motion_schema() -> dict[str, object]:
    """Return the JSON Schema of motion files that end in .yaml or .yml.

    JSON Schema cannot express that rows have one number a joint, that times increase, that all points have the same
    rows, or which joints a robot has; the reader checks these too.
    """
    description = (
        "A motion as samples: a ROS message trajectory_msgs/JointTrajectory, in rad, m and s. A file that dhkit wrote"
        " begins with the comments '# dhkit trajectory' and '# robot: NAME DIGEST'."
    )
    properties = {
        "header": {"description": "Of the ROS message; not read."},
        "joint_names": {
            "type": "array",
            "description": "Names of the robot's joints, in any order: the order of every row.",
            "items": {"type": "string"},
            "minItems": 1,
            "uniqueItems": True,
        },
        "points": {
            "type": "array",
            "description": "Samples in order of time.",
            "items": _point(),
            "minItems": 2,
        },
    }
    return titled_schema(
        "dhkit motion file", _closed(properties, description, ["joint_names", "points"])
    )


def _point() -> dict[str, object]:
    positions, velocities, accelerations = ROWS
    properties = {
        positions: _ROW | {"description": "Joint values, rad and m, one a joint."},
        velocities: _ROW_OR_NONE
        | {"description": "Joint rates, rad/s and m/s; in all points or in none."},
        accelerations: _ROW_OR_NONE
        | {"description": "Joint accelerations, rad/s^2 and m/s^2; only with velocities."},
        "effort": {"description": "Joint torques, N m and N; not read."},
        "time_from_start": _duration(),
    }
    return _closed(properties, "A sample of the motion.", [positions, "time_from_start"]) | {
        "if": {"properties": {accelerations: _ROW}, "required": [accelerations]},
        "then": {"properties": {velocities: _ROW}, "required": [velocities]},
    }


def _duration() -> dict[str, object]:
    """Return the schema of a time: seconds and nanoseconds, under the keys of one version of ROS."""
    properties: dict[str, object] = {}
    for whole, part in TIMES:
        properties |= {
            whole: _WHOLE | {"description": "Whole seconds."},
            part: _WHOLE | {"description": "Nanoseconds."},
        }
    duration = _closed(properties, "Time of the sample, greater than that of the one before.")
    return duration | {"anyOf": [{"required": [*keys]} for keys in TIMES]}


def _closed(
    properties: dict[str, object], description: str, required: list[str] | None = None
) -> dict[str, object]:
    """Return the schema of a mapping without other keys."""
    known = {
        "type": "object",
        "description": description,
        "properties": properties,
        "additionalProperties": False,
    }
    return known | ({"required": required} if required else {})
