"""Work shared among waiting threads."""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from itertools import islice
from typing import Any, TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def in_threads(function: Callable[[Item], Result], items: Iterable[Item], threads: int) -> Iterator[Result]:
    """Yield a function's results in order, worked out by so many threads; by the caller's own if it is one.

    ``function`` must not call this again with more than one thread: all of them may be waiting. When it raises, or the
    caller stops, what has not begun is not begun, and what has is waited for.
    """
    if threads < 2:
        yield from map(function, items)
        return
    waiting = iter(items)
    pending: deque[Future[Result]] = deque()
    try:
        pending.extend(_submitted(threads, function, item) for item in islice(waiting, threads))
        while pending:
            yield pending.popleft().result()
            pending.extend(_submitted(threads, function, item) for item in islice(waiting, 1))
    finally:
        _end(pending)


def all_in_threads(function: Callable[[Item], object], items: Sequence[Item]) -> None:
    """Call a function with all items at once, a thread each: with the first in the caller's own.

    When it returns or raises, no thread works on an item any more.
    """
    first, *others = items
    pending: list[Future[object]] = []
    try:
        pending.extend(_submitted(len(others), function, item) for item in others)
        function(first)
        for future in pending:
            future.result()
    finally:
        _end(pending)


def _end(pending: Iterable[Future[Any]]) -> None:
    """Cancel what has not begun, and wait for what has: it writes into arrays that the caller may use again."""
    wait([future for future in pending if not future.cancel()])


def _submitted(threads: int, function: Callable[[Item], Result], item: Item) -> Future[Result]:
    try:
        return _pool(threads).submit(function, item)
    except RuntimeError:  # the interpreter ends, and starts no more threads
        future: Future[Result] = Future()
        future.set_result(function(item))
        return future


_pools: dict[int, ThreadPoolExecutor] = {}
_lock = threading.Lock()


def _pool(threads: int) -> ThreadPoolExecutor:
    """Return at least so many waiting threads; sizes are powers of two, so that few pools serve all requests."""
    size = 1 << (threads - 1).bit_length()
    with _lock:
        if size not in _pools:
            _pools[size] = ThreadPoolExecutor(size, thread_name_prefix="dhkit")
        return _pools[size]


def _after_fork() -> None:
    """Threads do not survive a fork, nor does who held the lock: the child makes its own."""
    global _lock
    _lock = threading.Lock()
    _pools.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)
