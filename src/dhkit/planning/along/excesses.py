"""By how much a motion along a path misses its limits, and where."""

from __future__ import annotations

import numpy as np

from dhkit.description import Array
from dhkit.planning.along.timing_task import TimingTask
from dhkit.planning.states import States


def excesses(task: TimingTask, states: States, breaks: Array, ends: Array) -> dict[str, Array]:
    """Return by what share each kind of limit is exceeded in each interval of the grid, shape (K, rows)."""
    # Breaks of the path lie between those of the grid.
    interval = np.clip(np.searchsorted(ends, (breaks[1:] + breaks[:-1]) / 2) - 1, 0, task.intervals - 1)
    found = {}
    for what, use in task.checker.peaks(states):
        over = use.reshape(len(interval), -1, use.shape[1]).max(axis=1) - 1
        found[what] = np.zeros((task.intervals, use.shape[1]))
        np.maximum.at(found[what], interval, over)
    return found
