"""An arm near a state as a linear system, and the linear-quadratic regulator."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from dhkit.control.gains import Robot, description_of
from dhkit.control.references import Setpoint
from dhkit.description import Array, Description, joint_vector
from dhkit.dynamics import bias, gravity_torque
from dhkit.symbolic import CasadiFunctions

if TYPE_CHECKING:
    import casadi

__all__ = ["LQR", "linearize"]


def linearize(description: Description, q: ArrayLike, qd: ArrayLike | None = None) -> tuple[Array, Array]:
    """Return A and B of dx/dt = A x + B u near a state, x = (q, qd) and u = tau less what holds the state.

    Exact derivatives of forward dynamics by CasADi, at the torques that keep the rates (tau = C qd + g).

    Parameters
    ----------
    description
        The robot, with a body on every link.
    q, qd
        The state, shape (n,), rad, m and per second; at rest unless ``qd`` is given.

    Returns
    -------
    tuple[Array, Array]
        A, shape (2n, 2n), and B, shape (2n, n).

    Raises
    ------
    ValueError
        A state that is not (n,) and finite.
    DescriptionError
        A link without a body.
    """
    n = description.n
    state = joint_vector(description, q), np.zeros(n) if qd is None else joint_vector(description, qd, "qd")
    tau = bias(description, *state)
    by_q, by_qd, by_tau = (np.array(x) for x in _derivatives(description)(*state, tau))
    A = np.block([[np.zeros((n, n)), np.eye(n)], [by_q, by_qd]])
    return A, np.vstack([np.zeros((n, n)), by_tau])


@lru_cache(maxsize=32)
def _derivatives(description: Description) -> casadi.Function:
    import casadi

    forward = CasadiFunctions(description).forward_dynamics
    state = [casadi.SX.sym(name, description.n) for name in ("q", "qd", "tau")]
    qdd = forward(*state)
    return casadi.Function("derivatives", state, [casadi.jacobian(qdd, x) for x in state], {"cse": True})


class LQR:
    """tau = g(q_0) - K (x - x_setpoint), K = R^-1 B^T P of the arm linearized at q_0 (Anderson and Moore 1990).

    Parameters
    ----------
    robot
        The arm, or its description.
    q
        Where it is linearized, shape (n,), at rest.
    Q
        Weights of joint errors and rates, shape (2n,) or (2n, 2n); 1 for all unless given.
    R
        Weights of torques, shape (n,) or (n, n); 1e-4 for all unless given.

    Raises
    ------
    ValueError
        Weights of another shape or not positive (semi)definite; a state that is not (n,) and finite.
    """

    def __init__(self, robot: Robot, q: ArrayLike, Q: ArrayLike | None = None, R: ArrayLike | None = None) -> None:
        from scipy.linalg import solve_continuous_are

        self.description = description_of(robot)
        n = self.description.n
        self.A, self.B = linearize(self.description, q)
        self.Q, self.R = _weights(Q, 2 * n, 1.0, "Q"), _weights(R, n, 1e-4, "R")
        if np.linalg.eigvalsh(self.Q).min() < 0 or np.linalg.eigvalsh(self.R).min() <= 0:
            raise ValueError("Q is to be positive semidefinite, and R positive definite")
        self.P = solve_continuous_are(self.A, self.B, self.Q, self.R)
        self.K = np.linalg.solve(self.R, self.B.T @ self.P)
        self._held = gravity_torque(self.description, q)

    def __call__(self, t: float, q: Array, qd: Array, setpoint: Setpoint) -> Array:
        """Return the torques, shape (n,)."""
        error = np.concatenate([q - setpoint.q, qd - setpoint.qd])
        tau: Array = self._held - self.K @ error
        return tau


def _weights(given: ArrayLike | None, size: int, default: float, name: str) -> Array:
    weights = np.asarray(np.full(size, default) if given is None else given, dtype=float)
    weights = np.diag(weights) if weights.ndim == 1 else weights
    if weights.shape != (size, size) or not np.isfinite(weights).all():
        raise ValueError(f"{name} has shape {weights.shape}; expected ({size},) or ({size}, {size}), finite")
    if not np.allclose(weights, weights.T):
        raise ValueError(f"{name} is not symmetric")
    return weights
