"""Many solids as arrays, and which of their separating planes are needed.

A plane that separates a link from one obstacle separates it from every solid behind that plane too. Of copies, and of
the obstacles of a wall or a heap, few planes are left, with the same motions allowed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Box
from dhkit.planning.obstacles.scene import Obstacle

BEHIND_TOLERANCE = 1e-9
"""Distance (m) by which a solid may stand before a plane and counts as behind it: of copies only rounding differs."""


@dataclass(frozen=True, eq=False)
class Solids:
    """P solids, all boxes or none.

    Attributes
    ----------
    are_boxes
        Whether they are boxes; else spheres and capsules.
    centres
        Shape (P, 3), m.
    radii
        Distances of the surfaces from the boxes, segments or points inside, shape (P,), m.
    half_sizes
        Half the edges of those boxes, shape (P, 3), m.
    placements
        Poses in the world, shape (P, 4, 4), m.
    axes
        Ends of the axes, shape (P, 2, 3), m.
    """

    are_boxes: bool
    centres: Array
    radii: Array
    half_sizes: Array
    placements: Array
    axes: Array

    @classmethod
    def of(cls, items: Sequence[Obstacle]) -> Solids:
        """Return obstacles of one kind as arrays."""
        return cls(
            bool(items) and isinstance(items[0].geometry, Box),
            np.array([item.centre for item in items]).reshape(-1, 3),
            np.array([item.radius for item in items]),
            np.array([item.half_sizes for item in items]).reshape(-1, 3),
            np.array([item.T_world_obstacle for item in items]).reshape(-1, 4, 4),
            np.array([item.axis for item in items]).reshape(-1, 2, 3),
        )

    @property
    def bounds(self) -> Array:
        """Radii of balls around the solids, shape (P,), m."""
        bounds: Array = self.radii + np.linalg.norm(self.half_sizes, axis=1)
        return bounds

    def __getitem__(self, which: NDArray[np.int_]) -> Solids:
        """Return some of them."""
        arrays = (self.centres, self.radii, self.half_sizes, self.placements, self.axes)
        return Solids(self.are_boxes, *(array[which] for array in arrays))

    def reach(self, which: NDArray[np.int_], normals: Array) -> Array:
        """Return how far P of them reach along M directions (M, 3), shape (M, P), m."""
        halves = self.placements[which, :3, :3] * self.half_sizes[which, None]  # half edges, as columns
        along = np.abs(np.einsum("ix,jxa->ija", normals, halves)).sum(axis=2)
        reach: Array = normals @ self.centres[which].T + along + self.radii[which]
        return reach


def needed_planes(
    solids: Solids, which: NDArray[np.int_], normal: Array, level: Array, required: Array
) -> NDArray[np.bool_]:
    """Return which planes between a link and solids are needed, shape (P,).

    Parameters
    ----------
    which
        Indices of the solids, the nearest first, shape (P,).
    normal, level
        Their planes: normals towards the link, shape (P, 3), and positions along them, shape (P,), m.
    required
        Distances of the link from each plane, shape (P,), m.
    """
    # Entry (i, j): whether solid j, with the distance required from it, is behind what the link keeps from plane i.
    shields = solids.reach(which, normal) + required <= (level + required)[:, None] + BEHIND_TOLERANCE
    needed, is_shielded = np.zeros((2, len(which)), dtype=bool)
    for i in range(len(which)):
        if not is_shielded[i]:
            needed[i] = True
            is_shielded |= shields[i]
    return needed
