"""How far two paths' dynamics are apart: differences over the size of what is compared, state by state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dhkit.description import Array, Description

TOLERANCE = 1e-12
"""Of every quantity of dynamics: some thousand roundings."""


def relative_error(ours: Array, reference: Array, floor: Array | float = 0.0) -> Array:
    """Return, of each state, the largest difference over the reference's largest entry or the floor.

    Parameters
    ----------
    ours, reference
        Shape (N, ...): a quantity at N states.
    floor
        Shape (N,) or a number: what differences are compared with where the reference itself is small, so that noise
        around 0 is no error.

    Returns
    -------
    Array
        Shape (N,); 0 where nothing differs, NaN where one of both is NaN.

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
    """What the quantities of dynamics are measured by at least, each of shape (N,), for N states."""

    g: Array
    """sum(m) |gravity| reach, N m; of V too."""
    C: Array
    """max|M| max|qd|."""
    h: Array
    """max|M| max|qd|^2, of C qd and of K."""
    bias: Array
    """Those of g and h."""
    tau: Array
    """Those of g and h, and max|M| max|qdd|."""
    qdd: Array
    """max|tau| / min diag M."""
    Y: float
    """|gravity|, m/s^2: what a kilogram weighs, of which nothing may be left in a joint's direction."""

    @classmethod
    def of(cls, description: Description, M: Array, qd: Array, qdd: Array, tau: Array) -> Floors:
        """Return those of states with mass matrices (N, n, n), rates, accelerations and torques (N, n)."""
        numbers = description.numbers
        weight = float(np.sum(numbers.mass) * np.linalg.norm(numbers.gravity)) * max(1.0, description.reach)
        inertia, rate = _largest(M), _largest(qd)
        g = np.full(len(M), weight)
        C, h = inertia * rate, inertia * rate**2
        with np.errstate(all="ignore"):
            fastest = _largest(tau) / np.min(np.diagonal(M, axis1=-2, axis2=-1), axis=-1)
        falling = float(np.linalg.norm(numbers.gravity))
        return cls(g, C, h, g + h, g + h + inertia * _largest(qdd), fastest, falling)


def forward_tolerance(M: Array) -> Array:
    """Return how far accelerations may be apart, shape (N,): 1e-12, or 4 eps cond M where M is worse than that."""
    tolerance: Array = np.maximum(TOLERANCE, 4 * np.finfo(float).eps * np.linalg.cond(M))
    return tolerance


def _largest(x: Array) -> Array:
    largest: Array = np.max(np.abs(x.reshape(len(x), -1)), axis=1, initial=0.0)
    return largest
