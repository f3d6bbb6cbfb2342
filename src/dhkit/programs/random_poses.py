"""Random states of an arm, any, regular or singular ones, and random poses that it cannot reach."""

from __future__ import annotations

from itertools import islice

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array
from dhkit.kinematics import singular_values

_MIN_REGULAR_RATIO = 1e-2
"""Smallest over largest singular value of the Jacobian, above which a state is regular."""
_MAX_SINGULAR_RATIO = 1e-9
"""The same ratio, below which a state is singular."""
_TRIES = 50
"""Random states that are tried for each regular one."""


def random_states(arm: Arm, rng: np.random.Generator, count: int) -> Array:
    """Return random joint values inside the limits, shape (count, n), rad and m.

    Parameters
    ----------
    arm
        The arm; a joint without limits makes a full turn, or the arm's reach to both sides.
    rng
        Generator of the random numbers.
    count
        Number of states.

    Returns
    -------
    Array
        Shape (count, n), rad and m.

    Examples
    --------
    >>> import numpy as np
    >>> from dhkit import Arm
    >>> random_states(Arm.load("puma560"), np.random.default_rng(0), 5).shape
    (5, 6)
    """
    numbers = arm.description.numbers
    free = np.where(numbers.prismatic, arm.description.reach or 1.0, np.pi)
    lower = np.where(np.isfinite(numbers.lower), numbers.lower, -free)
    upper = np.where(np.isfinite(numbers.upper), numbers.upper, free)
    return rng.uniform(lower, upper, (count, arm.n))


def _singular_value_ratio(arm: Arm, q: Array) -> float:
    """Return the smallest over the largest singular value of the Jacobian."""
    sigma = singular_values(arm.description, q, "whole")
    return float(sigma[min(arm.n, 6) - 1] / sigma[0]) if sigma[0] > 0 else 0.0


def regular_states(arm: Arm, rng: np.random.Generator, count: int) -> Array:
    """Return random joint values inside the limits, away from singular ones, shape (count, n), rad and m."""
    states = random_states(arm, rng, _TRIES * count)
    regular = list(
        islice((q for q in states if _singular_value_ratio(arm, q) > _MIN_REGULAR_RATIO), count)
    )
    return np.array(regular) if regular else random_states(arm, rng, count)


def singular_states(arm: Arm, rng: np.random.Generator, count: int) -> Array:
    """Return singular joint values of a six-joint arm, shape (at most count, n), rad and m; none of other arms.

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
        free = 1.0 if numbers.prismatic[i] else np.pi
        low = numbers.lower[i] if np.isfinite(numbers.lower[i]) else -free
        high = numbers.upper[i] if np.isfinite(numbers.upper[i]) else free
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
            if _singular_value_ratio(arm, q) < _MAX_SINGULAR_RATIO:
                found.append(q)
    return np.array(found).reshape(-1, arm.n)


def poses_out_of_reach(arm: Arm, rng: np.random.Generator, count: int) -> Array:
    """Return poses beyond the arm's reach, shape (count, 4, 4), m, world; none if a slide has no limits."""
    numbers = arm.description.numbers
    if (numbers.prismatic & ~(np.isfinite(numbers.lower) & np.isfinite(numbers.upper))).any():
        return np.zeros((0, 4, 4))
    poses: Array = arm.fk(random_states(arm, rng, count))
    base = numbers.T_world_base[:3, 3]
    direction = poses[:, :3, 3] - base
    length = np.linalg.norm(direction, axis=1, keepdims=True)
    direction = np.where(length > 1e-9, direction / np.maximum(length, 1e-9), [1.0, 0.0, 0.0])
    farthest = arm.description.reach + float(np.linalg.norm(numbers.T_last_tool[:3, 3]))
    poses[:, :3, 3] = base + direction * rng.uniform(2.0, 3.0, (count, 1)) * (farthest or 1.0)
    return poses
