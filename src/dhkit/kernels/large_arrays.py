"""Memory of large results, used again once they are dropped.

A new array of 100 MB takes longer to get its pages from the system than a kernel takes to fill it: up to eight times as
long where memory is in pieces. Blocks of dropped results are kept for the next ones of about their size. They are
marked as free (``MADV_FREE``), so that the system takes their pages where memory is short.
"""

from __future__ import annotations

import contextlib
import math
import mmap
import weakref

import numpy as np

from dhkit.description import Array

_SMALLEST = 4 << 20
"""Smaller results, in bytes, come from NumPy: the C library keeps their memory."""
_MOST_KEPT = 512 << 20
"""Largest number of bytes in blocks that wait."""
_LARGEST_RATIO = 2
"""A block is used for results of at least its size over this number."""
_CAN_KEEP = all(hasattr(mmap, name) for name in ("MADV_FREE", "MADV_HUGEPAGE", "MAP_PRIVATE"))

_kept: list[mmap.mmap] = []
"""Blocks that wait, the oldest first. Lists are changed by single operations only: results are dropped at any time, in
any thread."""


def large_array(shape: tuple[int, ...]) -> Array:
    """Return a new array, in any unit, whose values are not set.

    Parameters
    ----------
    shape
        Its shape.
    """
    size = 8 * math.prod(shape)
    if size < _SMALLEST or not _CAN_KEEP:
        return np.empty(shape)
    block = _waiting(size)
    if block is None:
        try:
            block = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        except OSError:
            _kept.clear()
            return np.empty(shape)
        # Where the system has no large pages, small ones do.
        with contextlib.suppress(OSError):
            block.madvise(mmap.MADV_HUGEPAGE)
    array = np.ndarray(shape, np.float64, block)
    # Views of the array keep it alive.
    dropped = weakref.finalize(array, _keep, block)
    dropped.atexit = False
    return array


def _waiting(size: int) -> mmap.mmap | None:
    """Return a block that waits, of at least a size in bytes; None if there is none."""
    for block in tuple(_kept):
        if size <= len(block) <= _LARGEST_RATIO * size:
            # Another thread may have taken it.
            with contextlib.suppress(ValueError):
                _kept.remove(block)
                return block
    return None


def _keep(block: mmap.mmap) -> None:
    """Let a block wait for the next result."""
    with contextlib.suppress(OSError):
        block.madvise(mmap.MADV_FREE)
    _kept.append(block)
    while sum(map(len, tuple(_kept))) > _MOST_KEPT:
        with contextlib.suppress(IndexError):
            _kept.pop(0)
