"""A simulation as the command asks for it: the arm, what moves, the motion and the options."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.cli.arguments import columns, joint_values, numbers
from dhkit.cli.quickest import ends
from dhkit.control import CONTROLLERS, Controller, FrictionCompensation, Push, make_controller
from dhkit.description import Array, Payload
from dhkit.description.joint_text import joint_text
from dhkit.dynamics import Friction
from dhkit.errors import DescriptionError
from dhkit.trajectories import Trajectory, read_motion

NOTHING = "none"
"""The controller that gives no torque."""
SHORTEST = 2.0
"""s: duration of a motion for which none is asked, if the arm can do it in half of it."""


@dataclass(frozen=True, eq=False)
class Task:
    """A simulation that is asked for."""

    arm: Arm
    """What the controller knows."""
    plant: Arm
    """What moves."""
    motion: Trajectory
    controllers: Sequence[str]
    bandwidth: float
    """rad/s."""
    damping: float
    options: dict[str, Any]
    """As for :meth:`Arm.simulate`."""
    compensate: bool = False
    named: str = "a motion"
    """What the motion is, in words."""

    def controller(self, name: str) -> Controller | None:
        """Return a controller by name, tuned.

        Raises
        ------
        ValueError
            No such controller.
        """
        if name == NOTHING:
            return None
        if name not in CONTROLLERS:
            raise ValueError(f"controller is {name!r}; expected {', '.join(CONTROLLERS)} or {NOTHING}")
        q = self.motion.q(self.motion.duration / 2)
        made = make_controller(name, self.arm.description, self.bandwidth, self.damping, q)
        return FrictionCompensation(made, self.arm) if self.compensate else made

    @property
    def about(self) -> str:
        """The motion and what the plant carries, in words."""
        load = "" if self.plant is self.arm else ", with a payload that the controller does not know of"
        return f"{self.named}, {self.motion.duration:.4g} s{load}"

    @property
    def rate(self) -> str:
        """How often the controller is called, in words."""
        rate = self.options["rate"]
        return "continuous" if rate is None else f"{rate:g} Hz"


def chosen_motion(
    arm: Arm,
    path: Path | None,
    start: str | None,
    goal: str | None,
    duration: float | None,
    degrees: bool,
    names: str | None = None,
) -> tuple[Trajectory, str]:
    """Return the motion of a file, or the quintic between two configurations; and what it is, in words.

    Without a start, it begins in a named configuration, or at zero; without a goal, it ends with every joint moved by 1
    rad or less; without a duration, it takes twice the least time, and 2 s at least.

    Raises
    ------
    DescriptionError
        A file beside configurations, one that cannot be read, or a motion that goes nowhere.
    """
    if path is not None:
        if start or goal or duration is not None:
            raise DescriptionError("--motion: found --from, --to or --duration too; expected the file alone")
        return read_motion(path, arm.description, degrees=degrees, columns=columns(names)), str(path)
    here, there = ends(arm)
    here = here if start is None else joint_values(arm, [start], degrees, "values of --from", outside="refused")
    there = there if goal is None else joint_values(arm, [goal], degrees, "values of --to", outside="refused")
    if start is None and np.array_equal(here, there):
        here = ends(arm)[1]
    if np.array_equal(here, there):
        raise DescriptionError("--from and --to are the same; expected two configurations")
    if duration is None:
        duration = max(SHORTEST, 2 * arm.quintic(here, there).duration) if _has_limits(arm) else SHORTEST
    words = f"quintic from {_name_of(arm, here)} to {_name_of(arm, there)}"
    return arm.quintic(here, there, duration), words


def _name_of(arm: Arm, q: Array) -> str:
    """Return a configuration's name, or its values."""
    known = {"zero": np.zeros(arm.n)} | dict(arm.configurations)
    found = next((name for name, values in known.items() if np.array_equal(values, q)), None)
    slides = arm.description.numbers.prismatic.tolist()
    return found or "(" + ", ".join(joint_text(x, slides=s, digits=4) for x, s in zip(q, slides, strict=True)) + ")"


def _has_limits(arm: Arm) -> bool:
    numbers = arm.description.numbers
    return bool(np.isfinite(numbers.velocity).any() or np.isfinite(numbers.effort).any())


def moving_arm(arm: Arm, carried: Payload | None, unmodelled: bool) -> tuple[Arm, Arm]:
    """Return the arm that the controller knows, and the one that moves with what it carries.

    Raises
    ------
    DescriptionError
        No payload that could be unmodelled.
    """
    if carried is None:
        if unmodelled:
            raise DescriptionError("--unmodelled: found no --payload; expected one that the controller does not know")
        return arm, arm
    loaded = arm.with_payload(carried)
    return (arm if unmodelled else loaded), loaded


def friction_of(text: str) -> bool | Friction:
    """Return what ``--friction`` asks for: none, stiction, or a width of smooth friction in rad/s.

    Raises
    ------
    DescriptionError
        Another word, or no width.
    """
    if text in ("none", "stiction"):
        return text == "stiction"
    try:
        width = float(text)
    except ValueError:
        raise DescriptionError(f"--friction: found {text!r}; expected none, stiction or a width in rad/s") from None
    try:
        return Friction(width)
    except ValueError as error:
        raise DescriptionError(f"--{error}") from None


def pushes(texts: Sequence[str]) -> list[Push]:
    """Return forces on the tool over a time: "FX FY FZ @ BEGIN END", N in world axes, and s.

    Raises
    ------
    DescriptionError
        Other numbers, or no expressions.
    ValueError
        An end before the beginning.
    """
    found = []
    for text in texts:
        force, at, window = text.partition("@")
        if not at:
            raise DescriptionError(f'--push: found {text!r}; expected "FX FY FZ @ BEGIN END", N and s')
        begin, end = numbers([window], "--push", [2])
        found.append(Push(numbers([force], "--push", [3]), begin=float(begin), end=float(end)))
    return found
