"""The robot: its source, its joints, and pictures of it."""

from __future__ import annotations

import logging
from collections.abc import Iterator

import numpy as np

from dhkit.description import Array, Description
from dhkit.display import counted
from dhkit.report.document import Block, Figure, Heading, Image, Paragraph, Prompt, Table
from dhkit.report.pictures import image_png
from dhkit.report.words import joint_values, name_of, number, source_of
from dhkit.viewer.pictures import picture
from dhkit.viewer.scene import first_configuration

log = logging.getLogger(__name__)

_PICTURES = 4
"""Largest number of pictures."""
_SIZE = (960, 760)
"""Size of a picture, px."""


def robot_section(description: Description) -> Iterator[Block]:
    """Yield the section on the robot itself."""
    name = name_of(description)
    yield Heading("The robot")
    yield Prompt(
        "State the purpose of the robot, where its dimensions and masses come from, and how its CAD model was made "
        "(assembly, export of the parts, one file a link)."
    )
    revolute = description.kinds.count("R")
    kinds = [counted(revolute, "revolute joint")] if revolute else []
    if revolute < description.n:
        kinds.append(counted(description.n - revolute, "prismatic joint"))
    source = source_of(description)
    yield Paragraph(
        f"The robot {name} has {' and '.join(kinds)} in one chain. "
        f"{f'Source of the data: {source}. ' if source else ''}"
        f"The sum of its lengths is {number(description.reach)} m."
    )
    yield _joints(description)
    for warning in description.warnings[:4]:
        yield Paragraph(f"Note: {warning}.")
    yield from _pictures(description)


def ready(description: Description) -> tuple[str, Array]:
    """Return the name of the first configuration and its joint values, shape (n,), rad and m."""
    return (
        "ready" if "ready" in description.configurations else "zero",
        first_configuration(description),
    )


def _joints(description: Description) -> Table:
    """Return the table of joints: limits, and what moves."""
    numbers = description.numbers
    rows = []
    for i, joint in enumerate(description.joints):
        factor = 1.0 if numbers.prismatic[i] else 180 / np.pi
        unit = "m" if numbers.prismatic[i] else "°"
        cells = [f"{i + 1} {joint.name}", "prismatic" if numbers.prismatic[i] else "revolute"]
        cells.append(_range(factor * numbers.lower[i], factor * numbers.upper[i], unit))
        cells.append(_limit(factor * numbers.velocity[i], f"{unit}/s"))
        cells.append(_limit(numbers.effort[i], "N" if numbers.prismatic[i] else "N m"))
        cells.append(_limit(numbers.mass[i], "kg"))
        rows.append(tuple(cells))
    return Table(
        ("joint", "type", "range", "speed", "torque", "mass of its link"),
        tuple(rows),
        "Joints: range, largest speed and torque, and the mass of the link that each moves",
        "llrrrr",
    )


def _range(lower: float, upper: float, unit: str) -> str:
    if not np.isfinite(lower) and not np.isfinite(upper):
        return "no limit"
    return f"{number(lower)} to {number(upper)} {unit}".replace(" °", "°")


def _limit(value: float, unit: str) -> str:
    return f"{number(value)} {unit}".replace(" °", "°") if np.isfinite(value) else "none"


def _pictures(description: Description) -> Iterator[Block]:
    """Yield pictures of the first configuration and of others that differ from it, with the DH frames."""
    name, first = ready(description)
    shown = {name: first}
    for other, q in description.numbers.configurations.items():
        if len(shown) < _PICTURES and not any(np.array_equal(q, known) for known in shown.values()):
            shown[other] = q
    if len(shown) == 1:
        shown["moved"] = moved(description, first)
    try:
        images = [
            Image(image_png(picture(description, q, size=_SIZE, frames=True)), label)
            for label, q in shown.items()
        ]
    except (OSError, ValueError) as error:
        log.warning("%s: no pictures in the report: %s", name_of(description), error)
        yield Paragraph(f"Pictures could not be drawn: {error}.")
        return
    values = "; ".join(f"{label}: {joint_values(description, q)}" for label, q in shown.items())
    for k in range(0, len(images), 2):
        pair = tuple(images[k : k + 2])
        caption = (
            f"The robot with its DH frames (x red, y green, z blue). Joint values: {values}"
            if k == 0
            else "Further configurations of the robot"
        )
        yield Figure(pair, caption, 1.0 if len(pair) == 2 else 0.55)


def moved(description: Description, q: Array) -> Array:
    """Return joint values with each joint moved inside its limits, by 1 rad or 0.3 of the reach at most; shape (n,)."""
    numbers = description.numbers
    start = np.clip(q, numbers.lower, numbers.upper)
    distance = np.where(numbers.prismatic, 0.3 * description.reach, 1.0)
    up = np.minimum(distance, 0.8 * (numbers.upper - start))
    down = np.minimum(distance, 0.8 * (start - numbers.lower))
    return np.asarray(start + np.where(up >= down, up, -down))
