"""Model-based controllers: gravity compensation, feed-forward, computed torque, friction compensation."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from dhkit.cached_property import cached_property
from dhkit.control.controller import continuous_law, name_of, reset
from dhkit.control.gains import batch_of, effective_inertia, gain, gains_text, pd_gains
from dhkit.control.law import Law, LawFunction, Symbols
from dhkit.control.references import Setpoint
from dhkit.description import Array, Robot, description_of, require_bodies
from dhkit.display import repr_line
from dhkit.dynamics import Friction, friction_torque
from dhkit.symbolic import InertialTable, recursive_gravity, recursive_inverse_dynamics

if TYPE_CHECKING:
    import casadi

REST = 1e-4
"""Rate of a setpoint (rad/s or m/s) over which the friction compensation changes its sign smoothly."""


class _Proportional:
    """Base class: gains kp and kd on the errors of joint values and rates, and the model of an arm."""

    def __init__(
        self, robot: Robot, kp: ArrayLike | None = None, kd: ArrayLike | None = None
    ) -> None:
        if kp is None or kd is None:
            name = type(self).__name__
            raise TypeError(f"{name} needs the gains kp and kd, which {name}.tuned(arm) computes")
        self.description = description_of(robot)
        require_bodies(self.description)
        n = self.description.n
        self.kp = gain(kp, "kp", n)
        self.kd = gain(kd, "kd", n)
        self.batch_shape = batch_of(self.kp, self.kd)

    def __repr__(self) -> str:
        return repr_line(
            type(self).__name__, self.description.name, gains_text(kp=self.kp, kd=self.kd)
        )

    def __call__(self, t: float, q: Array, qd: Array, setpoint: Setpoint) -> Array:
        """Return the torques, shape (n,) or (B, n), N m and N."""
        return self._function(q, qd, setpoint, self._gains)

    @property
    def _gains(self) -> Array:
        """The gains kp and kd of each joint, shape (2n,) or (B, 2n)."""
        shape = (*self.batch_shape, self.description.n)
        both = (
            gains if gains.shape == shape else np.broadcast_to(gains, shape)
            for gains in (self.kp, self.kd)
        )
        return np.concatenate(tuple(both), axis=-1)

    @cached_property
    def _function(self) -> LawFunction:
        return LawFunction(self.law())

    def law(self) -> Law:
        """Return the controller as a CasADi expression."""
        raise NotImplementedError

    def _law(
        self, name: str, torques: Callable[[InertialTable, Symbols, casadi.SX], casadi.SX]
    ) -> Law:
        """Return the law with these torques, whose gains are kp and kd of each joint."""
        return Law(name, self.description, self._gains, torques)

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in vars(self).items() if name != "_function"}


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
    def tuned(cls, robot: Robot, bandwidth: ArrayLike = 20.0, damping: ArrayLike = 1.0) -> Self:
        """Return the controller with kp = w^2, kd = 2 z w for bandwidth w, rad/s, and damping z: numbers, or (B,).

        Parameters
        ----------
        robot
            The robot, or arm, that the controller knows.
        bandwidth
            Bandwidth w, rad/s.
        damping
            Damping ratio z.

        Examples
        --------
        >>> from dhkit import Arm
        >>> controller = ComputedTorque.tuned(Arm.load("planar2r"), bandwidth=10.0)
        >>> float(controller.kp), float(controller.kd)
        (100.0, 20.0)
        """
        return cls(robot, *pd_gains(bandwidth, damping))

    def law(self) -> Law:
        """Return the controller as a CasADi expression."""
        return self._law("computed_torque", _computed_torque)


class PDGravity(_Proportional):
    """tau = kp e + kd de/dt + g(q) (Takegaki and Arimoto 1981; Siciliano et al. 2009, section 8.5.1).

    It brings the arm to rest at any configuration, but lags behind a motion. kp is in N m/rad, kd in N m s/rad.
    """

    @classmethod
    def tuned(
        cls,
        robot: Robot,
        bandwidth: ArrayLike = 20.0,
        damping: ArrayLike = 1.0,
        q: ArrayLike | None = None,
    ) -> Self:
        """Return the controller with kp = m w^2 and kd = 2 z w m, m the effective inertia of each joint.

        Parameters
        ----------
        robot
            The arm, or its description.
        bandwidth, damping
            w, rad/s, and z; or shape (B,) for the runs of a batch.
        q
            Joint values at which the effective inertias are computed, shape (n,); their average over random
            configurations inside the limits unless given.
        """
        m = effective_inertia(description_of(robot), q)
        kp, kd = pd_gains(bandwidth, damping)
        return cls(robot, m * kp, m * kd)

    def law(self) -> Law:
        """Return the controller as a CasADi expression."""
        return self._law("pd_gravity", _pd_gravity)


class FeedForward(PDGravity):
    """tau = ID(q_d, qd_d, qdd_d) + kp e + kd de/dt: inverse dynamics of the setpoint plus PD feedback.

    The feed-forward torques of a motion can be computed in advance; Craig (2005), section 10.5.
    Gains as for :class:`PDGravity`.
    """

    def law(self) -> Law:
        """Return the controller as a CasADi expression."""
        return self._law("feed_forward", _feed_forward)


# The laws: e = q_d - q


def _computed_torque(table: InertialTable, s: Symbols, gains: casadi.SX) -> casadi.SX:
    # M a + C qd + g with a = qdd_d + kd de/dt + kp e is the inverse dynamics at the acceleration a. The right model
    # gives qdd = a, which is d^2e/dt^2 + kd de/dt + kp e = 0.
    return recursive_inverse_dynamics(table, s.q, s.qd, s.setpoint_qdd + _correction(s, gains))


def _pd_gravity(table: InertialTable, s: Symbols, gains: casadi.SX) -> casadi.SX:
    return _correction(s, gains) + recursive_gravity(table, s.q)


def _feed_forward(table: InertialTable, s: Symbols, gains: casadi.SX) -> casadi.SX:
    # ID(q_d, qd_d, qdd_d) = M(q_d) qdd_d + C(q_d, qd_d) qd_d + g(q_d) does not depend on the measured state.
    ahead = recursive_inverse_dynamics(table, s.setpoint_q, s.setpoint_qd, s.setpoint_qdd)
    return ahead + _correction(s, gains)


def _correction(s: Symbols, gains: casadi.SX) -> casadi.SX:
    """Return kp e + kd de/dt of each joint."""
    n = s.q.shape[0]
    return gains[:n] * (s.setpoint_q - s.q) + gains[n:] * (s.setpoint_qd - s.qd)


class FrictionCompensation:
    """Another controller's torques plus the friction torques of the arm at the setpoint's rates.

    The setpoint's rates are used, not the measured ones: otherwise dry friction would be compensated in the wrong
    direction whenever noise changes the sign of a small rate. The sign changes smoothly over 1e-4 rad/s or m/s,
    because the rate of a setpoint at rest is 0 only up to rounding.

    Parameters
    ----------
    inner
        The controller.
    robot
        The arm whose friction is compensated; the arm of ``inner`` unless given.
    friction
        Model of dry friction near rest; ``Friction(1e-4)`` unless given.
    """

    def __init__(
        self, inner: Any, robot: Robot | None = None, friction: Friction | None = None
    ) -> None:
        if not callable(inner):
            raise TypeError(f"inner is {type(inner).__name__}; expected a controller")
        found = robot if robot is not None else getattr(inner, "description", None)
        if found is None:
            raise ValueError("robot is not given, and the inner controller has none")
        if friction is not None and not isinstance(friction, Friction):
            raise TypeError(f"friction is {friction!r}; expected a Friction, or None")
        self.inner = inner
        self.description = description_of(found)
        self.batches: bool = getattr(inner, "batches", True)
        self.batch_shape: tuple[int, ...] = getattr(inner, "batch_shape", ())
        self.friction = Friction(REST) if friction is None else friction

    def reset(self) -> None:
        """Reset the inner controller."""
        reset(self.inner)

    def initial_state(self, q: Array) -> Array:
        """Return the inner controller's internal states at time 0, shape (m,).

        Parameters
        ----------
        q
            Joint values, shape (n,), rad and m.
        """
        return continuous_law(self.inner, q)[0]

    def continuous(
        self, t: float, q: Array, qd: Array, setpoint: Setpoint, state: Array
    ) -> tuple[Array, Array]:
        """Return the torques, shape (n,), N m and N, and the derivatives of the inner states, shape (m,).

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
        tau, change = continuous_law(self.inner, q)[1](t, q, qd, setpoint, state)
        return np.asarray(tau, dtype=float) + self._friction(setpoint), change

    def __call__(self, t: float, q: Array, qd: Array, setpoint: Setpoint) -> Array:
        """Return the torques, shape (n,) or (B, n), N m and N."""
        return np.asarray(self.inner(t, q, qd, setpoint), dtype=float) + self._friction(setpoint)

    def __repr__(self) -> str:
        return repr_line(
            type(self).__name__,
            self.description.name,
            f"{self.friction}, around {name_of(self.inner)}",
        )

    def _friction(self, setpoint: Setpoint) -> Array:
        # tau = tau_inner + r(qd_d), with r the torque of viscous and dry friction.
        return friction_torque(self.description, setpoint.qd, self.friction)
