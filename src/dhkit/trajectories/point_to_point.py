"""The classical motions between two configurations: cubic, quintic, and linear with parabolic blends."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, takes_robot
from dhkit.errors import PlanningError
from dhkit.trajectories.interpolation import cubic_hermite, quintic_hermite
from dhkit.trajectories.limits import Limits
from dhkit.trajectories.slowdown import Torques, least_slowdowns, require_inside
from dhkit.trajectories.timing import check_duration, configuration, default_limits, timed
from dhkit.trajectories.trajectory import Trajectory

_USUAL_BLEND = 0.25
"""Blend, as a share of the duration, of a motion that nothing limits."""
_MIN_BLEND = 0.01
"""Smallest share of the duration for a blend: accelerations grow without bound as it goes to 0."""
_GRID = 50
"""Number of blends that are tried first."""
_FINER_GRID = 15
"""Number of blends that are tried between the neighbours of the best one."""
_REFINEMENTS = 4
"""Number of times that the best blend is refined: to 2e-6 of the duration."""


@takes_robot
def cubic(
    description: Description,
    q0: ArrayLike,
    q1: ArrayLike,
    duration: float | None = None,
    qd0: ArrayLike | None = None,
    qd1: ArrayLike | None = None,
    limits: Limits | None = None,
    torques: Torques | None = None,
) -> Trajectory:
    """Return the cubic polynomials of time that meet values and rates at both ends.

    Craig 2005, Introduction to Robotics, section 7.3.

    Parameters
    ----------
    description
        The robot.
    q0, q1
        Start and goal, shape (n,), rad and m.
    duration
        Duration, s; None for the shortest from rest to rest that the limits allow.
    qd0, qd1
        Rates at both ends, shape (n,), rad/s and m/s; 0 if not given.
    limits
        The robot's own if not given, without those of torque where a link has no body; a given duration is then held
        against the joints' ranges alone.
    torques
        As for :func:`dhkit.trajectories.least_slowdown`.

    Returns
    -------
    Trajectory
        The motion.

    Raises
    ------
    ValueError
        Other shapes, values that are not finite, or rates without a duration.
    PlanningError
        A joint leaves its limits on the way, the duration is too short for the limits given, or no duration keeps them.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> motion = cubic(library_robot("planar2r"), [0, 0], [0.5, 1.0], duration=2.0)
    >>> motion.q(1.0), motion.qd(1.0)
    (array([0.25, 0.5 ]), array([0.375, 0.75 ]))
    """
    q = np.stack([configuration(description, q0, "q0"), configuration(description, q1, "q1")])
    ends = (qd0, qd1)
    T = _unit(duration, ends)
    qd = np.stack([configuration(description, qd0, "qd0"), configuration(description, qd1, "qd1")])
    times = np.array([0.0, T])
    return timed(
        Trajectory(description, times, cubic_hermite(times, q, qd)), duration, limits, torques
    )


@takes_robot
def quintic(
    description: Description,
    q0: ArrayLike,
    q1: ArrayLike,
    duration: float | None = None,
    qd0: ArrayLike | None = None,
    qd1: ArrayLike | None = None,
    qdd0: ArrayLike | None = None,
    qdd1: ArrayLike | None = None,
    limits: Limits | None = None,
    torques: Torques | None = None,
) -> Trajectory:
    """Return the quintic polynomials of time that meet values, rates and accelerations at both ends.

    Parameters
    ----------
    description, q0, q1, duration, qd0, qd1, limits, torques
        As for :func:`cubic`.
    qdd0, qdd1
        Accelerations at both ends, shape (n,), per second squared; 0 if not given.

    Returns
    -------
    Trajectory
        The motion.

    Raises
    ------
    ValueError, PlanningError
        As for :func:`cubic`.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> motion = quintic(library_robot("planar2r"), [0, 0], [0.5, 1.0], duration=2.0)
    >>> motion.q(1.0), motion.qdd(2.0).round(9)
    (array([0.25, 0.5 ]), array([0., 0.]))
    """
    q = np.stack([configuration(description, q0, "q0"), configuration(description, q1, "q1")])
    T = _unit(duration, (qd0, qd1, qdd0, qdd1))
    qd = np.stack([configuration(description, qd0, "qd0"), configuration(description, qd1, "qd1")])
    qdd = np.stack(
        [configuration(description, qdd0, "qdd0"), configuration(description, qdd1, "qdd1")]
    )
    times = np.array([0.0, T])
    return timed(
        Trajectory(description, times, quintic_hermite(times, q, qd, qdd)),
        duration,
        limits,
        torques,
    )


@takes_robot
def trapezoidal(
    description: Description,
    q0: ArrayLike,
    q1: ArrayLike,
    duration: float | None = None,
    blend: float | None = None,
    limits: Limits | None = None,
    torques: Torques | None = None,
) -> Trajectory:
    """Return a motion of trapezoidal velocity: all joints together along the straight line between two configurations.

    Linear with parabolic blends (Craig 2005, section 7.3; Spong, Hutchinson and Vidyasagar 2006, section 5.5.3).

    Parameters
    ----------
    description, q0, q1, duration, limits, torques
        As for :func:`cubic`.
    blend
        Share of the duration for accelerating, and again for braking, in (0, 0.5]; None for the one with the shortest
        duration that the limits allow, and for 0.25 where nothing limits a motion whose duration is given.

    Returns
    -------
    Trajectory
        The motion.

    Raises
    ------
    ValueError
        Other shapes, values that are not finite, or another blend.
    PlanningError
        As for :func:`cubic`.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> motion = trapezoidal(arm, [0, 0], [0.6, 0.3], limits=Limits.of(arm, velocity=1, acceleration=5, torque=np.inf))
    >>> round(motion.duration, 4)  # 0.6 / 1 + 1 / 5
    0.8
    """
    check_duration(duration)
    start = configuration(description, q0, "q0")
    goal = configuration(description, q1, "q1")
    if blend is not None and not 0 < blend <= 0.5:
        raise ValueError(f"blend is {blend!r}; expected more than 0 and at most 0.5")
    if blend is None:
        bounds = limits or default_limits(description)
        require_inside(_blended(description, start, goal, 0.5), bounds)
        blend = _chosen_blend(description, start, goal, bounds, torques, duration)
    return timed(_blended(description, start, goal, blend), duration, limits, torques)


def _unit(duration: float | None, ends: tuple[ArrayLike | None, ...]) -> float:
    """Return the duration for which the polynomial is made first; rates and accelerations need the final one."""
    check_duration(duration)
    if duration is None and any(np.any(np.asarray(end)) for end in ends if end is not None):
        raise ValueError(
            "rates or accelerations at the ends are given, but no duration; expected a duration"
        )
    return 1.0 if duration is None else duration


def _blended(description: Description, q0: Array, q1: Array, blend: float) -> Trajectory:
    """Return the motion over one second with blends of ``blend`` seconds."""
    # Acceleration v / b for b seconds, velocity v, acceleration -v / b for b seconds: v (1 - b) = q1 - q0. With u the
    # time since the beginning of each piece,
    #     q = q0 + v / (2 b) u^2,    q = q0 + v b / 2 + v u,    q = q1 - v b / 2 + v u - v / (2 b) u^2.
    v = (q1 - q0) / (1 - blend)
    zero = np.zeros_like(v)
    speed_up = np.stack([q0, zero, v / (2 * blend)])
    cruise = np.stack([q0 + v * blend / 2, v, zero])
    brake = np.stack([q1 - v * blend / 2, v, -v / (2 * blend)])
    if blend == 0.5:
        return Trajectory(description, np.array([0.0, 0.5, 1.0]), np.stack([speed_up, brake]))
    return Trajectory(
        description, np.array([0.0, blend, 1 - blend, 1.0]), np.stack([speed_up, cruise, brake])
    )


def _chosen_blend(
    description: Description,
    q0: Array,
    q1: Array,
    limits: Limits,
    torques: Torques | None,
    duration: float | None,
) -> float:
    """Return the best blend, and a usual one where there is no best."""
    if not (q0 != q1).any():
        return 0.5
    try:
        return _best_blend(description, q0, q1, limits, torques)
    except PlanningError:  # nothing limits the motion
        if duration is None:
            raise
        return _USUAL_BLEND


def _best_blend(
    description: Description, q0: Array, q1: Array, limits: Limits, torques: Torques | None
) -> float:
    """Return the blend, as a share of the duration, with the shortest duration that the limits allow."""
    # The duration may have several minima in the blend: a grid is searched before one is refined.
    low = _MIN_BLEND
    high = 0.5
    count = _GRID
    for _ in range(_REFINEMENTS + 1):
        blends = np.linspace(low, high, count)
        motions = [_blended(description, q0, q1, float(blend)) for blend in blends]
        best = int(np.argmin(least_slowdowns(motions, limits, torques)))
        low = blends[max(best - 1, 0)]
        high = blends[min(best + 1, count - 1)]
        count = _FINER_GRID
    return float(blends[best])
