"""Settings of a simulation: the arm, the plant, the motion and the options."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dhkit.arm import Arm
from dhkit.cli.arguments import columns, numbers, option_values, split_at
from dhkit.cli.demo_motions import moved_configurations
from dhkit.cli.quantities import quantity
from dhkit.control import (
    CONTROLLERS,
    Controller,
    FrictionCompensation,
    Push,
    SimulationOptions,
    make_controller,
)
from dhkit.description import Array, Payload
from dhkit.description.joint_text import joint_text
from dhkit.dynamics import Friction
from dhkit.errors import DescriptionError, ExpressionError
from dhkit.trajectories import Trajectory, read_motion

NO_CONTROLLER = "none"
"""Name of the controller that gives no torque."""
MIN_DURATION = 2.0
"""Shortest default duration of a motion, s; longer motions take twice their least time."""


def tuned_controller(
    name: str, arm: Arm, motion: Trajectory, bandwidth: float, damping: float, compensate: bool
) -> Controller | None:
    """Return a controller by name, tuned for a bandwidth, rad/s, and a damping ratio; None for no controller.

    With ``compensate`` it compensates friction.

    Raises
    ------
    ValueError
        There is no such controller.
    """
    if name == NO_CONTROLLER:
        return None
    if name not in CONTROLLERS:
        raise ValueError(
            f"controller is {name!r}; expected {', '.join(CONTROLLERS)} or {NO_CONTROLLER}"
        )
    controller = make_controller(
        name, arm.description, bandwidth, damping, motion.q(motion.duration / 2)
    )
    return FrictionCompensation(controller, arm) if compensate else controller


def chosen_motion(
    arm: Arm,
    path: Path | None,
    start: str | None,
    goal: str | None,
    duration: float | None,
    degrees: bool,
    names: str | None = None,
) -> tuple[Trajectory, str]:
    """Return the motion of a file, or the quintic between two configurations; and its description.

    By default the motion begins in a named configuration, or at zero; it ends with every joint moved by 1 rad or less;
    and it takes twice the least time, but at least 2 s.

    Raises
    ------
    DescriptionError
        A file is given beside configurations or cannot be read, or both configurations are the same.
    """
    if path is not None:
        if start or goal or duration is not None:
            raise DescriptionError(
                "--motion: found --from, --to or --duration too; expected the file alone"
            )
        return read_motion(path, arm.description, degrees=degrees, columns=columns(names)), str(
            path
        )
    begin, end = moved_configurations(arm)
    begin = begin if start is None else option_values(arm, start, "--from", degrees)
    end = end if goal is None else option_values(arm, goal, "--to", degrees)
    if start is None and np.array_equal(begin, end):
        begin = moved_configurations(arm)[1]
    if np.array_equal(begin, end):
        raise DescriptionError("--from and --to are the same; expected two configurations")
    if duration is None:
        numbers = arm.description.numbers
        has_limits = np.isfinite(numbers.velocity).any() or np.isfinite(numbers.effort).any()
        duration = (
            max(MIN_DURATION, 2 * arm.quintic(begin, end).duration) if has_limits else MIN_DURATION
        )
    text = f"quintic from {_configuration_text(arm, begin)} to {_configuration_text(arm, end)}"
    return arm.quintic(begin, end, duration), text


def _configuration_text(arm: Arm, q: Array) -> str:
    """Return the name of a configuration, shape (n,), or its values."""
    configurations = {"zero": np.zeros(arm.n)} | dict(arm.configurations)
    name = next(
        (name for name, values in configurations.items() if np.array_equal(values, q)), None
    )
    slides = arm.description.numbers.prismatic.tolist()
    return (
        name
        or "("
        + ", ".join(joint_text(x, slides=s, digits=4) for x, s in zip(q, slides, strict=True))
        + ")"
    )


def known_and_moving_arm(arm: Arm, carried: Payload | None, unmodelled: bool) -> tuple[Arm, Arm]:
    """Return the arm that the controller knows, and the arm that moves with the payload.

    Raises
    ------
    DescriptionError
        There is no payload that could be unmodelled.
    """
    if carried is None:
        if unmodelled:
            raise DescriptionError(
                "--unmodelled: found no --payload; expected one that the controller does not know"
            )
        return arm, arm
    loaded = arm.with_payload(carried)
    return (arm if unmodelled else loaded), loaded


def _friction_of(text: str) -> bool | Friction:
    """Return the friction of a text: none, stiction, or the width of smooth friction in rad/s.

    Raises
    ------
    DescriptionError
        The text is another word, or the width is not positive.
    """
    if text in ("none", "stiction"):
        return text == "stiction"
    try:
        width = quantity(text)
    except ExpressionError:
        raise DescriptionError(
            f"--friction: found {text!r}; expected none, stiction or a width in rad/s"
        ) from None
    try:
        return Friction(width)
    except ValueError as error:
        raise DescriptionError(f"--{error}") from None


def pushes(texts: Sequence[str]) -> list[Push]:
    """Return pushes on the tool, of texts "FX FY FZ @ BEGIN END": a force in the world, N, and its times, s.

    Raises
    ------
    DescriptionError
        There are other numbers, or a word is not an expression.
    ValueError
        A push ends before it begins.
    """
    parsed = []
    for text in texts:
        force, times = split_at(text)
        if times is None:
            raise DescriptionError(
                f'--push: found {text!r}; expected "FX FY FZ @ BEGIN END", N and s'
            )
        begin, end = numbers([times], "--push", [2])
        parsed.append(Push(numbers([force], "--push", [3]), begin=float(begin), end=float(end)))
    return parsed


def simulation_options(
    plant: Arm,
    rate: float | None,
    plant_rate: float | None,
    friction: str,
    restitution: float | None,
    push: Sequence[str],
) -> SimulationOptions:
    """Return the options of a simulation; texts are those of `--friction` and `--push`."""
    return SimulationOptions(
        plant=plant,
        rate=rate,
        plant_rate=plant_rate,
        friction=_friction_of(friction),
        restitution=restitution,
        pushes=pushes(push),
    )
