"""Capsules that contain the shapes of an arm's links, and small ones around balls, of which they are made."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import Array, Box, Capsule, Cylinder, Description, Sphere, world_to_frames
from dhkit.model.mesh_reader import read_part
from dhkit.model.shapes import MeshVersions, Part, link_parts, mesh_versions
from dhkit.planning.obstacles.scene import rotations_onto

RADII = np.concatenate([[1.0], 1 + np.geomspace(2e-3, 0.5, 13)])
"""Radii tried about an axis, relative to the smallest possible: a wider capsule may be shorter and smaller."""
TILT_RATIO = 0.98
"""Largest ratio of volumes with which a tilted axis replaces one of symmetry."""
MAX_CAPSULES = 2
"""Largest number of capsules of a link: each costs an optimizer about a hundred operations at every point."""
MERGE_RATIO = 1.25
"""Largest ratio of volumes, of a common capsule over two capsules, with which the two are merged."""
RIM_CORNERS = 24
"""Number of corners of the polygon around a cylinder's rim, which is 0.9 % wider than the rim."""
THICKNESS = 1e-6
"""Thickness that a flat mesh is given, as a share of its size."""
LEAST_THICKNESS = 1e-6
"""Smallest thickness that a flat mesh is given, m."""


@dataclass(frozen=True, eq=False)
class Balls:
    """Balls whose convex hull is enclosed; points are balls of radius 0."""

    centres: Array
    """Centres, shape (N, 3), m."""
    radii: Array
    """Radii, shape (N,), m."""


@dataclass(frozen=True, eq=False)
class Enclosure:
    """A capsule around balls."""

    start: Array
    """Centre of the half ball at one end, shape (3,), m."""
    end: Array
    """Centre of the half ball at the other end, shape (3,), m."""
    radius: float
    """Radius, m."""

    @property
    def volume(self) -> float:
        """Volume, m^3: pi r^2 (length + 4/3 r)."""
        length = float(np.linalg.norm(self.end - self.start))
        return float(np.pi * self.radius**2 * (length + 4 / 3 * self.radius))


def enclose(balls: Balls) -> Enclosure:
    """Return a small capsule around balls, along a principal or a coordinate axis through the middle of their extent.

    A capsule is convex, so it contains the convex hull of the balls that it contains.
    """
    capsules = [_about(balls, R[:, 2], _middle(balls, R)) for R in _candidates(balls)]
    return min(capsules, key=lambda capsule: capsule.volume)


def refine(balls: Balls) -> Enclosure:
    """Return the capsule of :func:`enclose`, or a smaller one with a tilted axis.

    The axis is tilted by x_1 and x_2 and moved aside by x_3 and x_4 times the radius: in the frame R of the best axis
    through the point m, along R (x_1, x_2, 1) through m + radius R (x_3, x_4, 0). The simplex search of Nelder and Mead
    (1965) looks for the smallest volume.
    """
    from scipy.optimize import minimize

    ranked = sorted(
        _candidates(balls), key=lambda R: _about(balls, R[:, 2], _middle(balls, R)).volume
    )
    R = ranked[0]
    middle = _middle(balls, R)
    best = _about(balls, R[:, 2], middle)
    scale = best.radius

    def tilted(x: Array) -> Enclosure:
        direction = R @ np.array([x[0], x[1], 1.0])
        return _about(
            balls, direction / np.linalg.norm(direction), middle + scale * (R[:, :2] @ x[2:])
        )

    steps = np.concatenate([np.zeros((1, 4)), 0.1 * np.eye(4)])
    found = minimize(
        lambda x: tilted(x).volume,
        np.zeros(4),
        method="Nelder-Mead",
        options={"initial_simplex": steps, "maxfev": 120, "xatol": 1e-4, "fatol": 0.0},
    )
    other = tilted(found.x)
    return other if other.volume < TILT_RATIO * best.volume else best


def _candidates(balls: Balls) -> list[Array]:
    """Return rotations whose third columns are candidates for the axis."""
    # Principal axes: the right singular vectors of the centres about their mean.
    centred = balls.centres - balls.centres.mean(axis=0)
    principal = np.linalg.svd(centred, full_matrices=False)[2] if len(centred) > 2 else np.eye(3)
    axes = [*np.eye(3), *principal]
    # The longest direction of a pair of thin, oblique solids is not a principal axis.
    far = balls.centres[np.argmax(np.linalg.norm(centred, axis=1))]
    along = balls.centres[np.argmax(np.linalg.norm(balls.centres - far, axis=1))] - far
    if np.linalg.norm(along) > 0:
        axes.append(along / np.linalg.norm(along))
    return list(rotations_onto(np.array(axes)))


def _middle(balls: Balls, R: Array) -> Array:
    """Return the middle of the balls' extent along the columns of R."""
    local = balls.centres @ R
    low = (local - balls.radii[:, None]).min(axis=0)
    high = (local + balls.radii[:, None]).max(axis=0)
    middle: Array = R @ ((low + high) / 2)
    return middle


def _about(balls: Balls, axis: Array, middle: Array) -> Enclosure:
    """Return the smallest capsule about the line through a point along a unit vector."""
    offset = balls.centres - middle
    along = offset @ axis
    aside = np.linalg.norm(offset - along[:, None] * axis, axis=1)
    r = RADII[:, None] * np.max(aside + balls.radii)

    # A ball of radius rho beside the axis by e is inside if its centre is within r - rho of the segment [low, high]:
    #   low <= along + w  and  high >= along - w,    w^2 = (r - rho)^2 - e^2.
    w = np.sqrt(np.maximum((r - balls.radii) ** 2 - aside**2, 0.0))
    low = np.min(along + w, axis=1)
    high = np.max(along - w, axis=1)

    # Where low > high, one ball contains all.
    middles = (low + high) / 2
    is_segment = low < high
    low = np.where(is_segment, low, middles)
    high = np.where(is_segment, high, middles)

    # The smallest volume / pi.
    best = np.argmin(r[:, 0] ** 2 * (high - low + 4 / 3 * r[:, 0]))
    return Enclosure(middle + low[best] * axis, middle + high[best] * axis, float(r[best, 0]))


class LinkBody(NamedTuple):
    """A rigid body of a link; a link is one body, but links that were locked together are several."""

    link: int
    """Index of the link, 0 (the base) to n."""
    number: int = 0
    """Number of the body in the link, from 0, along the chain."""

    @property
    def name(self) -> str:
        """Name of its link."""
        return link_name(self.link)


@dataclass(frozen=True, eq=False)
class LinkCapsule:
    """A cylinder with half balls on its ends that moves with a link; a ball if start and end coincide."""

    body: LinkBody
    """The body around which it lies."""
    start: Array
    """Centre of the half ball at one end, in the link's DH frame, shape (3,), m."""
    end: Array
    """Centre of the half ball at the other end, likewise."""
    radius: float
    """Radius, m."""

    @property
    def link(self) -> int:
        """Index of the link, whose DH frame it is fixed to: 0 (the base) to n."""
        return self.body.link

    @property
    def name(self) -> str:
        """Name of its link."""
        return self.body.name

    @property
    def length(self) -> float:
        """Length of the axis, m."""
        return float(np.linalg.norm(self.end - self.start))


def link_name(link: int) -> str:
    """Return the name of a link, 0 (the base) to n."""
    return f"link {link}" if link else "the base"


def link_capsules(description: Description) -> tuple[LinkCapsule, ...]:
    """Return capsules that contain all that :func:`dhkit.model.shapes.link_parts` draws, at most two a body.

    A link is one body; links that were locked together are several. The solids of a body are merged into two groups,
    beginning with the pair whose common capsule is least larger than their own; into one group if its capsule is
    hardly larger.

    Raises
    ------
    ModelError
        A mesh that cannot be read.

    Examples
    --------
    >>> from dhkit.description.table_rows import from_dh
    >>> [capsule.link for capsule in link_capsules(from_dh([(0, 0.4, 0, "pi/2"), (0, 0, 0.3, 0)]))]
    [0, 1, 1, 2, 2]
    """
    # Equal descriptions may have their meshes in different folders.
    return _link_capsules(description, mesh_versions(description))


def world_axes(description: Description, q: ArrayLike) -> Array:
    """Return the ends of the axes of an arm's m capsules, in the world.

    Parameters
    ----------
    q
        Joint values, shape (..., n), rad and m.

    Returns
    -------
    Array
        Start and end of each axis, shape (..., m, 2, 3), m. NaN where q is not finite.
    """
    capsules = link_capsules(description)
    frames = world_to_frames(description, q)[..., [capsule.link for capsule in capsules], :, :]
    ends = np.array([(capsule.start, capsule.end) for capsule in capsules])

    # R x + p of each end x, as rows x^T R^T + p^T.
    axes: Array = (
        np.matmul(ends, np.swapaxes(frames[..., :3, :3], -1, -2)) + frames[..., None, :3, 3]
    )
    return axes


@lru_cache(maxsize=64)
def _link_capsules(description: Description, meshes: MeshVersions) -> tuple[LinkCapsule, ...]:
    bodies: dict[LinkBody, list[Part]] = {}
    for part in link_parts(description):
        bodies.setdefault(LinkBody(part.link, part.body), []).append(part)
    capsules = []
    for body, parts in sorted(bodies.items()):
        T = parts[0].T_link_body
        for group in _merge_groups([_balls(part) for part in parts]):
            # In the body's own frame, so that the capsules of a link stay the same when it is locked to another.
            fit = refine(group)
            start = T[:3, :3] @ fit.start + T[:3, 3]
            end = T[:3, :3] @ fit.end + T[:3, 3]
            start.setflags(write=False)
            end.setflags(write=False)
            capsules.append(LinkCapsule(body, start, end, fit.radius))
    return tuple(capsules)


def _merge_groups(groups: list[Balls]) -> list[Balls]:
    """Return at most ``MAX_CAPSULES`` groups of a link's solids; pairs with the least additional volume are merged."""
    volumes: dict[frozenset[int], float] = {}

    def volume(members: frozenset[int]) -> float:
        if members not in volumes:
            volumes[members] = enclose(_merge(groups, members)).volume
        return volumes[members]

    def additional(pair: tuple[frozenset[int], frozenset[int]]) -> float:
        first, second = pair
        return volume(first | second) - volume(first) - volume(second)

    sets = [frozenset([i]) for i in range(len(groups))]
    while len(sets) > 1:
        first, second = min(combinations(sets, 2), key=additional)
        if len(sets) <= MAX_CAPSULES and volume(first | second) > MERGE_RATIO * (
            volume(first) + volume(second)
        ):
            break
        sets = [members for members in sets if members not in (first, second)] + [first | second]
    return [_merge(groups, members) for members in sets]


def _merge(groups: list[Balls], members: frozenset[int]) -> Balls:
    """Return the balls of some groups as one group."""
    return Balls(
        np.concatenate([groups[i].centres for i in sorted(members)]),
        np.concatenate([groups[i].radii for i in sorted(members)]),
    )


def _balls(part: Part) -> Balls:
    """Return balls in the body's frame whose convex hull contains a part."""
    match part.geometry:
        case Sphere(radius):
            local = np.zeros((1, 3))
            radii = float(radius)
        case Capsule(radius, length):
            local = np.array([[0, 0, -0.5], [0, 0, 0.5]]) * float(length)
            radii = float(radius)
        case Cylinder(radius, length):
            local = _rims(float(radius), float(length))
            radii = 0.0
        case Box(size):
            corners = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T
            local = corners * [float(edge) for edge in size]
            radii = 0.0
        case _:
            local = convex_hull(part)[0]
            radii = 0.0
    R = part.T_body_part[:3, :3]
    t = part.T_body_part[:3, 3]
    return Balls(local @ R.T + t, np.full(len(local), radii))


def _rims(radius: float, length: float) -> Array:
    """Return the corners of polygons around a cylinder's two rims.

    The sides of a regular polygon of N corners touch the rim if its corners are at radius / cos(pi / N).
    """
    angles = 2 * np.pi * np.arange(RIM_CORNERS) / RIM_CORNERS
    x, y = np.array([np.cos(angles), np.sin(angles)]) * radius / np.cos(np.pi / RIM_CORNERS)
    return np.concatenate(
        [np.stack([x, y, np.full(RIM_CORNERS, z)], axis=1) for z in (-length / 2, length / 2)]
    )


def _thickened(vertices: Array) -> Array:
    """Return the corners of small cubes about the vertices of a flat mesh, whose hull contains that of the mesh."""
    edge = max(THICKNESS * float(np.ptp(vertices, axis=0).max(initial=0.0)), LEAST_THICKNESS)
    cube = np.array(list(product((-edge / 2, edge / 2), repeat=3)))
    thick: Array = (np.unique(vertices, axis=0)[:, None] + cube).reshape(-1, 3)
    return thick


def convex_hull(part: Part) -> tuple[Array, NDArray[np.int_]]:
    """Return the corners of a mesh's convex hull, shape (c, 3), m, and the triangles between them, shape (f, 3).

    Raises
    ------
    ModelError
        The mesh cannot be read.
    """
    from scipy.spatial import ConvexHull, QhullError

    vertices = read_part(part).vertices
    try:
        hull = ConvexHull(vertices)
    except QhullError:  # flat: a plate, one triangle, or less
        vertices = _thickened(vertices)
        hull = ConvexHull(vertices)
    place = np.full(len(vertices), -1)
    place[hull.vertices] = np.arange(len(hull.vertices))
    return vertices[hull.vertices], place[hull.simplices]
