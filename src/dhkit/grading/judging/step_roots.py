"""Roots of the equations of a step that are no solutions: an equation that has some does not determine its joint."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from dhkit.description import Array
from dhkit.grading.judging.inverse_poses import Poses

TRIED_POSES = 12
"""Number of poses at which roots are looked for."""
GRID = 720
"""Joint values at which equations are tried first: every half degree, or every 1/180 of twice the reach."""
REFINEMENTS = 45
"""Halvings of the interval about a smallest residual; 2^-45 of a degree is rounding."""
IS_ROOT = 1e-8
"""Largest residual, relative to the size of an equation's terms, of a root."""
FAR = 1e-3
"""Least distance of a root from all solutions, rad or relative to the reach, that makes it another one."""
LEAST_SHARE = 0.5
"""Least share of the poses with another root: at single poses a root may be one by chance."""


def other_root(
    poses: Poses, joint: int, before: Sequence[int], residual: Callable[[int, Array], Array]
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
    residual
        Function from the index of a pose and joint values (k, n), rad and m, to the residuals (k,), each the largest of
        all equations, relative to the largest size of their terms at these joint values.
    """
    is_prismatic = bool(poses.description.numbers.prismatic[joint])
    reach = 2 * poses.scale if is_prismatic else np.pi
    grid = np.linspace(-reach, reach, GRID + 1)
    found: list[float | None] = []
    for s in range(min(TRIED_POSES, len(poses.q))):
        truths = poses.truths[s]
        truths = truths[np.all(np.isfinite(truths), axis=1)]
        same = np.all(poses.gaps(truths[:, list(before)], truths[:1, list(before)], list(before)) < FAR, axis=1)
        known = truths[same][:, joint]

        def at(x: Array, s: int = s, q: Array = truths[0]) -> Array:
            # With the grid, so that residuals are relative to the same size each time.
            joints = np.tile(q, (len(x) + len(grid), 1))
            joints[:, joint] = np.concatenate([x, grid])
            return residual(s, joints)[: len(x)]

        roots = _roots(at, grid)
        gaps = poses.gaps(roots[:, None], known[None, :], joint)
        others = roots[np.all(gaps > FAR, axis=1)]
        found.append(float(others[0]) if len(others) else None)
    share = np.mean([one is not None for one in found]) if found else 0.0
    return next((one for one in found if one is not None), None) if share >= LEAST_SHARE else None


def _roots(residual: Callable[[Array], Array], grid: Array) -> Array:
    """Return the values at which a residual, which is nowhere negative, is zero: from its smallest values on a grid."""
    values = np.nan_to_num(residual(grid), nan=np.inf)
    inner = values[1:-1]
    is_low = (inner <= values[:-2]) & (inner <= values[2:]) & (inner < 0.1)
    centres = grid[1:-1][is_low]
    width = np.full(len(centres), grid[1] - grid[0])
    # A smallest value lies between the neighbours on the grid: thirds that do not have it are left out.
    for _ in range(REFINEMENTS):
        left, right = centres - width / 3, centres + width / 3
        at_left, at_right = (np.nan_to_num(residual(x), nan=np.inf) for x in (left, right))
        centres = np.where(at_left < at_right, centres - width / 6, centres + width / 6)
        width = width * 0.75
    return centres[np.nan_to_num(residual(centres), nan=np.inf) < IS_ROOT] if len(centres) else centres
