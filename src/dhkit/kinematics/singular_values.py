"""Jacobians with a small singular value, found without computing the others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array

_MARGIN = 4.0
"""Factor of the bound of a determinant, for rounding."""


def has_small_singular_value(J: Array, bound: float) -> NDArray[np.bool_]:
    """Return whether the smallest of the m singular values of matrices is below a bound, shape (N,).

    With S = |J|_F^2, the sum of their squares, the product of the squares of the m - 1 others is at most
    (S / (m - 1))^(m - 1), so that

        smallest^2 >= det(J J^T) / (S / (m - 1))^(m - 1).

    Only where that does not show that it is above the bound, singular values are computed: it takes ten times as long.

    Parameters
    ----------
    J
        Shape (N, m, n), n >= m >= 2, finite.
    bound
        Positive.

    Examples
    --------
    >>> has_small_singular_value(np.array([np.diag([1.0, 1e-7]), np.eye(2)]), 1e-5).tolist()
    [True, False]
    """
    m = J.shape[1]
    S = np.sum(J * J, axis=(1, 2))
    determinant = np.linalg.det(J @ np.swapaxes(J, 1, 2))
    doubtful = determinant < _MARGIN * bound**2 * (S / (m - 1)) ** (m - 1)
    rows = np.flatnonzero(doubtful)
    small = np.zeros(len(J), dtype=bool)
    small[rows] = np.linalg.svd(J[rows], compute_uv=False)[:, m - 1] < bound
    return small
