"""The geometric Jacobian of the tool, and its rate of change."""

from __future__ import annotations

from functools import lru_cache

from numpy.typing import ArrayLike

from dhkit.description import Array, Description, joint_array, takes_robot
from dhkit.kernels import Kernel, fill, kernel
from dhkit.symbolic import (
    Graph,
    ReferenceAxes,
    SymbolicTable,
    derivative_of_matrix,
    jacobian as symbolic_jacobian,
    jacobian_dot as symbolic_jacobian_dot,
    joint_symbols,
    table_pattern,
)


@takes_robot
def jacobian(
    description: Description,
    q: ArrayLike,
    frame: ReferenceAxes = "world",
    out: Array | None = None,
    threads: int = 1,
) -> Array:
    """Return the Jacobian of the tool: J qd = (velocity of its origin; angular velocity).

    Parameters
    ----------
    description
        The robot.
    q
        Joint positions, shape (..., n), rad and m; angles up to 1e6 rad.
    frame
        ``"world"`` or ``"tool"``: the axes that both rows of three are resolved in. The point is always the tool's
        origin.
    out, threads
        As for :func:`dhkit.kinematics.forward_kinematics`.

    Returns
    -------
    Array
        Shape (..., 6, n): m/rad, m/m, rad/rad and 0. NaN where the tool's pose is.

    Raises
    ------
    ValueError, TypeError
        q has not shape (..., n); another frame; ``out`` does not fit.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> jacobian(library_robot("planar2r"), [0.0, 0.0]).round(3)
    array([[0. , 0. ],
           [0.9, 0.4],
           [0. , 0. ],
           [0. , 0. ],
           [0. , 0. ],
           [1. , 1. ]])
    """
    _check_frame(frame)
    run, parameters = jacobian_kernel(description, frame)
    return fill(run, parameters, [joint_array(description, q)], (6, description.n), out, threads)


@takes_robot
def jacobian_dot(
    description: Description,
    q: ArrayLike,
    qd: ArrayLike,
    frame: ReferenceAxes = "world",
    out: Array | None = None,
    threads: int = 1,
) -> Array:
    """Return the time derivative of :func:`jacobian` along a motion, so that the tool's acceleration is J qdd + Jd qd.

    Parameters
    ----------
    description
        The robot.
    q, qd
        Joint positions and velocities, shapes (..., n), rad, m, rad/s and m/s; batch axes broadcast.
    frame, out, threads
        As for :func:`jacobian`. In ``"tool"`` axes it is the derivative of the components.

    Returns
    -------
    Array
        Shape (..., 6, n), per second.

    Raises
    ------
    ValueError, TypeError
        As for :func:`jacobian`.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> jacobian_dot(library_robot("planar2r"), [0.0, 0.0], [1.0, 0.0])[:3].round(3)
    array([[-0.9, -0.4],
           [ 0. ,  0. ],
           [ 0. ,  0. ]])
    """
    _check_frame(frame)
    run, parameters = jacobian_dot_kernel(description, frame)
    states = [joint_array(description, q), joint_array(description, qd, "qd")]
    return fill(run, parameters, states, (6, description.n), out, threads)


@takes_robot
def jacobian_derivative(
    description: Description,
    q: ArrayLike,
    frame: ReferenceAxes = "world",
    out: Array | None = None,
    threads: int = 1,
) -> Array:
    """Return the derivatives of :func:`jacobian` with respect to each joint value, dJ/dq_k.

    Parameters
    ----------
    description
        The robot.
    q
        Joint positions, shape (..., n), rad and m.
    frame, threads
        As for :func:`jacobian`. In ``"tool"`` axes they are the derivatives of the components.
    out
        Array for the result, shape (..., n, 6, n), float64, C-contiguous.

    Returns
    -------
    Array
        Shape (..., n, 6, n): entry [..., k, :, :] is dJ/dq_k, in the units of J per rad or m.

    Raises
    ------
    ValueError, TypeError
        As for :func:`jacobian`.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> jacobian_derivative(library_robot("planar2r"), [0.0, 0.0])[1, :2].round(3)
    array([[-0.4, -0.4],
           [ 0. ,  0. ]])
    """
    _check_frame(frame)
    run, parameters = jacobian_derivative_kernel(description, frame)
    n = description.n
    return fill(run, parameters, [joint_array(description, q)], (n, 6, n), out, threads)


@lru_cache(maxsize=1024)
def jacobian_kernel(description: Description, frame: ReferenceAxes) -> tuple[Kernel, Array]:
    """Return the kernel of :func:`jacobian` and the arm's values of its parameters."""
    pattern, parameters = table_pattern(description)
    return kernel(f"jacobian_{frame}", pattern, lambda: _graph(description, frame)), parameters


@lru_cache(maxsize=1024)
def jacobian_dot_kernel(description: Description, frame: ReferenceAxes) -> tuple[Kernel, Array]:
    """Return the kernel of :func:`jacobian_dot` and the arm's values of its parameters."""
    pattern, parameters = table_pattern(description)
    return kernel(
        f"jacobian_dot_{frame}", pattern, lambda: _dot_graph(description, frame)
    ), parameters


@lru_cache(maxsize=1024)
def jacobian_derivative_kernel(
    description: Description, frame: ReferenceAxes
) -> tuple[Kernel, Array]:
    """Return the kernel of :func:`jacobian_derivative` and the arm's values of its parameters."""
    pattern, parameters = table_pattern(description)
    return kernel(
        f"jacobian_derivative_{frame}", pattern, lambda: _derivative_graph(description, frame)
    ), parameters


def _check_frame(frame: str) -> None:
    if frame not in ("world", "tool"):
        raise ValueError(f"frame is {frame!r}; expected 'world' or 'tool'")


def _graph(description: Description, frame: ReferenceAxes) -> Graph:
    table, parameters = SymbolicTable.parametric(description)
    q = joint_symbols("q", description.n)
    J = symbolic_jacobian(table, q, frame)
    return Graph.of("jacobian", {"parameters": parameters, "q": q}, {"J": J})


def _dot_graph(description: Description, frame: ReferenceAxes) -> Graph:
    table, parameters = SymbolicTable.parametric(description)
    q = joint_symbols("q", description.n)
    qd = joint_symbols("qd", description.n)
    J_dot = symbolic_jacobian_dot(table, q, qd, frame)
    return Graph.of("jacobian_dot", {"parameters": parameters, "q": q, "qd": qd}, {"J_dot": J_dot})


def _derivative_graph(description: Description, frame: ReferenceAxes) -> Graph:
    table, parameters = SymbolicTable.parametric(description)
    q = joint_symbols("q", description.n)
    slopes = derivative_of_matrix(symbolic_jacobian(table, q, frame), q)
    return Graph.of("jacobian_derivative", {"parameters": parameters, "q": q}, {"dJ": slopes})
