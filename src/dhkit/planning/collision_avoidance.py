"""Collision avoidance: smooth distances for the optimizer, exact distances by coal for the certificate."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dhkit.description import Array, Description
from dhkit.errors import PlanningError
from dhkit.planning.constraints import Constraint
from dhkit.planning.obstacles import Floor, Obstacle, Scene, SceneSlots, check_obstacles, clearances, deficits, distance
from dhkit.planning.point import Point

if TYPE_CHECKING:
    import casadi

SLOT_COUNTS = (0, 1, 2, 4, 8, 16, 32)
"""Numbers of obstacle slots of programs: a program for three obstacles has four slots and serves four as well."""
INFLATION_FACTOR = 1.2
"""Factor of a gap's shortfall that is added to the margin of its obstacle before the next solution."""


@dataclass(frozen=True)
class ClearanceConstraint(Constraint):
    """Distance of the links from the obstacles in a program's slots, whose parameters come with each motion."""

    slots: SceneSlots
    moving = False

    @property
    def what(self) -> str:
        """Name of the limited quantity."""
        return "clearance"

    def size(self, description: Description) -> int:
        """Return the number of parameters."""
        return self.slots.size

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return the limited expressions, k x 1, without unit: scaled so that the bound is 1."""
        return 2 - clearances(point.description, point.q, parameters, self.slots)


@dataclass(frozen=True, eq=False)
class CollisionAvoidance:
    """Obstacles of a motion, and the clearance from them and between links."""

    obstacles: tuple[Obstacle | Floor, ...] = ()
    clearance: float = 0.01
    """Smallest distance, m."""
    self_collision: bool = False

    @classmethod
    def of(cls, obstacles: Scene, clearance: float, self_collision: bool) -> CollisionAvoidance:
        """Return checked settings.

        Raises
        ------
        ValueError
            A clearance that is negative or not finite.
        """
        if not (math.isfinite(clearance) and clearance >= 0):
            raise ValueError(f"clearance is {clearance!r}; expected a number of at least 0, m")
        return cls(check_obstacles(obstacles), clearance, self_collision)

    def __bool__(self) -> bool:
        return bool(self.obstacles) or self.self_collision

    @property
    def slots(self) -> SceneSlots:
        """Slots of a program for these obstacles, padded so that programs can be used again."""
        return padded_slots(SceneSlots.of(self.obstacles, self.self_collision))

    @property
    def names(self) -> str:
        """Names of the obstacles, as text."""
        counted = Counter([item.name for item in self.obstacles] + ["itself"] * self.self_collision)
        return ", ".join(name if count == 1 else f"{count} x {name}" for name, count in counted.items())

    def gaps(self, description: Description, q: Array) -> Array:
        """Return the exact smallest distance at states q (N, n), shape (N,), m."""
        found = distance(description, q, self.obstacles, self.self_collision)
        return np.asarray(found.distance)

    def shortfalls(self, description: Description, q: Array) -> Array:
        """Return the shortfalls of distances from the clearance, shape (K + 1,), m; that between links last."""
        found = deficits(description, q, self.obstacles, self.clearance, self.self_collision)
        return found if self.self_collision else np.append(found, 0.0)

    def values(self, inflation: Array) -> Array:
        """Return the parameters of a program's slots for inflations of the margins, shape (K + 1,), m."""
        return self.slots.values(self.obstacles, self.clearance, inflation)

    def require(self, description: Description, q: Array, where: str) -> None:
        """Require the clearance at one configuration q (n,), rad and m.

        Raises
        ------
        PlanningError
            Names the link, the obstacle and the gap.
        """
        found = distance(description, q, self.obstacles, self.self_collision)
        gap = float(found.distance)
        if gap >= self.clearance:
            return
        who, what = found.pair or ("the arm", "an obstacle")
        state = f"{1000 * gap:.3g} mm from" if gap > 0 else f"{-1000 * gap:.3g} mm inside"
        raise PlanningError(f"{where}: {who} is {state} {what}, {1000 * self.clearance:.3g} mm are asked for")


NO_AVOIDANCE = CollisionAvoidance()


def padded_slots(slots: SceneSlots) -> SceneSlots:
    """Return slots for at least as many obstacles, rounded up to ``SLOT_COUNTS``."""
    return SceneSlots(_next(slots.capsules), _next(slots.boxes), slots.floor, slots.self_collision)


def _next(count: int) -> int:
    return next((size for size in SLOT_COUNTS if size >= count), count)
