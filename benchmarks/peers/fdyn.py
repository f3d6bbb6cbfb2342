"""roboticstoolbox-python's ``fdyn``: SciPy's steps over the toolbox's ``accel``, for the robot of our own table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dhkit.bench.contenders import import_peer
from dhkit.bench.peers.roboticstoolbox import toolbox_robot
from dhkit.control import ComputedTorque, Reference
from dhkit.description import Array, Description


class Fdyn:
    """One arm that the toolbox simulates.

    Parameters
    ----------
    description
        The robot, whose DHRobot has no friction.
    options
        Options of SciPy's integrator RK45, such as ``rtol``; by default its own.

    Raises
    ------
    UnavailableError
        The toolbox is not installed.
    """

    def __init__(
        self, description: Description, options: Mapping[str, float] | None = None
    ) -> None:
        self.robot = toolbox_robot(description)
        self._options = dict(options or {})

    def swing(self, q0: Array, duration: float) -> tuple[Array, Array]:
        """Return joint values and rates, shape (N, n) each, of an arm let go at rest at joint values (n,)."""
        run = self.robot.fdyn(duration, q0, solver_args=self._options)
        return run.q, run.qd

    def controlled(
        self,
        controller: ComputedTorque,
        reference: Reference,
        q0: Array,
        qd0: Array,
        duration: float,
    ) -> tuple[Array, Array]:
        """Return joint values and rates, shape (N, n) each, under computed torque by the toolbox's own ``rne``."""
        kp, kd = controller.kp, controller.kd

        def torque(robot: Any, t: float, q: Array, qd: Array) -> Array:
            setpoint_q, setpoint_qd, setpoint_qdd = (
                rows[0] for rows in reference.sampled(np.array([t]))
            )
            tau: Array = robot.rne(
                q, qd, setpoint_qdd + kd * (setpoint_qd - qd) + kp * (setpoint_q - q)
            )
            return tau

        run = self.robot.fdyn(duration, q0, torque, qd0=qd0, solver_args=self._options)
        return run.q, run.qd

    def accelerations(self, q: Array, qd: Array, tau: Array) -> Array:
        """Return accelerations, shape (N, n), of states and torques, shape (N, n) each."""
        return np.asarray(self.robot.accel(q, qd, tau))


def own_puma_accelerations(q: Array, qd: Array, tau: Array) -> Array:
    """Return accelerations of the toolbox's own PUMA 560 without friction, states and result of shape (N, 6).

    Raises
    ------
    UnavailableError
        The toolbox is not installed.
    """
    import_peer("roboticstoolbox")
    puma = import_peer("roboticstoolbox.models.DH").Puma560().nofriction(coulomb=True, viscous=True)
    return np.asarray(puma.accel(q, qd, tau))
