"""Polynomials through samples: a spline, or Hermite polynomials from values and derivatives."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, joint_array
from dhkit.description.arrays import number_array


def check_times(times: ArrayLike) -> Array:
    """Return times as an array (N,), N >= 2.

    Raises
    ------
    ValueError
        Another shape, values that are not finite, or times that do not increase.
    TypeError
        Not numbers.
    """
    t = number_array(times, "times", "(N,)")
    if t.ndim != 1 or len(t) < 2:
        raise ValueError(f"times has shape {t.shape}; expected (N,) with N >= 2")
    if not np.isfinite(t).all():
        raise ValueError(f"times[{int(np.flatnonzero(~np.isfinite(t))[0])}] is not finite")
    if (np.diff(t) <= 0).any():
        k = int(np.flatnonzero(np.diff(t) <= 0)[0])
        raise ValueError(f"times do not increase: times[{k}] is {t[k]:g} s, times[{k + 1}] is {t[k + 1]:g} s")
    return t


def interpolated(
    description: Description, times: ArrayLike, q: ArrayLike, qd: ArrayLike | None, qdd: ArrayLike | None
) -> tuple[Array, Array]:
    """Return breaks and coefficients; see :meth:`dhkit.trajectories.Trajectory.from_samples`."""
    from scipy.interpolate import CubicSpline

    t = check_times(times)
    if qd is None and qdd is not None:
        raise ValueError("qdd is given without qd; expected both or neither")
    arrays = [
        _rows(description, value, name, len(t))
        for name, value in (("q", q), ("qd", qd), ("qdd", qdd))
        if value is not None
    ]
    t = t - t[0]
    if len(arrays) == 1:
        return t, np.moveaxis(CubicSpline(t, arrays[0]).c[::-1], 0, 1)
    return t, (cubic_hermite if len(arrays) == 2 else quintic_hermite)(t, *arrays)


def _rows(description: Description, value: ArrayLike, name: str, count: int) -> Array:
    array = joint_array(description, value, name)
    if array.shape != (count, description.n):
        raise ValueError(f"{name} has shape {array.shape}; expected ({count}, {description.n})")
    if not np.isfinite(array).all():
        row = int(np.argwhere(~np.isfinite(array))[0, 0])
        raise ValueError(f"{name} has values that are not finite, the first in row {row}")
    return array


def cubic_hermite(times: Array, q: Array, qd: Array) -> Array:
    """Return coefficients (K, 4, m), ascending powers from each interval's beginning.

    Parameters
    ----------
    times
        Shape (K+1,), increasing.
    q, qd
        Values and derivatives at these times, shape (K+1, m).
    """
    # With s = (q1 - q0) / h:  c2 = (3 s - 2 v0 - v1) / h,  c3 = (v0 + v1 - 2 s) / h^2.
    h = np.diff(times)[:, None]
    slope = np.diff(q, axis=0) / h
    c2 = (3 * slope - 2 * qd[:-1] - qd[1:]) / h
    c3 = (qd[:-1] + qd[1:] - 2 * slope) / h**2
    return np.stack([q[:-1], qd[:-1], c2, c3], axis=1)


def quintic_hermite(times: Array, q: Array, qd: Array, qdd: Array) -> Array:
    """Return coefficients (K, 6, m) as :func:`cubic_hermite`, from second derivatives too."""
    # Differences at the end from the parabola at the beginning, in units of the interval:
    #     g = q1 - q0 - h v0 - h^2 a0 / 2,    r = h (v1 - v0 - h a0),    b = h^2 (a1 - a0).
    h = np.diff(times)[:, None]
    gap = np.diff(q, axis=0) - h * qd[:-1] - h**2 * qdd[:-1] / 2
    rate = h * (qd[1:] - qd[:-1] - h * qdd[:-1])
    bend = h**2 * (qdd[1:] - qdd[:-1])

    # c3 h^3 + c4 h^4 + c5 h^5 = g, and its first and second derivatives, times h and h^2, r and b.
    c3 = (10 * gap - 4 * rate + bend / 2) / h**3
    c4 = (-15 * gap + 7 * rate - bend) / h**4
    c5 = (6 * gap - 3 * rate + bend / 2) / h**5
    return np.stack([q[:-1], qd[:-1], qdd[:-1] / 2, c3, c4, c5], axis=1)
