"""Instants of a motion, and its derivatives there.

An instant is a row (k, s): the piece k of the motion, and the time s since the piece began, s. Where two pieces meet
each has an instant of its own.
"""

from __future__ import annotations

import math

import numpy as np

from dhkit.description import Array
from dhkit.trajectories import Trajectory

MIN_STATES = 33
"""Smallest number of instants in a piece of a motion."""
MAX_STATES = 5001
"""Largest number of instants in a piece of a motion."""


def dense(motion: Trajectory, turn: float) -> Array:
    """Return instants between which a joint turns by about ``turn`` at most, shape (N, 2), both ends of each piece.

    Parameters
    ----------
    motion
        The motion.
    turn
        Largest turn of a joint between two instants, rad; m for prismatic joints.
    """
    found = []
    for k, duration in enumerate(np.diff(motion.breaks)):
        at = _row_of_instants(k, duration, MIN_STATES)
        travel = np.abs(np.diff(derivative(motion, at, 0), axis=0)).sum(axis=0).max()
        # Twice as many as at constant speed: a quintic is 1.9 times as fast as its mean.
        count = int(np.clip(2 * travel / turn, MIN_STATES, MAX_STATES))
        found.append(_row_of_instants(k, duration, count))
    return np.concatenate(found)


def _row_of_instants(k: int, duration: float, count: int) -> Array:
    return np.column_stack([np.full(count, float(k)), np.linspace(0.0, duration, count)])


def time_of(motion: Trajectory, instant: Array) -> float:
    """Return the time of an instant since the beginning of the motion, s."""
    return float(motion.breaks[int(instant[0])] + instant[1])


def derivative(motion: Trajectory, instants: Array, order: int) -> Array:
    """Return a derivative of q(s) = sum_j c_j s^j at instants (N, 2), shape (N, n), in rad and m over s^order.

    Each of its terms is j! / (j - order)! c_j s^(j - order).
    """
    pieces = instants[:, 0].astype(int)
    s = instants[:, 1]
    coefficients: Array = motion.coefficients
    total = np.zeros((len(instants), coefficients.shape[2]))
    for j in range(order, coefficients.shape[1]):
        factor = math.perm(j, order) * s ** (j - order)
        total += factor[:, None] * coefficients[pieces, j]
    return total
