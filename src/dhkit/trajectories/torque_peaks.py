"""Proved bounds of the torques of a motion, between samples too.

In a cell of a motion a torque tau(t) is interpolated by cubics p through four neighbouring samples, h apart. Between
the two in the middle, and at the ends of the cell between any two of them,

    |tau(t) - p(t)| <= max |t - t_0| |t - t_1| |t - t_2| |t - t_3| / 4! D <= h^4 / 24 D

(Stoer and Bulirsch 2002, ch. 2.1.4), where D bounds the fourth derivative of the torque. It follows from the motion's
polynomials, see :mod:`dhkit.dynamics.torque_bounds`, and is too large by several powers of ten; the fourth power of h
makes up for that. Cells in which the bound does not decide are sampled more finely.

Smooth dry friction is part of tau. Dry friction that is a step is constant while a joint goes one way, and between two
bounds elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Description
from dhkit.dynamics import inverse_dynamics
from dhkit.dynamics.torque_bounds import dry_friction_bounds, torque_derivative_bounds
from dhkit.symbolic import Friction
from dhkit.trajectories.pieces import Pieces
from dhkit.trajectories.trajectory import Trajectory

ORDER = 4
"""Number of samples of an interpolant, and the order of the bounded derivative."""
_CELLS = 64
"""Least number of cells of a motion: derivatives are bounded over each, the more tightly the shorter it is."""
_FIRST_SAMPLES = 8
"""Number of samples of a cell at first, both its ends included."""
_MOST_SAMPLES = 4096
"""Largest number of samples of a cell."""
_TOLERANCE = 2e-8
"""Distance between bound and interpolant that is asked for, as a share of the limit."""
_RATE_ROUNDING = 1e-12
"""Rate, as a share of a joint's largest, that is rounding: a joint with it has not turned back."""
_BATCH = 65_536
"""Number of states that are computed at a time."""


@dataclass(frozen=True)
class TorquePeaks:
    """Largest torques of a motion's joints, as shares of their limits."""

    largest: Array
    """Upper bounds of |tau| / limit, shape (n,); 0 without a limit."""
    times: Array
    """Times near which they are reached, shape (n,), s."""
    seen: Array
    """Lower bounds, shape (n,): torques at samples."""
    is_proved: NDArray[np.bool_]
    """Whether the bound is below the limit, or within ``_TOLERANCE`` of the truth, shape (n,)."""


def torque_peaks(
    description: Description, trajectory: Trajectory, limit: Array, friction: Friction | None = None
) -> TorquePeaks:
    """Return proved bounds of the torques of a motion.

    Parameters
    ----------
    description
        The arm that moves, with a body on every link.
    trajectory
        The motion.
    limit
        Limits of the torques, shape (n,), N m and N; infinite where there is none.
    friction
        Friction that the torques include, None for none.
    """
    numbers = description.numbers
    intervals = len(trajectory.breaks) - 1
    cells = trajectory.pieces.divided(-(-_CELLS // intervals))
    width = np.diff(cells.breaks)
    count = len(width)

    # Torques are functions of q, qd and qdd: their fourth derivatives have derivatives of q up to the sixth. That of
    # viscous friction B qd is B times the fifth derivative of q.
    motion = np.stack(
        [np.abs(cells.differentiated(m).bernstein).max(axis=1) for m in range(ORDER + 3)]
    )
    fourth = torque_derivative_bounds(description, motion)
    if friction is not None:
        fourth += np.abs(numbers.viscous) * motion[ORDER + 1]
    is_smooth = friction is not None and friction.width > 0
    if friction is not None and is_smooth:
        fourth += dry_friction_bounds(numbers, friction.width, _least_speeds(cells), motion)
    fourth /= limit
    least_dry, most_dry, is_dry_constant = _dry_friction_steps(
        description, cells, None if is_smooth else friction
    )

    highest = np.zeros((count, description.n))
    seen = np.zeros_like(highest)
    times = np.zeros_like(highest)
    proved = np.zeros_like(highest, dtype=bool)

    def measure(rows: NDArray[np.intp], samples: int) -> None:
        u = width[rows, None] * np.linspace(0.0, 1.0, samples)
        q, qd, qdd = (cells.differentiated(m).on(rows[:, None], u) for m in range(3))
        if friction is not None and is_smooth:
            tau = inverse_dynamics(description, q, qd, qdd, friction=friction)
        else:
            tau = inverse_dynamics(description, q, qd, qdd)
            if friction is not None:
                tau = tau + numbers.viscous * qd

        # The largest torques over their limits, forwards and backwards, of the cubics between samples.
        above, at_above = _largest((tau + most_dry[rows, None]) / limit)
        below, at_below = _largest(-(tau + least_dry[rows, None]) / limit)

        least = np.maximum(tau + least_dry[rows, None], -tau - most_dry[rows, None]) / limit
        seen[rows] = np.maximum(seen[rows], least.max(axis=1))

        # Error of a cubic between samples h apart, for |d^4 tau / dt^4| <= D:  h^4 / 4! D.
        h = width[rows, None] / (samples - 1)
        error = h**ORDER / factorial(ORDER) * fourth[rows]
        highest[rows] = np.maximum(above, below) + error
        times[rows] = cells.breaks[rows, None] + h * np.where(above >= below, at_above, at_below)
        proved[rows] = (highest[rows] <= 1) | ((error <= _TOLERANCE) & is_dry_constant[rows])

    measure(np.arange(count), _FIRST_SAMPLES)

    # First with an error of half the distance to the limit, which decides most cells, then with the tolerance.
    for is_last in (False, True):
        wanted = (
            np.full_like(seen, _TOLERANCE) if is_last else np.maximum((1 - seen) / 2, _TOLERANCE)
        )
        # Samples N of a cell of width w with which the error is the wanted one: (w / (N - 1))^4 / 4! D.
        steps = width[:, None] * (fourth / (factorial(ORDER) * wanted)) ** (1 / ORDER)
        steps = np.where(proved, 0.0, steps).max(axis=1)
        # Rounded up to powers of sqrt(2), so that cells are computed together.
        samples = (
            np.exp2(np.ceil(2 * np.log2(np.clip(steps, 1, _MOST_SAMPLES))) / 2).astype(int) + 2
        )
        # More samples do not help where dry friction alone leaves the bound wide.
        coarse = np.flatnonzero(samples > _FIRST_SAMPLES)
        for N in np.unique(samples[coarse]).tolist():
            rows = coarse[samples[coarse] == N]
            for part in np.array_split(rows, -(-len(rows) * N // _BATCH)):
                measure(part, N)

    cell = highest.argmax(axis=0)
    joints = np.arange(description.n)
    return TorquePeaks(
        highest[cell, joints], times[cell, joints], seen.max(axis=0), np.asarray(proved.all(axis=0))
    )


def _least_speeds(cells: Pieces) -> Array:
    """Return lower bounds of the speed of each joint in each cell, shape (C, n), rad/s and m/s."""
    # A rate between b_min and b_max has at least the speed max(b_min, -b_max, 0).
    rates = cells.derivative.bernstein
    return np.asarray(np.maximum(np.maximum(rates.min(axis=1), -rates.max(axis=1)), 0.0))


def _dry_friction_steps(
    description: Description, cells: Pieces, friction: Friction | None
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return the least and the largest dry friction in each cell, and whether it is constant there, shape (C, n).

    That of steps; zeros where there is no friction, or a smooth one.
    """
    shape = len(cells.coefficients), description.n
    if friction is None:
        return np.zeros(shape), np.zeros(shape), np.ones(shape, dtype=bool)
    forwards = np.broadcast_to(description.numbers.coulomb[:, 0], shape)
    backwards = np.broadcast_to(description.numbers.coulomb[:, 1], shape)
    rates = cells.derivative.bernstein
    slowest = rates.min(axis=1)
    fastest = rates.max(axis=1)
    rounding = _RATE_ROUNDING * np.maximum(np.abs(slowest), np.abs(fastest)).max(axis=0)
    rests = (slowest >= -rounding) & (fastest <= rounding)
    # A joint that goes one way may rest at single instants, where it has no dry friction: these are ends of intervals,
    # and states of every certificate.
    goes_forwards = (slowest >= -rounding) & ~rests
    goes_backwards = (fastest <= rounding) & ~rests
    least = np.minimum(np.minimum(forwards, backwards), 0.0)
    most = np.maximum(np.maximum(forwards, backwards), 0.0)
    least = np.select([rests, goes_forwards, goes_backwards], [0.0, forwards, backwards], least)
    most = np.select([rests, goes_forwards, goes_backwards], [0.0, forwards, backwards], most)
    return least, most, least == most


def _largest(y: Array) -> tuple[Array, Array]:
    """Return the largest values between samples (C, N, n) of cells, and where, in steps: shape (C, n)."""
    peaks, places = cubic_peaks(y)
    best = peaks.argmax(axis=1)[:, None]
    return np.take_along_axis(peaks, best, axis=1)[:, 0], np.take_along_axis(places, best, axis=1)[
        :, 0
    ]


def cubic_peaks(y: Array) -> tuple[Array, Array]:
    """Return the largest values of the cubics through four neighbouring samples, and where, shape (C, N - 3, n).

    Each cubic counts between the two samples in its middle, the first and the last also to the ends.

    Parameters
    ----------
    y
        Samples one step apart, shape (C, N, n).

    Returns
    -------
    tuple of arrays
        The values, and their places in steps from the first sample.
    """
    pieces = y.shape[1] - 3
    y0, y1, y2, y3 = (y[:, k : k + pieces] for k in range(4))

    # Cubic through (-1, y0), (0, y1), (1, y2) and (2, y3): y1 + c1 x + c2 x^2 + c3 x^3.
    c1 = -y0 / 3 - y1 / 2 + y2 - y3 / 6
    c2 = (y0 + y2) / 2 - y1
    c3 = (y3 - y0) / 6 + (y1 - y2) / 2
    low = np.zeros((pieces, 1))
    high = np.ones((pieces, 1))
    low[0] = -1.0
    high[-1] = 2.0

    # Extremes, c1 + 2 c2 x + 3 c3 x^2 = 0, by the formula that does not cancel (Press et al. 2007, eq. 5.6.4).
    root = np.sqrt(np.maximum(c2**2 - 3 * c3 * c1, 0.0))
    half = -(c2 + np.where(c2 < 0, -root, root))
    with np.errstate(divide="ignore", invalid="ignore"):
        extremes = (half / (3 * c3), c1 / half)

    places = np.where(y2 > y1, 1.0, 0.0)
    peaks = np.maximum(y1, y2)
    for x in (np.broadcast_to(low, c1.shape), np.broadcast_to(high, c1.shape), *extremes):
        inside = np.clip(np.nan_to_num(x), low, high)
        value = y1 + inside * (c1 + inside * (c2 + inside * c3))
        places = np.where(value > peaks, inside, places)
        peaks = np.maximum(peaks, value)
    return peaks, places + np.arange(1, pieces + 1)[:, None]
