"""Which joints hold and which break away: a complementarity problem with bounds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array

PATIENCE = 10
"""Rounds without fewer violations after which one index at a time is exchanged, which cannot go in a circle."""


def bounded_forces(A: Array, b: Array, lower: Array, upper: Array) -> tuple[Array, NDArray[np.int8]]:
    """Return the resisting torques f of joints at rest, and which of their bounds each is at.

    The accelerations are w = b - A f. A joint holds (w = 0) while its torque is between the bounds; it breaks away
    forwards (w >= 0) against its upper bound, backwards (w <= 0) against its lower one. With A positive definite there
    is exactly one solution (Cottle, Pang and Stone 2009, The Linear Complementarity Problem, theorem 3.3.7). It is
    found by block principal pivoting (Judice and Pires 1994, A block principal pivoting algorithm for large-scale
    strictly monotone linear complementarity problems), with Murty's least-index rule as its fallback.

    Parameters
    ----------
    A
        The block of the inverse mass matrix, shape (m, m), positive definite.
    b
        Accelerations without resistance, shape (m,).
    lower, upper
        Bounds of the torques, shape (m,), lower <= upper; infinite at a stop.

    Returns
    -------
    tuple[Array, NDArray[np.int8]]
        f, shape (m,); and 0 where a joint holds, 1 at the upper bound, -1 at the lower one, shape (m,).
    """
    side = np.zeros(len(b), dtype=np.int8)
    fewest, patience = len(b) + 1, PATIENCE
    while True:
        held = side == 0
        f = np.where(side > 0, upper, np.where(side < 0, lower, 0.0))
        if held.any():
            f[held] = np.linalg.solve(A[np.ix_(held, held)], b[held] - A[np.ix_(held, ~held)] @ f[~held])
        w = b - A @ f
        # Where each joint belongs if it is wrong: over a bound, or moving against its direction.
        wanted = np.where(held, (f > upper).astype(np.int8) - (f < lower), np.where(side * w < 0, 0, side))
        wrong = np.flatnonzero(wanted != side)
        if not len(wrong):
            return f, side
        if len(wrong) < fewest:
            fewest, patience = len(wrong), PATIENCE
        else:
            patience -= 1
        changed = wrong if patience > 0 else wrong[-1:]
        side[changed] = wanted[changed]
