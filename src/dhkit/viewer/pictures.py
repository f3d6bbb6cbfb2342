"""Pictures of an arm as pixels, drawn without a browser or a graphics processor: triangles in a depth buffer."""

from __future__ import annotations

import logging
import operator
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain, product, zip_longest
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull

from dhkit.description import Array, Box, Capsule, Cylinder, Description, Mesh, Sphere
from dhkit.description.frames import joint_array
from dhkit.errors import ModelError
from dhkit.model.mesh_reader import read_part
from dhkit.model.shapes import Part, link_parts
from dhkit.packages import imported
from dhkit.viewer.drawables import grid_step
from dhkit.viewer.overlays import AXIS_COLORS
from dhkit.viewer.scene import (
    PICTURE_TRIAD_SHARE,
    first_configuration,
    frame_labels,
    node_transforms,
    scene_size,
)

if TYPE_CHECKING:
    from PIL.Image import Image

    from dhkit.planning.obstacles import Scene

log = logging.getLogger(__name__)

_SUPERSAMPLING = 2
"""Fine pixels that are drawn for one pixel of the picture, along each edge: their mean smooths the edges."""
_FIELD_OF_VIEW = np.radians(34.0)
"""Angle of view across the shorter edge, rad, as in the page."""
_MARGIN = 1.12
"""Size of the picture over that of the drawn scene."""
_SPACE_DIRECTION = np.array([0.62, -0.78, 0.36])
"""Direction from the arm to the camera, world, for an arm that moves in space."""
_FLAT_DIRECTION = np.array([0.35, -0.5, 1.6])
"""The same for an arm whose motions stay near a horizontal plane."""
_LIGHTS = ((0.5, np.array([0.5, -0.55, 0.75])), (0.18, np.array([-0.8, 0.3, 0.35])))
"""Strengths of the lights, and directions to them, world."""
_AMBIENT_LIGHT = 0.42
GROUND_COLOR = (244, 245, 247)
_GRID_COLOR = (205, 210, 219)
_PATH_COLOR = (217, 72, 15)
_REFERENCE_COLOR = (140, 153, 173)
_GHOST_OPACITY = 0.35
_ROUND_SIDES = 40
"""Sides of a round solid."""
_BLOCK_PIXELS = 4_000_000
"""Pixels of triangles that are drawn at once."""
_OBSTACLE_OPACITY = 0.55
_OBSTACLE_COLOR = (109, 91, 176)
"""Red, green and blue of obstacles, as in the viewer."""
_MIN_EDGE = 16
"""Smallest width and height of a picture, px."""
_MAX_EDGE = 4000
"""Largest width and height of a picture, px."""


@dataclass(frozen=True, eq=False)
class Ghost:
    """A translucent copy of the arm.

    Attributes
    ----------
    transforms
        Poses of links 0 ... n and the tool, shape (n + 2, 4, 4), m, world.
    color
        Red, green and blue, 0 to 255.
    """

    transforms: Array
    color: tuple[int, int, int]


@dataclass(frozen=True, eq=False)
class _Solid:
    """Triangles that move with a link."""

    link: int
    corners: Array
    """Shape (m, 3, 3), m, in the link's frame."""
    color: Array
    """Red, green and blue, 0 to 255."""


def picture(
    description: Description,
    q: ArrayLike | None = None,
    *,
    size: tuple[int, int] = (960, 720),
    frames: bool = False,
    ghosts: Sequence[Ghost] = (),
    path: ArrayLike | None = None,
    obstacles: Scene = (),
) -> Image:
    """Return a picture of an arm.

    Parameters
    ----------
    description
        The arm.
    q
        Joint values, shape (n,), rad and m; the arm's first configuration if not given.
    size
        Width and height, px.
    frames
        Whether the DH frames are drawn, with their names.
    ghosts
        Translucent copies of the arm.
    path
        Points that a line is drawn through, shape (N, 3), m, world.
    obstacles
        Translucent obstacles; a floor is the ground of the picture.

    Raises
    ------
    ValueError
        The joint values have another shape or are not finite, or the size is not from 16 to 4000 px an edge.

    Notes
    -----
    A mesh that cannot be read is left out; a warning in the log names its file and the cause.
    """
    state = first_configuration(description) if q is None else joint_array(description, q)
    if state.ndim != 1 or not np.isfinite(state).all():
        raise ValueError(
            f"q is {np.asarray(q).tolist()!r}; expected {description.n} finite joint values"
        )
    return next(
        pictures(
            description,
            state[None],
            size=size,
            frames=frames,
            ghosts=ghosts,
            path=path,
            obstacles=obstacles,
        )
    )


def pictures(
    description: Description,
    q: ArrayLike,
    *,
    size: tuple[int, int] = (640, 480),
    frames: bool = False,
    ghosts: Sequence[Ghost] = (),
    path: ArrayLike | None = None,
    obstacles: Scene = (),
    references: ArrayLike | None = None,
) -> Iterator[Image]:
    """Return pictures of an arm in several states, all seen from one place.

    Parameters
    ----------
    description, size, frames, ghosts, path, obstacles
        As for :func:`picture`.
    q
        Joint values, shape (N, n), rad and m.
    references
        Joint values of a ghost that moves along, shape (N, n), rad and m.
    """
    try:
        width, height = map(operator.index, size)
    except (TypeError, ValueError):
        raise ValueError(
            f"size is {size!r}; expected width and height in px, whole numbers"
        ) from None
    if not (_MIN_EDGE <= width <= _MAX_EDGE and _MIN_EDGE <= height <= _MAX_EDGE):
        raise ValueError(
            f"size is {width} x {height}; expected {_MIN_EDGE} to {_MAX_EDGE} px an edge"
        )
    solids = _solids(description)
    transforms = node_transforms(description, joint_array(description, q))
    moving: Array = np.zeros((0, 4, 4))
    if references is not None:
        moving = node_transforms(description, joint_array(description, references))
    points = np.zeros((0, 3)) if path is None else np.asarray(path, dtype=float)
    # Obstacles stand still: they are of one more node, after the tool, which is the world.
    around = _obstacle_solids(obstacles, transforms.shape[-3])
    in_view = np.concatenate([points, *(solid.corners.reshape(-1, 3) for solid in around)])
    camera = _Camera.around(
        description, _extent(description, solids, transforms, ghosts, in_view, frames), size
    )
    ground = _draw_ground(description, camera)
    for nodes, reference in zip_longest(transforms, moving):
        image = ground
        for ghost in (
            *ghosts,
            *([] if reference is None else [Ghost(reference, _REFERENCE_COLOR)]),
        ):
            with_ghost = _draw_arm(solids, ghost.transforms, camera, image, np.array(ghost.color))
            image = _mixed(image, with_ghost, _GHOST_OPACITY)
        arm = _draw_arm(solids, nodes, camera, image)
        if around:
            world = np.concatenate([nodes, np.eye(4)[None]])
            covered = _draw_arm((*solids, *around), world, camera, image)
            arm = _mixed(arm, covered, _OBSTACLE_OPACITY)
        image = arm
        yield _finish(image, camera, description, nodes if frames else None, points)


# Solids of the picture


@lru_cache(maxsize=8)
def _solids(description: Description) -> tuple[_Solid, ...]:
    solids = []
    for part in link_parts(description):
        color = np.array([int(part.color[i : i + 2], 16) for i in (1, 3, 5)], dtype=float)
        try:
            solids.append(_Solid(part.link, _triangles(part), color))
        except ModelError as error:  # the mesh has a valid header, and content that is not valid
            log.warning("%s; it is left out", error)
    return tuple(solids)


def _obstacle_solids(obstacles: Scene, node: int) -> tuple[_Solid, ...]:
    """Return obstacles as solids of a node that is the world; a floor has none."""
    from dhkit.planning.obstacles import Floor, check_obstacles

    trimesh = imported("trimesh", "a picture")
    ball = trimesh.creation.uv_sphere(1.0, count=[_ROUND_SIDES // 2, _ROUND_SIDES]).vertices
    solids = []
    for obstacle in check_obstacles(obstacles):
        if isinstance(obstacle, Floor):
            continue
        # Each obstacle is a box of half edges h, each point of which is the centre of a ball of radius r: the hull of
        # balls around the eight corners.
        corners = np.array(list(product((-1.0, 1.0), repeat=3))) * obstacle.half_sizes
        surface = corners[:, None] + obstacle.radius * ball
        T = obstacle.T_world_obstacle
        cloud = surface.reshape(-1, 3) @ T[:3, :3].T + T[:3, 3]
        triangles = cloud[ConvexHull(cloud).simplices]
        solids.append(_Solid(node, triangles, np.array(_OBSTACLE_COLOR, dtype=float)))
    return tuple(solids)


def _triangles(part: Part) -> Array:
    """Return a part's triangles in its link's frame, shape (m, 3, 3), m."""
    trimesh = imported("trimesh", "a picture")

    shape = part.geometry
    match shape:
        case Mesh():
            scale = 1.0
            corners = read_part(part).corners
        case Box():
            edges = np.array([float(edge) for edge in shape.size])
            mesh = trimesh.creation.box(edges / edges.max())
            scale = float(edges.max())
        case Sphere():
            mesh = trimesh.creation.uv_sphere(1.0, count=[_ROUND_SIDES // 2, _ROUND_SIDES])
            scale = float(shape.radius)
        case Cylinder():
            # Of unit size, since trimesh merges points nearer than 1e-8.
            scale = float(shape.radius)
            mesh = trimesh.creation.cylinder(
                1.0, float(shape.length) / scale, sections=_ROUND_SIDES
            )
        case Capsule():
            scale = float(shape.radius)
            mesh = trimesh.creation.capsule(
                float(shape.length) / scale, 1.0, count=[_ROUND_SIDES, _ROUND_SIDES // 2]
            )
            mesh.apply_translation([0, 0, -mesh.bounds.mean(axis=0)[2]])
    if not isinstance(shape, Mesh):
        corners = scale * np.asarray(mesh.triangles, dtype=float)
    T = part.T_link_part
    return corners @ T[:3, :3].T + T[:3, 3]


def _extent(
    description: Description,
    solids: Sequence[_Solid],
    transforms: Array,
    ghosts: Sequence[Ghost],
    points: Array,
    frames: bool,
) -> Array:
    """Return the corners of boxes around all that is drawn, shape (k, 3), m, world."""
    extent = [points]
    for solid in solids:
        low = solid.corners.min(axis=(0, 1))
        high = solid.corners.max(axis=(0, 1))
        box = np.array(list(product(*zip(low, high, strict=True))))
        nodes = [
            transforms[:, solid.link],
            *(ghost.transforms[None, solid.link] for ghost in ghosts),
        ]
        extent += [box @ T[:3, :3].T + T[:3, 3] for T in chain.from_iterable(nodes)]
    if frames:
        length = PICTURE_TRIAD_SHARE * scene_size(description)
        tips = transforms[..., :3, 3, None] + length * transforms[..., :3, :3]
        extent.append(np.moveaxis(tips, -1, -2).reshape(-1, 3))
    return np.concatenate(extent)


# The camera


@dataclass(frozen=True, eq=False)
class _Camera:
    """A pinhole camera, whose image is in fine pixels."""

    eye: Array
    """Position, shape (3,), m, world."""
    R: Array
    """Directions right, down and ahead as rows, shape (3, 3), world."""
    focal_length: float
    """Focal length, fine pixels."""
    size: tuple[int, int]
    """Width and height, fine pixels."""
    min_depth: float
    """Depth that nearer points, and those behind the camera, are drawn at, m."""

    @classmethod
    def around(cls, description: Description, points: Array, size: tuple[int, int]) -> _Camera:
        """Return a camera that has all points, shape (k, 3), m, world, in view, for a picture of a size in px."""
        up = -description.numbers.gravity
        up = np.array([0.0, 0.0, 1.0]) if not up.any() else up / np.linalg.norm(up)
        low = points.min(axis=0)
        high = points.max(axis=0)
        span = high - low

        # The direction from the scene towards the camera: obliquely from above, and steeper for a flat scene.
        towards = _SPACE_DIRECTION if abs(up[2]) > 0.5 else np.array([0.18, 0.0, 1.0]) + 0.14 * up
        if abs(up[2]) > 0.5 and span[2] < 0.25 * max(span[0], span[1]):
            towards = _FLAT_DIRECTION

        # The camera's axes as rows of R: right, down, ahead.
        ahead = -towards / np.linalg.norm(towards)
        right = np.cross(ahead, up)
        right /= np.linalg.norm(right)
        R = np.stack([right, np.cross(ahead, right), ahead])
        fine = (_SUPERSAMPLING * size[0], _SUPERSAMPLING * size[1])
        # A camera at the distance D from the centre sees the point (x, y, depth) at f x / (D + depth) pixels, which
        # are at most half the width w:  D >= 2 f |x| / w - depth,  and likewise for y.
        focal_length = 0.5 * min(fine) / np.tan(_FIELD_OF_VIEW / 2)
        centre = (low + high) / 2
        across = np.abs((points - centre) @ R[:2].T) * 2 * focal_length / np.array(fine)
        depth = (points - centre) @ ahead
        distance = float(np.max(_MARGIN * across.max(axis=1) - depth))
        distance = max(distance, 0.3 * float(np.linalg.norm(span)) or scene_size(description))
        return cls(centre - distance * ahead, R, float(focal_length), fine, 1e-3 * distance)

    def project(self, points: Array) -> Array:
        """Return points, shape (..., 3), m, world, as fine pixels right and down from the upper left, and depth, m."""
        local = (points - self.eye) @ self.R.T
        depth = np.maximum(local[..., 2:], self.min_depth)

        # Pinhole camera: (u, v) = f (x, y) / depth, about the middle of the picture.
        pixels = self.focal_length * local[..., :2] / depth + 0.5 * np.array(self.size)
        return np.concatenate([pixels, depth], axis=-1)


# Pixels


def _mixed(below: NDArray[np.uint8], above: NDArray[np.uint8], opacity: float) -> NDArray[np.uint8]:
    """Return an image with another over it that is translucent."""
    return np.rint((1 - opacity) * below + opacity * above).astype(np.uint8)


def _draw_arm(
    solids: Sequence[_Solid],
    transforms: Array,
    camera: _Camera,
    image: NDArray[np.uint8],
    tint: Array | None = None,
) -> NDArray[np.uint8]:
    """Return an image with an arm drawn over it."""
    corners = []
    colors = []
    for solid in solids:
        T = transforms[solid.link]
        world = solid.corners @ T[:3, :3].T + T[:3, 3]
        normals = np.cross(world[:, 1] - world[:, 0], world[:, 2] - world[:, 0])
        lengths = np.linalg.norm(normals, axis=1)
        world = world[lengths > 0]
        normals = normals[lengths > 0] / lengths[lengths > 0, None]
        # Files may have triangles the wrong way round: the side that is seen is lit.
        towards = np.einsum("ij,ij->i", normals, camera.eye - world[:, 0])
        normals *= np.where(towards < 0, -1.0, 1.0)[:, None]
        light = _AMBIENT_LIGHT + sum(
            strength * np.clip(normals @ (direction / np.linalg.norm(direction)), 0, None)
            for strength, direction in _LIGHTS
        )
        corners.append(world)
        colors.append(np.clip(light[:, None] * (solid.color if tint is None else tint), 0, 255))
    if not corners:
        return image
    return _rasterize(camera.project(np.concatenate(corners)), np.concatenate(colors), image)


def _rasterize(corners: Array, colors: Array, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return an image with triangles drawn over it, the nearest on top: all of their pixels at once.

    Parameters
    ----------
    corners
        Pixels right and down, and depth, shape (m, 3, 3).
    colors
        Shape (m, 3), 0 to 255.
    image
        Shape (height, width, 3).
    """
    height, width = image.shape[:2]
    drawn = image.reshape(-1, 3).copy()
    nearest = np.zeros(height * width)
    # Blocks of triangles cover a few million pixels each: the memory for all at once would have no bound.
    boxes = np.ptp(np.clip(corners[..., :2], 0, [width, height]), axis=1) + 1
    block = np.cumsum(boxes.prod(axis=1)) // _BLOCK_PIXELS
    for number in np.unique(block):
        chosen = block == number
        _draw_block(corners[chosen], colors[chosen], drawn, nearest, (height, width))
    return drawn.reshape(image.shape)


def _draw_block(
    corners: Array, colors: Array, drawn: NDArray[np.uint8], nearest: Array, size: tuple[int, int]
) -> None:
    """Draw triangles, shape (m, 3, 3), over pixels, shape (height * width, 3), and update their largest 1/depth."""
    height, width = size
    # The pixels of each span: those whose centres, at x + 1/2, lie between its ends.
    which, y, left, right = _spans(corners[..., :2], height)
    first = np.clip(np.ceil(left - 0.5), 0, width).astype(int)
    counts = np.clip(np.floor(right - 0.5), -1, width - 1).astype(int) - first + 1
    kept = counts > 0
    which = which[kept]
    y = y[kept]
    first = first[kept]
    counts = counts[kept]
    x = np.repeat(first, counts) + _ranges(counts)
    which = np.repeat(which, counts)
    y = np.repeat(y, counts)

    # Barycentric coordinates of a pixel's centre p in the triangle a, b, c (shares of its area):
    #     p = a + beta (b - a) + gamma (c - a).
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (corners[:, k].T for k in range(3))
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    area = np.where(np.abs(area) < 1e-12, np.inf, area)
    px = x + 0.5 - ax[which]
    py = y + 0.5 - ay[which]
    beta = (px * (cy - ay)[which] - py * (cx - ax)[which]) / area[which]
    gamma = (py * (bx - ax)[which] - px * (by - ay)[which]) / area[which]
    pixel = y * width + x

    # 1/depth is linear across the picture; the largest is the nearest.
    nearness = 1 / az[which] + beta * (1 / bz - 1 / az)[which] + gamma * (1 / cz - 1 / az)[which]
    np.maximum.at(nearest, pixel, nearness)
    front = nearness >= nearest[pixel]
    drawn[pixel[front]] = np.rint(colors[which[front]]).astype(np.uint8)


def _spans(corners: Array, height: int) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
    """Return the rows of pixels that triangles, shape (m, 3, 2), cover: triangle, row, left and right end."""
    # Rows whose middle, at y + 1/2, lies between a triangle's lowest and highest corner.
    low = np.clip(np.ceil(corners[..., 1].min(axis=1) - 0.5), 0, height).astype(int)
    high = np.clip(np.floor(corners[..., 1].max(axis=1) - 0.5), -1, height - 1).astype(int)
    counts = np.maximum(high - low + 1, 0)
    which = np.repeat(np.arange(len(corners)), counts)
    row = np.repeat(low, counts) + _ranges(counts)

    # A span ends where the middle of the row crosses edges p q of the triangle.
    at = row + 0.5
    left = np.full(len(which), np.inf)
    right = np.full(len(which), -np.inf)
    for k in range(3):
        px, py = corners[which, k].T
        qx, qy = corners[which, (k + 1) % 3].T
        crosses = (py <= at) != (qy <= at)
        with np.errstate(divide="ignore", invalid="ignore"):
            x = px + (at - py) / (qy - py) * (qx - px)
        left = np.where(crosses, np.minimum(left, x), left)
        right = np.where(crosses, np.maximum(right, x), right)
    covered = left <= right
    return which[covered], row[covered], left[covered], right[covered]


def _ranges(counts: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return 0 ... count - 1 for each of the counts, joined."""
    return np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)


def _draw_ground(description: Description, camera: _Camera) -> NDArray[np.uint8]:
    """Return the picture behind the arm: the ground with a grid that fades out."""
    from PIL import Image, ImageDraw

    image = Image.new("RGB", camera.size, GROUND_COLOR)
    draw = ImageDraw.Draw(image)
    size = scene_size(description)
    step = grid_step(size)
    lines = int(np.ceil(1.3 * size / step))
    half = lines * step
    along = np.linspace(-half, half, 8 * lines + 1)

    # Each grid line is drawn in pieces, whose colour fades with the distance of their middle from the origin.
    for offset in step * np.arange(-lines, lines + 1):
        for swapped in (False, True):
            points = np.stack([along, np.full_like(along, offset), np.zeros_like(along)], axis=1)
            points = points[:, [1, 0, 2]] if swapped else points
            ahead = ((points - camera.eye) @ camera.R[2]) > 0.05 * size
            pixels = camera.project(points)[:, :2]
            for k in range(len(pixels) - 1):
                fade = np.clip(1 - np.hypot(*points[k : k + 2, :2].mean(axis=0)) / half, 0, 1)
                if fade > 0 and ahead[k] and ahead[k + 1]:
                    color = tuple(
                        int(g + fade * (line - g))
                        for g, line in zip(GROUND_COLOR, _GRID_COLOR, strict=True)
                    )
                    draw.line(
                        [tuple(pixels[k]), tuple(pixels[k + 1])], fill=color, width=_SUPERSAMPLING
                    )
    return np.asarray(image)


def _finish(
    image: NDArray[np.uint8],
    camera: _Camera,
    description: Description,
    nodes: Array | None,
    points: Array,
) -> Image:
    """Return the picture of a fine image, with lines and names drawn over it."""
    from PIL import Image, ImageDraw, ImageFont

    drawn = Image.fromarray(image)
    draw = ImageDraw.Draw(drawn)
    if len(points) > 1:
        line = [tuple(point) for point in camera.project(points)[:, :2]]
        draw.line(line, fill=_PATH_COLOR, width=2 * _SUPERSAMPLING, joint="curve")
    names = []
    if nodes is not None:
        length = PICTURE_TRIAD_SHARE * scene_size(description)
        for T in nodes:
            origin = camera.project(T[:3, 3])[:2]
            for axis, color in enumerate(AXIS_COLORS):
                end = camera.project(T[:3, 3] + length * T[:3, axis])[:2]
                draw.line([tuple(origin), tuple(end)], fill=color, width=2 * _SUPERSAMPLING)
        names = [
            (label.text, camera.project(nodes[label.frame][:3, 3])[:2] / _SUPERSAMPLING)
            for label in frame_labels(description)
        ]

    # The fine picture is reduced, and names are written at the size of the small one.
    small = drawn.resize(
        (camera.size[0] // _SUPERSAMPLING, camera.size[1] // _SUPERSAMPLING),
        Image.Resampling.LANCZOS,
    )
    draw = ImageDraw.Draw(small)
    font = ImageFont.load_default(max(12, small.height // 36))
    for text, (x, y) in names:
        width = draw.textlength(text, font=font)
        left = x + 7 if x + 7 + width + 4 < small.width else x - 7 - width
        box = draw.textbbox((left, max(3.0, y - 17)), text, font=font)
        draw.rectangle((box[0] - 3, box[1] - 2, box[2] + 3, box[3] + 2), fill=(255, 255, 255))
        draw.text((left, max(3.0, y - 17)), text, fill=(29, 35, 48), font=font)
    return small
