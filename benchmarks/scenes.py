"""Random scenes among obstacles that another planner solves (`make bench`): benchmarks/results/scenes.md, .json.

Each scene has 3 to 10 boxes and spheres, and the straight joint path collides. A scene counts if OMPL finds a path. Our
motion is certified at 5 kHz, and compared with the best of motions that start from paths of OMPL by other seeds.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, ClassVar

import numpy as np

from benchmarks.command import publish, tell
from benchmarks.peers.ompl import SampledPaths
from dhkit.bench.benchmark_report import Report, Table, duration
from dhkit.bench.machine import Machine
from dhkit.description import Array, Description, library_robot
from dhkit.display import html_table, repr_line
from dhkit.dynamics import gravity_torque
from dhkit.errors import PlanningError
from dhkit.planning import Obstacle, Planner, distance
from dhkit.planning.certificate import Checker
from dhkit.planning.criteria import Limit, States, loaded
from dhkit.trajectories import Trajectory

RESULT = Path(__file__).parent / "results" / "scenes"
ARMS = ("ur5", "panda", "puma560")
CLEARANCE = 0.02
"""m."""
END_CLEARANCE = 0.03
"""Distance from obstacles at the ends, m."""
RANGE = 3.0
"""Largest magnitude of a joint value at an end, rad."""
MAX_HOLDING_SHARE = 0.9
"""Largest share of the torque limits that holds an arm at an end."""
PEER_SECONDS = 20.0
"""Time limit of OMPL, s."""
TIME_LIMIT = 30.0
"""Time limit of a motion, s."""
CHECK_RATE = 5000.0
"""Samples of a motion per second at which it is certified, Hz."""
TIME_SHARE = 0.05
"""Excess over the best motion that is accepted."""
ROUNDING = 1e-6
"""Shortfall of a distance (m), or excess of a limit, that counts as none."""
PATH_SPEED = 0.5
"""Share of the speed limits with which a path of OMPL is followed, as a start."""


@dataclass(frozen=True)
class SceneKind:
    """Which scenes are generated."""

    robot: str
    counts: tuple[int, int] = (3, 10)
    """Smallest and largest number of obstacles."""
    has_boxes: bool = True
    """Whether half of the obstacles are boxes; else all are spheres."""
    self_collision: bool = False
    """Whether links keep the clearance from each other too."""

    @property
    def name(self) -> str:
        """The robot, and what is special."""
        spheres = "" if self.has_boxes else f", {self.counts[1]} spheres"
        return f"{self.robot}{spheres}{' and itself' * self.self_collision}"


KINDS = {
    "mixed": tuple(SceneKind(robot) for robot in ARMS),
    "spheres": tuple(SceneKind(robot, (10, 10), has_boxes=False) for robot in ("ur5", "panda")),
    "itself": tuple(
        SceneKind(robot, (10, 10), has_boxes=False, self_collision=True) for robot in ARMS
    ),
}
"""Kinds of scenes by name: 3 to 10 boxes and spheres, ten spheres, and ten spheres with self-collision."""


@dataclass(frozen=True)
class Scene:
    """Obstacles, and two configurations between which the straight joint path collides."""

    obstacles: tuple[Obstacle, ...]
    start: Array
    goal: Array


def scenes(kind: SceneKind, seed: int) -> Iterator[Scene]:
    """Yield random scenes without end."""
    description = library_robot(kind.robot)
    rng, numbers = np.random.default_rng(seed), description.numbers
    lower, upper = np.maximum(numbers.lower, -RANGE), np.minimum(numbers.upper, RANGE)
    while True:
        count, obstacles = int(rng.integers(kind.counts[0], kind.counts[1] + 1)), list[Obstacle]()
        while len(obstacles) < count:
            at = rng.uniform(-1, 1, 3) * description.reach
            at[2] = abs(at[2]) + 0.1
            if np.linalg.norm(at[:2]) < 0.25 * description.reach:
                continue
            if kind.has_boxes and rng.uniform() < 0.5:
                obstacles.append(Obstacle.box(rng.uniform(0.1, 0.3, 3), at))
            else:
                obstacles.append(Obstacle.sphere(rng.uniform(0.05, 0.15), at))
        states = rng.uniform(lower, upper, (200, description.n))
        gaps = distance(description, states, obstacles, kind.self_collision).distance
        clear = states[gaps > END_CLEARANCE]
        held = np.abs(gravity_torque(description, clear)) < MAX_HOLDING_SHARE * numbers.effort
        clear = clear[held.all(axis=1)]
        if len(clear) < 2:
            continue
        way = clear[0] + np.linspace(0, 1, 60)[:, None] * (clear[1] - clear[0])
        if distance(description, way, obstacles).distance.min() < CLEARANCE:
            yield Scene(tuple(obstacles), clear[0], clear[1])


@dataclass(frozen=True)
class SceneResult:
    """One scene.

    Attributes
    ----------
    obstacles
        Their number.
    peer_seconds
        Time in which OMPL found a path, s.
    seconds, duration
        Time in which the motion was found, and the motion's own, s; infinite if none was found.
    best
        Duration of the best motion from other starts, s; infinite if none was tried.
    shortfall
        Smallest distance below the clearance on a grid of 5 kHz, m.
    excess
        Largest share by which a limit is exceeded there.
    reason
        Why no motion was found.
    """

    robot: str
    obstacles: int
    peer_seconds: float
    seconds: float
    duration: float
    best: float
    shortfall: float
    excess: float
    reason: str = ""


@dataclass(frozen=True)
class SceneReport(Report):
    """Motions among obstacles in scenes that OMPL solves."""

    COLUMNS: ClassVar[tuple[str, ...]] = (
        "robot",
        "solved",
        "time, median",
        "95 %",
        "max",
        "within 5 % of the best start",
        "OMPL's path, median",
    )
    results: tuple[SceneResult, ...]
    starts: int
    machine: Machine
    interrupted: bool = False

    def json(self) -> dict[str, object]:
        """Return the report as plain data for JSON; None for a motion that was not found."""
        data = super().json()
        for result in data["results"]:  # type: ignore[attr-defined]
            for name, value in result.items():
                if isinstance(value, float) and not np.isfinite(value):
                    result[name] = None
        return data

    @property
    def _rows(self) -> list[list[str]]:
        return [
            self._row(name)
            for name in (*dict.fromkeys(result.robot for result in self.results), "all")
        ]

    def _row(self, robot: str) -> list[str]:
        chosen = [result for result in self.results if robot in (result.robot, "all")]
        found = [result for result in chosen if np.isfinite(result.duration)]
        compared = [result for result in chosen if np.isfinite(result.best)]
        near = sum(result.duration <= (1 + TIME_SHARE) * result.best for result in compared)
        middle, late, most = np.quantile([result.seconds for result in chosen], [0.5, 0.95, 1.0])
        return [
            robot,
            f"{len(found)} of {len(chosen)}",
            *(duration(float(value)) for value in (middle, late, most)),
            f"{near} of {len(compared)}",
            duration(float(np.median([result.peer_seconds for result in chosen]))),
        ]

    @property
    def tables(self) -> list[Table]:
        """Scenes by robot, and those without a motion."""
        failed = [
            [result.robot, str(result.obstacles), result.reason]
            for result in self.results
            if result.reason
        ]
        tables: list[Table] = [("Scenes", self.COLUMNS, self._rows)]
        return tables + (
            [("Without a motion", ("robot", "obstacles", "why"), failed)] if failed else []
        )

    @property
    def meaning(self) -> str:
        """What the columns mean."""
        short, over = (
            max(getattr(result, name) for result in self.results)
            for name in ("shortfall", "excess")
        )
        return (
            f"Motions in least time, {1000 * CLEARANCE:g} mm clear. Time: of one call, with the planner made before. "
            f"At {CHECK_RATE:g} Hz the motions come at most {max(short, 0.0):.0e} m nearer than that, by coal, and "
            f"exceed limits by at most {max(over, 0.0):.0e} of them, by Pinocchio. The best start: of {self.starts} "
            "more motions, each started from another path of OMPL beside our own starts."
        )

    def __repr__(self) -> str:
        return repr_line("SceneReport", summary=f"{len(self.results)} scenes")

    @property
    def main_table(self) -> str:
        """The scenes by robot, as HTML."""
        return html_table(self.COLUMNS, self._rows, align="lr")

    @property
    def title(self) -> str:
        """What was measured, in a line."""
        ending = " (interrupted)" if self.interrupted else ""
        return f"motions among obstacles, {len(self.results)} scenes that OMPL solves{ending}"


def compare_scenes(
    count: int = 200,
    *,
    kinds: Sequence[SceneKind] = KINDS["mixed"],
    compared: int = 40,
    starts: int = 20,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> SceneReport:
    """Plan motions among obstacles.

    Parameters
    ----------
    count
        Number of scenes of all arms.
    kinds
        Kinds of scenes, taken in turn.
    compared
        Number of scenes whose motions are compared with those from other starts.
    starts
        Number of other starts.
    seed
        Of the scenes.
    progress
        Gets a line after each scene.

    Returns
    -------
    SceneReport
        What was measured; when interrupted from the keyboard, what was measured until then.
    """
    tell = progress or (lambda line: None)
    planners = [Planner(library_robot(kind.robot)) for kind in kinds]
    sources = [scenes(kind, seed) for kind in kinds]
    for kind, planner in zip(kinds, planners, strict=True):
        first = next(scenes(kind, seed))
        planner.solve(first.start, first.goal)  # imports, and the program
    results: list[SceneResult] = []
    interrupted = False
    try:
        while len(results) < count:
            which = len(results) % len(kinds)
            given = starts if len(results) < compared else 0
            found = _scene(kinds[which], planners[which], next(sources[which]), given)
            if found is not None:
                results.append(found)
                ratio = (
                    ""
                    if np.isinf(found.best)
                    else f", {found.duration / found.best:.3f} of the best"
                )
                took = f"{found.seconds:.2f} s, {found.duration:.3f} s{ratio}"
                tell(f"{len(results)}: {found.robot}, {took} {found.reason}")
    except KeyboardInterrupt:
        interrupted = True
    return SceneReport(tuple(results), starts, Machine.here(), interrupted)


def _scene(kind: SceneKind, planner: Planner, scene: Scene, starts: int) -> SceneResult | None:
    """Return the result of one scene; None if OMPL does not solve it."""
    description = planner.description
    sampled = SampledPaths(description, list(scene.obstacles), CLEARANCE, kind.self_collision)
    begin = perf_counter()
    if sampled.path(scene.start, scene.goal, PEER_SECONDS) is None:
        return None
    peer_seconds = perf_counter() - begin
    options: dict[str, Any] = {
        "obstacles": scene.obstacles,
        "clearance": CLEARANCE,
        "self_collision": kind.self_collision,
        "time_limit": TIME_LIMIT,
    }
    begin, motion, reason = perf_counter(), None, ""
    try:
        motion = planner.solve(scene.start, scene.goal, **options)
    except PlanningError as error:
        reason = str(error)
    seconds = perf_counter() - begin
    best = np.inf
    for _ in range(starts):
        path = sampled.path(scene.start, scene.goal, PEER_SECONDS)
        if path is None:
            continue
        try:
            best = min(
                best,
                planner.solve(
                    scene.start, scene.goal, warm=along_path(description, path), **options
                ).duration,
            )
        except PlanningError:
            continue
    if motion is None:
        lost = (np.inf, best, -np.inf, -np.inf, reason)
        return SceneResult(kind.name, len(scene.obstacles), peer_seconds, seconds, *lost)
    if starts:
        best = min(best, motion.duration)
    return SceneResult(
        kind.name,
        len(scene.obstacles),
        peer_seconds,
        seconds,
        motion.duration,
        best,
        *_certified(kind, planner, motion, scene.obstacles),
    )


def along_path(description: Description, path: Array) -> Trajectory:
    """Return a motion along a path, at rest at its ends."""
    steps = np.max(np.abs(np.diff(path, axis=0)) / description.numbers.velocity, axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    x = np.linspace(0.0, 1.0, 200)
    s = along[-1] * x * x * (3 - 2 * x)
    q = np.stack([np.interp(s, along, column) for column in path.T], axis=1)
    times = along[-1] / PATH_SPEED * x
    qd = np.gradient(q, times, axis=0)
    qd[[0, -1]] = 0.0
    return Trajectory.from_samples(description, times, q, qd)


def _certified(
    kind: SceneKind, planner: Planner, motion: Trajectory, obstacles: Sequence[Obstacle]
) -> tuple[float, float]:
    """Return what is missing of the clearance, m, and by what share a limit is exceeded, at 5 kHz."""
    arm = loaded(planner.description)
    t = np.append(np.arange(0.0, motion.duration, 1 / CHECK_RATE), motion.duration)
    states = States(arm, t, motion.q(t), motion.qd(t), motion.qdd(t))
    uses = Checker(arm, planner.limits).measured(states)
    over = max(float(use.max()) - 1 for limit, use in uses.items() if limit != Limit.POSITION)
    gaps = distance(planner.description, states.q, obstacles, kind.self_collision)
    gap = float(np.min(gaps.distance))
    return CLEARANCE - gap, over


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark, write its report and print it."""
    parser = argparse.ArgumentParser(
        description="Motions among obstacles in scenes that OMPL solves."
    )
    parser.add_argument("--scenes", type=int, default=200, help="number of scenes (default: 200)")
    parser.add_argument(
        "--compared", type=int, default=40, help="scenes compared with other starts (default: 40)"
    )
    parser.add_argument(
        "--kind", choices=[*KINDS], default="mixed", help="kind of scenes (default: mixed)"
    )
    parser.add_argument(
        "--starts", type=int, default=20, help="number of other starts (default: 20)"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--output", type=Path, default=RESULT, help="path of the results, without ending"
    )
    chosen = parser.parse_args(arguments)
    report = compare_scenes(
        chosen.scenes,
        kinds=KINDS[chosen.kind],
        compared=chosen.compared,
        starts=chosen.starts,
        seed=chosen.seed,
        progress=tell,
    )
    publish(report, chosen.output)


if __name__ == "__main__":
    main()
