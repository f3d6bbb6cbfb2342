"""A description as other libraries need it: joint axes in space, and the ortho-parallel parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dhkit.bench.contenders import UnavailableError
from dhkit.description import Array, Description, world_to_frames, world_to_tool
from dhkit.description.frames import carrying

_AXIS_TOLERANCE = 1e-9
"""Largest distance, m, or sine of axes that count as meeting, parallel or perpendicular."""


@dataclass(frozen=True, eq=False)
class JointAxes:
    """Joint axes of an arm at one state, in the world.

    Attributes
    ----------
    directions
        Directions of the axes, unit vectors, shape (n, 3), world.
    points
        A point of each axis, shape (n, 3), m, world.
    T_world_tool
        Pose of the tool at this state, shape (4, 4), m.
    """

    directions: Array
    points: Array
    T_world_tool: Array

    @property
    def offsets(self) -> Array:
        """Offsets from the world over the points to the tool, shape (n + 1, 3), m: the P of EAIK and ssik."""
        return np.diff(self.points, axis=0, prepend=0.0, append=self.T_world_tool[None, :3, 3])

    def without_tool_rotation(self, T: Array) -> Array:
        """Return poses, shape (..., 4, 4), m, of a tool whose axes are the world's at this state."""
        return self._with_rotation(T, self.T_world_tool[:3, :3].T)

    def with_tool_rotation(self, T: Array) -> Array:
        """Return the tool's poses, the inverse of :meth:`without_tool_rotation`."""
        return self._with_rotation(T, self.T_world_tool[:3, :3])

    @staticmethod
    def _with_rotation(T: Array, R: Array) -> Array:
        rotated = np.array(T)
        rotated[..., :3, :3] = T[..., :3, :3] @ R
        return rotated


def joint_axes(description: Description, q: Array | None = None) -> JointAxes:
    """Return the axes of a revolute arm at joint values q, shape (n,), rad; by default at 0.

    Raises
    ------
    UnavailableError
        A joint is prismatic.
    """
    if description.numbers.prismatic.any():
        raise UnavailableError("takes revolute joints only; this arm has prismatic ones")
    q = np.zeros(description.n) if q is None else q
    frames = world_to_frames(description, q)
    turning = carrying(description.convention, frames)
    return JointAxes(turning[:, :3, 2], turning[:, :3, 3], world_to_tool(description, q))


def bare(description: Description) -> Description:
    """Return a description without limits and shapes: the mechanism alone, in one file."""
    return replace(
        description,
        base=replace(description.base, shapes=()),
        joints=tuple(
            replace(joint, limits=None if joint.is_revolute else joint.limits, shapes=())
            for joint in description.joints
        ),
        tool=replace(description.tool, shapes=()),
    )


def has_spherical_wrist(axes: JointAxes) -> bool:
    """Return whether the last three axes meet in a point."""
    return _wrist_centre(axes) is not None


def _wrist_centre(axes: JointAxes) -> Array | None:
    """Return the point where the last three axes meet, shape (3,), m, world; None if they do not."""
    directions = axes.directions[-3:]
    points = axes.points[-3:]
    # Least squares of the distances to the three lines: sum (1 - h h^T) (x - p) = 0.
    projectors = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    centre = np.linalg.lstsq(
        projectors.sum(axis=0), np.einsum("kij,kj->i", projectors, points), rcond=None
    )[0]
    distances = np.linalg.norm(np.einsum("kij,kj->ki", projectors, centre - points), axis=1)
    return centre if distances.max() < _AXIS_TOLERANCE else None


@dataclass(frozen=True, eq=False)
class OrthoParallel:
    """An arm with an ortho-parallel basis and a spherical wrist.

    At its zero state all links are upright, with axes along z y y z y z; lengths are named as in
    Brandstötter, Angerer and Hofbaur, An analytical solution of the inverse kinematics problem of industrial serial
    manipulators (2014), figure 2.

    Attributes
    ----------
    a1, a2, b, c2, c3
        Lengths, m; c1 and c4 are 0, since the basis is at shoulder height and the flange in the wrist's centre.
    T_world_basis, T_flange_tool
        Poses of the basis and, in the flange, of the tool, shape (4, 4), m.
    zero
        Our joint values of the upright arm, shape (6,), rad.
    signs
        1 if our joint angle and the family's grow together, else -1, shape (6,).
    """

    a1: float
    a2: float
    b: float
    c2: float
    c3: float
    T_world_basis: Array
    T_flange_tool: Array
    zero: Array
    signs: Array

    @classmethod
    def of(cls, description: Description) -> OrthoParallel:
        """Return the parameters of an arm: it is turned upright joint by joint, where its lengths are measured.

        Raises
        ------
        UnavailableError
            The arm is of another family.
        """
        if description.n != 6:
            raise UnavailableError(f"takes 6 joints; this arm has {description.n}")
        axes = joint_axes(description)
        centre = _wrist_centre(axes)
        h = axes.directions
        cosines = [abs(h[i] @ h[i + 1]) for i in (0, 2, 3, 4)]
        if (
            centre is None
            or max(cosines) > _AXIS_TOLERANCE
            or np.linalg.norm(np.cross(h[1], h[2])) > _AXIS_TOLERANCE
        ):
            raise UnavailableError(
                "takes an ortho-parallel basis with a spherical wrist; this arm is built otherwise"
            )
        return _fit_upright(description)

    def poses(self, T: Array) -> Array:
        """Return poses of the flange in the basis for poses of the tool in the world, shape (..., 4, 4), m."""
        return np.asarray(np.linalg.inv(self.T_world_basis) @ T @ np.linalg.inv(self.T_flange_tool))

    def tool_poses(self, T: Array) -> Array:
        """Return poses of the tool in the world, the inverse of :meth:`poses`."""
        return np.asarray(self.T_world_basis @ T @ self.T_flange_tool)

    def angles(self, q: Array) -> Array:
        """Return the family's joint angles for ours, shape (..., 6), rad."""
        return self.signs * (q - self.zero)

    def ours(self, angles: Array) -> Array:
        """Return our joint values, the inverse of :meth:`angles`."""
        return self.zero + self.signs * angles


def _fit_upright(description: Description) -> OrthoParallel:
    axes = joint_axes(description)
    z = axes.directions[0]
    y = axes.directions[1]
    x = np.cross(y, z)
    q = np.zeros(6)

    def turn(joint: int, current: Array, target: Array) -> JointAxes:
        """Turn a joint until one vector has the direction of another, seen along the joint's axis z."""
        # Signed angle about z from c to t:  tan = z . (c x t) / (c . t - (z . c)(z . t)).
        axis = joint_axes(description, q).directions[joint]
        q[joint] = np.arctan2(
            axis @ np.cross(current, target), current @ target - (axis @ current) * (axis @ target)
        )
        return joint_axes(description, q)

    upper_arm = axes.points[2] - axes.points[1]
    axes = turn(1, upper_arm - (upper_arm @ y) * y, z)
    axes = turn(2, _forearm_direction(_wrist_centre(axes), axes), z)
    axes = turn(3, axes.directions[4], y)
    axes = turn(4, axes.directions[5], z)
    centre = _wrist_centre(axes)
    if centre is None:
        raise UnavailableError("takes a spherical wrist; the axes of this arm's meet too loosely")

    basis = np.eye(4)
    basis[:3, :3] = np.column_stack([x, y, z])
    origin = axes.points[0]
    basis[:3, 3] = origin + ((axes.points[1] - origin) @ z) * z
    shoulder, elbow, wrist = (
        (point - basis[:3, 3]) @ basis[:3, :3] for point in (axes.points[1], axes.points[2], centre)
    )
    upright = basis.copy()
    upright[:3, 3] = centre
    return OrthoParallel(
        a1=float(shoulder[0]),
        a2=float(wrist[0] - elbow[0]),
        b=float(wrist[1]),
        c2=float(elbow[2]),
        c3=float(wrist[2] - elbow[2]),
        T_world_basis=basis,
        T_flange_tool=np.linalg.inv(upright) @ axes.T_world_tool,
        zero=q,
        signs=np.sign(np.einsum("ij,ij->i", axes.directions, np.array([z, y, y, z, y, z]))),
    )


def _forearm_direction(centre: Array | None, axes: JointAxes) -> Array:
    """Return the direction of the fourth axis that points from the elbow to the wrist's centre."""
    forearm: Array = axes.directions[3]
    return -forearm if centre is not None and (centre - axes.points[2]) @ forearm < 0 else forearm
