"""Error measure for dynamics: differences relative to the size of a quantity, state by state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dhkit.description import Array, Description

TOLERANCE = 1e-12
"""Tolerance for every quantity of dynamics: some thousand roundings."""


def relative_error(ours: Array, reference: Array, floor: Array | float = 0.0) -> Array:
    """Return for each state the largest difference over the reference's largest entry or the floor.

    Parameters
    ----------
    ours, reference
        A quantity at N states, shape (N, ...).
    floor
        Smallest size that differences are divided by, shape (N,) or a number, so that noise around 0 is not an error.

    Returns
    -------
    Array
        Shape (N,); 0 where both are equal, NaN where one is NaN.

    Raises
    ------
    ValueError
        The shapes differ.
    """
    if ours.shape != reference.shape:
        raise ValueError(f"shapes {ours.shape} and {reference.shape}; expected equal ones")
    difference = _largest(ours - reference)
    size = np.maximum(_largest(reference), floor)
    with np.errstate(all="ignore"):
        return np.where(difference == 0, 0.0, difference / size)


@dataclass(frozen=True)
class Floors:
    """Smallest sizes of the quantities of dynamics that errors are relative to, shape (N,) each, for N states."""

    g: Array
    """sum(m) |gravity| reach, N m; for V too, J."""
    C: Array
    """max|M| max|qd|."""
    h: Array
    """max|M| max|qd|^2, for C qd and K."""
    bias: Array
    """Sum of those of g and h."""
    tau: Array
    """Sum of those of g and h, and max|M| max|qdd|."""
    qdd: Array
    """max|tau| / min diag M."""
    Y: float
    """|gravity|, m/s^2: the weight of a kilogram, whose component along a joint may be 0."""

    @classmethod
    def of(cls, description: Description, M: Array, qd: Array, qdd: Array, tau: Array) -> Floors:
        """Return the sizes for states with mass matrices (N, n, n), rates, accelerations and torques (N, n)."""
        numbers = description.numbers
        gravity = float(np.linalg.norm(numbers.gravity))
        weight_times_reach = float(np.sum(numbers.mass) * gravity) * max(1.0, description.reach)
        largest_M = _largest(M)
        largest_qd = _largest(qd)

        g = np.full(len(M), weight_times_reach)
        h = largest_M * largest_qd**2
        with np.errstate(all="ignore"):
            qdd_floor = _largest(tau) / np.min(np.diagonal(M, axis1=-2, axis2=-1), axis=-1)
        return cls(
            g=g,
            C=largest_M * largest_qd,
            h=h,
            bias=g + h,
            tau=g + h + largest_M * _largest(qdd),
            qdd=qdd_floor,
            Y=gravity,
        )


def forward_tolerance(M: Array) -> Array:
    """Return the tolerance for accelerations, shape (N,): 1e-12, or 4 eps cond(M) where that is larger."""
    tolerance: Array = np.maximum(TOLERANCE, 4 * np.finfo(float).eps * np.linalg.cond(M))
    return tolerance


def _largest(x: Array) -> Array:
    """Return the largest magnitude of an entry at each state, shape (N,), of x, shape (N, ...)."""
    largest: Array = np.max(np.abs(x.reshape(len(x), -1)), axis=1, initial=0.0)
    return largest
