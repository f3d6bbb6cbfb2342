"""What a motion is to be like, as it is asked for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, Payload, joint_array
from dhkit.planning.clear import Surroundings
from dhkit.trajectories import Limits


@dataclass(frozen=True, eq=False)
class Wish:
    """What a motion is to be like, whatever its way."""

    limits: Limits
    duration: float | None
    start_velocity: Array
    goal_velocity: Array
    payload: Payload | None
    surroundings: Surroundings

    def loaded(self, description: Description) -> Description:
        """Return an arm with what it is to carry."""
        return self.payload.carried(description) if self.payload else description

    def rests_at(self, name: str) -> bool:
        """Whether the arm stands still at a place."""
        return not {"start": self.start_velocity, "goal": self.goal_velocity}.get(name, np.ones(1)).any()


def checked_limits(description: Description, limits: Limits | None) -> Limits:
    """Return limits, a robot's own where none are given.

    Raises
    ------
    ValueError
        Limits of another number of joints.
    TypeError
        Something else.
    """
    if limits is None:
        return Limits.of(description)
    if not isinstance(limits, Limits):
        raise TypeError(f"limits is {limits!r}; expected Limits.of(description, velocity=...) and the like")
    if len(limits.lower) != description.n:
        raise ValueError(f"limits are of {len(limits.lower)} joints; {description.name} has {description.n}")
    return limits


def end_velocity(description: Description, value: ArrayLike | None, name: str) -> Array:
    """Return a velocity (n,), zero where none is given.

    Raises
    ------
    ValueError, TypeError
        Another shape, numbers that are not finite, or no numbers.
    """
    if value is None:
        return np.zeros(description.n)
    qd = joint_array(description, value, f"{name}_velocity")
    if qd.shape != (description.n,) or not np.isfinite(qd).all():
        raise ValueError(f"{name}_velocity: expected finite numbers, shape ({description.n},)")
    return qd
