"""Energies of an arm, and the power of its drives."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, joint_array, takes_robot
from dhkit.dynamics.programs import evaluate
from dhkit.kernels import result_array


@takes_robot
def kinetic_energy(
    description: Description,
    q: ArrayLike,
    qd: ArrayLike,
    out: Array | None = None,
    threads: int = 1,
) -> Array:
    """Return the kinetic energy, rotors of the drives included.

    Parameters
    ----------
    description
        The robot, with a body on every link.
    q, qd
        Joint values and rates, shapes (..., n), rad, m and seconds; batch axes broadcast.
    out, threads
        As for :func:`dhkit.dynamics.mass_matrix`; ``out`` of shape (...).

    Returns
    -------
    Array
        Shape (...), J; NaN where an input is not finite.

    Raises
    ------
    DescriptionError, ValueError, TypeError
        As for :func:`dhkit.dynamics.mass_matrix`.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> round(float(kinetic_energy(library_robot("planar2r"), [0.0, 0.0], [1.0, 0.0])), 4)
    0.4608
    """
    return evaluate("kinetic_energy", description, {"q": q, "qd": qd}, (), out, threads)


@takes_robot
def potential_energy(
    description: Description, q: ArrayLike, out: Array | None = None, threads: int = 1
) -> Array:
    """Return the potential energy of the moving links in gravity, shape (...), J; arguments as for ``mass_matrix``.

    It is 0 for a mass at the world's origin: V = -sum(m g . c).

    Parameters
    ----------
    description
        The arm.
    q
        Joint values, shape (..., n), rad and m.
    out
        Array that receives the result, float64, C-contiguous; a new array unless given.
    threads
        Number of threads that share a large batch.

    Returns
    -------
    Array
        Shape (...), J.

    Raises
    ------
    DescriptionError, ValueError, TypeError
        As for :func:`dhkit.dynamics.mass_matrix`.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> float(potential_energy(arm, [0, 0]))
    0.0
    """
    return evaluate("potential_energy", description, {"q": q}, (), out, threads)


@takes_robot
def power(
    description: Description, qd: ArrayLike, tau: ArrayLike, out: Array | None = None
) -> Array:
    """Return the mechanical power of the joints, qd . tau, shape (...), W; qd and tau (..., n) broadcast.

    Parameters
    ----------
    description
        The arm.
    qd, tau
        Joint rates and torques, shape (..., n), rad/s, m/s, N m and N.
    out
        Array that receives the result, float64, C-contiguous; a new array unless given.

    Returns
    -------
    Array
        Shape (...), W; positive where the drives do work on the arm.

    Raises
    ------
    ValueError, TypeError
        An argument of another shape, or not numeric; ``out`` does not fit.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> float(power(arm, [1.0, 2.0], [3.0, 0.5]))
    4.0
    """
    rates = joint_array(description, qd, "qd")
    torques = joint_array(description, tau, "tau")
    shape = np.broadcast_shapes(rates.shape, torques.shape)[:-1]
    result = result_array(shape, out)
    result[...] = np.sum(rates * torques, axis=-1)
    return result
