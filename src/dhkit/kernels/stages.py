"""Stages: arrays at fixed addresses, into which single items and small blocks are copied.

Looking up the addresses of new arrays takes longer than copying a few numbers, so that a compiled function keeps arrays
whose addresses it already has, one set for each thread and number of items.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array


@dataclass(frozen=True, slots=True)
class Stage:
    """Arrays that a function reads and writes in place."""

    parameters: Array
    inputs: list[Array]
    outputs: list[NDArray[Any]]
    run: Callable[[], object]
    kept: tuple[Any, ...] = ()
    """Objects that ``run`` needs and that must stay alive."""

    def work(
        self, parameters: Array, inputs: Sequence[Array], outputs: Sequence[NDArray[Any]]
    ) -> None:
        """Write the outputs (items, ...) of parameters (p,) and inputs (items, ...), in the units of the program."""
        self.parameters[...] = parameters
        # For single items, zip(strict=True) would take as long as a copy.
        for k, staged in enumerate(self.inputs):
            staged[...] = inputs[k]
        self.run()
        for k, staged in enumerate(self.outputs):
            outputs[k][...] = staged


class Stages(threading.local):
    """A thread's own stages, by their number of items.

    A stage is taken out while it works, so that a signal handler that calls the same kernel gets another one.
    """

    def __init__(self, made: Callable[[int], Stage]) -> None:
        self._made = made
        self._idle: dict[int, Stage] = {}

    def work(
        self,
        items: int,
        parameters: Array,
        inputs: Sequence[Array],
        outputs: Sequence[NDArray[Any]],
    ) -> None:
        """Compute ``items`` items; see :meth:`Stage.work`."""
        idle = self._idle
        stage = idle.pop(items, None) or self._made(items)
        try:
            stage.work(parameters, inputs, outputs)
        finally:
            idle[items] = stage


def aligned(size: int, alignment: int) -> Array:
    """Return an array of ``size`` doubles, shape (size,), whose address is a multiple of ``alignment`` bytes."""
    array = np.empty(size + alignment // 8)
    # NumPy's addresses are multiples of 8: a whole number of doubles leads to the next multiple of ``alignment``.
    skipped = -address(array) % alignment // 8
    return array[skipped : skipped + size]


def address(array: NDArray[Any]) -> int:
    """Return the address in bytes of the first entry of an array of any shape."""
    found: int = array.__array_interface__["data"][0]
    return found
