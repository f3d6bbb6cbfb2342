"""Many arms at once: batches of states, gains and arms advanced together by kernels."""

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
from dhkit.control.timing import (
    require_positive,
    row_times,
    sampled_reference,
    steps_a_period,
    substeps,
)
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
    """Simulate a batch of arms under one controller, and return their motions.

    The size B of the batch is that of ``q0``, ``qd0``, ``plant``, ``reference`` or the gains, each of one row or of B.
    Torques are constant in a period of the controller, as in :func:`simulate`, and all arms take the same steps of the
    classical Runge-Kutta method. There are no joint stops, no pushes (external forces) and no stiction: dry friction
    has to be smooth.

    Parameters
    ----------
    description
        The robot that the controller and the reference know.
    controller
        Called for all arms at once with the time, s, joint values and rates (B, n), and a setpoint whose arrays are
        (n,), or (B, n) where each arm holds joint values of its own; returns torques (B, n). dhkit's controllers accept
        batches, with gains (n,) or (B, n), except for :class:`OperationalSpace` and :class:`Adaptive`; the control law
        of several is part of the compiled step. None: no torques.
    reference
        As for :func:`simulate`, but not a pose; one for all, or joint values (B, n) to hold. None holds ``q0``.
    duration
        As for :func:`simulate`.
    q0, qd0
        Joint values and rates at the start, shape (n,) or (B, n), rad, m and per second; those of the reference at its
        start unless given, or zero.
    options, **keywords
        Fields of :class:`BatchOptions`, as one value or one by one: ``plant``, ``friction``, ``rate``, ``plant_rate``,
        ``keep``, ``sensors``, ``saturation``, ``threads``, ``progress``.

    Returns
    -------
    BatchResult
        Final states, errors and energies of each arm, and with ``keep="all"`` all states.

    Raises
    ------
    SimulationError
        The controller raises, or returns another shape, or for a finite state torques that are not finite.
    DescriptionError
        A link without a body.
    ValueError, TypeError
        An argument that does not fit: says which, and what is expected.

    Examples
    --------
    >>> import numpy as np
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> released = np.zeros((5, 2))
    >>> result = simulate_batch(arm, None, q0=released, duration=0.1, friction=False)
    >>> result.q.shape
    (5, 2)
    """
    chosen = BatchOptions.of(options, keywords)
    friction = Friction.chosen(chosen.friction)
    rate = chosen.rate
    keep = chosen.keep
    sensors = chosen.sensors
    if not getattr(controller, "batches", True):
        name = type(controller).__name__
        raise ValueError(
            f"{name} controls one arm at a time; expected another controller, or simulate() for each arm"
        )
    require_fits(controller, description)
    require_positive(duration=duration)
    moving = chosen.moving(description)
    n = description.n

    # Setpoints q, qd and qdd: each (rows, n), or one row, (1, n) or (1, B, n), where joint values are held.
    if isinstance(reference, Trajectory | Reference):
        followed = reference_of(description, reference)
        t = row_times(followed.duration, duration, rate)
        setpoints = sampled_reference(description, followed, t)
    else:
        given, name = (q0, "q0") if reference is None else (reference, "reference")
        array = np.asarray(0.0 if given is None else given)
        # Four arms of four joints whose last holds 0 0 0 1 would look like this too.
        if array.shape == (4, 4) and np.array_equal(array[3], [0, 0, 0, 1]):
            raise ValueError(
                f"{name} looks like a pose of the tool; a batch holds joint values, ({n},) or (B, {n})"
            )
        held = _states(description, given, np.zeros(n), name)
        t = row_times(None, duration, rate)
        setpoints = held[None], np.zeros((1, *held.shape)), np.zeros((1, *held.shape))
    q = _states(description, q0, setpoints[0][0], "q0")
    qd = _states(description, qd0, setpoints[1][0], "qd0")
    size = _size(
        q,
        qd,
        setpoints[0][0],
        np.empty((len(moving), n)),
        np.empty((*getattr(controller, "batch_shape", ()), n)),
    )
    # q, qd, applied and commanded torques, of 8 bytes each.
    if keep == "all" and (needed := 4 * 8 * size * len(t) * n) > MAX_STORED_BYTES:
        raise ValueError(
            f"all states are {needed / 1e9:.3g} GB; expected at most {MAX_STORED_BYTES / 1e9:g} GB"
        )
    different_arms = {id(arm): arm for arm in moving}.values()
    stiffness = max(Plant(arm, friction, None).stiffness for arm in different_arms)
    steps = substeps(stiffness, 1 / rate, steps_a_period(rate, chosen.plant_rate, len(t)))
    h = 1 / rate / steps  # length of a step, s
    effort = np.stack([arm.numbers.effort for arm in moving])
    if len(setpoints[0]) == 1:
        setpoints = (
            _rows(setpoints[0][0], size)[None],
            np.zeros((1, size, n)),
            np.zeros((1, size, n)),
        )
    for array in setpoints:
        array.flags.writeable = False
    effort_limits = effort if chosen.saturation else np.full((1, n), np.inf)
    # A law in the step sees the true state, not what sensors measure.
    law = law_of(controller) if sensors is None else None
    step_with_law = (
        None if law is None else closed_step(moving, friction, h, law, effort_limits, setpoints)
    )
    run = BatchRun(
        description=description,
        controller=controller,
        t=t,
        reference=setpoints,
        open_step=StepKernel.open(moving, friction, h),
        closed_step=step_with_law,
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
    run: BatchRun,
    record: Record,
    arms: tuple[Description, ...],
    friction: Friction | None,
    keep: str,
) -> BatchResult:
    """Return the result of a run from its record; ``arms`` are those that moved."""
    size, n = record.q.shape
    rows = len(run.t)
    reference = [np.broadcast_to(_with_batch_axis(x), (size, rows, n)) for x in run.reference[:2]]
    has_norms = run.measured
    lower = np.stack([arm.numbers.lower for arm in arms])
    upper = np.stack([arm.numbers.upper for arm in arms])
    return BatchResult(
        arms=arms,
        friction=friction,
        t=run.t,
        q0=record.q0,
        qd0=record.qd0,
        q=record.q,
        qd=record.qd,
        final_error=run.reference[0][-1] - record.q,
        peak_error=record.peak if has_norms else None,
        rms_error=np.sqrt(record.squares / rows) if has_norms else None,
        saturated=record.saturated_steps / rows if has_norms else None,
        # NaN is outside.
        outside=np.any(~((record.lowest >= lower) & (record.highest <= upper)), axis=1)
        if has_norms
        else None,
        works=record.works,
        history=History(*record.rows, *reference) if keep == "all" else None,
    )


def _with_batch_axis(reference: Array) -> Array:
    """Return a reference with the axis of the batch before that of time: shape (1, rows, n) or (B, 1, n)."""
    return reference[None] if reference.ndim == 2 else reference.transpose(1, 0, 2)


def _states(description: Description, given: ArrayLike | None, default: Array, name: str) -> Array:
    """Return joint values or rates, shape (n,) or (B, n), checked to be finite; the default where none are given."""
    if given is None:
        return default
    states = joint_array(description, given, name)
    if states.ndim > 2 or not np.isfinite(states).all():
        n = description.n
        raise ValueError(f"{name} has shape {states.shape}; expected ({n},) or (B, {n}), finite")
    return states


def _rows(array: Array, size: int) -> Array:
    """Return an array (n,) or (B, n) as a contiguous (B, n), whose sums are five times as fast as a view's."""
    return np.array(np.broadcast_to(array, (size, array.shape[-1])), order="C")


def _size(*arrays: Array) -> int:
    """Return the size of the batch that arrays (n,) and (B, n) broadcast to."""
    sizes = {len(array) for array in arrays if array.ndim == 2 and len(array) != 1}
    if len(sizes) > 1:
        raise ValueError(
            f"states, references, gains and arms are of batches of {', '.join(map(str, sorted(sizes)))}; expected one"
        )
    return sizes.pop() if sizes else 1
