"""Inverse kinematics of six revolute joints without a closed form, by elimination, as solutions with a status."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import Array, Description
from dhkit.errors import ModelError
from dhkit.kernels import Kernel, pose_rows
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
from dhkit.kinematics.polynomial.pose_results import PoseProgram, output_sizes
from dhkit.kinematics.polynomial.six_joints import six_joints
from dhkit.kinematics.polynomial.solve import (
    INEXACT,
    SAME_ANGLE,
    SORTED_BY,
    are_distinct,
    sorting_key,
)
from dhkit.kinematics.polynomial.trigonometric import DOUBTFUL, NEAR_SOLUTION, NONE, ROOTS
from dhkit.kinematics.singular_values import has_small_singular_value
from dhkit.kinematics.solutions import IKFlag, IKSolutions, IKStatus

_TOGETHER = 256
"""Poses whose roots are held together, some 500 KB."""
_FURTHER_WAYS = 2
"""Number of further eliminations whose programs are tried before poses are solved with care."""
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
    first, *others = six_joints(description).ways
    # Interpreted, the program for single poses takes longer than what it saves. It is asked about a batch of no items,
    # which counts nothing towards compiling.
    if has_curves(description) or not first.pose_kernel.is_compiled_for(0):
        return _solved_with_care(description, poses)
    goals = poses.reshape(-1, 16)
    sure = _SurePoses.of(description, first, goals)
    rows = np.flatnonzero(sure.counts == 0)
    for way in others[:_FURTHER_WAYS]:
        # Where roots of one polynomial nearly coincide, those of another one lie apart.
        if len(rows) and way.pose_kernel.is_compiled_for(len(rows)):
            more = _SurePoses.of(description, way, goals[rows])
            sure.q[rows] = more.q
            sure.flags[rows] = more.flags
            sure.counts[rows] = more.counts
            rows = rows[more.counts == 0]
    if not len(rows):
        return sure.solutions(description)
    return sure.solutions(description, rows, _solved_with_care(description, poses[rows]))


@dataclass(frozen=True, eq=False)
class _SurePoses:
    """Solutions of those of N poses whose roots lie apart and give one solution each, as the program tells."""

    q: Array
    """Sorted solutions, shape (N, 16, 6), rad; where there are fewer, any numbers follow."""
    flags: NDArray[np.uint8]
    """Shape (N, 16), likewise."""
    counts: NDArray[np.intp]
    """Number of solutions, shape (N,); 0 of other poses."""

    @classmethod
    def of(cls, description: Description, arm: PoseProgram, poses: Array) -> _SurePoses:
        """Return the solutions of matrices, shape (N, 16)."""
        numbers = description.numbers
        parameters = np.concatenate([arm.parameters, numbers.lower, numbers.upper])
        q = np.empty((len(poses), ROOTS, description.n))
        flags = np.empty((len(poses), ROOTS), dtype=np.uint8)
        counts = np.empty(len(poses), dtype=np.intp)
        for begin in range(0, len(poses), _TOGETHER):
            some = slice(begin, begin + _TOGETHER)
            goals = poses[some]
            others = [np.empty((len(goals), size)) for size in output_sizes(arm.details)[1:]]
            arm.pose_kernel(parameters, [goals], [q[some].reshape(len(goals), -1), *others])
            flags[some], counts[some] = _flags_and_counts(others, q[some])
        return cls(q, flags, counts)

    def solutions(
        self,
        description: Description,
        rows: NDArray[np.intp] | None = None,
        others: IKSolutions | None = None,
    ) -> IKSolutions:
        """Return all solutions, with those of other poses in their rows (M,)."""
        B = max(1, int(self.counts.max(initial=0)), 0 if others is None else len(others.branches))
        valid = np.arange(B) < self.counts[:, None]
        q = _columns(self.q, valid, np.nan)
        flags = _columns(self.flags, valid, 0)
        status = np.full(len(q), IKStatus.ok, dtype=np.uint8)
        distance = np.zeros(len(q))
        complete = True
        if others is not None:
            of_others = slice(len(others.branches))
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


def _columns(table: NDArray[Any], is_kept: NDArray[np.bool_], filling: float) -> NDArray[Any]:
    """Return the entries (N, B, ...) of a table (N, K, ...) that are kept, shape (N, B), and a filling elsewhere."""
    columns = np.empty((*is_kept.shape, *table.shape[2:]), dtype=table.dtype)
    common = min(is_kept.shape[1], table.shape[1])
    columns[:, :common] = table[:, :common]
    columns[~is_kept] = filling
    return columns


def _flags_and_counts(outputs: list[Array], q: Array) -> tuple[NDArray[np.uint8], NDArray[np.intp]]:
    """Return the flags (N, 16) of roots with joint values (N, 16, 6), and the numbers of solutions, 0 if not sure."""
    kinds, are_outside = np.moveaxis(outputs[0].reshape(len(q), ROOTS, 2), -1, 0)
    posed = outputs[2][:, 0]
    error = outputs[3][:, 0]
    is_root = kinds != NONE
    counts: NDArray[np.intp] = np.count_nonzero(is_root, axis=1)
    # Complex roots come in pairs: an odd number is not all. False for NaN.
    is_sure = (posed == 1.0) & (error < INEXACT) & (counts % 2 == 0)
    is_sure &= ~(kinds == DOUBTFUL).any(axis=1)
    near = np.flatnonzero(is_sure & (kinds == NEAR_SOLUTION).any(axis=1))
    if len(near):
        owner, place = np.nonzero(is_root[near])
        is_one = are_distinct(q[near[owner], place], owner)
        is_sure[near[owner[~is_one]]] = False
    counts[~is_sure] = 0

    return np.where(are_outside == 1.0, _OUT_OF_LIMITS, np.uint8(0)), counts


def _solved_with_care(description: Description, poses: Array) -> IKSolutions:
    """Return the solutions of matrices (N, 4, 4); roots may nearly coincide, or not be known well."""
    posed = are_poses(poses)
    goals = orthonormal(poses[posed])
    found = six_joints(description)(goals.reshape(-1, 16))

    rows = np.flatnonzero(posed)
    table = ordered(found.q, rows[found.owner], posed.size)
    B = table.shape[1]
    flags, is_nearly_curve = _singular_flags(description, table)
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


def _singular_flags(
    description: Description, q: Array
) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Return the flags of singular solutions (N, B, n), shape (N, B), and which poses are nearly curves, (N,).

    Near a curve of solutions, iteration closes at points beside it: two of them or more are nearly exactly singular.
    """
    flags = np.zeros(q.shape[:2], dtype=np.uint8)
    is_asked = ~np.isnan(q).any(axis=-1)
    J = jacobian(description, q[is_asked])
    # Without units: velocities over the reach.
    J[:, :3] /= Axes.of(description).scale
    is_singular = has_small_singular_value(J, SINGULAR)
    flags[is_asked] = np.where(is_singular, np.uint8(IKFlag.singular), np.uint8(0))
    is_exactly = np.zeros(q.shape[:2], dtype=bool)
    is_exactly[flags > 0] = has_small_singular_value(J[is_singular], _EXACTLY)
    is_nearly_curve = np.count_nonzero(is_exactly, axis=1) > 1
    return flags, is_nearly_curve


def _have_clusters(q: Array, flags: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return which poses have singular solutions that lie near each other, shape (N,), of tables (N, B, 6) and (N, B).

    Where many roots coincide, Newton's method closes at false solutions near the true one.
    """
    is_singular = flags & np.uint8(IKFlag.singular) > 0
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


def ordered(q: Array, owner: NDArray[np.intp], poses: int) -> Array:
    """Return solutions (K, n) as a table, shape (poses, B, n), those of a pose sorted, and filled up with NaN.

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
    place = np.arange(len(q)) - np.repeat(np.cumsum(counts) - counts, counts)
    shape = (poses, max(1, int(counts.max(initial=0))))
    keys = np.full(shape, np.inf)
    keys[owner, place] = by_joints
    table = np.full((*shape, q.shape[1]), np.nan)
    table[owner, place] = q
    return np.take_along_axis(table, np.argsort(keys, axis=1)[..., None], axis=1)
