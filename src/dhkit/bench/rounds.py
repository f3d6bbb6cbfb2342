"""Timing in interleaved rounds: every contender is timed once in each round, so that a noisy minute affects all."""

from __future__ import annotations

import gc
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from time import perf_counter

import numpy as np

from dhkit.bench.contenders import Call, Mode, Task
from dhkit.description import Array

BUDGET = {Mode.SINGLE: 0.05, Mode.FEW: 0.05, Mode.BATCH: 1.0}
"""Time of a contender in a round, s: a short loop of calls is as informative as a long one."""
FEWEST = 64
"""Smallest number of items of a contender that takes several in a call."""
MIN_TIMING = 0.02
"""Shortest timing of repeated calls, s: with it caches are equally warm for all, and the first call does not decide."""


@contextmanager
def calm() -> Iterator[None]:
    """Keep the garbage collector and warnings of other packages out of timings."""
    was_enabled = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    finally:
        if was_enabled:
            gc.enable()


def _seconds_of(call: Call) -> float:
    """Return the time of one call, s; its result is freed after the clock has stopped."""
    start = perf_counter()
    result = call()
    seconds = perf_counter() - start
    del result
    return seconds


def items_within(task: Task, mode: Mode, max_items: int) -> int:
    """Return how many items fit into a round, at most ``max_items``; this warms the contender up as well."""
    items = min(max_items, 1 if mode is Mode.SINGLE else FEWEST)
    while True:
        call = task.prepare(items)
        _seconds_of(call)
        seconds = _seconds_of(call)
        room = BUDGET[mode] / max(seconds, 1e-9)
        if items == max_items or room < 2.0:
            fitting = max(1, int(items * min(1.0, room)))
            if mode is Mode.FEW:
                # Whole calls of every size.
                return min(max_items, max(1, fitting // FEWEST) * FEWEST)
            return fitting
        items = min(max_items, items * int(min(room, 16.0)))


def lasting(call: Call) -> int:
    """Return the number of repetitions of a call in a timing; this warms the call up as well."""
    _seconds_of(call)
    return max(1, round(MIN_TIMING / max(_seconds_of(call), 1e-7)))


def repeated(call: Call, times: int) -> Call:
    """Return a call that repeats another."""

    def calls() -> None:
        for _ in range(times):
            call()

    return calls if times > 1 else call


def rounds(calls: Sequence[Call], repeats: int) -> Iterator[Array]:
    """Yield the times of the calls, shape (len(calls),), s, for each round."""
    for _ in range(repeats):
        gc.collect()
        yield np.array([_seconds_of(call) for call in calls])
