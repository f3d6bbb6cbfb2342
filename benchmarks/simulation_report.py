"""The report of the benchmark of simulation, for people (text, Markdown) and machines (JSON)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from dhkit.bench.benchmark_report import (
    Missing,
    Report,
    Requirement,
    Table,
    duration,
    requirements_text,
)
from dhkit.bench.machine import Machine
from dhkit.display import html_table, repr_line

MEANING = (
    "Times are medians and quartiles over interleaved rounds; per arm and step: a call's time over arms times steps. "
    "Joint error: largest one between reference and joint values. Integration error: of the last joint values and "
    "rates, against eight steps a period of the controller. Audit: energy that nothing accounts for, over the energy "
    "turned over. Ratio: time over that of the first line, within a round. Difference: of the last joint values and "
    "rates from those of dhkit's batch, largest. Error: of the last joint values and rates, against DOP853 with a "
    "tolerance of 1e-13; where torques are held, most of it is the effect of that. Drift: largest change of the "
    "energy over the largest kinetic energy, at the rows or steps that the contender returns."
)


@dataclass(frozen=True)
class Timing:
    """Median and quartiles of the time of a call over the rounds, s."""

    seconds: float
    lower: float
    upper: float

    @property
    def cells(self) -> list[str]:
        """Cells of a row: the median, and the quartiles."""
        return [duration(self.seconds), f"{duration(self.lower)} to {duration(self.upper)}"]


@dataclass(frozen=True)
class SingleRow:
    """One arm under a controller that is called at a rate."""

    COLUMNS: ClassVar[tuple[str, ...]] = (
        "controller",
        "simulated",
        "wall time",
        "quartiles",
        "per step",
        "joint error",
        "integration error",
        "audit",
    )
    controller: str
    simulated: float
    """Simulated time, s."""
    steps: int
    timing: Timing
    joint_error: float
    """Largest error of a joint value from the reference during the run, rad or m."""
    integration_error: float
    audit: float

    @property
    def cells(self) -> list[str]:
        """The cells of a row under :attr:`COLUMNS`."""
        return [
            self.controller,
            f"{self.simulated:g} s",
            *self.timing.cells,
            duration(self.timing.seconds / self.steps),
            *(f"{error:.1e}" for error in (self.joint_error, self.integration_error, self.audit)),
        ]


@dataclass(frozen=True)
class BatchRow:
    """Many arms in one call, or one arm in a peer's loop."""

    COLUMNS: ClassVar[tuple[str, ...]] = (
        "contender",
        "arms",
        "per arm and step",
        "quartiles",
        "ratio",
        "difference",
    )
    contender: str
    arms: int
    each: Timing
    """Time of one arm's step."""
    ratio: float
    """Time of one arm's step over that of dhkit's batch on one thread that keeps the last states."""
    difference: float | None
    """Largest difference of the last states from dhkit's; None for dhkit itself."""

    @property
    def cells(self) -> list[str]:
        """The cells of a row under :attr:`COLUMNS`."""
        difference = "" if self.difference is None else f"{self.difference:.0e}"
        return [self.contender, str(self.arms), *self.each.cells, f"{self.ratio:.3g}", difference]


@dataclass(frozen=True)
class IntegrationRow:
    """The errors of a contender's solution of a problem, and its time."""

    COLUMNS: ClassVar[tuple[str, ...]] = (
        "contender",
        "wall time",
        "quartiles",
        "per simulated second",
        "error [rad]",
        "error [rad/s]",
        "drift",
    )
    problem: str
    contender: str
    simulated: float
    """Simulated time, s."""
    timing: Timing
    joint_error: float
    """Largest error of the last joint values, rad or m."""
    rate_error: float
    """Largest error of the last rates, rad/s or m/s."""
    drift: float | None
    """Largest change of the energy over the largest kinetic energy; None where torques do work."""

    @property
    def cells(self) -> list[str]:
        """The cells of a row under :attr:`COLUMNS`."""
        return [
            self.contender,
            *self.timing.cells,
            duration(self.timing.seconds / self.simulated),
            f"{self.joint_error:.1e}",
            f"{self.rate_error:.1e}",
            "" if self.drift is None else f"{self.drift:.1e}",
        ]


@dataclass(frozen=True)
class ModelCheck:
    """The difference of a peer's arm from dhkit's."""

    COLUMNS: ClassVar[tuple[str, ...]] = ("peer's model", "difference of accelerations")
    model: str
    difference: float
    """Largest difference from dhkit's accelerations of random states, over the largest acceleration."""

    @property
    def cells(self) -> list[str]:
        """The cells of a row under :attr:`COLUMNS`."""
        return [self.model, f"{self.difference:.1e}"]


@dataclass(frozen=True)
class SimulationReport(Report):
    """Simulation beside peers, for one robot in one process."""

    robot: str
    seed: int
    """Seed of the states at the beginning."""
    repeats: int
    """Number of rounds."""
    single: tuple[SingleRow, ...]
    batch: tuple[BatchRow, ...]
    integration: tuple[IntegrationRow, ...]
    models: tuple[ModelCheck, ...]
    requirements: tuple[Requirement, ...]
    missing: tuple[Missing, ...]
    machine: Machine
    interrupted: bool = False

    @property
    def meaning(self) -> str:
        """What the columns mean."""
        return MEANING

    def __repr__(self) -> str:
        return repr_line(
            "SimulationReport",
            self.robot,
            f"{self.repeats} rounds, {requirements_text(self.requirements)}",
        )

    @property
    def main_table(self) -> str:
        """Many arms in one call, as HTML."""
        return html_table(BatchRow.COLUMNS, [row.cells for row in self.batch], align="lr")

    @property
    def title(self) -> str:
        """What was measured, in a line."""
        ending = " (interrupted)" if self.interrupted else ""
        return f"{self.robot}: simulation beside peers, {self.repeats} rounds{ending}"

    @property
    def tables(self) -> list[Table]:
        """Requirements, one arm, many arms, errors beside times."""
        tables: list[Table] = [
            (
                "Required",
                ("what", "required", "measured", ""),
                [list(line.cells) for line in self.requirements],
            ),
            ("One arm, called at 1 kHz", SingleRow.COLUMNS, [row.cells for row in self.single]),
            (
                "Many arms, PD plus gravity at 1 kHz",
                BatchRow.COLUMNS,
                [row.cells for row in self.batch],
            ),
        ]
        tables += [
            (
                problem,
                IntegrationRow.COLUMNS,
                [row.cells for row in self.integration if row.problem == problem],
            )
            for problem in dict.fromkeys(row.problem for row in self.integration)
        ]
        tables += [
            ("Same arm", ModelCheck.COLUMNS, [check.cells for check in self.models]),
            (
                "Did not take part",
                ("quantity", "who", "why"),
                [[gap.quantity, gap.name, gap.reason] for gap in self.missing],
            ),
        ]
        return tables
