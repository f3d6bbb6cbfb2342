"""Inverse kinematics of six revolute joints: which elimination suits an arm, and all solutions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dhkit.cached_property import cached_property
from dhkit.description import Array, Description
from dhkit.description.poses import turned_about
from dhkit.kinematics.axes import Axes
from dhkit.kinematics.forward import forward_kinematics
from dhkit.kinematics.numeric import refined, solve_numerically
from dhkit.kinematics.polynomial.general import CompiledGeneral, General
from dhkit.kinematics.polynomial.pose_results import PoseResults, solve_from
from dhkit.kinematics.polynomial.solve import (
    MOST,
    Elimination,
    Found,
    distinct,
    solve,
)
from dhkit.kinematics.polynomial.two_parallel import TwoParallel

_TRIALS = 64
"""Number of random poses by which eliminations are compared."""
_FOUND = 1e-5
"""Largest difference, rad, of a solution from the joint values that made the pose."""
_MISSED_COUNTS = 4
"""Number of poses with an incomplete set of solutions that one missed solution counts as."""
_FURTHER_WAYS = 2
"""Number of further eliminations whose programs are tried before LAPACK."""
_MANY = 1e6
"""More than all failures of an elimination."""
_DISPLACEMENTS = (1e-4, 1e-3, 1e-2)
"""Sizes of displacements, rad and share of the reach: the roots at a double root's pose are then 1e-2 apart."""
_STARTS = 64
_MAX_ROUNDS = 8
"""Number of random starts in a round of iterations, and largest number of rounds."""
_CLOSES = 1e-11
"""Error to which a solution closes that iteration finds: share of the reach, and rad."""


@dataclass(frozen=True, eq=False)
class SixJoints:
    """The solver of an arm of six revolute joints."""

    description: Description

    @cached_property
    def two_parallel(self) -> TwoParallel | None:
        """The arm as one with parallel axes 2 and 3; None if it is not of that kind."""
        return TwoParallel.fit(Axes.of(self.description))

    @property
    def elimination(self) -> TwoParallel | CompiledGeneral:
        """The way in which joints are eliminated first."""
        return self.ways[0]

    @cached_property
    def ways(self) -> list[TwoParallel | CompiledGeneral]:
        """The ways to eliminate joints, the best one first; a later one takes the poses at which those before fail.

        Of those for any geometry the first finds most poses of random joint values, and most of them in full; the next
        one finds most of the others in full. They fail at different poses, for their polynomials are in other joints.
        """
        variants = General.of(self.description).variants()
        if self.two_parallel is not None:
            # Its polynomial is in joint 1; the roots of those in joint 2 lie elsewhere.
            return [self.two_parallel, *(CompiledGeneral(x) for x in variants if x.joint == 2)]
        q = np.random.default_rng(0).uniform(-np.pi, np.pi, (_TRIALS, 6))
        poses = forward_kinematics(self.description, q).reshape(-1, 16)
        failures = np.array([self._failures(variant, q, poses) for variant in variants])
        chosen: list[int] = []
        are_left = np.ones(_TRIALS, dtype=bool)
        while len(chosen) < len(variants):
            score = failures[:, are_left].sum(axis=1) + failures.sum(axis=1) / _MANY
            score[chosen] = np.inf
            chosen.append(int(np.argmin(score)))
            are_left &= failures[chosen[-1]] > 0
        return [CompiledGeneral(variants[k]) for k in chosen]

    def _failures(self, elimination: Elimination, q: Array, poses: Array) -> NDArray[np.intp]:
        """Return how badly an elimination fails at poses (N, 16) that were made of joint values (N, 6), shape (N,)."""
        found = solve(self.description, elimination.candidates, poses)
        apart = 2 * np.abs(np.sin((found.q - q[found.owner]) / 2)).max(axis=1)
        is_found = np.zeros(len(poses), dtype=bool)
        is_found[found.owner[apart < _FOUND]] = True
        return np.asarray(_MISSED_COUNTS * ~is_found + ~found.is_complete)

    def __call__(self, poses: Array, results: PoseResults | None = None) -> Found:
        """Return the solutions of poses, with orthonormal rotations.

        Poses with fewer solutions than real roots, because some roots nearly coincide, are solved once more by
        eliminating other joints, and by LAPACK, which finds two solutions at one root, then from the solutions of poses
        beside them, where the roots lie apart, and then by iteration from random starts.

        Parameters
        ----------
        poses
            Shape (N, 16), m.
        results
            What the program of :attr:`elimination` found at them; it runs unless that is given.
        """
        if results is None:
            found = solve(self.description, self.elimination.candidates, poses)
        else:
            found = solve_from(self.description, self.elimination, results, poses)
        rows = np.flatnonzero(~found.is_complete)
        known = [self.elimination]
        for way in self.ways[1 : 1 + _FURTHER_WAYS]:
            if len(rows) and way.pose_kernel.is_compiled_for(len(rows)):
                others = solve(self.description, way.candidates, poses[rows])
                found = _with_more(found, rows, others, may_confirm=True)
                rows = rows[~found.is_complete[rows]]
                known.append(way)
        for way in self.ways:
            if len(rows) and isinstance(way, CompiledGeneral):
                others = solve(self.description, way.candidates_by_lapack, poses[rows])
                # At the roots that its program found, LAPACK does not find them once more.
                found = _with_more(found, rows, others, may_confirm=way not in known)
                rows = rows[~found.is_complete[rows]]
        if len(rows):
            found = _with(found, rows, *self._from_beside(poses[rows]))
            rows = rows[~found.is_complete[rows]]
        if len(rows):
            found = _with(found, rows, *self._iterated(poses[rows], found, rows))
        return found

    def _from_beside(self, poses: Array) -> tuple[Array, NDArray[np.intp]]:
        """Return solutions (K, 6) of poses (M, 16) by Newton's method from those of displaced poses, and their poses.

        To both sides, for of two solutions that nearly coincide there is perhaps none at one side.
        """
        displaced = _displaced(poses, Axes.of(self.description).scale)
        beside = solve(self.description, self.elimination.candidates, displaced.reshape(-1, 16))
        owner = beside.owner % len(poses)
        ends, closed = refined(self.description, beside.q, poses[owner])
        return ends[closed], owner[closed]

    def _iterated(
        self, poses: Array, known: Found, rows: NDArray[np.intp]
    ) -> tuple[Array, NDArray[np.intp]]:
        """Return what iterations from random starts find, until a round of them finds nothing new.

        Parameters
        ----------
        poses
            Shape (M, 16), m.
        known, rows
            Solutions that are known, and the indices of the poses there, shape (M,).
        """
        place = np.full(len(known.expected), -1)
        place[rows] = np.arange(len(rows))
        is_asked = place[known.owner] >= 0
        q = known.q[is_asked]
        owner = place[known.owner[is_asked]]

        rng = np.random.default_rng(0)
        waiting = np.arange(len(rows))
        for _ in range(_MAX_ROUNDS):
            of_start = np.repeat(waiting, _STARTS)
            starts = rng.uniform(-np.pi, np.pi, (len(of_start), q.shape[1]))
            goals = poses[of_start].reshape(-1, 4, 4)
            found = solve_numerically(
                self.description, goals, starts, restarts=0, tolerance=_CLOSES, limits=False
            )
            reached = found.valid[:, 0]
            before = np.bincount(owner, minlength=len(rows))
            q = np.concatenate([q, found.q[reached, 0]])
            owner = np.concatenate([owner, of_start[reached]])
            kept = distinct(q, owner)
            q = q[kept]
            owner = owner[kept]
            # More than 16 are points of a curve of solutions.
            counts = np.bincount(owner, minlength=len(rows))[waiting]
            waiting = waiting[(counts > before[waiting]) & (counts <= MOST)]
            if not len(waiting):
                break
        return q, owner


def _displaced(poses: Array, length: float) -> Array:
    """Return poses (N, 16) moved and turned a little, by random amounts, each to both sides, shape (K, N, 16)."""
    rng = np.random.default_rng(0)
    displaced = []
    for size in _DISPLACEMENTS:
        phi = size * rng.uniform(-1.0, 1.0, 3)
        angle = float(np.linalg.norm(phi))
        shift = size * length * rng.uniform(-1.0, 1.0, 3)
        for sign in (1.0, -1.0):
            T = poses.reshape(-1, 4, 4).copy()
            T[:, :3, :3] = turned_about(phi / angle, np.array(sign * angle)) @ T[:, :3, :3]
            T[:, :3, 3] += sign * shift
            displaced.append(T.reshape(-1, 16))
    return np.array(displaced)


@lru_cache(maxsize=64)
def six_joints(description: Description) -> SixJoints:
    """Return the solver of an arm of six revolute joints."""
    return SixJoints(description)


def has_two_parallel(description: Description) -> bool:
    """Return whether an arm is of the kind of :class:`TwoParallel`, whose elimination needs no comparison.

    Parameters
    ----------
    description
        The robot.
    """
    return description.kinds == "RRRRRR" and six_joints(description).two_parallel is not None


def _with(
    found: Found,
    rows: NDArray[np.intp],
    more: Array,
    owner: NDArray[np.intp],
    may_be_singular: NDArray[np.bool_] | bool = True,
) -> Found:
    """Return solutions with others added.

    Parameters
    ----------
    found
        The solutions.
    rows
        Indices of the poses to which others are added, shape (M,).
    more, owner, may_be_singular
        The others, shape (K, 6), rad, their poses as indices of ``rows``, and whether they have not been shown to be
        regular, shape (K,) each.
    """
    is_delicate = found.is_delicate.copy()
    is_delicate[rows] = True
    is_asked = np.zeros(len(found.expected), dtype=bool)
    is_asked[rows] = True
    changes = is_asked[found.owner]
    q = np.concatenate([found.q[changes], more])
    owners = np.concatenate([found.owner[changes], rows[owner]])
    may = np.broadcast_to(may_be_singular, len(more))
    may = np.concatenate([found.may_be_singular[changes], may])
    kept = distinct(q, owners)
    q = np.concatenate([found.q[~changes], q[kept]])
    owners = np.concatenate([found.owner[~changes], owners[kept]])
    may = np.concatenate([found.may_be_singular[~changes], may[kept]])
    order = np.argsort(owners, kind="stable")
    return replace(
        found,
        q=q[order],
        owner=owners[order],
        may_be_singular=may[order],
        expected=found.expected.copy(),
        is_exact=found.is_exact.copy(),
        is_delicate=is_delicate,
        is_settled=found.is_settled.copy(),
    )


def _with_more(found: Found, rows: NDArray[np.intp], others: Found, *, may_confirm: bool) -> Found:
    """Return what is found, with the solutions of another elimination added.

    Parameters
    ----------
    found
        The solutions.
    rows
        Indices of the poses that the other elimination solved, shape (M,).
    others
        What it found.
    may_confirm
        Whether it is not one of those that found the solutions.
    """
    before = found.counts[rows]
    merged = _with(found, rows, others.q, others.owner, others.may_be_singular)
    # No solution is without a root, so that the smaller number of real roots counts.
    are_exact = found.is_exact[rows] & others.is_exact
    least = np.minimum(found.expected[rows], others.expected)
    merged.expected[rows[are_exact]] = least[are_exact]
    # Where that one is complete, and its solutions lie at its roots, it knows their number.
    is_known = others.is_complete & others.is_settled
    merged.expected[rows[is_known]] = others.expected[is_known]
    merged.is_exact[rows[is_known]] = True
    # So do two eliminations whose roots nearly coincide, but which found the same solutions.
    counts = merged.counts[rows]
    is_same = (before == counts) & (others.counts == counts) & others.is_exact & may_confirm
    merged.is_settled[rows[is_known | is_same]] = True
    return merged
