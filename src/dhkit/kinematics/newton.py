"""One damped Newton step towards a pose inside the joint limits, for iterative inverse kinematics."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Description
from dhkit.kernels import Kernel, kernel
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.forward import forward_kinematics
from dhkit.kinematics.jacobian import jacobian
from dhkit.kinematics.manipulability import freedoms
from dhkit.symbolic import Graph, Loop, table_pattern


@dataclass(frozen=True, eq=False)
class Newton:
    """Errors and steps of an arm; lengths are divided by the reach to compare them with radians."""

    description: Description
    length: float
    """Length that counts as much as a radian, m: the reach."""
    size: int
    """Number of coordinates of a pose to reach: 6, or 3 for the position alone."""
    lower: Array
    """Joint limits that steps keep, shape (n,), rad and m."""
    upper: Array

    @classmethod
    def of(cls, description: Description, *, position_only: bool, limits: bool) -> Newton:
        """Return the steps of an arm."""
        numbers = description.numbers
        anywhere = np.full(description.n, np.inf)
        return cls(
            description,
            length=Axes.of(description).scale,
            size=3 if position_only else 6,
            lower=numbers.lower if limits else -anywhere,
            upper=numbers.upper if limits else anywhere,
        )

    @property
    def freedoms(self) -> int:
        """Number of directions in which the arm can move the tool, of those that count."""
        return freedoms(self.description, "whole" if self.size == 6 else "translational")

    @property
    def units(self) -> Array:
        """Unit of each joint's steps, shape (n,): 1 rad, or the reach in m."""
        return np.where(self.description.numbers.prismatic, self.length, 1.0)

    @property
    def parameters(self) -> Array:
        """Length, units, endless joints and limits, as the programs take them, shape (1 + 4 n,)."""
        return np.concatenate([[self.length], self.units, self.endless, self.lower, self.upper])

    @property
    def endless(self) -> NDArray[np.bool_]:
        """Whether a joint's range is at least 2 pi rad, so that it never stops at a limit, shape (n,)."""
        return ~self.description.numbers.prismatic & (self.upper - self.lower >= math.tau)

    @property
    def middle(self) -> Array:
        """Middle of the limits, 0 without limits, shape (n,), rad and m."""
        lower, upper = self.ranges(0.0)
        return (lower + upper) / 2

    def ranges(self, room: Array | float) -> tuple[Array, Array]:
        """Return the limits, shape (n,) each, rad and m; -``room`` and ``room`` for joints without limits."""
        limited = np.isfinite(self.upper - self.lower)
        return np.where(limited, self.lower, -np.asarray(room)), np.where(limited, self.upper, room)

    def inside(self, q: Array) -> Array:
        """Return joint values q (..., n), rad and m, moved into the limits by whole turns or to the nearest limit."""
        # q - 2 pi round((q - middle) / 2 pi) is the representative of an angle that is nearest to the middle.
        whole_turns = math.tau * np.rint((q - self.middle) / math.tau)
        nearest = q - np.where(self.description.numbers.prismatic, 0.0, whole_turns)

        outside = (q < self.lower) | (q > self.upper)
        return np.clip(np.where(outside, nearest, q), self.lower, self.upper)

    def error(self, q: Array, goals: Array) -> Array:
        """Return the errors from poses of the tool to goals.

        Parameters
        ----------
        q
            Shape (N, n).
        goals
            Poses, shape (N, 16), row by row.

        Returns
        -------
        Array
            Shape (N, 6) or (N, 3): displacement over ``length``, then rotation vector, rad, both in world axes.
        """
        T = forward_kinematics(self.description, q).reshape(-1, 16)
        error = np.empty((len(q), self.size))
        run = error_kernel(self.size)
        run(np.array([self.length]), [T, goals], [error])
        return error

    def step(self, q: Array, error: Array, damping: Array) -> Array:
        """Return the joint values after one step, inside the limits.

        Parameters
        ----------
        q
            Shape (N, n), inside the limits.
        error
            Shape (N, 6) or (N, 3), as of :meth:`error`.
        damping
            Positive number added to the squares of the Jacobian's singular values, shape (N,).
        """
        n = self.description.n
        J = jacobian(self.description, q).reshape(-1, 6 * n)
        new = np.empty_like(q)
        run = step_kernel(n, self.size)
        run(self.parameters, [q, error, J, damping[:, None]], [new])
        return new

    def descend(self, goals: Array, starts: Array, tolerance: float) -> tuple[Array, Array]:
        """Search until all poses are reached or all searches are stalled.

        Parameters
        ----------
        goals
            Poses, shape (N, 16), row by row; rotations orthonormal to 2e-6.
        starts
            Shape (N, n), inside the limits.
        tolerance
            Largest error, see :func:`closes`.

        Returns
        -------
        tuple[Array, Array]
            Joint values (N, n), and the errors there, as of :meth:`error`.
        """
        q = np.empty_like(starts)
        error = np.empty((len(starts), self.size))
        run, parameters = descent_kernel(self.description, self.size)
        tolerances = np.full((len(starts), 1), tolerance)
        posed = np.empty((len(starts), 1))
        run(
            np.concatenate([parameters, self.parameters]),
            [goals, starts, tolerances],
            [q, error, posed],
        )
        return q, error


def error_kernel(size: int) -> Kernel:
    """Return the kernel of :meth:`Newton.error` for 6 coordinates of a pose, or 3."""

    def derived() -> Graph:
        from dhkit.kinematics.newton_program import error_program

        return error_program(size)

    return kernel("pose_error", f"{size}", derived)


def step_kernel(n: int, size: int) -> Kernel:
    """Return the kernel of :meth:`Newton.step` for n joints and 6 coordinates of a pose, or 3."""

    def derived() -> Graph:
        from dhkit.kinematics.newton_program import step_program

        return step_program(n, size)

    return kernel("newton_step", f"{n} {size}", derived)


@lru_cache(maxsize=512)
def descent_kernel(description: Description, size: int) -> tuple[Kernel, Array]:
    """Return the kernel of :meth:`Newton.descend`, and the first of its parameters: those of the arm's table."""

    def derived() -> Loop:
        from dhkit.kinematics.descent_program import descent_program

        return descent_program(description, size)

    pattern, parameters = table_pattern(description)
    run = kernel("descent", f"{size} {pattern}", derived, ("float64",) * 3, is_loop=True)
    return run, parameters


def magnitude(error: Array) -> Array:
    """Return the larger one of position and rotation of errors (..., 6) or (..., 3), shape (...)."""
    return np.sqrt(_largest_square(error))


def closes(error: Array, tolerance: float) -> NDArray[np.bool_]:
    """Return whether errors (..., 6) or (..., 3) are within the tolerance, position and rotation each, shape (...)."""
    # Squares are compared, as the compiled search does: of far poses both sides are infinite.
    within: NDArray[np.bool_] = _largest_square(error) <= tolerance**2
    return within


def _largest_square(error: Array) -> Array:
    squares = error**2
    position = squares[..., :3].sum(axis=-1)
    rotation = squares[..., 3:].sum(axis=-1)
    larger: Array = np.maximum(position, rotation)
    return larger
