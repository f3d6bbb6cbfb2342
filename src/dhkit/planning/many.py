"""Many motions of one planner, over processes."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Any, Protocol, TypeAlias

from numpy.typing import ArrayLike

from dhkit.description import Array, Description
from dhkit.description.arrays import number_array
from dhkit.errors import PlanningError
from dhkit.kernels import check_whole
from dhkit.trajectories import Trajectory

ManyProgress: TypeAlias = Callable[[int, int], object]
"""Callback after each motion, with the number of motions that are done and of all; an exception in it ends the rest."""


class OneMotion(Protocol):
    """A planner: it can be sent to another process."""

    description: Description

    @property
    def solve(self) -> Callable[..., Trajectory]:
        """The function that returns the best motion from a start to a goal, or raises a PlanningError."""
        ...


def solve_many(
    planner: OneMotion,
    starts: ArrayLike,
    goals: ArrayLike,
    *,
    workers: int | None = None,
    progress: ManyProgress | None = None,
    options: Mapping[str, Any] | None = None,
) -> list[Trajectory | PlanningError]:
    """Return the best motions between pairs of places, see :meth:`Planner.solve_many`."""
    n = planner.description.n
    first = _places(starts, n, "starts", poses=False)
    last = _places(goals, n, "goals", poses=True)
    count = max(len(first), len(last))
    for name, places in (("starts", first), ("goals", last)):
        if len(places) not in (1, count):
            raise ValueError(f"{name} has {len(places)} places; expected 1 or {count}")
    pairs = [(first[k % len(first)], last[k % len(last)]) for k in range(count)]
    if workers is None:
        workers = os.cpu_count() or 1
    check_whole("workers", workers, 1)
    report, given = progress or (lambda done, total: None), dict(options or {})
    if min(workers, count) <= 1:
        found = []
        for start, goal in pairs:
            found.append(_solved(planner, start, goal, given))
            report(len(found), count)
        return found
    results: list[Trajectory | PlanningError | None] = [None] * count
    pool = ProcessPoolExecutor(min(workers, count), get_context("spawn"), _begin, (planner,))
    try:
        futures: dict[Future[Trajectory | PlanningError], int] = {
            pool.submit(_solve, start, goal, given): k for k, (start, goal) in enumerate(pairs)
        }
        for done, future in enumerate(as_completed(futures), start=1):
            results[futures[future]] = future.result()
            report(done, count)
    except BaseException:
        for process in list((pool._processes or {}).values()):
            process.terminate()
        pool.shutdown(cancel_futures=True)
        raise
    pool.shutdown()
    return [result for result in results if result is not None]


_planner: list[OneMotion] = []
"""The planner of a worker process."""


def _begin(planner: OneMotion) -> None:
    _planner[:] = [planner]


def _solve(start: Array, goal: Array, options: dict[str, Any]) -> Trajectory | PlanningError:
    return _solved(_planner[0], start, goal, options)


def _solved(planner: OneMotion, start: Array, goal: Array, options: dict[str, Any]) -> Trajectory | PlanningError:
    try:
        return planner.solve(start, goal, **options)
    except PlanningError as error:
        # Without its traceback and context, which hold the planner's programs.
        return PlanningError(str(error))


def _places(values: ArrayLike, n: int, name: str, *, poses: bool) -> Sequence[Array]:
    """Return places, each of shape (n,) or (4, 4), from one or several of them."""
    expected = f"(..., {n})" + (" or (..., 4, 4)" if poses else "")
    array = number_array(values, name, expected)
    if poses and array.shape[-2:] == (4, 4) and array.ndim in (2, 3):
        return list(array.reshape(-1, 4, 4))
    if array.ndim not in (1, 2) or array.shape[-1] != n or not array.size:
        raise ValueError(f"{name} has shape {array.shape}; expected {expected}")
    return list(array.reshape(-1, n))
