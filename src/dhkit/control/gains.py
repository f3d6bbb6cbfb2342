"""Gains of controllers: given by number or joint, or from a bandwidth and a damping."""

from __future__ import annotations

from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description
from dhkit.description.frames import number_array
from dhkit.dynamics import mass_matrix
from dhkit.verification import random_motions

__all__ = ["Robot", "description_of", "effective_inertia", "gain", "pd_gains", "pid_gains"]

Robot = Any
"""An arm, or its description."""
STATES = 256
"""Random configurations over which effective inertias are averaged."""


def description_of(robot: Robot) -> Description:
    """Return the description of an arm, or itself.

    Raises
    ------
    TypeError
        Neither.
    """
    found = getattr(robot, "description", robot)
    if not isinstance(found, Description):
        raise TypeError(f"found {type(robot).__name__}; expected an arm or its description")
    return found


def gain(value: ArrayLike, name: str, n: int | None = None) -> Array:
    """Return a gain of all joints, or of each, shape () or (n,).

    Raises
    ------
    ValueError
        Negative or not finite, or of another shape.
    TypeError
        Not numbers.
    """
    array = number_array(value, name, "a number, or one for each joint")
    if array.ndim > 1 or (n is not None and array.ndim == 1 and array.shape != (n,)):
        raise ValueError(f"{name} has shape {array.shape}; expected a number, or {'(n,)' if n is None else (n,)}")
    if not (np.isfinite(array).all() and (array >= 0).all()):
        raise ValueError(f"{name} is {array.tolist()}; expected finite numbers, 0 or more")
    return array.copy()


def positive(value: float, name: str) -> float:
    """Return a number.

    Raises
    ------
    ValueError
        Not a positive, finite number.
    """
    if not (isinstance(value, Real) and np.isfinite(value) and value > 0):
        raise ValueError(f"{name} is {value!r}; expected a positive number")
    return float(value)


def effective_inertia(description: Description, q: ArrayLike | None = None) -> Array:
    """Return what each joint's drive feels, shape (n,), kg m^2 and kg: the diagonal of the mass matrix.

    Parameters
    ----------
    description
        The robot, with a body on every link.
    q
        Where, shape (n,); the average over random configurations inside the limits unless given.
    """
    M = mass_matrix(description, random_motions(description, STATES).q if q is None else q)
    diagonal: Array = np.diagonal(M, axis1=-2, axis2=-1).reshape(-1, description.n).mean(axis=0)
    return diagonal


def pd_gains(bandwidth: float, damping: float) -> tuple[float, float]:
    """Return k_p = w^2 and k_d = 2 z w, for which an error decays as s^2 + 2 z w s + w^2 says."""
    w, z = positive(bandwidth, "bandwidth"), positive(damping, "damping")
    return w * w, 2 * z * w


def pid_gains(bandwidth: float, damping: float, integral: float) -> tuple[float, float, float]:
    """Return k_p, k_i and k_d of the poles of (s + a w) (s^2 + 2 z w s + w^2), a being ``integral``."""
    w, z = positive(bandwidth, "bandwidth"), positive(damping, "damping")
    a = integral
    if not (np.isfinite(a) and a >= 0):
        raise ValueError(f"integral is {integral!r}; expected a number, 0 or more")
    return w * w * (1 + 2 * z * a), a * w**3, w * (2 * z + a)
