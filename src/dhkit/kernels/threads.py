"""Work distributed to waiting threads."""

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


def in_threads(
    function: Callable[[Item], Result], items: Iterable[Item], threads: int
) -> Iterator[Result]:
    """Yield a function's results in order, computed by several threads; with one, by the caller's.

    ``function`` must not call this again with more than one thread, because all of them may be waiting. When it raises,
    or the caller stops, items that have not begun are dropped, and running ones are waited for.

    Parameters
    ----------
    function
        Function of one item.
    items
        Items; no more than ``threads`` are taken ahead.
    threads
        Number of threads.

    Yields
    ------
    Result
        The result of each item, in the items' order.

    Raises
    ------
    Exception
        What the function raised.

    Examples
    --------
    >>> list(in_threads(abs, [-1, 2, -3], threads=2))
    [1, 2, 3]
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
    """Call a function with all items at once, one thread each, the first in the caller's.

    When this returns or raises, no thread works on an item any more.

    Parameters
    ----------
    function
        Function of one item.
    items
        Items, at least one.

    Raises
    ------
    Exception
        What the function raised for one of the items.

    Examples
    --------
    >>> done = []
    >>> all_in_threads(done.append, [1, 2, 3])
    >>> sorted(done)
    [1, 2, 3]
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
    """Cancel futures that have not begun and wait for the others, which write into arrays of the caller."""
    wait([future for future in pending if not future.cancel()])


def _submitted(threads: int, function: Callable[[Item], Result], item: Item) -> Future[Result]:
    try:
        return _pool(threads).submit(function, item)
    except RuntimeError:  # the interpreter is ending and starts no more threads
        future: Future[Result] = Future()
        future.set_result(function(item))
        return future


_pools: dict[int, ThreadPoolExecutor] = {}
_lock = threading.Lock()


def _pool(threads: int) -> ThreadPoolExecutor:
    """Return a pool with at least ``threads`` threads; sizes are powers of two, so that few pools exist."""
    size = 1 << (threads - 1).bit_length()
    with _lock:
        if size not in _pools:
            _pools[size] = ThreadPoolExecutor(size, thread_name_prefix="dhkit")
        return _pools[size]


def _after_fork() -> None:
    """Make new pools and locks in the child: threads do not survive a fork, nor does the holder of a lock."""
    global _lock
    _lock = threading.Lock()
    _pools.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)
