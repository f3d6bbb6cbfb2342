"""Motions of the tool along a straight line and a circle."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Description, takes_robot
from dhkit.trajectories.following import joint_path
from dhkit.trajectories.limits import Limits
from dhkit.trajectories.paths import quintic_law
from dhkit.trajectories.slowdown import Torques
from dhkit.trajectories.timing import check_duration, timed
from dhkit.trajectories.tool_paths import ToolPath, tool_circle, tool_line
from dhkit.trajectories.trajectory import Trajectory


@takes_robot
def straight_line(
    description: Description,
    T0: ArrayLike,
    T1: ArrayLike,
    q0: ArrayLike | None = None,
    duration: float | None = None,
    limits: Limits | None = None,
    torques: Torques | None = None,
) -> Trajectory:
    """Return the motion of the tool along the straight line between two poses, its orientation turning evenly.

    The time law is s(t) = 10 t^3 - 15 t^4 + 6 t^5: velocity and acceleration begin and end with 0.

    Parameters
    ----------
    description
        The robot.
    T0, T1
        Poses of the tool in the world, shape (4, 4).
    q0
        Joint values near which it begins, shape (n,), rad and m; see :func:`dhkit.trajectories.joint_path`.
    duration, limits, torques
        As for :func:`dhkit.trajectories.cubic`.

    Returns
    -------
    Trajectory
        The motion.

    Raises
    ------
    ValueError
        Other shapes, matrices that are not poses, or a duration that is not positive.
    PlanningError
        The arm cannot follow: the workspace, a singularity or a joint limit is in the way; or as for
        :func:`dhkit.trajectories.cubic`.

    Examples
    --------
    >>> from dhkit.description import library_robot, world_to_tool
    >>> arm = library_robot("planar2r")
    >>> T0, T1 = world_to_tool(arm, [[0.2, 1.2], [0.8, 1.0]])
    >>> motion = straight_line(arm, T0, T1, q0=[0.2, 1.2], duration=1.0)
    >>> middle = world_to_tool(arm, motion.q(0.5))[:3, 3]
    >>> bool(abs(middle - (T0[:3, 3] + T1[:3, 3]) / 2).max() < 1e-7)
    True
    """
    return _along(description, tool_line(T0, T1), q0, duration, limits, torques)


@takes_robot
def circle(
    description: Description,
    T0: ArrayLike,
    centre: ArrayLike,
    axis: ArrayLike,
    angle: float = 2 * np.pi,
    q0: ArrayLike | None = None,
    duration: float | None = None,
    limits: Limits | None = None,
    turning: bool = False,
    torques: Torques | None = None,
) -> Trajectory:
    """Return the motion of the tool along a circle or an arc, with the time law of :func:`straight_line`.

    Parameters
    ----------
    description
        The robot.
    T0
        The first pose, shape (4, 4), in the world.
    centre, axis, angle, turning
        As for :func:`dhkit.trajectories.tool_circle`.
    q0, duration, limits, torques
        As for :func:`straight_line`.

    Returns
    -------
    Trajectory
        The motion.

    Raises
    ------
    ValueError, PlanningError
        As for :func:`straight_line`.

    Examples
    --------
    >>> from dhkit.description import library_robot, world_to_tool
    >>> arm = library_robot("planar3r")
    >>> T0 = world_to_tool(arm, [0.3, 0.6, 0.4])
    >>> motion = circle(arm, T0, T0[:3, 3] - [0.1, 0, 0], [0, 0, 1], angle=3.0, q0=[0.3, 0.6, 0.4], duration=2.0)
    >>> motion.duration
    2.0
    """
    return _along(
        description, tool_circle(T0, centre, axis, angle, turning), q0, duration, limits, torques
    )


def _along(
    description: Description,
    tool: ToolPath,
    q0: ArrayLike | None,
    duration: float | None,
    limits: Limits | None,
    torques: Torques | None,
) -> Trajectory:
    check_duration(duration)
    path = joint_path(description, tool, q0, limits)
    return timed(path.timed(*quintic_law()), duration, limits, torques)
