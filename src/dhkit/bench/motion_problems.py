"""Motions among obstacles between given states: which a planner finds, how long they last, and whether they keep clear.

Links are capsules, given as plain numbers in a file of problems. Motions are judged by formulas of this module:
distances of segments from boxes and points, and torques of inverse dynamics.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dhkit.arm import Arm
from dhkit.description import Array
from dhkit.display import plain, repr_line
from dhkit.errors import DescriptionError, DhkitError
from dhkit.planning import Obstacle
from dhkit.planning.obstacles.capsules import link_capsules
from dhkit.trajectories import Trajectory

_RATE = 1000.0
"""Samples of a motion per second at which it is judged, Hz."""
_ROUNDING = 1e-6
"""Shortfall of a distance, m, or excess of a limit, as a share of it, that counts as none."""
MOTION_COLUMNS = ("arm", "motions found", "longest / known", "clearance left", "time", "why not")
_SAME_SHAPE = 1e-9
"""Difference of the ends or radii of capsules, m, that counts as none."""
_HALVINGS = 60
"""Steps of a golden section search: it ends at 1e-12 of a segment."""
_GOLDEN = (np.sqrt(5.0) - 1) / 2
_REASON = 200
"""Longest reason why a motion was not found, characters."""


@dataclass(frozen=True)
class Capsule:
    """All points within a radius of a segment that moves with a link."""

    link: int
    """Number of the link, from 1, whose frame it is fixed to."""
    start: Array
    end: Array
    """Ends of the segment in that frame, shape (3,), m."""
    radius: float
    """m."""


@dataclass(frozen=True)
class Solid:
    """A sphere or a box at rest, edges along the world's axes."""

    centre: Array
    """Shape (3,), m."""
    radius: float = 0.0
    """Of a sphere, m."""
    size: Array | None = None
    """Edges of a box, shape (3,), m; None for a sphere."""

    @property
    def obstacle(self) -> Obstacle:
        """The solid as dhkit's planner takes it."""
        if self.size is None:
            return Obstacle.sphere(self.radius, self.centre)
        return Obstacle.box(self.size, self.centre)

    def distance(self, points: Array) -> Array:
        """Return the distances of points (..., 3) from the solid, shape (...), m; inside a box they are 0."""
        apart = points - self.centre
        if self.size is not None:
            apart = np.maximum(np.abs(apart) - self.size / 2, 0.0)
        distance: Array = np.linalg.norm(apart, axis=-1) - self.radius
        return distance


@dataclass(frozen=True)
class Scene:
    """Two states, and what lies between them."""

    solids: tuple[Solid, ...]
    start: Array
    goal: Array
    """Shape (n,), rad and m."""
    duration: float
    """Shortest known duration, s."""


@dataclass(frozen=True, eq=False)
class MotionProblems:
    """An arm's scenes.

    Attributes
    ----------
    robot
        Name of the arm in dhkit's library.
    capsules
        The links.
    clearance
        Distance to keep from solids, m.
    lower, upper, speed, torque
        Limits of the joints, shape (n,), rad, m, s, N m and N.
    scenes
        The scenes.
    """

    robot: str
    capsules: tuple[Capsule, ...]
    clearance: float
    lower: Array
    upper: Array
    speed: Array
    torque: Array
    scenes: tuple[Scene, ...]

    @classmethod
    def read(cls, data: Mapping[str, Any]) -> MotionProblems:
        """Return the motions of a file's content; KeyError, TypeError or ValueError where it has not the format."""
        motions = data["motions"]

        def numbers(key: str, missing: float) -> Array:
            given = data["arm"][key] if key in ("lower", "upper") else motions[key]
            return np.array([missing if x is None else x for x in given], dtype=float)

        return cls(
            str(data["arm"]["name"]),
            tuple(
                Capsule(
                    int(one["link"]),
                    _point(one["start"]),
                    _point(one["end"]),
                    float(one["radius"]),
                )
                for one in motions["capsules"]
            ),
            float(motions["clearance"]),
            numbers("lower", -np.inf),
            numbers("upper", np.inf),
            numbers("speed", np.inf),
            numbers("torque", np.inf),
            tuple(
                Scene(
                    tuple(map(_solid, scene["solids"])),
                    np.array(scene["start"], dtype=float),
                    np.array(scene["goal"], dtype=float),
                    float(scene["duration"]),
                )
                for scene in motions["scenes"]
            ),
        )

    def __repr__(self) -> str:
        return repr_line("MotionProblems", self.robot, f"{len(self.scenes)} scenes")

    def clearances(self, arm: Arm, q: Array, solids: Sequence[Solid]) -> Array:
        """Return the smallest distance between a link and a solid in states (N, n), shape (N,), m."""
        frames = arm.frames(q)
        smallest = np.full(len(q), np.inf)
        for capsule in self.capsules:
            frame = frames[:, capsule.link]
            start = frame[:, :3, :3] @ capsule.start + frame[:, :3, 3]
            end = frame[:, :3, :3] @ capsule.end + frame[:, :3, 3]
            for solid in solids:
                gap = _segment_distance(start, end, solid) - capsule.radius
                smallest = np.minimum(smallest, gap)
        return smallest

    def faults(self, arm: Arm, scene: Scene, motion: Trajectory) -> dict[str, float]:
        """Return by how much a motion misses what is asked: 0 or less where it does not.

        Parameters
        ----------
        arm
            The robot.
        scene, motion
            The scene, and its motion, which is judged at 1 kHz.

        Returns
        -------
        dict[str, float]
            ``"ends"``, rad and m; ``"clearance"``, m; ``"position"``, rad and m; ``"speed"`` and ``"torque"``, as
            shares of the limits.
        """
        t = np.append(np.arange(0.0, motion.duration, 1 / _RATE), motion.duration)
        q, qd, qdd = motion.q(t), motion.qd(t), motion.qdd(t)
        tau = arm.inverse_dynamics(q, qd, qdd)
        ends = np.concatenate([q[0] - scene.start, q[-1] - scene.goal, qd[0], qd[-1]])
        gap = self.clearances(arm, q, scene.solids).min()
        return {
            "ends": float(np.abs(ends).max()) - _ROUNDING,
            "clearance": self.clearance - float(gap) - _ROUNDING,
            "position": float(np.maximum(self.lower - q, q - self.upper).max()) - _ROUNDING,
            "speed": float((np.abs(qd) / self.speed).max()) - 1 - _ROUNDING,
            "torque": float((np.abs(tau) / self.torque).max()) - 1 - _ROUNDING,
        }


def _point(values: Any) -> Array:
    point = np.array(values, dtype=float)
    if point.shape != (3,):
        raise ValueError(f"a point has shape {point.shape}; expected (3,)")
    return point


def _solid(data: Mapping[str, Any]) -> Solid:
    if data["shape"] == "sphere":
        return Solid(_point(data["at"]), radius=float(data["radius"]))
    if data["shape"] == "box":
        return Solid(_point(data["at"]), size=_point(data["size"]))
    raise ValueError(f"shape {data['shape']!r}; expected sphere or box")


def _segment_distance(start: Array, end: Array, solid: Solid) -> Array:
    """Return the distances of segments, whose ends are (N, 3), from a solid, shape (N,), m.

    The distance of a point from a convex solid is a convex function along a segment: golden section.
    """
    along = end - start

    def at(share: Array) -> Array:
        return solid.distance(start + share[:, None] * along)

    low = np.zeros(len(start))
    high = np.ones(len(start))
    for _ in range(_HALVINGS):
        width = _GOLDEN * (high - low)
        is_left = at(high - width) <= at(low + width)
        high = np.where(is_left, low + width, high)
        low = np.where(is_left, low, high - width)
    ends = np.minimum(at(np.zeros(len(start))), at(np.ones(len(start))))
    return np.minimum(at((low + high) / 2), ends)


@dataclass(frozen=True)
class MotionRow:
    """What dhkit's planner did with an arm's scenes.

    Attributes
    ----------
    robot
        Name of the arm.
    scenes, found
        Number of scenes, and of motions that miss nothing that was asked.
    longest
        Largest duration over the shortest known one.
    nearest
        Smallest distance from a solid, less the clearance that is to be kept, m.
    seconds
        Time for a motion, s, with the derivation of the planner's program in the first.
    reason
        Why motions were not found or do not count; empty if all do.
    """

    robot: str
    scenes: int
    found: int = 0
    longest: float = 0.0
    nearest: float = field(default=np.inf)
    seconds: float = 0.0
    reason: str = ""

    @property
    def is_right(self) -> bool:
        """Whether all motions were found."""
        return self.found == self.scenes

    @property
    def cells(self) -> list[str]:
        """The row of the table."""
        return [
            self.robot,
            f"{self.found} of {self.scenes}",
            f"{self.longest:.3f}",
            f"{1000 * self.nearest:.3f} mm",
            f"{self.seconds:.2f} s",
            self.reason,
        ]


def plan_problems(problems: MotionProblems) -> MotionRow:
    """Return what dhkit's planner does with an arm's scenes.

    Raises
    ------
    DescriptionError
        The library's arm is another one than the file's.
    """
    arm = Arm.load(problems.robot)
    _check_same_arm(arm, problems)
    found = 0
    longest = 0.0
    nearest = np.inf
    reasons = []
    begin = time.perf_counter()
    motions: list[Trajectory | str] = []
    for scene in problems.scenes:
        solids = [solid.obstacle for solid in scene.solids]
        try:
            motions.append(
                arm.plan(scene.start, scene.goal, obstacles=solids, clearance=problems.clearance)
            )
        except DhkitError as error:
            motions.append(str(error))
    seconds = time.perf_counter() - begin

    for scene, motion in zip(problems.scenes, motions, strict=True):
        if isinstance(motion, str):
            reasons.append(motion)
            continue
        faults = problems.faults(arm, scene, motion)
        missed = [f"{name} by {fault:.2g}" for name, fault in faults.items() if not fault <= 0]
        if missed:
            reasons.append(f"misses {', '.join(missed)}")
            continue
        found += 1
        longest = max(longest, motion.duration / scene.duration)
        nearest = min(nearest, -faults["clearance"] - _ROUNDING)
    count = max(1, len(problems.scenes))
    return MotionRow(
        problems.robot,
        len(problems.scenes),
        found,
        longest,
        nearest,
        seconds / count,
        plain("; ".join(reasons), _REASON),
    )


def _check_same_arm(arm: Arm, problems: MotionProblems) -> None:
    """Raise DescriptionError unless the links of the library's arm are the capsules of the file."""
    own = [one for one in link_capsules(arm.description) if one.link]
    same = len(own) == len(problems.capsules) and all(
        one.link == other.link
        and abs(one.radius - other.radius) <= _SAME_SHAPE
        and np.abs(one.start - other.start).max() <= _SAME_SHAPE
        and np.abs(one.end - other.end).max() <= _SAME_SHAPE
        for one, other in zip(own, problems.capsules, strict=True)
    )
    if not same:
        raise DescriptionError(f"{problems.robot}: the links' shapes are not those of the library")
