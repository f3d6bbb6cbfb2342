"""All solutions of poses of an arm of six revolute joints, from the real roots of its polynomial."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Description
from dhkit.kinematics.newton import Newton, closes
from dhkit.kinematics.numeric import refined
from dhkit.kinematics.polynomial import trigonometric

_CHUNK = 1_024
"""Poses that are solved together; their arrays take some 10 MB."""
_CLOSES = 1e-14
"""Error of starts that need no iteration: share of the reach, and rad."""
_INEXACT = 1e-6
"""Largest coefficient beyond degree 8, relative to the others, of a polynomial that is trusted."""
_SAME_SOLUTION = 1e-5
"""Solutions that differ by less, rad, are one: near singularities iterations end that far apart."""
_NUMBERED = 3
"""Number of joints that make the number by which solutions are sorted."""
_SPACING = 10.0
"""Distance of the numbers of two poses; those of one pose differ by up to 6."""
MOST = 16
"""Largest number of solutions of a pose, unless they are infinitely many."""
_NEAR_ROOTS = 1e-3
"""Distance of two roots, rad, below which a solution may be singular."""


class Elimination(Protocol):
    """A way to eliminate all joints but one."""

    def first_angle(self, poses: Array) -> Array:
        """Return the first angle at which the polynomial is evaluated, shape (N,), for poses (N, 16)."""

    def values(self, poses: Array, angles: Array) -> Array:
        """Return values of the polynomial, shape (N, S), at angles (N, S)."""

    def starts(self, poses: Array, angles: Array) -> tuple[NDArray[np.intp], Array]:
        """Return indices of poses and joint values (L, 6) near solutions, for roots (K,) of poses (K, 16)."""


@dataclass(frozen=True, eq=False)
class Found:
    """Solutions of a batch of poses."""

    q: Array
    """Shape (K, 6), rad, those of a pose together."""
    owner: NDArray[np.intp]
    """Index of the pose of each, shape (K,), in ascending order."""
    expected: NDArray[np.intp]
    """Number of real roots of each pose's polynomial, shape (N,); 1 if there are only some that are nearly real."""
    is_exact: NDArray[np.bool_]
    """Whether the polynomial is known well enough for that number, shape (N,)."""
    is_delicate: NDArray[np.bool_]
    """Whether two roots of the polynomial nearly coincide, so that a solution may be singular, shape (N,)."""

    @property
    def is_complete(self) -> NDArray[np.bool_]:
        """Whether a pose has as many solutions as its polynomial has real roots, shape (N,).

        Their number is even and at most 16, for complex ones come in pairs: of an odd number one is missing, or two
        coincide.
        """
        counts = self.counts
        is_possible = (counts % 2 == 0) & (counts <= MOST)
        complete: NDArray[np.bool_] = self.is_exact & (counts >= self.expected) & is_possible
        return complete

    @property
    def counts(self) -> NDArray[np.intp]:
        """Number of solutions of each pose, shape (N,)."""
        return np.bincount(self.owner, minlength=len(self.expected))


def solve(description: Description, elimination: Elimination, poses: Array) -> Found:
    """Return the solutions of poses, shape (N, 16), with orthonormal rotations, m."""
    q = [np.empty((0, 6))]
    owner = [np.empty(0, dtype=np.intp)]
    expected = np.zeros(len(poses), dtype=np.intp)
    is_exact, is_delicate = np.zeros((2, len(poses)), dtype=bool)
    for begin in range(0, len(poses), _CHUNK):
        some = slice(begin, begin + _CHUNK)
        found = _solve(description, elimination, poses[some])
        q.append(found.q)
        owner.append(found.owner + begin)
        expected[some] = found.expected
        is_exact[some] = found.is_exact
        is_delicate[some] = found.is_delicate
    return Found(np.concatenate(q), np.concatenate(owner), expected, is_exact, is_delicate)


def _solve(description: Description, elimination: Elimination, poses: Array) -> Found:
    """Return the solutions of a chunk of poses."""
    with np.errstate(all="ignore"):
        first = elimination.first_angle(poses)
        values = elimination.values(poses, first[:, None] + trigonometric.angles())
        c, beyond = trigonometric.coefficients(values)
        roots = trigonometric.real_roots(c, beyond)
        goals = poses[roots.owner]
        of_root, starts = elimination.starts(goals, roots.angle + first[roots.owner])
    is_number = np.isfinite(starts).all(axis=1)
    of_root = of_root[is_number]
    q, closed = _polished(description, starts[is_number], goals[of_root])
    q, owner = distinct(q[closed], roots.owner[of_root[closed]])

    expected = np.bincount(roots.owner[roots.is_real], minlength=len(poses))
    expected[roots.owner] = np.maximum(expected[roots.owner], 1)
    is_delicate = np.zeros(len(poses), dtype=bool)
    is_delicate[_with_near_roots(roots)] = True
    return Found(q, owner, expected, beyond < _INEXACT, is_delicate)


def _with_near_roots(roots: trigonometric.Roots) -> NDArray[np.intp]:
    """Return the indices of polynomials of which two roots nearly coincide."""
    is_near = roots.height < _NEAR_ROOTS
    number = roots.angle[is_near] + _SPACING * roots.owner[is_near]
    order = np.argsort(number)
    owner = roots.owner[is_near][order]
    are_near = np.diff(number[order]) < _NEAR_ROOTS
    # The first and the last root of a polynomial may be near to each other through pi.
    ends = np.flatnonzero(np.diff(owner, prepend=-1, append=-1))
    begin = ends[:-1]
    last = ends[1:] - 1
    through_pi = number[order][last] - number[order][begin] > 2 * np.pi - _NEAR_ROOTS
    return np.concatenate([owner[1:][are_near], owner[begin][through_pi]])


def _polished(
    description: Description, starts: Array, goals: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the ends (K, 6) of Newton's method, and whether they close; starts that close already stay where they are.

    Angles are in (-pi, pi].
    """
    newton = Newton.of(description, position_only=False, limits=False)
    starts = starts - math.tau * np.ceil((starts - math.pi) / math.tau)
    with np.errstate(all="ignore"):
        closed = closes(newton.error(starts, goals), _CLOSES)
    rest = np.flatnonzero(~closed)
    starts[rest], closed[rest] = refined(description, starts[rest], goals[rest])
    return starts, closed


def distinct(q: Array, owner: NDArray[np.intp]) -> tuple[Array, NDArray[np.intp]]:
    """Return solutions (K, n), rad, without those that another one of the same pose equals, and their poses (K,).

    Poses are in ascending order, the solutions of each in no particular one.
    """
    # Equal solutions of a pose have equal numbers, whole turns included, and so lie next to each other.
    number = np.cos(q[:, :_NUMBERED] + np.arange(_NUMBERED)).sum(axis=1) + _SPACING * owner
    order = np.argsort(number)
    q = q[order]
    owner = owner[order]
    number = number[order]
    is_new = np.ones(len(q), dtype=bool)
    for lag in range(1, len(q)):
        near = np.flatnonzero(number[lag:] - number[:-lag] < _NUMBERED * _SAME_SOLUTION)
        if not len(near):
            break
        # |e^(ia) - e^(ib)| = 2 |sin((a - b) / 2)|, about |a - b|.
        apart = 2 * np.abs(np.sin((q[near + lag] - q[near]) / 2)).max(axis=1)
        is_new[near[apart <= _SAME_SOLUTION] + lag] = False
    return q[is_new], owner[is_new]
