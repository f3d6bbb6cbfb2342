"""The regressor in numbers: torques are linear in the links' inertial parameters."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, joint_array, takes_robot
from dhkit.kernels import Kernel, fill, kernel
from dhkit.symbolic import (
    Graph,
    SymbolicTable,
    joint_symbols,
    table_pattern,
    velocity_regressor,
)


@takes_robot
def inertial_parameters(description: Description) -> Array:
    """Return the links' inertial parameters, that :func:`regressor` is to be multiplied by.

    Parameters
    ----------
    description
        The robot.

    Returns
    -------
    Array
        Shape (10 n,), ten for each link: mass, kg, first moments m c, kg m, and second moments xx, yy, zz, xy, yz, xz
        about its DH frame's origin, kg m^2, in the axes of that frame: m2, rx2, ry2, rz2, Ixx2, Iyy2, Izz2, Ixy2, Iyz2,
        Ixz2. NaN where a link has no body.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> inertial_parameters(library_robot("planar2r"))[:4].round(3)  # m1, rx1, ry1, rz1
    array([ 2. , -0.5,  0. ,  0. ])
    """
    return description.numbers.inertial_parameters.ravel()


@takes_robot
def regressor(
    description: Description,
    q: ArrayLike,
    qd: ArrayLike,
    qdd: ArrayLike,
    out: Array | None = None,
    threads: int = 1,
) -> Array:
    """Return Y with tau = Y theta + B qdd, B ``numbers.drive_inertia``, theta of :func:`inertial_parameters`.

    The force and moment that a link needs are linear in its parameters (Atkeson, An & Hollerbach, 1986, eq. 8); the
    joints before it feel them by the principle of virtual work.

    Parameters
    ----------
    description
        The robot; its links' bodies do not matter.
    q, qd, qdd
        Joint values, rates and accelerations, shapes (..., n), rad, m and seconds; batch axes broadcast.
    out
        Array that receives the result, shape (..., n, 10 n), float64, C-contiguous.
    threads
        Number of threads that share a large batch.

    Returns
    -------
    Array
        Shape (..., n, 10 n); NaN where a state is not finite.

    Raises
    ------
    ValueError, TypeError
        An argument of another shape, or not numeric; ``out`` does not fit.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> Y = regressor(arm, [0.3, -0.5], [1.0, 0.2], [0.5, -1.0])
    >>> (Y @ inertial_parameters(arm)).round(4)  # without drives, these are the torques
    array([14.8616,  2.8382])
    """
    named = ((q, "q"), (qd, "qd"), (qdd, "qdd"))
    states = [joint_array(description, x, name) for x, name in named]
    run, parameters = regressor_kernel(description)
    return fill(run, parameters, states, (description.n, 10 * description.n), out, threads)


@lru_cache(maxsize=512)
def regressor_kernel(description: Description) -> tuple[Kernel, Array]:
    """Return the kernel of :func:`regressor` and the arm's values of its parameters, of which gravity is the last."""
    pattern, parameters = table_pattern(description)
    gravity = gravity_in_base(description)
    run = kernel("regressor", pattern, lambda: _graph(description))
    return run, np.concatenate([parameters, gravity])


def _graph(description: Description) -> Graph:
    import casadi

    table, parameters = SymbolicTable.parametric(description)
    gravity = joint_symbols("gravity", 3)
    q, qd, qdd = (joint_symbols(name, description.n) for name in ("q", "qd", "qdd"))
    # The regressor of M qdd_r + C qd_r + g is that of inverse dynamics where the reference is the motion itself.
    Y = velocity_regressor(table, (gravity[0], gravity[1], gravity[2]), q, qd, qd, qdd)
    parameters = casadi.vertcat(parameters, gravity)
    return Graph.of("regressor", {"parameters": parameters, "q": q, "qd": qd, "qdd": qdd}, {"Y": Y})


def gravity_in_base(description: Description) -> Array:
    """Return the free-fall acceleration in the axes of frame 0, shape (3,), m/s^2."""
    numbers = description.numbers
    gravity: Array = numbers.T_world_base[:3, :3].T @ numbers.gravity
    return gravity
