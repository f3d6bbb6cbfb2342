"""What a program for one pose finds, for batches; see :mod:`dhkit.kinematics.polynomial.pose_steps`."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.kernels import Kernel
from dhkit.kinematics.polynomial.solve import Candidates
from dhkit.kinematics.polynomial.trigonometric import ROOTS, expected_roots

COMMON_DETAILS = 5
"""Number of details of a root that all programs give."""


class PoseProgram(Protocol):
    """An elimination as a program for one pose."""

    @property
    def pose_kernel(self) -> Kernel:
        """The program, whose outputs have the sizes of :func:`output_sizes`."""

    @property
    def parameters(self) -> Array:
        """Its parameters but for the limits, which follow."""

    @property
    def details(self) -> int:
        """Number of details of a root."""

    def candidates_of(self, results: PoseResults, poses: Array) -> Candidates:
        """Return joint values at the roots that the program found at poses, shape (N, 16), m."""


def output_sizes(details: int) -> tuple[int, ...]:
    """Return the numbers of entries of a program's outputs, with a number of details of a root."""
    return (6 * ROOTS, ROOTS, details * ROOTS, 1, 1)


@dataclass(frozen=True, eq=False)
class PoseResults:
    """Roots of N poses."""

    q: Array
    """Joint values at the roots, shape (N, 16, 6), rad."""
    is_near: NDArray[np.bool_]
    is_real: NDArray[np.bool_]
    is_beside: NDArray[np.bool_]
    is_delicate: NDArray[np.bool_]
    """Whether a root is nearly real, real, near to another, and may have a singular solution, shape (N, 16) each."""
    error: Array
    """Of the joint values, shape (N, 16), shares of the reach and rad."""
    angle: Array
    """The root itself, shape (N, 16), rad."""
    more: Array
    """Further details, shape (N, 16, K)."""
    error_of_polynomial: Array
    """Shape (N, 1)."""

    @classmethod
    def of(cls, program: PoseProgram, poses: Array) -> PoseResults:
        """Return the results of poses, shape (N, 16), m; limits do not matter."""
        parameters = np.concatenate([program.parameters, np.full(6, -np.inf), np.full(6, np.inf)])
        outputs = [np.empty((len(poses), size)) for size in output_sizes(program.details)]
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
        details = of_roots.reshape(len(q), ROOTS, of_roots.shape[1] // ROOTS)
        return cls(
            q.reshape(len(q), ROOTS, 6),
            details[:, :, 0] > 0.0,
            details[:, :, 1] > 0.0,
            details[:, :, 2] > 0.0,
            details[:, :, 2] > 1.0,
            details[:, :, 3],
            details[:, :, 4],
            details[:, :, COMMON_DETAILS:],
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
            np.asarray(self.is_beside.any(axis=1)),
            np.asarray(self.is_delicate.any(axis=1)),
            self.error_of_polynomial[:, 0],
        )


def with_more(found: Candidates, q: Array, error: Array, root: NDArray[np.intp]) -> Candidates:
    """Return candidates with others (K, 6), rad, at roots (K,) that have several solutions."""
    roots = np.concatenate([found.root, root])
    order = np.argsort(roots, kind="stable")
    return Candidates(
        np.concatenate([found.q, q])[order],
        np.concatenate([found.error, error])[order],
        np.concatenate([found.may_be_singular, np.ones(len(q), dtype=bool)])[order],
        found.owner[roots[order]],
        roots[order],
        found.expected,
        found.may_repeat,
        found.is_delicate,
        found.error_of_polynomial,
    )
