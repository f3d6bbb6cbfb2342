"""Forward kinematics: poses of the tool and of all frames."""

from __future__ import annotations

from functools import lru_cache

from numpy.typing import ArrayLike

from dhkit.description import Array, Description, joint_array, takes_robot
from dhkit.kernels import Kernel, fill, kernel
from dhkit.symbolic import Graph, SymbolicTable, joint_symbols, table_pattern


@takes_robot
def forward_kinematics(
    description: Description, q: ArrayLike, out: Array | None = None, threads: int = 1
) -> Array:
    """Return the tool's pose in the world, T_world_tool = base A_1 ... A_n tool.

    Parameters
    ----------
    description
        The robot.
    q
        Joint positions, shape (..., n), rad and m; angles up to 1e6 rad.
    out
        Array to write into, shape (..., 4, 4), float64, contiguous.
    threads
        Number of threads for a large batch.

    Returns
    -------
    Array
        Shape (..., 4, 4); NaN where q has an entry that is not finite or too large.

    Raises
    ------
    ValueError, TypeError
        q has not shape (..., n) or is not numeric; ``out`` does not fit.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> forward_kinematics(arm, [0.0, 0.0])[:3, 3]
    array([0.9, 0. , 0. ])
    >>> forward_kinematics(arm, [[0.0, 0.0], [0.1, 0.2]]).shape
    (2, 4, 4)
    """
    run, parameters = tool_kernel(description)
    return fill(run, parameters, [joint_array(description, q)], (4, 4), out, threads)


@takes_robot
def frames(
    description: Description, q: ArrayLike, out: Array | None = None, threads: int = 1
) -> Array:
    """Return DH frames 0 ... n in the world, shape (..., n+1, 4, 4); arguments as for :func:`forward_kinematics`.

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
        Shape (..., n+1, 4, 4), m.

    Raises
    ------
    ValueError, TypeError
        q has not shape (..., n) or is not numeric; ``out`` does not fit.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> frames(arm, [0, 0])[:, 0, 3]
    array([0. , 0.5, 0.9])
    """
    run, parameters = frames_kernel(description)
    return fill(
        run, parameters, [joint_array(description, q)], (description.n + 1, 4, 4), out, threads
    )


@lru_cache(maxsize=512)
def tool_kernel(description: Description) -> tuple[Kernel, Array]:
    """Return the kernel of :func:`forward_kinematics` and the arm's values of its parameters."""
    pattern, parameters = table_pattern(description)
    return kernel("forward_kinematics", pattern, lambda: _tool_graph(description)), parameters


@lru_cache(maxsize=512)
def frames_kernel(description: Description) -> tuple[Kernel, Array]:
    """Return the kernel of :func:`frames` and the arm's values of its parameters."""
    pattern, parameters = table_pattern(description)
    return kernel("frames", pattern, lambda: _frames_graph(description)), parameters


def _tool_graph(description: Description) -> Graph:
    table, parameters = SymbolicTable.parametric(description)
    q = joint_symbols("q", description.n)
    return Graph.of(
        "forward_kinematics", {"parameters": parameters, "q": q}, {"T": table.world_to_tool(q)}
    )


def _frames_graph(description: Description) -> Graph:
    import casadi

    table, parameters = SymbolicTable.parametric(description)
    q = joint_symbols("q", description.n)
    # CasADi's matrices are stored by columns, NumPy's arrays by rows: Graph.of takes care of it, so that the frames
    # below each other, shape (4 (n + 1), 4), come out as (n + 1, 4, 4).
    stacked = casadi.vertcat(*table.world_to_frames(q))
    return Graph.of("frames", {"parameters": parameters, "q": q}, {"T": stacked})
