"""Random states for comparisons."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dhkit.description import Array, Description, takes_robot
from dhkit.display import counted, repr_line
from dhkit.kernels import check_whole

_DEFAULT_SPEED = 3.0
"""Largest speed of a joint without a speed limit, rad/s or m/s."""
_ACCELERATION = 10.0
"""Largest acceleration, rad/s^2 or m/s^2."""


class JointStates(NamedTuple):
    """Joint values, rates and accelerations, each of shape (samples, n), rad, m and seconds."""

    q: Array
    """Joint values, shape (samples, n), rad and m."""
    qd: Array
    """Rates, shape (samples, n), rad/s and m/s."""
    qdd: Array
    """Accelerations, shape (samples, n), rad/s^2 and m/s^2."""

    def __repr__(self) -> str:
        return repr_line(
            "JointStates", counted(len(self.q), "state"), counted(self.q.shape[-1], "joint")
        )


@takes_robot
def random_states(description: Description, samples: int, seed: int = 0) -> Array:
    """Return random joint values, shape (samples, n): full turns, and strokes inside limits (without limits 1 m).

    Parameters
    ----------
    description
        The robot.
    samples
        Number of states.
    seed
        Seed of the random numbers.

    Returns
    -------
    Array
        Shape (samples, n), rad and m.

    Raises
    ------
    ValueError
        ``samples`` is not a whole number from 1 on, or ``seed`` none from 0 on.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> random_states(library_robot("puma560"), 100).shape
    (100, 6)
    """
    check_whole("samples", samples, 1)
    check_whole("seed", seed, 0)
    numbers = description.numbers
    uses_limits = np.isfinite(numbers.lower) & np.isfinite(numbers.upper) & numbers.prismatic
    free = np.where(numbers.prismatic, 1.0, np.pi)
    lower = np.where(uses_limits, numbers.lower, -free)
    upper = np.where(uses_limits, numbers.upper, free)
    return np.random.default_rng(seed).uniform(lower, upper, (samples, description.n))


@takes_robot
def random_motions(description: Description, samples: int, seed: int = 0) -> JointStates:
    """Return random states inside the limits of position and speed, with accelerations up to 10 rad/s^2 or m/s^2.

    Joints without limits make full turns or a metre, at 3 rad/s or m/s.

    Parameters
    ----------
    description
        The robot.
    samples
        Number of states.
    seed
        Seed of the random numbers.

    Returns
    -------
    JointStates
        Fields ``q``, ``qd`` and ``qdd``, shape (samples, n), rad, m and seconds.

    Raises
    ------
    ValueError
        ``samples`` is not a whole number from 1 on, or ``seed`` none from 0 on.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> motion = random_motions(library_robot("puma560"), 100)
    >>> motion.q.shape
    (100, 6)
    """
    check_whole("samples", samples, 1)
    check_whole("seed", seed, 0)
    numbers = description.numbers
    rng = np.random.default_rng(seed)
    shape = (samples, description.n)
    limited = np.isfinite(numbers.lower) & np.isfinite(numbers.upper)
    free = np.where(numbers.prismatic, 1.0, np.pi)
    lower = np.where(limited, numbers.lower, -free)
    upper = np.where(limited, numbers.upper, free)
    rate = np.where(np.isfinite(numbers.velocity), numbers.velocity, _DEFAULT_SPEED)
    return JointStates(
        rng.uniform(lower, upper, shape),
        rng.uniform(-rate, rate, shape),
        rng.uniform(-_ACCELERATION, _ACCELERATION, shape),
    )
