"""The report of the benchmark of motions, for people (text, Markdown) and machines (JSON)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from dhkit.bench.benchmark_report import Missing, Report, Table, duration
from dhkit.bench.machine import Machine
from dhkit.display import html_table, repr_line

MEANING = (
    "Over fine: the motion's duration over that of the planner's on the fine mesh, between the same configurations. "
    "Time: of one call that finds it, everything included; the programs are made before, once for an arm, as Programs "
    "says. The fine mesh starts from the usual one's motion. Excess: by what share of a limit of speed or torque a "
    "motion exceeds it at worst, at 10 kHz by Pinocchio."
)


@dataclass(frozen=True)
class MotionRow:
    """The results of one contender at one speed.

    Attributes
    ----------
    speed
        Factor of the robot's speed limits.
    contender
        Name of the contender.
    pairs, found
        Number of pairs of configurations, and of those between which a motion was found.
    mean, most
        Mean and largest ratio of its durations to those of the fine mesh.
    excess
        Largest share by which its motions exceed a limit; negative if they keep all limits.
    seconds, late
        Median time to find a motion, and the time within which 95 % are found, s.
    """

    COLUMNS: ClassVar[tuple[str, ...]] = (
        "motion",
        "found",
        "over fine, mean",
        "max",
        "excess",
        "time, median",
        "95 %",
    )
    speed: float
    contender: str
    pairs: int
    found: int
    mean: float
    most: float
    excess: float
    seconds: float
    late: float

    @property
    def cells(self) -> list[str]:
        """The cells of a row under :attr:`COLUMNS`."""
        return [
            self.contender,
            f"{self.found} of {self.pairs}",
            f"{self.mean:.4f}",
            f"{self.most:.4f}",
            f"{max(self.excess, 0.0):.0e}",
            duration(self.seconds),
            duration(self.late),
        ]


@dataclass(frozen=True)
class MeshBuild:
    """The time to make a planner's program for a number of intervals, s."""

    COLUMNS: ClassVar[tuple[str, ...]] = ("intervals", "time to make")
    intervals: int
    seconds: float

    @property
    def cells(self) -> list[str]:
        """The cells of a row under :attr:`COLUMNS`."""
        return [str(self.intervals), duration(self.seconds)]


@dataclass(frozen=True)
class MotionReport(Report):
    """Motions in least time beside others, for one robot in one process on one core."""

    robot: str
    pairs: int
    """Number of starts and goals at each speed."""
    seed: int
    """Seed of the starts and goals."""
    rows: tuple[MotionRow, ...]
    builds: tuple[MeshBuild, ...]
    missing: tuple[Missing, ...]
    machine: Machine
    interrupted: bool = False

    @property
    def meaning(self) -> str:
        """What the columns mean."""
        return MEANING

    def __repr__(self) -> str:
        return repr_line(
            "MotionReport", self.robot, f"{self.pairs} random pairs, {len(self.rows)} rows"
        )

    @property
    def main_table(self) -> str:
        """The motions, as HTML."""
        rows = [(f"{row.speed:g}", *row.cells) for row in self.rows]
        return html_table(("speed", *MotionRow.COLUMNS), rows, align="rlr")

    @property
    def title(self) -> str:
        """What was measured, in a line."""
        ending = " (interrupted)" if self.interrupted else ""
        return f"{self.robot}: motions in least time beside others, {self.pairs} random pairs, one core{ending}"

    @property
    def tables(self) -> list[Table]:
        """Motions by speed, and the planners' programs."""
        columns: Sequence[str] = MotionRow.COLUMNS
        tables: list[Table] = [
            (_heading(speed), columns, [row.cells for row in self.rows if row.speed == speed])
            for speed in dict.fromkeys(row.speed for row in self.rows)
        ]
        return [
            *tables,
            ("Programs", MeshBuild.COLUMNS, [build.cells for build in self.builds]),
            ("Did not take part", ("who", "why"), [[gap.name, gap.reason] for gap in self.missing]),
        ]


def _heading(speed: float) -> str:
    return "The robot's own limits" if speed == 1 else f"{speed:g} times its speed limits"
