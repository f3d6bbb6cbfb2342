"""Paths around obstacles by sampling: RRT-Connect and shortcuts.

Kuffner and LaValle 2000, RRT-Connect: An efficient approach to single-query path planning.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.planning.program import Work

REACH = 1.0
"""Largest step towards a sample, as a share of the mean range of a joint."""
RESOLUTION = 0.05
"""Largest change of a joint (rad or m) between two checked states of a path."""
SHORTCUTS = 60
"""Number of shortcuts that are tried."""

IsFree = Callable[[Array], NDArray[np.bool_]]
"""Returns whether states q (N, n) are free, shape (N,)."""


class PathSampler:
    """Paths between two configurations through free states.

    Parameters
    ----------
    is_free
        The test of states.
    lower, upper
        Bounds of the samples, shape (n,), rad and m.
    scale
        Sizes of joint moves that count as equal, shape (n,), rad and m.
    seed
        Seed of the samples: other seeds find other paths.
    work
        Counts the tested states, and says when to give up.
    samples
        Largest number of samples before the search gives up.
    """

    def __init__(
        self,
        is_free: IsFree,
        lower: Array,
        upper: Array,
        scale: Array,
        seed: int,
        work: Work,
        samples: int = 4000,
    ) -> None:
        self.is_free = is_free
        self.lower = lower
        self.upper = upper
        self.scale = scale
        self.rng = np.random.default_rng(seed)
        self.work = work
        self.samples = samples
        self._step = REACH * float(np.mean((upper - lower) / scale))

    def path(self, start: Array, goal: Array) -> Array | None:
        """Return configurations of a path, shape (k, n), or None if so many samples found none.

        Raises
        ------
        SearchLimitError
            The limit of the work was reached.
        """
        if self.is_way_free(start, goal):
            return np.stack([start, goal])
        trees = (_Tree(start, self.scale), _Tree(goal, self.scale))
        for turn in range(self.samples):
            self.work.require_left()

            # Extend: one tree, each in turn, grows by a step towards a random sample.
            grown = trees[turn % 2]
            other = trees[1 - turn % 2]
            sample = self.rng.uniform(self.lower, self.upper)
            near = grown.nearest(sample)

            # new = node + share (sample - node), at most self._step away in the norm |dq / scale|.
            away = (sample - grown.nodes[near]) / self.scale
            share = min(1.0, self._step / max(float(np.linalg.norm(away)), 1e-12))
            new = self._extend(grown, near, grown.nodes[near] + share * away * self.scale)
            if new is None:
                continue

            # Connect: the other tree grows towards the new node as far as the way is free.
            target = grown.nodes[new]
            last = self._extend(other, other.nearest(target), target)
            if last is not None and np.array_equal(other.nodes[last], target):
                first, second = (new, last) if turn % 2 == 0 else (last, new)
                return np.array([*reversed(trees[0].back(first)), *trees[1].back(second)[1:]])
        return None

    def shortened(self, path: Array) -> Array:
        """Return a path with detours cut off, by straight ways between random points of it."""
        for _ in range(SHORTCUTS):
            if len(path) == 2 or self.work.is_over:
                break
            lengths = np.linalg.norm(np.diff(path, axis=0) / self.scale, axis=1)
            along = np.concatenate([[0.0], np.cumsum(lengths)])
            u, v = np.sort(self.rng.uniform(0.0, along[-1], 2))
            i = _side_at(along, u)
            j = _side_at(along, v)
            if i == j:
                continue  # both on one side, which is straight already

            # The point at a length u on side i: q_i + (q_(i+1) - q_i) (u - along_i) / length_i.
            a = path[i] + (path[i + 1] - path[i]) * (u - along[i]) / max(lengths[i], 1e-12)
            b = path[j] + (path[j + 1] - path[j]) * (v - along[j]) / max(lengths[j], 1e-12)
            if self.is_way_free(a, b):
                path = np.vstack([path[: i + 1], a, b, path[j + 1 :]])
        return path

    def is_way_free(self, start: Array, goal: Array) -> bool:
        """Return whether the straight way between two configurations is free."""
        return bool(self._free(_way(start, goal)).all())

    def _free(self, q: Array) -> NDArray[np.bool_]:
        self.work.states += len(q)
        return self.is_free(q)

    def _extend(self, tree: _Tree, near: int, target: Array) -> int | None:
        """Go straight to a target as far as the way is free; return the new node, or None if there is none."""
        way = _way(tree.nodes[near], target)
        free = self._free(way)
        if free.all():
            return tree.add(target, near)

        # The states before the first that is not free.
        count = int(np.argmin(free))
        return tree.add(way[count - 1], near) if count else None


class _Tree:
    """Configurations that free straight lines join to a root."""

    def __init__(self, root: Array, scale: Array) -> None:
        self.nodes = [root]
        self._parents = [-1]
        self._scale = scale

    def nearest(self, q: Array) -> int:
        return int(np.argmin(np.sum(((np.array(self.nodes) - q) / self._scale) ** 2, axis=1)))

    def add(self, q: Array, parent: int) -> int:
        self.nodes.append(q)
        self._parents.append(parent)
        return len(self.nodes) - 1

    def back(self, node: int) -> list[Array]:
        """Return the nodes from one to the root."""
        path = []
        while node >= 0:
            path.append(self.nodes[node])
            node = self._parents[node]
        return path


def _side_at(along: Array, length: float) -> int:
    """Return the side of a polygon at a length from its start; its corners are at ``along`` (k,)."""
    return min(int(np.searchsorted(along, length, side="right")) - 1, len(along) - 2)


def _way(start: Array, goal: Array) -> Array:
    """Return the states of a straight way after its start, shape (k, n)."""
    count = max(1, int(np.ceil(np.abs(goal - start).max() / RESOLUTION)))
    return start + np.arange(1, count + 1)[:, None] / count * (goal - start)
