"""The geometric Jacobian of the tool, and its rate of change."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Convention, Description, joint_array, world_to_frames
from dhkit.kinematics.batches import in_blocks

__all__ = ["ReferenceAxes", "jacobian", "jacobian_dot"]

ReferenceAxes: TypeAlias = Literal["world", "tool"]
"""Whose axes the tool's velocity is resolved in."""


def jacobian(
    description: Description,
    q: ArrayLike,
    frame: ReferenceAxes = "world",
    out: Array | None = None,
    threads: int = 1,
) -> Array:
    """Return the Jacobian of the tool: J qd = (velocity of its origin; angular velocity).

    Column i is (z x (p_tool - p); z) for a revolute joint about the axis z through p, and (z; 0) for a prismatic one
    (Siciliano et al., Robotics, 2009, eq. 3.30).

    Parameters
    ----------
    description
        The robot.
    q
        Joint values, shape (..., n), rad and m.
    frame
        ``"world"`` or ``"tool"``: the axes that both rows of three are resolved in. The point is always the tool's
        origin.
    out, threads
        As for :func:`dhkit.kinematics.forward_kinematics`.

    Returns
    -------
    Array
        Shape (..., 6, n): m/rad, m/m, rad/rad and 0. NaN where q is.

    Raises
    ------
    ValueError, TypeError
        q has not shape (..., n); another frame; ``out`` does not fit.
    """
    _check_frame(frame)
    states = (joint_array(description, q),)

    def block(q: Array) -> Array:
        axes, points, T_world_tool = _axes(description, q)
        return _in_frame(_columns(description, axes, points, T_world_tool), T_world_tool, frame)

    return in_blocks(block, states, (6, description.n), out, threads)


def jacobian_dot(
    description: Description,
    q: ArrayLike,
    qd: ArrayLike,
    frame: ReferenceAxes = "world",
    out: Array | None = None,
    threads: int = 1,
) -> Array:
    """Return the time derivative of :func:`jacobian` along a motion, so that the tool's acceleration is J qdd + Jd qd.

    Parameters
    ----------
    description
        The robot.
    q, qd
        Joint values and rates, shapes (..., n), rad, m and per second; batch axes broadcast.
    frame, out, threads
        As for :func:`jacobian`. In ``"tool"`` axes it is the derivative of the components.

    Returns
    -------
    Array
        Shape (..., 6, n), per second.

    Raises
    ------
    ValueError, TypeError
        As for :func:`jacobian`.
    """
    _check_frame(frame)
    states = joint_array(description, q), joint_array(description, qd, "qd")

    def block(q: Array, qd: Array) -> Array:
        axes, points, T_world_tool = _axes(description, q)
        J = _columns(description, axes, points, T_world_tool)
        twist = (J @ qd[..., None])[..., 0]
        J_dot = _columns_dot(description, axes, points, T_world_tool, qd, twist[..., :3])
        if frame == "tool":
            spin = twist[..., None, 3:]
            for rows in (slice(0, 3), slice(3, 6)):
                J_dot[..., rows, :] -= np.swapaxes(np.cross(spin, np.swapaxes(J[..., rows, :], -1, -2)), -1, -2)
        return _in_frame(J_dot, T_world_tool, frame)

    return in_blocks(block, states, (6, description.n), out, threads)


def _check_frame(frame: str) -> None:
    if frame not in ("world", "tool"):
        raise ValueError(f"frame is {frame!r}; expected 'world' or 'tool'")


def _axes(description: Description, q: Array) -> tuple[Array, Array, Array]:
    """Return joint axes and points on them, shapes (m, n, 3), and the tool's pose (m, 4, 4), all in the world."""
    T = world_to_frames(description, q)
    T[~np.isfinite(q).all(axis=-1)] = np.nan  # frame 0 too: no entry of such a state means anything
    T_world_tool: Array = T[..., -1, :, :] @ description.numbers.T_last_tool
    carrying = T[..., :-1, :, :] if description.convention is Convention.STANDARD else T[..., 1:, :, :]
    return carrying[..., :3, 2], carrying[..., :3, 3], T_world_tool


def _columns(description: Description, axes: Array, points: Array, T_world_tool: Array) -> Array:
    turning = ~description.numbers.prismatic[:, None]
    levers = T_world_tool[..., None, :3, 3] - points
    linear = np.where(turning, np.cross(axes, levers), axes)
    angular = axes * turning
    return np.swapaxes(np.concatenate([linear, angular], axis=-1), -1, -2)


def _columns_dot(
    description: Description, axes: Array, points: Array, T_world_tool: Array, qd: Array, tool_velocity: Array
) -> Array:
    """Differentiate each column: an axis turns, and its point moves, with the joints before it."""
    turning = ~description.numbers.prismatic[:, None]
    spins = axes * np.where(turning, qd[..., None], 0.0)
    slides = axes * np.where(turning, 0.0, qd[..., None])
    before = np.cumsum(spins, axis=-2) - spins
    # A point's velocity is the sum over the joints before of spin x (point - p_j) + slide.
    moments = np.cumsum(np.cross(points, spins) + slides, axis=-2) - np.cross(points, spins) - slides
    velocities = np.cross(before, points) + moments
    axes_dot = np.cross(before, axes)
    levers = T_world_tool[..., None, :3, 3] - points
    levers_dot = tool_velocity[..., None, :] - velocities
    linear = np.where(turning, np.cross(axes_dot, levers) + np.cross(axes, levers_dot), axes_dot)
    return np.swapaxes(np.concatenate([linear, axes_dot * turning], axis=-1), -1, -2)


def _in_frame(J: Array, T_world_tool: Array, frame: str) -> Array:
    if frame == "world":
        return J
    R_tool_world = np.swapaxes(T_world_tool[..., :3, :3], -1, -2)
    return np.concatenate([R_tool_world @ J[..., :3, :], R_tool_world @ J[..., 3:, :]], axis=-2)
