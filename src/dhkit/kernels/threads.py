"""Work shared among waiting threads."""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice
from typing import TypeVar

__all__ = ["all_in_threads", "in_threads"]

Item = TypeVar("Item")
Result = TypeVar("Result")


def in_threads(function: Callable[[Item], Result], items: Iterable[Item], threads: int) -> Iterator[Result]:
    """Yield a function's results in order, worked out by so many threads; by the caller's own if it is one.

    ``function`` must not call this again with more than one thread: all of them may be waiting. When it raises, or the
    caller stops, what has not begun is not begun.
    """
    if threads < 2:
        yield from map(function, items)
        return
    waiting = iter(items)
    # Twice as many as threads are under way, so that a thread that is done finds work.
    pending: deque[Future[Result]] = deque()
    try:
        pending.extend(_pool(threads).submit(function, item) for item in islice(waiting, 2 * threads))
        while pending:
            yield pending.popleft().result()
            pending.extend(_pool(threads).submit(function, item) for item in islice(waiting, 1))
    finally:
        for future in pending:
            future.cancel()


def all_in_threads(function: Callable[[Item], object], items: Sequence[Item]) -> None:
    """Call a function with all items at once, a thread each: with the first in the caller's own."""
    first, *others = items
    pending = [_pool(len(others)).submit(function, item) for item in others]
    function(first)
    for future in pending:
        future.result()


_pools: dict[int, ThreadPoolExecutor] = {}
_lock = threading.Lock()


def _pool(count: int) -> ThreadPoolExecutor:
    """Return as many waiting threads, the same ones each time."""
    with _lock:
        if count not in _pools:
            _pools[count] = ThreadPoolExecutor(count, thread_name_prefix="dhkit")
        return _pools[count]


def _after_fork() -> None:
    """Threads do not survive a fork, nor does who held the lock: the child makes its own."""
    global _lock
    _lock = threading.Lock()
    _pools.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)
