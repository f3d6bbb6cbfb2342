"""Motions in least time beside classical ones and toppra's (`make bench`): benchmarks/results/planning.md, .json.

How long the motions take, and how long it takes to find them. Takes some minutes; ``--pairs 3`` for a look.
"""

from __future__ import annotations

import argparse
import gc
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Protocol

import numpy as np

from benchmarks.motion_report import MeshBuild, MotionReport, MotionRow
from benchmarks.peers.toppra import StraightTiming
from dhkit.bench.contenders import UnavailableError
from dhkit.bench.machine import Machine
from dhkit.bench.report import Missing
from dhkit.bench.rounds import calm
from dhkit.cli.bench import write
from dhkit.description import Array, Description, library_robot
from dhkit.dynamics import gravity_torque
from dhkit.errors import PlanningError
from dhkit.planning import Planner
from dhkit.planning.certificate import Checker
from dhkit.planning.states import States
from dhkit.trajectories import Limits, Trajectory, quintic, trapezoidal

RESULT = Path(__file__).parent / "results" / "planning"
SPEEDS = (1.0, 3.0)
"""Times the robot's own speed limits: at three times those of the PUMA, torques count as well."""
MESHES = (24, 32, 48)
FINER = 4
"""Times the usual intervals: what the others are held against."""
FINE_SECONDS = 120.0
"""s a motion on the fine mesh may take."""
HELD = 0.95
"""Of their limits that torques may need to hold an arm."""
RATE = 1e4
"""Hz: where motions are held against their limits."""
BUILDS = 3

Progress = Callable[[str], None]


class Motion(Protocol):
    """What every contender comes to."""

    @property
    def duration(self) -> float:
        """In s."""
        ...

    def q(self, t: Array) -> Array:
        """Return joint values, shape (N, n)."""
        ...

    def qd(self, t: Array) -> Array:
        """Return velocities, likewise."""
        ...

    def qdd(self, t: Array) -> Array:
        """Return accelerations, likewise."""
        ...


Mover = Callable[[Array, Array, Limits], Motion]
"""From a start, a goal and limits to a motion."""


@dataclass(frozen=True)
class _Sample:
    """One motion of one contender; a duration is infinite where it found none."""

    speed: float
    contender: str
    pair: int
    duration: float
    excess: float
    seconds: float


def compare_motions(
    description: Description,
    pairs: int = 30,
    *,
    meshes: Sequence[int] = MESHES,
    intervals: int | None = None,
    speeds: Sequence[float] = SPEEDS,
    seed: int = 0,
    progress: Progress | None = None,
) -> MotionReport:
    """Time motions between random configurations, in one process on one core, contenders in turns.

    Parameters
    ----------
    description
        The robot, with bodies and limits of speed and torque.
    pairs
        Starts and goals at each speed, the same ones.
    meshes
        Intervals that the planner is tried with.
    intervals
        Of its usual mesh, in place of the planner's own; the fine one has four times as many.
    speeds
        Times the robot's speed limits.
    seed
        Of the pairs.
    progress
        Gets a line before each step.

    Returns
    -------
    MotionReport
        What was measured; when interrupted from the keyboard, what was measured until then.
    """
    tell = progress or (lambda line: None)
    machine = Machine.here()
    usual = intervals or Planner(description).intervals
    counts = sorted({*meshes, usual} - {FINER * usual})
    samples: list[_Sample] = []
    builds: list[MeshBuild] = []
    missing: list[Missing] = []
    interrupted = False
    with calm(), _one_core():
        try:
            start, goal = holdable_pairs(description, 1, seed)[0]
            Planner(description, intervals=min(counts)).solve(start, goal)  # imports
            planners = {}
            for count in (*counts, FINER * usual):
                tell(f"building {count} intervals")
                planners[count], seconds = _built(description, count)
                builds.append(MeshBuild(count, seconds))
            movers = _movers(description, {count: planners[count] for count in counts}, usual, missing)
            for speed in speeds:
                limits = Limits.of(description).scaled(velocity=speed)
                for k, (start, goal) in enumerate(holdable_pairs(description, pairs, seed)):
                    tell(f"speeds x {speed:g}: pair {k + 1} of {pairs}")
                    gc.collect()
                    samples += _pair(movers, planners[FINER * usual], start, goal, limits, speed, k)
        except KeyboardInterrupt:
            interrupted = True
    rows = tuple(row for speed in speeds for row in _rows([s for s in samples if s.speed == speed], usual))
    return MotionReport(description.name, pairs, seed, rows, tuple(builds), tuple(missing), machine, interrupted)


def holdable_pairs(description: Description, count: int, seed: int) -> Array:
    """Return random configurations inside the limits in which the arm can hold itself, shape (count, 2, n)."""
    numbers, rng = description.numbers, np.random.default_rng(seed)
    lower = np.where(np.isfinite(numbers.lower), numbers.lower, -np.pi)
    upper = np.where(np.isfinite(numbers.upper), numbers.upper, np.pi)
    found: list[Array] = []
    while len(found) < 2 * count:
        q = rng.uniform(lower, upper)
        if (np.abs(gravity_torque(description, q)) <= HELD * numbers.effort).all():
            found.append(q)
    return np.array(found).reshape(count, 2, description.n)


@contextmanager
def _one_core() -> Iterator[None]:
    """Keep this process on one core, where the system can."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    own = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(own)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, own)


def _built(description: Description, intervals: int) -> tuple[Planner, float]:
    """Return a planner whose program is made, and how long that took: the median of some."""
    start, goal = holdable_pairs(description, 1, 0)[0]
    seconds = []
    for _ in range(BUILDS):
        planner = Planner(description, intervals=intervals)
        report = planner.solve(start, goal, time_limit=FINE_SECONDS).report
        seconds.append(report.build_seconds)
    return planner, float(np.median(seconds))


def _movers(
    description: Description, planners: dict[int, Planner], usual: int, missing: list[Missing]
) -> dict[str, Mover]:
    """Return who takes part, by name; the planner on its usual mesh first."""

    def planned(planner: Planner) -> Mover:
        return lambda start, goal, limits: planner.solve(start, goal, limits=limits)

    movers = {_name(usual, usual): planned(planners[usual])}
    try:
        timing = StraightTiming(description)
        start, goal = holdable_pairs(description, 1, 0)[0]
        timing(start, goal, Limits.of(description))  # what it does but once
        movers["toppra, straight joint path"] = timing
    except (UnavailableError, PlanningError) as error:
        missing.append(Missing("motions", "toppra", str(error)))
    movers["best trapezoid"] = lambda start, goal, limits: trapezoidal(description, start, goal, limits=limits)
    movers["quintic"] = lambda start, goal, limits: quintic(description, start, goal, limits=limits)
    return movers | {_name(count, usual): planned(p) for count, p in planners.items() if count != usual}


def _name(intervals: int, usual: int) -> str:
    what = {usual: ", its usual mesh", FINER * usual: ", fine"}.get(intervals, "")
    return f"dhkit, {intervals} intervals{what}"


def _pair(
    movers: dict[str, Mover], fine: Planner, start: Array, goal: Array, limits: Limits, speed: float, k: int
) -> Iterator[_Sample]:
    """Yield each contender's motion, the fine one last: it starts from the usual one."""
    warm: Trajectory | None = None

    def finest(start: Array, goal: Array, limits: Limits) -> Motion:
        return fine.solve(start, goal, limits=limits, warm=warm, time_limit=FINE_SECONDS)

    for name, mover in [*movers.items(), (_name(fine.intervals, fine.intervals // FINER), finest)]:
        began = perf_counter()
        try:
            motion = mover(start, goal, limits)
        except PlanningError:
            yield _Sample(speed, name, k, np.inf, np.nan, perf_counter() - began)
            continue
        seconds = perf_counter() - began
        if warm is None and isinstance(motion, Trajectory):
            warm = motion
        yield _Sample(speed, name, k, motion.duration, _excess(fine.description, motion, limits), seconds)


def _excess(description: Description, motion: Motion, limits: Limits) -> float:
    """Return by what share of a limit of speed or torque a motion exceeds it at worst."""
    t = np.append(np.arange(0.0, motion.duration, 1 / RATE), motion.duration)
    states = States(description, t, motion.q(t), motion.qd(t), motion.qdd(t))
    return max(float(use.max()) - 1 for _, use in Checker(description, limits).measured(states))


def _rows(samples: list[_Sample], usual: int) -> Iterator[MotionRow]:
    """Yield a row for each contender, of samples at one speed."""
    best = {s.pair: s.duration for s in samples if s.contender == _name(FINER * usual, usual)}
    for name in dict.fromkeys(s.contender for s in samples):
        own = [s for s in samples if s.contender == name and np.isfinite(best.get(s.pair, np.inf))]
        found = [s for s in own if np.isfinite(s.duration)]
        if not found:
            continue
        over = [s.duration / best[s.pair] for s in found]
        middle, late = np.quantile([s.seconds for s in found], [0.5, 0.95])
        yield MotionRow(
            speed=found[0].speed,
            contender=name,
            pairs=len(own),
            found=len(found),
            mean=float(np.mean(over)),
            most=max(over),
            excess=max(s.excess for s in found),
            seconds=float(middle),
            late=float(late),
        )


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark, write its report and print it."""
    parser = argparse.ArgumentParser(description="Motions in least time beside others.")
    parser.add_argument("--robot", default="puma560", help="of the library (default: puma560)")
    parser.add_argument("--pairs", type=int, default=30, help="random starts and goals (default: 30)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, default=RESULT, help="path of the results, without ending")
    chosen = parser.parse_args(arguments)
    report = compare_motions(
        library_robot(chosen.robot),
        chosen.pairs,
        seed=chosen.seed,
        progress=lambda line: print(line, file=sys.stderr, flush=True),
    )
    for path in write(report, chosen.output):
        print(f"wrote {path}", file=sys.stderr)
    print(report)


if __name__ == "__main__":
    main()
