"""Grid along a path: finer where the arm has to move slowly, with knots where the path's curvature jumps."""

from __future__ import annotations

import numpy as np

from dhkit.description import Array
from dhkit.trajectories import JointPath

JUMP_ROUNDING = 1e-6
"""Jump of a derivative, relative to its largest value, that counts as rounding."""
EVEN_SHARE, MIN_TIME = 0.3, 1e-12
"""Share of knots with even spacing, and the shortest time of an interval, s."""


def jumps(path: JointPath, order: int) -> Array:
    """Return the jumps of a derivative by s at the inner breaks, shape (K-1, n), rad and m."""
    pieces, inside = path.pieces.differentiated(order), path.breaks[1:-1]
    steps: Array = pieces(inside) - pieces(inside, "left")
    return steps


def knots_of(path: JointPath, intervals: int, rough: Array, speeds: Array) -> Array:
    """Return a grid whose intervals take about the same time, with knots where the path's curvature jumps.

    From rest, s and the first knots grow as t^2; where joints have to move slowly, near singularities, the grid is
    finer.

    Parameters
    ----------
    rough, speeds
        A first grid, shape (K+1,), and the largest constant speed in its intervals, shape (K,), 1/s.
    """
    steps = np.diff(rough)
    times = steps / speeds
    share = (1 - EVEN_SHARE) * times / max(float(times.sum()), MIN_TIME) + EVEN_SHARE * steps
    x = (1 - np.cos(np.linspace(0.0, np.pi, intervals + 1))) / 2
    knots, taken = np.interp(x, np.concatenate([[0.0], np.cumsum(share) / share.sum()]), rough), set()
    bends = np.abs(jumps(path, 2)).max(axis=1)
    for s in path.breaks[1:-1][bends > JUMP_ROUNDING * np.abs(path.qss(path.breaks)).max()]:
        k = int(np.argmin(np.abs(knots[1:-1] - s))) + 1
        if knots[k] in taken:
            knots = np.insert(knots, np.searchsorted(knots, s), s)
        else:
            knots[k] = s
        taken.add(s)
    return knots
