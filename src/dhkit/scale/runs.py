"""Monte Carlo simulations and many plans by the workers of a cluster."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import lru_cache
from itertools import pairwise
from pickle import dumps, loads
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dhkit.arm import Arm
from dhkit.control import BatchResult, Controller, Reference
from dhkit.control.options import BatchOptions
from dhkit.description import Array
from dhkit.errors import PlanningError
from dhkit.kinematics.workspace import Progress
from dhkit.planning import Planner
from dhkit.scale.clusters import completed, prepare
from dhkit.trajectories import Trajectory

if TYPE_CHECKING:
    from dhkit.scale.clusters import Client


RUNS_PER_TASK = 1_024
"""Simulations in a task at least: fewer do not fill the vectors of a processor for long."""


# Simulations


def simulate_many(
    client: Client,
    arm: Arm,
    controller: Controller | None = None,
    reference: Reference | Trajectory | ArrayLike | None = None,
    duration: float | None = None,
    q0: ArrayLike | None = None,
    qd0: ArrayLike | None = None,
    *,
    options: BatchOptions | None = None,
    size: int = RUNS_PER_TASK,
    progress: Progress | None = None,
) -> BatchResult:
    """Simulate many runs by the workers of a cluster, in tasks of many runs each; see :meth:`dhkit.Arm.simulate_batch`.

    The number of runs B is that of the rows of ``q0``, ``qd0``, of joint values to hold, or of ``options.plant``: arms
    with other masses or payloads, for instance. Gains are the same in all runs.

    Parameters
    ----------
    client
        A client of dask, as :func:`connected` yields it.
    arm
        The robot that the controller and the reference know.
    controller, reference, duration
        As for :meth:`dhkit.Arm.simulate_batch`; joint values to hold may have shape (B, n).
    q0, qd0
        Joint values and rates at the start, shape (n,) or (B, n), rad, m and per second.
    options
        Options of the simulation but ``progress``. ``keep="all"`` needs memory for all states in this process.
    size
        Runs in a task at least.
    progress
        Called with how many runs are done and how many there will be; an exception in it ends the work.

    Returns
    -------
    BatchResult
        The runs in their order.

    Raises
    ------
    SimulationError, ValueError, TypeError
        As for :meth:`dhkit.Arm.simulate_batch`.
    """
    prepare(client)
    options = options or BatchOptions()
    followed = reference if isinstance(reference, Trajectory | Reference) else None
    q0 = _rows(q0)
    qd0 = _rows(qd0)
    held = None if followed is not None else _rows(reference)
    plants = options.plant if isinstance(options.plant, Sequence) else None
    runs = max(1 if rows is None else len(rows) for rows in (q0, qd0, held, plants))

    def cut(rows: Any, part: slice) -> Any:
        return rows if rows is None or len(rows) == 1 else rows[part]

    # Equal parts, so that each has ``size`` rows at least if there are so many.
    ends = np.linspace(0, runs, max(1, runs // size) + 1).astype(int).tolist()
    parts = [slice(*pair) for pair in pairwise(ends)]
    items = [
        {
            "controller": controller,
            "reference": cut(held, part) if followed is None else followed,
            "duration": duration,
            "q0": cut(q0, part),
            "qd0": cut(qd0, part),
            "options": options if plants is None else replace(options, plant=cut(plants, part)),
        }
        for part in parts
    ]
    found: dict[int, BatchResult] = {}
    done = 0
    for number, result in completed(client, _Simulate(arm), items):
        found[number] = result
        done += parts[number].stop - parts[number].start
        if progress is not None:
            progress(done, runs)
    return _joined([found[number] for number in range(len(parts))])


def _rows(values: object) -> Array | None:
    """Return joint values, shape (n,) or (B, n), as rows: one, or one for each run."""
    return None if values is None else np.atleast_2d(np.asarray(values, dtype=float))


@dataclass(frozen=True)
class _Simulate:
    arm: Arm

    def __call__(self, arguments: dict[str, Any]) -> BatchResult:
        return self.arm.simulate_batch(**arguments)


def _joined(results: Sequence[BatchResult]) -> BatchResult:
    """Return results of consecutive runs as one."""
    first = results[0]
    if len(results) == 1:
        return first
    joined = {
        each.name: _joined_field([getattr(result, each.name) for result in results])
        for each in fields(first)
        if each.name not in ("arms", "friction", "t")
    }
    if len(first.arms) > 1:
        joined["arms"] = sum((result.arms for result in results), ())
    return replace(first, **joined)


def _joined_field(values: Sequence[Any]) -> Any:
    """Return arrays joined along the runs; None where there are none; the same for each field of a dataclass."""
    first = values[0]
    if is_dataclass(first) and not isinstance(first, type):
        parts = {
            each.name: _joined_field([getattr(value, each.name) for value in values])
            for each in fields(first)
        }
        return replace(first, **parts)
    return None if first is None else np.concatenate(values)


# Plans


def plan_many(
    client: Client,
    planner: Planner,
    starts: ArrayLike,
    goals: ArrayLike,
    *,
    progress: Progress | None = None,
    **options: Any,
) -> list[Trajectory | PlanningError]:
    """Plan the best motions between N pairs of places by the workers of a cluster, a task each.

    Parameters
    ----------
    client
        A client of dask, as :func:`connected` yields it.
    planner
        Of :meth:`dhkit.Arm.planner`.
    starts, goals
        Joint values, shape (N, n), or (n,) for all, rad and m; goals may be poses (N, 4, 4) or (4, 4) of the tool.
    progress
        Called with how many motions are done and how many there will be; an exception in it ends the work.
    **options
        Arguments of :meth:`dhkit.Planner.solve` for all motions.

    Returns
    -------
    list[Trajectory | PlanningError]
        For each pair the motion, or why there is none.

    Raises
    ------
    ValueError, TypeError
        Arguments of another shape or type.
    """
    prepare(client)
    n = planner.description.n
    first = _places(starts, n, poses=False)
    last = _places(goals, n, poses=True)
    pairs = max(len(first), len(last))
    for name, places in (("starts", first), ("goals", last)):
        if len(places) not in (1, pairs):
            raise ValueError(f"{name} has {len(places)} places; expected 1 or {pairs}")
    items = [(first[k % len(first)], last[k % len(last)]) for k in range(pairs)]
    found: dict[int, Trajectory | PlanningError] = {}
    for number, motion in completed(client, _Plan(dumps(planner), options), items):
        found[number] = motion
        if progress is not None:
            progress(len(found), pairs)
    return [found[number] for number in range(pairs)]


@dataclass(frozen=True)
class _Plan:
    planner: bytes
    options: dict[str, Any]

    def __call__(self, pair: tuple[Array, Array]) -> Trajectory | PlanningError:
        return _planner(self.planner).solve_many(*pair, workers=1, **self.options)[0]


@lru_cache(maxsize=4)
def _planner(pickled: bytes) -> Planner:
    """Return a planner that this worker keeps: it holds programs that take long to build."""
    planner: Planner = loads(pickled)  # noqa: S301 - dask sends pickles in any case
    return planner


def _places(values: ArrayLike, n: int, *, poses: bool) -> Sequence[Array]:
    """Return places, each of shape (n,) or with ``poses`` (4, 4), from one or several of them."""
    array = np.asarray(values, dtype=float)
    is_one = array.ndim == 1 or (poses and array.shape == (4, 4))
    return [array] if is_one else list(array)
