"""Cases in which planners are slow or fail (`make bench`): benchmarks/results/planning_cases.md and .json.

Each row has at least 20 motions, their median, 95 % and longest time to be found, and the time that is wanted.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, ClassVar

import numpy as np

from benchmarks.command import publish, tell
from benchmarks.planning import holdable_pairs
from dhkit.bench.benchmark_report import Report, Table, duration
from dhkit.bench.machine import Machine
from dhkit.bench.rounds import calm
from dhkit.description import Payload, library_robot
from dhkit.description.frames import world_to_tool
from dhkit.display import html_table, repr_line
from dhkit.errors import PlanningError
from dhkit.planning import Effort, Floor, Obstacle, Planner
from dhkit.trajectories import Limits, Trajectory

RESULT = Path(__file__).parent / "results" / "planning_cases"
ARMS = ("puma560", "ur5", "panda", "planar2r", "cobra600")
OBJECTIVES = ("time", "effort", "energy", "jerk")
TIME_LIMIT = 30.0
"""Time limit of a motion, s."""
NEAR_LEAST = 1.03
"""Duration of smooth motions over the least one."""
PUBLISHED_ENERGY = 20.4044
"""Least integral of the squared voltages of the Manutec r3's motion of 0.53 s, V^2 s (von Stryk & Schlemmer 1994)."""
VOLTAGE = 1 / np.array([126.0, 252.0, 72.0])
"""V per N m of the Manutec r3's drives."""
FIRST_MOTION = """
from dhkit import Arm
motion = Arm.load("puma560").plan([0, 0.8, -1.0, 0, 0.5, 0], [1.2, 0.3, -0.8, 0.5, -0.6, {last}])
assert motion.report.certificate.ok
"""

Case = Callable[[], Trajectory | None]
"""Finds one motion, or raises PlanningError; None where only the time counts."""


@dataclass(frozen=True)
class CaseRow:
    """Motions of one kind.

    Attributes
    ----------
    case
        What they are.
    motions, found
        Number of motions, and of those that were found and certified.
    median, late, longest
        Median time to find one, the time within which 95 % are found, and the longest time, s.
    wanted
        What is wanted, as text.
    met
        Whether it was seen.
    """

    COLUMNS: ClassVar[tuple[str, ...]] = (
        "case",
        "found",
        "time, median",
        "95 %",
        "max",
        "wanted",
        "met",
    )
    case: str
    motions: int
    found: int
    median: float
    late: float
    longest: float
    wanted: str
    met: bool

    @property
    def cells(self) -> list[str]:
        """The cells of a row under :attr:`COLUMNS`."""
        times = (self.median, self.late, self.longest)
        found = f"{self.found} of {self.motions}"
        return [
            self.case,
            found,
            *(duration(time) for time in times),
            self.wanted,
            "yes" if self.met else "no",
        ]


@dataclass(frozen=True)
class CaseReport(Report):
    """Cases in which planners are slow or fail, in one process."""

    rows: tuple[CaseRow, ...]
    machine: Machine
    interrupted: bool = False

    @property
    def meaning(self) -> str:
        """What the columns mean."""
        return MEANING

    def __repr__(self) -> str:
        return repr_line("CaseReport", summary=f"{len(self.rows)} rows")

    @property
    def main_table(self) -> str:
        """The cases, as HTML."""
        return html_table(CaseRow.COLUMNS, [tuple(row.cells) for row in self.rows], align="lr")

    @property
    def title(self) -> str:
        """What was measured, in a line."""
        return f"planning, hard cases{' (interrupted)' if self.interrupted else ''}"

    @property
    def tables(self) -> list[Table]:
        """The cases."""
        return [("Cases", CaseRow.COLUMNS, [row.cells for row in self.rows])]


MEANING = (
    "Time: of one call that finds a motion, with its certificate by Pinocchio; "
    "first calls make their programs too."
)


def measure_cases(
    pairs: int = 25,
    *,
    only: str = "",
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> CaseReport:
    """Measure all cases.

    Parameters
    ----------
    pairs
        Number of random pairs for each arm, objective and choice of friction.
    only
        Part of the names of the cases to measure; all unless given.
    seed
        Of the random pairs.
    progress
        Gets a line after each row.

    Returns
    -------
    CaseReport
        What was measured; when interrupted from the keyboard, what was measured until then.
    """
    tell = progress or (lambda line: None)
    rows: list[CaseRow] = []
    interrupted = False
    with calm():
        try:
            for case, wanted, most, motions in _cases(pairs, seed):
                if only in case:
                    rows.append(_measured(case, wanted, most, motions))
                    tell("  ".join(rows[-1].cells))
        except KeyboardInterrupt:
            interrupted = True
    return CaseReport(tuple(rows), Machine.here(), interrupted)


def _measured(case: str, wanted: str, most: float, motions: Iterator[Case]) -> CaseRow:
    """Return the row of motions; ``most`` is the longest time that is wanted, s."""
    seconds, found = [], 0
    for find in motions:
        begin = perf_counter()
        try:
            motion = find()
            found += motion is None or motion.report.certificate.ok
        except PlanningError as error:
            print(f"{case}: {error}", file=sys.stderr)
        seconds.append(perf_counter() - begin)
    middle, late, longest = (float(value) for value in np.quantile(seconds, [0.5, 0.95, 1.0]))
    return CaseRow(
        case,
        len(seconds),
        found,
        middle,
        late,
        longest,
        wanted,
        found == len(seconds) and late <= most,
    )


def _cases(pairs: int, seed: int) -> Iterator[tuple[str, str, float, Iterator[Case]]]:
    """Yield names, what is wanted, the longest time for 95 %, s, and motions."""
    for count in (0, 1, 3, 5, 10):
        yield (
            f"ur5, first motion with {count} obstacles far away",
            "1.3 times that with none",
            np.inf,
            _first(count),
        )
    yield "panda, first motion", "program 0.7 s", 0.7 + 0.5, _first_of_panda(seed)
    yield "box, table and payload, ur5, first", "3 s", 3.0, _beside_table(is_first=True)
    yield "box, table and payload, ur5, again", "1.5 s", 1.5, _beside_table(is_first=False)
    for objective in OBJECTIVES[1:]:
        yield (
            f"planar2r, {objective} at 1.03 times the least time",
            "none fails",
            np.inf,
            _near_least(objective),
        )
    yield (
        "manutec_r3, energy at 0.53 s, 24 to 81 intervals",
        "within 0.1 % of the published",
        np.inf,
        _manutec(),
    )
    yield "planar2r, moves of 1e-9 to 1e-2 rad", "0.2 s", 0.2, _small_moves()
    yield "panda, three times its speeds", "0.5 s", 0.5, _fast_panda(seed)
    yield "panda, goal a pose, first motion", "1 s", 1.0, _pose_goals(seed)
    yield "puma560, new process, nothing compiled", "2.5 s", 2.5, _new_processes()
    for name in ARMS:
        for objective in OBJECTIVES:
            for friction in (False, True):
                case = f"{name}, {objective}{', friction' if friction else ''}"
                yield (
                    case,
                    "none fails",
                    np.inf,
                    _random_pairs(name, objective, friction, pairs, seed),
                )


def _first(count: int) -> Iterator[Case]:
    arm = library_robot("ur5")
    start, goal = (
        np.array([0.0, -1.2, 1.5, -1.8, -1.57, 0.0]),
        np.array([1.6, -1.0, 1.2, -1.0, -1.0, 0.5]),
    )
    balls = [Obstacle.sphere(0.05, (3.0, 0.3 * k, 1.0)) for k in range(count)]
    for _ in range(20):
        yield lambda: Planner(arm).solve(start, goal, obstacles=balls)


def _first_of_panda(seed: int) -> Iterator[Case]:
    arm = library_robot("panda")
    for start, goal in holdable_pairs(arm, 20, seed):
        yield lambda start=start, goal=goal: Planner(arm).solve(start, goal)  # type: ignore[misc]


def _beside_table(*, is_first: bool) -> Iterator[Case]:
    """Yield motions with a box between start and goal, above a table."""
    arm, rng = library_robot("ur5"), np.random.default_rng(0)
    planner = Planner(arm)
    for _ in range(20):
        start = np.array([-0.8, -1.2, 1.4, -1.8, -1.57, 0.0]) + rng.uniform(-0.1, 0.1, 6)
        goal = np.array([0.8, -1.2, 1.4, -1.8, -1.57, 0.0]) + rng.uniform(-0.1, 0.1, 6)
        middle = world_to_tool(arm, (start + goal) / 2)[:3, 3]
        box = Obstacle.box((0.08, 0.08, 0.3), middle, name="box")
        options: dict[str, Any] = {
            "obstacles": [box, Floor(-0.05)],
            "payload": Payload(1.0),
            "clearance": 0.01,
            "time_limit": TIME_LIMIT,
        }

        def find(start: Any = start, goal: Any = goal, options: Any = options) -> Trajectory:
            return (Planner(arm) if is_first else planner).solve(start, goal, **options)

        if not is_first:
            find()
        yield find


def _near_least(objective: str) -> Iterator[Case]:
    arm = library_robot("planar2r")
    quick, planner = Planner(arm), Planner(arm, objective)
    for start, goal in holdable_pairs(arm, 20, 1):
        least = quick.solve(start, goal).duration
        yield lambda a=start, b=goal, t=NEAR_LEAST * least: planner.solve(a, b, duration=t)  # type: ignore[misc]


def _manutec() -> Iterator[Case]:
    arm = library_robot("manutec_r3")
    start, goal = (arm.numbers.configurations[name] for name in ("start", "goal"))

    def solve(intervals: int) -> Trajectory:
        planner = Planner(arm, Effort(joint_weights=tuple(VOLTAGE**2)), intervals=intervals)
        motion = planner.solve(start, goal, duration=0.53)
        if abs(motion.report.cost / PUBLISHED_ENERGY - 1) > 1e-3:
            raise PlanningError(f"{intervals} intervals: {motion.report.cost:.5g} V^2 s")
        return motion

    for intervals in range(24, 84, 3):
        yield lambda intervals=intervals: solve(intervals)  # type: ignore[misc]


def _small_moves() -> Iterator[Case]:
    arm = library_robot("planar2r")
    planner, start = Planner(arm), np.array([0.3, 0.5])
    planner.solve(start, start + 0.3)
    for size in np.geomspace(1e-9, 1e-2, 22):
        for direction in ((1.0, 1.0), (1.0, -0.5)):
            goal = start + size * np.array(direction)
            yield lambda goal=goal: planner.solve(start, goal)  # type: ignore[misc]


def _fast_panda(seed: int) -> Iterator[Case]:
    arm = library_robot("panda")
    planner, limits = Planner(arm), Limits.of(arm).scaled(velocity=3.0)
    pairs = holdable_pairs(arm, 41, seed)
    planner.solve(*pairs[0], limits=limits)
    for start, goal in pairs[1:]:
        yield lambda start=start, goal=goal: planner.solve(start, goal, limits=limits)  # type: ignore[misc]


def _pose_goals(seed: int) -> Iterator[Case]:
    arm = library_robot("panda")
    for start, goal in holdable_pairs(arm, 20, seed):
        T = world_to_tool(arm, goal)
        yield lambda start=start, T=T: Planner(arm).solve(start, T)  # type: ignore[misc]


def _new_processes() -> Iterator[Case]:
    for k in range(20):
        with tempfile.TemporaryDirectory() as folder:
            environment = {**os.environ, "DHKIT_CACHE_DIR": folder}
            program = [sys.executable, "-c", FIRST_MOTION.format(last=1.0 - 0.05 * k)]

            def find(
                program: list[str] = program, environment: dict[str, str] = environment
            ) -> None:
                subprocess.run(program, env=environment, check=True)

            yield find


def _random_pairs(
    name: str, objective: str, friction: bool, pairs: int, seed: int
) -> Iterator[Case]:
    arm = library_robot(name)
    planner = Planner(arm, objective, friction=friction)
    for start, goal in holdable_pairs(arm, pairs, seed):
        yield lambda a=start, b=goal: planner.solve(a, b, time_limit=TIME_LIMIT)  # type: ignore[misc]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark, write its report and print it."""
    parser = argparse.ArgumentParser(description="Cases in which planners are slow or fail.")
    parser.add_argument(
        "--pairs", type=int, default=25, help="random pairs for each kind (default: 25)"
    )
    parser.add_argument("--only", default="", help="part of the names of the cases to measure")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--output", type=Path, default=RESULT, help="path of the results, without ending"
    )
    chosen = parser.parse_args(arguments)
    report = measure_cases(
        chosen.pairs,
        only=chosen.only,
        seed=chosen.seed,
        progress=tell,
    )
    publish(report, chosen.output)


if __name__ == "__main__":
    main()
