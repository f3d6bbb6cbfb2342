"""Joint positions from a solver without closed form as solutions, with flags and status."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Description
from dhkit.description.poses import ORTHONORMAL
from dhkit.kinematics.solutions import LIMIT_SLACK, IKFlag, IKSolutions, IKStatus


def collect(
    description: Description,
    q: Array,
    distance: Array,
    *,
    posed: NDArray[np.bool_],
    branches: tuple[str, ...],
    met: tuple[str, ...],
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
    posed
        Whether each matrix is a pose, shape (...).
    branches, met
        See :class:`dhkit.kinematics.IKSolutions`.
    """
    valid = np.asarray(~np.isnan(q).any(axis=-1))
    found = valid.any(axis=-1)
    status = np.where(posed, np.where(found, IKStatus.ok, IKStatus.out_of_reach), IKStatus.not_a_pose)
    return IKSolutions(
        q=q,
        valid=valid,
        flags=np.where(valid & _outside(description, q), np.uint8(IKFlag.out_of_limits), np.uint8(0)),
        status_code=status.astype(np.uint8),
        distance=np.where(posed, np.where(found, 0.0, distance), np.nan),
        branches=branches,
        met=met,
        description=description,
    )


def are_poses(T: Array) -> NDArray[np.bool_]:
    """Return whether matrices (..., 4, 4) are poses, shape (...): finite, orthonormal to 1e-6, last row 0 0 0 1."""
    with np.errstate(over="ignore", invalid="ignore"):
        R = T[..., :3, :3]
        defect = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max(axis=(-1, -2))
        bottom = np.abs(T[..., 3, :] - (0, 0, 0, 1)).max(axis=-1)
        proper = np.einsum("...i,...i", np.cross(R[..., 0], R[..., 1]), R[..., 2]) > 0
        finite = np.isfinite(T).all(axis=(-1, -2))
    posed: NDArray[np.bool_] = finite & proper & (defect <= ORTHONORMAL) & (bottom <= ORTHONORMAL)
    return posed


def orthonormal(T: Array) -> Array:
    """Return poses (..., 4, 4), m, with orthonormal rotations, from poses T whose rotations are orthonormal to 1e-6.

    Each iteration R (3 - R^T R) / 2 squares the defect (Björck and Bowie 1971).
    """
    T = T.copy()
    for _ in range(2):
        R = T[..., :3, :3]
        T[..., :3, :3] = R @ (1.5 * np.eye(3) - 0.5 * np.swapaxes(R, -1, -2) @ R)
    T[..., 3, :] = (0.0, 0.0, 0.0, 1.0)
    return T


def wrap_angles(q: Array, turning: NDArray[np.bool_]) -> Array:
    """Return joint values q (..., n), rad and m, with angles of the marked joints (n,) reduced to (-pi, pi]."""
    inside = (q > -np.pi) & (q <= np.pi)
    return np.where(turning & ~inside, q - math.tau * np.ceil((q - np.pi) / math.tau), q)


def _outside(description: Description, q: Array) -> NDArray[np.bool_]:
    """Return whether a joint is outside its limits for all whole turns, shape (...); False for NaN."""
    numbers = description.numbers
    lower, upper = numbers.lower - LIMIT_SLACK, numbers.upper + LIMIT_SLACK
    with np.errstate(invalid="ignore"):
        windings = np.floor((upper - q) / math.tau) - np.ceil((lower - q) / math.tau)
        outside: NDArray[np.bool_] = np.where(numbers.prismatic, (q < lower) | (q > upper), windings < 0)
    return np.asarray(outside.any(axis=-1))
