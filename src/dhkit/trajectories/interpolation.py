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
        raise ValueError(
            f"times do not increase: times[{k}] is {t[k]:g} s, times[{k + 1}] is {t[k + 1]:g} s"
        )
    return t


def interpolated(
    description: Description,
    times: ArrayLike,
    q: ArrayLike,
    qd: ArrayLike | None,
    qdd: ArrayLike | None,
) -> tuple[Array, Array]:
    """Return breaks from t = 0 on, and coefficients: of a spline, or of Hermite pieces where rates are given.

    See :meth:`dhkit.trajectories.Trajectory.from_samples`.
    """
    from scipy.interpolate import CubicSpline

    t = check_times(times)
    if qd is None and qdd is not None:
        raise ValueError("qdd is given without qd; expected qd too")
    count = len(t)
    q = _rows(description, q, "q", count)
    qd = None if qd is None else _rows(description, qd, "qd", count)
    qdd = None if qdd is None else _rows(description, qdd, "qdd", count)
    t = t - t[0]

    if qd is None:
        # SciPy has the highest power first, in the first axis.
        return t, np.moveaxis(CubicSpline(t, q).c[::-1], 0, 1)
    if qdd is None:
        return t, cubic_hermite(t, q, qd)
    return t, quintic_hermite(t, q, qd, qdd)


def _rows(description: Description, value: ArrayLike, name: str, count: int) -> Array:
    """Return an argument as an array (count, n) of finite values."""
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
    # q_0 + qd_0 u + (3 slope - 2 qd_0 - qd_1) / h u^2 + (qd_0 + qd_1 - 2 slope) / h^2 u^3, on an interval of length h
    h = np.diff(times)[:, None]
    slope = np.diff(q, axis=0) / h
    qd_0 = qd[:-1]
    qd_1 = qd[1:]
    c_2 = (3 * slope - 2 * qd_0 - qd_1) / h
    c_3 = (qd_0 + qd_1 - 2 * slope) / h**2
    return np.stack([q[:-1], qd_0, c_2, c_3], axis=1)


def quintic_hermite(times: Array, q: Array, qd: Array, qdd: Array) -> Array:
    """Return coefficients (K, 6, m) as :func:`cubic_hermite`, from second derivatives too."""
    # The parabola q_0 + qd_0 u + qdd_0 / 2 u^2 and, with x = u / h, x^3 (a + b x + c x^2) such that the sum has the
    # value, first and second derivative of the end at x = 1. The differences from the parabola there, by x:
    h = np.diff(times)[:, None]
    value = np.diff(q, axis=0) - h * qd[:-1] - h**2 * qdd[:-1] / 2
    first = h * (qd[1:] - qd[:-1] - h * qdd[:-1])
    second = h**2 * (qdd[1:] - qdd[:-1])

    # a + b + c = value,  3 a + 4 b + 5 c = first,  6 a + 12 b + 20 c = second
    a = 10 * value - 4 * first + second / 2
    b = -15 * value + 7 * first - second
    c = 6 * value - 3 * first + second / 2
    return np.stack([q[:-1], qd[:-1], qdd[:-1] / 2, a / h**3, b / h**4, c / h**5], axis=1)
