"""Obstacles in the world: boxes, spheres, capsules and a floor; and many of them as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import Array, Box, Capsule, Sphere, check_pose
from dhkit.description.arrays import number_array
from dhkit.display import listed, repr_line, value_line
from dhkit.expressions import exact

Solid: TypeAlias = Box | Sphere | Capsule
"""Shape of an obstacle."""


@dataclass(frozen=True)
class Obstacle:
    """A solid at rest in the world.

    Created by :meth:`box`, :meth:`sphere` or :meth:`capsule`.

    Examples
    --------
    >>> Obstacle.sphere(0.1, (0.4, 0.2, 0.3)).centre
    array([0.4, 0.2, 0.3])
    >>> Obstacle.box((0.4, 0.4, 0.0), at=(0, 0, 0))
    Traceback (most recent call last):
        ...
    ValueError: box: size is (0.4, 0.4, 0.0); expected three positive numbers, m
    """

    geometry: Solid
    """Shape with sizes in m; a capsule lies along z, centred."""
    placement: tuple[tuple[float, ...], ...]
    """Pose in the world, rows of the 4x4 matrix, m."""
    name: str

    @classmethod
    def box(cls, size: ArrayLike, at: ArrayLike, name: str = "box") -> Obstacle:
        """Return a box.

        Parameters
        ----------
        size
            Lengths of the edges, shape (3,), m.
        at
            Pose in the world, shape (4, 4), or position of the centre, shape (3,), m.
        name
            Name in reports.

        Raises
        ------
        ValueError
            Another shape, a size that is not positive and finite, or a matrix that is not a pose.
        TypeError
            Not numbers.
        """
        x, y, z = _sizes("box: size", size, (3,), "three positive numbers, m")
        array = number_array(at, "box: at", "(4, 4) or (3,)")
        if array.shape == (4, 4) and np.all(np.isfinite(array)):
            T_world_obstacle = check_pose(array, "box: at")
        else:
            T_world_obstacle = np.eye(4)
            T_world_obstacle[:3, 3] = _point(
                "box: at", at, "a pose, shape (4, 4), or a position, shape (3,), finite"
            )
        return cls._placed(Box((exact(x), exact(y), exact(z))), T_world_obstacle, name)

    @classmethod
    def sphere(cls, radius: float, centre: ArrayLike, name: str = "sphere") -> Obstacle:
        """Return a ball.

        Parameters
        ----------
        radius
            Radius, m.
        centre
            Position in the world, shape (3,), m.
        name
            Name in reports.

        Raises
        ------
        ValueError
            A radius that is not positive and finite, or another shape.
        TypeError
            Not numbers.
        """
        (r,) = _sizes("sphere: radius", radius, (), "a positive number, m")
        T_world_obstacle = np.eye(4)
        T_world_obstacle[:3, 3] = _point("sphere: centre", centre)
        return cls._placed(Sphere(exact(r)), T_world_obstacle, name)

    @classmethod
    def capsule(
        cls, radius: float, start: ArrayLike, end: ArrayLike, name: str = "capsule"
    ) -> Obstacle:
        """Return a cylinder with half balls on its ends.

        Parameters
        ----------
        radius
            Radius, m.
        start, end
            Ends of the axis, which are the centres of the half balls, in the world, shape (3,), m.
        name
            Name in reports.

        Raises
        ------
        ValueError
            A radius that is not positive and finite, another shape, or ends that coincide.
        TypeError
            Not numbers.
        """
        (r,) = _sizes("capsule: radius", radius, (), "a positive number, m")
        first = _point("capsule: start", start)
        last = _point("capsule: end", end)
        length = float(np.linalg.norm(last - first))
        if not length > 0:
            raise ValueError(
                f"capsule: start and end are both {_shown(first)}; expected two points (or a sphere)"
            )
        T_world_obstacle = np.eye(4)
        T_world_obstacle[:3, :3] = rotations_onto((last - first) / length)
        T_world_obstacle[:3, 3] = (first + last) / 2
        return cls._placed(Capsule(exact(r), exact(length)), T_world_obstacle, name)

    def __repr__(self) -> str:
        kind = type(self.geometry).__name__.lower()
        return repr_line(
            f"Obstacle {self.name[:60]}", summary=f"{kind} about {listed(self.centre)} m"
        )

    @classmethod
    def _placed(cls, geometry: Solid, T_world_obstacle: Array, name: str) -> Obstacle:
        if not name:
            raise ValueError("name is empty; expected the name of the obstacle in reports")
        return cls(geometry, tuple(tuple(row) for row in T_world_obstacle.tolist()), name)

    @cached_property
    def T_world_obstacle(self) -> Array:
        """Pose in the world, shape (4, 4), m."""
        return _frozen(np.array(self.placement))

    @cached_property
    def centre(self) -> Array:
        """Centre in the world, shape (3,), m."""
        return _frozen(self.T_world_obstacle[:3, 3].copy())

    @cached_property
    def half_sizes(self) -> Array:
        """Half the edges of the box around which the solid is rounded, shape (3,), m; zeros for a sphere."""
        match self.geometry:
            case Box(size):
                return _frozen(np.array([float(edge) for edge in size]) / 2)
            case Capsule(_, length):
                return _frozen(np.array([0.0, 0.0, float(length) / 2]))
        return _frozen(np.zeros(3))

    @property
    def radius(self) -> float:
        """Distance of the surface from the box, segment or point inside, m: 0 for a box."""
        return 0.0 if isinstance(self.geometry, Box) else float(self.geometry.radius)

    @cached_property
    def axis(self) -> Array:
        """The ends of a capsule's axis in the world, shape (2, 3), m; twice the centre for a sphere."""
        # c - l z and c + l z, with the centre c, half the length l and the direction z.
        _, _, half_length = self.half_sizes
        along = self.T_world_obstacle[:3, 2] * half_length
        return _frozen(np.stack([self.centre - along, self.centre + along]))


@dataclass(frozen=True)
class Floor:
    """A horizontal floor: the links that can reach below ``height`` must stay above it.

    Raises
    ------
    ValueError
        A height that is not finite.
    """

    height: float = 0.0
    """Height, world z, m."""
    name: str = "floor"

    def __post_init__(self) -> None:
        height = number_array(self.height, "floor: height", "()")
        if height.shape != () or not np.isfinite(height):
            raise ValueError(f"floor: height is {self.height!r}; expected a finite number, m")

    __repr__ = value_line


Scene: TypeAlias = Sequence[Obstacle | Floor]
"""Obstacles of an arm, with at most one floor."""


def check_obstacles(obstacles: Scene) -> tuple[Obstacle | Floor, ...]:
    """Return a scene as a tuple.

    Raises
    ------
    TypeError
        Something else than obstacles and floors.
    ValueError
        More than one floor.
    """
    if isinstance(obstacles, Obstacle | Floor) or not isinstance(obstacles, Sequence):
        raise TypeError(
            f"obstacles is {type(obstacles).__name__}; expected a list of Obstacle and Floor"
        )
    for item in obstacles:
        if not isinstance(item, Obstacle | Floor):
            raise TypeError(f"obstacles: found {type(item).__name__}; expected Obstacle or Floor")
    floors = sum(isinstance(item, Floor) for item in obstacles)
    if floors > 1:
        raise ValueError(f"obstacles: found {floors} floors; expected one at most")
    return tuple(obstacles)


def rotations_onto(directions: Array) -> Array:
    """Return rotations whose third columns are unit vectors: shape (..., 3) to (..., 3, 3)."""
    # Any second direction serves; the coordinate axis farthest from the first is never parallel to it.
    helper = np.eye(3)[np.argmin(np.abs(directions), axis=-1)]
    x = np.cross(helper, directions)
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, np.cross(directions, x), directions], axis=-1)


def _sizes(name: str, value: ArrayLike, shape: tuple[int, ...], expected: str) -> list[float]:
    array = number_array(value, name, str(shape))
    if array.shape != shape or not np.all(np.isfinite(array) & (array > 0)):
        raise ValueError(f"{name} is {_shown(array)}; expected {expected}")
    return [float(x) for x in array.ravel()]


def _point(
    name: str, value: ArrayLike, expected: str = "a finite position, shape (3,), m"
) -> Array:
    array = number_array(value, name, "(3,)")
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        found = _shown(array) if array.shape == (3,) else f"of shape {array.shape}"
        raise ValueError(f"{name} is {found}; expected {expected}")
    return array


def _shown(array: Array) -> str:
    return str(tuple(array.tolist()) if array.ndim == 1 else array.tolist())[:80]


def _frozen(array: Array) -> Array:
    array.setflags(write=False)
    return array


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
        """Return the support of P of them along M unit vectors n (M, 3), shape (M, P), m: the largest n . x.

        With the centre c, the half edges e_a as vectors, and the radius r of the rounding,

            h(n) = n . c + sum_a |n . e_a| + r.
        """
        # Half edges, as columns.
        halves = self.placements[which, :3, :3] * self.half_sizes[which, None]
        along = np.abs(np.einsum("ix,jxa->ija", normals, halves)).sum(axis=2)
        reach: Array = normals @ self.centres[which].T + along + self.radii[which]
        return reach
