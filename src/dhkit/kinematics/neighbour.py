"""Inverse kinematics of arms whose axes are nearly, but not exactly, those of a family with a closed form.

Axes 2 and 3 of such an arm are off parallel by 1e-6 rad, say, because its angles were measured or rounded. Its
neighbour is the arm of the family with the same parameters: its axes 2 and 3 are parallel. A solution of the neighbour
misses the pose by about the defect of the axes, and Newton's method on the arm's own kinematics, begun there, squares
that miss in each step.

Not every solution need be found, so that a pose without one is ``not_found`` and not ``out_of_reach``:

- Near the boundary of the workspace the neighbour may have no solution. The starts are then its solutions for the same
  pose moved by a little more than the miss.
- Where two branches lead to one solution, or one to none, as near a singularity, the solution is followed along a path
  of poses.
- Where no branch leads to a solution, one is looked for by :func:`dhkit.kinematics.numeric.solve_numerically`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from dhkit.description import Array, Description, world_to_tool
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.candidates import (
    SINGULARITIES,
    are_poses,
    collect,
    is_beyond_all_links,
    orthonormal,
)
from dhkit.kinematics.closed_form import classify
from dhkit.kinematics.closed_form.family import ALL_COORDINATES
from dhkit.kinematics.newton import Newton
from dhkit.kinematics.numeric import refined, solve_numerically
from dhkit.kinematics.solutions import IKFlag, IKSolutions
from dhkit.kinematics.solver import Solver, free_angles, solve_in_closed_form, solver_for

_OTHER = "other"
"""Name of the last branch: a solution that iteration finds where no branch of the neighbour leads to one."""
_OTHER_STARTS = 15
"""Number of random starts of that iteration for a pose."""
_CHUNK = 2048
"""Number of poses at a time: the differences of all pairs of their solutions take 6 MB."""
_SAMPLES = 64
"""Number of random states at which the neighbour's miss is measured."""
_MISSES = 4.0
"""Displacement of a pose near the boundary, over the neighbour's largest miss.

The pose is displaced along each axis to both sides. The direction towards the workspace has an angle to one of those of
at most arccos(1 / sqrt(3)), so that the pose moves there by 0.58 of the displacement, more than twice the miss."""
_PATH_STEPS = 32
"""Number of steps in which a solution is followed from the pose of its start to the required one."""
_PATH_ERROR = 1e-9
"""Error, share of the reach and rad, at which Newton's method stops on the way."""
_SAME_ANGLE = 1e-6
"""Joint values, rad or share of the reach, that differ by less are the same solution."""


def solve_from_neighbour(
    description: Description, T: ArrayLike, seed: ArrayLike | None = None
) -> IKSolutions:
    """Return the solutions of T_world_tool(q) = T that Newton's method finds from those of the neighbouring arm.

    Parameters
    ----------
    description
        The robot; its classification has a neighbour.
    T
        Poses of the tool in the world, shape (..., 4, 4).
    seed
        Joint values for free joints, as for :func:`dhkit.kinematics.inverse_kinematics`.

    Returns
    -------
    IKSolutions
        The neighbour's branches, and ``"other"``. All have the flag ``refined``, and close to 1e-10; their flags of
        singularities are the neighbour's. ``distance`` is NaN where nothing was found.
    """
    poses = np.asarray(T, dtype=float)
    batch = poses.shape[:-2]
    solver = _neighbour(description)
    free = free_angles(description, solver.fit, seed, batch).reshape(2, -1)
    rows = poses.reshape(-1, 4, 4)
    posed = are_poses(rows)

    B = len(solver.fit.branches) + 1
    q = np.full((len(rows), B, description.n), np.nan)
    flags = np.zeros((len(rows), B), dtype=np.uint8)
    for begin in range(0, len(rows), _CHUNK):
        some = begin + np.flatnonzero(posed[begin : begin + _CHUNK])
        q[some, :-1], flags[some, :-1] = _refined_branches(
            description, solver, rows[some], free[:, some]
        )

    missing = (
        posed
        & np.isnan(q).any(axis=-1).all(axis=-1)
        & ~is_beyond_all_links(description, rows[:, :3, 3])
    )
    if missing.any():
        iterated = solve_numerically(
            description, rows[missing], restarts=_OTHER_STARTS, limits=False
        )
        q[missing, -1] = iterated.q[:, 0]
    return collect(
        description,
        q.reshape(*batch, B, description.n),
        np.full(batch, np.nan),
        positions=poses[..., :3, 3],
        posed=posed.reshape(batch),
        branches=(*solver.fit.branches, _OTHER),
        met=ALL_COORDINATES,
        flags=(flags & SINGULARITIES | np.uint8(IKFlag.refined)).reshape(*batch, B),
        complete=False,
    )


@lru_cache(maxsize=64)
def _neighbour(description: Description) -> Solver:
    """Return the closed form of an arm's neighbour."""
    neighbour = classify(description).neighbour
    if neighbour is None:
        raise ValueError(
            f"{description.name} is {classify(description).words}; expected an arm that nearly has a closed form"
        )
    return solver_for(description, *neighbour)


def _refined_branches(
    description: Description, solver: Solver, poses: Array, free: Array
) -> tuple[Array, NDArray[np.uint8]]:
    """Return the arm's solutions in the order of the neighbour's branches, shape (N, B, n), and their flags (N, B).

    Branches that lead to no solution are NaN.
    """
    starts, flags = _starts(description, solver, poses, free)
    goals = np.repeat(orthonormal(poses).reshape(-1, 1, 16), starts.shape[1], axis=1)
    has_start = ~np.isnan(starts).any(axis=-1)
    q = np.full(starts.shape, np.nan)
    q[has_start] = _refined(description, starts[has_start], goals[has_start])

    # Newton's method may end at the solution of another branch, or nowhere: such starts are followed in small steps.
    # Of starts that still end at one solution the nearest keeps it.
    lost = has_start & (np.isnan(q).any(axis=-1) | _are_twins(description, starts, q))
    q[lost] = _followed(description, starts[lost], goals[lost])
    q[_are_twins(description, starts, q)] = np.nan
    return q, flags


def _refined(description: Description, starts: Array, goals: Array) -> Array:
    """Return the solutions of poses (K, 16) that Newton's method finds from starts (K, n); NaN where it finds none."""
    ends, closed = refined(description, starts, goals)
    return np.where(closed[:, None], ends, np.nan)


def _followed(description: Description, starts: Array, goals: Array) -> Array:
    """Return solutions of poses (K, 16), shape (K, n), by following a path of poses from those of the starts (K, n).

    Each start is an exact solution of its own pose. Near a singularity, where two solutions are close to each other,
    small steps stay with one of them. NaN where no solution is found. With poses (R, p), from start 0 to goal g, the
    path of s in [0, 1] is a straight line and a rotation about a fixed axis, by the rotation vector phi:

        p(s) = p_0 + s (p_g - p_0),    R(s) = exp(s [phi]) R_0,    exp([phi]) = R_g R_0^T.
    """
    if not len(starts):
        return starts
    newton = Newton.of(description, position_only=False, limits=False)
    T_start = world_to_tool(description, starts)
    T_goal = goals.reshape(-1, 4, 4)
    displacement = T_goal[:, :3, 3] - T_start[:, :3, 3]
    phi = Rotation.from_matrix(
        T_goal[:, :3, :3] @ np.swapaxes(T_start[:, :3, :3], 1, 2)
    ).as_rotvec()

    q = starts
    for s in np.arange(1, _PATH_STEPS) / _PATH_STEPS:
        T = T_start.copy()
        T[:, :3, 3] += s * displacement
        T[:, :3, :3] = Rotation.from_rotvec(s * phi).as_matrix() @ T[:, :3, :3]
        with np.errstate(all="ignore"):
            q, _ = newton.descend(T.reshape(-1, 16), q, _PATH_ERROR)
    return _refined(description, q, goals)


def _starts(
    description: Description, solver: Solver, poses: Array, free: Array
) -> tuple[Array, NDArray[np.uint8]]:
    """Return the neighbour's solutions (N, B, n) at poses (N, 4, 4), or at displaced ones if it has none, and flags."""
    exact = solve_in_closed_form(description, solver, poses, free)
    q = exact.q
    flags = exact.flags

    # The first displaced pose at which a branch has a solution gives its start.
    lacking = np.flatnonzero(~exact.valid.all(axis=1))
    for displaced in _displaced(description, poses[lacking]):
        near = solve_in_closed_form(description, solver, displaced, free[:, lacking])
        is_missing = np.isnan(q[lacking]).any(axis=-1)
        new = near.valid & is_missing
        row, branch = np.nonzero(new)
        q[lacking[row], branch] = near.q[new]
        flags[lacking[row], branch] = near.flags[new]
    return q, flags


def _displaced(description: Description, poses: Array) -> Iterator[Array]:
    """Yield poses (N, 4, 4) moved along each axis of the world, to both sides, and turned about each axis."""
    size = _MISSES * _largest_miss(description)
    directions = (*np.eye(3), *-np.eye(3))
    for direction in directions:
        moved = poses.copy()
        moved[:, :3, 3] += size * Axes.of(description).scale * direction
        yield moved
    for direction in directions:
        turned = poses.copy()
        turned[:, :3, :3] = Rotation.from_rotvec(size * direction).as_matrix() @ poses[:, :3, :3]
        yield turned


@lru_cache(maxsize=64)
def _largest_miss(description: Description) -> float:
    """Return the largest miss of the neighbour's solutions at random poses: share of the reach, and rad."""
    solver = _neighbour(description)
    span = np.where(description.numbers.prismatic, Axes.of(description).scale, np.pi)
    states = np.random.default_rng(0).uniform(-span, span, (_SAMPLES, description.n))
    T = world_to_tool(description, states)
    found = solve_in_closed_form(description, solver, T, np.zeros((2, _SAMPLES)))

    goals = np.broadcast_to(T[:, None], (*found.valid.shape, 4, 4))[found.valid]
    newton = Newton.of(description, position_only=False, limits=False)
    misses = newton.error(found.q[found.valid], goals.reshape(-1, 16))
    return float(np.abs(misses).max(initial=0.0))


def _are_twins(description: Description, starts: Array, q: Array) -> NDArray[np.bool_]:
    """Return which solutions (N, B, n) another start reached that was nearer to them, shape (N, B).

    Branches whose starts coincide, at singularities of the neighbour, are not twins.
    """
    # Pairs of branches (i, j) of a pose, shape (N, B, B): one solution from two starts.
    together = _largest_difference(description, q[:, :, None], q[:, None]) < _SAME_ANGLE
    apart = _largest_difference(description, starts[:, :, None], starts[:, None]) > _SAME_ANGLE

    # Branch i moved farther than j from its start, or as far and comes later.
    moved = _largest_difference(description, q, starts)
    moved_i = moved[:, :, None]
    moved_j = moved[:, None]
    order = np.arange(q.shape[1])
    is_later = order[:, None] > order
    farther = (moved_i > moved_j) | ((moved_i == moved_j) & is_later)

    twins: NDArray[np.bool_] = (together & apart & farther).any(axis=2)
    return twins


def _largest_difference(description: Description, a: Array, b: Array) -> Array:
    """Return the largest difference of joint values (..., n): angles the short way round, lengths over the reach."""
    # |d - 2 pi round(d / (2 pi))| <= pi is an angle the short way round.
    difference = a - b
    prismatic = description.numbers.prismatic
    whole_turns = np.where(prismatic, 0.0, math.tau * np.rint(difference / math.tau))
    units = np.where(prismatic, Axes.of(description).scale, 1.0)
    size = np.abs(difference - whole_turns) / units
    largest: Array = size.max(axis=-1)
    return largest
