"""A cubic spline through configurations, from rest to rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, joint_array, takes_robot
from dhkit.trajectories.interpolation import check_times
from dhkit.trajectories.limits import Limits
from dhkit.trajectories.slowdown import Torques
from dhkit.trajectories.timing import default_limits, timed
from dhkit.trajectories.trajectory import Trajectory


@takes_robot
def spline(
    description: Description,
    points: ArrayLike,
    times: ArrayLike | None = None,
    limits: Limits | None = None,
    torques: Torques | None = None,
) -> Trajectory:
    """Return the cubic spline through configurations, at rest at both ends, with continuous accelerations between.

    Craig 2005, Introduction to Robotics, section 7.3 (clamped).

    Parameters
    ----------
    description
        The robot.
    points
        Shape (m, n), m >= 2, rad and m.
    times
        Times of the points, shape (m,), s, increasing; the motion begins with the first, which becomes 0. If not given,
        intervals are in proportion to their times at the joints' velocity limits (for a joint without one, to its
        distance), and as short together as the limits allow.
    limits, torques
        As for :func:`dhkit.trajectories.cubic`.

    Returns
    -------
    Trajectory
        The motion.

    Raises
    ------
    ValueError
        Other shapes, values that are not finite, times that do not increase, or, without times, a point that is the
        same as the one before.
    PlanningError
        A joint leaves its limits, also between points; the times are too short for the limits given; or no duration
        keeps them.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> motion = spline(library_robot("planar2r"), [[0, 0], [0.5, 0.2], [1.0, 1.0]], times=[0, 1, 2])
    >>> motion.q(1.0), motion.qd(2.0).round(9)
    (array([0.5, 0.2]), array([0., 0.]))
    """
    from scipy.interpolate import CubicSpline

    q = joint_array(description, points, "points")
    if q.ndim != 2 or len(q) < 2:
        raise ValueError(f"points has shape {q.shape}; expected (m, {description.n}) with m >= 2")
    if not np.isfinite(q).all():
        raise ValueError(f"points[{int(np.argwhere(~np.isfinite(q))[0, 0])}] is not finite")
    if times is None:
        t = _spaced(q, limits or default_limits(description))
        duration = None
    else:
        t = check_times(times)
        if len(t) != len(q):
            raise ValueError(f"times has shape {t.shape}; expected ({len(q)},), one for each point")
        t = t - t[0]
        duration = float(t[-1])
    curve = CubicSpline(t, q, bc_type="clamped")
    return timed(
        Trajectory(description, t, np.moveaxis(curve.c[::-1], 0, 1)), duration, limits, torques
    )


def _spaced(q: Array, limits: Limits) -> Array:
    """Return times of points (m, n), from 0, shape (m,)."""
    # The interval between two points lasts as long as its slowest joint needs: max_i |q_i(k+1) - q_i(k)| / velocity_i.
    ways = np.abs(np.diff(q, axis=0))
    seconds = (ways / np.where(np.isfinite(limits.velocity), limits.velocity, 1.0)).max(axis=1)
    if (seconds == 0).any():
        k = int(np.flatnonzero(seconds == 0)[0])
        raise ValueError(f"points[{k + 1}] is the same as points[{k}]; expected another, or times")
    return np.concatenate([[0.0], np.cumsum(seconds)])
