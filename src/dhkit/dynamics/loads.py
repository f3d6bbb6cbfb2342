"""Torques beside the links' own dynamics: friction of the joints, and wrenches on the tool."""

from __future__ import annotations

from functools import lru_cache

from numpy.typing import ArrayLike

from dhkit.description import Array, Description, joint_array, takes_robot
from dhkit.description.arrays import number_array
from dhkit.kernels import Kernel, fill, kernel
from dhkit.symbolic import (
    Friction,
    Graph,
    SymbolicTable,
    friction_parameters,
    friction_torque as friction_expression,
    jacobian,
    joint_symbols,
    table_pattern,
)


@takes_robot
def friction_torque(
    description: Description,
    qd: ArrayLike,
    friction: Friction | None = None,
    out: Array | None = None,
    threads: int = 1,
) -> Array:
    """Return friction torques: viscous, and dry friction that differs by direction.

    Parameters
    ----------
    description
        The robot; a joint without a drive has no friction.
    qd
        Joint rates, shape (..., n), rad/s and m/s.
    friction
        Model of dry friction near rest: a step unless given, 0 at rest.
    out, threads
        As for :func:`dhkit.dynamics.mass_matrix`.

    Returns
    -------
    Array
        Shape (..., n), joint side, N m and N, with the sign of the motion: the torque that a motor must add.

    Raises
    ------
    ValueError, TypeError
        qd has not shape (..., n) or is not numeric; ``out`` does not fit.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> friction_torque(library_robot("puma560"), [0.5, 0, 0, 0, 0, -0.5]).round(2)
    array([27.63,  0.  ,  0.  ,  0.  ,  0.  , -0.91])
    """
    state = joint_array(description, qd, "qd")
    width = Friction().width if friction is None else friction.width
    run = friction_kernel(description.n, width > 0)
    return fill(
        run,
        friction_parameters(description.numbers, width),
        [state],
        (description.n,),
        out,
        threads,
    )


@takes_robot
def wrench_torque(
    description: Description, q: ArrayLike, wrench: ArrayLike, threads: int = 1
) -> Array:
    """Return J^T w, shape (..., n): the torques with which a wrench on the tool drives the joints.

    Parameters
    ----------
    description
        The robot.
    q
        Joint values, shape (..., n), rad and m.
    wrench
        Force (N), then moment (N m), that the environment applies at the tool's origin, world axes, shape (..., 6).
    threads
        As for :func:`dhkit.dynamics.mass_matrix`.

    Returns
    -------
    Array
        Shape (..., n), J^T wrench, N m and N; NaN where an input is not finite.

    Raises
    ------
    ValueError, TypeError
        An argument of another shape, or not numeric.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> wrench_torque(library_robot("planar2r"), [0.0, 0.0], [0, 10, 0, 0, 0, 0]).round(3)  # 10 N upwards at the tip
    array([9., 4.])
    """
    load = number_array(wrench, "wrench", "(..., 6)")
    if load.ndim == 0 or load.shape[-1] != 6:
        raise ValueError(f"wrench has shape {load.shape}; expected (..., 6): force, then moment")
    run, parameters = wrench_kernel(description)
    return fill(
        run, parameters, [joint_array(description, q), load], (description.n,), None, threads
    )


def external_torque(
    description: Description,
    q: ArrayLike,
    qd: ArrayLike,
    wrench: ArrayLike | None,
    friction: bool | Friction,
    threads: int = 1,
) -> Array | None:
    """Return J^T wrench - friction, shape (..., n), N m and N; None if there is neither.

    Raises
    ------
    ValueError, TypeError
        As for :func:`friction_torque` and :func:`wrench_torque`; ``friction`` is neither a bool nor a Friction.
    """
    model = Friction.chosen(friction)
    of_wrench = None if wrench is None else wrench_torque(description, q, wrench, threads)
    if model is None:
        return of_wrench
    of_friction = friction_torque(description, qd, model, threads=threads)
    return -of_friction if of_wrench is None else of_wrench - of_friction


def friction_kernel(n: int, smooth: bool) -> Kernel:
    """Return the kernel of :func:`friction_torque` for n joints, with a smooth change of direction or a step."""
    name = "smooth_friction" if smooth else "friction"
    return kernel(name, str(n), lambda: _friction_graph(name, n, smooth))


@lru_cache(maxsize=512)
def wrench_kernel(description: Description) -> tuple[Kernel, Array]:
    """Return the kernel of :func:`wrench_torque` and the arm's values of its parameters."""
    pattern, parameters = table_pattern(description)
    return kernel("wrench_torque", pattern, lambda: _wrench_graph(description)), parameters


def _friction_graph(name: str, n: int, smooth: bool) -> Graph:
    """Return the program of :func:`friction_torque`."""
    parameters = joint_symbols("parameters", 3 * n + 1)
    qd = joint_symbols("qd", n)
    torque = friction_expression(qd, parameters, smooth=smooth)
    return Graph.of(name, {"parameters": parameters, "qd": qd}, {"tau": torque})


def _wrench_graph(description: Description) -> Graph:
    """Return the program of :func:`wrench_torque`."""
    table, parameters = SymbolicTable.parametric(description)
    q = joint_symbols("q", description.n)
    wrench = joint_symbols("wrench", 6)
    tau = jacobian(table, q).T @ wrench
    return Graph.of(
        "wrench_torque", {"parameters": parameters, "q": q, "wrench": wrench}, {"tau": tau}
    )
