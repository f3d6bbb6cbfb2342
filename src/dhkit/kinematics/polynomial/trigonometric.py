"""Real roots of trigonometric polynomials of degree 8 from their values, for batches.

With z = e^(i theta), such a polynomial is f(theta) = sum c_k z^k for k from -8 to 8, and c_-k is the conjugate of c_k.
Times z^8 it is an ordinary polynomial of degree 16: its roots on the unit circle are the real roots of f, the others
lie in pairs z and 1 / conj(z).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array
from dhkit.kernels import Kernel, kernel
from dhkit.kinematics.polynomial.root_kinds import DEGREE, ROOTS, SAMPLES

if TYPE_CHECKING:
    from dhkit.symbolic import Pipeline

_WELL_KNOWN = 1e-12
"""Error of the coefficients above which every root that is nearly real counts as one; usually it is some 1e-15."""
_NO_PARAMETERS = np.zeros(1)


def angles() -> Array:
    """Return the angles at which values are taken, shape (SAMPLES,), rad, less the first one."""
    return np.asarray(2 * np.pi / SAMPLES * np.arange(SAMPLES))


@dataclass(frozen=True, eq=False)
class Roots:
    """Roots of N polynomials that are real or may be."""

    owner: NDArray[np.intp]
    """Index of the polynomial of each root, shape (K,), in ascending order."""
    angle: Array
    """The root's real part, shape (K,), rad."""
    expected: NDArray[np.intp]
    """Number of roots of each polynomial that are real up to their errors, shape (N,); at least 1 if some are nearly
    real, and all that are nearly real if the polynomial is not well known."""
    is_delicate: NDArray[np.bool_]
    """Whether two roots of a polynomial nearly coincide, or have the same real part, shape (N,)."""
    error: Array
    """Largest coefficient beyond degree 8 of each polynomial, relative to the others, shape (N,); NaN or infinite where
    the values are not finite, or are all 0."""


def real_roots(values: Array, first: float) -> Roots:
    """Return the real roots of polynomials, and those that are nearly real.

    Parameters
    ----------
    values
        Values at equally spaced angles, shape (N, SAMPLES).
    first
        The first angle, rad.
    """
    count = len(values)
    angle, is_tried, is_real, closeness = (np.empty((count, ROOTS)) for _ in range(4))
    error = np.empty((count, 1))
    run = roots_kernel()
    inputs = [np.ascontiguousarray(values), np.full((count, 1), first)]
    run(_NO_PARAMETERS, inputs, [angle, is_tried, is_real, closeness, error])

    # NaN, where values are not finite, is no root.
    is_near = is_tried > 0.0
    owner, _ = np.nonzero(is_near)
    expected = expected_roots(is_near, is_real > 0.0, error)
    is_delicate = np.asarray((closeness > 0.0).any(axis=1))
    return Roots(owner, angle[is_near], expected, is_delicate, error[:, 0])


def expected_roots(
    is_near: NDArray[np.bool_], is_real: NDArray[np.bool_], error: Array
) -> NDArray[np.intp]:
    """Return the number of roots of each polynomial that have a solution, shape (N,); see :class:`Roots`.

    Parameters
    ----------
    is_near, is_real
        Whether a root is nearly real, and whether it is real up to its error or may be, shape (N, K) each.
    error
        Of the polynomials, shape (N, 1), as of :class:`Roots`.
    """
    # Near poses at several singularities the coefficients cancel, and roots that are real may look complex. Some are
    # not nearly real, but too uncertain to be told complex.
    is_counted = is_real | (is_near & (error > _WELL_KNOWN))
    counts = np.count_nonzero(is_counted, axis=1)
    return np.asarray(np.maximum(counts, is_near.any(axis=1)))


def roots_kernel() -> Kernel:
    """Return the kernel of :func:`dhkit.kinematics.polynomial.root_steps.roots_program`."""

    def derived() -> Pipeline:
        from dhkit.kinematics.polynomial.root_steps import roots_program

        return roots_program()

    pattern = f"{DEGREE} {SAMPLES}"
    return kernel("trigonometric_roots", pattern, derived, ("float64",) * 5)
