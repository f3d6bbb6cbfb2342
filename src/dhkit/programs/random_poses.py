"""Random states of an arm: any, regular and singular ones; and poses that it cannot reach."""

from __future__ import annotations

from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array
from dhkit.kinematics import singular_values

REGULAR = 1e-2
"""Smallest over largest singular value of the Jacobian, from which a state is regular."""
SINGULAR = 1e-9
"""The same, below which it is singular."""
ATTEMPTS = 50
"""Random states that are tried for each one wanted."""


def random_states(arm: Arm, rng: np.random.Generator, count: int) -> Array:
    """Return random joint values inside the limits, shape (count, n)."""
    numbers = arm.description.numbers
    free = np.where(numbers.prismatic, arm.description.reach or 1.0, np.pi)
    lower = np.where(np.isfinite(numbers.lower), numbers.lower, -free)
    upper = np.where(np.isfinite(numbers.upper), numbers.upper, free)
    values: Array = rng.uniform(lower, upper, (count, arm.n))
    return values


def _share(arm: Arm, q: Array) -> float:
    """Return the smallest over the largest singular value of the Jacobian."""
    sigma = singular_values(arm.description, q, "whole")
    return float(sigma[min(arm.n, 6) - 1] / sigma[0]) if sigma[0] > 0 else 0.0


def regular_states(arm: Arm, rng: np.random.Generator, count: int) -> Array:
    """Return random joint values inside the limits, away from singular ones, shape (count, n)."""
    found: list[Array] = []
    for q in random_states(arm, rng, ATTEMPTS * count):
        if len(found) == count:
            break
        if _share(arm, q) > REGULAR:
            found.append(q)
    return np.array(found) if found else random_states(arm, rng, count)


def singular_states(arm: Arm, rng: np.random.Generator, count: int) -> Array:
    """Return singular joint values of a six-joint arm, shape (at most count, n).

    They are roots of the Jacobian's determinant along single joints.
    """
    from scipy.optimize import brentq

    if arm.n != 6:
        return np.zeros((0, arm.n))
    numbers = arm.description.numbers
    found: list[Array] = []
    for q in random_states(arm, rng, 4 * count):
        if len(found) == count:
            break
        i = int(rng.integers(1, arm.n - 1))
        low, high = _range(numbers, i)
        grid = np.linspace(low, high, 41)

        def determinant(x: float, q: Array = q, i: int = i) -> float:
            moved = q.copy()
            moved[i] = x
            return float(np.linalg.det(arm.jacobian(moved)))

        values = [determinant(x) for x in grid]
        roots = [k for k in range(40) if values[k] * values[k + 1] < 0]
        if roots:
            k = roots[int(rng.integers(len(roots)))]
            q[i] = brentq(determinant, grid[k], grid[k + 1], xtol=1e-15)
            if _share(arm, q) < SINGULAR:
                found.append(q)
    return np.array(found).reshape(-1, arm.n)


def _range(numbers: Any, i: int) -> tuple[float, float]:
    """Return between which values a joint is searched."""
    free = 1.0 if numbers.prismatic[i] else np.pi
    low, high = numbers.lower[i], numbers.upper[i]
    return (low if np.isfinite(low) else -free), (high if np.isfinite(high) else free)


def poses_out_of_reach(arm: Arm, rng: np.random.Generator, count: int) -> Array:
    """Return poses beyond the arm's reach, shape (count, 4, 4); none of an arm with a slide without limits."""
    numbers = arm.description.numbers
    if (numbers.prismatic & ~(np.isfinite(numbers.lower) & np.isfinite(numbers.upper))).any():
        return np.zeros((0, 4, 4))
    poses: Array = arm.fk(random_states(arm, rng, count))
    base = numbers.T_world_base[:3, 3]
    away = poses[:, :3, 3] - base
    length = np.linalg.norm(away, axis=1, keepdims=True)
    away = np.where(length > 1e-9, away / np.maximum(length, 1e-9), [1.0, 0.0, 0.0])
    farthest = arm.description.reach + float(np.linalg.norm(numbers.T_last_tool[:3, 3]))
    poses[:, :3, 3] = base + away * rng.uniform(2.0, 3.0, (count, 1)) * (farthest or 1.0)
    return poses
