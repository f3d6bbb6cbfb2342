"""References for controllers: motions, held configurations, steps and sines."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from dhkit.control.tool_poses import joints_at_pose
from dhkit.description import Array, Description, joint_vector
from dhkit.description.arrays import number_array
from dhkit.display import listed, repr_line, value_line
from dhkit.kinematics import forward_kinematics, jacobian, jacobian_dot
from dhkit.trajectories import Trajectory

Samples: TypeAlias = tuple[Array, Array, Array]
"""Joint values, rates and accelerations, shape (N, n) each."""


@dataclass(frozen=True, eq=False)
class Setpoint:
    """Reference at one time: joint values, rates and accelerations, shape (n,), rad, m and seconds."""

    description: Description
    q: Array
    qd: Array
    qdd: Array

    @cached_property
    def T(self) -> Array:
        """The tool's pose in the world, shape (4, 4)."""
        return forward_kinematics(self.description, self.q)

    @cached_property
    def twist(self) -> Array:
        """The tool's velocity, shape (6,): of its origin, m/s, then angular, rad/s, world axes."""
        return jacobian(self.description, self.q) @ self.qd

    @cached_property
    def acceleration(self) -> Array:
        """The tool's acceleration, shape (6,): the time derivative of ``twist``, m/s^2 and rad/s^2."""
        # d/dt (J qd) = J qdd + dJ/dt qd
        at_rest: Array = jacobian(self.description, self.q) @ self.qdd
        return at_rest + jacobian_dot(self.description, self.q, self.qd) @ self.qd

    def __repr__(self) -> str:
        return repr_line(
            "Setpoint", self.description.name, f"q {listed(self.q)}, qd {listed(self.qd)}"
        )


@runtime_checkable
class Reference(Protocol):
    """Joint values as a function of time; ``duration`` is the duration of a run unless another is given.

    If it has an attribute ``jumps``, times (s) at which it or its derivatives jump, continuous runs end steps there.
    """

    @property
    def duration(self) -> float | None:
        """Duration, s; None if it has no end."""

    def sampled(self, t: Array) -> Samples:
        """Return joint values, rates and accelerations at times (N,), s: shape (N, n) each, rad, m and seconds.

        Parameters
        ----------
        t
            Times, shape (N,), s.
        """


@dataclass(frozen=True, eq=False)
class Held:
    """A constant configuration, shape (n,), rad and m."""

    q: Array
    duration: float | None = None

    def sampled(self, t: Array) -> Samples:
        """Return the configuration at times (N,), shape (N, n), and zero rates and accelerations.

        Parameters
        ----------
        t
            Times, shape (N,), s.
        """
        still = np.zeros((len(t), len(self.q)))
        return still + self.q, still, still.copy()

    __repr__ = value_line


@dataclass(frozen=True, eq=False)
class Step:
    """A step from one configuration to another at a time, shape (n,) each, rad and m."""

    before: ArrayLike
    after: ArrayLike
    time: float = 0.0
    """Time of the step, s."""
    duration: float | None = None

    def __post_init__(self) -> None:
        _check_fields(self, "before", "after", "time")

    @property
    def jumps(self) -> tuple[float, ...]:
        """Times of jumps, s."""
        return (float(self.time),)

    def sampled(self, t: Array) -> Samples:
        """Return the configurations at times (N,), shape (N, n), and zero rates and accelerations.

        Parameters
        ----------
        t
            Times, shape (N,), s.
        """
        q = np.where((t >= self.time)[:, None], np.asarray(self.after), np.asarray(self.before))
        return q, np.zeros_like(q), np.zeros_like(q)

    __repr__ = value_line


@dataclass(frozen=True, eq=False)
class Sine:
    """Joint values centre + amplitude sin(2 pi frequency t + phase), arrays of shape (n,), rad and m."""

    centre: ArrayLike
    amplitude: ArrayLike
    frequency: ArrayLike = 1.0
    """Frequency, a number for all joints or shape (n,), Hz."""
    phase: ArrayLike = 0.0
    """Phase, a number for all joints or shape (n,), rad."""
    duration: float | None = None

    def __post_init__(self) -> None:
        _check_fields(self, "centre", "amplitude", "frequency", "phase")

    def sampled(self, t: Array) -> Samples:
        """Return joint values, rates and accelerations at times (N,), shape (N, n) each.

        Parameters
        ----------
        t
            Times, shape (N,), s.
        """
        # q = c + A sin(w t + phi),    qd = A w cos(w t + phi),    qdd = -A w^2 sin(w t + phi),    w = 2 pi frequency.
        centre = np.asarray(self.centre)
        rate = 2 * np.pi * np.broadcast_to(np.asarray(self.frequency), centre.shape)
        amplitude = np.broadcast_to(np.asarray(self.amplitude), centre.shape)
        angle = rate * t[:, None] + np.asarray(self.phase)
        swing = amplitude * np.sin(angle)
        return centre + swing, amplitude * rate * np.cos(angle), -(rate**2) * swing

    __repr__ = value_line


def _check_fields(reference: object, *names: str) -> None:
    """Convert the fields of a frozen reference to arrays, and check that they are finite and fit together.

    Raises
    ------
    ValueError
        A field that is not finite, or shapes that do not broadcast.
    TypeError
        A field that is not numeric.
    """
    for name in names:
        value = number_array(getattr(reference, name), name, "numbers")
        if not np.isfinite(value).all():
            raise ValueError(
                f"{type(reference).__name__}: {name} is {value.tolist()}; expected finite numbers"
            )
        object.__setattr__(reference, name, value)
    shapes = [np.shape(getattr(reference, name)) for name in names]
    try:
        np.broadcast_shapes(*shapes)
    except ValueError:
        fields = ", ".join(f"{name} {shape}" for name, shape in zip(names, shapes, strict=True))
        raise ValueError(f"{type(reference).__name__}: {fields} do not fit together") from None


@dataclass(frozen=True, eq=False)
class _Motion:
    """A trajectory as a reference."""

    motion: Trajectory

    @property
    def duration(self) -> float:
        return self.motion.duration

    @property
    def jumps(self) -> Array:
        return self.motion.breaks

    def sampled(self, t: Array) -> Samples:
        return self.motion.q(t), self.motion.qd(t), self.motion.qdd(t)


def reference_of(
    description: Description,
    reference: Reference | Trajectory | str | ArrayLike,
    q0: ArrayLike | None = None,
) -> Reference:
    """Return a reference: as given, or made from a trajectory, or from a configuration or a pose to hold.

    Parameters
    ----------
    description
        The robot.
    reference
        A :class:`Reference`; a motion; joint values (n,); the name of a pose of the robot's file, such as ``"ready"``;
        or a pose of the tool in the world (4, 4).
    q0
        Joint values, shape (n,), rad and m, to which those that hold a pose are nearest; the middle of the joint limits
        unless given.

    Raises
    ------
    ValueError
        A trajectory of another robot, an unknown name, a matrix that is not a pose, or a configuration that is not (n,)
        and finite.
    UnreachableError
        A pose that the arm does not reach inside its limits.
    TypeError
        Something else.
    """
    if isinstance(reference, Trajectory):
        if reference.n != description.n or reference.description.kinds != description.kinds:
            raise ValueError(
                f"the reference is a motion of {reference.description.name} ({reference.n} joints); expected one of "
                f"{description.name} ({description.n} joints)"
            )
        return _Motion(reference)
    if isinstance(reference, type):
        raise TypeError(f"reference is the class {reference.__name__}; expected an object of it")
    if isinstance(reference, Reference):
        return reference
    if isinstance(reference, str):
        return Held(joint_vector(description, reference, "reference"))
    array = number_array(reference, "reference", f"a motion, ({description.n},) or (4, 4)")
    if array.shape == (4, 4):
        near = None if q0 is None else joint_vector(description, q0, "q0")
        return Held(joints_at_pose(description, array, near, "reference"))
    if array.shape != (description.n,) or not np.isfinite(array).all():
        raise ValueError(
            f"reference has shape {array.shape}; expected a motion, ({description.n},) finite joint values, or a pose "
            "(4, 4)"
        )
    return Held(array.copy())
