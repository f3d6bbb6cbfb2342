"""Slots for obstacles in a program that is built once, and their parameters for a scene."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Box
from dhkit.description.arrays import number_array
from dhkit.planning.obstacles.scene import Floor, Obstacle, Scene, check_obstacles

CAPSULE, BOX, FLOOR, ITSELF = 7, 16, 2, 1
"""Numbers of parameters of a slot. Capsule: start (3), end - start (3), radius plus margin; box: R_box_world (9, by
rows), centre (3), half sizes (3), margin; floor: height, margin; links: margin."""
PARKED = (0.0, 0.0, -100.0)
"""Position of obstacles in unused slots, m: too far for any arm, near enough for ten correct digits."""
PARKED_SIZE = 0.1
"""Radius or half size of obstacles in unused slots, m."""


@dataclass(frozen=True)
class SceneSlots:
    """Numbers of obstacle slots of a program; spheres are capsules of length 0.

    Raises
    ------
    ValueError
        A negative number.

    Examples
    --------
    >>> slots = SceneSlots(capsules=2, boxes=1)
    >>> slots.size
    30
    >>> slots.fits([Obstacle.sphere(0.1, (0.5, 0, 0.5)), Floor()])
    False
    """

    capsules: int = 0
    boxes: int = 0
    floor: bool = False
    self_collision: bool = False

    def __post_init__(self) -> None:
        for name in ("capsules", "boxes"):
            if getattr(self, name) < 0:
                raise ValueError(f"slots: {name} is {getattr(self, name)}; expected 0 or more")

    @classmethod
    def of(cls, obstacles: Scene, self_collision: bool = False) -> SceneSlots:
        """Return the fewest slots for a scene."""
        boxes = sum(isinstance(item, Obstacle) and isinstance(item.geometry, Box) for item in obstacles)
        floors = sum(isinstance(item, Floor) for item in check_obstacles(obstacles))
        return cls(len(obstacles) - boxes - floors, boxes, floors > 0, self_collision)

    @property
    def size(self) -> int:
        """The number of parameters."""
        return CAPSULE * self.capsules + BOX * self.boxes + FLOOR * self.floor + ITSELF * self.self_collision

    def fits(self, obstacles: Scene) -> bool:
        """Return whether a scene has no more obstacles than slots."""
        need = SceneSlots.of(obstacles)
        return need.capsules <= self.capsules and need.boxes <= self.boxes and need.floor <= self.floor

    def values(self, obstacles: Scene, clearance: float = 0.0, inflation: ArrayLike = 0.0) -> Array:
        """Return the parameters for a scene.

        Parameters
        ----------
        obstacles
            K obstacles, in the order of :func:`dhkit.planning.obstacles.deficits`.
        clearance
            Smallest distance of the links from obstacles and from each other, m.
        inflation
            Addition to the clearance from each obstacle, m: a number, or shape (K,), or (K + 1,) with that between
            links last.

        Returns
        -------
        Array
            Parameters, shape (size,). Obstacles in unused slots are far away, an unused floor far below.

        Raises
        ------
        ValueError
            More obstacles than slots, or another number of inflations.
        """
        obstacles = check_obstacles(obstacles)
        if not self.fits(obstacles):
            raise ValueError(f"obstacles need {SceneSlots.of(obstacles)}; there is room for {self}")
        margins = clearance + self._inflations(len(obstacles), inflation)
        solids: dict[bool, list[Array]] = {True: [], False: []}
        floor = np.array([PARKED[2], 0.0])
        for item, margin in zip(obstacles, margins, strict=False):
            if isinstance(item, Floor):
                floor = np.array([item.height, margin])
            else:
                is_box = isinstance(item.geometry, Box)
                solids[is_box].append(_box(item, margin) if is_box else _capsule(item, margin))
        parked = Obstacle.sphere(PARKED_SIZE, PARKED), Obstacle.box((2 * PARKED_SIZE,) * 3, PARKED)
        capsules = solids[False] + [_capsule(parked[0], 0.0)] * (self.capsules - len(solids[False]))
        boxes = solids[True] + [_box(parked[1], 0.0)] * (self.boxes - len(solids[True]))
        rest = [floor] * self.floor + [margins[-1:]] * self.self_collision
        return np.concatenate([np.zeros(0), *capsules, *boxes, *rest])

    def _inflations(self, k: int, inflation: ArrayLike) -> Array:
        """Return K + 1 numbers, that between links last."""
        array = number_array(inflation, "inflation", f"({k},) or ({k + 1},)")
        if array.shape not in ((), (k,), (k + 1,)):
            raise ValueError(f"inflation has shape {array.shape}; expected ({k},) or ({k + 1},) for {k} obstacles")
        return np.append(array, 0.0) if array.shape == (k,) else np.broadcast_to(array, (k + 1,))


def starts(slots: SceneSlots) -> tuple[Iterator[int], Iterator[int], int, int]:
    """Return the offsets of the parameters of capsules, boxes, the floor and the links."""
    boxes = CAPSULE * slots.capsules
    floor = boxes + BOX * slots.boxes
    return iter(range(0, boxes, CAPSULE)), iter(range(boxes, floor, BOX)), floor, floor + FLOOR * slots.floor


def _capsule(obstacle: Obstacle, margin: float) -> Array:
    start, end = obstacle.axis
    return np.concatenate([start, end - start, [obstacle.radius + margin]])


def _box(obstacle: Obstacle, margin: float) -> Array:
    R_box_world = obstacle.T_world_obstacle[:3, :3].T
    return np.concatenate([R_box_world.ravel(), obstacle.centre, obstacle.half_sizes, [margin]])
