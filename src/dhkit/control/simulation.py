"""Simulating an arm under a controller: what is asked for is checked here, and run in :mod:`dhkit.control.runs`."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dhkit.control.controller import Controller, require_fits
from dhkit.control.integrators import State
from dhkit.control.plant import Plant
from dhkit.control.references import Held, Reference, reference_of
from dhkit.control.result import SimulationResult
from dhkit.control.runs import ContinuousRun, Progress, SampledRun
from dhkit.control.sensors import Sensors
from dhkit.control.timing import (
    MOST_STEPS,
    require_positive,
    row_times,
    sampled_reference,
    steps_a_period,
    substeps,
)
from dhkit.description import Array, Description, joint_vector, takes_robot
from dhkit.description.joint_words import joint_words, outside_words
from dhkit.trajectories import Trajectory

log = logging.getLogger(__name__)
ROUNDING = 1e-9
"""rad or m beyond a limit that is not worth a word."""

ROWS_RATE = 1000.0
"""Hz: rows of a continuous run's result."""
TOLERANCES = (3e-14, 1e-3)
"""What DOP853 can meet in doubles, and what would be no accuracy."""


@takes_robot
def simulate(
    description: Description,
    controller: Controller | None = None,
    reference: Reference | Trajectory | ArrayLike | None = None,
    duration: float | None = None,
    q0: ArrayLike | None = None,
    qd0: ArrayLike | None = None,
    rate: float | None = 1000.0,
    plant: Plant | None = None,
    plant_rate: float | None = None,
    *,
    sensors: Sensors | None = None,
    saturation: bool = True,
    tolerance: float = 1e-13,
    progress: Progress | None = None,
) -> SimulationResult:
    """Return how an arm moves under a controller: called at a rate with its torques held in between, or continuous.

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
        What is to be followed: a motion, joint values (n,) or a pose of the tool (4, 4) to hold, or a
        :class:`Reference`. None holds ``q0``.
    duration
        s; that of the reference unless given. Rounded to whole periods.
    q0, qd0
        Where the run begins, shape (n,), rad, m and per second; where the reference begins, at rest, unless given.
    rate
        Calls of the controller, Hz; None for a continuous controller.
    plant
        What moves, where it differs from the robot: see :class:`Plant`. The robot without friction, with inelastic
        stops, unless given.
    plant_rate
        Steps of the integration, Hz, a multiple of ``rate``; ``rate`` unless given. Of a continuous run, rows of its
        result a second; 1000 unless given.
    sensors
        What the controller sees; the true state unless given. Only sampled.
    saturation
        Whether torques are cut off at the drives' limits.
    tolerance
        Of a step of DOP853, relative and absolute.
    progress
        Called after every thousand rows; an exception in it ends the run.

    Returns
    -------
    SimulationResult
        N+1 states.

    Raises
    ------
    SimulationError
        The controller raises or returns what is no finite (n,) array, or the arm's state is no longer finite: names the
        time; ``result`` holds what was simulated until then.
    DescriptionError
        A link without a body.
    ValueError, TypeError
        An argument that does not fit: says which, and what is expected.
    """
    _require_types(plant=(plant, Plant), sensors=(sensors, Sensors))
    _require_flag("saturation", saturation)
    require_fits(controller, description)
    moved = Plant(description) if plant is None else plant
    if moved.description.kinds != description.kinds:
        raise ValueError(f"the plant has joints {moved.description.kinds}; expected {description.kinds}")
    wanted = _wanted(description, reference, q0)
    require_positive(rate=rate, plant_rate=plant_rate, duration=duration)
    t = row_times(wanted.duration, duration, (plant_rate or ROWS_RATE) if rate is None else rate)
    asked = sampled_reference(description, wanted, t)
    most = moved.description.numbers.effort if saturation else np.full(moved.n, np.inf)
    q, qd = _state(description, q0, asked[0][0], "q0"), _state(description, qd0, asked[1][0], "qd0")
    _tell_beyond(moved, asked[0])
    q = _inside(moved, q, "q0" if q0 is not None else "the reference's first state")
    memory = np.zeros(0)
    run: ContinuousRun | SampledRun
    if rate is None:
        if sensors is not None:
            raise ValueError("sensors measure samples; expected a rate in Hz, or no sensors")
        if not TOLERANCES[0] <= tolerance <= TOLERANCES[1]:
            raise ValueError(f"tolerance is {tolerance!r}; expected {TOLERANCES[0]:g} to {TOLERANCES[1]:g}")
        # DOP853's steps in stiff friction are about as long as those of a fixed step.
        substeps(moved.stiffness, t[-1] / MOST_STEPS)
        run = ContinuousRun(description, moved, controller, t, asked, most, wanted=wanted, q0=q, tolerance=tolerance)
        memory = run.memory
    else:
        steps = substeps(moved.stiffness, 1 / rate, steps_a_period(rate, plant_rate, len(t)))
        measuring = None if sensors is None else sensors.started(moved.n, 1 / rate)
        run = SampledRun(description, moved, controller, t, asked, most, substeps=steps, measuring=measuring)
    return run(State(0.0, q, qd, memory), progress)


def _wanted(description: Description, reference: Any, q0: ArrayLike | None) -> Reference:
    if reference is not None:
        return reference_of(description, reference, q0)
    return Held(_state(description, q0, np.zeros(description.n), "q0"))


def _require_types(**arguments: tuple[object, type]) -> None:
    for name, (value, kind) in arguments.items():
        if value is not None and not isinstance(value, kind):
            raise TypeError(f"{name} is {type(value).__name__}; expected a {kind.__name__}, or None")


def _require_flag(name: str, value: object) -> None:
    if not isinstance(value, bool | np.bool_):
        raise TypeError(f"{name} is {value!r}; expected True or False")


def _tell_beyond(plant: Plant, q: Array) -> None:
    """Log that a reference leads beyond the stops, where the arm cannot follow."""
    lower, upper = plant.limits
    beyond = np.maximum(q - upper, lower - q).max(axis=0)
    if (beyond > ROUNDING).any():
        i = int(np.argmax(beyond))
        log.warning(
            "the reference leads %s by %s beyond its limits; are its angles in degrees?",
            plant.description.joints[i].name,
            joint_words(beyond[i], slides=bool(plant.description.numbers.prismatic[i]), digits=3),
        )


def _inside(plant: Plant, q: Array, name: str) -> Array:
    """Return a first state, moved to the stops where it is beyond them by rounding; no arm is in another such state."""
    lower, upper = plant.limits
    if ((q >= lower - ROUNDING) & (q <= upper + ROUNDING)).all():
        return np.clip(q, lower, upper)
    i = int(np.argmax((q < lower) | (q > upper)))
    joint = plant.description.joints[i]
    words = outside_words(q[i], lower[i], upper[i], slides=not joint.is_revolute, digits=4)
    raise ValueError(f"{name}: {joint.name} is {words}; expected joint values inside, or restitution=None for no stops")


def _state(description: Description, given: ArrayLike | None, default: Array, name: str) -> Array:
    return (default if given is None else joint_vector(description, given, name)).copy()
