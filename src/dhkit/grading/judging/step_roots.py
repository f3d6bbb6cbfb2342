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
"""Number of intervals of the grid of joint values at which equations are tried first: every half degree of a turn, or
every 1/360 of the reach from minus to plus the reach."""
_REFINEMENTS = 45
"""Number of steps that narrow the interval about a smallest residual, each to three quarters: to 2e-6 of its width."""
_MAY_BE_ROOT = 0.1
"""Largest residual on the grid beside a root."""
_IS_ROOT = 1e-7
"""Largest residual of a root, relative to the largest size of the equations' terms at any joint value."""
_FAR = 1e-3
"""Smallest distance of a root from all solutions, rad or relative to the reach, at which it is not one of them."""
_LEAST_SHARE = 0.5
"""Smallest share of the poses that must have another root: at single poses there may be one by chance."""

Residual: TypeAlias = Callable[[NDArray[np.intp], Array], Array]
"""Function from indices of poses (k,) and joint values (k, n), rad and m, to residuals (k,), none negative."""


def other_root(
    poses: Poses,
    joint: int,
    before: Sequence[int],
    residual_on: Callable[[NDArray[np.intp], Array], Residual],
    worked: Array,
) -> float | None:
    """Return a root of the equations that is not a joint value of any solution; None if all roots are solutions.

    Parameters
    ----------
    poses
        Poses with all their solutions.
    joint
        The joint that the equations are to determine, from 0.
    before
        Joints that earlier steps find, from 0; they have the values of a solution.
    residual_on
        Function from the indices of poses (k,) and joint values (k, n) to the residual of the equations, the largest of
        all of them, relative to the largest size of their terms at these joint values.
    worked
        Roots of the worked solution, shape (S, C, n), rad and m: after them later joints may have no solution.
    """
    count = min(_TRIED_POSES, len(poses.q))
    truths = poses.truths[:count]

    # The first solution of each pose, in which the joint then takes the values of a grid.
    is_solution = np.all(np.isfinite(truths), axis=-1)
    q = truths[np.arange(count), np.argmax(is_solution, axis=1)]
    reach = poses.scale if poses.description.numbers.prismatic[joint] else np.pi
    grid = np.linspace(-reach, reach, _GRID + 1)

    def with_value(rows: NDArray[np.intp], x: Array) -> Array:
        joints: Array = q[rows].copy()
        joints[:, joint] = x
        return joints

    every = np.repeat(np.arange(count), len(grid))
    values = np.tile(grid, count)
    residual = residual_on(every, with_value(every, values))
    rows, roots = _roots(lambda k, x: residual(k, with_value(k, x)), grid, count)

    # Roots that are the joint's value in a solution with the same values of the joints before are expected.
    known = np.concatenate(
        [np.where(is_solution[..., None], truths, np.nan), worked[:count]], axis=1
    )
    gaps_before = poses.gaps(known[..., before], q[:, None, before], list(before))
    is_expected = np.isfinite(known[..., joint]) & np.all(gaps_before < _FAR, axis=-1)
    gaps = np.where(
        is_expected[rows], poses.gaps(roots[:, None], known[rows, :, joint], joint), np.inf
    )
    is_other = np.all(gaps > _FAR, axis=1)

    share = len(np.unique(rows[is_other])) / count
    if share < _LEAST_SHARE:
        return None
    return round(float(roots[is_other][0]), 6) + 0.0


def _roots(residual: Residual, grid: Array, count: int) -> tuple[NDArray[np.intp], Array]:
    """Return the indices of poses (R,) and the roots of their residuals (R,), rad or m.

    Each local minimum on the grid is refined by search in an interval that shrinks about it.
    """
    every = np.repeat(np.arange(count), len(grid))
    values = np.nan_to_num(residual(every, np.tile(grid, count)), nan=np.inf).reshape(count, -1)
    inner = values[:, 1:-1]
    is_low = (inner <= values[:, :-2]) & (inner <= values[:, 2:]) & (inner < _MAY_BE_ROOT)
    rows, places = np.nonzero(is_low)
    centres = grid[1:-1][places]
    if not len(rows):
        return rows, centres

    # The minimum lies in [c - w/2, c + w/2], between the neighbours on the grid. Of a residual with one minimum there,
    # the outer quarter beside the larger of the values at c - w/4 and c + w/4 does not contain it and is left out: the
    # rest has the width 3/4 w and its centre at c -+ w/8.
    width = 2 * (grid[1] - grid[0])
    twice = np.concatenate([rows, rows])
    for _ in range(_REFINEMENTS):
        both = residual(twice, np.concatenate([centres - width / 4, centres + width / 4]))
        left, right = np.split(np.nan_to_num(both, nan=np.inf), 2)
        centres = np.where(left < right, centres - width / 8, centres + width / 8)
        width *= 0.75

    is_root = np.nan_to_num(residual(rows, centres), nan=np.inf) < _IS_ROOT
    return rows[is_root], centres[is_root]
