"""Linearization of an arm at a state, and the linear-quadratic regulator."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from dhkit.control.references import Setpoint
from dhkit.description import Array, Description, Robot, description_of, joint_vector, takes_robot
from dhkit.description.arrays import number_array
from dhkit.display import repr_line
from dhkit.dynamics import bias, gravity_torque, require_inertia
from dhkit.symbolic import CasadiFunctions

if TYPE_CHECKING:
    import casadi

ERROR = 0.1
RATE = 1.0
ACCELERATION = 200.0
"""Acceptable deviations for the default weights: rad, rad/s and rad/s^2, or m, m/s and m/s^2."""


@takes_robot
def linearize(
    description: Description, q: ArrayLike, qd: ArrayLike | None = None
) -> tuple[Array, Array]:
    """Return A and B of dx/dt = A x + B u near a state: x = (q, qd) minus the state, u = tau minus C qd + g there.

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

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> A, B = linearize(library_robot("planar2r"), [-1.5707963267948966, 0.0])  # hanging
    >>> A.shape, B.shape
    ((4, 4), (4, 2))
    """
    require_inertia(description)
    n = description.n
    state = (
        joint_vector(description, q),
        np.zeros(n) if qd is None else joint_vector(description, qd, "qd"),
    )

    # qdd = f(q, qd, tau) = M^-1 (tau - C qd - g), so that with x = (q, qd) and u = tau - tau_0, tau_0 = C qd + g there,
    #     A = [0, 1; df/dq, df/dqd],    B = [0; df/dtau] = [0; M^-1].
    tau = bias(description, *state)
    by_q, by_qd, by_tau = (np.array(x) for x in _derivatives(description)(*state, tau))
    A = np.block([[np.zeros((n, n)), np.eye(n)], [by_q, by_qd]])
    return A, np.vstack([np.zeros((n, n)), by_tau])


@lru_cache(maxsize=32)
def _derivatives(description: Description) -> casadi.Function:
    import casadi

    state = [casadi.SX.sym(name, description.n) for name in ("q", "qd", "tau")]
    qdd = CasadiFunctions(description).forward_dynamics(*state)
    return casadi.Function(
        "derivatives", state, [casadi.jacobian(qdd, x) for x in state], {"cse": True}
    )


class LQR:
    """tau = g(q_0) - K (x - x_setpoint), K = R^-1 B^T P of the arm linearized at q_0 (Anderson and Moore 1990).

    Parameters
    ----------
    robot
        The arm, or its description.
    q
        Joint values at which the arm is linearized, at rest, shape (n,), rad and m.
    Q
        Weights of joint errors and rates, shape (2n,) or (2n, 2n).
    R
        Weights of torques, shape (n,) or (n, n).

    Raises
    ------
    ValueError
        Weights of another shape or not positive (semi)definite; a state that is not (n,) and finite.

    Notes
    -----
    Unless given, weights are the squares of 1 over an acceptable deviation (Bryson and Ho 1975, section 5.2): 0.1 rad
    or m, 1 rad/s or m/s, and of torques the drives' limits, but at most what accelerates the joint by 200 rad/s^2 or
    m/s^2 while the others swing freely: the fastest poles are then slow enough for a rate of 1 kHz.
    """

    def __init__(
        self, robot: Robot, q: ArrayLike, Q: ArrayLike | None = None, R: ArrayLike | None = None
    ) -> None:
        from scipy.linalg import solve_continuous_are

        self.description = description_of(robot)
        n = self.description.n
        self.A, self.B = linearize(self.description, q)

        # Q_ii = 1 / dx_i^2 and R_ii = 1 / dtau_i^2. A torque on joint i alone accelerates it by (M^-1)_ii tau_i, and
        # M^-1 is the lower half of B.
        deviations = np.repeat([ERROR, RATE], n)
        torques = np.minimum(
            self.description.numbers.effort, ACCELERATION / np.diagonal(self.B[n:])
        )
        self.Q = _weights(Q, 1 / deviations**2, "Q")
        self.R = _weights(R, 1 / torques**2, "R")
        if np.linalg.eigvalsh(self.Q).min() < 0 or np.linalg.eigvalsh(self.R).min() <= 0:
            raise ValueError("Q is to be positive semidefinite, and R positive definite")

        # P solves A^T P + P A - P B R^-1 B^T P + Q = 0, and K = R^-1 B^T P.
        try:
            self.P = solve_continuous_are(self.A, self.B, self.Q, self.R)
        except np.linalg.LinAlgError as error:
            raise ValueError(f"Q and R give no regulator: {error}") from None
        self.K = np.linalg.solve(self.R, self.B.T @ self.P)

        # dx/dt = (A - B K) x. A state that a semidefinite Q does not weight may be left with the eigenvalue 0.
        slowest = float(np.linalg.eigvals(self.A - self.B @ self.K).real.max())
        if slowest >= 0:
            raise ValueError(
                f"Q and R leave the arm unstable, with an eigenvalue of {slowest:.3g} 1/s; expected Q above 0"
            )
        self._held = gravity_torque(self.description, q)

    def __call__(self, t: float, q: Array, qd: Array, setpoint: Setpoint) -> Array:
        """Return the torques, shape (n,), N m and N."""
        error = np.concatenate([q - setpoint.q, qd - setpoint.qd], axis=-1)
        tau: Array = self._held - error @ self.K.T
        return tau

    def __repr__(self) -> str:
        return repr_line(type(self).__name__, self.description.name, f"K of shape {self.K.shape}")


def _weights(given: ArrayLike | None, default: Array, name: str) -> Array:
    size = len(default)
    weights = number_array(
        default if given is None else given, name, f"({size},) or ({size}, {size})"
    )
    weights = np.diag(weights) if weights.ndim == 1 else weights
    if weights.shape != (size, size) or not np.isfinite(weights).all():
        raise ValueError(
            f"{name} has shape {weights.shape}; expected ({size},) or ({size}, {size}), finite"
        )
    if not np.allclose(weights, weights.T):
        raise ValueError(f"{name} is not symmetric")
    return weights
