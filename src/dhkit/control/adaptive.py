"""Adaptive control: computed torque with inertial parameters that are estimated while the arm moves."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from dhkit.control.gains import effective_inertia, gain, gains_text, positive
from dhkit.control.references import Setpoint
from dhkit.description import Array, Description, Robot, description_of, require_bodies
from dhkit.description.arrays import number_array
from dhkit.display import counted, repr_line
from dhkit.dynamics import inertial_parameters, mass_matrix, parameter_grouping, velocity_regressor
from dhkit.errors import DescriptionError
from dhkit.verification import random_motions

RANDOM_STATES = 2000
"""Number of random motions over which the squared regressor is averaged for the default adaptation gains."""


class Adaptive:
    """tau = Y(q, qd, qd_r, qdd_r) p + B qdd_r + K_D s, dp/dt = Gamma Y^T s.

    Slotine & Li, On the adaptive control of robot manipulators, 1987. With e = q_d - q: qd_r = qd_d + Lambda e,
    qdd_r = qdd_d + Lambda de/dt, s = qd_r - qd = de/dt + Lambda e (the opposite sign of theirs), and
    Y p + B qdd_r = M qdd_r + C qd_r + g with C of the Christoffel symbols. With the true parameters p*,
    V = (s^T M s + (p - p*)^T Gamma^-1 (p - p*)) / 2 falls by dV/dt = -s^T K_D s. So the error goes to 0; p goes to p*
    only in a motion that excites all parameters.

    p are the base parameters of the links (:func:`dhkit.dynamics.parameter_grouping`). The drives' rotor inertia B
    (``numbers.drive_inertia``) is not estimated: it is the arm's own. Called by a sampled controller, p is
    integrated by the trapezoidal rule from call to call; a continuous integrator takes :meth:`initial_state` and
    :meth:`continuous`. The estimate goes on changing as long as there is an error: friction, noise or a saturated
    drive make it drift.

    Parameters
    ----------
    robot
        The arm, or its description.
    decay
        Lambda, 1/s: how fast the error decays where s = 0. A number, or shape (n,).
    kd
        K_D, N m s/rad (N s/m for slides): a number, or shape (n,).
    adaptation
        Gamma, in units of p squared over J: a positive number, the diagonal (m,), or a positive definite matrix (m, m).
    estimate
        p at the start, shape (m,), in SI units of the base parameters.
    masses
        Factor of the arm's own parameters from which the estimate starts, if ``estimate`` is not given.

    Attributes
    ----------
    estimate
        Current p, shape (m,).

    Raises
    ------
    ValueError
        A gain that is negative or not finite, a Gamma that is not positive definite, an estimate of another shape.
    TypeError
        Not an arm, or gains that are not numbers.
    DescriptionError
        A link without a body.
    """

    estimate: Array

    batches = False
    """False: the controller takes the state of one arm, not states of a batch."""

    def __init__(
        self,
        robot: Robot,
        decay: ArrayLike,
        kd: ArrayLike,
        adaptation: ArrayLike,
        *,
        estimate: ArrayLike | None = None,
        masses: float = 1.0,
    ) -> None:
        self.description = description_of(robot)
        require_bodies(self.description)
        n = self.description.n
        self.decay = gain(decay, "decay", n)
        self.kd = gain(kd, "kd", n)
        grouping = parameter_grouping(self.description)
        self._columns = list(grouping.columns)
        self.adaptation = _adaptation_gains(adaptation, len(grouping))
        if estimate is None:
            self._start: Array = positive(masses, "masses") * (
                grouping.matrix @ inertial_parameters(self.description)
            )
        else:
            self._start = _first_estimate(estimate, len(grouping))
        self.reset()

    @classmethod
    def tuned(
        cls,
        robot: Robot,
        bandwidth: float = 20.0,
        damping: float = 1.0,
        adaptation: float = 2.0,
        q: ArrayLike | None = None,
        estimate: ArrayLike | None = None,
        masses: float = 1.0,
    ) -> Self:
        """Return the controller whose error has the poles of s^2 + 2 z w s + w^2 when the parameters are right.

        It obeys (s + Lambda)(s + k) = 0, with Lambda = w (z - sqrt(z^2 - 1)), k = w (z + sqrt(z^2 - 1)) and
        K_D = m k, m the effective inertia of each joint; so z is 1 or more. Gamma = a <Y^T K_D^-1 Y>^-1, averaged over
        random motions inside the limits: to parameters that change slowly s = -K_D^-1 Y (p - p*), so that p - p* decays
        at the rate a in a motion that excites it as random ones do. A slower or smaller motion excites it less.

        Parameters
        ----------
        robot
            The arm, or its description.
        bandwidth, damping
            w, rad/s, and z, 1 or more.
        adaptation
            a, 1/s.
        q
            Joint values at which the effective inertias are computed, shape (n,); their average over random
            configurations inside the limits unless given.
        estimate, masses
            As for the class.

        Raises
        ------
        ValueError
            A bandwidth or rate that is not positive, a damping below 1.
        DescriptionError
            A link without a body, or a joint that feels no inertia.
        """
        description = description_of(robot)
        w = positive(bandwidth, "bandwidth")
        z = positive(damping, "damping")
        if z < 1:
            raise ValueError(
                f"damping is {damping!r}; expected 1 or more: both poles of this controller are real"
            )
        m = effective_inertia(description, q)
        if not (m > 0).all():
            raise DescriptionError(
                f"{description.name}: joint {int(np.argmin(m)) + 1} feels no inertia"
            )

        # Both poles are real:  lambda = w (z - sqrt(z^2 - 1)) and kd / m = w (z + sqrt(z^2 - 1)), with product w^2.
        apart = np.sqrt(z * z - 1)
        kd = m * w * (z + apart)

        # The closed loop is M ds/dt + C s + K_D s = -Y (p - p*). While p changes slowly, s = -K_D^-1 Y (p - p*), and so
        #     d(p - p*)/dt = Gamma Y^T s = -Gamma <Y^T K_D^-1 Y> (p - p*) = -a (p - p*).
        Gamma = positive(adaptation, "adaptation") * _inverse_excitation(description, kd)
        return cls(description, w * (z - apart), kd, Gamma, estimate=estimate, masses=masses)

    def reset(self) -> None:
        """Go back to the estimate at the start."""
        self.estimate = self._start.copy()
        self._time: float | None = None
        self._rate: Array = np.zeros_like(self.estimate)

    def __call__(self, t: float, q: Array, qd: Array, setpoint: Setpoint) -> Array:
        """Return the torques, shape (n,), N m and N, and store the estimate's rate for the next call."""
        Y, known, s = self._terms(q, qd, setpoint)

        # dp/dt = Gamma Y^T s, integrated from call k - 1 to call k by the trapezoidal rule:
        #     p_k = p_(k-1) + (t_k - t_(k-1)) / 2 (rate_(k-1) + rate_k).
        rate = self.adaptation @ (Y.T @ s)
        if self._time is not None:
            self.estimate = self.estimate + (t - self._time) / 2 * (self._rate + rate)
        self._time = t
        self._rate = rate
        return Y @ self.estimate + known

    def initial_state(self, q: Array | None = None) -> Array:
        """Return the estimate at the start, shape (m,), which does not depend on q.

        Parameters
        ----------
        q
            Joint values, shape (n,), rad and m.
        """
        return self._start.copy()

    def continuous(
        self, t: float, q: Array, qd: Array, setpoint: Setpoint, state: Array
    ) -> tuple[Array, Array]:
        """Return the torques, shape (n,), and the rate of the estimate, shape (m,), at an estimate ``state`` (m,).

        Parameters
        ----------
        t
            Time, s.
        q, qd
            Joint values and rates, shape (n,), rad, m and per second.
        setpoint
            What the reference asks for at this time.
        state
            The controller's own state.
        """
        Y, known, s = self._terms(q, qd, setpoint)
        return Y @ state + known, self.adaptation @ (Y.T @ s)

    def lyapunov(
        self, q: Array, qd: Array, setpoint: Setpoint, estimate: Array, true: Array
    ) -> float:
        """Return V = (s^T M s + (p - p*)^T Gamma^-1 (p - p*)) / 2, J: it never rises under :meth:`continuous`.

        Parameters
        ----------
        q, qd
            Joint values and rates, shape (n,), rad, m and per second.
        setpoint
            The setpoint at that time.
        estimate, true
            p and p*, shape (m,). M is that of the controller's arm, which has to be the true arm.
        """
        _, s = self._reference(q, qd, setpoint)
        wrong = estimate - true
        M = mass_matrix(self.description, q)
        return float(s @ M @ s + wrong @ np.linalg.solve(self.adaptation, wrong)) / 2

    def __repr__(self) -> str:
        text = f"{counted(len(self.estimate), 'parameter')}, {gains_text(decay=self.decay, kd=self.kd)}"
        return repr_line(type(self).__name__, self.description.name, text)

    def _reference(self, q: Array, qd: Array, setpoint: Setpoint) -> tuple[Array, Array]:
        """Return qd_r and s."""
        # qd_r = qd_d + Lambda e and s = qd_r - qd, with e = q_d - q.
        qd_r = setpoint.qd + self.decay * (setpoint.q - q)
        return qd_r, qd_r - qd

    def _terms(self, q: Array, qd: Array, setpoint: Setpoint) -> tuple[Array, Array, Array]:
        """Return Y in base parameters, the torques that do not depend on the estimate, and s."""
        qd_r, s = self._reference(q, qd, setpoint)
        qdd_r = setpoint.qdd + self.decay * (setpoint.qd - qd)

        # tau = Y p + (B qdd_r + K_D s). Only independent columns of Y are kept: base parameters multiply these.
        Y = velocity_regressor(self.description, q, qd, qd_r, qdd_r)[:, self._columns]
        known = self.description.numbers.drive_inertia @ qdd_r + self.kd * s
        return Y, known, s


def _inverse_excitation(description: Description, kd: Array) -> Array:
    """Return <Y^T K_D^-1 Y>^-1 over random motions, shape (m, m)."""
    q, qd, qdd = random_motions(description, RANDOM_STATES)
    Y = velocity_regressor(description, q, qd, qd, qdd)[
        ..., list(parameter_grouping(description).columns)
    ]

    # The rows of K_D^(-1/2) Y of all N states, over sqrt(N), make a matrix A with A^T A = <Y^T K_D^-1 Y>.
    A = (Y / np.sqrt(kd)[:, None]).reshape(-1, Y.shape[-1]) / np.sqrt(len(q))

    # A = Q R D, with D = diag(column lengths), so that (A^T A)^-1 = X X^T with X = D^-1 R^-1. Forming A^T A first
    # would square the condition number.
    D = np.linalg.norm(A, axis=0)
    X = np.linalg.inv(np.linalg.qr(A / D, mode="r")) / D[:, None]
    product: Array = X @ X.T
    return (product + product.T) / 2


def _adaptation_gains(value: ArrayLike, m: int) -> Array:
    array = number_array(value, "adaptation", "a number, (m,) or (m, m)")
    if array.shape not in ((), (m,), (m, m)) or not np.isfinite(array).all():
        raise ValueError(
            f"adaptation has shape {array.shape}; expected a number, ({m},) or ({m}, {m}), finite"
        )
    matrix = array if array.ndim == 2 else np.diag(np.broadcast_to(array, m))
    if not np.allclose(matrix, matrix.T) or np.linalg.eigvalsh(matrix).min() <= 0:
        raise ValueError("adaptation is not symmetric and positive definite")
    return matrix.copy()


def _first_estimate(value: ArrayLike, m: int) -> Array:
    array = number_array(value, "estimate", f"({m},)")
    if array.shape != (m,) or not np.isfinite(array).all():
        raise ValueError(
            f"estimate has shape {array.shape}; expected ({m},) finite base parameters"
        )
    return array.copy()
