"""Forward dynamics: the accelerations that torques cause."""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Description, joint_array, takes_robot
from dhkit.dynamics.equations import mass_matrix
from dhkit.dynamics.loads import external_torque
from dhkit.dynamics.programs import evaluate
from dhkit.errors import DescriptionError
from dhkit.symbolic import SINGULAR, Friction

log = logging.getLogger(__name__)

_SINGULAR_SAMPLES = 16
"""Number of random states at which a mass matrix must be singular to count as singular at every state."""


@takes_robot
def forward_dynamics(
    description: Description,
    q: ArrayLike,
    qd: ArrayLike,
    tau: ArrayLike,
    wrench: ArrayLike | None = None,
    friction: bool | Friction = False,
    out: Array | None = None,
    threads: int = 1,
) -> Array:
    """Return the joint accelerations that torques cause: M qdd = tau - C qd - g - friction + J^T wrench.

    Parameters
    ----------
    description
        The robot, with a body on every link.
    q, qd, tau
        Joint values, rates and torques, shapes (..., n), rad, m, seconds, N m and N; batch axes broadcast.
    wrench, friction, out, threads
        As for :func:`dhkit.dynamics.inverse_dynamics`.

    Returns
    -------
    Array
        Shape (..., n), rad/s^2 and m/s^2; NaN where an input is not finite, or M is singular at this state; the latter
        is logged as a warning.

    Raises
    ------
    DescriptionError
        A link without a body; joints that carry no inertia at any state.
    ValueError, TypeError
        An argument of another shape, or not numeric; ``out`` does not fit.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> arm = library_robot("planar2r")
    >>> forward_dynamics(arm, [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]).round(3)  # released from the horizontal
    array([-25.898,  37.67 ])
    """
    load = external_torque(description, q, qd, wrench, friction, threads)
    q = joint_array(description, q, "q")
    qd = joint_array(description, qd, "qd")
    tau = joint_array(description, tau, "tau")
    if out is not None and np.may_share_memory(out, q):
        # out= may overwrite q, which is needed below to explain an acceleration that is NaN.
        q = q.copy()
    # M qdd + h = tau + load
    total_torque = tau if load is None else tau + load
    states = {"q": q, "qd": qd, "tau": total_torque}
    qdd = evaluate("forward_dynamics", description, states, (description.n,), out, threads)

    # The sum finds a NaN in one pass; only then its cause is looked for.
    if qdd.size and not np.isfinite(qdd.sum()):
        _explain(description, q, qdd)
    return qdd


@takes_robot
def require_inertia(description: Description) -> None:
    """Check that an arm's mass matrix is regular at some state, and with couplings positive definite at all.

    Parameters
    ----------
    description
        The robot, with a body on every link.

    Raises
    ------
    DescriptionError
        A link without a body; joints that carry no inertia at any state, or couplings that are too large. The message
        names them, and a remedy.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> require_inertia(library_robot("planar2r"))
    """
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (_SINGULAR_SAMPLES, description.n))
    M = mass_matrix(description, q)

    if description.couplings:
        smallest_eigenvalue = np.linalg.eigvalsh(M)[:, 0]
        rounding = SINGULAR * np.abs(M).max(axis=(1, 2))
        if (smallest_eigenvalue < -rounding).any():
            pairs = [coupling.joints for coupling in description.couplings]
            listed = ", ".join(f"joints {i} and {j}" for i, j in pairs)
            raise DescriptionError(
                f"{description.name}: the mass matrix is not positive definite: the coupling of {listed} is too large "
                "for the inertia of links and drives"
            )

    joints = _joints_without_inertia(M)
    if np.all(joints >= 0):
        names = _named(description, np.unique(joints))
        raise DescriptionError(
            f"{description.name}: the mass matrix is singular: {names} no inertia; give a link that the "
            "joint moves a body with inertia, or the drive a rotor inertia"
        )


def _explain(description: Description, q: Array, qdd: Array) -> None:
    """Raise an error or log a warning where M is singular; other NaN come from states that are not finite."""
    require_inertia(description)
    lost = np.isnan(qdd).any(axis=-1)
    M = mass_matrix(description, np.broadcast_to(q, qdd.shape)[lost])
    joints = _joints_without_inertia(M)
    if np.all(joints < 0):
        return
    log.warning(
        "%s: no acceleration of %d of %d states: their mass matrix is singular, %s no inertia there",
        description.name,
        int(np.sum(joints >= 0)),
        lost.size,
        _named(description, np.unique(joints[joints >= 0])),
    )


def _joints_without_inertia(M: Array) -> Array:
    """Return the last joint, from 0, without inertia for each matrix (N, n, n), shape (N,); -1 if there is none.

    The elimination and its tolerance are those of ``solve_for_acceleration``.
    """
    A = M.copy()
    smallest_pivot = SINGULAR * np.diagonal(M, axis1=-2, axis2=-1).max(axis=-1)
    joints = np.full(len(M), -1)
    for k in reversed(range(M.shape[-1])):
        pivot = A[:, k, k].copy()
        is_singular = (pivot <= smallest_pivot) & (joints < 0)
        joints[is_singular] = k
        # A_ij <- A_ij - A_ik A_kj / A_kk; results after a singular pivot are not used.
        with np.errstate(all="ignore"):
            A -= A[:, :, k, None] * A[:, None, k, :] / pivot[:, None, None]
    return joints


def _named(description: Description, joints: Array) -> str:
    """Return the subject and verb of a sentence on joints, from 0, that carry something."""
    names = [f"{i + 1} ({description.joints[i].name})" for i in joints]
    listed = ", ".join(names)
    return f"joint {listed} carries" if len(names) == 1 else f"joints {listed} carry"
