"""When a run's rows are, how many integration steps lie between them, and what is asked for at each."""

from __future__ import annotations

from math import ceil

import numpy as np

from dhkit.control.gains import positive
from dhkit.control.references import Reference, Samples
from dhkit.description import Array, Description

NAMES = ("q", "qd", "qdd")
MOST_STEPS = 10_000_000
"""Of one run: what is kept of them is about 5 kB a step for each joint."""
STEPS_OF_STIFFNESS = 0.5
"""Largest step times the stiffness of friction: Runge and Kutta's method is stable up to 2.785; at 0.5 the energy
audit of a PUMA closes to 1e-9."""
MOST_SUBSTEPS = 1_000
"""In a control period."""


def require_positive(**values: float | None) -> None:
    """Refuse what is given and not a positive, finite number.

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
        s: how long the reference lasts, and what was asked for in its place; None for neither.
    rate
        Rows a second.

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
        raise ValueError(f"{span:g} s are less than half a period at {rate:g} Hz; expected a period at least")
    if steps > MOST_STEPS:
        raise ValueError(f"{span:g} s at {rate:g} Hz are {span * rate:.3g} steps; expected at most {MOST_STEPS:,}")
    return np.arange(steps + 1) / rate


def steps_a_period(rate: float, plant_rate: float | None, periods: int = 1) -> int:
    """Return how many integration steps a control period has.

    Raises
    ------
    ValueError
        Not a whole number, or more than ten million steps in so many periods.
    """
    steps = 1 if plant_rate is None else plant_rate / rate
    if abs(steps - round(steps)) > 1e-9 or steps < 1 - 1e-9:
        raise ValueError(f"plant_rate is {plant_rate:g}; expected a multiple of rate, {rate:g}")
    if steps * periods > MOST_STEPS:
        raise ValueError(
            f"plant_rate {plant_rate:g} makes {steps * periods:.3g} steps; expected at most {MOST_STEPS:,}"
        )
    return round(steps)


def substeps(stiffness: float, period: float, asked: int = 1) -> int:
    """Return how many integration steps a control period takes, so that friction does not become unstable.

    Parameters
    ----------
    stiffness
        Of friction, 1/s: see :attr:`Plant.stiffness`.
    period
        s.
    asked
        At least so many.

    Raises
    ------
    ValueError
        More than a thousand, and more than were asked for.
    """
    needed = max(asked, ceil(min(stiffness * period / STEPS_OF_STIFFNESS, 1e9)))
    if needed > max(asked, MOST_SUBSTEPS):
        raise ValueError(
            f"friction is too stiff: its rate of {stiffness:.3g} 1/s takes {needed:,} steps in {period:g} s;"
            f" expected at most {MOST_SUBSTEPS:,}: a wider Friction(width), friction that is a step, or shorter periods"
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
        raise ValueError(f"the reference raised {type(error).__name__}: {' '.join(str(error).split())}") from error
    if len(found) != len(NAMES):
        raise ValueError(f"the reference returned {len(found)} arrays; expected {', '.join(NAMES)}")
    copies = []
    for name, value in zip(NAMES, found, strict=True):
        array = np.asarray(value)
        if array.dtype.kind not in "fiu" or array.shape != shape or not np.isfinite(array).all():
            raise ValueError(f"the reference's {name} has shape {array.shape}; expected {shape}, finite numbers")
        copy = np.array(array, dtype=float)
        copy.flags.writeable = False
        copies.append(copy)
    q, qd, qdd = copies
    return q, qd, qdd
