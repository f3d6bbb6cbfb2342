"""Joint values and angles for machines: in radians or degrees, under keys that name the unit."""

from __future__ import annotations

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array


def angle_key(name: str, *, degrees: bool) -> str:
    """Return the key of angles, ``q_rad`` or ``q_deg``."""
    return f"{name}_{'deg' if degrees else 'rad'}"


def joint_entry(arm: Arm, name: str, values: Array, *, degrees: bool = False) -> dict[str, object]:
    """Return joint values, shape (..., n), under a key with the unit of angles; prismatic joints stay in m."""
    in_degrees = ~arm.description.numbers.prismatic & degrees
    return {
        angle_key(name, degrees=degrees): np.where(in_degrees, np.degrees(values), values).tolist()
    }
