"""What a program for one pose finds, for batches; see :mod:`dhkit.kinematics.polynomial.pose_steps`."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Description
from dhkit.kernels import Kernel
from dhkit.kinematics.polynomial.root_kinds import (
    IS_BESIDE,
    IS_DELICATE,
    IS_REAL,
    IS_TRIED,
    ROOTS,
)
from dhkit.kinematics.polynomial.solve import Candidates, Found, solve_parts
from dhkit.kinematics.polynomial.trigonometric import expected_roots

_DETAILS = 4
OUTPUT_SIZES = (6 * ROOTS, ROOTS, _DETAILS * ROOTS, 1, 1)
"""Numbers of entries of a program's outputs, which are :data:`dhkit.kinematics.polynomial.pose_steps.RESULTS`."""


class PoseProgram(Protocol):
    """An elimination as a program for one pose."""

    @property
    def pose_kernel(self) -> Kernel:
        """The program, whose outputs have the sizes of :data:`OUTPUT_SIZES`."""

    @property
    def parameters(self) -> Array:
        """Its parameters but for the limits, which follow."""

    def candidates_of(self, results: PoseResults, poses: Array) -> Candidates:
        """Return joint values at the roots that the program found at poses, shape (N, 16), m."""


@dataclass(frozen=True, eq=False)
class PoseResults:
    """Roots of N poses."""

    q: Array
    """Joint values at the roots, shape (N, 16, 6), rad."""
    is_near: NDArray[np.bool_]
    """Whether a root is nearly real, shape (N, 16)."""
    is_real: NDArray[np.bool_]
    """Whether it is real up to its error, shape (N, 16)."""
    may_repeat: NDArray[np.bool_]
    """Whether its solution may be that of another root, shape (N, 16)."""
    is_delicate: NDArray[np.bool_]
    """Whether its solution may be singular, or was not at the root, shape (N, 16)."""
    error: Array
    """Of the joint values, shape (N, 16), shares of the reach and rad."""
    angle: Array
    """The root itself, shape (N, 16), rad."""
    more: Array
    """The last detail, shape (N, 16)."""
    error_of_polynomial: Array
    """Shape (N, 1)."""

    @classmethod
    def of(cls, program: PoseProgram, poses: Array) -> PoseResults:
        """Return the results of poses, shape (N, 16), m; limits do not matter."""
        parameters = np.concatenate([program.parameters, np.full(6, -np.inf), np.full(6, np.inf)])
        outputs = [np.empty((len(poses), size)) for size in OUTPUT_SIZES]
        program.pose_kernel(parameters, [poses], outputs)
        q, _, of_roots, _, error_of_polynomial = outputs
        return cls.read(q, of_roots, error_of_polynomial)

    @classmethod
    def read(cls, q: Array, of_roots: Array, error_of_polynomial: Array) -> PoseResults:
        """Return the results of a program.

        Parameters
        ----------
        q, of_roots, error_of_polynomial
            Its outputs for N poses, shape (N, ...) each: joint values, rad, details of the roots, and the polynomial's
            error.
        """
        details = of_roots.reshape(len(q), ROOTS, _DETAILS)
        states, error, angle, more = np.moveaxis(details, -1, 0)
        # NaN, of matrices that are not finite, is 0.
        bits = np.where(states > 0.0, states, 0.0).astype(np.uint8)
        return cls(
            q.reshape(len(q), ROOTS, 6),
            bits & IS_TRIED > 0,
            bits & IS_REAL > 0,
            bits & (IS_BESIDE | IS_DELICATE) > 0,
            bits & IS_DELICATE > 0,
            error,
            angle,
            more,
            error_of_polynomial.reshape(len(q), 1),
        )

    def at(self, rows: slice | NDArray[Any]) -> PoseResults:
        """Return the results of some poses: a slice, indices, or which ones."""
        return PoseResults(*(getattr(self, field.name)[rows] for field in fields(self)))

    def candidates(self) -> Candidates:
        """Return the joint values at roots that are nearly real."""
        owner, place = np.nonzero(self.is_near)
        return Candidates(
            self.q[owner, place],
            self.error[owner, place],
            self.is_delicate[owner, place],
            owner,
            np.arange(len(owner)),
            expected_roots(self.is_near, self.is_real, self.error_of_polynomial),
            np.asarray(self.may_repeat.any(axis=1)),
            np.asarray(self.is_delicate.any(axis=1)),
            self.error_of_polynomial[:, 0],
        )


def solve_from(
    description: Description, program: PoseProgram, results: PoseResults, poses: Array
) -> Found:
    """Return the solutions of poses at which an elimination's program has run.

    Parameters
    ----------
    description
        The robot.
    program, results
        The elimination, and what it found.
    poses
        Shape (N, 16), with orthonormal rotations, m.
    """
    return solve_parts(
        description, lambda some: program.candidates_of(results.at(some), poses[some]), poses
    )


def with_more(
    found: Candidates,
    q: Array,
    error: Array,
    root: NDArray[np.intp],
    is_kept: NDArray[np.bool_] | None = None,
) -> Candidates:
    """Return candidates with others.

    Parameters
    ----------
    found
        One candidate for each root, shape (L,).
    q, error, root
        The others: joint values, shape (K, 6), rad, their errors, and indices of their roots, shape (K,) each.
    is_kept
        Which candidates are kept, shape (L,); all unless given.
    """
    kept = found.root if is_kept is None else found.root[is_kept]
    roots = np.concatenate([kept, root])
    order = np.argsort(roots, kind="stable")
    may_be_singular = np.ones(len(q), dtype=bool)
    return replace(
        found,
        q=np.concatenate([found.q[kept], q])[order],
        error=np.concatenate([found.error[kept], error])[order],
        may_be_singular=np.concatenate([found.may_be_singular[kept], may_be_singular])[order],
        owner=found.owner[roots[order]],
        root=roots[order],
    )
