"""Controllers that know the arm's equations: gravity, feed-forward, computed torque, friction."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from dhkit.control.gains import Robot, description_of, effective_inertia, gain, pd_gains
from dhkit.control.references import Setpoint
from dhkit.description import Array, require_bodies
from dhkit.dynamics import Friction, friction_torque, gravity_torque, inverse_dynamics

__all__ = ["ComputedTorque", "FeedForward", "FrictionCompensation", "PDGravity"]


class _Proportional:
    """Gains on the errors of joint values and rates, and the model of an arm."""

    def __init__(self, robot: Robot, kp: ArrayLike, kd: ArrayLike) -> None:
        self.description = description_of(robot)
        require_bodies(self.description)
        n = self.description.n
        self.kp, self.kd = gain(kp, "kp", n), gain(kd, "kd", n)

    def _correction(self, q: Array, qd: Array, setpoint: Setpoint) -> Array:
        correction: Array = self.kp * (setpoint.q - q) + self.kd * (setpoint.qd - qd)
        return correction


class ComputedTorque(_Proportional):
    """tau = M(q) (qdd_d + kd de/dt + kp e) + C qd + g (Siciliano et al. 2009, section 8.5.2; Luh et al. 1980).

    With the right model every joint's error decays as s^2 + kd s + kp says; kp and kd are per s^2 and per s.

    Raises
    ------
    ValueError
        A gain that is negative or not finite.
    DescriptionError
        A link without a body.
    """

    @classmethod
    def tuned(cls, robot: Robot, bandwidth: float = 20.0, damping: float = 1.0) -> Self:
        """Return the controller with kp = w^2 and kd = 2 z w for a bandwidth w (rad/s) and a damping z."""
        return cls(robot, *pd_gains(bandwidth, damping))

    def __call__(self, t: float, q: Array, qd: Array, setpoint: Setpoint) -> Array:
        """Return the torques, shape (n,)."""
        return inverse_dynamics(self.description, q, qd, setpoint.qdd + self._correction(q, qd, setpoint))


class PDGravity(_Proportional):
    """tau = kp e + kd de/dt + g(q) (Takegaki and Arimoto 1981; Siciliano et al. 2009, section 8.5.1).

    It brings the arm to rest at any configuration, but lags behind a motion. kp is in N m/rad, kd in N m s/rad.
    """

    @classmethod
    def tuned(cls, robot: Robot, bandwidth: float = 20.0, damping: float = 1.0, q: ArrayLike | None = None) -> Self:
        """Return the controller with kp = m w^2 and kd = 2 z w m, m the effective inertia of each joint.

        Parameters
        ----------
        robot
            The arm, or its description.
        bandwidth, damping
            w, rad/s, and z.
        q
            Where the effective inertias are taken, shape (n,); their average over the workspace unless given.
        """
        m = effective_inertia(description_of(robot), q)
        kp, kd = pd_gains(bandwidth, damping)
        return cls(robot, m * kp, m * kd)

    def __call__(self, t: float, q: Array, qd: Array, setpoint: Setpoint) -> Array:
        """Return the torques, shape (n,)."""
        return self._correction(q, qd, setpoint) + gravity_torque(self.description, q)


class FeedForward(PDGravity):
    """tau = ID(q_d, qd_d, qdd_d) + kp e + kd de/dt: the setpoint's own torques, and a correction.

    The torques of a motion can be worked out beforehand; Craig (2005), section 10.5. Gains as of :class:`PDGravity`.
    """

    def __call__(self, t: float, q: Array, qd: Array, setpoint: Setpoint) -> Array:
        """Return the torques, shape (n,)."""
        ahead = inverse_dynamics(self.description, setpoint.q, setpoint.qd, setpoint.qdd)
        return ahead + self._correction(q, qd, setpoint)


class FrictionCompensation:
    """Another controller's torques plus those that the arm's friction takes at the setpoint's rates.

    At the setpoint's rates and not at the measured ones: dry friction would otherwise be compensated in the wrong
    direction whenever noise changes the sign of a small rate.

    Parameters
    ----------
    inner
        The controller.
    robot
        Whose friction; that of ``inner`` unless given.
    friction
        How dry friction changes with the direction; a step unless given.
    """

    def __init__(self, inner: Any, robot: Robot = None, friction: Friction | None = None) -> None:
        if not callable(inner):
            raise TypeError(f"inner is {type(inner).__name__}; expected a controller")
        found = robot if robot is not None else getattr(inner, "description", None)
        if found is None:
            raise ValueError("robot is not given, and the inner controller has none")
        self.inner, self.description = inner, description_of(found)
        self.friction = friction

    def reset(self) -> None:
        """Reset the inner controller."""
        reset = getattr(self.inner, "reset", None)
        if callable(reset):
            reset()

    def __call__(self, t: float, q: Array, qd: Array, setpoint: Setpoint) -> Array:
        """Return the torques, shape (n,)."""
        loss = friction_torque(self.description, setpoint.qd, self.friction)
        tau: Array = np.asarray(self.inner(t, q, qd, setpoint), dtype=float) + loss
        return tau
