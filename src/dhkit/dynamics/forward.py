"""Forward dynamics: how an arm accelerates."""

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
        Shape (..., n), rad/s^2 and m/s^2; NaN where an input is not finite, or M is singular at this state, of which
        the log tells.

    Raises
    ------
    DescriptionError
        A link without a body; joints that carry no inertia at any state.
    ValueError, TypeError
        An argument of another shape, or not numeric; ``out`` does not fit.
    """
    load = external_torque(description, q, qd, wrench, friction, threads)
    q, qd, tau = (joint_array(description, array, name) for array, name in ((q, "q"), (qd, "qd"), (tau, "tau")))
    if out is not None and np.may_share_memory(out, q):
        q = q.copy()  # out= may overwrite q, which is needed to explain a missing acceleration
    drive = tau if load is None else tau + load
    states = {"q": q, "qd": qd, "tau": drive}
    qdd = evaluate("forward_dynamics", description, states, (description.n,), out, threads)
    # The sum finds a NaN in one pass; only then its cause is looked for.
    if qdd.size and not np.isfinite(qdd.sum()):
        _explain(description, q, qdd)
    return qdd


@takes_robot
def require_inertia(description: Description) -> None:
    """Check that an arm's mass matrix is regular at some state, and with couplings positive definite at all.

    Raises
    ------
    DescriptionError
        A link without a body; joints that carry no inertia at any state, or couplings that are too large: names them,
        and what would help.
    """
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (_SINGULAR_SAMPLES, description.n))
    M = mass_matrix(description, q)
    if description.couplings and (np.linalg.eigvalsh(M)[:, 0] < -SINGULAR * np.abs(M).max(axis=(1, 2))).any():
        pairs = (coupling.joints for coupling in description.couplings)
        listed = ", ".join(f"joints {i} and {j}" for i, j in pairs)
        raise DescriptionError(
            f"{description.name}: the mass matrix is not positive definite: the coupling of {listed} is too large for "
            "the inertia of links and drives"
        )
    everywhere = _failing(M)
    if np.all(everywhere >= 0):
        names = _named(description, np.unique(everywhere))
        raise DescriptionError(
            f"{description.name}: the mass matrix is singular: {names} no inertia; give the links behind a body with "
            "inertia, or the drive a rotor inertia"
        )


def _explain(description: Description, q: Array, qdd: Array) -> None:
    """Raise an error or log a warning where M is singular; other NaN come from states that are not finite."""
    require_inertia(description)
    lost = np.isnan(qdd).any(axis=-1)
    joints = _failing(mass_matrix(description, np.broadcast_to(q, qdd.shape)[lost]))
    if np.all(joints < 0):
        return
    log.warning(
        "%s: no acceleration of %d of %d states: their mass matrix is singular, %s no inertia there",
        description.name,
        int(np.sum(joints >= 0)),
        lost.size,
        _named(description, np.unique(joints[joints >= 0])),
    )


def _failing(M: Array) -> Array:
    """Return the last joint without inertia for each matrix (N, n, n), as ``solve_for_acceleration``; -1: none."""
    A = M.copy()
    least = SINGULAR * np.diagonal(M, axis1=-2, axis2=-1).max(axis=-1)
    failing = np.full(len(M), -1)
    for k in reversed(range(M.shape[-1])):
        pivot = A[:, k, k].copy()
        singular = (pivot <= least) & (failing < 0)
        failing[singular] = k
        with np.errstate(all="ignore"):  # results after a singular pivot are not used
            A -= A[:, :, k, None] * A[:, None, k, :] / pivot[:, None, None]
    return failing


def _named(description: Description, joints: Array) -> str:
    names = [f"{i + 1} ({description.joints[i].name})" for i in joints]
    return f"joint{'s' * (len(names) > 1)} {', '.join(names)} {'carry' if len(names) > 1 else 'carries'}"
