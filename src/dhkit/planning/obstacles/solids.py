"""Distances of two solids: bounds in closed form, and exact signed ones by coal (formerly hpp-fcl).

The bounds, of points, segments and boxes, exclude pairs before exact distances are measured: of capsules, of obstacles,
and of the shapes of links whose capsules are too wide for them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Box, Capsule, Cylinder, Description, Sphere, world_to_frames
from dhkit.errors import ModelError
from dhkit.model.shapes import MeshVersions, Part, link_parts, mesh_versions
from dhkit.planning.obstacles.capsules import LinkBody, convex_hull
from dhkit.planning.obstacles.scene import Floor, Obstacle, Solids, rotations_onto

if TYPE_CHECKING:
    CoalModule: TypeAlias = Any

POINTS = 9
"""Number of points of an axis at which its distance from a box is bounded."""

ZERO = 1e-15
"""Squared length (m^2), or that times a squared sine, below which a direction is undefined."""

Bounds = tuple[Array, Array]
"""Lower and upper bounds of a distance, shape (...) each, m."""
POINT = 1e-9
"""Length of an axis (m) below which its capsule is a ball."""
FAILED = -1e300
"""Largest number that coal returns where it finds a penetration and not its depth: some symmetric places."""
SHIFTS = (np.array([3e-8, 1e-8, 2e-8]), np.array([-2e-8, 3e-8, -1e-8]))
"""Translations of a solid, m, with which coal is asked again where it finds no depth of a penetration."""
UNKNOWN_DEPTH = -1e-6
"""Distance, m, of solids that penetrate each other to a depth that is not found."""
TOLERANCE = 1e-9
"""Tolerance of coal's iterations, m; its default is 1e-6."""
SHORT = 1e-12
"""Length of a vector, m, below which it has no direction."""


def segment_distances(first: Array, second: Array) -> Array:
    """Return the distances of segments (Ericson, Real-Time Collision Detection, 2005, section 5.1.9).

    Parameters
    ----------
    first, second
        Ends of the segments, shape (..., 2, 3), m; batch axes are broadcast. Ends may coincide.

    Returns
    -------
    Array
        Distances, shape (...), m.
    """
    own, theirs = nearest_points(first, second)
    distances: Array = np.linalg.norm(own - theirs, axis=-1)
    return distances


def nearest_points(first: Array, second: Array) -> tuple[Array, Array]:
    """Return the nearest points of segments, shape (..., 3) each, m, on the first and on the second.

    The points p1 + s d1 and p2 + t d2 of the lines, with r = p1 - p2, are nearest for

        s = (b f - c e) / (a e - b^2),    t = (b s + f) / e,    s = (b t - c) / a,

    where a = d1 . d1, b = d1 . d2, c = d1 . r, e = d2 . d2 and f = d2 . r (Ericson, Real-Time Collision Detection,
    2005, section 5.1.9). On segments s and t are clamped to [0, 1], each in turn with the other fixed.

    Parameters
    ----------
    first, second
        As in :func:`segment_distances`.
    """
    p1 = first[..., 0, :]
    d1 = first[..., 1, :] - first[..., 0, :]
    p2 = second[..., 0, :]
    d2 = second[..., 1, :] - second[..., 0, :]
    r = p1 - p2

    a = _dot(d1, d1)
    b = _dot(d1, d2)
    c = _dot(d1, r)
    e = _dot(d2, d2)
    f = _dot(d2, r)

    # s of the lines, the best t for that s, and the best s for that t: s changes only where t was clamped. For parallel
    # lines, a e = b^2, any s serves, and 0 is taken.
    s = np.clip(_quotient(b * f - c * e, a * e - b * b), 0.0, 1.0)
    t = np.clip(_quotient(b * s + f, e), 0.0, 1.0)
    s = np.clip(_quotient(b * t - c, a), 0.0, 1.0)
    return p1 + s[..., None] * d1, p2 + t[..., None] * d2


def nearest_on_box(axes: Array, T_world_box: Array, half_sizes: Array) -> tuple[Array, Array]:
    """Return the nearest points of segments and a box, shape (..., 3) each, m, on the segment and in the box.

    In the box's frame a segment is x(s) = x_0 + s d, 0 <= s <= 1, and the point of the box nearest to x is x clamped to
    the half sizes. Half the derivative of the squared distance,

        g(s) = d . (x(s) - clamp(x(s))),

    is piecewise linear and grows: its zero lies between two of the positions s at which a coordinate enters or leaves
    the box, where it is found by linear interpolation.

    Parameters
    ----------
    axes
        Ends of the segments, shape (..., 2, 3), m.
    T_world_box
        Pose of the box, shape (..., 4, 4), m; batch axes are broadcast.
    half_sizes
        Half the edges, shape (..., 3), m; zeros for a point or a segment.
    """
    R = T_world_box[..., :3, :3]
    centre = T_world_box[..., None, :3, 3]
    half = half_sizes[..., None, :]
    ends = (axes - centre) @ R
    x0 = ends[..., 0, :]
    d = ends[..., 1, :] - ends[..., 0, :]

    # The positions at which a coordinate is at a face, and both ends, in order.
    with np.errstate(divide="ignore", invalid="ignore"):
        crossings = np.concatenate([(-half_sizes - x0) / d, (half_sizes - x0) / d], axis=-1)
    inner = np.clip(np.nan_to_num(crossings, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0)
    zeros = np.zeros((*inner.shape[:-1], 1))
    positions = np.sort(np.concatenate([zeros, inner, zeros + 1], axis=-1), axis=-1)

    # g at each of them; the last one with g < 0, and the next.
    x = x0[..., None, :] + positions[..., None] * d[..., None, :]
    g = np.sum(d[..., None, :] * (x - np.clip(x, -half, half)), axis=-1)
    last = np.maximum(np.sum(g < 0, axis=-1, keepdims=True) - 1, 0)
    after = np.minimum(last + 1, positions.shape[-1] - 1)
    s0 = np.take_along_axis(positions, last, axis=-1)[..., 0]
    g0 = np.take_along_axis(g, last, axis=-1)[..., 0]
    s1 = np.take_along_axis(positions, after, axis=-1)[..., 0]
    g1 = np.take_along_axis(g, after, axis=-1)[..., 0]

    # Without a zero inside, the nearest point is an end.
    zero = s0 + (s1 - s0) * _quotient(-g0, g1 - g0)
    s = np.where(g1 < 0, s1, zero)
    s = np.where(g0 >= 0, s0, s)

    own = (x0 + s[..., None] * d)[..., None, :]
    in_box = np.clip(own, -half, half)
    R_box_world = np.swapaxes(R, -1, -2)
    on_segment = own @ R_box_world + centre
    on_box = in_box @ R_box_world + centre
    return on_segment[..., 0, :], on_box[..., 0, :]


def axis_bounds(solids: Solids, axes: Array) -> Bounds:
    """Return bounds of the signed distances of segments from solids.

    Parameters
    ----------
    solids
        P solids.
    axes
        Ends of the segments, shape (..., P, 2, 3), m: the last batch axis goes with the solids.
    """
    if solids.are_boxes:
        return _box_bounds(solids, axes)
    distance = segment_distances(axes, solids.axes) - solids.radii
    return distance, distance


def _box_bounds(solids: Solids, axes: Array) -> Bounds:
    """Return bounds of the signed distances of segments from boxes, from ``POINTS`` points of each segment.

    In the box's frame a point x is beyond its faces by e = |x| - half sizes, and its signed distance is

        |max(e, 0)| + min(max_i e_i, 0).
    """
    ends = (axes - solids.centres[:, None]) @ solids.placements[:, :3, :3]
    share = np.linspace(0, 1, POINTS)[:, None]
    points = ends[..., :1, :] + share * (ends[..., 1:, :] - ends[..., :1, :])
    e = np.abs(points) - solids.half_sizes[:, None]
    signed = np.linalg.norm(np.maximum(e, 0.0), axis=-1) + np.minimum(e.max(axis=-1), 0.0)
    upper = signed.min(axis=-1)

    # No point of a segment of length l is farther than half a step from one of N sampled points: the distance is at
    # least min_k d_k - l / (2 (N - 1)). A segment that is partly inside is bounded only by the ball around its middle,
    # d_middle - l / 2, since it may have to move its own length to get out.
    length = np.linalg.norm(ends[..., 1, :] - ends[..., 0, :], axis=-1)
    outside = upper - length / (2 * (POINTS - 1))
    lower = np.where(outside > 0, outside, signed[..., POINTS // 2] - length / 2)
    return lower, upper


def _dot(first: Array, second: Array) -> Array:
    """Return scalar products along the last axis: five times as fast as a product and its sum over three numbers."""
    products: Array = np.einsum("...i,...i->...", first, second)
    return products


def _quotient(numerator: Array, denominator: Array) -> Array:
    """Return a quotient, 0 where the denominator is 0."""
    quotient: Array = np.divide(
        numerator, denominator, out=np.zeros_like(numerator), where=denominator > ZERO
    )
    return quotient


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
    request = distance_request()
    result = coal.DistanceResult()
    return np.array(
        [signed_distance(coal, capsule, own, solid, place, request, result) for own in places]
    )


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
    request = distance_request()
    result = coal.DistanceResult()
    pairs = zip(places, other_places, strict=True)
    return np.array(
        [signed_distance(coal, one, own, other, place, request, result) for own, place in pairs]
    )


def signed_distance(
    coal: CoalModule, first: Any, T1: Any, second: Any, T2: Any, request: Any, result: Any
) -> float:
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


def _distance(
    coal: CoalModule, first: Any, T1: Any, second: Any, T2: Any, request: Any, result: Any
) -> float:
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


@dataclass(frozen=True, eq=False)
class _Solid:
    """A convex solid that moves with a link."""

    shape: Any
    """The solid as coal's shape."""
    T_link_solid: Array
    """Pose in the link's DH frame, shape (4, 4), m."""
    extent: Callable[[Array], Array]
    """Support function: the largest n . x of its points x, m, for unit vectors n in its frame, shape (..., 3)."""


def shape_distances(
    description: Description, q: Array, bodies: tuple[LinkBody, LinkBody], enough: float = np.inf
) -> Array:
    """Return the signed distances between the shapes of two bodies of links, shape (N,), m; inf if one has none.

    Boxes, spheres, cylinders and capsules are exact; a mesh counts as its convex hull.

    Parameters
    ----------
    q
        Joint values, shape (N, n), rad and m.
    bodies
        The two bodies.
    enough
        Distance, m, from which a lower bound of the distance is returned instead: it takes 2 µs a state, and the
        distance itself 50 µs.

    Raises
    ------
    ModelError
        coal is not installed, or a mesh cannot be read.
    """
    solids = _solids(description, mesh_versions(description))
    frames = world_to_frames(description, q)
    least = np.full(len(q), np.inf)
    coal = coal_module()
    request = distance_request()
    result = coal.DistanceResult()
    for first, second in product(*(solids.get(body, ()) for body in bodies)):
        T1 = frames[:, bodies[0].link] @ first.T_link_solid
        T2 = frames[:, bodies[1].link] @ second.T_link_solid
        bound = _separation(first, T1, second, T2)
        decided = bound >= np.minimum(least, enough)
        least[decided] = np.minimum(least, bound)[decided]
        for k in np.flatnonzero(~decided):
            pose1 = _transform(coal, T1[k])
            pose2 = _transform(coal, T2[k])
            gap = signed_distance(coal, first.shape, pose1, second.shape, pose2, request, result)
            least[k] = min(least[k], gap)
    return least


def nearest_of_bodies(
    description: Description,
    frames: Array,
    bodies: tuple[LinkBody, LinkBody],
    enough: float = np.inf,
) -> tuple[float, Array] | None:
    """Return the signed distance between the shapes of two bodies, m, and the points where they are nearest.

    Parameters
    ----------
    frames
        DH frames of the base and the links in the world, shape (n + 1, 4, 4), m.
    bodies
        The two bodies.
    enough
        Distance, m, above which nothing is searched.

    Returns
    -------
    tuple or None
        Distance, and points of the first and the second, shape (2, 3), m, world. None if all shapes are farther from
        each other than ``enough``, or one body has none.

    Raises
    ------
    ModelError
        coal is not installed, or a mesh cannot be read.
    """
    first, second = (_placed_solids(description, frames, body) for body in bodies)
    return _nearest_of_solids(first, second, enough)


def nearest_to_obstacle(
    description: Description,
    frames: Array,
    body: LinkBody,
    obstacle: Obstacle | Floor,
    enough: float = np.inf,
) -> tuple[float, Array] | None:
    """Return the signed distance between the shapes of a body and an obstacle, m, and where they are nearest.

    Parameters
    ----------
    frames, enough
        As for :func:`nearest_of_bodies`.
    body
        The body.
    obstacle
        The obstacle.

    Returns
    -------
    tuple or None
        Distance, and points of the body and the obstacle, as from :func:`nearest_of_bodies`.

    Raises
    ------
    ModelError
        coal is not installed, or a mesh cannot be read.
    """
    solid = (
        _PlacedSolid(_floor_solid(obstacle), np.eye(4))
        if isinstance(obstacle, Floor)
        else _obstacle_solid(obstacle)
    )
    return _nearest_of_solids(_placed_solids(description, frames, body), [solid], enough)


class _PlacedSolid(NamedTuple):
    solid: _Solid
    T_world_solid: Array
    """Shape (4, 4), m."""


def _placed_solids(description: Description, frames: Array, body: LinkBody) -> list[_PlacedSolid]:
    """Return the solids of a body in the world; frames are those of :func:`nearest_of_bodies`."""
    solids = _solids(description, mesh_versions(description)).get(body, ())
    return [_PlacedSolid(solid, frames[body.link] @ solid.T_link_solid) for solid in solids]


def _obstacle_solid(obstacle: Obstacle | Floor) -> _PlacedSolid:
    if isinstance(obstacle, Floor):
        return _PlacedSolid(_floor_solid(obstacle), np.eye(4))
    return _PlacedSolid(_primitive(obstacle.geometry, np.eye(4)), obstacle.T_world_obstacle)


def _floor_solid(floor: Floor) -> _Solid:
    """Return the half space below a floor, whose support function is finite straight up alone: h(z) = height."""

    def extent(n: Array) -> Array:
        is_up = n[..., 2] >= 1 - SHORT
        return np.where(is_up, floor.height, np.inf)

    return _Solid(
        coal_module().Halfspace(np.array([0.0, 0.0, 1.0]), floor.height), np.eye(4), extent
    )


def _nearest_of_solids(
    first: Sequence[_PlacedSolid], second: Sequence[_PlacedSolid], enough: float
) -> tuple[float, Array] | None:
    """Return the smallest distance of two groups of solids, and the points, as :func:`nearest_of_bodies`."""
    coal = coal_module()
    request = distance_request()
    result = coal.DistanceResult()
    nearest: tuple[float, Array] | None = None
    for (one, T1), (other, T2) in product(first, second):
        least = enough if nearest is None else nearest[0]
        if _separation(one, T1[None], other, T2[None])[0] >= least:
            continue
        pose1 = _transform(coal, T1)
        pose2 = _transform(coal, T2)
        gap = signed_distance(coal, one.shape, pose1, other.shape, pose2, request, result)
        if gap < least:
            nearest = gap, np.stack([result.getNearestPoint1(), result.getNearestPoint2()])
    return nearest


def _transform(coal: CoalModule, T: Array) -> Any:
    """Return a pose (4, 4) as coal's."""
    return coal.Transform3s(np.ascontiguousarray(T[:3, :3]), np.ascontiguousarray(T[:3, 3]))


def _separation(first: _Solid, T1: Array, second: _Solid, T2: Array) -> Array:
    """Return the largest gap between two solids along one of several directions, shape (N,), m.

    It is a lower bound of their distance: with the support function h of a solid, that is h(n) = max n . x over its
    points x, a plane of normal n lies between them if the gap along n is positive,

        gap(n) = n . (c2 - c1) - h1(n) - h2(-n),

    and two convex solids are as far apart as the largest gap (Boyd and Vandenberghe 2004, ch. 8.1). Tried are the axes
    of both solids, the line between their centres, its parts across an axis, and the common normal of the axes.
    """
    R1 = T1[:, :3, :3]
    R2 = T2[:, :3, :3]
    line = T2[:, :3, 3] - T1[:, :3, 3]
    z1 = R1[:, :, 2]
    z2 = R2[:, :, 2]
    across = [line - np.sum(line * z, axis=1, keepdims=True) * z for z in (z1, z2)]
    axes1 = [R1[:, :, i] for i in range(3)]
    axes2 = [R2[:, :, i] for i in range(3)]
    n = np.stack([*axes1, *axes2, line, *across, np.cross(z1, z2)], axis=1)

    length = np.linalg.norm(n, axis=2, keepdims=True)
    n = np.divide(n, length, out=np.broadcast_to(z1[:, None], n.shape).copy(), where=length > SHORT)
    along = np.einsum("nki,ni->nk", n, line)
    n = np.where(along[..., None] < 0, -n, n)

    # n in the frame of each solid, the second seen from outside.
    gaps: Array = np.abs(along) - first.extent(n @ R1) - second.extent(-n @ R2)
    largest: Array = gaps.max(axis=1)
    return largest


@lru_cache(maxsize=64)
def _solids(description: Description, meshes: MeshVersions) -> dict[LinkBody, tuple[_Solid, ...]]:
    """Return the solids of each body that has any."""
    found: dict[LinkBody, tuple[_Solid, ...]] = {}
    for part in link_parts(description):
        body = LinkBody(part.link, part.body)
        found[body] = (*found.get(body, ()), _solid(part))
    return found


def _solid(part: Part) -> _Solid:
    """Return the solid of a part; the support function of a mesh is the largest n . x of its corners x."""
    T = part.T_link_part
    if isinstance(part.geometry, Sphere | Capsule | Cylinder | Box):
        return _primitive(part.geometry, T)
    coal = coal_module()
    corners, faces = convex_hull(part)
    hull = coal.Convex(_vectors(corners), _triangles(faces))
    return _Solid(hull, T, lambda n: np.max(n @ corners.T, axis=-1))


def _primitive(geometry: Sphere | Capsule | Cylinder | Box, T: Array) -> _Solid:
    """Return a solid at a pose in its link's frame, with its support function h(n) = max n . x over its points x.

    With n = (n_x, n_y, n_z), radius r and half length l along z, or half edges e:

        sphere r,    capsule r + l |n_z|,    cylinder r hypot(n_x, n_y) + l |n_z|,    box sum e_i |n_i|.
    """
    coal = coal_module()
    match geometry:
        case Sphere():
            r = float(geometry.radius)
            return _Solid(coal.Sphere(r), T, lambda n: np.full(n.shape[:-1], r))
        case Capsule():
            r = float(geometry.radius)
            half = float(geometry.length) / 2
            return _Solid(coal.Capsule(r, 2 * half), T, lambda n: r + half * np.abs(n[..., 2]))
        case Cylinder():
            r = float(geometry.radius)
            half = float(geometry.length) / 2
            shape = coal.Cylinder(r, 2 * half)
            return _Solid(
                shape, T, lambda n: r * np.hypot(n[..., 0], n[..., 1]) + half * np.abs(n[..., 2])
            )
    edges = np.array([float(edge) for edge in geometry.size])
    return _Solid(coal.Box(*edges.tolist()), T, lambda n: np.abs(n) @ (edges / 2))


def _vectors(corners: Array) -> Any:
    vectors = coal_module().StdVec_Vec3s()
    vectors.extend(corners)
    return vectors


def _triangles(faces: NDArray[np.int_]) -> Any:
    coal = coal_module()
    triangles = coal.StdVec_Triangle()
    triangles.extend([coal.Triangle(*map(int, face)) for face in faces])
    return triangles
