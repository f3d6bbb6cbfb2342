"""Trigonometric polynomials of degree 8 from their values, and their real roots, for batches.

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

if TYPE_CHECKING:
    from dhkit.symbolic import Graph

DEGREE = 8
SAMPLES = 20
"""Number of values. 17 would do; the other coefficients then tell how exactly the values are a polynomial's."""
_MOST_STEPS = 60
"""Largest number of Aberth's steps; most poses take 8 to 12."""
_CONVERGED = 1e-9
"""Estimates whose last steps are below this share of their absolute value are roots: steps shrink by their cubes."""
_NEARLY_REAL = 3e-2
"""Largest imaginary part, rad, of a root that is tried: rounding of 1e-15 in the coefficients moves a root of
multiplicity k by its k-th root, 0.013 for k = 8. Whether a solution is there is decided by what follows."""
_ERROR_OF_VALUE = 1e-11
"""Assumed error of a polynomial near a root, relative to its largest coefficient. The error itself is some 1e-14; the
four roots of a pose at two singularities, which it moves by 1e-3, are held to be real with this margin only."""


def angles() -> Array:
    """Return the angles at which values are taken, shape (SAMPLES,), rad, less the first one."""
    return np.asarray(2 * np.pi / SAMPLES * np.arange(SAMPLES))


def coefficients(values: Array) -> tuple[NDArray[np.complex128], Array]:
    """Return the coefficients of trigonometric polynomials.

    Parameters
    ----------
    values
        Values at equally spaced angles, shape (N, SAMPLES).

    Returns
    -------
    tuple[NDArray[np.complex128], Array]
        c_0 to c_8, shape (N, 9), the largest of absolute value 1; and the largest of c_9 and c_10, which are 0 but for
        rounding, shape (N,), infinite for values that are all 0.
    """
    c = np.fft.rfft(values, axis=1) / SAMPLES
    largest = np.abs(c[:, : DEGREE + 1]).max(axis=1, initial=0.0)
    c /= np.where(largest > 0, largest, 1.0)[:, None]
    beyond = np.abs(c[:, DEGREE + 1 :]).max(axis=1)
    return c[:, : DEGREE + 1], np.where(largest > 0, beyond, np.inf)


@dataclass(frozen=True, eq=False)
class Roots:
    """Roots of polynomials that are real or may be."""

    owner: NDArray[np.intp]
    """Index of the polynomial of each root, shape (K,), in ascending order."""
    angle: Array
    """The root's real part, shape (K,), rad, in (-pi, pi]."""
    height: Array
    """The root's imaginary part without its sign, shape (K,), rad."""
    is_real: NDArray[np.bool_]
    """Whether the root is real up to its error, shape (K,)."""


def real_roots(c: NDArray[np.complex128], beyond: Array) -> Roots:
    """Return the real roots of polynomials, and those that are nearly real.

    Parameters
    ----------
    c
        Coefficients c_0 to c_8, shape (N, 9).
    beyond
        Error of the coefficients, shape (N,).
    """
    all_roots = _roots(c)
    square = all_roots.real**2 + all_roots.imag**2
    near = (square > np.exp(-2 * _NEARLY_REAL)) & (square < np.exp(2 * _NEARLY_REAL))
    owner, _ = np.nonzero(near)
    z = all_roots[near]
    # z = e^(i (angle + i height)).
    height = np.abs(np.log(square[near])) / 2

    # f' = sum i k (c_k z^k - conj(c_k) z^-k): an error of f moves a root by that error over f'.
    k = np.arange(1, DEGREE + 1)
    powers = _powers(z)
    inverse_powers = _powers(1.0 / z)
    of_owner = c[owner, 1:]
    slope = np.abs((of_owner * powers - of_owner.conj() * inverse_powers) @ k)
    error = np.maximum(_ERROR_OF_VALUE, beyond[owner])
    return Roots(owner, np.angle(z), height, height * slope < error)


def _powers(z: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return z, z^2, ..., z^8 of numbers (K,), shape (K, 8)."""
    repeated = np.broadcast_to(z, (DEGREE, len(z)))
    powers: NDArray[np.complex128] = np.multiply.accumulate(repeated, axis=0).T
    return powers


def _roots(c: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the roots z of sum c_k z^k, shape (N, 16), by Aberth's method (Aberth 1973, Math. Comp. 27)."""
    numbers = np.concatenate([c.real, c.imag[:, 1:]], axis=1)
    # Neither on the circle nor in pairs, for steps would keep both.
    start = 0.9 * np.exp(1j * (0.4 + 2 * np.pi / (2 * DEGREE) * np.arange(2 * DEGREE)))
    z = np.tile(np.concatenate([start.real, start.imag]), (len(c), 1))

    active = np.flatnonzero(np.isfinite(numbers).all(axis=1))
    no_parameters = np.zeros(1)
    for _ in range(_MOST_STEPS):
        if not len(active):
            break
        after = np.empty((len(active), 4 * DEGREE))
        step = np.empty((len(active), 1))
        _aberth_kernel()(no_parameters, [numbers[active], z[active]], [after, step])
        z[active] = after
        active = active[~(step[:, 0] < _CONVERGED)]
    return z[:, : 2 * DEGREE] + 1j * z[:, 2 * DEGREE :]


def _aberth_kernel() -> Kernel:
    """Return the kernel of :func:`dhkit.kinematics.polynomial.aberth_program.aberth_program`."""

    def derived() -> Graph:
        from dhkit.kinematics.polynomial.aberth_program import aberth_program

        return aberth_program(DEGREE)

    return kernel("aberth", f"{DEGREE}", derived, ("float64", "float64"))
