"""Motions in least time beside classical ones and toppra's (`make bench`): benchmarks/results/planning.md, .json.

How long the motions take, and how long it takes to find them. Takes some minutes; ``--pairs 3`` for a look.
"""

from __future__ import annotations

import argparse
import gc
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Protocol

import numpy as np

from benchmarks.command import publish, tell
from benchmarks.motion_report import MeshBuild, MotionReport, MotionRow
from benchmarks.peers.toppra import StraightTiming
from dhkit.bench.benchmark_report import Missing
from dhkit.bench.contenders import UnavailableError
from dhkit.bench.machine import Machine
from dhkit.bench.rounds import calm
from dhkit.description import Array, Description, library_robot
from dhkit.dynamics import gravity_torque
from dhkit.errors import PlanningError
from dhkit.planning import Planner
from dhkit.planning.certificate import Checker
from dhkit.planning.criteria import Limit, States, loaded
from dhkit.trajectories import Limits, Trajectory, quintic, trapezoidal

RESULT = Path(__file__).parent / "results" / "planning"
SPEEDS = (1.0, 3.0)
"""Factors of the robot's own speed limits: at three times those of the PUMA, torques count as well."""
MESHES = (24, 32, 48)
FINE_FACTOR = 4
"""Intervals of the fine mesh, which the others are compared with, over the usual ones."""
MAX_FINE_TIME = 120.0
"""Longest time of a motion on the fine mesh, s."""
MAX_HOLDING_SHARE = 0.95
"""Largest share of their limits that torques may need to hold an arm."""
CHECK_RATE = 1e4
"""Samples of a motion per second at which its limits are checked, Hz."""
BUILDS = 3
"""Times that a planner's program is made, of which the median counts."""

Progress = Callable[[str], None]


class Motion(Protocol):
    """The motion of a contender."""

    @property
    def duration(self) -> float:
        """Duration, s."""
        ...

    def q(self, t: Array) -> Array:
        """Return joint values at times, shape (N,), s, as shape (N, n)."""
        ...

    def qd(self, t: Array) -> Array:
        """Return rates at times, shape (N,), s, as shape (N, n)."""
        ...

    def qdd(self, t: Array) -> Array:
        """Return accelerations at times, shape (N,), s, as shape (N, n)."""
        ...


Mover = Callable[[Array, Array, Limits], Motion]
"""Returns a motion, given joint values of start and goal, shape (n,) each, and limits."""


@dataclass(frozen=True)
class _Sample:
    """One motion of one contender; the duration is infinite if it found none."""

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
        Number of starts and goals, which are the same at each speed.
    meshes
        Numbers of intervals of the planner's meshes.
    intervals
        Of its usual mesh, instead of the planner's own; the fine one has four times as many.
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
    counts = sorted({*meshes, usual} - {FINE_FACTOR * usual})
    samples: list[_Sample] = []
    builds: list[MeshBuild] = []
    missing: list[Missing] = []
    interrupted = False
    with calm(), _one_core():
        try:
            start, goal = holdable_pairs(description, 1, seed)[0]
            Planner(description, intervals=min(counts)).solve(start, goal)  # imports
            planners = {}
            for count in (*counts, FINE_FACTOR * usual):
                tell(f"building {count} intervals")
                planners[count], seconds = _build_planner(description, count)
                builds.append(MeshBuild(count, seconds))
            movers = _movers(
                description, {count: planners[count] for count in counts}, usual, missing
            )
            for speed in speeds:
                limits = Limits.of(description).scaled(velocity=speed)
                for k, (start, goal) in enumerate(holdable_pairs(description, pairs, seed)):
                    tell(f"speeds x {speed:g}: pair {k + 1} of {pairs}")
                    gc.collect()
                    samples += _pair(
                        movers, planners[FINE_FACTOR * usual], start, goal, limits, speed, k
                    )
        except KeyboardInterrupt:
            interrupted = True
    rows = tuple(
        row for speed in speeds for row in _rows([s for s in samples if s.speed == speed], usual)
    )
    return MotionReport(
        description.name, pairs, seed, rows, tuple(builds), tuple(missing), machine, interrupted
    )


def holdable_pairs(description: Description, count: int, seed: int) -> Array:
    """Return random joint values inside the limits at which the arm can hold itself, shape (count, 2, n), rad and m."""
    numbers, rng = description.numbers, np.random.default_rng(seed)
    lower = np.where(np.isfinite(numbers.lower), numbers.lower, -np.pi)
    upper = np.where(np.isfinite(numbers.upper), numbers.upper, np.pi)
    holdable: list[Array] = []
    while len(holdable) < 2 * count:
        q = rng.uniform(lower, upper)
        if (np.abs(gravity_torque(description, q)) <= MAX_HOLDING_SHARE * numbers.effort).all():
            holdable.append(q)
    return np.array(holdable).reshape(count, 2, description.n)


@contextmanager
def _one_core() -> Iterator[None]:
    """Keep this process on one core, if the system can."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    own = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(own)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, own)


def _build_planner(description: Description, intervals: int) -> tuple[Planner, float]:
    """Return a planner with its program, and the median time of making it, s."""
    start, goal = holdable_pairs(description, 1, 0)[0]
    seconds = []
    for _ in range(BUILDS):
        planner = Planner(description, intervals=intervals)
        report = planner.solve(start, goal, time_limit=MAX_FINE_TIME).report
        seconds.append(report.build_seconds)
    return planner, float(np.median(seconds))


def _movers(
    description: Description, planners: dict[int, Planner], usual: int, missing: list[Missing]
) -> dict[str, Mover]:
    """Return the contenders by name; the planner on its usual mesh is the first."""

    def mover_of(planner: Planner) -> Mover:
        return lambda start, goal, limits: planner.solve(start, goal, limits=limits)

    movers = {_name(usual, usual): mover_of(planners[usual])}
    try:
        timing = StraightTiming(description)
        start, goal = holdable_pairs(description, 1, 0)[0]
        timing(start, goal, Limits.of(description))  # work that it does only once
        movers["toppra, straight joint path"] = timing
    except (UnavailableError, PlanningError) as error:
        missing.append(Missing("motions", "toppra", str(error)))
    movers["best trapezoid"] = lambda start, goal, limits: trapezoidal(
        description, start, goal, limits=limits
    )
    movers["quintic"] = lambda start, goal, limits: quintic(description, start, goal, limits=limits)
    return movers | {
        _name(count, usual): mover_of(p) for count, p in planners.items() if count != usual
    }


def _name(intervals: int, usual: int) -> str:
    mesh = {usual: ", its usual mesh", FINE_FACTOR * usual: ", fine"}.get(intervals, "")
    return f"dhkit, {intervals} intervals{mesh}"


def _pair(
    movers: dict[str, Mover],
    fine: Planner,
    start: Array,
    goal: Array,
    limits: Limits,
    speed: float,
    k: int,
) -> Iterator[_Sample]:
    """Yield each contender's motion; the one on the fine mesh is the last, since it starts from the usual one."""
    warm: Trajectory | None = None

    def finest(start: Array, goal: Array, limits: Limits) -> Motion:
        return fine.solve(start, goal, limits=limits, warm=warm, time_limit=MAX_FINE_TIME)

    for name, mover in [
        *movers.items(),
        (_name(fine.intervals, fine.intervals // FINE_FACTOR), finest),
    ]:
        begin = perf_counter()
        try:
            motion = mover(start, goal, limits)
        except PlanningError:
            yield _Sample(speed, name, k, np.inf, np.nan, perf_counter() - begin)
            continue
        seconds = perf_counter() - begin
        if warm is None and isinstance(motion, Trajectory):
            warm = motion
        yield _Sample(
            speed, name, k, motion.duration, _excess(fine.description, motion, limits), seconds
        )


def _excess(description: Description, motion: Motion, limits: Limits) -> float:
    """Return the largest share by which a motion exceeds a limit of speed or torque; negative if it keeps them."""
    t = np.append(np.arange(0.0, motion.duration, 1 / CHECK_RATE), motion.duration)
    arm = loaded(description)
    states = States(arm, t, motion.q(t), motion.qd(t), motion.qdd(t))
    uses = Checker(arm, limits).measured(states)
    return max(float(use.max()) - 1 for limit, use in uses.items() if limit != Limit.POSITION)


def _rows(samples: list[_Sample], usual: int) -> Iterator[MotionRow]:
    """Yield a row for each contender, of samples at one speed."""
    best = {s.pair: s.duration for s in samples if s.contender == _name(FINE_FACTOR * usual, usual)}
    for name in dict.fromkeys(s.contender for s in samples):
        compared = [
            s for s in samples if s.contender == name and np.isfinite(best.get(s.pair, np.inf))
        ]
        found = [s for s in compared if np.isfinite(s.duration)]
        if not found:
            continue
        ratios = [s.duration / best[s.pair] for s in found]
        middle, late = np.quantile([s.seconds for s in found], [0.5, 0.95])
        yield MotionRow(
            speed=found[0].speed,
            contender=name,
            pairs=len(compared),
            found=len(found),
            mean=float(np.mean(ratios)),
            most=max(ratios),
            excess=max(s.excess for s in found),
            seconds=float(middle),
            late=float(late),
        )


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark, write its report and print it."""
    parser = argparse.ArgumentParser(description="Motions in least time beside others.")
    parser.add_argument("--robot", default="puma560", help="of the library (default: puma560)")
    parser.add_argument(
        "--pairs", type=int, default=30, help="random starts and goals (default: 30)"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--output", type=Path, default=RESULT, help="path of the results, without ending"
    )
    chosen = parser.parse_args(arguments)
    report = compare_motions(
        library_robot(chosen.robot),
        chosen.pairs,
        seed=chosen.seed,
        progress=tell,
    )
    publish(report, chosen.output)


if __name__ == "__main__":
    main()
