"""The closed form of an arm's family as a kernel, with the arm's parameters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import Array, Description, joint_array
from dhkit.description.frames import configuration
from dhkit.kernels import EXACT_RANGE, Kernel, kernel, result_array
from dhkit.kinematics.closed_form import classify
from dhkit.kinematics.closed_form.family import OUTPUT_TYPES, Family, Fit, limit_parameters
from dhkit.kinematics.closed_form.nearest_wrist import nearest_wrist_distance
from dhkit.kinematics.solutions import IKSolutions
from dhkit.symbolic import Graph


@dataclass(frozen=True)
class Solver:
    """The kernel of an arm's closed form with the arm's parameters."""

    fit: Fit
    kernel: Kernel
    parameters: Array


@lru_cache(maxsize=512)
def solver_of(description: Description) -> Solver | None:
    """Return the solver of an arm's closed form; None if no closed form is known."""
    found = classify(description)
    if found.family is None or found.fit is None:
        return None
    return solver_for(description, found.family, found.fit)


def solver_for(description: Description, family: Family, fit: Fit) -> Solver:
    """Return the solver of a family's closed form with an arm's limits."""
    numbers = description.numbers
    prismatic = tuple(bool(slides) for slides in numbers.prismatic)
    limits = limit_parameters(numbers.lower, numbers.upper, prismatic)

    def derived() -> Graph:
        from dhkit.kinematics.closed_form.program import program

        return program(family, fit, prismatic)

    solver = kernel(f"ik_{family.name}", fit.structure, derived, OUTPUT_TYPES)
    return Solver(fit, solver, np.concatenate([fit.vector(), limits]))


def solve_in_closed_form(
    description: Description,
    solver: Solver,
    poses: Array,
    free: Array,
    out: Array | None = None,
    threads: int = 1,
) -> IKSolutions:
    """Return the solutions of a closed form.

    Parameters
    ----------
    description
        The robot.
    solver
        The closed form.
    poses
        Poses of the tool in the world, shape (..., 4, 4), m.
    free
        Angles of the joints that may be free, shape (2, ...), rad: see :func:`free_angles`; of seven joints those of
        joint 1, the redundancy, and joint 5, shape (3, ...).
    out, threads
        As for :func:`dhkit.kinematics.inverse_kinematics`.
    """
    fit = solver.fit
    batch = poses.shape[:-2]
    B = len(fit.branches)
    n = description.n
    q = result_array((*batch, B, n), out)
    if out is not None and np.may_share_memory(out, poses):
        poses = poses.copy()
    distance = np.empty(batch)
    valid, flags = np.empty((2, *batch, B), dtype=np.uint8)
    status = np.empty(batch, dtype=np.uint8)
    count = poses.size // 16
    later = None
    if count:
        rows = [
            q.reshape(count, B * n),
            distance.reshape(count, 1),
            valid.reshape(count, B),
            flags.reshape(count, B),
            status.reshape(count, 1),
        ]
        # Kernels read arrays without gaps; those that broadcasting made have none of their own.
        columns = (poses.reshape(count, 16), *free.reshape(len(free), count, 1))
        inputs = [np.ascontiguousarray(column) for column in columns]
        solver.kernel(solver.parameters, inputs, rows, threads)
        # A single call has no time to look for others.
        is_one_in_reach = count == 1 and distance.item() == 0.0
        if has_offset_wrist(fit) and not is_one_in_reach:
            beyond = np.flatnonzero(distance.reshape(count) > 0)
            if beyond.size:
                of_beyond = poses.reshape(count, 4, 4)[beyond]
                later = partial(_corrected, fit, distance, beyond, of_beyond)
    solutions = IKSolutions(
        q=q,
        valid=valid.view(np.bool_),
        flags=flags,
        status_code=status,
        distance=distance,
        branches=fit.branches,
        met=fit.coordinates,
        description=description,
    )
    return solutions if later is None else solutions.with_later_distance(later)


def _corrected(fit: Fit, distance: Array, beyond: NDArray[np.intp], poses: Array) -> Array:
    """Return distances (...), m, with those of poses (K, 4, 4) that are out of reach, at the indices ``beyond``."""
    distance.reshape(-1)[beyond] = nearest_wrist_distance(fit, poses)
    return distance


def has_offset_wrist(fit: Fit) -> bool:
    """Whether a spherical wrist's plane has an offset: the kernel's distance, to the nearest point in it, is too large.

    Parameters
    ----------
    fit
        The arm as a member of its family.
    """
    return fit.wrist_distances is not None and bool(fit.parameters["offset"])


def free_angles(
    description: Description, fit: Fit, seed: ArrayLike | None, batch: tuple[int, ...]
) -> Array:
    """Return the angles that joint 1 and the wrist's free joint take where they are free, shape (2, ...), rad."""
    if seed is None:
        return np.zeros((2, *batch))
    start = configuration(description, seed, "seed") if isinstance(seed, str) else seed
    try:
        joints = joint_array(description, start, "seed")[..., [0, fit.free_joint or 0]]
        angles = np.broadcast_to(joints, (*batch, 2))
    except ValueError:
        raise ValueError(
            f"seed has shape {np.shape(seed)}; expected {(*batch, description.n)}"
        ) from None
    angles = np.where(np.abs(angles) <= EXACT_RANGE, angles, 0.0)
    return np.ascontiguousarray(np.moveaxis(angles, -1, 0))
