"""By how much a motion along a path misses its limits, and where."""

from __future__ import annotations

import numpy as np

from dhkit.description import Array
from dhkit.planning.along.timing_task import TimingTask
from dhkit.planning.certificate import Checker
from dhkit.planning.states import States

__all__ = ["POINTS", "excesses", "peaks"]

POINTS = 8
"""States an interval by which a motion is certified: intervals are many."""


def peaks(checker: Checker, states: States) -> list[tuple[str, Array]]:
    """Return each kind of limit with by what share it is exceeded, shape (intervals, POINTS, rows).

    Between states a use is as high as the parabola through three of them.
    """
    found = []
    for what, use in checker.measured(states):
        values = use.reshape(-1, POINTS, use.shape[1])
        slope, bend = (values[:, 2:] - values[:, :-2]) / 2, np.diff(values, 2, axis=1)
        inside = (bend < 0) & (np.abs(slope) < np.abs(bend))
        rise = np.divide(slope**2, -2 * bend, out=np.zeros_like(bend), where=inside)
        found.append((what, values + np.pad(rise, ((0, 0), (1, 1), (0, 0))) - 1))
    return found


def excesses(task: TimingTask, states: States, breaks: Array, ends: Array) -> dict[str, Array]:
    """Return by what share each kind of limit is exceeded in each interval of the grid, shape (K, rows)."""
    # Breaks of the path lie between those of the grid.
    interval = np.clip(np.searchsorted(ends, (breaks[1:] + breaks[:-1]) / 2) - 1, 0, task.intervals - 1)
    found = {}
    for what, over in peaks(task.checker, states):
        found[what] = np.zeros((task.intervals, over.shape[2]))
        np.maximum.at(found[what], interval, over.max(axis=1))
    return found
