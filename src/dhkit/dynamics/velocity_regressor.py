"""The regressor of adaptive control: with rates and reference rates, and in the fewest parameters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, joint_array, takes_robot
from dhkit.display import counted, repr_line
from dhkit.dynamics.regressor import gravity_in_base, regressor
from dhkit.kernels import Kernel, fill, kernel
from dhkit.symbolic import (
    Graph,
    SymbolicTable,
    joint_symbols,
    table_pattern,
    velocity_regressor as velocity_regressor_expression,
)

_DEPENDENT = 1e-9
"""Largest norm that is left of a dependent column of length 1 when its projection on others is subtracted; rounding
leaves 1e-14."""
_STATES_PER_JOINT = 20
"""Number of random states per joint for the rank: twice as many equations as parameters."""


@takes_robot
def velocity_regressor(
    description: Description,
    q: ArrayLike,
    qd: ArrayLike,
    qd_r: ArrayLike,
    qdd_r: ArrayLike,
    out: Array | None = None,
    threads: int = 1,
) -> Array:
    """Return Y with Y theta + B qdd_r = M(q) qdd_r + C(q, qd) qd_r + g(q), theta of ``inertial_parameters``.

    B is ``numbers.drive_inertia``, C that of :func:`dhkit.dynamics.coriolis_matrix`. With qd_r = qd and qdd_r = qdd
    it is the regressor of inverse dynamics, :func:`dhkit.dynamics.regressor` (Slotine & Li, On the Adaptive Control
    of Robot Manipulators, 1987).

    Parameters
    ----------
    description
        The robot; its links' bodies do not matter.
    q, qd
        Joint values and rates, shapes (..., n), rad, m and seconds; batch axes broadcast.
    qd_r, qdd_r
        Reference rates and accelerations, likewise.
    out
        Array that receives the result, shape (..., n, 10 n), float64, C-contiguous.
    threads
        Number of threads that share a large batch.

    Returns
    -------
    Array
        Shape (..., n, 10 n); NaN where an input is not finite.

    Raises
    ------
    ValueError, TypeError
        An argument of another shape, or not numeric; ``out`` does not fit.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> velocity_regressor(arm, [0.3, -0.5], [1.0, 0.2], [0.9, 0.1], [0.0, 0.0]).shape
    (2, 20)
    """
    named = ((q, "q"), (qd, "qd"), (qd_r, "qd_r"), (qdd_r, "qdd_r"))
    states = [joint_array(description, x, name) for x, name in named]
    run, parameters = _velocity_regressor_kernel(description)
    return fill(run, parameters, states, (description.n, 10 * description.n), out, threads)


@lru_cache(maxsize=512)
def _velocity_regressor_kernel(description: Description) -> tuple[Kernel, Array]:
    """Return the kernel of :func:`velocity_regressor` and the arm's values of its parameters."""
    pattern, parameters = table_pattern(description)
    run = kernel("velocity_regressor", pattern, lambda: _graph(description))
    return run, np.concatenate([parameters, gravity_in_base(description)])


def _graph(description: Description) -> Graph:
    """Return the program of :func:`velocity_regressor`; gravity in frame 0 is the last parameter."""
    import casadi

    table, parameters = SymbolicTable.parametric(description)
    gravity = joint_symbols("gravity", 3)
    states = {name: joint_symbols(name, description.n) for name in ("q", "qd", "qd_r", "qdd_r")}
    Y = velocity_regressor_expression(table, (gravity[0], gravity[1], gravity[2]), *states.values())
    return Graph.of(
        "velocity_regressor",
        {"parameters": casadi.vertcat(parameters, gravity), **states},
        {"Y": Y},
    )


@dataclass(frozen=True, eq=False)
class ParameterGrouping:
    """Base parameters in numbers: the fewest combinations of inertial parameters that the torques depend on.

    With theta of :func:`dhkit.dynamics.inertial_parameters`, Y theta = Y[..., columns] @ (matrix @ theta) for every
    state: base parameter k is entry ``columns[k]`` of theta plus multiples of others that have the same effect.
    """

    columns: tuple[int, ...]
    """Indices of independent columns of the regressor, ascending."""
    matrix: Array
    """Base parameters in terms of inertial parameters, shape (m, 10 n)."""

    def __len__(self) -> int:
        return len(self.columns)

    def __repr__(self) -> str:
        columns = ", ".join(map(str, self.columns))
        return repr_line(
            "ParameterGrouping", counted(len(self), "base parameter"), f"columns {columns}"
        )


@takes_robot
@lru_cache(maxsize=128)
def parameter_grouping(description: Description) -> ParameterGrouping:
    """Return an arm's base parameters from the rank of its regressor at random states.

    Columns are taken one after the other, and kept where they do not depend on those before (Gautier 1991, Numerical
    calculation of the base inertial parameters of robots): moments first, from the last link to the first, then masses.
    So a mass is grouped with moments, and what may belong to two links with that nearer to the base.

    Parameters
    ----------
    description
        The robot.

    Returns
    -------
    ParameterGrouping
        Base parameters in numbers, without those of the drives; in symbols: :func:`dhkit.symbolic.base_parameters`.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.dynamics import inertial_parameters
    >>> arm = library_robot("planar2r")
    >>> grouping = parameter_grouping(arm)  # of rx, ry and Izz of both links, the masses grouped with them
    >>> grouping.columns
    (1, 2, 6, 11, 12, 16)
    >>> (grouping.matrix @ inertial_parameters(arm)).shape
    (6,)
    """
    n = description.n
    rng = np.random.default_rng(0)
    states = rng.uniform(-np.pi, np.pi, (3, _STATES_PER_JOINT * n, n))
    A = regressor(description, *states).reshape(-1, 10 * n)

    # Moments from the last link to the first, then masses. Column 10 i is the mass of link i, then come its moments.
    order: list[int] = []
    for i in reversed(range(n)):
        order += range(10 * i + 1, 10 * i + 10)
    order += [10 * i for i in reversed(range(n))]

    # Gram-Schmidt: the columns of Q are an orthonormal basis of the kept columns. The second pass removes the
    # components along them that rounding left.
    Q = np.zeros((len(A), 0))
    kept = []
    smallest = _DEPENDENT * np.linalg.norm(A, axis=0).max()
    for k in order:
        size = np.linalg.norm(A[:, k])
        if size <= smallest:
            continue
        rest = A[:, k] / size
        for _ in range(2):
            rest = rest - Q @ (Q.T @ rest)
        if np.linalg.norm(rest) > _DEPENDENT:
            Q = np.column_stack([Q, rest / np.linalg.norm(rest)])
            kept.append(k)

    # All columns as combinations of the kept ones: A = A[:, columns] matrix
    columns = tuple(sorted(kept))
    matrix, *_ = np.linalg.lstsq(A[:, columns], A, rcond=None)
    return ParameterGrouping(columns, np.asarray(matrix))
