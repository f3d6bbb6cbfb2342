"""Batches worked off in blocks that fit the cache, on one thread or several, into an array of the caller's."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from dhkit.description import Array

__all__ = ["in_blocks"]

BLOCK = 2_048
"""States of one block: their frames take about 2 MB."""


def in_blocks(
    function: Callable[..., Array],
    states: tuple[Array, ...],
    tail: tuple[int, ...],
    out: Array | None = None,
    threads: int = 1,
) -> Array:
    """Apply a function of states (N, n) with results (N, *tail) to states (..., n).

    Parameters
    ----------
    function
        Takes blocks of the states, each (m, n), and returns (m, *tail).
    states
        Arrays of shape (..., n); their batch axes are broadcast.
    tail
        The result's axes behind the batch axes.
    out
        Where to write: float64, C-contiguous, of the result's shape; a new array if not given.
    threads
        How many blocks are worked on at once; a batch of one block takes one.

    Raises
    ------
    ValueError
        ``out`` has another shape, type or layout, or ``threads`` is below 1.
    """
    if threads < 1:
        raise ValueError(f"threads is {threads!r}; expected 1 or more")
    batch = np.broadcast_shapes(*(state.shape[:-1] for state in states))
    shape = (*batch, *tail)
    if out is None:
        out = np.empty(shape)
    elif not isinstance(out, np.ndarray):
        raise ValueError(f"out is {type(out).__name__}; expected an array of shape {shape}, float64")
    elif out.shape != shape or out.dtype != np.float64 or not out.flags.c_contiguous or not out.flags.writeable:
        raise ValueError(
            f"out has shape {out.shape} and type {out.dtype}; expected {shape}, float64, contiguous and writeable"
        )
    flat = [np.broadcast_to(state, (*batch, state.shape[-1])).reshape(-1, state.shape[-1]) for state in states]
    result = out.reshape(-1, *tail)

    def work(start: int) -> None:
        block = slice(start, start + BLOCK)
        result[block] = function(*(state[block] for state in flat))

    starts = range(0, len(result), BLOCK)
    if threads == 1 or len(starts) < 2:
        for start in starts:
            work(start)
    else:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(work, starts))
    return out
