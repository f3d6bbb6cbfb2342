"""Inverse kinematics of a batch of poses: in closed form, or as the arm's classification says otherwise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, joint_array, takes_robot
from dhkit.errors import ModelError
from dhkit.kernels import check_whole, pose_rows
from dhkit.kinematics.closed_form import classify
from dhkit.kinematics.eliminated import solve_by_elimination
from dhkit.kinematics.preference import Preference
from dhkit.kinematics.redundant import JOINTS, solve_redundant
from dhkit.kinematics.solutions import IKSolutions, IKStatus
from dhkit.kinematics.solver import free_angles, solve_in_closed_form, solver_of

_BOUNDARY_SHARE = 1e-4
"""Distance beyond the workspace, as a share of the reach, of poses that an arm near a family may still reach."""
_CHUNK = 16_384
"""Poses per chunk: with eight branches 6 MB of joint positions, which fit into the processor's cache."""


@takes_robot
def inverse_kinematics(
    description: Description,
    T: ArrayLike,
    seed: ArrayLike | None = None,
    out: Array | None = None,
    threads: int = 1,
    redundancy: ArrayLike | None = None,
    prefer: Preference | None = None,
) -> IKSolutions:
    """Return all solutions of T_world_tool(q) = T in closed form.

    An arm whose axes are nearly those of a family, to 1e-3, is solved by Newton's method from the solutions of the
    exact member of the family: see :mod:`dhkit.kinematics.neighbour`. For other arms of six revolute joints all joints
    but one are eliminated: see :func:`dhkit.kinematics.eliminated.solve_by_elimination`. Arms of seven revolute joints
    have infinitely many solutions: those with a given joint 7 are returned.

    Parameters
    ----------
    description
        The robot.
    T
        Poses of the tool in the world, shape (..., 4, 4).
    seed
        Joint positions, shape (n,) or (..., n), rad and m. Where two axes of the wrist coincide, one joint is free (q4,
        or q6 of an arm with three parallel axes), and where the point that joint 1 turns is on its axis, joint 1 is:
        a free joint takes its angle from the seed, or 0. An arm of seven joints takes its redundancy from it.
    out
        Array for the joint positions, shape (..., B, n), float64, contiguous. Only for closed forms.
    threads
        Number of threads for a large batch. Only for closed forms.
    redundancy
        Redundancy of an arm of seven joints, shape () or (...), rad: joint position 7 or the arm angle. Without it and
        without a seed, values from the middle outward are tried until one has a solution inside all limits.
    prefer
        What the redundancy of an arm of seven joints is chosen for: ``"limits"``, distance from the limits;
        ``"manipulability"``; or joint positions (7,) to be near to. See
        :func:`dhkit.kinematics.redundant.solve_redundant`.

    Returns
    -------
    IKSolutions
        B branches: of a closed form the same for every pose, in a fixed order. The status tells poses that are out of
        reach, or that are not a pose.

    Raises
    ------
    ModelError
        No closed form is known for this arm, and it has prismatic joints or not six or seven; says how its axes lie and
        what to use.
    ValueError, TypeError
        T has not shape (..., 4, 4); ``seed``, ``out``, ``redundancy`` or ``prefer`` does not fit.

    Examples
    --------
    >>> from dhkit.description import library_robot, world_to_tool
    >>> arm = library_robot("puma560")
    >>> T = world_to_tool(arm, [0.1, 0.4, -0.8, 0.3, 0.5, 0.2])
    >>> solutions = inverse_kinematics(arm, T)
    >>> solutions.q.shape, int(solutions.valid.sum())
    ((8, 6), 8)
    >>> solutions.nearest([0, 0, 0, 0, 0, 0]).round(3)
    array([ 0.1,  0.4, -0.8,  0.3,  0.5,  0.2])
    """
    check_whole("threads", threads, 1)
    poses = pose_rows(T)
    solver = solver_of(description)
    if description.n != JOINTS:
        for name, value in (("redundancy", redundancy), ("prefer", prefer)):
            if value is not None:
                raise ValueError(
                    f"{name} is given, but {description.name} has {description.n} joints; expected 7"
                )
    if solver is None:
        return _solved_otherwise(description, poses, seed, out, threads, redundancy, prefer)
    batch = poses.shape[:-2]
    free = free_angles(description, solver.fit, seed, batch)
    found = solve_in_closed_form(description, solver, poses, free, out, threads)
    return (
        found
        if classify(description).neighbour is None
        else _with_poses_at_the_boundary(description, found, poses)
    )


def _with_poses_at_the_boundary(
    description: Description, found: IKSolutions, poses: Array
) -> IKSolutions:
    """Return solutions of an arm that misses its family by at most 1e-12, near the boundary of the workspace too.

    There the miss counts by its square root: a pose that the arm reaches stretched may be 1e-6 of the reach beyond what
    the family's member reaches. Such poses are solved by Newton's method from that member's solutions.
    """
    from dhkit.kinematics.neighbour import solve_from_neighbour  # with SciPy's rotations, 60 ms

    least = _BOUNDARY_SHARE * max(description.reach, 1e-300)
    is_near = (found.status_code == IKStatus.out_of_reach) & (found.distance <= least)
    rows = np.flatnonzero(is_near.ravel())
    if not len(rows):
        return found
    refined = solve_from_neighbour(description, poses.reshape(-1, 4, 4)[rows])
    B = len(found.branches)
    q = found.q.reshape(-1, B, description.n)
    valid = found.valid.reshape(-1, B)
    flags = found.flags.reshape(-1, B)
    status = found.status_code.ravel()
    distance = found.distance.ravel()
    q[rows] = refined.q[:, :B]
    valid[rows] = refined.valid[:, :B]
    flags[rows] = refined.flags[:, :B]
    # What iteration finds beside the branches takes the place of the first.
    by_iteration = np.flatnonzero(refined.valid[:, B] & ~refined.valid[:, :B].any(axis=1))
    for each, others in ((q, refined.q), (valid, refined.valid), (flags, refined.flags)):
        each[rows[by_iteration], 0] = others[by_iteration, B]
    reached = valid[rows].any(axis=1)
    status[rows] = np.where(reached, IKStatus.singular, IKStatus.not_found)
    distance[rows] = np.where(reached, 0.0, distance[rows])
    return replace(
        found,
        q=q.reshape(found.q.shape),
        valid=valid.reshape(found.valid.shape),
        flags=flags.reshape(found.flags.shape),
        status_code=status.reshape(found.status_code.shape),
        distance=distance.reshape(found.distance.shape),
    )


@takes_robot
def inverse_kinematics_in_chunks(
    description: Description,
    T: ArrayLike,
    size: int = _CHUNK,
    seed: ArrayLike | None = None,
    threads: int = 1,
    redundancy: ArrayLike | None = None,
) -> Iterator[tuple[slice, IKSolutions]]:
    """Return an iterator over the solutions of many poses, ``size`` at a time, without memory for all of them.

    A million poses of an arm with eight branches have 384 MB of joint positions. Page faults for new memory take up to
    ten times as long as solving; chunks reuse their memory.

    Parameters
    ----------
    description
        The robot; one whose inverse kinematics have a closed form, of seven joints at a given redundancy.
    T
        Poses of the tool in the world, shape (N, 4, 4).
    size
        Number of poses per chunk.
    seed, threads
        As for :func:`inverse_kinematics`; ``seed`` of shape (n,) or (N, n).
    redundancy
        As for :func:`inverse_kinematics`, shape () or (N,), rad.

    Returns
    -------
    Iterator[tuple[slice, IKSolutions]]
        The slice of the poses, and their solutions. The next chunk overwrites the joint positions: copy what you keep.

    Raises
    ------
    ModelError, ValueError, TypeError
        As for :func:`inverse_kinematics`; ``size`` is below 1.

    Examples
    --------
    >>> import numpy as np
    >>> from dhkit.description import library_robot, world_to_tool
    >>> arm = library_robot("puma560")
    >>> T = world_to_tool(arm, np.random.default_rng(0).uniform(-1, 1, (1000, 6)))
    >>> sum(int(found.valid.any(axis=-1).sum()) for rows, found in inverse_kinematics_in_chunks(arm, T, 300))
    1000
    """
    check_whole("size", size, 1)
    poses = pose_rows(T)
    if poses.ndim != 3:
        raise ValueError(f"T has shape {poses.shape}; expected (N, 4, 4)")
    starts = None if seed is None else joint_array(description, seed, "seed")
    if starts is not None and starts.shape not in ((description.n,), (len(poses), description.n)):
        raise ValueError(
            f"seed has shape {starts.shape}; expected {(description.n,)} or {(len(poses), description.n)}"
        )
    found = classify(description)
    fit = found.fit if found.redundant is None else found.redundant[1]
    if fit is None:
        raise ModelError(
            f"{description.name} is {found.words}: how many branches there will be is open; use arm.ik"
        )
    q = np.empty((min(size, len(poses)), len(fit.branches), description.n))
    values = None if redundancy is None else np.asarray(redundancy)
    if values is not None and values.shape not in ((), (len(poses),)):
        raise ValueError(f"redundancy has shape {values.shape}; expected () or ({len(poses)},)")

    def solve(begin: int) -> tuple[slice, IKSolutions]:
        rows = slice(begin, min(begin + size, len(poses)))
        near = starts if starts is None or starts.ndim == 1 else starts[rows]
        at = values if values is None or not values.ndim else values[rows]
        return rows, inverse_kinematics(
            description, poses[rows], near, q[: rows.stop - rows.start], threads, at
        )

    return map(solve, range(0, len(poses), size))


def _solved_otherwise(
    description: Description,
    T: Array,
    seed: ArrayLike | None,
    out: Array | None,
    threads: int,
    redundancy: ArrayLike | None,
    prefer: Preference | None,
) -> IKSolutions:
    """Return the solutions of an arm without a closed form for six joints."""
    found = classify(description)
    if found.redundant is not None:
        return solve_redundant(description, T, seed, redundancy, threads, prefer, out)
    if out is not None:
        raise ValueError(
            f"out is given, but {description.name} is {found.words}: how many branches there will be is open"
        )
    if found.neighbour is not None:
        from dhkit.kinematics.neighbour import solve_from_neighbour  # with SciPy's rotations, 60 ms

        return solve_from_neighbour(description, T, seed)
    if description.n == JOINTS:
        return solve_redundant(description, T, seed, redundancy, threads, prefer)
    if seed is not None:
        _check_seed(description, seed, T.shape[:-2])
    return solve_by_elimination(description, T)


def _check_seed(description: Description, seed: ArrayLike, batch: tuple[int, ...]) -> None:
    """Raise ValueError or TypeError unless there is a seed for every pose, though elimination has no use for it."""
    shape = joint_array(description, seed, "seed").shape
    expected = (*batch, description.n)
    if shape not in ((description.n,), expected):
        raise ValueError(f"seed has shape {shape}; expected ({description.n},) or {expected}")
