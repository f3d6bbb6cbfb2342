"""Many motions of one planner, over processes."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from multiprocessing import get_context
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description
from dhkit.description.arrays import number_array
from dhkit.errors import PlanningError
from dhkit.kernels import check_whole
from dhkit.trajectories import Trajectory

SimilarMotions: TypeAlias = Trajectory | Sequence[Trajectory | PlanningError | None] | None
"""A motion like all that are planned, or one for each; None and errors where there is none."""
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
    warm: SimilarMotions = None,
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
    similar = _similar(warm, count)
    pairs = [(first[k % len(first)], last[k % len(last)], similar[k]) for k in range(count)]
    if workers is None:
        workers = os.cpu_count() or 1
    check_whole("workers", workers, 1)
    if progress is not None and not callable(progress):
        raise TypeError(
            f"progress is {type(progress).__name__}; expected a function of two numbers"
        )
    report = progress or (lambda done, total: None)
    given = dict(options or {})
    if min(workers, count) <= 1:
        found = []
        for pair in pairs:
            found.append(_solved(planner, *pair, given))
            report(len(found), count)
        return found
    _require_sendable(planner)
    lost = PlanningError(
        "its process ended: for want of memory perhaps (fewer workers= need less), or because the script that plans "
        "has no line if __name__ == '__main__':"
    )
    results: list[Trajectory | PlanningError] = [lost] * count
    pool = ProcessPoolExecutor(min(workers, count), get_context("spawn"), _begin, (planner,))
    try:
        futures: dict[Future[Trajectory | PlanningError], int] = {
            pool.submit(_solve, *pair, given): k for k, pair in enumerate(pairs)
        }
        for done, future in enumerate(as_completed(futures), start=1):
            with suppress(BrokenProcessPool):
                results[futures[future]] = future.result()
            report(done, count)
    except BaseException:
        for process in list((pool._processes or {}).values()):
            process.terminate()
        pool.shutdown(cancel_futures=True)
        raise
    pool.shutdown()
    return results


def _require_sendable(planner: OneMotion) -> None:
    try:
        pickle.dumps(planner)
    except (AttributeError, TypeError, pickle.PicklingError) as error:
        raise TypeError(
            f"the planner cannot be sent to other processes ({error}): define its constraints and objective at the top "
            "of a module, or use workers=1"
        ) from None


_planner: list[OneMotion] = []
"""The planner of a worker process."""


def _begin(planner: OneMotion) -> None:
    _planner[:] = [planner]


def _solve(
    start: Array, goal: Array, warm: Trajectory | None, options: dict[str, Any]
) -> Trajectory | PlanningError:
    return _solved(_planner[0], start, goal, warm, options)


def _solved(
    planner: OneMotion, start: Array, goal: Array, warm: Trajectory | None, options: dict[str, Any]
) -> Trajectory | PlanningError:
    try:
        return planner.solve(start, goal, warm=warm, **options)
    except PlanningError as error:
        # Without its traceback and context, which hold the planner's programs.
        return PlanningError(str(error))


def _similar(warm: object, count: int) -> list[Trajectory | None]:
    """Return a similar motion for each pair: one for all, or one each; results of an earlier call hold errors too."""
    if warm is None or isinstance(warm, Trajectory):
        return [warm] * count
    if not isinstance(warm, Sequence) or not all(
        isinstance(one, Trajectory | PlanningError | None) for one in warm
    ):
        raise TypeError(
            f"warm is {type(warm).__name__}; expected a Trajectory, or a list of them and of None"
        )
    if len(warm) != count:
        raise ValueError(f"warm has {len(warm)} motions; expected one, or {count}")
    return [one if isinstance(one, Trajectory) else None for one in warm]


def _places(values: ArrayLike, n: int, name: str, *, poses: bool) -> Sequence[Array]:
    """Return places, each of shape (n,) or (4, 4), from one or several of them."""
    expected = f"(..., {n})" + (" or (..., 4, 4)" if poses else "")
    array = number_array(values, name, expected)
    if not array.size:
        raise ValueError(f"{name} has shape {array.shape}: no places; expected {expected}")
    if (
        array.ndim > 1
        and not (finite := np.isfinite(array).reshape(len(array), -1).all(axis=1)).all()
    ):
        raise ValueError(f"{name}[{int(np.argmin(finite))}] has values that are not finite")
    if poses and array.shape[-2:] == (4, 4) and array.ndim in (2, 3):
        return list(array.reshape(-1, 4, 4))
    if array.ndim not in (1, 2) or array.shape[-1] != n:
        raise ValueError(f"{name} has shape {array.shape}; expected {expected}")
    return list(array.reshape(-1, n))
