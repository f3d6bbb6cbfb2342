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
"""Whether the system takes back the pages of blocks that wait."""

_kept: list[mmap.mmap] = []
"""Blocks that wait, the oldest first. Lists are changed by single operations only: results are dropped at any time, in
any thread."""


class _Owner:
    """Owns a block while an array, or whatever was made from it, needs it: what NumPy calls the array's base."""

    __slots__ = ("__array_interface__", "__weakref__")

    def __init__(self, block: mmap.mmap, shape: tuple[int, ...]) -> None:
        address = np.frombuffer(block, np.uint8).__array_interface__["data"][0]
        self.__array_interface__ = {
            "version": 3,
            "typestr": np.dtype(np.float64).str,
            "shape": shape,
            "data": (address, False),
        }


def large_array(shape: tuple[int, ...]) -> Array:
    """Return a new array, in any unit, whose values are not set.

    Parameters
    ----------
    shape
        Its shape.
    """
    size = 8 * math.prod(shape)
    if size < _SMALLEST or not _CAN_KEEP or _has_bounded_addresses():
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
    owner = _Owner(block, shape)
    dropped = weakref.finalize(owner, _keep, block)
    dropped.atexit = False
    return np.asarray(owner)


def _has_bounded_addresses() -> bool:
    """Return whether the process may use so many addresses only, of which blocks that wait would take some."""
    import resource

    return resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY


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
