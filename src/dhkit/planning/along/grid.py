"""Where the intervals of a timing end: finer where the arm has to go slowly, and where the path bends suddenly."""

from __future__ import annotations

import numpy as np

from dhkit.description import Array
from dhkit.planning.along.path_states import PathStates
from dhkit.planning.along.rows import speed_bounds, timing_rows, tool_speeds
from dhkit.planning.constraints import Constraint
from dhkit.trajectories import JointPath, Limits

CORNER = 1e-6
"""Share of the largest derivative by which it may jump: rounding."""
EVENLY, TINY = 0.3, 1e-12
"""Share of knots that lie evenly, and a time that nothing takes, s."""


def jumps(path: JointPath, order: int) -> Array:
    """Return by how much a derivative jumps at each inner break, shape (K-1, n)."""
    pieces, inside = path.pieces.differentiated(order), path.breaks[1:-1]
    steps: Array = pieces(inside) - pieces(inside, "left")
    return steps


def even_speeds(states: PathStates, limits: Limits, constraints: tuple[Constraint, ...]) -> Array:
    """Return the greatest even speed along the path in each interval, shape (K,), 1/s."""
    nothing = np.zeros((len(states.steps), 1))
    bounds = speed_bounds(states, limits, nothing, [(tool, nothing) for tool in tool_speeds(constraints)])
    most = np.minimum(bounds[:-1], bounds[1:])
    for row in timing_rows(states, limits):
        most = np.minimum(most, row.even.min(axis=0))
    return np.sqrt(most)


def knots_of(path: JointPath, intervals: int, rough: Array, speeds: Array) -> Array:
    """Return a grid with steps that take about the same time, and knots where the path's curvature jumps.

    From rest s grows as t^2 and so do the first knots; where the joints have to go slowly, near singularities, the
    grid is finer.

    Parameters
    ----------
    rough, speeds
        A first grid, shape (K+1,), and the greatest even speed in its intervals, shape (K,).
    """
    steps = np.diff(rough)
    times = steps / speeds
    share = (1 - EVENLY) * times / max(float(times.sum()), TINY) + EVENLY * steps
    x = (1 - np.cos(np.linspace(0.0, np.pi, intervals + 1))) / 2
    knots, taken = np.interp(x, np.concatenate([[0.0], np.cumsum(share) / share.sum()]), rough), set()
    bends = np.abs(jumps(path, 2)).max(axis=1)
    for s in path.breaks[1:-1][bends > CORNER * np.abs(path.qss(path.breaks)).max()]:
        k = int(np.argmin(np.abs(knots[1:-1] - s))) + 1
        if knots[k] in taken:
            knots = np.insert(knots, np.searchsorted(knots, s), s)
        else:
            knots[k] = s
        taken.add(s)
    return knots
