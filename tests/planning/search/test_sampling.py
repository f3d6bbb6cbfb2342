"""Sampled paths: free from end to end, short, and the same for the same seed."""

from itertools import pairwise

import numpy as np
import pytest

from dhkit.planning.program import SearchLimitError, Work
from dhkit.planning.program.work import STATES_PER_ITERATION
from dhkit.planning.search.sampling import PathSampler

LOWER, UPPER = -np.ones(2), np.ones(2)


def wall(q):
    """Free are points outside a wall that leaves a gap at the top."""
    return ~((np.abs(q[:, 0]) < 0.1) & (q[:, 1] < 0.7))


def sampler(seed=0, is_free=wall, work=None, **options):
    return PathSampler(is_free, LOWER, UPPER, np.ones(2), seed, work or Work(), **options)


def dense(path):
    return np.concatenate([np.linspace(a, b, 200) for a, b in pairwise(path)])


@pytest.mark.parametrize("seed", range(5))
def test_a_path_leads_around_a_wall(seed):
    start, goal = np.array([-0.8, -0.5]), np.array([0.8, -0.5])
    search = sampler(seed)
    path = search.path(start, goal)
    assert np.array_equal(path[0], start) and np.array_equal(path[-1], goal)
    assert wall(dense(path)).mean() > 0.99  # states are checked 0.05 apart
    short = search.shortened(path)
    length = np.linalg.norm(np.diff(short, axis=0), axis=1).sum()
    assert length <= np.linalg.norm(np.diff(path, axis=0), axis=1).sum() + 1e-12
    shortest = 2 * np.hypot(0.7, 1.2) + 0.2
    assert shortest * 0.98 < length < 1.15 * shortest
    assert np.array_equal(short[[0, -1]], path[[0, -1]])
    assert np.array_equal(path, sampler(seed).path(start, goal))


def test_a_free_way_is_straight():
    assert sampler().path(np.array([-0.8, 0.9]), np.array([0.8, 0.9])).shape == (2, 2)


def test_where_there_is_no_path_it_ends():
    closed = sampler(is_free=lambda q: np.abs(q[:, 0]) > 0.1, samples=200)
    assert closed.path(np.array([-0.8, 0.0]), np.array([0.8, 0.0])) is None


def test_the_limit_of_work_is_kept():
    work, tested = Work(max_iterations=10), []

    def is_free(q):
        tested.append(len(q))
        return np.abs(q[:, 0]) > 0.1

    with pytest.raises(SearchLimitError, match=r"^no motion found within 10 iterations$"):
        sampler(is_free=is_free, work=work).path(np.array([-0.8, 0.0]), np.array([0.8, 0.0]))
    assert work.states == sum(tested)
    assert 0 <= work.states - 10 * STATES_PER_ITERATION < 2 * max(tested)
