"""Time grid of a run: the rows' times, the integration steps between them, and the setpoint at each."""

from __future__ import annotations

from math import ceil

import numpy as np

from dhkit.control.gains import positive
from dhkit.control.references import Reference, Samples
from dhkit.description import Array, Description

NAMES = ("q", "qd", "qdd")
MAX_STEPS = 10_000_000
"""Largest number of rows or steps of a run. A row takes about 60 bytes for each joint."""
STEPS_OF_STIFFNESS = 0.5
"""Largest product of step length (s) and stiffness of friction (1/s). The Runge-Kutta method is stable up to 2.785;
at 0.5 the energy balance of a PUMA closes to 1e-9."""
MAX_SUBSTEPS = 1_000
"""Largest number of integration steps in a control period."""


def require_positive(**values: float | None) -> None:
    """Require positive, finite numbers; None is accepted.

    Raises
    ------
    ValueError
        Says the name, and what was found.
    """
    for name, value in values.items():
        if value is not None:
            positive(value, name)


def row_times(reference: float | None, duration: float | None, rate: float) -> Array:
    """Return the times of a run's rows, shape (N+1,), s.

    Parameters
    ----------
    reference, duration
        Duration of the reference, s, and the one given in its place, which has precedence; None if not given.
    rate
        Rows per second, Hz.

    Raises
    ------
    ValueError
        Neither is given, or more than ten million rows.
    """
    span = reference if duration is None else duration
    if span is None:
        raise ValueError("duration is not given, and the reference has no end")
    if duration is None:
        positive(span, "the reference's duration")
    steps = round(span * rate)
    if not steps:
        raise ValueError(
            f"{span:g} s are less than half a period at {rate:g} Hz; expected a period at least"
        )
    if steps > MAX_STEPS:
        raise ValueError(
            f"{span:g} s at {rate:g} Hz are {span * rate:.3g} steps; expected at most {MAX_STEPS:,}"
        )
    # k / rate, and not k times a rounded period, so that rounding errors do not grow with k.
    return np.arange(steps + 1) / rate


def steps_a_period(rate: float, plant_rate: float | None, periods: int = 1) -> int:
    """Return the number of integration steps in a control period that ``plant_rate`` (Hz) asks for.

    Raises
    ------
    ValueError
        Not a whole number, or more than ten million steps in so many periods.
    """
    steps = 1 if plant_rate is None else plant_rate / rate
    if abs(steps - round(steps)) > 1e-9 or steps < 1 - 1e-9:
        raise ValueError(f"plant_rate is {plant_rate:g}; expected a multiple of rate, {rate:g}")
    if steps * periods > MAX_STEPS:
        raise ValueError(
            f"plant_rate {plant_rate:g} makes {steps * periods:.3g} steps; expected at most {MAX_STEPS:,}"
        )
    return round(steps)


def substeps(stiffness: float, period: float, asked: int = 1) -> int:
    """Return the number of integration steps in a control period that keeps stiff friction stable.

    Parameters
    ----------
    stiffness
        Stiffness of friction, 1/s: see :attr:`Plant.stiffness`.
    period
        Control period, s.
    asked
        Smallest number of steps.

    Raises
    ------
    ValueError
        More than ``MAX_SUBSTEPS`` and more than ``asked``.
    """
    # N steps of h = period / N with stiffness h <= STEPS_OF_STIFFNESS; 1e9 stands for a stiffness without bound.
    needed = max(asked, ceil(min(stiffness * period / STEPS_OF_STIFFNESS, 1e9)))
    if needed > max(asked, MAX_SUBSTEPS):
        raise ValueError(
            f"friction is too stiff: its rate of {stiffness:.3g} 1/s takes {needed:,} steps in {period:g} s;"
            f" expected at most {MAX_SUBSTEPS:,}: a wider Friction(width), friction that is a step, or shorter periods"
        )
    return needed


def sampled_reference(description: Description, reference: Reference, t: Array) -> Samples:
    """Return joint values, rates and accelerations of a reference at times (N,), shape (N, n) each, read-only.

    They are copies: neither a reference nor a controller that changes what it is given changes the run.

    Raises
    ------
    ValueError
        The reference raises, returns something else than three arrays of this shape, or values that are not finite.
    """
    shape = (len(t), description.n)
    try:
        found = tuple(reference.sampled(t.copy()))
    except Exception as error:
        raise ValueError(
            f"the reference raised {type(error).__name__}: {' '.join(str(error).split())}"
        ) from error
    if len(found) != len(NAMES):
        raise ValueError(f"the reference returned {len(found)} arrays; expected {', '.join(NAMES)}")
    copies = []
    for name, value in zip(NAMES, found, strict=True):
        array = np.asarray(value)
        if array.dtype.kind not in "fiu" or array.shape != shape or not np.isfinite(array).all():
            raise ValueError(
                f"the reference's {name} has shape {array.shape}; expected {shape}, finite numbers"
            )
        copy = np.array(array, dtype=float)
        copy.flags.writeable = False
        copies.append(copy)
    q, qd, qdd = copies
    return q, qd, qdd
