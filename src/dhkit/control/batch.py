"""Many arms at once: batches of states, gains and arms advanced together by one kernel."""

from __future__ import annotations

from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from dhkit.control.batch_result import BatchResult, History
from dhkit.control.batch_run import BatchRun, Record, closed_step
from dhkit.control.controller import Controller, require_fits, reset
from dhkit.control.law import law_of
from dhkit.control.options import BatchKeywords, BatchOptions
from dhkit.control.plant import Plant
from dhkit.control.references import Reference, reference_of
from dhkit.control.step_kernel import StepKernel
from dhkit.control.timing import require_positive, row_times, sampled_reference, steps_a_period, substeps
from dhkit.description import Array, Description, joint_array, takes_robot
from dhkit.dynamics import Friction
from dhkit.trajectories import Trajectory

MAX_STORED_BYTES = 4_000_000_000
"""Largest size of the states that a batch stores with ``keep="all"``, bytes."""


@takes_robot
def simulate_batch(
    description: Description,
    controller: Controller | None = None,
    reference: Reference | Trajectory | ArrayLike | None = None,
    duration: float | None = None,
    q0: ArrayLike | None = None,
    qd0: ArrayLike | None = None,
    *,
    options: BatchOptions | None = None,
    **keywords: Unpack[BatchKeywords],
) -> BatchResult:
    """Return how a batch of arms moves under a controller that is called for all of them at once.

    The size B of the batch is that of ``q0``, ``qd0``, ``plant``, ``reference`` or the gains, which broadcast. All arms
    take the same steps of the classical Runge-Kutta method, as :func:`simulate` does. There are no joint stops, no
    pushes and no stiction: dry friction has to be smooth.

    Parameters
    ----------
    description
        The robot that the controller and the reference know.
    controller
        Called with joint values and rates (B, n) and a setpoint whose arrays are (n,), or (B, n) where each arm holds
        joint values of its own; returns torques (B, n). Those of dhkit can, with gains (n,) or (B, n), except for
        :class:`OperationalSpace` and :class:`Adaptive`.
    reference
        As for :func:`simulate`, one for all; or joint values (B, n) to hold. None holds ``q0``.
    q0, qd0
        Joint values and rates at the start, shape (n,) or (B, n), rad, m and per second.
    duration
        As for :func:`simulate`.
    options, **keywords
        Fields of :class:`BatchOptions`, as one value or one by one: ``plant``, ``friction``, ``rate``, ``plant_rate``,
        ``keep``, ``sensors``, ``saturation``, ``threads``, ``progress``.

    Raises
    ------
    SimulationError
        The controller raises, or returns another shape, or for a finite state torques that are not finite.
    DescriptionError
        A link without a body.
    ValueError, TypeError
        An argument that does not fit: says which, and what is expected.
    """
    chosen = BatchOptions.of(options, keywords)
    friction = Friction.chosen(chosen.friction)
    rate = chosen.rate
    keep = chosen.keep
    sensors = chosen.sensors
    if not getattr(controller, "batches", True):
        name = type(controller).__name__
        raise ValueError(f"{name} controls one arm at a time; expected another controller, or runs one by one")
    require_fits(controller, description)
    require_positive(duration=duration)
    moving = chosen.moving(description)
    n = description.n
    if isinstance(reference, Trajectory | Reference):
        followed = reference_of(description, reference)
        t = row_times(followed.duration, duration, rate)
        setpoints = sampled_reference(description, followed, t)
    else:
        given, name = (q0, "q0") if reference is None else (reference, "reference")
        array = np.asarray(0.0 if given is None else given)
        if array.shape == (4, 4) and np.array_equal(array[3], [0, 0, 0, 1]):
            raise ValueError(f"{name} looks like a pose of the tool; a batch holds joint values, ({n},) or (B, {n})")
        held = _states(description, given, np.zeros(n), name)
        t = row_times(None, duration, rate)
        setpoints = held[None], np.zeros((1, *held.shape)), np.zeros((1, *held.shape))
    q = _states(description, q0, setpoints[0][0], "q0")
    qd = _states(description, qd0, setpoints[1][0], "qd0")
    size = _size(
        q, qd, setpoints[0][0], np.empty((len(moving), n)), np.empty((*getattr(controller, "batch_shape", ()), n))
    )
    if keep == "all" and (needed := 4 * 8 * size * len(t) * n) > MAX_STORED_BYTES:
        raise ValueError(f"all states are {needed / 1e9:.3g} GB; expected at most {MAX_STORED_BYTES / 1e9:g} GB")
    stiffness = max(Plant(arm, friction, None).stiffness for arm in {id(arm): arm for arm in moving}.values())
    steps = substeps(stiffness, 1 / rate, steps_a_period(rate, chosen.plant_rate, len(t)))
    effort = np.stack([arm.numbers.effort for arm in moving])
    if len(setpoints[0]) == 1:
        setpoints = _rows(setpoints[0][0], size)[None], np.zeros((1, size, n)), np.zeros((1, size, n))
    for array in setpoints:
        array.flags.writeable = False
    effort_limits = effort if chosen.saturation else np.full((1, n), np.inf)
    law = law_of(controller) if sensors is None else None
    run = BatchRun(
        description=description,
        controller=controller,
        t=t,
        reference=setpoints,
        open_step=StepKernel.open(moving, friction, 1 / rate / steps),
        closed_step=None
        if law is None
        else closed_step(moving, friction, 1 / rate / steps, law, effort_limits, setpoints),
        substeps=steps,
        effort_limits=effort_limits,
        measuring=None if sensors is None else sensors.start(n, 1 / rate),
        measured=keep != "final",
    )
    record = Record.empty(_rows(q, size), _rows(qd, size), len(t) if keep == "all" else 0)
    reset(controller)
    run(record, chosen.threads, chosen.progress)
    return _result(run, record, moving, friction, keep)


def _result(
    run: BatchRun, record: Record, arms: tuple[Description, ...], friction: Friction | None, keep: str
) -> BatchResult:
    size, n = record.q.shape
    steps = len(run.t)
    reference = [np.broadcast_to(_with_batch_axis(x), (size, steps, n)) for x in run.reference[:2]]
    norms = keep != "final"
    lower, upper = (np.stack([getattr(arm.numbers, name) for arm in arms]) for name in ("lower", "upper"))
    return BatchResult(
        arms=arms,
        friction=friction,
        t=run.t,
        q0=record.q0,
        qd0=record.qd0,
        q=record.q,
        qd=record.qd,
        final_error=run.reference[0][-1] - record.q,
        peak_error=record.peak if norms else None,
        rms_error=np.sqrt(record.squares / steps) if norms else None,
        saturated=record.saturated_steps / steps if norms else None,
        outside=np.any(~((record.lowest >= lower) & (record.highest <= upper)), axis=1) if norms else None,
        works=record.works,
        history=History(*record.rows, *reference) if keep == "all" else None,
    )


def _with_batch_axis(reference: Array) -> Array:
    """Return a reference with the axis of the batch before that of time: shape (1, N, n) or (B, 1, n)."""
    return reference[None] if reference.ndim == 2 else reference.transpose(1, 0, 2)


def _states(description: Description, given: ArrayLike | None, default: Array, name: str) -> Array:
    """Return joint values or rates, shape (n,) or (B, n), finite."""
    if given is None:
        return default
    states = joint_array(description, given, name)
    if states.ndim > 2 or not np.isfinite(states).all():
        n = description.n
        raise ValueError(f"{name} has shape {states.shape}; expected ({n},) or (B, {n}), finite")
    return states


def _rows(array: Array, size: int) -> Array:
    """Return an array (n,) or (B, n) as a contiguous (B, n): sums take a fifth of the time of broadcast ones."""
    return np.array(np.broadcast_to(array, (size, array.shape[-1])), order="C")


def _size(*arrays: Array) -> int:
    """Return the size of the batch that arrays (n,) and (B, n) broadcast to."""
    sizes = {len(array) for array in arrays if array.ndim == 2 and len(array) != 1}
    if len(sizes) > 1:
        raise ValueError(
            f"states, references, gains and arms are of batches of {', '.join(map(str, sorted(sizes)))}; expected one"
        )
    return sizes.pop() if sizes else 1
