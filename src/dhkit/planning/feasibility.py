"""Why there is no motion: said before a solver would find out, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dhkit.description import Array, Description
from dhkit.description.joint_words import joint_words, outside_words
from dhkit.errors import PlanningError
from dhkit.planning.constraints import Constraint
from dhkit.planning.goals import Place
from dhkit.planning.objectives import Objective
from dhkit.planning.states import States
from dhkit.planning.task import Task
from dhkit.trajectories import Limits, quintic, trapezoidal

BARELY = 1e-6
"""By what share of a constraint rounding may exceed it."""
EDGE = 1e-9
"""rad and m: how far outside its limits rounding may put a joint."""


def require_inside_limits(description: Description, limits: Limits, q: Array, where: str) -> None:
    """Refuse a configuration outside the joint limits.

    Raises
    ------
    PlanningError
        Names the joint and the limit.
    """
    excess = np.maximum(limits.lower - q, q - limits.upper)
    if not excess.max() > EDGE:
        return
    i = int(np.argmax(excess))
    words = outside_words(q[i], limits.lower[i], limits.upper[i], slides=bool(description.numbers.prismatic[i]))
    raise PlanningError(f"{where}: joint {description.joints[i].name} is at {words}")


def require_speed(description: Description, limits: Limits, qd: Array, where: str) -> None:
    """Refuse a velocity beyond its limit.

    Raises
    ------
    PlanningError
        Names the joint and the limit.
    """
    excess = np.abs(qd) - limits.velocity
    if not excess.max() > 0:
        return
    i = int(np.argmax(excess))
    slides = bool(description.numbers.prismatic[i])
    found, bound = (joint_words(x, slides=slides, rate="/s") for x in (abs(qd[i]), limits.velocity[i]))
    raise PlanningError(f"{where}: joint {description.joints[i].name} moves with {found}, above its limit, {bound}")


def require_holdable(description: Description, limits: Limits, q: Array, where: str) -> None:
    """Refuse a configuration in which the arm's torques do not hold it.

    Raises
    ------
    PlanningError
        Names the joint, what it takes and what it has.
    """
    if np.isinf(limits.torque).all():
        return
    still = np.zeros((1, description.n))
    g = States(description, np.zeros(1), q[None], still, still).gravity_torque[0]
    excess = np.abs(g) - limits.torque
    if not (excess > EDGE * limits.torque).any():
        return
    i = int(np.argmax(np.abs(g) / limits.torque))
    unit = "N" if description.numbers.prismatic[i] else "N m"
    raise PlanningError(
        f"{where}: joint {description.joints[i].name} cannot hold the arm there: it takes {abs(g[i]):.5g} {unit}, "
        f"its limit is {limits.torque[i]:.5g} {unit}"
    )


def require_kept(description: Description, constraints: Sequence[Constraint], T_start: Array, spot: Place) -> None:
    """Refuse a place that breaks a constraint at rest, by its configuration or its pose.

    Raises
    ------
    PlanningError
        Names the constraint.
    """
    q = np.zeros(description.n) if spot.q is None else spot.q
    still = np.zeros((1, description.n))
    states = States(description, np.zeros(1), q[None], still, still)
    if spot.T is not None:
        states = states.with_tool(spot.T[None])
    for constraint in constraints:
        use = float(constraint.measured(states, constraint.values(description, T_start)).max())
        if use > 1 + BARELY:
            raise PlanningError(f"{spot.name}: its {constraint.what} is not allowed: {constraint.told(use)}")


def require_bounded(description: Description, limits: Limits, objective: Objective, moves: Array) -> None:
    """Refuse a time-optimal motion of a joint that could jump.

    Parameters
    ----------
    moves
        Which joints have to move, shape (n,).

    Raises
    ------
    PlanningError
        Names a joint without any limit of torque, acceleration or jerk.
    """
    if not objective.has_time or not objective.only_time:
        return
    free = moves & np.isinf(limits.torque) & np.isinf(limits.acceleration) & np.isinf(limits.jerk)
    if free.any():
        name = description.joints[int(np.flatnonzero(free)[0])].name
        raise PlanningError(
            f"joint {name} has neither a torque, nor an acceleration, nor a jerk limit: in least time it would jump; "
            "give one (effort in the robot file, or limits=)"
        )


def classical(task: Task) -> tuple[tuple[str, float], ...]:
    """Return the durations of a quintic and of the best trapezoid along the straight joint path, under its limits, s.

    None for what they cannot do: with configurations on the way, other ends than rest, obstacles, or friction.
    """
    if (
        len(task.points) > 2
        or not task.rests
        or task.friction is not None
        or task.surroundings
        or task.checker.constraints
    ):
        return ()

    def torques(q: Array, qd: Array, qdd: Array) -> Array:
        return States(task.description, np.zeros(len(q)), q, qd, qdd).tau

    found = []
    for name, make in (("best trapezoid", trapezoidal), ("quintic", quintic)):
        try:
            motion = make(task.arm, task.points[0], task.points[1], limits=task.limits, torques=torques)
        except PlanningError:
            continue  # the straight way may lead through where the arm is too weak
        found.append((name, motion.duration))
    return tuple(found)
