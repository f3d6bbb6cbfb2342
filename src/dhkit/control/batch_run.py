"""The steps of a batch: a control law inside the program, block by block, or a controller called for all arms."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from dhkit.control.controller import Controller, call_controller
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
"""Largest number of arms that take a step together: few calls for each step, and states that fit the CPU's cache."""
DIVERGED = 1e100
"""Joint value or rate (rad, m, per second) from which a run counts as diverged: its torques may overflow without an
error, and the run ends in NaN."""


@dataclass(frozen=True, eq=False)
class Record:
    """Stored values of a batch, filled by a run: arrays of shape (B, n) unless another is given."""

    q0: Array
    qd0: Array
    q: Array
    """Joint values of the last states, rad and m."""
    qd: Array
    works: Array
    """Works of ``WORKS`` from the start, shape (B, 3), J."""
    peak: Array
    """Largest absolute errors of the joint values so far, rad and m."""
    squares: Array
    """Sums of squared errors over the rows so far, rad^2 and m^2."""
    saturated_steps: Array
    """Number of steps in which the torque was cut off at the drive's limit."""
    lowest: Array
    """Lowest joint values so far, rad and m."""
    highest: Array
    rows: tuple[Array, ...]
    """Joint values, rates, applied and commanded torques at all times, shape (B, N+1, n); empty unless stored."""

    @classmethod
    def empty(cls, q: Array, qd: Array, kept: int) -> Record:
        """Return the record of a run from states q and qd (B, n), SI units, that stores ``kept`` rows of each arm."""
        peak, squares, saturated_steps = (np.zeros_like(q) for _ in range(3))
        rows = tuple(np.empty((len(q), kept, q.shape[1])) for _ in range(4 if kept else 0))
        works = np.zeros((len(q), len(WORKS)))
        return cls(
            q,
            qd,
            q.copy(),
            qd.copy(),
            works,
            peak,
            squares,
            saturated_steps,
            q.copy(),
            q.copy(),
            rows,
        )

    def part(self, rows: slice) -> Record:
        """Return the record of some of the arms, as views."""
        arrays = {
            name: getattr(self, name)[rows] for name in self.__dataclass_fields__ if name != "rows"
        }
        return Record(**arrays, rows=tuple(x[rows] for x in self.rows))


@dataclass(frozen=True, eq=False)
class BatchRun:
    """A run of a batch.

    Parameters
    ----------
    description
        The robot that the controller knows.
    t
        Times of the rows, shape (N+1,), s.
    reference
        Joint values, rates and accelerations: (N+1, n) for all arms, or (1, B, n) of each, the same at all times.
    open_step, closed_step
        The step under constant torques, and the step that includes the control law; None if the controller has no law.
    substeps
        Integration steps in each control period.
    effort_limits
        Largest torques of the drives, shape (1, n) or (B, n), N m and N.
    measuring
        The sensors whose values the controller gets; None if it gets the true state.
    measured
        Whether error norms are recorded.
    """

    description: Description
    controller: Controller | None
    t: Array
    reference: Samples
    open_step: StepKernel
    closed_step: StepKernel | None
    substeps: int
    effort_limits: Array
    measuring: Measuring | None
    measured: bool
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def __call__(self, record: Record, threads: int, progress: Progress | None) -> None:
        """Fill a record."""
        size = len(record.q)
        steps = len(self.t) - 1
        if self.closed_step is None:
            self._run(record, threads, lambda k: progress(k, steps) if progress else None)
            return
        count = -(-size // BLOCK)
        blocks = [slice(size * k // count, size * (k + 1) // count) for k in range(count)]
        done = [0] * count

        def report_step(block: int, step: int) -> None:
            if progress is not None:
                with self._lock:
                    done[block] = step
                    progress(sum(done) // count, steps)

        def advance(share: range) -> None:
            for k in share:
                self._of_rows(blocks[k], size)._run(
                    record.part(blocks[k]), 1, partial(report_step, k)
                )

        workers = min(threads, count)
        all_in_threads(advance, [range(i, count, workers) for i in range(workers)])

    def _of_rows(self, rows: slice, size: int) -> BatchRun:
        """Return the run of some of the arms."""
        reference = self.reference
        if reference[0].ndim == 3:
            reference = reference[0][:, rows], reference[1][:, rows], reference[2][:, rows]
        closed = None if self.closed_step is None else self.closed_step.rows(rows)
        return replace(
            self,
            reference=reference,
            effort_limits=self.effort_limits
            if len(self.effort_limits) != size
            else self.effort_limits[rows],
            open_step=self.open_step.rows(rows),
            closed_step=closed,
        )

    def _run(self, record: Record, threads: int, report_step: Callable[[int], None]) -> None:
        """Fill a record; all its arms take each step together."""
        steps = len(self.t) - 1
        states: tuple[Array, Array, Array] = (record.q, record.qd, record.works)
        setpoints = np.concatenate(self.reference, axis=-1)
        closed = self.closed_step
        for k in range(steps + 1):
            if closed is None:
                commanded = self._commanded(k, *states[:2])
            else:
                later = _empty_like(states)
                commanded = np.empty_like(states[0])
                closed(states, setpoints[min(k, len(setpoints) - 1)], (*later, commanded), threads)
            applied = (
                self._saturate(commanded)
                if closed is None or self.measured or self.substeps > 1
                else commanded
            )
            if self.measured:
                self._record_errors(record, k, states[0], commanded, applied)
            for row, value in zip(record.rows, (*states[:2], applied, commanded), strict=False):
                row[:, k] = value
            if k == steps:
                break
            if closed is not None:
                states = later
            # The closed step is the first of the period; in the others its torques are held.
            for _ in range(0 if closed is None else 1, self.substeps):
                # New arrays each time: a controller may keep those that it was given.
                later = _empty_like(states)
                self.open_step(states, applied, later, threads)
                states = later
            if k % PROGRESS_EVERY == PROGRESS_EVERY - 1:
                report_step(k + 1)
        for kept, value in zip((record.q, record.qd, record.works), states, strict=True):
            kept[:] = value

    def _setpoint(self, k: int) -> Setpoint:
        return Setpoint(
            self.description, *(array[min(k, len(array) - 1)] for array in self.reference)
        )

    def _commanded(self, k: int, q: Array, qd: Array) -> Array:
        """Return the torques that the controller commands in row k, shape (B, n), N m and N."""
        if self.controller is None:
            return np.zeros_like(q)
        time = float(self.t[k])
        measured_state = q.view(), qd.view()
        for array in measured_state:
            array.flags.writeable = False
        if self.measuring is not None:
            measured_state = self.measuring(q, qd)
        returned = call_controller(self.controller, time, *measured_state, self._setpoint(k))
        try:
            commanded = np.ascontiguousarray(
                np.broadcast_to(number_array(returned, "torques", "(N, n)"), q.shape)
            )
        except (TypeError, ValueError):
            raise SimulationError(
                f"the controller returned {type(returned).__name__} of shape {np.shape(returned)} at {time:g} s;"
                f" expected torques {q.shape}"
            ) from None
        if not np.isfinite(commanded.sum()):
            is_bounded = (np.abs(q) < DIVERGED).all(axis=1) & (np.abs(qd) < DIVERGED).all(axis=1)
            wrong = ~np.isfinite(commanded).all(axis=1) & is_bounded
            if wrong.any():
                run = int(np.argmax(wrong))
                raise SimulationError(
                    f"the controller's torques of run {run} are not finite at {time:g} s"
                )
        return commanded

    def _saturate(self, commanded: Array) -> Array:
        """Return commanded torques cut off at the drives' limits, shape (B, n)."""
        if np.isinf(self.effort_limits).all():
            return commanded
        return np.clip(commanded, -self.effort_limits, self.effort_limits)

    def _record_errors(
        self, record: Record, k: int, q: Array, commanded: Array, applied: Array
    ) -> None:
        error = self._setpoint(k).q - q
        record.squares[:] += error * error
        np.abs(error, out=error)
        np.maximum(record.peak, error, out=record.peak)
        if applied is not commanded:
            record.saturated_steps[:] += applied != commanded
        np.minimum(record.lowest, q, out=record.lowest)
        np.maximum(record.highest, q, out=record.highest)


def _empty_like(states: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
    q, qd, works = states
    return np.empty_like(q), np.empty_like(qd), np.empty_like(works)


def closed_step(
    arms: Sequence[Description],
    friction: Friction | None,
    h: float,
    law: Law,
    effort_limits: Array,
    reference: Samples,
) -> StepKernel:
    """Return the step with a control law, for limits of torques and a reference as :class:`BatchRun` has them.

    Gains, limits and arms that all runs share are numbers of the program; others are one row for each run.
    """
    q = reference[0]
    setpoint = (
        np.zeros(3 * q.shape[-1])
        if q.ndim == 2
        else np.concatenate([x[0] for x in reference], axis=-1)
    )
    return StepKernel.closed_loop(
        arms,
        friction,
        h,
        law,
        effort_limits[0] if len(effort_limits) == 1 else effort_limits,
        setpoint,
    )
