"""Simulation over ``pin.aba`` as users of Pinocchio write it: a Runge-Kutta loop in Python, and SciPy's solve_ivp."""

from __future__ import annotations

import numpy as np

from dhkit.bench.contenders import import_peer
from dhkit.control import PDGravity
from dhkit.description import Array, Description
from dhkit.model import pinocchio_model


class AbaLoop:
    """One arm under PD plus gravity, its torques held over each step of Runge and Kutta's method of order 4.

    The model, its data and all arrays are reused, and the state is one vector of values and rates, so that a stage
    takes two operations of NumPy on it. Of three ways to write the loop this one was the fastest. Torques are cut off
    at the drives' limits, as dhkit's are.

    Parameters
    ----------
    description
        The robot.
    controller
        Its gains, shape (n,), are used; its law is computed here with Pinocchio's gravity torques.
    target
        Joint values to hold, shape (n,), rad and m.
    step
        Length of a step, s.

    Raises
    ------
    UnavailableError
        Pinocchio is not installed.
    """

    def __init__(
        self, description: Description, controller: PDGravity, target: Array, step: float
    ) -> None:
        self._pin = import_peer("pinocchio")
        self._model = pinocchio_model(description)
        self._data = self._model.createData()
        self._kp, self._kd = (
            np.array(np.broadcast_to(gain, target.shape)) for gain in (controller.kp, controller.kd)
        )
        self._effort = np.array(description.numbers.effort)
        self._target, self._step = target, step

    def __call__(self, q0: Array, steps: int) -> Array:
        """Return joint values and rates, shape (2n,), after a number of steps from rest at joint values, shape (n,)."""
        model, data, h, n = self._model, self._data, self._step, len(q0)
        aba, gravity = self._pin.aba, self._pin.computeGeneralizedGravity
        add, multiply, subtract, least, largest = (
            np.add,
            np.multiply,
            np.subtract,
            np.minimum,
            np.maximum,
        )
        target, kp, kd, effort = self._target, self._kp, self._kd, self._effort
        lowest, half = -effort, h / 2
        weights = h / 6 * np.array([1.0, 2.0, 2.0, 1.0])
        y, stage, tau, damping = (
            np.concatenate([q0, np.zeros(n)]),
            np.empty(2 * n),
            np.empty(n),
            np.empty(n),
        )
        q, qd, stage_q, stage_qd = y[:n], y[n:], stage[:n], stage[n:]
        slopes = np.empty((4, 2 * n))
        k1, k2, k3, _ = slopes
        (v1, a1), (v2, a2), (v3, a3), (v4, a4) = ((k[:n], k[n:]) for k in slopes)
        for _ in range(steps):
            subtract(target, q, out=tau)
            multiply(kp, tau, out=tau)
            multiply(kd, qd, out=damping)
            subtract(tau, damping, out=tau)
            add(tau, gravity(model, data, q), out=tau)
            least(tau, effort, out=tau)
            largest(tau, lowest, out=tau)
            v1[:] = qd
            a1[:] = aba(model, data, q, qd, tau)
            multiply(k1, half, out=stage)
            add(stage, y, out=stage)
            v2[:] = stage_qd
            a2[:] = aba(model, data, stage_q, stage_qd, tau)
            multiply(k2, half, out=stage)
            add(stage, y, out=stage)
            v3[:] = stage_qd
            a3[:] = aba(model, data, stage_q, stage_qd, tau)
            multiply(k3, h, out=stage)
            add(stage, y, out=stage)
            v4[:] = stage_qd
            a4[:] = aba(model, data, stage_q, stage_qd, tau)
            weights.dot(slopes, out=stage)
            add(y, stage, out=y)
        return y


def default_swing(description: Description, q0: Array, duration: float) -> tuple[Array, Array]:
    """Return joint values and rates, shape (N, n) each, of an arm let go at rest, by solve_ivp with its defaults.

    Raises
    ------
    UnavailableError
        Pinocchio is not installed.
    """
    aba, solve = import_peer("pinocchio").aba, import_peer("scipy.integrate").solve_ivp
    model, n = pinocchio_model(description), len(q0)
    data, none = model.createData(), np.zeros(n)

    def rates(t: float, y: Array) -> Array:
        return np.concatenate([y[n:], aba(model, data, y[:n], y[n:], none)])

    states = solve(rates, (0.0, duration), np.concatenate([q0, none])).y.T
    return states[:, :n], states[:, n:]
