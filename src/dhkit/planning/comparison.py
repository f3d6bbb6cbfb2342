"""What a motion is worth: beside classical ones, and on a coarser mesh."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from dhkit.description import Array
from dhkit.errors import PlanningError
from dhkit.planning.search import Search
from dhkit.planning.states import States
from dhkit.planning.task import Task
from dhkit.trajectories import Trajectory, quintic, trapezoidal

if TYPE_CHECKING:
    from dhkit.planning.planner import Planner

__all__ = ["classical", "coarser"]


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


def coarser(planner: Planner, task: Task, motion: Trajectory, deadline: float) -> tuple[int, float] | None:
    """Return a mesh of half as many intervals and the cost on it; nothing where the time is over."""
    usual = planner.intervals_for(task)
    intervals = max(6, usual // 2)
    if time.perf_counter() > deadline or intervals == usual:
        return None
    try:
        program, made = planner.program(task, intervals)
        found = Search(task, program, deadline + made)(motion)
    except PlanningError:
        return None
    return len(found.trajectory.breaks) - 1, found.cost
