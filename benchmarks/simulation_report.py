"""What the benchmark of simulation found, for people (text, Markdown) and machines (JSON)."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, ClassVar

from dhkit.bench.machine import Machine
from dhkit.bench.report import (
    Missing,
    Requirement,
    Table,
    duration,
    listed_values,
    report_html,
    report_markdown,
    report_text,
    standing,
)
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
    """Median and quartiles of a call over the rounds, s."""

    seconds: float
    lower: float
    upper: float

    @property
    def cells(self) -> list[str]:
        """The median, and from which quartile to which."""
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
    """s."""
    steps: int
    timing: Timing
    joint_error: float
    """Largest one between reference and joint values during the run, rad or m."""
    integration_error: float
    audit: float

    @property
    def cells(self) -> list[str]:
        """A line of a table under :attr:`COLUMNS`."""
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

    COLUMNS: ClassVar[tuple[str, ...]] = ("contender", "arms", "per arm and step", "quartiles", "ratio", "difference")
    contender: str
    arms: int
    each: Timing
    """Of one arm's step."""
    ratio: float
    """Time of one arm's step over that of dhkit's batch on one thread that keeps the last states."""
    difference: float | None
    """From the states that dhkit ends in; None for dhkit itself."""

    @property
    def cells(self) -> list[str]:
        """A line of a table under :attr:`COLUMNS`."""
        difference = "" if self.difference is None else f"{self.difference:.0e}"
        return [self.contender, str(self.arms), *self.each.cells, f"{self.ratio:.3g}", difference]


@dataclass(frozen=True)
class IntegrationRow:
    """How exactly a contender solves a problem, and how long that takes."""

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
    """s."""
    timing: Timing
    joint_error: float
    """Of the last joint values, rad or m."""
    rate_error: float
    drift: float | None
    """None where torques do work."""

    @property
    def cells(self) -> list[str]:
        """A line of a table under :attr:`COLUMNS`."""
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
    """Whether a peer simulates the same arm."""

    COLUMNS: ClassVar[tuple[str, ...]] = ("peer's model", "difference of accelerations")
    model: str
    difference: float
    """Largest difference from dhkit's accelerations of random states, over the largest acceleration."""

    @property
    def cells(self) -> list[str]:
        """A line of a table under :attr:`COLUMNS`."""
        return [self.model, f"{self.difference:.1e}"]


@dataclass(frozen=True)
class SimulationReport:
    """Simulation beside peers: one robot, one process."""

    robot: str
    seed: int
    """Of the starts."""
    repeats: int
    """Rounds."""
    single: tuple[SingleRow, ...]
    batch: tuple[BatchRow, ...]
    integration: tuple[IntegrationRow, ...]
    models: tuple[ModelCheck, ...]
    requirements: tuple[Requirement, ...]
    missing: tuple[Missing, ...]
    machine: Machine
    interrupted: bool = False

    def json(self) -> dict[str, Any]:
        """Return everything as what JSON knows."""
        plain = asdict(self)
        for entry, line in zip(plain["requirements"], self.requirements, strict=True):
            entry |= line.derived
        listed: dict[str, Any] = listed_values(plain)
        return listed

    def markdown(self) -> str:
        """Return the report as Markdown."""
        return report_markdown(self._title, self.machine.facts, self._tables, MEANING)

    def __str__(self) -> str:
        return report_text(self._title, self.machine.facts, self._tables, MEANING)

    def __repr__(self) -> str:
        return repr_line("SimulationReport", self.robot, f"{self.repeats} rounds, {standing(self.requirements)}")

    def _repr_html_(self) -> str:
        table = html_table(BatchRow.COLUMNS, [row.cells for row in self.batch], align="lr")
        return report_html(self._title, self.machine.facts, table, self.requirements)

    @property
    def _title(self) -> str:
        ending = " (interrupted)" if self.interrupted else ""
        return f"{self.robot}: simulation beside peers, {self.repeats} rounds{ending}"

    @property
    def _tables(self) -> list[Table]:
        """Headings, columns and cells of the tables that have something to show."""
        tables: list[Table] = [
            ("Required", ("what", "required", "measured", ""), [list(line.cells) for line in self.requirements]),
            ("One arm, called at 1 kHz", SingleRow.COLUMNS, [row.cells for row in self.single]),
            ("Many arms, PD plus gravity at 1 kHz", BatchRow.COLUMNS, [row.cells for row in self.batch]),
        ]
        tables += [
            (problem, IntegrationRow.COLUMNS, [row.cells for row in self.integration if row.problem == problem])
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
        return [table for table in tables if table[2]]
