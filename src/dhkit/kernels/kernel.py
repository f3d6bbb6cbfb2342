"""Kernels: batch functions on arrays (N, size), compiled, or in NumPy where compiling is switched off."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.kernels import store
from dhkit.kernels.source import array_source, loop_source
from dhkit.symbolic import Graph

__all__ = ["Kernel", "compiling", "kernel"]

SHARE = 4_096
"""Items that a thread must have to itself: below that handing them over costs more than it saves."""
ARRAY_BLOCK = 2_048
"""Items that NumPy works on at once."""


def compiling() -> bool:
    """Return whether kernels are compiled: unless the environment variable ``DHKIT_KERNELS`` is ``off``."""
    return os.environ.get("DHKIT_KERNELS", "").lower() != "off"


@dataclass(frozen=True)
class Kernel:
    """A function of items: ``kernel(parameters, inputs, outputs)`` fills the outputs.

    Inputs are (N, size) float64, C-contiguous; outputs likewise, of the kinds that :func:`kernel` was given. Items are
    independent; one whose input is not finite gives NaN.
    """

    name: str
    function: Callable[..., None]
    compiled: bool

    def __call__(
        self, parameters: Array, inputs: Sequence[Array], outputs: Sequence[NDArray[Any]], threads: int = 1
    ) -> None:
        """Fill ``outputs``; with several threads each takes a share of a large batch."""
        count = len(inputs[0])
        shares = min(threads, count // SHARE) if self.compiled else 1
        if shares < 2:
            self._run(parameters, (*inputs, *outputs))
            return
        edges = np.linspace(0, count, shares + 1).astype(int)
        parts = [tuple(array[start:stop] for array in (*inputs, *outputs)) for start, stop in pairwise(edges)]
        pending = [_workers(shares - 1).submit(self._run, parameters, part) for part in parts[1:]]
        self._run(parameters, parts[0])
        for share in pending:
            share.result()

    def _run(self, parameters: Array, arrays: Sequence[NDArray[Any]]) -> None:
        if self.compiled:
            self.function(parameters, *arrays)
            return
        with np.errstate(all="ignore"):
            for start in range(0, len(arrays[0]), ARRAY_BLOCK):
                self.function(parameters, *(array[start : start + ARRAY_BLOCK] for array in arrays))


def kernel(
    name: str,
    pattern: str,
    derive: Callable[[], Graph],
    types: Sequence[str] = ("float64",),
    written_in: str | None = None,
) -> Kernel:
    """Return the kernel of a program: from this process, from the disk, or derived and compiled now.

    Parameters
    ----------
    name, pattern
        Together say which program it is: the kernel is found by them, and ``derive`` is only called when it is new.
    derive
        Returns the program; its first input holds the parameters.
    types
        Of each output: float64, or uint8 for small whole numbers.
    written_in
        The file or folder that decides what is derived: the kernel is made anew when it changes. The file of
        ``derive`` unless given.
    """
    key = (name, pattern, compiling())
    found = _kernels.get(key)
    if found is None:
        with _lock:
            found = _kernels.get(key) or _made(name, pattern, derive, types, written_in)
            _kernels[key] = found
    return found


def _made(name: str, pattern: str, derive: Callable[[], Graph], types: Sequence[str], written_in: str | None) -> Kernel:
    if not compiling():
        space: dict[str, Any] = {}
        exec(compile(array_source(derive(), types), f"<{name}>", "exec"), space)  # noqa: S102 - text of our own making
        return Kernel(name, space["kernel"], compiled=False)
    key = store.digest(name, pattern, written_in or derive.__code__.co_filename)
    function = store.load(name, key, lambda cache: loop_source(derive(), types, cache=cache))
    return Kernel(name, function, compiled=True)


_kernels: dict[tuple[str, str, bool], Kernel] = {}
_pools: dict[int, ThreadPoolExecutor] = {}
_lock = threading.RLock()


def _workers(count: int) -> ThreadPoolExecutor:
    """Return as many waiting threads, the same ones each time."""
    with _lock:
        if count not in _pools:
            _pools[count] = ThreadPoolExecutor(count, thread_name_prefix="dhkit")
        return _pools[count]


def _after_fork() -> None:
    """Threads do not survive a fork, nor does whoever held the lock: the child makes its own."""
    global _lock
    _lock = threading.RLock()
    _pools.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)
