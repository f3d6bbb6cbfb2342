"""Obstacles of a motion, and the clearance that a certificate checks by coal."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

import numpy as np

from dhkit.description import Array, Description
from dhkit.errors import PlanningError
from dhkit.planning.obstacles import Floor, Obstacle, Scene, check_obstacles, distance


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
    def names(self) -> str:
        """Names of the obstacles, as text."""
        counted = Counter([item.name for item in self.obstacles] + ["itself"] * self.self_collision)
        return ", ".join(name if count == 1 else f"{count} x {name}" for name, count in counted.items())

    def gaps(self, description: Description, q: Array) -> Array:
        """Return the exact smallest distance at states q (N, n), shape (N,), m."""
        found = distance(description, q, self.obstacles, self.self_collision)
        return np.asarray(found.distance)

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
