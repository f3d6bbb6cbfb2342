"""Inverse kinematics of six revolute joints without a closed form, by elimination, as solutions with a status."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import Array, Description
from dhkit.errors import ModelError
from dhkit.kernels import Kernel, pose_rows
from dhkit.kernels.large_arrays import large_array
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.candidates import (
    are_poses,
    collect,
    is_beyond_all_links,
    orthonormal,
)
from dhkit.kinematics.closed_form import classify
from dhkit.kinematics.closed_form.family import ALL_COORDINATES
from dhkit.kinematics.closed_form.formulas import SINGULAR
from dhkit.kinematics.jacobian import jacobian, jacobian_kernel
from dhkit.kinematics.manipulability import freedoms
from dhkit.kinematics.newton import Newton, descent_kernel
from dhkit.kinematics.polynomial.pose_results import OUTPUT_SIZES, PoseProgram, PoseResults
from dhkit.kinematics.polynomial.root_kinds import ROOTS
from dhkit.kinematics.polynomial.six_joints import six_joints
from dhkit.kinematics.polynomial.solve import (
    SAME_ANGLE,
    SORTED_BY,
    are_distinct,
    sorting_key,
)
from dhkit.kinematics.singular_values import has_small_singular_value
from dhkit.kinematics.solutions import IKFlag, IKSolutions, IKStatus

_TOGETHER = 512
"""Poses whose roots are held together, some 700 KB."""
_SINGULAR = np.uint8(IKFlag.singular)
_OF_UNSURE = (0, 2, 4)
"""Outputs of a program that are kept of poses of which it is not sure: joint values, details of the roots, the error of
the polynomial."""
_OUT_OF_LIMITS = np.uint8(IKFlag.out_of_limits)
_MOST_NUMBERS = 4_000_000
"""Largest number of distances that are held at a time, 32 MB."""
_EXACTLY = 1e-7
"""Smallest singular value of a solution that is singular to rounding."""
_CLUSTER = 0.05
"""Distance of singular solutions, rad, below which some of them may be false."""


def solve_by_elimination(description: Description, T: ArrayLike) -> IKSolutions:
    """Return the solutions of T_world_tool(q) = T of an arm of six revolute joints, from the roots of a polynomial.

    See :mod:`dhkit.kinematics.polynomial`. The first call for an arm of general geometry compares six ways of
    elimination, for a second or two.

    Parameters
    ----------
    description
        The robot; six revolute joints.
    T
        Poses of the tool in the world, shape (..., 4, 4).

    Returns
    -------
    IKSolutions
        Branches ``"solution 1"`` ... ``"solution B"``, B the largest number found for a pose of the batch and at least
        1. They are in ascending order of joint 1, and where it is equal of q2 + q3/10 + q4/100 + q5/1000: the same
        number at another pose need not be the same way to reach. Singular ones have the flag ``singular``. ``complete``
        tells whether each pose has as many solutions as its polynomial has real roots; it is False for arms that never
        move in all directions, whose solutions are curves. A pose that has none of either is ``out_of_reach``, other
        poses without a solution are ``not_found``. ``distance`` is NaN where nothing was found.

    Raises
    ------
    ModelError
        The arm has prismatic joints, or not six joints.
    ValueError, TypeError
        T has not shape (..., 4, 4), or is not numeric.
    """
    if description.numbers.prismatic.any() or description.n != 6:
        words = classify(description).words
        raise ModelError(f"{description.name} is {words}; ik_numeric solves any arm")
    poses = pose_rows(T)
    found = _solved(description, poses.reshape(-1, 4, 4))
    B = len(found.branches)
    return replace(
        found,
        q=found.q.reshape(*poses.shape[:-2], B, description.n),
        valid=found.valid.reshape(*poses.shape[:-2], B),
        flags=found.flags.reshape(*poses.shape[:-2], B),
        status_code=found.status_code.reshape(poses.shape[:-2]),
        distance=found.distance.reshape(poses.shape[:-2]),
    )


def _solved(description: Description, poses: Array) -> IKSolutions:
    """Return the solutions of matrices (N, 4, 4)."""
    first = six_joints(description).elimination
    # Interpreted, the program for single poses takes longer than what it saves. It is asked about a batch of no items,
    # which counts nothing towards compiling.
    if has_curves(description) or not first.pose_kernel.is_compiled_for(0):
        return _solved_with_care(description, poses)
    sure = _SurePoses.of(description, first, poses.reshape(-1, 16))
    rows = np.flatnonzero(sure.counts == 0)
    if not len(rows):
        return sure.solutions(description)
    others = _solved_with_care(description, poses[rows], sure.unsure)
    return sure.solutions(description, rows, others)


@dataclass(frozen=True, eq=False)
class _SurePoses:
    """Solutions of those of N poses whose roots lie apart and give one solution each, as the program tells."""

    q: Array
    """Sorted solutions, shape (N, 16, 6), rad; where there are fewer, NaN follows. Of other poses any numbers."""
    flags: NDArray[np.uint8]
    """Shape (N, 16), likewise, with 0 instead of NaN."""
    counts: NDArray[np.intp]
    """Number of solutions, shape (N,); 0 of other poses."""
    unsure: PoseResults
    """The roots of the other poses, in their order."""

    @classmethod
    def of(cls, description: Description, arm: PoseProgram, poses: Array) -> _SurePoses:
        """Return the solutions of matrices, shape (N, 16)."""
        numbers = description.numbers
        parameters = np.concatenate([arm.parameters, numbers.lower, numbers.upper])
        q = large_array((len(poses), ROOTS, description.n))
        flags = np.empty((len(poses), ROOTS), dtype=np.uint8)
        counts = np.empty(len(poses), dtype=np.intp)
        unsure = [tuple(np.empty((0, OUTPUT_SIZES[k])) for k in _OF_UNSURE)]
        for begin in range(0, len(poses), _TOGETHER):
            some = slice(begin, begin + _TOGETHER)
            own = q[some]
            outputs = [own.reshape(len(own), -1)]
            outputs += [np.empty((len(own), size)) for size in OUTPUT_SIZES[1:]]
            arm.pose_kernel(parameters, [poses[some]], outputs)
            flags[some], counts[some] = _flags_and_counts(outputs[1:], own)
            is_unsure = counts[some] == 0
            unsure.append(tuple(outputs[k][is_unsure] for k in _OF_UNSURE))
        all_unsure = map(np.concatenate, zip(*unsure, strict=True))
        return cls(q, flags, counts, PoseResults.read(*all_unsure))

    def solutions(
        self,
        description: Description,
        rows: NDArray[np.intp] | None = None,
        others: IKSolutions | None = None,
    ) -> IKSolutions:
        """Return all solutions, with those of other poses in their rows (M,)."""
        B = max(1, int(self.counts.max(initial=0)), 0 if others is None else len(others.branches))
        valid = np.arange(B) < self.counts[:, None]
        # Of 16 branches they are the program's own array, which is not copied.
        q = self.q if B == ROOTS else large_array((len(valid), B, description.n))
        flags = np.zeros(valid.shape, dtype=np.uint8)
        common = slice(min(B, ROOTS))
        if B != ROOTS:
            q[:, common] = self.q[:, common]
            q[:, ROOTS:] = np.nan
        flags[:, common] = self.flags[:, common]
        status = np.full(len(q), IKStatus.ok, dtype=np.uint8)
        distance = np.zeros(len(q))
        complete = True
        if others is not None:
            of_others = slice(len(others.branches))
            q[rows] = np.nan
            flags[rows] = 0
            q[rows, of_others] = others.q
            flags[rows, of_others] = others.flags
            valid[rows, of_others] = others.valid
            status[rows] = others.status_code
            distance[rows] = others.distance
            complete = others.complete
        return IKSolutions(
            q=q,
            valid=valid,
            flags=flags,
            status_code=status,
            distance=distance,
            branches=branch_names(B),
            met=ALL_COORDINATES,
            description=description,
            complete=complete,
        )


def _flags_and_counts(outputs: list[Array], q: Array) -> tuple[NDArray[np.uint8], NDArray[np.intp]]:
    """Return the flags (N, 16) of roots with joint values (N, 16, 6), and the numbers of solutions, 0 if not sure."""
    are_outside, _, verdict, _ = outputs
    # NaN, of matrices that are not finite, is not above 0.
    known = np.where(verdict[:, 0] > 0.0, verdict[:, 0], 0.0)
    counts = known.astype(np.intp)
    near = np.flatnonzero(known != counts)
    if len(near):
        owner, place = np.nonzero(np.arange(ROOTS) < counts[near, None])
        is_one = are_distinct(q[near[owner], place], owner)
        counts[near[owner[~is_one]]] = 0
    return (are_outside == 1.0).view(np.uint8) * _OUT_OF_LIMITS, counts


def _solved_with_care(
    description: Description, poses: Array, results: PoseResults | None = None
) -> IKSolutions:
    """Return the solutions of matrices (N, 4, 4); roots may nearly coincide, or not be known well.

    Parameters
    ----------
    description
        The robot.
    poses
        The matrices.
    results
        What the program of the first elimination found at them, if it has run.
    """
    posed = are_poses(poses)
    goals = orthonormal(poses[posed])
    known = None if results is None else results.at(posed)
    found = six_joints(description)(goals.reshape(-1, 16), known)

    rows = np.flatnonzero(posed)
    places = ordered(found.q, rows[found.owner], posed.size)
    B = places.shape[1]
    is_singular, is_exactly = _are_singular(description, found.q, found.may_be_singular)
    # Near a curve of solutions, iteration closes at points beside it: some of them are nearly exactly singular.
    is_nearly_curve = np.bincount(rows[found.owner[is_exactly]], minlength=posed.size) > 1
    table = np.vstack([found.q, np.full(description.n, np.nan)])[places]
    flags = np.append(np.where(is_singular, _SINGULAR, np.uint8(0)), np.uint8(0))[places]
    are_false = is_nearly_curve | _have_clusters(table, flags)
    is_known = found.is_complete & ~are_false[rows]
    none_exist = np.zeros(posed.size, dtype=bool)
    if not has_curves(description):
        none_exist[rows] = is_known & (found.counts == 0)
    if not is_known.all():
        # The polynomial of a pose far beyond all links is not well known, but it has no solution.
        is_known |= is_beyond_all_links(description, goals[:, :3, 3])
    return collect(
        description,
        table,
        np.full(posed.shape, np.nan),
        positions=poses[..., :3, 3],
        posed=posed,
        branches=branch_names(B),
        met=ALL_COORDINATES,
        flags=flags,
        complete=bool(is_known.all()) and not has_curves(description),
        none_exist=none_exist,
    )


def branch_names(count: int) -> tuple[str, ...]:
    """Return the names of so many solutions."""
    return tuple(f"solution {k + 1}" for k in range(count))


def elimination_kernels(description: Description) -> list[Kernel]:
    """Return the kernels that :func:`solve_by_elimination` uses for an arm of six revolute joints.

    Parameters
    ----------
    description
        The robot.
    """
    newton = Newton.of(description, position_only=False, limits=False)
    descent, _ = descent_kernel(description, newton.size)
    of_jacobian, _ = jacobian_kernel(description, "world")
    return [*six_joints(description).elimination.kernels, descent, of_jacobian]


def _are_singular(
    description: Description, q: Array, may_be: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which solutions are singular, and which exactly, shape (K,) each.

    Parameters
    ----------
    description
        The robot.
    q
        Solutions, shape (K, n), rad.
    may_be
        Those that have not been shown to be regular, shape (K,).
    """
    is_singular, is_exactly = np.zeros((2, len(q)), dtype=bool)
    J = jacobian(description, q[may_be])
    # Without units: velocities over the reach.
    J[:, :3] /= Axes.of(description).scale
    is_singular[may_be] = are_small = has_small_singular_value(J, SINGULAR)
    is_exactly[is_singular] = has_small_singular_value(J[are_small], _EXACTLY)
    return is_singular, is_exactly


def _have_clusters(q: Array, flags: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return which poses have singular solutions that lie near each other, shape (N,), of tables (N, B, 6) and (N, B).

    Where many roots coincide, Newton's method closes at false solutions near the true one.
    """
    is_singular = flags == _SINGULAR
    have = np.zeros(len(q), dtype=bool)
    every = np.flatnonzero(np.count_nonzero(is_singular, axis=1) > 1)
    # Each pose has a distance for any two of its solutions, of which there may be hundreds near a curve of them.
    together = max(1, _MOST_NUMBERS // (q.shape[1] ** 2 * q.shape[2]))
    for begin in range(0, len(every), together):
        rows = every[begin : begin + together]
        singular = np.where(is_singular[rows, :, None], q[rows], np.nan)
        apart = 2 * np.abs(np.sin((singular[:, :, None] - singular[:, None]) / 2)).max(axis=-1)
        apart[:, np.arange(q.shape[1]), np.arange(q.shape[1])] = np.nan
        # Comparisons with NaN are false.
        have[rows] = (apart < _CLUSTER).any(axis=(1, 2))
    return have


@lru_cache(maxsize=64)
def has_curves(description: Description) -> bool:
    """Return whether the arm never moves its tool in as many directions as it has joints, so that joints are redundant.

    Parameters
    ----------
    description
        The robot.
    """
    return freedoms(description, "whole") < description.n


def ordered(q: Array, owner: NDArray[np.intp], poses: int) -> NDArray[np.intp]:
    """Return the places of solutions (K, n) in a table of poses, shape (poses, B), those of a pose sorted, then K.

    Parameters
    ----------
    q
        Solutions, those of a pose together, and poses in ascending order; rad and m.
    owner
        The pose of each, shape (K,).
    poses
        Number of poses.
    """
    counts = np.bincount(owner, minlength=poses)
    # Angles are rounded, and those of further joints count where joint 1 is equal: both flips of a spherical wrist
    # share joints 1 to 3. Angles at -pi are those at pi.
    some = q[:, :SORTED_BY]
    around = np.where(some < SAME_ANGLE - np.pi, some + 2 * np.pi, some)
    by_joints = sorting_key([*(np.rint(around.T / SAME_ANGLE) * SAME_ANGLE)])
    column = np.arange(len(q)) - np.repeat(np.cumsum(counts) - counts, counts)
    shape = (poses, max(1, int(counts.max(initial=0))))
    places = np.full(shape, len(q))
    # By pose, then by the key.
    places[owner, column] = np.lexsort((by_joints, owner))
    return places
