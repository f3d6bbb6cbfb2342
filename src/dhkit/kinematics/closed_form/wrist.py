"""The last joints of six: axes 5 and 6 meet at right angles, and axis 5 is at right angles to an axis before it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from dhkit.description import Array
from dhkit.description.poses import inverse_pose
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.closed_form.arm_plane import ArmPlane, Vector, as_pair
from dhkit.kinematics.closed_form.family import Parameter, PoseSymbols
from dhkit.kinematics.closed_form.formulas import (
    MIN_DIRECTION,
    SX,
    Pair,
    add_angles,
    angle,
    rotate,
    turn_by_pi,
    unit_pair,
    wrap_angle,
)


def wrist_parameters(
    axes: Axes, plane: ArmPlane, first: Array, centre: Array
) -> dict[str, Parameter]:
    """Return the parameters of the arm's plane and wrist: positions, and directions of the wrist's axes at zero.

    Parameters
    ----------
    first
        Direction of the axis before axis 5, at right angles to it: axis 4, or the parallel axes.
    centre
        Point where axes 5 and 6 meet, shape (3,), m, world.
    """
    z5 = axes.direction(5)
    z6 = axes.direction(6)
    T_world_wrist = np.eye(4)
    T_world_wrist[:3, :3] = np.stack([z6, z5, np.cross(z6, z5)], axis=1)
    T_world_wrist[:3, 3] = centre

    # Angle from the first axis to axis 6 about axis 5, at zero: cosine first . z6, sine z5 . (first x z6).
    wrist = as_pair(first @ z6, z5 @ np.cross(first, z6))

    # "F" maps the plane's coordinates to the wrist's axes z5 x first, z5 and first. "straight" is twice the angle
    # "wrist", by which the solution with a flip, q5' = -q5 - 2 wrist, differs from -q5.
    return {
        "T_plane_world": plane.T[:3],
        "T_tool_wrist": (inverse_pose(axes.T_world_tool) @ T_world_wrist)[:3],
        "F": np.stack([np.cross(z5, first), z5, first]) @ plane.R.T + 0.0,
        "wrist": wrist,
        "straight": np.angle(complex(*wrist) ** 2),
        "up": plane.up,
        "reach": axes.scale,
    }


ERROR_OVER_DEFECT = 10.0
"""Assumed ratio of a rotation's error to its defect of orthonormality, which does not show three of the nine errors,
while the others may be small by chance."""


@dataclass(frozen=True)
class Wrist:
    """Directions of the tool after the wrist's rotation, in the wrist's axes at zero joint positions.

    Those axes are z5 x first, z5 and ``first``, where ``first`` is the axis that the roll is about.
    """

    a: Vector
    """Axis 6."""
    n: Vector
    """The tool's direction that is along axis 5 at zero joint positions."""
    m: Vector
    """Their cross product a x n."""


def wrist_axes(p: Mapping[str, SX], axes: Iterable[Vector]) -> Wrist:
    """Return the tool's axes in those of the wrist, from those in the axes of the arm."""
    a, n, m = (rotate(p["F"], axis) for axis in axes)
    return Wrist(a, n, m)


def ill_determined(pose: PoseSymbols) -> SX:
    """Return the scale below which the first wrist joint's direction is undetermined: rounding, or the pose's error."""
    return 1.0 + ERROR_OVER_DEFECT / MIN_DIRECTION * pose.noise


def joints_5_and_6(
    p: Mapping[str, SX], wrist: Wrist, roll: Pair
) -> tuple[tuple[SX, SX], tuple[SX, SX]]:
    """Return q5 and q6 without flip (joint 5 positive), then with flip, where ``roll`` is larger by pi.

    Both follow from the rotation that remains after the roll about the first axis, so that any roll closes the pose.
    With c and s the cosine and sine of the roll, and the angle ``wrist`` from the first axis to axis 6 at zero,

        q5 + wrist = atan2(c a_1 + s a_2, a_3),    q6 = atan2(s m_1 - c m_2, c n_2 - s n_1).
    """
    a = wrist.a
    n = wrist.n
    m = wrist.m
    c, s = roll

    # In the wrist's axes the directions (-m, n, a) are the columns of R = Rz(roll) Ry(q5 + wrist) Rz(q6). The third
    # column of Rz(-roll) R is (sin(q5 + wrist), 0, cos(q5 + wrist)), and its second row (sin q6, cos q6, 0).
    sine, cosine = unit_pair(c * a[0] + s * a[1], a[2])
    q5 = angle(add_angles((cosine, sine), p["wrist"], -1.0))
    q6 = angle(unit_pair(c * n[1] - s * n[0], s * m[0] - c * m[1]))

    # With the roll larger by pi, c and s change their signs: q5 + wrist becomes its opposite, and q6 turns by pi.
    return (q5, q6), (wrap_angle(-q5 - p["straight"]), turn_by_pi(q6))
