"""The steps of a batch: a control law inside the program, block by block, or a controller called for all arms."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from dhkit.control.controller import Controller, called
from dhkit.control.law import Law
from dhkit.control.references import Samples, Setpoint
from dhkit.control.runs import PROGRESS_EVERY, Progress
from dhkit.control.sensors import Measuring
from dhkit.control.step_kernel import WORKS, StepKernel
from dhkit.description import Array, Description
from dhkit.description.arrays import number_array
from dhkit.dynamics import Friction
from dhkit.errors import SimulationError
from dhkit.kernels import all_in_threads

BLOCK = 8_192
"""Arms that are taken through all steps together, at most: few calls a step, and states that stay in the cache."""
DIVERGED = 1e100
"""rad, m and per second: torques of a run whose state has become that large may overflow; the run then ends in NaN."""


@dataclass(frozen=True, eq=False)
class Record:
    """What is kept of a batch, arrays (B, n) unless said; filled by a run."""

    q0: Array
    qd0: Array
    q: Array
    """The last states."""
    qd: Array
    works: Array
    """Shape (B, 3)."""
    peak: Array
    """Largest errors."""
    squares: Array
    """Sums of squared errors."""
    cut: Array
    """How often a torque was cut off."""
    lowest: Array
    """Joint values."""
    highest: Array
    rows: tuple[Array, ...]
    """Joint values, rates, torques given and asked for at all times, shape (B, N+1, n); empty where not kept."""

    @classmethod
    def empty(cls, q: Array, qd: Array, kept: int) -> Record:
        """Return the record of a run that begins at states (B, n), with room for so many rows of each arm."""
        peak, squares, cut = (np.zeros_like(q) for _ in range(3))
        rows = tuple(np.empty((len(q), kept, q.shape[1])) for _ in range(4 if kept else 0))
        works = np.zeros((len(q), len(WORKS)))
        return cls(q, qd, q.copy(), qd.copy(), works, peak, squares, cut, q.copy(), q.copy(), rows)

    def part(self, rows: slice) -> Record:
        """Return the record of some of the arms: views."""
        arrays = {name: getattr(self, name)[rows] for name in self.__dataclass_fields__ if name != "rows"}
        return Record(**arrays, rows=tuple(x[rows] for x in self.rows))


@dataclass(frozen=True, eq=False)
class BatchRun:
    """A run of a batch.

    Parameters
    ----------
    description
        What the controller knows.
    t
        Times of the rows, shape (N+1,), s.
    reference
        Joint values, rates and accelerations: (N+1, n) for all arms, or (1, B, n) of each, the same at all times.
    open_step, closed_step
        The step under given torques, and the one with the control law where the controller has one.
    substeps
        Steps in each control period.
    most
        Largest torques, shape (1, n) or (B, n).
    measuring
        What a controller sees, where that is not the state.
    measured
        Whether errors are.
    """

    description: Description
    controller: Controller | None
    t: Array
    reference: Samples
    open_step: StepKernel
    closed_step: StepKernel | None
    substeps: int
    most: Array
    measuring: Measuring | None
    measured: bool
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def __call__(self, record: Record, threads: int, progress: Progress | None) -> None:
        """Fill a record."""
        size, steps = len(record.q), len(self.t) - 1
        if self.closed_step is None:
            self._run(record, threads, lambda k: progress(k, steps) if progress else None)
            return
        count = -(-size // BLOCK)
        blocks = [slice(size * k // count, size * (k + 1) // count) for k in range(count)]
        done = [0] * count

        def told(block: int, step: int) -> None:
            if progress is not None:
                with self._lock:
                    done[block] = step
                    progress(sum(done) // count, steps)

        def advance(share: range) -> None:
            for k in share:
                self._part(blocks[k], size)._run(record.part(blocks[k]), 1, partial(told, k))

        workers = min(threads, count)
        all_in_threads(advance, [range(i, count, workers) for i in range(workers)])

    def _part(self, rows: slice, size: int) -> BatchRun:
        """Return the run of some of the arms."""
        reference = self.reference
        if reference[0].ndim == 3:
            reference = reference[0][:, rows], reference[1][:, rows], reference[2][:, rows]
        closed = None if self.closed_step is None else self.closed_step.rows(rows)
        return replace(
            self,
            reference=reference,
            most=self.most if len(self.most) != size else self.most[rows],
            open_step=self.open_step.rows(rows),
            closed_step=closed,
        )

    def _run(self, record: Record, threads: int, told: Callable[[int], None]) -> None:
        """Fill a record, all its arms together."""
        steps = len(self.t) - 1
        states: tuple[Array, Array, Array] = (record.q, record.qd, record.works)
        setpoints = np.concatenate(self.reference, axis=-1)
        closed = self.closed_step
        for k in range(steps + 1):
            if closed is None:
                asked = self._asked(k, *states[:2])
            else:
                later, asked = _room(states), np.empty_like(states[0])
                closed(states, setpoints[min(k, len(setpoints) - 1)], (*later, asked), threads)
            given = self._cut_off(asked) if closed is None or self.measured or self.substeps > 1 else asked
            if self.measured:
                self._measure(record, k, states[0], asked, given)
            for row, value in zip(record.rows, (*states[:2], given, asked), strict=False):
                row[:, k] = value
            if k == steps:
                break
            if closed is not None:
                states = later
            for _ in range(0 if closed is None else 1, self.substeps):
                # New arrays each time: a controller may keep those that it was given.
                later = _room(states)
                self.open_step(states, given, later, threads)
                states = later
            if k % PROGRESS_EVERY == PROGRESS_EVERY - 1:
                told(k + 1)
        for kept, value in zip((record.q, record.qd, record.works), states, strict=True):
            kept[:] = value

    def _setpoint(self, k: int) -> Setpoint:
        return Setpoint(self.description, *(array[min(k, len(array) - 1)] for array in self.reference))

    def _asked(self, k: int, q: Array, qd: Array) -> Array:
        """Return the torques that the controller asks for, shape (B, n)."""
        if self.controller is None:
            return np.zeros_like(q)
        time = float(self.t[k])
        seen = q.view(), qd.view()
        for array in seen:
            array.flags.writeable = False
        if self.measuring is not None:
            seen = self.measuring(q, qd)
        returned = called(self.controller, time, *seen, self._setpoint(k))
        try:
            asked = np.ascontiguousarray(np.broadcast_to(number_array(returned, "torques", "(N, n)"), q.shape))
        except (TypeError, ValueError):
            raise SimulationError(
                f"the controller returned {type(returned).__name__} of shape {np.shape(returned)} at {time:g} s;"
                f" expected torques {q.shape}"
            ) from None
        if not np.isfinite(asked.sum()):
            sane = (np.abs(q) < DIVERGED).all(axis=1) & (np.abs(qd) < DIVERGED).all(axis=1)
            wrong = ~np.isfinite(asked).all(axis=1) & sane
            if wrong.any():
                run = int(np.argmax(wrong))
                raise SimulationError(f"the controller's torques of run {run} are not finite at {time:g} s")
        return asked

    def _cut_off(self, asked: Array) -> Array:
        """Return torques as the drives can give them."""
        if np.isinf(self.most).all():
            return asked
        given: Array = np.minimum(asked, self.most)
        np.maximum(given, -self.most, out=given)
        return given

    def _measure(self, record: Record, k: int, q: Array, asked: Array, given: Array) -> None:
        error = self._setpoint(k).q - q
        record.squares[:] += error * error
        np.abs(error, out=error)
        np.maximum(record.peak, error, out=record.peak)
        if given is not asked:
            record.cut[:] += given != asked
        np.minimum(record.lowest, q, out=record.lowest)
        np.maximum(record.highest, q, out=record.highest)


def _room(states: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
    q, qd, works = states
    return np.empty_like(q), np.empty_like(qd), np.empty_like(works)


def closed_step(
    arms: Sequence[Description], friction: Friction | None, h: float, law: Law, most: Array, reference: Samples
) -> StepKernel:
    """Return the step with a control law, for limits of torques and a reference as :class:`BatchRun` has them.

    Gains, limits and arms that all runs share are numbers of the program; others are one row for each run.
    """
    q = reference[0]
    setpoint = np.zeros(3 * q.shape[-1]) if q.ndim == 2 else np.concatenate([x[0] for x in reference], axis=-1)
    return StepKernel.closed_loop(arms, friction, h, law, most[0] if len(most) == 1 else most, setpoint)
