"""How long a motion takes: as long as is asked for, or as its limits demand."""

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

SHORTEST, LONGEST = 1e-6, 1e6
"""s: durations beyond these are slips, and their powers leave the range of doubles."""
SLACK = 1e-9
"""By what share a duration may be shorter than its limits demand: rounding."""


def timed(shape: Trajectory, duration: float | None, limits: Limits | None, torques: Torques | None) -> Trajectory:
    """Return a motion over another duration.

    Parameters
    ----------
    shape
        The motion, over any duration.
    duration
        In s; None for the shortest that the limits allow.
    limits
        The robot's own if not given, which a given duration is not held against.
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
    c = least_slowdown(shape, own, torques)
    if duration is None:
        if c == 0:
            raise ValueError("the motion ends where it begins; expected a duration")
        return shape.slowed(c)
    if c * shape.duration > duration * (1 + SLACK):
        raise PlanningError(
            f"{duration:.6g} s are too short: the limits allow the motion in {c * shape.duration:.6g} s"
        )
    return shape.slowed(duration / shape.duration)


def default_limits(description: Description) -> Limits:
    """Return a robot's own limits; those of torque only where every link has a body, so that torques are known."""
    limits = Limits.of(description)
    if np.isfinite(description.numbers.mass).all():
        return limits
    return replace(limits, torque=np.full(description.n, np.inf))


def check_duration(duration: float | None) -> None:
    """Refuse a duration that is not positive, or too long for what is computed with it.

    Raises
    ------
    ValueError
        Not a number from 1e-6 to 1e6 s.
    """
    if duration is None:
        return
    if not isinstance(duration, Real) or not SHORTEST <= duration <= LONGEST:
        raise ValueError(f"duration is {duration!r}; expected {SHORTEST:g} to {LONGEST:g} s")


def configuration(description: Description, value: ArrayLike | None, name: str) -> Array:
    """Return a joint vector, shape (n,), 0 for None.

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
