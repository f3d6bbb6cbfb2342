"""Checked arguments of a planning request."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, Payload, joint_array
from dhkit.planning.certificate import CollisionAvoidance
from dhkit.planning.criteria import Constraint, LoadedArm, loaded, require_value
from dhkit.symbolic import Friction
from dhkit.trajectories import Limits


@dataclass(frozen=True, eq=False)
class PlanRequest:
    """Arguments of a planning request that do not depend on the route."""

    limits: Limits
    duration: float | None
    start_velocity: Array
    goal_velocity: Array
    payload: Payload | None
    avoidance: CollisionAvoidance

    def loaded(self, description: Description) -> LoadedArm:
        """Return the arm with its payload."""
        return loaded(description, self.payload)

    def rests_at(self, name: str) -> bool:
        """Whether the arm is at rest at a place, given by its name."""
        return not {"start": self.start_velocity, "goal": self.goal_velocity}.get(
            name, np.ones(1)
        ).any()


def require_limits(limits: object) -> None:
    """Require limits of joints, or None.

    Raises
    ------
    TypeError
        Something else.
    """
    if limits is not None and not isinstance(limits, Limits):
        raise TypeError(
            f"limits is {limits!r}; expected Limits.of(description, velocity=...) and the like"
        )


def checked_limits(description: Description, limits: Limits | None) -> Limits:
    """Return the given limits, or the robot's own if none are given.

    Raises
    ------
    ValueError
        Limits of another number of joints.
    TypeError
        Something else.
    """
    require_limits(limits)
    if limits is None:
        return Limits.of(description)
    if len(limits.lower) != description.n:
        raise ValueError(
            f"limits are of {len(limits.lower)} joints; {description.name} has {description.n}"
        )
    return limits


def end_velocity(description: Description, value: ArrayLike | None, name: str) -> Array:
    """Return joint rates at an end, shape (n,), rad/s and m/s; zero if none are given.

    Raises
    ------
    ValueError, TypeError
        Another shape, or values that are not finite numbers.
    """
    if value is None:
        return np.zeros(description.n)
    qd = joint_array(description, value, f"{name}_velocity")
    if qd.shape != (description.n,) or not np.isfinite(qd).all():
        raise ValueError(f"{name}_velocity: expected finite numbers, shape ({description.n},)")
    return qd


def checked_constraints(constraints: Constraint | Sequence[Constraint]) -> tuple[Constraint, ...]:
    """Return constraints as a tuple.

    Raises
    ------
    TypeError
        Something else, or a class that is not a frozen dataclass.
    """
    given = (constraints,) if isinstance(constraints, Constraint) else tuple(constraints)
    for constraint in given:
        if not isinstance(constraint, Constraint):
            raise TypeError(f"constraints has {constraint!r}; expected ToolSpeed(...) and the like")
        require_value(constraint)
    return given


SMOOTH_FRICTION = Friction(width=1e-2)
"""Friction that replaces one with a step at rest: it is smooth over a width of 0.01 rad/s or m/s."""


def smoothed(friction: Friction | None) -> Friction | None:
    """Return friction that an optimizer can derive."""
    return SMOOTH_FRICTION if friction is not None and friction.width == 0 else friction
