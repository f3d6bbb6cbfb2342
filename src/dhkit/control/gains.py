"""Gains of controllers: given by number or joint, or from a bandwidth and a damping."""

from __future__ import annotations

from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description
from dhkit.description.arrays import number_array
from dhkit.dynamics import mass_matrix
from dhkit.verification import random_motions

RANDOM_CONFIGURATIONS = 256
"""Number of random configurations over which effective inertias are averaged."""


def gain(value: ArrayLike, name: str, n: int | None = None) -> Array:
    """Return a gain, in its own unit, as an array: shape () for all joints, (n,) for each, (B, n) for a batch.

    Raises
    ------
    ValueError
        Negative or not finite, or of another shape.
    TypeError
        Not numbers.
    """
    array = number_array(value, name, "a number, or one for each joint")
    # A column (B, 1) has one gain for all joints of each run.
    if array.ndim == 2 and array.shape[1] == 1 and n is not None:
        array = np.repeat(array, n, axis=1)
    if array.ndim > 2 or (n is not None and array.ndim and array.shape[-1] != n):
        each = "n" if n is None else str(n)
        raise ValueError(
            f"{name} has shape {array.shape}; expected a number, ({each},), or (B, {each}) for a batch"
        )
    if not (np.isfinite(array).all() and (array >= 0).all()):
        raise ValueError(f"{name} is {array.tolist()}; expected finite numbers, 0 or more")
    return array.copy()


def batch_of(*gains: Array) -> tuple[int, ...]:
    """Return the batch shape of gains: (B,) if they are for B runs, () if for one.

    Raises
    ------
    ValueError
        Gains for batches of different sizes.
    """
    sizes = {len(gain) for gain in gains if gain.ndim == 2}
    if len(sizes) > 1:
        raise ValueError(
            f"gains are of batches of {', '.join(map(str, sorted(sizes)))}; expected one"
        )
    return tuple(sizes)


def positive(value: float, name: str) -> float:
    """Return a positive, finite number.

    Raises
    ------
    ValueError
        Not a positive, finite number.
    """
    if isinstance(value, bool) or not (
        isinstance(value, Real) and np.isfinite(value) and value > 0
    ):
        raise ValueError(f"{name} is {str(value)[:60]}; expected a positive number")
    return float(value)


def _positive_each(value: ArrayLike, name: str) -> Array:
    """Return positive numbers of any unit: one, shape (), or one for each run of a batch as a column, shape (B, 1).

    Raises
    ------
    ValueError
        Another shape, or a number that is not positive and finite.
    TypeError
        Not numbers.
    """
    array = number_array(value, name, "a positive number, or one for each run")
    if array.ndim > 1 or not (np.isfinite(array).all() and (array > 0).all()):
        shown = str(array.tolist())[:60]
        raise ValueError(
            f"{name} is {shown}; expected a positive number, or (B,) of them for a batch"
        )
    return array[:, None] if array.ndim else array


def effective_inertia(description: Description, q: ArrayLike | None = None) -> Array:
    """Return the effective inertia of each joint, shape (n,), kg m^2 and kg: the diagonal of the mass matrix.

    Parameters
    ----------
    description
        The robot, with a body on every link.
    q
        Joint values, shape (n,), rad and m; the average over random configurations inside the limits unless given.
    """
    # M_ii is the torque for a unit acceleration of joint i while the other joints do not accelerate.
    M = mass_matrix(
        description, random_motions(description, RANDOM_CONFIGURATIONS).q if q is None else q
    )
    diagonal: Array = np.diagonal(M, axis1=-2, axis2=-1).reshape(-1, description.n).mean(axis=0)
    return diagonal


def pd_gains(bandwidth: ArrayLike, damping: ArrayLike) -> tuple[Array, Array]:
    """Return k_p = w^2 and k_d = 2 z w of the error dynamics s^2 + 2 z w s + w^2, shape () or (B, 1)."""
    w = _positive_each(bandwidth, "bandwidth")
    z = _positive_each(damping, "damping")
    return w * w, 2 * z * w


def pid_gains(
    bandwidth: ArrayLike, damping: ArrayLike, integral: float
) -> tuple[Array, Array, Array]:
    """Return k_p, k_i and k_d of the poles of (s + a w) (s^2 + 2 z w s + w^2), a = ``integral``; () or (B, 1)."""
    w = _positive_each(bandwidth, "bandwidth")
    z = _positive_each(damping, "damping")
    a = integral
    if not (np.isfinite(a) and a >= 0):
        raise ValueError(f"integral is {integral!r}; expected a number, 0 or more")

    # (s + a w) (s^2 + 2 z w s + w^2) = s^3 + k_d s^2 + k_p s + k_i
    k_p = w * w * (1 + 2 * z * a)
    k_i = a * w**3
    k_d = w * (2 * z + a)
    return k_p, k_i, k_d


def gains_text(**gains: Array) -> str:
    """Return gains as text, from the smallest to the largest of all joints.

    Examples
    --------
    >>> gains_text(kp=np.array([400.0, 400.0]), kd=np.array([40.0, 20.0]))
    'kp 400, kd 20 to 40'
    """
    return ", ".join(f"{name} {_range_text(values)}" for name, values in gains.items())


def _range_text(values: Array) -> str:
    if values.ndim > 1:
        return f"of shape {values.shape}"
    least = float(np.min(values))
    most = float(np.max(values))
    return f"{least:.4g}" if least == most else f"{least:.4g} to {most:.4g}"
