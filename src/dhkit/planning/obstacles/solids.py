"""Exact signed distances of capsules from solids and from each other, by coal (formerly hpp-fcl)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from dhkit.description import Array, Box, Capsule
from dhkit.errors import ModelError
from dhkit.planning.obstacles.scene import Obstacle, rotations_onto

if TYPE_CHECKING:
    CoalModule: TypeAlias = Any

POINT = 1e-9
"""Length of an axis (m) below which its capsule is a ball."""
TOLERANCE = 1e-9
"""Tolerance of coal's iterations, m; its default is 1e-6."""


def obstacle_distances(radius: float, axes: Array, obstacle: Obstacle) -> Array:
    """Return the signed distances of a capsule from an obstacle, at N poses.

    Parameters
    ----------
    radius
        Radius of the capsule, m.
    axes
        Ends of its axis in the world, shape (N, 2, 3), m.
    obstacle
        A box, sphere or capsule.

    Returns
    -------
    Array
        Distances, shape (N,), m; negative for penetration, by its depth.

    Raises
    ------
    ModelError
        coal is not installed.
    """
    coal = _coal()
    match obstacle.geometry:
        case Box():
            solid = coal.Box(*(2 * obstacle.half_sizes).tolist())
        case Capsule(_, length):
            solid = coal.Capsule(obstacle.radius, float(length))
        case _:
            solid = coal.Sphere(obstacle.radius)
    T = obstacle.T_world_obstacle
    place = coal.Transform3s(np.array(T[:3, :3]), np.array(T[:3, 3]))
    capsule, places = _capsule(coal, radius, axes)
    request, result = _request(coal), coal.DistanceResult()
    return np.array([_distance(coal, capsule, own, solid, place, request, result) for own in places])


def capsule_distances(radii: tuple[float, float], first: Array, second: Array) -> Array:
    """Return the signed distances of two capsules at N poses, shape (N,), m; ends of their axes are (N, 2, 3), m.

    Raises
    ------
    ModelError
        coal is not installed.
    """
    coal = _coal()
    one, places = _capsule(coal, radii[0], first)
    other, other_places = _capsule(coal, radii[1], second)
    request, result = _request(coal), coal.DistanceResult()
    pairs = zip(places, other_places, strict=True)
    return np.array([_distance(coal, one, own, other, place, request, result) for own, place in pairs])


def _distance(coal: CoalModule, first: Any, T1: Any, second: Any, T2: Any, request: Any, result: Any) -> float:
    result.clear()  # coal keeps the smallest of a result's queries
    return float(coal.distance(first, T1, second, T2, request, result))


def _capsule(coal: CoalModule, radius: float, axes: Array) -> tuple[Any, list[Any]]:
    """Return coal's capsule and its N poses, from the ends of its axis, shape (N, 2, 3), m."""
    along = axes[:, 1] - axes[:, 0]
    lengths = np.linalg.norm(along, axis=1)
    middles = np.ascontiguousarray(axes.mean(axis=1))
    if not len(axes) or lengths[0] < POINT:
        return coal.Sphere(radius), [coal.Transform3s(np.eye(3), middle) for middle in middles]
    rotations = rotations_onto(along / lengths[:, None])
    places = [coal.Transform3s(R, middle) for R, middle in zip(rotations, middles, strict=True)]
    return coal.Capsule(radius, float(lengths[0])), places


def _request(coal: CoalModule) -> Any:
    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    request.gjk_tolerance = TOLERANCE
    request.epa_tolerance = TOLERANCE
    return request


def _coal() -> CoalModule:
    try:
        import coal
    except ImportError as error:
        raise ModelError(
            f"coal cannot be imported ({error}); pip install pin (Linux, macOS) or conda install coal; "
            "planning around obstacles checks its paths with it"
        ) from None
    return coal
