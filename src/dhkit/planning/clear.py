"""Keeping clear of obstacles: smooth distances for the optimizer, coal's exact ones for the certificate."""

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

SIZES = (0, 1, 2, 4, 8, 16, 32)
"""How many obstacles programs have room for: one made for three serves four as well."""
BEYOND = 1.2
"""What a gap that is short is multiplied by to be added to the margin."""


@dataclass(frozen=True)
class Clear(Constraint):
    """Links stay away from what fills the slots; its parameters come with each motion."""

    slots: SceneSlots
    moving = False
    low = 1.0
    high = math.inf

    @property
    def what(self) -> str:
        """What it limits, in words."""
        return "clearance"

    def size(self, description: Description) -> int:
        """Return how many parameters it takes."""
        return self.slots.size

    def rows(self, point: Point, parameters: casadi.SX) -> casadi.SX:
        """Return what must stay within bounds, k x 1."""
        return clearances(point.description, point.q, parameters, self.slots)


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What a motion keeps away from, and by how much."""

    obstacles: tuple[Obstacle | Floor, ...] = ()
    clearance: float = 0.01
    """m."""
    self_collision: bool = False

    @classmethod
    def of(cls, obstacles: Scene, clearance: float, self_collision: bool) -> Surroundings:
        """Check arguments.

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
        """Room for it, with some to spare."""
        return roomy(SceneSlots.of(self.obstacles, self.self_collision))

    @property
    def names(self) -> str:
        """What is there, in words."""
        counted = Counter([item.name for item in self.obstacles] + ["itself"] * self.self_collision)
        return ", ".join(name if count == 1 else f"{count} x {name}" for name, count in counted.items())

    def gaps(self, description: Description, q: Array) -> Array:
        """Return the exact distance of states (N, n) from the nearest thing, shape (N,), m."""
        found = distance(description, q, self.obstacles, self.self_collision)
        return np.asarray(found.distance)

    def short(self, description: Description, q: Array) -> Array:
        """Return by how much each thing's gap is short of the clearance, shape (K + 1,), m; links' own last."""
        found = deficits(description, q, self.obstacles, self.clearance, self.self_collision)
        return found if self.self_collision else np.append(found, 0.0)

    def values(self, inflation: Array) -> Array:
        """Return the parameters of a program's slots."""
        return self.slots.values(self.obstacles, self.clearance, inflation)

    def require(self, description: Description, q: Array, where: str) -> None:
        """Refuse a configuration that is too near.

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


NOTHING = Surroundings()


def roomy(slots: SceneSlots) -> SceneSlots:
    """Return slots for as many obstacles or somewhat more."""
    return SceneSlots(_next(slots.capsules), _next(slots.boxes), slots.floor, slots.self_collision)


def _next(count: int) -> int:
    return next((size for size in SIZES if size >= count), count)
