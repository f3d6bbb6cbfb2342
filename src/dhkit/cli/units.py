"""Joint values and angles for machines: in radians or degrees as was asked for, under keys that say which."""

from __future__ import annotations

from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array


def angle_key(name: str, *, degrees: bool) -> str:
    """Return the key of angles, ``q_rad`` or ``q_deg``."""
    return f"{name}_{'deg' if degrees else 'rad'}"


def joint_entry(arm: Arm, name: str, values: Array, *, degrees: bool = False) -> dict[str, list[Any]]:
    """Return joint values, shape (..., n), rad and m, by a key with the angles' unit; sliding joints stay in m."""
    turning = ~arm.description.numbers.prismatic & degrees
    return {angle_key(name, degrees=degrees): np.where(turning, np.degrees(values), values).tolist()}
