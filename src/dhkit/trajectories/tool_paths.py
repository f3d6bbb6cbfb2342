"""Paths of the tool: straight line and circle, with exact derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array
from dhkit.description.arrays import number_array
from dhkit.description.poses import one_pose
from dhkit.display import repr_line


class ToolPath(Protocol):
    """Poses of the tool over s in [0, 1]."""

    def poses(self, s: Array) -> Array:
        """Return T_world_tool, shape (N, 4, 4), for s of shape (N,).

        Parameters
        ----------
        s
            Places on the path, shape (N,), from 0 to 1.
        """

    def twists(self, s: Array) -> Array:
        """Return derivatives by s, shape (N, 6), world axes: of the tool's origin, m, and angular, rad.

        Parameters
        ----------
        s
            Places on the path, shape (N,), from 0 to 1.
        """

    def twist_rates(self, s: Array) -> Array:
        """Return the derivatives of the twists by s, shape (N, 6), m and rad.

        Parameters
        ----------
        s
            Places on the path, shape (N,), from 0 to 1.
        """


@dataclass(frozen=True, eq=False)
class ToolLine:
    """A straight line, turned evenly about one axis the shorter way round."""

    T0: Array
    """The first pose, shape (4, 4)."""
    way: Array
    """Vector from the first to the last position, shape (3,), m."""
    turn: Array
    """Rotation vector from the first to the last pose, world axes, shape (3,), rad."""

    def poses(self, s: Array) -> Array:
        """Return poses, shape (N, 4, 4).

        Parameters
        ----------
        s
            Places on the path, shape (N,), from 0 to 1.
        """
        # p(s) = p_0 + s way,  R(s) = exp(s [turn]x) R_0
        return _poses(self.T0[:3, 3] + s[:, None] * self.way, s[:, None] * self.turn, self.T0)

    def twists(self, s: Array) -> Array:
        """Return the same twist everywhere, shape (N, 6).

        Parameters
        ----------
        s
            Places on the path, shape (N,), from 0 to 1.
        """
        return np.tile(np.concatenate([self.way, self.turn]), (len(s), 1))

    def twist_rates(self, s: Array) -> Array:
        """Return zeros, shape (N, 6).

        Parameters
        ----------
        s
            Places on the path, shape (N,), from 0 to 1.
        """
        return np.zeros((len(s), 6))

    def __repr__(self) -> str:
        length = np.linalg.norm(self.way)
        angle = np.linalg.norm(self.turn)
        return repr_line("ToolLine", summary=f"{length:.4g} m, turned by {angle:.4g} rad")


@dataclass(frozen=True, eq=False)
class ToolCircle:
    """An arc about an axis through a point."""

    T0: Array
    """The first pose, shape (4, 4)."""
    centre: Array
    """A point of the axis, shape (3,), m."""
    turn: Array
    """The axis times the angle, shape (3,), rad."""
    turning: bool
    """Whether the tool turns with the arc; else its orientation stays."""

    def poses(self, s: Array) -> Array:
        """Return poses, shape (N, 4, 4).

        Parameters
        ----------
        s
            Places on the path, shape (N,), from 0 to 1.
        """
        # p(s) = centre + exp(s [turn]x) (p_0 - centre)
        turn = s[:, None] * self.turn
        tool_turn = turn if self.turning else 0.0 * turn
        return _poses(self.centre + self._radii(s), tool_turn, self.T0)

    def twists(self, s: Array) -> Array:
        """Return twists, shape (N, 6).

        Parameters
        ----------
        s
            Places on the path, shape (N,), from 0 to 1.
        """
        # v = w x r, with w the turn per unit of s
        velocity: Array = np.cross(self.turn, self._radii(s))
        angular = np.broadcast_to(self.turn * self.turning, velocity.shape)
        return np.asarray(np.concatenate([velocity, angular], axis=1))

    def twist_rates(self, s: Array) -> Array:
        """Return the derivatives of the twists, which point towards the axis, shape (N, 6).

        Parameters
        ----------
        s
            Places on the path, shape (N,), from 0 to 1.
        """
        # dv/ds = w x (w x r)
        acceleration = np.cross(self.turn, np.cross(self.turn, self._radii(s)))
        return np.asarray(np.concatenate([acceleration, np.zeros_like(acceleration)], axis=1))

    def __repr__(self) -> str:
        angle = float(np.linalg.norm(self.turn))
        radius = float(np.linalg.norm(np.cross(self.turn, self.T0[:3, 3] - self.centre))) / (
            angle or 1.0
        )
        tool = "turning with it" if self.turning else "keeping its orientation"
        return repr_line(
            "ToolCircle", summary=f"{angle:.4g} rad of radius {radius:.4g} m, the tool {tool}"
        )

    def _radii(self, s: Array) -> Array:
        """Return vectors from the centre to the tool, shape (N, 3), m."""
        R = _rotations(s[:, None] * self.turn)
        radii: Array = np.einsum("kij,j->ki", R, self.T0[:3, 3] - self.centre)
        return radii


def tool_line(T0: ArrayLike, T1: ArrayLike) -> ToolLine:
    """Return the straight line between two poses; its orientation turns evenly about one axis (slerp).

    Parameters
    ----------
    T0, T1
        Poses of the tool in the world, shape (4, 4), m.

    Returns
    -------
    ToolLine
        The line, over a parameter from 0 to 1.

    Raises
    ------
    ValueError
        Other shapes, or matrices that are not poses.

    Examples
    --------
    >>> from dhkit.description import pose
    >>> line = tool_line(pose((0.5, 0, 0.2)), pose((0.5, 0.2, 0.2)))
    >>> line.poses(np.array([0.5]))[0, :3, 3]
    array([0.5, 0.1, 0.2])
    """
    from scipy.spatial.transform import Rotation

    start = one_pose(T0, "T0")
    goal = one_pose(T1, "T1")
    R = goal[:3, :3] @ start[:3, :3].T
    turn = Rotation.from_matrix(R).as_rotvec()
    return ToolLine(start, goal[:3, 3] - start[:3, 3], turn)


def tool_circle(
    T0: ArrayLike,
    centre: ArrayLike,
    axis: ArrayLike,
    angle: float = 2 * np.pi,
    turning: bool = False,
) -> ToolCircle:
    """Return an arc that begins at a pose.

    Parameters
    ----------
    T0
        The first pose, shape (4, 4), in the world.
    centre
        A point of the axis, shape (3,), m: the arc lies in the plane across the axis through the first position.
    axis
        Direction of the axis, shape (3,), of any length but 0; angles follow the right-hand rule.
    angle
        Angle of the arc, rad.
    turning
        Whether the tool turns with the arc; else its orientation stays.

    Returns
    -------
    ToolCircle
        The arc, over a parameter from 0 to 1.

    Raises
    ------
    ValueError
        Other shapes, no pose, values that are not finite, an axis of length 0, or a position on the axis.

    Examples
    --------
    >>> from dhkit.description import pose
    >>> arc = tool_circle(pose((0.5, 0, 0.2)), (0.4, 0, 0.2), (0, 0, 1), angle=3.141592653589793)
    >>> arc.poses(np.array([0.5, 1.0]))[:, :3, 3].round(6)
    array([[0.4, 0.1, 0.2],
           [0.3, 0. , 0.2]])
    """
    start = one_pose(T0, "T0")
    point = _vector(centre, "centre")
    direction = _vector(axis, "axis")
    length = float(np.linalg.norm(direction))
    if not length:
        raise ValueError("axis has length 0; expected a direction")
    if not np.isfinite(angle):
        raise ValueError(f"angle is {angle!r}; expected a number, rad")
    direction = direction / length
    arm = start[:3, 3] - point
    if not np.linalg.norm(np.cross(direction, arm)) > 0:
        raise ValueError("T0 lies on the axis; expected a circle's beginning beside it")
    return ToolCircle(start, point, direction * float(angle), turning)


def _poses(positions: Array, turns: Array, T0: Array) -> Array:
    """Return poses (N, 4, 4) from positions (N, 3), m, and rotation vectors (N, 3), rad, from T0."""
    T = np.zeros((len(positions), 4, 4))
    T[:, :3, :3] = _rotations(turns) @ T0[:3, :3]
    T[:, :3, 3] = positions
    T[:, 3, 3] = 1.0
    return T


def _rotations(turns: Array) -> Array:
    """Return rotation matrices (N, 3, 3) of rotation vectors (N, 3), rad."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(turns).as_matrix())


def _vector(value: ArrayLike, name: str) -> Array:
    """Return an argument as a finite vector, shape (3,)."""
    array = number_array(value, name, "(3,)")
    if array.shape != (3,) or not np.isfinite(array).all():
        raise ValueError(f"{name} has shape {array.shape}; expected (3,), finite values")
    return array
