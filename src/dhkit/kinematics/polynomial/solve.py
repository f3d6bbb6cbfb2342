"""All solutions of poses of an arm of six revolute joints, from the real roots of its polynomial."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Description
from dhkit.kernels import Kernel
from dhkit.kinematics.numeric import refined

_CHUNK = 1_024
"""Poses that are solved together; their arrays take some 10 MB."""
CLOSES = 1e-13
"""Error of starts that need no iteration: share of the reach, and rad."""
_AT_ROOT = 1e-6
"""Error of joint values that belong to their root: share of the reach, and rad."""
INEXACT = 1e-6
"""Largest coefficient beyond degree 8, relative to the others, of a polynomial that is trusted."""
SAME_ANGLE = 1e-6
"""Angles that differ by less, rad, count as equal when solutions are sorted."""
SORTED_BY = 5
"""Number of joints by which solutions are sorted."""
SAME_SOLUTION = 1e-5
"""Solutions that differ by less, rad, are one: near singularities iterations end that far apart."""
_NUMBERED = 3
"""Number of joints that make the number by which solutions are sorted."""
_SPACING = 10.0
"""Distance of the numbers of two poses; those of one pose differ by up to 6."""
MOST = 16
"""Largest number of solutions of a pose, unless they are infinitely many."""


class Elimination(Protocol):
    """A way to eliminate all joints but one."""

    @property
    def kernels(self) -> Sequence[Kernel]:
        """The kernels that it uses."""

    def candidates(self, poses: Array) -> Candidates:
        """Return joint values at the roots of the polynomial of poses, shape (N, 16), m."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Joint values at the roots of the polynomials of N poses that are real or may be."""

    q: Array
    """Shape (L, 6), near solutions, rad, in (-pi, pi]."""
    error: Array
    """Their errors, shape (L,), shares of the reach and rad."""
    may_be_singular: NDArray[np.bool_]
    """Whether they have not been shown to be regular, shape (L,)."""
    owner: NDArray[np.intp]
    """The pose of each, shape (L,), in ascending order."""
    root: NDArray[np.intp]
    """The root of each, shape (L,): some roots have several solutions, which are together."""
    expected: NDArray[np.intp]
    """Number of real roots, shape (N,); see :class:`dhkit.kinematics.polynomial.trigonometric.Roots`."""
    may_repeat: NDArray[np.bool_]
    """Whether two roots are so near that one solution may be found from both, shape (N,)."""
    is_delicate: NDArray[np.bool_]
    """Whether a solution at one of two near roots may be singular, shape (N,)."""
    error_of_polynomial: Array
    """Largest coefficient beyond degree 8, relative to the others, shape (N,)."""


@dataclass(frozen=True, eq=False)
class Found:
    """Solutions of a batch of poses."""

    q: Array
    """Shape (K, 6), rad, those of a pose together."""
    owner: NDArray[np.intp]
    """Index of the pose of each, shape (K,), in ascending order."""
    may_be_singular: NDArray[np.bool_]
    """Whether they have not been shown to be regular, shape (K,)."""
    expected: NDArray[np.intp]
    """Number of real roots of each pose's polynomial, shape (N,); 1 if there are only some that are nearly real."""
    is_exact: NDArray[np.bool_]
    """Whether the polynomial is known well enough for that number, shape (N,)."""
    is_delicate: NDArray[np.bool_]
    """Whether a solution may be singular, shape (N,): two roots nearly coincide, or a solution is not at its root."""
    is_settled: NDArray[np.bool_]
    """Whether at least as many solutions as real roots were at their roots before iteration, or two eliminations found
    the same solutions, shape (N,)."""

    @property
    def is_complete(self) -> NDArray[np.bool_]:
        """Whether a pose has as many solutions as its polynomial has real roots, shape (N,).

        Their number is even and at most 16, for complex ones come in pairs: of an odd number one is missing, or two
        coincide. Where roots nearly coincide, their number is known if solutions are at them: rounding makes complex
        roots of some of four that coincide.
        """
        counts = self.counts
        is_possible = (counts % 2 == 0) & (counts <= MOST)
        is_counted = self.is_exact & (self.is_settled | ~self.is_delicate)
        complete: NDArray[np.bool_] = is_counted & (counts >= self.expected) & is_possible
        return complete

    @property
    def counts(self) -> NDArray[np.intp]:
        """Number of solutions of each pose, shape (N,)."""
        return np.bincount(self.owner, minlength=len(self.expected))


def sorting_key(angles: Sequence[Any]) -> Any:
    """Return q1 + SAME_ANGLE (q2 / 10 + q3 / 100 + ...), by which solutions are sorted.

    Parameters
    ----------
    angles
        The first ``SORTED_BY`` joints' angles, whole multiples of ``SAME_ANGLE``, rad: arrays or CasADi expressions.
    """
    first, *others = angles
    return first + SAME_ANGLE * sum(x * 0.1**k for k, x in enumerate(others, start=1))


def solve(
    description: Description, candidates: Callable[[Array], Candidates], poses: Array
) -> Found:
    """Return the solutions of poses.

    Parameters
    ----------
    description
        The robot.
    candidates
        Returns joint values at the roots of the polynomials of poses, as :meth:`Elimination.candidates`.
    poses
        Shape (N, 16), with orthonormal rotations, m.
    """
    return solve_parts(description, lambda some: candidates(poses[some]), poses)


def solve_parts(
    description: Description, candidates: Callable[[slice], Candidates], poses: Array
) -> Found:
    """Return the solutions of poses part by part.

    Parameters
    ----------
    description
        The robot.
    candidates
        Returns joint values at the roots of the polynomials of a part of the poses.
    poses
        Shape (N, 16), with orthonormal rotations, m.
    """
    q = [np.empty((0, 6))]
    owner = [np.empty(0, dtype=np.intp)]
    may_be_singular = [np.empty(0, dtype=bool)]
    expected = np.zeros(len(poses), dtype=np.intp)
    is_exact, is_delicate, is_settled = np.zeros((3, len(poses)), dtype=bool)
    for begin in range(0, len(poses), _CHUNK):
        some = slice(begin, begin + _CHUNK)
        with np.errstate(all="ignore"):
            near = candidates(some)
        found = _closed(description, near, poses[some])
        q.append(found.q)
        owner.append(found.owner + begin)
        may_be_singular.append(found.may_be_singular)
        expected[some] = found.expected
        is_exact[some] = found.is_exact
        is_delicate[some] = found.is_delicate
        is_settled[some] = found.is_settled
    return Found(
        np.concatenate(q),
        np.concatenate(owner),
        np.concatenate(may_be_singular),
        expected,
        is_exact,
        is_delicate,
        is_settled,
    )


def _closed(description: Description, found: Candidates, poses: Array) -> Found:
    """Return the solutions of a chunk of poses."""
    # False for errors that are no numbers, as are those of joint values that are none.
    closed = found.error <= CLOSES
    q = found.q
    may_be_singular = found.may_be_singular
    moved = np.flatnonzero(~closed)
    if len(moved):
        moved = moved[np.isfinite(q[moved]).all(axis=1)]
        q[moved], closed[moved] = refined(description, q[moved], poses[found.owner[moved]])
        may_be_singular[moved] = True

    # Solutions of a pose that come from roots apart differ in that joint, unless they moved far from their roots.
    is_moved = np.zeros(len(poses), dtype=bool)
    is_moved[found.owner[moved]] = True
    is_doubtful = found.may_repeat | is_moved
    kept = np.flatnonzero(closed)
    owner = found.owner[kept]
    root = found.root[kept]
    is_doubtful[owner[1:][root[1:] == root[:-1]]] = True
    rows = np.flatnonzero(is_doubtful[owner])
    if len(rows):
        is_one = np.ones(len(kept), dtype=bool)
        is_one[rows] = are_distinct(q[kept[rows]], owner[rows])
        kept = kept[is_one]
    owner = found.owner[kept]
    is_at_root = found.error[kept] < _AT_ROOT
    # What Newton's method moved may be singular as well.
    is_delicate = found.is_delicate | is_moved
    is_exact = found.error_of_polynomial < INEXACT
    is_settled = np.bincount(owner[is_at_root], minlength=len(poses)) >= found.expected
    return Found(
        q[kept],
        owner,
        may_be_singular[kept],
        found.expected,
        is_exact,
        is_delicate,
        is_settled,
    )


def are_distinct(q: Array, owner: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return which solutions (K, n), rad, to keep so that of equal ones of a pose one is left, shape (K,).

    Parameters
    ----------
    q
        Solutions in any order.
    owner
        The pose of each, shape (K,).
    """
    # Equal solutions of a pose have equal numbers, whole turns included, and so lie next to each other.
    number = np.cos(q[:, :_NUMBERED] + np.arange(_NUMBERED)).sum(axis=1) + _SPACING * owner
    order = np.argsort(number)
    in_order = q[order]
    number = number[order]
    is_new = np.ones(len(q), dtype=bool)
    for lag in range(1, len(q)):
        near = np.flatnonzero(number[lag:] - number[:-lag] < _NUMBERED * SAME_SOLUTION)
        if not len(near):
            break
        # |e^(ia) - e^(ib)| = 2 |sin((a - b) / 2)|, about |a - b|.
        apart = 2 * np.abs(np.sin((in_order[near + lag] - in_order[near]) / 2)).max(axis=1)
        is_new[order[near[apart <= SAME_SOLUTION] + lag]] = False
    return is_new


def distinct(q: Array, owner: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return indices of solutions (K, 6), rad, of poses (K,), without those that another one of the same pose equals.

    Of equal ones the first is left. Those of a pose are together, and poses in ascending order.
    """
    order = np.argsort(owner, kind="stable")
    rows: NDArray[np.intp] = order[are_distinct(q[order], owner[order])]
    return rows
