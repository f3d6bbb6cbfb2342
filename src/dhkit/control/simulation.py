"""Simulation of an arm under a controller: checks of the arguments; the run itself is in :mod:`dhkit.control.runs`."""

from __future__ import annotations

import logging
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from dhkit.control.controller import NO_STATE, Controller, require_fits
from dhkit.control.integrators import State
from dhkit.control.options import SimulationKeywords, SimulationOptions
from dhkit.control.plant import Plant
from dhkit.control.references import Held, Reference, reference_of
from dhkit.control.result import SimulationResult
from dhkit.control.runs import ContinuousRun, SampledRun
from dhkit.control.timing import (
    MAX_STEPS,
    require_positive,
    row_times,
    sampled_reference,
    steps_a_period,
    substeps,
)
from dhkit.description import Array, Description, joint_vector, takes_robot
from dhkit.description.joint_text import joint_text, violated_limit_text
from dhkit.trajectories import Trajectory

log = logging.getLogger(__name__)
LIMIT_TOLERANCE = 1e-9
"""Distance beyond a joint limit (rad or m) that counts as rounding and is corrected without a message."""

ROWS_RATE = 1000.0
"""Rows of a continuous run's result, Hz."""


@takes_robot
def simulate(
    description: Description,
    controller: Controller | None = None,
    reference: Reference | Trajectory | ArrayLike | None = None,
    duration: float | None = None,
    q0: ArrayLike | None = None,
    qd0: ArrayLike | None = None,
    *,
    options: SimulationOptions | None = None,
    **keywords: Unpack[SimulationKeywords],
) -> SimulationResult:
    """Simulate an arm under a controller, called at a rate with its torques held between calls, or continuous.

    Sampled, the plant is integrated by the classical Runge-Kutta method in steps of 1 / ``plant_rate``, shorter where
    friction is stiff; continuous (``rate=None``), by DOP853 with steps of its own. Both are split where a joint with
    stiction stops or breaks away and where one hits its stop, which is looked for at the end of each step.

    Parameters
    ----------
    description
        The robot.
    controller
        See :class:`Controller`; None for no torque. It runs in this process and cannot be timed out.
    reference
        The reference to follow: a motion, joint values (n,) or a pose of the tool (4, 4) to hold, or a
        :class:`Reference`. None holds ``q0``.
    duration
        s; that of the reference unless given. Rounded to whole periods.
    q0, qd0
        Joint values and rates at the start, shape (n,), rad, m and per second; the reference's first joint values and
        zero rates unless given.
    options, **keywords
        Fields of :class:`SimulationOptions`, as one value or one by one: ``plant``, ``friction``, ``restitution``,
        ``pushes``, ``rate``, ``plant_rate``, ``sensors``, ``saturation``, ``tolerance``, ``progress``.

    Returns
    -------
    SimulationResult
        The run, N+1 states.

    Raises
    ------
    SimulationError
        The controller raises, or returns something else than a finite array of shape (n,), or the arm's state is no
        longer finite. Names the time; ``result`` holds the rows until then.
    DescriptionError
        A link without a body.
    ValueError, TypeError
        An argument that does not fit: says which, and what is expected.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.control import PID
    >>> from dhkit.trajectories import quintic
    >>> arm = library_robot("planar2r")
    >>> run = simulate(arm, PID.tuned(arm), quintic(arm, [0, 0], [0.5, 1.0], duration=1.0))
    >>> run.q.shape
    (1001, 2)
    """
    chosen = SimulationOptions.of(options, keywords)
    require_fits(controller, description)
    moved = chosen.moving(description)
    rate = chosen.rate
    plant_rate = chosen.plant_rate
    followed = _reference_or_hold(description, reference, q0)
    require_positive(duration=duration)
    t = row_times(followed.duration, duration, (plant_rate or ROWS_RATE) if rate is None else rate)
    setpoints = sampled_reference(description, followed, t)
    effort_limits = (
        moved.description.numbers.effort if chosen.saturation else np.full(moved.n, np.inf)
    )
    q = _state(description, q0, setpoints[0][0], "q0")
    qd = _state(description, qd0, setpoints[1][0], "qd0")
    _warn_beyond_stops(moved, setpoints[0])
    q = _moved_to_stops(moved, q, "q0" if q0 is not None else "the reference's first state")
    run_arguments = (description, moved, controller, t, setpoints, effort_limits)
    if rate is None:
        # DOP853's steps in stiff friction are about as long as those of a fixed step.
        substeps(moved.stiffness, t[-1] / MAX_STEPS)
        continuous = ContinuousRun(
            *run_arguments, continuous_reference=followed, q0=q, tolerance=chosen.tolerance
        )
        return continuous(State(0.0, q, qd, continuous.memory), chosen.progress)
    steps = substeps(moved.stiffness, 1 / rate, steps_a_period(rate, plant_rate, len(t)))
    measuring = None if chosen.sensors is None else chosen.sensors.start(moved.n, 1 / rate)
    sampled = SampledRun(*run_arguments, substeps=steps, measuring=measuring)
    return sampled(State(0.0, q, qd, NO_STATE), chosen.progress)


def _reference_or_hold(description: Description, reference: Any, q0: ArrayLike | None) -> Reference:
    if reference is not None:
        return reference_of(description, reference, q0)
    return Held(_state(description, q0, np.zeros(description.n), "q0"))


def _warn_beyond_stops(plant: Plant, q: Array) -> None:
    """Log a warning if the reference leads beyond the stops, where the arm cannot follow."""
    lower, upper = plant.limits
    beyond = np.maximum(q - upper, lower - q).max(axis=0)
    if (beyond > LIMIT_TOLERANCE).any():
        i = int(np.argmax(beyond))
        log.warning(
            "the reference leads %s by %s beyond its limits; are its angles in degrees?",
            plant.description.joints[i].name,
            joint_text(beyond[i], slides=bool(plant.description.numbers.prismatic[i]), digits=3),
        )


def _moved_to_stops(plant: Plant, q: Array, name: str) -> Array:
    """Return the first state, clipped to the stops where it passes them by rounding.

    Raises
    ------
    ValueError
        A joint value beyond a stop by more than rounding.
    """
    lower, upper = plant.limits
    if ((q >= lower - LIMIT_TOLERANCE) & (q <= upper + LIMIT_TOLERANCE)).all():
        return np.clip(q, lower, upper)
    i = int(np.argmax((q < lower) | (q > upper)))
    joint = plant.description.joints[i]
    text = violated_limit_text(q[i], lower[i], upper[i], slides=not joint.is_revolute, digits=4)
    raise ValueError(
        f"{name}: {joint.name} is {text}; expected joint values inside, or restitution=None for no stops"
    )


def _state(description: Description, given: ArrayLike | None, default: Array, name: str) -> Array:
    return (default if given is None else joint_vector(description, given, name)).copy()
