"""The duration of a motion: a given one, or the shortest that its limits allow."""

from __future__ import annotations

from dataclasses import replace
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, joint_array
from dhkit.errors import PlanningError
from dhkit.trajectories.limits import Limits
from dhkit.trajectories.slowdown import Torques, least_slowdown, require_inside
from dhkit.trajectories.trajectory import Trajectory

_MIN_DURATION = 1e-6
"""Smallest duration, s; shorter ones are typing errors, and their powers leave the range of doubles."""
_MAX_DURATION = 1e6
"""Largest duration, s, for the same reasons."""
_DURATION_SLACK = 1e-9
"""Share by which rounding may make a duration shorter than the limits allow."""


def timed(
    shape: Trajectory, duration: float | None, limits: Limits | None, torques: Torques | None
) -> Trajectory:
    """Return a motion over another duration.

    Parameters
    ----------
    shape
        The motion, over any duration.
    duration
        Duration, s; None for the shortest that the limits allow.
    limits
        The limits; the robot's own if not given. A given duration is checked against given limits only.
    torques
        As for :func:`dhkit.trajectories.least_slowdown`.

    Raises
    ------
    ValueError
        A duration that is not positive, or none for a motion that stands still.
    PlanningError
        A joint leaves its limits, the duration is shorter than the limits allow, or no duration keeps them.
    """
    check_duration(duration)
    own = limits or default_limits(shape.description)
    require_inside(shape, own)
    if duration is not None and limits is None:
        return shape.slowed(duration / shape.duration)
    c = least_slowdown(shape, own, torques, may_be_unlimited=duration is not None)
    if duration is None:
        if c == 0:
            raise ValueError("the motion ends where it begins; expected a duration")
        return shape.slowed(c)

    # The motion in the given time is duration / shape.duration times as slow as the shape, and may not be less than c.
    if c * shape.duration > duration * (1 + _DURATION_SLACK):
        raise PlanningError(
            f"{duration:.6g} s are too short: the limits allow the motion in {c * shape.duration:.6g} s"
        )
    return shape.slowed(duration / shape.duration)


def default_limits(description: Description) -> Limits:
    """Return a robot's own limits; torques are limited only if every link has a body, so that they are known."""
    limits = Limits.of(description)
    if np.isfinite(description.numbers.mass).all():
        return limits
    return replace(limits, torque=np.full(description.n, np.inf))


def check_duration(duration: float | None) -> None:
    """Check that a duration is from 1e-6 to 1e6 s.

    Raises
    ------
    ValueError
        It is not.
    """
    if duration is None:
        return
    if not isinstance(duration, Real) or not _MIN_DURATION <= duration <= _MAX_DURATION:
        raise ValueError(
            f"duration is {duration!r}; expected {_MIN_DURATION:g} to {_MAX_DURATION:g} s"
        )


def configuration(description: Description, value: ArrayLike | None, name: str) -> Array:
    """Return joint values, shape (n,), rad and m; zeros for None.

    Raises
    ------
    ValueError
        Another shape, or values that are not finite.
    """
    array = np.zeros(description.n) if value is None else joint_array(description, value, name)
    if array.shape != (description.n,):
        raise ValueError(f"{name} has shape {array.shape}; expected ({description.n},)")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} is {array.tolist()}; expected finite values")
    return array
