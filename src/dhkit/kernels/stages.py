"""Arrays at fixed places, through which single items and small blocks pass: handing over addresses costs more."""

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
    """What ``run`` works with without holding it."""

    def work(self, parameters: Array, inputs: Sequence[Array], outputs: Sequence[NDArray[Any]]) -> None:
        """Compute as many items as the arrays have rows."""
        self.parameters[...] = parameters
        for staged, array in zip(self.inputs, inputs, strict=True):
            staged[...] = array
        self.run()
        for array, staged in zip(outputs, self.outputs, strict=True):
            array[...] = staged


class Stages(threading.local):
    """A thread's own stages, by how many items they take.

    A stage is taken out while it works: a signal handler that calls the same kernel in between finds none, and gets one
    of its own.
    """

    def __init__(self, made: Callable[[int], Stage]) -> None:
        self._made = made
        self._idle: dict[int, Stage] = {}

    def work(self, items: int, parameters: Array, inputs: Sequence[Array], outputs: Sequence[NDArray[Any]]) -> None:
        """Compute so many items; see :meth:`Stage.work`."""
        stage = self._idle.pop(items, None) or self._made(items)
        try:
            stage.work(parameters, inputs, outputs)
        finally:
            self._idle[items] = stage


def aligned(size: int, alignment: int) -> Array:
    """Return an array of doubles whose address is a multiple of an alignment in bytes."""
    array = np.empty(size + alignment // 8)
    skipped = -address(array) % alignment // 8
    return array[skipped : skipped + size]


def address(array: NDArray[Any]) -> int:
    """Return where an array's first entry lies."""
    found: int = array.__array_interface__["data"][0]
    return found
