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
FAILED = -1e300
"""Largest number that coal returns where it finds a penetration and not its depth: some symmetric places."""
SHIFTS = (np.array([3e-8, 1e-8, 2e-8]), np.array([-2e-8, 3e-8, -1e-8]))
"""Moves of a solid, m, with which it is asked again then."""
UNKNOWN_DEPTH = -1e-6
"""Distance, m, of solids that penetrate each other to a depth that is not found."""
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
    coal = coal_module()
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
    request, result = distance_request(), coal.DistanceResult()
    return np.array([signed_distance(coal, capsule, own, solid, place, request, result) for own in places])


def capsule_distances(radii: tuple[float, float], first: Array, second: Array) -> Array:
    """Return the signed distances of two capsules at N poses, shape (N,), m; ends of their axes are (N, 2, 3), m.

    Raises
    ------
    ModelError
        coal is not installed.
    """
    coal = coal_module()
    one, places = _capsule(coal, radii[0], first)
    other, other_places = _capsule(coal, radii[1], second)
    request, result = distance_request(), coal.DistanceResult()
    pairs = zip(places, other_places, strict=True)
    return np.array([signed_distance(coal, one, own, other, place, request, result) for own, place in pairs])


def signed_distance(coal: CoalModule, first: Any, T1: Any, second: Any, T2: Any, request: Any, result: Any) -> float:
    """Return the signed distance of two of coal's shapes at poses T1 and T2, m; ``result`` is a scratch value."""
    found = _distance(coal, first, T1, second, T2, request, result)
    if found > FAILED:
        return found
    for shift in SHIFTS:
        moved = coal.Transform3s(T2.getRotation(), T2.getTranslation() + shift)
        found = _distance(coal, first, T1, second, moved, request, result)
        if found > FAILED:
            return found
    return UNKNOWN_DEPTH


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


def distance_request() -> Any:
    """Return coal's request of a signed distance."""
    request = coal_module().DistanceRequest()
    request.enable_signed_distance = True
    request.gjk_tolerance = TOLERANCE
    request.epa_tolerance = TOLERANCE
    return request


def coal_module() -> CoalModule:
    """Return the module coal.

    Raises
    ------
    ModelError
        It is not installed.
    """
    try:
        import coal
    except ImportError as error:
        raise ModelError(
            f"coal cannot be imported ({error}); pip install pin (Linux, macOS) or conda install coal; "
            "planning around obstacles checks its paths with it"
        ) from None
    return coal
