"""Initial guesses: legs along straight joint paths, about as fast as the limits allow, and detours."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from dhkit.description import Array
from dhkit.planning.assembly import knots_along
from dhkit.planning.criteria import LoadedArm, States
from dhkit.planning.mesh import Mesh
from dhkit.planning.task import Task
from dhkit.planning.variables import Knots
from dhkit.trajectories import Limits, Trajectory

SAMPLES = 17
"""Number of states of a leg from which its duration is estimated."""
MIN_TORQUE_SHARE = 0.05
"""Smallest share of a torque limit assumed free for acceleration, where gravity needs nearly all of it."""
DETOUR_SHARE = 0.7
"""Largest deviation of a detour, as a share of half a joint's range."""
DETOUR_DURATION_FACTOR = 2.0
"""Factor of the duration of a detour over that of the straight path."""


def leg_durations(arm: LoadedArm, limits: Limits, points: Array) -> Array:
    """Return estimates of the durations of legs between configurations, from rest to rest, shape (legs,), s.

    Each is the least duration of a cubic, with the torques that gravity leaves at each state; 0 without limits.
    """
    return np.array([_leg(arm, limits, a, b) for a, b in pairwise(points)])


def _leg(arm: LoadedArm, limits: Limits, start: Array, goal: Array) -> float:
    step = goal - start
    x = np.linspace(0.0, 1.0, SAMPLES)[:, None]
    q, qd, qdd = start + step * x * x * (3 - 2 * x), step * 6 * x * (1 - x), step * (6 - 12 * x)
    found = [np.max(np.abs(qd) / limits.velocity), np.sqrt(np.max(np.abs(qdd) / limits.acceleration))]
    found.append(np.cbrt(np.max(12 * np.abs(step) / limits.jerk)))
    if np.isfinite(limits.torque).any():
        states = States(arm, x[:, 0], q, qd, qdd)
        room = np.maximum(limits.torque - np.abs(states.gravity_torque), MIN_TORQUE_SHARE * limits.torque)
        found.append(np.sqrt(np.max(np.abs(states.tau - states.gravity_torque) / room)))
    return float(max(found))


def straight_motion(task: Task, durations: Array) -> Trajectory:
    """Return cubics between a task's configurations, at rest in between; durations of legs (legs,), s."""
    velocities = np.zeros_like(task.points)
    velocities[0], velocities[-1] = task.start_velocity, task.goal_velocity
    return Trajectory.from_samples(task.arm, np.concatenate([[0.0], np.cumsum(durations)]), task.points, velocities)


def straight_knots(task: Task, mesh: Mesh, durations: Array) -> Knots:
    """Return :func:`straight_motion` on a mesh."""
    return knots_along(straight_motion(task, durations), mesh, np.cumsum(durations))


def usual_accelerations(task: Task, guess: Knots) -> Array:
    """Return the scales of accelerations, shape (n,), rad/s^2 and m/s^2.

    The acceleration that the torque limit gives a joint alone, or its limit of acceleration; where neither is limited,
    twice the largest of the initial guess.
    """
    limits, n = task.limits, task.arm.n
    largest = np.maximum(2 * np.abs(guess.qdd).max(axis=0), 1e-3)
    usual = np.where(np.isfinite(limits.acceleration), limits.acceleration, np.inf)
    if np.isfinite(limits.torque).any():
        q = np.tile((task.points[0] + task.points[-1]) / 2, (n, 1))
        pushed = States(task.loaded, np.zeros(n), q, np.zeros((n, n)), np.eye(n))
        inertia = np.diagonal(pushed.tau - pushed.gravity_torque)
        usual = np.minimum(usual, limits.torque / np.maximum(inertia, 1e-12))
    return np.where(np.isfinite(usual), usual, np.maximum(largest, 0.05 * largest.max()))


def detour(task: Task, mesh: Mesh, durations: Array, seed: int) -> Knots:
    """Return a guess through random configurations, one halfway along each leg; durations (legs,), s."""
    rng, limits, points = np.random.default_rng(seed), task.limits, task.points
    reach = np.where(task.arm.numbers.prismatic, max(task.arm.reach, 1e-3), np.pi)
    half = np.where(np.isfinite(limits.upper - limits.lower), (limits.upper - limits.lower) / 2, reach)
    halfway = (points[1:] + points[:-1]) / 2 + DETOUR_SHARE * half * rng.uniform(-1, 1, (len(durations), task.arm.n))
    rows = np.empty((2 * len(durations) + 1, task.arm.n))
    rows[0::2], rows[1::2] = points, np.clip(halfway, limits.lower, limits.upper)
    velocities = np.zeros_like(rows)
    velocities[0], velocities[-1] = task.start_velocity, task.goal_velocity
    times = np.concatenate(
        [[0.0], np.cumsum(np.repeat(durations * (1.0 if task.duration else DETOUR_DURATION_FACTOR) / 2, 2))]
    )
    return knots_along(Trajectory.from_samples(task.arm, times, rows, velocities), mesh, times[2::2])
