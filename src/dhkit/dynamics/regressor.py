"""The regressor in numbers: torques are linear in the links' inertial parameters, or in the arm's base parameters."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Convention, Description, joint_array, takes_robot
from dhkit.kernels import Kernel, fill, kernel
from dhkit.symbolic import (
    Graph,
    SymbolicTable,
    joint_symbols,
    table_pattern,
    velocity_regressor,
)

if TYPE_CHECKING:
    from dhkit.symbolic import BaseColumn

_SX: TypeAlias = Any
"""A CasADi SX scalar or matrix."""
_SECOND = {"XX": (0, 0), "YY": (1, 1), "ZZ": (2, 2), "XY": (0, 1), "YZ": (1, 2), "XZ": (0, 2)}
"""Khalil's names of second moments in the order of :func:`inertial_parameters`, with their places in the matrix."""
_MOMENTS = ("MX", "MY", "MZ")


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
    states = _states(description, q, qd, qdd)
    run, parameters = regressor_kernel(description)
    return fill(run, parameters, states, (description.n, 10 * description.n), out, threads)


@lru_cache(maxsize=512)
def regressor_kernel(description: Description) -> tuple[Kernel, Array]:
    """Return the kernel of :func:`regressor` and the arm's values of its parameters, of which gravity is the last."""
    pattern, parameters = table_pattern(description)
    gravity = gravity_in_base(description)
    run = kernel("regressor", pattern, lambda: _graph(description))
    return run, np.concatenate([parameters, gravity])


@takes_robot
def base_regressor(
    description: Description,
    q: ArrayLike,
    qd: ArrayLike,
    qdd: ArrayLike,
    out: Array | None = None,
    threads: int = 1,
) -> Array:
    """Return Y with tau = Y beta, beta the base parameters ``base_parameters(description).values()``.

    The column of a base parameter is that of the inertial parameter after which it is named (Gautier & Khalil 1990).
    :meth:`dhkit.symbolic.BaseParameters.regressor` evaluates the exact equations of motion instead.

    Parameters
    ----------
    description
        The robot, with a body on every link.
    q, qd, qdd, out, threads
        As for :func:`regressor`.

    Returns
    -------
    Array
        Shape (..., n, parameters), columns in the order of ``base_parameters(description).names``; NaN where a state is
        not finite.

    Raises
    ------
    DescriptionError
        A link has no body.
    RingError
        The symbolic equations of motion, from which the base parameters are found, are too long.
    ValueError, TypeError
        An argument of another shape, or not numeric; ``out`` does not fit.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.symbolic import base_parameters
    >>> arm = library_robot("planar2r")
    >>> Y = base_regressor(arm, [0.3, -0.5], [1.0, 0.2], [0.5, -1.0])
    >>> (Y @ base_parameters(arm).values()).round(4)
    array([14.8616,  2.8382])
    """
    states = _states(description, q, qd, qdd)
    run, parameters = base_regressor_kernel(description)
    tail = (description.n, base_parameter_count(description))
    return fill(run, parameters, states, tail, out, threads)


def base_parameter_count(description: Description) -> int:
    """Return the number of base parameters of an arm; raises as :func:`base_regressor`."""
    from dhkit.symbolic import base_parameters

    return len(base_parameters(description))


@lru_cache(maxsize=512)
def base_regressor_kernel(description: Description) -> tuple[Kernel, Array]:
    """Return the kernel of :func:`base_regressor` and the arm's values of its parameters."""
    from dhkit.symbolic import base_parameters

    pattern, parameters = table_pattern(description)
    columns = base_parameters(description).columns
    key = " ".join([pattern, *(f"{kind}{joints}" for kind, joints in columns)])
    run = kernel("base_regressor", key, lambda: _base_graph(description, columns))
    return run, np.concatenate([parameters, gravity_in_base(description)])


def _states(description: Description, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> list[Array]:
    """Return joint values, rates and accelerations as arrays (..., n)."""
    named = {"q": q, "qd": qd, "qdd": qdd}
    return [joint_array(description, x, name) for name, x in named.items()]


def _graph(description: Description) -> Graph:
    states, Y, _ = _regressor_in_symbols(description)
    return Graph.of("regressor", states, {"Y": Y})


def _base_graph(description: Description, columns: Sequence[BaseColumn]) -> Graph:
    import casadi

    states, Y, table = _regressor_in_symbols(description)
    chosen = [_base_column(table, Y, states["qdd"], column) for column in columns]
    return Graph.of("base_regressor", states, {"Y": casadi.horzcat(*chosen)})


def _regressor_in_symbols(description: Description) -> tuple[dict[str, _SX], _SX, SymbolicTable]:
    """Return the programs' inputs, the regressor n x 10 n in them, and the arm's table."""
    import casadi

    table, parameters = SymbolicTable.parametric(description)
    gravity = joint_symbols("gravity", 3)
    q, qd, qdd = (joint_symbols(name, description.n) for name in ("q", "qd", "qdd"))
    # The regressor of M qdd_r + C qd_r + g is that of inverse dynamics where the reference is the motion itself.
    Y = velocity_regressor(table, (gravity[0], gravity[1], gravity[2]), q, qd, qd, qdd)
    parameters = casadi.vertcat(parameters, gravity)
    return {"parameters": parameters, "q": q, "qd": qd, "qdd": qdd}, Y, table


def _base_column(table: SymbolicTable, Y: _SX, qdd: _SX, column: BaseColumn) -> _SX:
    """Return the torques, n x 1, of a base parameter that is 1 while all others are 0."""
    import casadi

    kind, joints = column
    if kind == "Ia":
        (j,) = joints
        torque = casadi.SX(table.n, 1)
        torque[j - 1] = qdd[j - 1]
        return torque
    if kind == "Ic":
        i, j = joints
        torque = casadi.SX(table.n, 1)
        torque[i - 1] = qdd[j - 1]
        torque[j - 1] = qdd[i - 1]
        return torque

    (i,) = joints
    mass = casadi.SX(1.0 if kind == "M" else 0.0)
    moment = casadi.SX([1.0 if kind == name else 0.0 for name in _MOMENTS])
    second = casadi.SX(3, 3)
    if kind in _SECOND:
        j, k = _SECOND[kind]
        second[j, k] = second[k, j] = 1.0
    if table.convention is Convention.STANDARD:
        # The parameter's axes are those of joint i, and DH frame i lies behind link i: Tx(a) Rx(alpha) leads to it.
        a, _, cosine, sine, *_ = table.rows[i - 1]
        R = casadi.blockcat([[1, 0, 0], [0, cosine, sine], [0, -sine, cosine]])
        mass, moment, second = _moved(mass, moment, second, R, casadi.vertcat(-a, 0, 0))
    entries = [second[j, k] for j, k in _SECOND.values()]
    theta = casadi.vertcat(mass, moment, *entries)
    return Y[:, 10 * (i - 1) : 10 * i] @ theta


def _moved(mass: _SX, moment: _SX, second: _SX, R: _SX, p: _SX) -> tuple[_SX, _SX, _SX]:
    """Return mass, first moments and inertia of a body in another frame, in which its own frame is at (R, p)."""
    import casadi

    # With h = R (first moments) and J = R I R^T, by Steiner's theorem:
    #   sum m ((r + p)^2 1 - (r + p)(r + p)^T) = J + (2 p.h + m p^2) 1 - (p h^T + h p^T + m p p^T)
    h = R @ moment
    products = p @ h.T + h @ p.T + mass * p @ p.T
    square = 2 * casadi.dot(p, h) + mass * casadi.dot(p, p)
    return mass, h + mass * p, R @ second @ R.T + square * casadi.SX.eye(3) - products


def gravity_in_base(description: Description) -> Array:
    """Return the free-fall acceleration in the axes of frame 0, shape (3,), m/s^2."""
    numbers = description.numbers
    gravity: Array = numbers.T_world_base[:3, :3].T @ numbers.gravity
    return gravity
