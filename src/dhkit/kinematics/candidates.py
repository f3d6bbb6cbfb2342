"""Joint values that a solver without closed form has found, made into solutions: what counts, flags and status."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Description
from dhkit.description.poses import ORTHONORMAL
from dhkit.kinematics.solutions import LIMIT_SLACK, IKFlag, IKSolutions, IKStatus

TURN = 2 * np.pi


def collect(
    description: Description,
    q: Array,
    distance: Array,
    *,
    posed: NDArray[np.bool_],
    branches: tuple[str, ...],
    met: tuple[str, ...],
) -> IKSolutions:
    """Return the solutions that joint values are.

    Parameters
    ----------
    description
        The robot.
    q
        Joint values that close, NaN rows for what was not found, shape (..., B, n).
    distance
        What is to be said of poses that nothing was found for, m, shape (...).
    posed
        Which poses are poses, shape (...).
    branches, met
        As of :class:`dhkit.kinematics.IKSolutions`.
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
    """Return which matrices (..., 4, 4) are poses: finite, orthonormal to 1e-6, last row 0 0 0 1."""
    with np.errstate(over="ignore", invalid="ignore"):
        R = T[..., :3, :3]
        defect = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max(axis=(-1, -2))
        bottom = np.abs(T[..., 3, :] - (0, 0, 0, 1)).max(axis=-1)
        proper = np.einsum("...i,...i", np.cross(R[..., 0], R[..., 1]), R[..., 2]) > 0
        finite = np.isfinite(T).all(axis=(-1, -2))
    posed: NDArray[np.bool_] = finite & proper & (defect <= ORTHONORMAL) & (bottom <= ORTHONORMAL)
    return posed


def orthonormal(T: Array) -> Array:
    """Return poses (..., 4, 4) with the rotations nearest to theirs, which are rotations to 1e-6.

    Each round of R (3 - R^T R) / 2 squares what is missing (Björck and Bowie 1971).
    """
    T = T.copy()
    for _ in range(2):
        R = T[..., :3, :3]
        T[..., :3, :3] = R @ (1.5 * np.eye(3) - 0.5 * np.swapaxes(R, -1, -2) @ R)
    T[..., 3, :] = (0.0, 0.0, 0.0, 1.0)
    return T


def wrapped(q: Array, turning: NDArray[np.bool_]) -> Array:
    """Return joint values (..., n) with the angles of the joints that are marked, shape (n,), in (-pi, pi]."""
    inside = (q > -np.pi) & (q <= np.pi)
    wound: Array = np.where(turning & ~inside, q - TURN * np.ceil((q - np.pi) / TURN), q)
    return wound


def _outside(description: Description, q: Array) -> NDArray[np.bool_]:
    """Return where some joint is outside its limits whatever whole turns are added, shape (...); NaN is not."""
    numbers = description.numbers
    lower, upper = numbers.lower - LIMIT_SLACK, numbers.upper + LIMIT_SLACK
    with np.errstate(invalid="ignore"):
        windings = np.floor((upper - q) / TURN) - np.ceil((lower - q) / TURN)
        outside: NDArray[np.bool_] = np.where(numbers.prismatic, (q < lower) | (q > upper), windings < 0)
    return np.asarray(outside.any(axis=-1))
