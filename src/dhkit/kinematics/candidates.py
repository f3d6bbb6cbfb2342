"""Joint positions from a solver without closed form as solutions, with flags and status."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Description
from dhkit.description.poses import ORTHONORMAL
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.solutions import LIMIT_SLACK, IKFlag, IKSolutions, IKStatus

SINGULARITIES = np.uint8(IKFlag.shoulder | IKFlag.elbow | IKFlag.wrist | IKFlag.singular)
"""Flags of a branch at a singularity."""
_BOUND_ROUNDING = 1e-12
"""Relative margin of the arm's greatest length for rounding in the sum of its links."""


def collect(
    description: Description,
    q: Array,
    distance: Array,
    *,
    positions: Array,
    posed: NDArray[np.bool_],
    branches: tuple[str, ...],
    met: tuple[str, ...],
    flags: NDArray[np.uint8] | None = None,
    complete: bool = True,
    none_exist: NDArray[np.bool_] | None = None,
    redundancy: Array | None = None,
) -> IKSolutions:
    """Return joint positions as solutions.

    Parameters
    ----------
    description
        The robot.
    q
        Joint positions that reach the poses, shape (..., B, n), rad and m; NaN rows where none was found.
    distance
        Distance to report for poses without solution, m, shape (...).
    positions
        Required positions of the tool in the world, shape (..., 3), m.
    posed
        Whether each matrix is a pose, shape (...).
    branches, met
        See :class:`dhkit.kinematics.IKSolutions`.
    flags
        Flags of the branches but for limits, shape (..., B); none unless given.
    complete
        Whether these are all solutions.
    none_exist
        Whether it is known that a pose has no solution, shape (...).
    redundancy
        See :class:`dhkit.kinematics.IKSolutions`.
    """
    valid = np.asarray(~np.isnan(q).any(axis=-1))
    found = valid.any(axis=-1)
    special = np.zeros(valid.shape, dtype=np.uint8)
    if flags is not None:
        special[valid] = flags[valid]
    singular = np.any(special & SINGULARITIES != 0, axis=-1)

    reached = np.where(singular, IKStatus.singular, IKStatus.ok)
    if found.all():
        status = reached
    else:
        beyond = is_beyond_all_links(description, positions)
        if none_exist is not None:
            beyond |= none_exist
        missed = np.where(beyond, IKStatus.out_of_reach, IKStatus.not_found)
        status = np.where(found, reached, missed)
    status = np.where(posed, status, IKStatus.not_a_pose)
    return IKSolutions(
        q=q,
        valid=valid,
        flags=np.where(
            valid & _outside(description, q), special | np.uint8(IKFlag.out_of_limits), special
        ),
        status_code=status.astype(np.uint8),
        distance=np.where(posed, np.where(found, 0.0, distance), np.nan),
        branches=branches,
        met=met,
        description=description,
        complete=complete,
        redundancy=redundancy,
    )


def are_poses(T: Array) -> NDArray[np.bool_]:
    """Return whether matrices (..., 4, 4) are poses, shape (...): finite, orthonormal to 2e-6, last row 0 0 0 1."""
    with np.errstate(over="ignore", invalid="ignore"):
        # R^T R = 1 and det R > 0.
        R = T[..., :3, :3]
        defect = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max(axis=(-1, -2))
        bottom = np.abs(T[..., 3, :] - (0, 0, 0, 1)).max(axis=-1)
        proper = np.linalg.det(R) > 0
        finite = np.isfinite(T).all(axis=(-1, -2))
    posed: NDArray[np.bool_] = finite & proper & (defect <= ORTHONORMAL) & (bottom <= ORTHONORMAL)
    return posed


def orthonormal(T: Array) -> Array:
    """Return poses (..., 4, 4), m, with orthonormal rotations, from poses T whose rotations are orthonormal to 2e-6.

    Each iteration R (3 - R^T R) / 2 squares the defect (Björck and Bowie 1971).
    """
    # R^T R = 1 + E becomes 1 - 3/4 E^2 + O(E^3): two iterations take 2e-6 to 3e-12 and then below rounding.
    T = T.copy()
    for _ in range(2):
        R = T[..., :3, :3]
        T[..., :3, :3] = R @ (1.5 * np.eye(3) - 0.5 * np.swapaxes(R, -1, -2) @ R)
    T[..., 3, :] = (0.0, 0.0, 0.0, 1.0)
    return T


def is_beyond_all_links(description: Description, positions: Array) -> NDArray[np.bool_]:
    """Return whether positions (..., 3), m, are farther from axis 1 than all links in one line reach, shape (...).

    A revolute joint does not move the points of its axis, so the distances of points on consecutive axes are constant.
    A prismatic joint without regard to its limits has no bound.
    """
    axes = Axes.of(description)
    if axes.prismatic.any():
        return np.zeros(positions.shape[:-1], dtype=bool)

    # |p - p_1| <= sum_i |p_(i+1) - p_i|, with a point p_i of each axis and the tool's origin p last (triangle
    # inequality).
    chain = np.vstack([axes.points, axes.T_world_tool[:3, 3]])
    length = np.linalg.norm(np.diff(chain, axis=0), axis=1).sum()
    with np.errstate(all="ignore"):
        away = np.linalg.norm(positions - chain[0], axis=-1)
        # The squares of positions above 1e154 m overflow: they are infinitely far away.
        beyond: NDArray[np.bool_] = away > length + _BOUND_ROUNDING * (
            length + np.abs(positions).sum(axis=-1)
        )
        overflows: NDArray[np.bool_] = np.isinf(away)
    return np.asarray(beyond | overflows)


def _outside(description: Description, q: Array) -> NDArray[np.bool_]:
    """Return whether a joint is outside its limits for all whole turns, shape (...); False for NaN."""
    numbers = description.numbers
    lower = numbers.lower - LIMIT_SLACK
    upper = numbers.upper + LIMIT_SLACK

    outside = np.zeros(q.shape[:-1], dtype=bool)
    # Most are inside as they are, without whole turns. Comparisons with NaN are false.
    rows = np.nonzero(((q < lower) | (q > upper)).any(axis=-1))
    if len(rows[0]):
        # lower <= q + 2 pi k <= upper for some whole k: ceil((lower - q) / (2 pi)) <= floor((upper - q) / (2 pi)).
        some = q[rows]
        windings = np.floor((upper - some) / math.tau) - np.ceil((lower - some) / math.tau)
        is_beyond = np.where(numbers.prismatic, (some < lower) | (some > upper), windings < 0)
        outside[rows] = is_beyond.any(axis=-1)
    return outside
