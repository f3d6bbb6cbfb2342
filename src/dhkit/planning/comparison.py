"""What a motion is worth: beside classical ones, and on a coarser mesh."""

from __future__ import annotations

import time

import numpy as np

from dhkit.description import Array
from dhkit.errors import PlanningError
from dhkit.planning.search import Search
from dhkit.planning.states import States
from dhkit.planning.task import Task
from dhkit.trajectories import Trajectory, quintic, trapezoidal


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


def coarser(search: Search, motion: Trajectory) -> tuple[int, float] | None:
    """Return the intervals of a coarser program and a motion's cost on it; nothing where the time is over."""
    if time.perf_counter() > search.deadline:
        return None
    try:
        found = search(motion)
    except PlanningError:
        return None
    return len(found.trajectory.breaks) - 1, found.cost
