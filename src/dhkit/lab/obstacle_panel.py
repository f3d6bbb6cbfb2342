"""The obstacles of a lab: solids that a person places in the world, and that motions in least time go around."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dhkit.description import Array, pose
from dhkit.lab.desk import Desk
from dhkit.lab.requests import Fields, JsonObject, Panel, answers
from dhkit.planning import Floor, Obstacle

KINDS = {"box": 3, "sphere": 1, "cylinder": 2, "floor": 0}
"""Number of sizes of each kind: edges; radius; radius, and length of the axis between the centres of the round ends."""
MAX_OBSTACLES = 20
MAX_SIZE = 1e3
"""Largest size of an obstacle, m."""
MIN_SIZE = 1e-3
"""Smallest size of an obstacle, m."""
MAX_DISTANCE = 1e4
"""Largest coordinate of an obstacle, m."""
FIRST_SIZE = 0.12
"""Size of a new obstacle, as a share of the arm's reach."""
LEAST_DISTANCE = 0.3
"""Least distance of a new obstacle from the base's axis, as a share of the arm's reach."""
TURN = 0.8
"""Angle about the vertical axis from the tool to the first obstacle, and from each to the next, rad."""


@dataclass(frozen=True, eq=False)
class PlacedObstacle:
    """An obstacle as a person has placed it."""

    name: str
    kind: str
    sizes: tuple[float, ...]
    """As :data:`KINDS` lists them, m."""
    T: Array
    """Pose in the world, shape (4, 4), m. Of a floor only the height counts."""

    @property
    def solid(self) -> Obstacle | Floor:
        """The obstacle as planning takes it."""
        centre = self.T[:3, 3]
        match self.kind:
            case "box":
                return Obstacle.box(self.sizes, self.T, self.name)
            case "sphere":
                return Obstacle.sphere(self.sizes[0], centre, self.name)
            case "cylinder":
                radius, length = self.sizes
                along = self.T[:3, 2] * length / 2
                return Obstacle.capsule(radius, centre - along, centre + along, self.name)
        return Floor(float(centre[2]), self.name)

    @property
    def call(self) -> str:
        """The call that makes it, as Python has it."""
        centre = self.T[:3, 3].tolist()
        match self.kind:
            case "box":
                return f"dhkit.Obstacle.box({list(self.sizes)}, np.array({self.T.tolist()}), {self.name!r})"
            case "sphere":
                return f"dhkit.Obstacle.sphere({self.sizes[0]!r}, {centre}, {self.name!r})"
            case "cylinder":
                start, end = self.solid.axis.tolist()  # type: ignore[union-attr]  # a capsule
                return f"dhkit.Obstacle.capsule({self.sizes[0]!r}, {start}, {end}, {self.name!r})"
        return f"dhkit.Floor({centre[2]!r})"


class ObstaclePanel(Panel):
    """Requests ``obstacles.…``."""

    def __init__(self, desk: Desk) -> None:
        super().__init__(desk)
        self.placed: list[PlacedObstacle] = []

    @answers("obstacles.add", "kind")
    def add(self, fields: Fields) -> JsonObject:
        """Place an obstacle beside the arm, and return its index."""
        kind = fields.choice("kind", KINDS)
        if len(self.placed) >= MAX_OBSTACLES:
            raise ValueError(f"obstacles.add: {MAX_OBSTACLES} obstacles are enough")
        if kind == "floor" and any(obstacle.kind == "floor" for obstacle in self.placed):
            raise ValueError("obstacles.add: there is a floor already; expected one at most")
        reach = self.desk.arm.description.reach or 1.0
        size = FIRST_SIZE * reach
        sizes = {
            "box": (size, size, 2 * size),
            "sphere": (size / 2,),
            "cylinder": (size / 2, 2 * size),
            "floor": (),
        }
        obstacle = PlacedObstacle(
            self._free_name(kind), kind, sizes[kind], self._first_pose(kind, reach)
        )
        self._take([*self.placed, obstacle])
        return {"index": len(self.placed) - 1}

    @answers("obstacles.set", "index", "T", "sizes")
    def change(self, fields: Fields) -> None:
        """Move an obstacle, or give it other sizes."""
        index = self._index(fields)
        obstacle = self.placed[index]
        if "sizes" in fields:
            sizes = fields.vector("sizes", KINDS[obstacle.kind], MAX_SIZE)
            if (sizes < MIN_SIZE).any():
                raise ValueError(
                    f"obstacles.set: sizes are {sizes.tolist()}; expected at least {MIN_SIZE:g} m each"
                )
            obstacle = replace(obstacle, sizes=tuple(sizes.tolist()))
        if "T" in fields:
            T = fields.pose("T")
            if np.abs(T[:3, 3]).max() > MAX_DISTANCE:
                raise ValueError(f"obstacles.set: T is farther than {MAX_DISTANCE:g} m away")
            if obstacle.kind == "floor":
                T = pose((0.0, 0.0, T[2, 3]))
            obstacle = replace(obstacle, T=T)
        self._take([*self.placed[:index], obstacle, *self.placed[index + 1 :]])

    @answers("obstacles.remove", "index")
    def remove(self, fields: Fields) -> None:
        """Take an obstacle away."""
        index = self._index(fields)
        self._take([*self.placed[:index], *self.placed[index + 1 :]])

    @answers("obstacles.clear")
    def clear(self, _: Fields) -> None:
        """Take all obstacles away."""
        self._take([])

    def publish(self) -> None:
        """Send the obstacles to the pages."""
        state = [
            {
                "name": each.name,
                "kind": each.kind,
                "sizes": list(each.sizes),
                "T": each.T.ravel().tolist(),
            }
            for each in self.placed
        ]
        self.desk.view.panel("obstacles", state)

    def _index(self, fields: Fields) -> int:
        if not self.placed:
            raise ValueError(f"{fields.request}: there are no obstacles")
        return fields.integer("index", 0, len(self.placed) - 1)

    def _free_name(self, kind: str) -> str:
        if kind == "floor":
            return kind
        taken = {obstacle.name for obstacle in self.placed}
        names = (f"{kind} {k}" for k in range(1, MAX_OBSTACLES + 1))
        return next(name for name in names if name not in taken)

    def _first_pose(self, kind: str, reach: float) -> Array:
        if kind == "floor":
            return pose((0.0, 0.0, 0.0))
        x, y, z = self.desk.arm.fk(self.desk.q)[:3, 3]
        azimuth = np.arctan2(y, x) + TURN * (1 + len(self.placed))
        distance = max(float(np.hypot(x, y)), LEAST_DISTANCE * reach)
        return pose((distance * np.cos(azimuth), distance * np.sin(azimuth), z))

    def _take(self, placed: list[PlacedObstacle]) -> None:
        self.placed = placed
        self.desk.place(tuple(obstacle.solid for obstacle in placed))
        self.publish()
