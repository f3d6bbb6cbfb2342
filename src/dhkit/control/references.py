"""What a controller is to follow: motions, held configurations, steps and sines, sampled in one batch."""

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
    """What is asked for at one time: joint values, rates and accelerations, shape (n,), rad, m and seconds."""

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
        at_rest: Array = jacobian(self.description, self.q) @ self.qdd
        return at_rest + jacobian_dot(self.description, self.q, self.qd) @ self.qd

    def __repr__(self) -> str:
        return repr_line("Setpoint", self.description.name, f"q {listed(self.q)}, qd {listed(self.qd)}")


@runtime_checkable
class Reference(Protocol):
    """Anything that has joint values for times; ``duration`` is how long a run lasts unless it is told otherwise.

    Where it has an attribute ``jumps``, times (s) at which it or its derivatives jump, continuous runs pause there.
    """

    @property
    def duration(self) -> float | None:
        """In s; None where it has no end."""

    def sampled(self, t: Array) -> Samples:
        """Return joint values, rates and accelerations at times (N,)."""


@dataclass(frozen=True, eq=False)
class Held:
    """One configuration."""

    q: Array
    duration: float | None = None

    def sampled(self, t: Array) -> Samples:
        """Return the configuration for each time."""
        still = np.zeros((len(t), len(self.q)))
        return still + self.q, still, still.copy()

    def __repr__(self) -> str:
        return value_line(self)


@dataclass(frozen=True, eq=False)
class Step:
    """A configuration, and from a time on another one."""

    before: ArrayLike
    after: ArrayLike
    time: float = 0.0
    """s."""
    duration: float | None = None

    def __post_init__(self) -> None:
        _make_finite(self, "before", "after", "time")

    @property
    def jumps(self) -> tuple[float, ...]:
        """When it jumps, s."""
        return (float(self.time),)

    def sampled(self, t: Array) -> Samples:
        """Return one of the configurations for each time."""
        q = np.where((t >= self.time)[:, None], np.asarray(self.after), np.asarray(self.before))
        return q, np.zeros_like(q), np.zeros_like(q)

    def __repr__(self) -> str:
        return value_line(self)


@dataclass(frozen=True, eq=False)
class Sine:
    """Joint values centre + amplitude sin(2 pi frequency t + phase)."""

    centre: ArrayLike
    amplitude: ArrayLike
    frequency: ArrayLike = 1.0
    """Hz, for all joints or of each."""
    phase: ArrayLike = 0.0
    """rad."""
    duration: float | None = None

    def __post_init__(self) -> None:
        _make_finite(self, "centre", "amplitude", "frequency", "phase")

    def sampled(self, t: Array) -> Samples:
        """Return joint values and their derivatives."""
        centre = np.asarray(self.centre)
        rate = 2 * np.pi * np.broadcast_to(np.asarray(self.frequency), centre.shape)
        amplitude = np.broadcast_to(np.asarray(self.amplitude), centre.shape)
        angle = rate * t[:, None] + np.asarray(self.phase)
        swing = amplitude * np.sin(angle)
        return centre + swing, amplitude * rate * np.cos(angle), -(rate**2) * swing

    def __repr__(self) -> str:
        return value_line(self)


def _make_finite(reference: object, *names: str) -> None:
    """Turn fields into arrays.

    Raises
    ------
    ValueError
        One that is not finite.
    TypeError
        One that is no numbers.
    """
    for name in names:
        value = number_array(getattr(reference, name), name, "numbers")
        if not np.isfinite(value).all():
            raise ValueError(f"{type(reference).__name__}: {name} is {value.tolist()}; expected finite numbers")
        object.__setattr__(reference, name, value)
    shapes = [np.shape(getattr(reference, name)) for name in names]
    try:
        np.broadcast_shapes(*shapes)
    except ValueError:
        listed = ", ".join(f"{name} {shape}" for name, shape in zip(names, shapes, strict=True))
        raise ValueError(f"{type(reference).__name__}: {listed} do not fit together") from None


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
    description: Description, reference: Reference | Trajectory | ArrayLike, q0: ArrayLike | None = None
) -> Reference:
    """Return a reference, made of a trajectory, or of a configuration or a pose to hold where it is one.

    Parameters
    ----------
    description
        The robot.
    reference
        A :class:`Reference`, a motion, joint values (n,), or a pose of the tool in the world (4, 4).
    q0
        Joint values, shape (n,), rad and m, to which those that hold a pose are nearest; the middle of the joint limits
        unless given.

    Raises
    ------
    ValueError
        A trajectory of another robot, a matrix that is no pose, or a configuration that is not (n,) and finite.
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
