"""All controllers on one motion of three arms: writes the tables of docs/control.md (`make assets`), in 30 s."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from dhkit.arm import Arm
from dhkit.control import (
    CONTROLLERS,
    ComputedTorque,
    FrictionCompensation,
    Plant,
    SimulationResult,
    compare,
)
from dhkit.description import write_atomically
from dhkit.dynamics import Friction
from dhkit.errors import SimulationError
from dhkit.trajectories import Trajectory

PAGE = Path(__file__).resolve().parents[1] / "docs" / "control.md"
DURATION = 2.0
"""Duration of the motions, s."""
COMPENSATED = "computed-torque, friction compensated"
BEGIN, END = "<!-- benchmarks/controllers.py writes from here -->", "<!-- to here -->"
"""Lines of a Markdown file between which the tables stand."""

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Case:
    """An arm, its motion, and a payload that its controllers do not know of."""

    arm: Arm
    motion: Trajectory
    """A quintic polynomial from rest to rest."""
    payload: float
    """Mass at the tool, kg."""
    text: str
    """Text above the table."""


@dataclass(frozen=True)
class Errors:
    """The errors of an arm under one controller, of the joint that errs most; None if not simulated."""

    peak: float | None
    """Largest error with the right model, rad."""
    rms: float | None
    """Root of the mean square of the same error, rad."""
    final: float | None
    """Error at the end of the motion, rad."""
    tool: float | None
    """Largest distance of the tool from its reference, mm."""
    payload: float | None
    """Largest error with a payload that the controller does not know, rad."""
    friction: float
    """Largest error with the friction of the robot file, rad."""


@cache
def cases() -> tuple[Case, ...]:
    """Return the PUMA 560, two rods, and the second and third link of the seed paper's PUMA 560."""
    puma, rods = Arm.load("puma560"), Arm.load("planar2r")
    links = Arm.load("puma560_cao").lock({0: 0.0, 3: 0.0, 4: 0.0, 5: 0.0})
    return (
        Case(
            puma,
            puma.quintic(puma.configurations["nominal"], puma.configurations["ready"], DURATION),
            2.5,
            "**`puma560`**, from `nominal` to `ready`; the payload is 2.5 kg.",
        ),
        Case(
            rods,
            rods.quintic(np.radians([0, 30]), np.radians([60, 120]), DURATION),
            0.4,
            "**`planar2r`**, two uniform rods, from (0°, 30°) to (60°, 120°); the payload is 0.4 kg.",
        ),
        Case(
            links,
            links.quintic(np.radians([135, 0]), np.radians([75, -60]), DURATION),
            2.5,
            "**`puma560_cao`** with joints 2 and 3 free and the others held at 0, from (135°, 0°) to (75°, -60°); the"
            "\npayload is 2.5 kg.",
        ),
    )


def errors_of(
    case: Case, names: Sequence[str] = tuple(CONTROLLERS), progress: Progress | None = None
) -> dict[str, Errors]:
    """Return the errors of controllers by name, and those of computed torque with its friction compensated.

    Parameters
    ----------
    case
        The arm and its motion.
    names
        Names of controllers in ``CONTROLLERS``.
    progress
        Called with a line before each plant.

    Raises
    ------
    SimulationError
        A controller does not reach the end.
    """
    arm = case.arm
    plants = {
        "right": Plant(arm.description),
        "payload": Plant(arm.with_payload(case.payload).description),
        "friction": Plant(arm.description, Friction()),
    }
    runs: dict[str, dict[str, SimulationResult]] = {}
    for plant_name, plant in plants.items():
        if progress is not None:
            progress(f"{arm.name}: {len(names)} controllers, {plant_name}")
        comparison = compare(arm.description, case.motion, names, plant=plant)
        for name, reason in comparison.failures.items():
            raise SimulationError(f"{arm.name}, {plant_name}: {name}: {reason}")
        runs[plant_name] = dict(comparison.results)
    errors = {
        name: Errors(
            peak=_largest(run),
            rms=float(run.rms_error.max()),
            final=float(np.abs(run.final_error).max()),
            tool=1e3 * run.tool_norms.peak,
            payload=_largest(runs["payload"][name]),
            friction=_largest(runs["friction"][name]),
        )
        for name, run in runs["right"].items()
    }
    compensated = FrictionCompensation(ComputedTorque.tuned(arm))
    friction = _largest(arm.simulate(compensated, case.motion, friction=True))
    return errors | {COMPENSATED: Errors(None, None, None, None, None, friction)}


def _largest(run: SimulationResult) -> float:
    return float(run.peak_error.max())


HEADINGS = {
    "peak": "largest, rad",
    "rms": "RMS, rad",
    "final": "final, rad",
    "tool": "tool, mm",
    "payload": "payload, rad",
    "friction": "friction, rad",
}
"""Headings of the columns, by the fields of ``Errors``."""


def with_tables(text: str, progress: Progress | None = None) -> str:
    """Return a Markdown text with new tables instead of the old ones.

    Raises
    ------
    ValueError
        The text does not have ``BEGIN`` and after it ``END``, once each.
    """
    head, begin, rest = text.partition(BEGIN)
    _, end, tail = rest.partition(END)
    if not (begin and end) or BEGIN in rest or END in tail:
        raise ValueError(f"expected one line {BEGIN!r} and after it one line {END!r}")
    tables = [f"{case.text}\n\n{table(errors_of(case, progress=progress))}" for case in cases()]
    return "\n\n".join([head + BEGIN, *tables, END + tail])


def table(errors: Mapping[str, Errors]) -> str:
    """Return errors, by the names of controllers, as a Markdown table of numbers with two significant digits."""
    rows = [["controller", *HEADINGS.values()], ["---"] * (len(HEADINGS) + 1)]
    rows += [
        [name, *(_text(getattr(row, field)) for field in HEADINGS)] for name, row in errors.items()
    ]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def _text(value: float | None) -> str:
    return "" if value is None else f"{value:#.2g}".rstrip(".")


def main() -> None:
    """Simulate, and write the tables."""
    text = with_tables(
        PAGE.read_text("utf-8"), lambda line: print(line, file=sys.stderr, flush=True)
    )
    write_atomically(PAGE, text)
    print(f"wrote {PAGE}", file=sys.stderr)


if __name__ == "__main__":
    main()
