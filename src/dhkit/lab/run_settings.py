"""Settings of a run of the control panel, and the references that it follows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from enum import StrEnum
from typing import NamedTuple, TypeAlias

import numpy as np

from dhkit.arm import Arm
from dhkit.control import CONTROLLERS, Sine
from dhkit.description import Array
from dhkit.dynamics import Friction
from dhkit.lab.requests import Fields
from dhkit.trajectories import Trajectory

SMOOTHING_RATE = 0.05
"""Joint rate within which smooth friction changes its sign, rad/s or m/s."""
OWN = "own"
"""The name of the controller of the person's own program."""
CONTROLLER_TITLES = {
    OWN: "Your own",
    "pd": "PD of each joint",
    "pid": "PID of each joint",
    "pd-gravity": "PD and gravity",
    "feed-forward": "Feed-forward",
    "computed-torque": "Computed torque",
    "operational-space": "Operational space",
    "adaptive": "Adaptive",
    "lqr": "LQR",
}
JOINT_CONTROLLERS = ("pid", "pd")
"""Controllers whose gains can be typed for each joint."""
TUNING_SETTINGS = ("controller", "bandwidth", "damping")
"""Settings that gains are tuned by."""
SINE_AMPLITUDE = 0.3
"""Range of a sine from end to end, rad and shares of the arm's reach; less where limits are near."""
SINE_FREQUENCY = 0.25
"""Frequency of a sine, Hz."""
LIMIT_SHARE = 0.9
"""Largest share of the way to a joint limit that a sine uses."""
REST_TIME = 1.0
"""Time that a repeated motion is held at either end, s."""

Setpoints: TypeAlias = Callable[[float], tuple[Array, Array, Array]]
"""Joint values, rates and accelerations to follow at a time in s, shape (n,) each."""


class FrictionKind(StrEnum):
    """The friction of the joints in a run."""

    NONE = "none"
    SMOOTH = "smooth"
    STICTION = "stiction"


class ReferenceKind(StrEnum):
    """Reference that a run follows."""

    HOLD = "hold"
    SINE = "sine"
    MOTION = "motion"
    TARGET = "target"
    SLIDERS = "sliders"


class Gains(NamedTuple):
    """Gains of the joints' PID controllers, n numbers each."""

    kp: tuple[float, ...]
    """N m/rad, of prismatic joints N/m."""
    ki: tuple[float, ...]
    """N m/(rad s), N/(m s)."""
    kd: tuple[float, ...]
    """N m s/rad, N s/m."""


@dataclass(frozen=True)
class Settings:
    """Settings of a run.

    Attributes
    ----------
    controller
        Name of the controller: one of :data:`dhkit.control.CONTROLLERS`, or :data:`OWN`.
    bandwidth, damping
        Bandwidth, rad/s, and damping ratio that the controller's gains are tuned for.
    friction
        Friction of the joints.
    payload
        Mass at the tool, kg, that the controller does not know of.
    compensate
        Whether the controller compensates friction.
    reference
        Reference that the run follows.
    gains
        Gains that a person has typed for PID or PD; None for those tuned by bandwidth and damping.
    """

    controller: str = "computed-torque"
    bandwidth: float = 20.0
    damping: float = 1.0
    friction: FrictionKind = FrictionKind.NONE
    payload: float = 0.0
    compensate: bool = False
    reference: ReferenceKind = ReferenceKind.HOLD
    gains: Gains | None = None

    def changed(self, given: Fields) -> Settings:
        """Return the settings with the values of a request's fields instead of their own.

        Typed gains go where the controller, its bandwidth or its damping changes.

        Raises
        ------
        ValueError
            A value does not fit.
        """
        settings = Settings(
            given.choice("controller", [*CONTROLLERS, OWN], self.controller),
            given.number("bandwidth", 0.1, 1000.0, self.bandwidth),
            given.number("damping", 0.01, 10.0, self.damping),
            FrictionKind(given.choice("friction", list(FrictionKind), self.friction)),
            given.number("payload", 0.0, 1000.0, self.payload),
            given.flag("compensate", self.compensate),
            ReferenceKind(given.choice("reference", list(ReferenceKind), self.reference)),
        )
        is_tuned_anew = any(
            getattr(settings, name) != getattr(self, name) for name in TUNING_SETTINGS
        )
        return settings if is_tuned_anew else replace(settings, gains=self.gains)

    @property
    def friction_model(self) -> Friction | None:
        """The friction of the joints, as a simulation takes it."""
        if self.friction is FrictionKind.NONE:
            return None
        return Friction(SMOOTHING_RATE) if self.friction is FrictionKind.SMOOTH else Friction()


SETTING_NAMES = tuple(field.name for field in fields(Settings) if field.name != "gains")
"""Settings that a request may change; gains have a request of their own."""


def back_and_forth(motion: Trajectory, t: float, free: list[int]) -> tuple[Array, Array, Array]:
    """Return the free joints' values, rates and accelerations, shape (k,) each, of a motion that is repeated.

    The motion is held at its end, goes back the same way, is held again, and begins anew.

    Parameters
    ----------
    motion
        The motion, of n joints.
    t
        Time since the beginning, s.
    free
        The k joints, from 0.
    """
    half_period = motion.duration + REST_TIME
    returning, s = divmod(t % (2 * half_period), half_period)
    time = min(s, motion.duration)
    if returning:
        time = motion.duration - time
    if s >= motion.duration:
        at_rest = np.zeros(len(free))
        return motion.q(time)[free], at_rest, at_rest
    sign = -1.0 if returning else 1.0
    return motion.q(time)[free], sign * motion.qd(time)[free], motion.qdd(time)[free]


def gentle_sine(arm: Arm, q: Array, free: list[int]) -> Sine:
    """Return a sine of the k free joints that begins at rest, to the side on which there is more room.

    Parameters
    ----------
    arm
        The arm, of n joints.
    q
        Values of the free joints at the beginning, shape (k,), rad and m.
    free
        The free joints, from 0.
    """
    numbers = arm.description.numbers
    size = np.where(numbers.prismatic, SINE_AMPLITUDE * arm.description.reach, SINE_AMPLITUDE)[free]
    room_up = numbers.upper[free] - q
    room_down = q - numbers.lower[free]
    enough_room = room_up >= np.minimum(size, room_down)
    up = np.clip(np.where(enough_room, np.minimum(size, LIMIT_SHARE * room_up), 0.0), 0.0, None)
    down = np.clip(np.minimum(size, LIMIT_SHARE * room_down), 0.0, None)
    amplitude = np.where(up > 0, up, -down) / 2
    return Sine(q + amplitude, amplitude, SINE_FREQUENCY, -np.pi / 2)
