"""Derivatives of inverse and forward dynamics with respect to the state, as optimizers and filters need them."""

from __future__ import annotations

from typing import NamedTuple

from numpy.typing import ArrayLike

from dhkit.description import Array, Description, takes_robot
from dhkit.display import repr_line
from dhkit.dynamics.programs import evaluate


def _parts(stacked: Array) -> tuple[Array, Array, Array]:
    """Return views of the three matrices of each state; plain indices of one state are the quickest."""
    if stacked.ndim == 3:
        return stacked[0], stacked[1], stacked[2]
    return stacked[..., 0, :, :], stacked[..., 1, :, :], stacked[..., 2, :, :]


class InverseDynamicsDerivatives(NamedTuple):
    """Derivatives of the torques; Pinocchio's ``dtau_dq``, ``dtau_dv`` and ``M`` of ``computeRNEADerivatives``."""

    dtau_dq: Array
    """Shape (..., n, n): entry i, j is the derivative of tau_i by q_j, N m and N per rad and m."""
    dtau_dqd: Array
    """Shape (..., n, n), N m s and N s per rad and m."""
    dtau_dqdd: Array
    """Shape (..., n, n): the mass matrix, kg m^2, kg m and kg."""

    @classmethod
    def of(cls, stacked: Array) -> InverseDynamicsDerivatives:
        """Return views of the three derivatives in one array, shape (..., 3, n, n), units as above."""
        return cls(*_parts(stacked))

    def __repr__(self) -> str:
        return _line(self)


class ForwardDynamicsDerivatives(NamedTuple):
    """Derivatives of accelerations; Pinocchio's ``ddq_dq``, ``ddq_dv`` and ``Minv`` of ``computeABADerivatives``."""

    dqdd_dq: Array
    """Shape (..., n, n): entry i, j is the derivative of qdd_i by q_j, 1/s^2 where both joints are of a kind."""
    dqdd_dqd: Array
    """Shape (..., n, n), 1/s where both joints are of a kind."""
    dqdd_dtau: Array
    """Shape (..., n, n): the inverse of the mass matrix, 1/(kg m^2), 1/(kg m) and 1/kg."""

    @classmethod
    def of(cls, stacked: Array) -> ForwardDynamicsDerivatives:
        """Return views of the three derivatives in one array, shape (..., 3, n, n), units as above."""
        return cls(*_parts(stacked))

    def __repr__(self) -> str:
        return _line(self)


def _line(derivatives: InverseDynamicsDerivatives | ForwardDynamicsDerivatives) -> str:
    shape = derivatives[0].shape
    return repr_line(
        type(derivatives).__name__, ", ".join(derivatives._fields), f"shape {shape} each"
    )


@takes_robot
def inverse_dynamics_derivatives(
    description: Description,
    q: ArrayLike,
    qd: ArrayLike,
    qdd: ArrayLike,
    out: Array | None = None,
    threads: int = 1,
) -> InverseDynamicsDerivatives:
    """Return the derivatives of the torques tau = M qdd + C qd + g with respect to q, qd and qdd.

    Parameters
    ----------
    description
        The robot, with a body on every link.
    q, qd, qdd
        Joint values, rates and accelerations, shapes (..., n), rad, m and seconds; batch axes broadcast.
    out
        Array that receives all three, shape (..., 3, n, n), float64, C-contiguous.
    threads
        Number of threads that share a large batch.

    Returns
    -------
    InverseDynamicsDerivatives
        ``dtau_dq``, ``dtau_dqd`` and ``dtau_dqdd``, shape (..., n, n) each, with the drives' inertia and without
        friction; views of one array (..., 3, n, n). NaN where an input is not finite.

    Raises
    ------
    DescriptionError
        A link without a body.
    ValueError, TypeError
        An argument of another shape, or not numeric; ``out`` does not fit.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> found = inverse_dynamics_derivatives(arm, [0.3, -0.5], [1.0, 0.2], [0.0, 0.0])
    >>> found.dtau_dq.shape
    (2, 2)
    """
    states = {"q": q, "qd": qd, "qdd": qdd}
    tail = (3, description.n, description.n)
    found = evaluate("inverse_dynamics_derivatives", description, states, tail, out, threads)
    return InverseDynamicsDerivatives.of(found)


@takes_robot
def forward_dynamics_derivatives(
    description: Description,
    q: ArrayLike,
    qd: ArrayLike,
    tau: ArrayLike,
    out: Array | None = None,
    threads: int = 1,
) -> ForwardDynamicsDerivatives:
    """Return the derivatives of the accelerations qdd = M^-1 (tau - C qd - g) with respect to q, qd and tau.

    Parameters
    ----------
    description
        The robot, with a body on every link.
    q, qd, tau
        Joint values, rates and torques, shapes (..., n), rad, m, seconds, N m and N; batch axes broadcast.
    out, threads
        As for :func:`inverse_dynamics_derivatives`.

    Returns
    -------
    ForwardDynamicsDerivatives
        ``dqdd_dq``, ``dqdd_dqd`` and ``dqdd_dtau``, shape (..., n, n) each, with the drives' inertia and without
        friction; views of one array (..., 3, n, n). NaN where an input is not finite or M is singular.

    Raises
    ------
    DescriptionError
        A link without a body.
    ValueError, TypeError
        An argument of another shape, or not numeric; ``out`` does not fit.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> found = forward_dynamics_derivatives(arm, [0.0, 0.0], [0.0, 0.0], [0.0, 0.0])
    >>> found.dqdd_dtau.round(3)
    array([[  3.84, -11.04],
           [-11.04,  44.24]])
    """
    states = {"q": q, "qd": qd, "tau": tau}
    tail = (3, description.n, description.n)
    found = evaluate("forward_dynamics_derivatives", description, states, tail, out, threads)
    return ForwardDynamicsDerivatives.of(found)
