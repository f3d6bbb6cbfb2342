"""Roots of the equations of a step that are not solutions: an equation that has some does not determine its joint."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.grading.judging.inverse_poses import Poses

_TRIED_POSES = 12
"""Number of poses at which roots are looked for."""
_GRID = 720
"""Joint values at which equations are tried first: every half degree, or every 1/180 of the reach."""
_REFINEMENTS = 45
"""Steps that narrow the interval about a smallest residual, each by a quarter."""
_MAY_BE_ROOT = 0.1
"""Largest residual on the grid beside a root."""
_IS_ROOT = 1e-7
"""Largest residual of a root: relative to the largest size of an equation's terms at any joint value."""
_FAR = 1e-3
"""Least distance of a root from all solutions, rad or relative to the reach, that makes it another one."""
_LEAST_SHARE = 0.5
"""Least share of the poses with another root: at single poses a root may be one by chance."""

Residual: TypeAlias = Callable[[NDArray[np.intp], Array], Array]
"""Function from indices of poses (k,) and joint values (k, n), rad and m, to residuals (k,), none negative."""


def other_root(
    poses: Poses, joint: int, before: Sequence[int], residual_on: Callable[[NDArray[np.intp], Array], Residual]
) -> float | None:
    """Return a joint value that equations allow and no solution has; None if they have solutions for roots alone.

    Parameters
    ----------
    poses
        Poses with all their solutions.
    joint
        The joint that the equations are to determine, from 0.
    before
        Joints that earlier steps find; they have the values of a solution.
    residual_on
        Function from the indices of poses (k,) and joint values (k, n) to the equations' residual, the largest of all,
        relative to the largest size of their terms there.
    """
    count = min(_TRIED_POSES, len(poses.q))
    truths = poses.truths[:count]
    is_solution = np.all(np.isfinite(truths), axis=-1)
    q = truths[np.arange(count), np.argmax(is_solution, axis=1)]
    reach = poses.scale if poses.description.numbers.prismatic[joint] else np.pi
    grid = np.linspace(-reach, reach, _GRID + 1)

    def at(rows: NDArray[np.intp], x: Array) -> Array:
        joints: Array = q[rows].copy()
        joints[:, joint] = x
        return joints

    every = np.repeat(np.arange(count), len(grid))
    values = np.tile(grid, count)
    residual = residual_on(every, at(every, values))
    rows, roots = _roots(lambda k, x: residual(k, at(k, x)), grid, count)
    # The solutions of a pose that have the same values of the joints before.
    same = is_solution & np.all(poses.gaps(truths[..., before], q[:, None, before], list(before)) < _FAR, axis=-1)
    gaps = np.where(same[rows], poses.gaps(roots[:, None], truths[rows, :, joint], joint), np.inf)
    is_other = np.all(gaps > _FAR, axis=1)
    share = len(np.unique(rows[is_other])) / count
    return round(float(roots[is_other][0]), 6) + 0.0 if share >= _LEAST_SHARE else None


def _roots(residual: Residual, grid: Array, count: int) -> tuple[NDArray[np.intp], Array]:
    """Return the roots of residuals and the indices of their poses: from the smallest values on a grid."""
    every = np.repeat(np.arange(count), len(grid))
    values = np.nan_to_num(residual(every, np.tile(grid, count)), nan=np.inf).reshape(count, -1)
    inner = values[:, 1:-1]
    is_low = (inner <= values[:, :-2]) & (inner <= values[:, 2:]) & (inner < _MAY_BE_ROOT)
    rows, places = np.nonzero(is_low)
    centres = grid[1:-1][places]
    width = 2 * (grid[1] - grid[0])
    # A smallest value lies between the neighbours on the grid: the quarter that does not have it is left out.
    twice = np.concatenate([rows, rows])
    for _ in range(_REFINEMENTS if len(rows) else 0):
        both = residual(twice, np.concatenate([centres - width / 4, centres + width / 4]))
        left, right = np.split(np.nan_to_num(both, nan=np.inf), 2)
        centres = np.where(left < right, centres - width / 8, centres + width / 8)
        width *= 0.75
    is_root = np.nan_to_num(residual(rows, centres), nan=np.inf) < _IS_ROOT if len(rows) else np.zeros(0, dtype=bool)
    return rows[is_root], centres[is_root]
