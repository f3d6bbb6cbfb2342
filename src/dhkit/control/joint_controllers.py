"""Controllers of single joints: proportional, integral and derivative action."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dhkit.control.gains import batch_of, effective_inertia, gain, gains_text, pid_gains, positive
from dhkit.control.references import Setpoint
from dhkit.description import Array, Description, Robot, description_of
from dhkit.description.arrays import number_array
from dhkit.display import repr_line

BAND = 0.01
"""Share of the torque limit over which a continuous controller's integral action fades out."""


class PID:
    """Independent joints: tau = kp e + ki int(e) + kd de/dt, e = q_setpoint - q (Siciliano et al. 2009, section 8.3).

    The rate of the error is taken from the measured rate, or with ``derivative="measurement"`` the setpoint's rate is
    left out, so that a step of the setpoint does not kick. The integral of a joint does not change while
    its drive is at the limit and the error would increase the torque (conditional integration: Astrom and Hagglund
    2006, Advanced PID control, section 3.5).

    Parameters
    ----------
    kp, ki, kd
        Gains, N m/rad, N m/(rad s), N m s/rad (N/m ... for slides): a number for all joints, or shape (n,).
    derivative
        ``"error"`` or ``"measurement"``.
    cutoff
        rad/s: the derivative is filtered by 1 / (s / cutoff + 1); None for no filter.
    limit
        Torque limits for conditional integration, a number or shape (n,), N m and N; infinite unless given.

    Raises
    ------
    ValueError
        A gain that is negative or not finite, another derivative, a cutoff or limit that is not positive.
    """

    def __init__(
        self,
        kp: ArrayLike,
        ki: ArrayLike = 0.0,
        kd: ArrayLike = 0.0,
        *,
        derivative: str = "error",
        cutoff: float | None = None,
        limit: ArrayLike | None = None,
    ) -> None:
        given: object = kp
        if isinstance(given, Description) or hasattr(given, "description"):
            raise TypeError("kp is a robot; expected gains, which PID.tuned(arm) computes")
        self.kp = gain(kp, "kp")
        self.ki = gain(ki, "ki")
        self.kd = gain(kd, "kd")
        if derivative not in ("error", "measurement"):
            raise ValueError(f"derivative is {derivative!r}; expected 'error' or 'measurement'")
        self.derivative = derivative
        self.cutoff = None if cutoff is None else positive(cutoff, "cutoff")
        self.limit = number_array(
            np.inf if limit is None else limit, "limit", "a number, or one for each joint"
        )
        if not (self.limit > 0).all():
            raise ValueError(f"limit is {self.limit.tolist()}; expected positive numbers")
        self.batch_shape = batch_of(self.kp, self.ki, self.kd)
        self.reset()

    @classmethod
    def tuned(
        cls,
        robot: Robot,
        bandwidth: ArrayLike = 20.0,
        damping: ArrayLike = 1.0,
        integral: float = 0.5,
        q: ArrayLike | None = None,
        derivative: str = "error",
        cutoff: float | None = None,
    ) -> PID:
        """Return the controller whose joints have the poles of (s + a w) (s^2 + 2 z w s + w^2).

        With the effective inertia m of a joint, kp = m w^2 (1 + 2 z a), ki = m a w^3, kd = m w (2 z + a). The drives'
        limits are the arm's.

        Parameters
        ----------
        robot
            The arm, or its description.
        bandwidth
            w, rad/s; or shape (B,) for the runs of a batch.
        damping
            z, likewise.
        integral
            a: pole of the integral action over the bandwidth; 0 for PD.
        q
            Joint values at which the effective inertias are computed, shape (n,); their average over random
            configurations inside the limits unless given.
        derivative, cutoff
            As for the class.
        """
        description = description_of(robot)
        m = effective_inertia(description, q)

        # A joint of constant inertia m has m d^3e/dt^3 + kd d^2e/dt^2 + kp de/dt + ki e = 0: gains scale with m.
        kp, ki, kd = pid_gains(bandwidth, damping, integral)
        return cls(
            m * kp,
            m * ki,
            m * kd,
            derivative=derivative,
            cutoff=cutoff,
            limit=description.numbers.effort,
        )

    def reset(self) -> None:
        """Set the integral, the filter and the time back to the start."""
        self._integral: Array | float = 0.0
        self._rate: Array | None = None
        self._time: float | None = None

    def initial_state(self, q: Array) -> Array:
        """Return zeros for the integrals of the errors, rad s and m s, shape (n,), with filtered rates (2n,).

        Parameters
        ----------
        q
            Joint values, shape (n,), rad and m.
        """
        return np.zeros(len(q) * (1 if self.cutoff is None else 2))

    def continuous(
        self, t: float, q: Array, qd: Array, setpoint: Setpoint, state: Array
    ) -> tuple[Array, Array]:
        """Return the torques, shape (n,), N m and N, and the derivatives of ``state``, of the same shape.

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
        n = len(q)
        error = setpoint.q - q
        rate = (setpoint.qd if self.derivative == "error" else 0.0) - qd
        filtered = rate if self.cutoff is None else state[n:]
        tau = self._torques(error, state[:n], filtered)

        # The integral action fades out over the last hundredth of the torque limit: switched off at once, as in the
        # sampled controller, it would chatter at the limit. Where the error reduces the torque, it grows in full:
        #     d(integral)/dt = e min(max((limit - |tau|) / (BAND limit), 0), 1).
        left = (self.limit - np.abs(tau)) / np.where(
            np.isfinite(self.limit), BAND * self.limit, 1.0
        )
        growth = np.where(tau * error < 0, error, error * np.clip(left, 0.0, 1.0))
        if self.cutoff is None:
            return tau, growth

        # The filter 1 / (s / cutoff + 1): d(filtered)/dt = cutoff (rate - filtered).
        return tau, np.concatenate([growth, self.cutoff * (rate - filtered)])

    def __call__(self, t: float, q: Array, qd: Array, setpoint: Setpoint) -> Array:
        """Return the torques, shape (n,) or (B, n), N m and N."""
        _require_joints(len(q) if q.ndim == 1 else q.shape[1], kp=self.kp, ki=self.ki, kd=self.kd)
        error = setpoint.q - q
        step = 0.0 if self._time is None else t - self._time
        self._time = t
        rate = (setpoint.qd if self.derivative == "error" else 0.0) - qd
        if self.cutoff is not None:
            # The filter's exact response after h seconds of a constant rate r:
            #     y_k = y_(k-1) + (1 - exp(-cutoff h)) (r - y_(k-1)),    y_0 = r.
            if self._rate is not None:
                share = 1 - np.exp(-self.cutoff * step)
                rate = self._rate + share * (rate - self._rate)
            self._rate = rate
        tau = self._torques(error, self._integral, rate)

        # Conditional integration: integral_k = integral_(k-1) + h e_k, used from the next call on, where the drive is
        # below its limit or where the error reduces the torque.
        grows = (np.abs(tau) < self.limit) | (tau * error < 0)
        self._integral = self._integral + np.where(grows, error * step, 0.0)
        return tau

    def __repr__(self) -> str:
        return repr_line(
            type(self).__name__, summary=gains_text(kp=self.kp, ki=self.ki, kd=self.kd)
        )

    def _torques(self, error: Array, integral: Array | float, rate: Array) -> Array:
        return self.kp * error + self.ki * integral + self.kd * rate


def _require_joints(n: int, **gains: Array) -> None:
    for name, values in gains.items():
        if values.ndim and values.shape[-1] != n:
            raise ValueError(
                f"{name} has {values.shape[-1]} gains; expected {n}, one for each joint"
            )
