"""The terms of the equation of motion M qdd + C qd + g = tau, and inverse dynamics."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, joint_array, takes_robot
from dhkit.dynamics.loads import external_torque
from dhkit.dynamics.programs import evaluate
from dhkit.symbolic import Friction


@takes_robot
def mass_matrix(
    description: Description, q: ArrayLike, out: Array | None = None, threads: int = 1
) -> Array:
    """Return the joint-space mass matrix M(q), drives' rotor inertia included.

    Parameters
    ----------
    description
        The robot, with a body on every link.
    q
        Joint values, shape (..., n), rad and m; angles, and sums of those of parallel joints, up to 1e6 rad.
    out
        Array that receives the result, shape (..., n, n), float64, C-contiguous.
    threads
        Number of threads that share a large batch.

    Returns
    -------
    Array
        Shape (..., n, n), symmetric, kg m^2, kg m and kg; NaN where q has an entry that is not finite or too large.

    Raises
    ------
    DescriptionError
        A link without a body.
    ValueError, TypeError
        q has not shape (..., n) or is not numeric; ``out`` does not fit.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> mass_matrix(library_robot("planar2r"), [0.0, 0.0]).round(4)
    array([[0.9217, 0.23  ],
           [0.23  , 0.08  ]])
    """
    return evaluate(
        "mass_matrix", description, {"q": q}, (description.n, description.n), out, threads
    )


@takes_robot
def mass_matrix_derivative(
    description: Description, q: ArrayLike, out: Array | None = None, threads: int = 1
) -> Array:
    """Return the derivatives of the mass matrix with respect to each joint value, dM/dq_k.

    Parameters
    ----------
    description
        The robot, with a body on every link.
    q, threads
        As for :func:`mass_matrix`.
    out
        Array that receives the result, shape (..., n, n, n), float64, C-contiguous.

    Returns
    -------
    Array
        Shape (..., n, n, n): entry [..., k, :, :] is dM/dq_k, in the units of M per rad or m.

    Raises
    ------
    DescriptionError, ValueError, TypeError
        As for :func:`mass_matrix`.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> mass_matrix_derivative(library_robot("planar2r"), [0.0, 0.5])[1].round(4)
    array([[-0.1438, -0.0719],
           [-0.0719,  0.    ]])
    """
    n = description.n
    return evaluate("mass_matrix_derivative", description, {"q": q}, (n, n, n), out, threads)


@takes_robot
def coriolis_matrix(
    description: Description,
    q: ArrayLike,
    qd: ArrayLike,
    out: Array | None = None,
    threads: int = 1,
) -> Array:
    """Return the Coriolis matrix C(q, qd) by Christoffel symbols, shape (..., n, n): dM/dt - 2 C is skew-symmetric.

    Parameters
    ----------
    description, q, out, threads
        As for :func:`mass_matrix`.
    qd
        Joint rates, shape (..., n), rad/s and m/s; batch axes broadcast.

    Returns
    -------
    Array
        Shape (..., n, n), kg m^2/s, kg m/s and kg/s; NaN where an input is not finite.

    Raises
    ------
    DescriptionError, ValueError, TypeError
        As for :func:`mass_matrix`.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> coriolis_matrix(library_robot("planar2r"), [0.0, 0.5], [1.0, 2.0]).round(4)
    array([[-0.1438, -0.2157],
           [ 0.0719,  0.    ]])
    """
    tail = (description.n, description.n)
    return evaluate("coriolis_matrix", description, {"q": q, "qd": qd}, tail, out, threads)


@takes_robot
def gravity_torque(
    description: Description, q: ArrayLike, out: Array | None = None, threads: int = 1
) -> Array:
    """Return g(q), shape (..., n), N m and N: torques that hold the arm; arguments as for :func:`mass_matrix`.

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
        Shape (..., n), N m and N.

    Raises
    ------
    DescriptionError, ValueError, TypeError
        As for :func:`mass_matrix`.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> gravity_torque(arm, [0, 0]).round(3)
    array([15.206,  2.943])
    """
    return evaluate("gravity_torque", description, {"q": q}, (description.n,), out, threads)


@takes_robot
def bias(
    description: Description,
    q: ArrayLike,
    qd: ArrayLike,
    out: Array | None = None,
    threads: int = 1,
) -> Array:
    """Return C(q, qd) qd + g(q), shape (..., n), N m and N; arguments as for :func:`coriolis_matrix`.

    Parameters
    ----------
    description
        The arm.
    q, qd
        Joint values and rates, shape (..., n), rad, m and per second.
    out
        Array that receives the result, float64, C-contiguous; a new array unless given.
    threads
        Number of threads that share a large batch.

    Returns
    -------
    Array
        Shape (..., n), N m and N.

    Raises
    ------
    DescriptionError, ValueError, TypeError
        As for :func:`mass_matrix`.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> bias(arm, [0, 0], [0, 0]).round(3)
    array([15.206,  2.943])
    """
    return evaluate("bias", description, {"q": q, "qd": qd}, (description.n,), out, threads)


@takes_robot
def inverse_dynamics(
    description: Description,
    q: ArrayLike,
    qd: ArrayLike,
    qdd: ArrayLike,
    wrench: ArrayLike | None = None,
    friction: bool | Friction = False,
    out: Array | None = None,
    threads: int = 1,
) -> Array:
    """Return the joint torques of a motion, tau = M qdd + C qd + g + friction - J^T wrench.

    Parameters
    ----------
    description
        The robot, with a body on every link.
    q, qd, qdd
        Joint values, rates and accelerations, shapes (..., n), rad, m and seconds; batch axes broadcast.
    wrench
        Shape (..., 6): force (N) then moment (N m) that the environment applies at the tool's origin, world axes.
    friction
        True for dry friction as a step, 0 at rest; ``Friction(width=...)`` for a smooth one.
    out
        Array that receives the result, shape (..., n), float64, C-contiguous.
    threads
        Number of threads that share a large batch.

    Returns
    -------
    Array
        Shape (..., n), N m and N; NaN where an input is not finite.

    Raises
    ------
    DescriptionError
        A link without a body.
    ValueError, TypeError
        An argument of another shape, or not numeric; ``out`` does not fit.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> inverse_dynamics(arm, [0.0, 0.0], [1.0, 0.0], [0.0, 2.0]).round(3)
    array([15.666,  3.103])
    """
    # M qdd + h = tau + load  with  load = J^T wrench - friction,  so  tau = (M qdd + h) - load.
    load = external_torque(description, q, qd, wrench, friction, threads)
    states = {"q": q, "qd": qd, "qdd": qdd}
    if load is None:
        return evaluate("inverse_dynamics", description, states, (description.n,), out, threads)

    # The load may have batch axes (of the wrench) that the states lack.
    q = joint_array(description, q)
    states["q"] = np.broadcast_to(q, np.broadcast_shapes(q.shape, load.shape))
    tau = evaluate("inverse_dynamics", description, states, load.shape[-1:], out, threads)
    tau -= load
    return tau
