"""Timing in interleaved rounds: every contender once a round, so that a noisy minute hits them all."""

from __future__ import annotations

import gc
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from time import perf_counter

import numpy as np

from dhkit.bench.contenders import Call, Mode, Task
from dhkit.description import Array

BUDGET = {Mode.SINGLE: 0.05, Mode.BATCH: 1.0}
"""s a contender may take in a round: a loop of single calls is as telling when it is short."""
LASTING = 0.02
"""s: a call is repeated until its timing lasts this long: caches are then as warm for each, and no start decides."""


@contextmanager
def calm() -> Iterator[None]:
    """Keep the garbage collector and others' warnings out of what is timed."""
    collecting = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    finally:
        if collecting:
            gc.enable()


def seconds_of(call: Call) -> float:
    """Return how long one call takes, s; what it returns is let go after the clock has stopped."""
    start = perf_counter()
    result = call()
    seconds = perf_counter() - start
    del result
    return seconds


def items_within(task: Task, mode: Mode, most: int) -> int:
    """Return how many items fit a round, at most ``most``; this warms the contender up as well."""
    items = min(most, 1 if mode is Mode.SINGLE else 64)
    while True:
        call = task.prepare(items)
        seconds_of(call)
        seconds = seconds_of(call)
        room = BUDGET[mode] / max(seconds, 1e-9)
        if items == most or room < 2.0:
            return max(1, int(items * min(1.0, room)))
        items = min(most, items * int(min(room, 16.0)))


def lasting(call: Call) -> int:
    """Return how often a call is to be repeated; this warms it up as well."""
    seconds_of(call)
    return max(1, round(LASTING / max(seconds_of(call), 1e-7)))


def repeated(call: Call, times: int) -> Call:
    """Return a call of a call, one time after another."""

    def calls() -> None:
        for _ in range(times):
            call()

    return calls if times > 1 else call


def rounds(calls: Sequence[Call], repeats: int) -> Iterator[Array]:
    """Yield, a round, the seconds of each call, shape (len(calls),)."""
    for _ in range(repeats):
        gc.collect()
        yield np.array([seconds_of(call) for call in calls])
