"""The last joints of six: axes 5 and 6 meet at right angles, and axis 5 is at right angles to an axis before it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from dhkit.description import Array
from dhkit.kinematics.axes import Axes, inverse_pose
from dhkit.kinematics.closed_form.arm_plane import ArmPlane, Vector, as_pair
from dhkit.kinematics.closed_form.family import Parameter, PoseSymbols
from dhkit.kinematics.closed_form.formulas import NOTHING, SX, Pair, angle, turn_by_pi, rotate, add_angles, unit_pair, wrap_angle


def wrist_parameters(axes: Axes, plane: ArmPlane, first: Array, centre: Array) -> dict[str, Parameter]:
    """Return where arm plane and wrist are, and how the wrist's axes lie at zero joint values.

    Parameters
    ----------
    first
        The axis across axis 5 on the arm's side: axis 4, or the parallel axes' direction.
    centre
        Where axes 5 and 6 meet.
    """
    z5, z6 = axes.direction(5), axes.direction(6)
    T_world_wrist = np.eye(4)
    T_world_wrist[:3, :3] = np.stack([z6, z5, np.cross(z6, z5)], axis=1)
    T_world_wrist[:3, 3] = centre
    wrist = as_pair(first @ z6, z5 @ np.cross(first, z6))
    return {
        "T_plane_world": plane.T[:3],
        "T_tool_wrist": (inverse_pose(axes.T_world_tool) @ T_world_wrist)[:3],
        "F": np.stack([np.cross(z5, first), z5, first]) @ plane.R.T + 0.0,
        "wrist": wrist,
        "straight": np.angle(complex(*wrist) ** 2),
        "up": plane.up,
        "reach": axes.scale,
    }


UNSEEN = 10.0
"""How many times as far as it shows in its columns a rotation may be wrong: that they are orthonormal leaves three of
nine errors unseen, and the others may be small by chance."""


@dataclass(frozen=True)
class Wrist:
    """Where axis 6, axis 5 at zero and their product have gone, in the axes of the wrist at zero joint values."""

    a: Vector
    n: Vector
    m: Vector


def turned(p: Mapping[str, SX], axes: Iterable[Vector]) -> Wrist:
    """Return the tool's axes as the wrist sees them, from those that the arm sees."""
    a, n, m = (rotate(p["F"], axis) for axis in axes)
    return Wrist(a, n, m)


def ill_determined(pose: PoseSymbols) -> SX:
    """Return the scale at which the first joint's direction is noise: rounding, or what the pose is wrong by."""
    return 1.0 + UNSEEN / NOTHING * pose.noise


def joints_5_and_6(p: Mapping[str, SX], wrist: Wrist, roll: Pair) -> tuple[tuple[SX, SX], tuple[SX, SX]]:
    """Return q5 and q6 without flip (joint 5 turned to its positive side), and with it, where ``roll`` is pi further.

    Everything is taken from the rotation that the roll about the first axis leaves over: it closes whatever it is.
    """
    a, n, m = wrist.a, wrist.n, wrist.m
    bend = unit_pair(roll[0] * a[0] + roll[1] * a[1], a[2])
    q5 = angle(add_angles((bend[1], bend[0]), p["wrist"], -1.0))
    q6 = angle(unit_pair(roll[0] * n[1] - roll[1] * n[0], roll[1] * m[0] - roll[0] * m[1]))
    return (q5, q6), (wrap_angle(-q5 - p["straight"]), turn_by_pi(q6))
