"""Pictures of an arm as pixels, drawn without a browser or a graphics processor: triangles in a depth buffer."""

from __future__ import annotations

import logging
import operator
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import Array, Box, Capsule, Cylinder, Description, Mesh, Sphere
from dhkit.description.frames import joint_array
from dhkit.errors import ModelError
from dhkit.model.mesh_reader import read_part
from dhkit.model.shapes import Part, link_parts
from dhkit.viewer.drawables import grid_step
from dhkit.viewer.scene import first_configuration, frame_labels, node_transforms, scene_size

if TYPE_CHECKING:
    from PIL.Image import Image

log = logging.getLogger(__name__)

FINE = 2
"""Pixels that are drawn for one of the picture, along each edge: their mean smooths the edges."""
FIELD = np.radians(34.0)
"""Angle of view across the shorter edge, as in the page."""
MARGIN = 1.12
DIRECTION = np.array([0.62, -0.78, 0.36])
"""From the arm to the camera, for an arm that moves in space."""
FLAT = np.array([0.35, -0.5, 1.6])
"""For one whose moves stay near a horizontal plane."""
FRONT = np.array([0.0, -1.0, 0.14])
KEY, FILL = np.array([0.5, -0.55, 0.75]), np.array([-0.8, 0.3, 0.35])
"""Directions of the lights, in the world."""
AMBIENT, DIFFUSE, SOFT = 0.42, 0.5, 0.18
GROUND, LINES, PATH = (244, 245, 247), (205, 210, 219), (217, 72, 15)
AXES = ((229, 72, 77), (48, 164, 108), (59, 130, 246))
TRIAD = 0.11
"""Length of a frame's axes, share of the arm's size."""
GHOST = 0.35
"""Opacity."""
SIDES = 40
"""Of a round solid."""
BLOCK = 4_000_000
"""Pixels of triangles that are drawn at once."""
LARGEST = 4000
"""Pixels of an edge."""


@dataclass(frozen=True, eq=False)
class Ghost:
    """A translucent copy of the arm."""

    transforms: Array
    """Of its nodes, shape (n + 2, 4, 4) or (n + 2, 3, 4)."""
    color: tuple[int, int, int]
    """Red, green and blue, 0 to 255."""


@dataclass(frozen=True, eq=False)
class _Solid:
    """Triangles that move with a node."""

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
) -> Image:
    """Return a picture of an arm.

    Parameters
    ----------
    description
        The arm.
    q
        Joint values, shape (n,), rad and m; its first configuration if not given.
    size
        Width and height, px.
    frames
        Whether the DH frames are drawn, with their names.
    ghosts
        Translucent copies.
    path
        Points in the world that a line is drawn through, shape (N, 3), m.

    Raises
    ------
    ValueError
        Another shape, values that are not finite, or a size that is none.

    Notes
    -----
    A mesh that cannot be read is left out with a warning in the log that names file and cause.
    """
    state = first_configuration(description) if q is None else joint_array(description, q)
    if state.ndim != 1 or not np.isfinite(state).all():
        raise ValueError(f"q is {np.asarray(q).tolist()!r}; expected {description.n} finite joint values")
    return next(pictures(description, state[None], size=size, frames=frames, ghosts=ghosts, path=path))


def pictures(
    description: Description,
    q: ArrayLike,
    *,
    size: tuple[int, int] = (640, 480),
    frames: bool = False,
    ghosts: Sequence[Ghost] = (),
    path: ArrayLike | None = None,
    references: ArrayLike | None = None,
) -> Iterator[Image]:
    """Return pictures of an arm in several states, all of them seen from one place.

    Parameters
    ----------
    description, size, frames, ghosts, path
        As for :func:`picture`.
    q
        Joint values, shape (N, n), rad and m.
    references
        Joint values of a ghost that moves along, shape (N, n).
    """
    try:
        width, height = map(operator.index, size)
    except (TypeError, ValueError):
        raise ValueError(f"size is {size!r}; expected width and height in px, whole numbers") from None
    if not (16 <= width <= LARGEST and 16 <= height <= LARGEST):
        raise ValueError(f"size is {width} x {height}; expected 16 to {LARGEST} px an edge")
    solids = _solids(description)
    transforms = node_transforms(description, joint_array(description, q))
    beside = None if references is None else node_transforms(description, joint_array(description, references))
    points = np.zeros((0, 3)) if path is None else np.asarray(path, dtype=float)
    camera = _Camera.around(description, _extent(description, solids, transforms, ghosts, points, frames), size)
    ground = _ground(description, camera)
    for k, nodes in enumerate(transforms):
        image = ground
        for ghost in (*ghosts, *([] if beside is None else [Ghost(beside[k], (140, 153, 173))])):
            image = _blended(image, _drawn(solids, ghost.transforms, camera, image, np.array(ghost.color)), GHOST)
        yield _finished(_drawn(solids, nodes, camera, image), camera, description, nodes if frames else None, points)


# What is drawn


@lru_cache(maxsize=8)
def _solids(description: Description) -> tuple[_Solid, ...]:
    solids = []
    for part in link_parts(description):
        color = np.array([int(part.color[i : i + 2], 16) for i in (1, 3, 5)], dtype=float)
        try:
            solids.append(_Solid(part.link, _triangles(part), color))
        except ModelError as error:  # a mesh whose header is in order and whose content is not
            log.warning("%s; it is left out", error)
    return tuple(solids)


def _triangles(part: Part) -> Array:
    """Return a part's triangles in its link's frame, shape (m, 3, 3), m."""
    import trimesh

    shape = part.geometry
    match shape:
        case Mesh():
            return _placed(read_part(part).corners, part)
        case Box():
            edges = np.array([float(edge) for edge in shape.size])
            mesh, scale = trimesh.creation.box(edges / edges.max()), float(edges.max())
        case Sphere():
            mesh, scale = trimesh.creation.uv_sphere(1.0, count=[SIDES // 2, SIDES]), float(shape.radius)
        case Cylinder():
            scale = float(shape.radius)  # trimesh takes points that are nearer than 1e-8 for one
            mesh = trimesh.creation.cylinder(1.0, float(shape.length) / scale, sections=SIDES)
        case Capsule():
            scale = float(shape.radius)
            mesh = trimesh.creation.capsule(float(shape.length) / scale, 1.0, count=[SIDES, SIDES // 2])
            mesh.apply_translation([0, 0, -mesh.bounds.mean(axis=0)[2]])
    return _placed(scale * np.asarray(mesh.triangles, dtype=float), part)


def _placed(corners: Array, part: Part) -> Array:
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
    """Return the corners of boxes around all that is drawn, shape (k, 3), in the world."""
    seen = [points]
    for solid in solids:
        low, high = solid.corners.min(axis=(0, 1)), solid.corners.max(axis=(0, 1))
        box = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
        nodes = [transforms[:, solid.link], *(ghost.transforms[None, solid.link] for ghost in ghosts)]
        seen += [(box @ T[:3, :3].T + T[:3, 3]) for node in nodes for T in node]
    if frames:
        length = TRIAD * scene_size(description)
        tips = transforms[..., :3, 3, None] + length * transforms[..., :3, :3]
        seen.append(np.moveaxis(tips, -1, -2).reshape(-1, 3))
    return np.concatenate(seen)


# The camera


@dataclass(frozen=True, eq=False)
class _Camera:
    """A view of the world, in fine pixels."""

    eye: Array
    R: Array
    """Rows: right, down and ahead, in the world."""
    focus: float
    """Fine pixels."""
    size: tuple[int, int]
    """Fine pixels."""
    nearest: float
    """Depth of what is nearer or behind, m."""

    @classmethod
    def around(cls, description: Description, points: Array, size: tuple[int, int]) -> _Camera:
        """Return a camera that has all points in view."""
        up = -description.numbers.gravity
        up = np.array([0.0, 0.0, 1.0]) if not up.any() else up / np.linalg.norm(up)
        low, high = points.min(axis=0), points.max(axis=0)
        span = high - low
        towards = DIRECTION if abs(up[2]) > 0.5 else np.array([0.18, 0.0, 1.0]) + 0.14 * up
        if abs(up[2]) > 0.5 and span[2] < 0.25 * max(span[0], span[1]):
            towards = FLAT
        ahead = -towards / np.linalg.norm(towards)
        right = np.cross(ahead, up)
        right /= np.linalg.norm(right)
        R = np.stack([right, np.cross(ahead, right), ahead])
        fine = (FINE * size[0], FINE * size[1])
        focus = 0.5 * min(fine) / np.tan(FIELD / 2)
        centre = (low + high) / 2
        across = np.abs((points - centre) @ R[:2].T) * 2 * focus / np.array(fine)
        depth = (points - centre) @ ahead
        distance = float(np.max(MARGIN * across.max(axis=1) - depth))
        distance = max(distance, 0.3 * float(np.linalg.norm(span)) or scene_size(description))
        return cls(centre - distance * ahead, R, float(focus), fine, 1e-3 * distance)

    def seen(self, points: Array) -> Array:
        """Return points, shape (..., 3), as fine pixels right and down from the upper left, and the depth, m."""
        local = (points - self.eye) @ self.R.T
        depth = np.maximum(local[..., 2:], self.nearest)
        return np.concatenate([self.focus * local[..., :2] / depth + 0.5 * np.array(self.size), depth], axis=-1)


# Pixels


def _drawn(
    solids: Sequence[_Solid],
    transforms: Array,
    camera: _Camera,
    image: NDArray[np.uint8],
    tint: Array | None = None,
) -> NDArray[np.uint8]:
    """Return an image with an arm drawn over it."""
    corners, colors = [], []
    for solid in solids:
        T = transforms[solid.link]
        world = solid.corners @ T[:3, :3].T + T[:3, 3]
        normals = np.cross(world[:, 1] - world[:, 0], world[:, 2] - world[:, 0])
        lengths = np.linalg.norm(normals, axis=1)
        world, normals = world[lengths > 0], normals[lengths > 0] / lengths[lengths > 0, None]
        # Files may have triangles the wrong way round: the side that is seen is lit.
        towards = np.einsum("ij,ij->i", normals, camera.eye - world[:, 0])
        normals *= np.where(towards < 0, -1.0, 1.0)[:, None]
        light = AMBIENT + sum(
            strength * np.clip(normals @ (direction / np.linalg.norm(direction)), 0, None)
            for strength, direction in ((DIFFUSE, KEY), (SOFT, FILL))
        )
        corners.append(world)
        colors.append(np.clip(light[:, None] * (solid.color if tint is None else tint), 0, 255))
    if not corners:
        return image
    return _rasterized(camera.seen(np.concatenate(corners)), np.concatenate(colors), image)


def _rasterized(corners: Array, colors: Array, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
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
    drawn, nearest = image.reshape(-1, 3).copy(), np.zeros(height * width)
    # In blocks that cover a few million pixels each: triangles behind each other would need any amount of memory.
    boxes = np.ptp(np.clip(corners[..., :2], 0, [width, height]), axis=1) + 1
    block = np.cumsum(boxes.prod(axis=1)) // BLOCK
    for number in np.unique(block):
        chosen = block == number
        _draw_block(corners[chosen], colors[chosen], drawn, nearest, (height, width))
    return drawn.reshape(image.shape)


def _draw_block(corners: Array, colors: Array, drawn: NDArray[np.uint8], nearest: Array, size: tuple[int, int]) -> None:
    """Draw triangles over pixels, shape (height * width, 3), whose nearest 1/depth so far is known, and change both."""
    height, width = size
    which, y, left, right = _spans(corners[..., :2], height)
    first = np.clip(np.ceil(left - 0.5), 0, width).astype(int)
    counts = np.clip(np.floor(right - 0.5), -1, width - 1).astype(int) - first + 1
    kept = counts > 0
    which, y, first, counts = which[kept], y[kept], first[kept], counts[kept]
    x = np.repeat(first, counts) + _counted(counts)
    which, y = np.repeat(which, counts), np.repeat(y, counts)
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (corners[:, k].T for k in range(3))
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    area = np.where(np.abs(area) < 1e-12, np.inf, area)
    px, py = x + 0.5 - ax[which], y + 0.5 - ay[which]
    beta = (px * (cy - ay)[which] - py * (cx - ax)[which]) / area[which]
    gamma = (py * (bx - ax)[which] - px * (by - ay)[which]) / area[which]
    pixel = y * width + x
    # 1/depth is linear across the picture; the largest is the nearest.
    nearness = 1 / az[which] + beta * (1 / bz - 1 / az)[which] + gamma * (1 / cz - 1 / az)[which]
    np.maximum.at(nearest, pixel, nearness)
    front = nearness >= nearest[pixel]
    drawn[pixel[front]] = np.rint(colors[which[front]]).astype(np.uint8)


def _spans(corners: Array, height: int) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
    """Return the rows of pixels that triangles, shape (m, 3, 2), cover: triangle, row, and from where to where."""
    low = np.clip(np.ceil(corners[..., 1].min(axis=1) - 0.5), 0, height).astype(int)
    high = np.clip(np.floor(corners[..., 1].max(axis=1) - 0.5), -1, height - 1).astype(int)
    counts = np.maximum(high - low + 1, 0)
    which = np.repeat(np.arange(len(corners)), counts)
    row = np.repeat(low, counts) + _counted(counts)
    at = row + 0.5
    left, right = np.full(len(which), np.inf), np.full(len(which), -np.inf)
    for k in range(3):
        (px, py), (qx, qy) = corners[which, k].T, corners[which, (k + 1) % 3].T
        crosses = (py <= at) != (qy <= at)
        with np.errstate(divide="ignore", invalid="ignore"):
            x = px + (at - py) / (qy - py) * (qx - px)
        left = np.where(crosses, np.minimum(left, x), left)
        right = np.where(crosses, np.maximum(right, x), right)
    covered = left <= right
    return which[covered], row[covered], left[covered], right[covered]


def _counted(counts: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return 0 ... count - 1 for each of some counts, one after the other."""
    return np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)


def _blended(image: NDArray[np.uint8], drawn: NDArray[np.uint8], opacity: float) -> NDArray[np.uint8]:
    return np.rint((1 - opacity) * image + opacity * drawn).astype(np.uint8)


def _ground(description: Description, camera: _Camera) -> NDArray[np.uint8]:
    """Return the picture behind the arm: the ground with a grid that fades out."""
    from PIL import Image, ImageDraw

    image = Image.new("RGB", camera.size, GROUND)
    draw = ImageDraw.Draw(image)
    size = scene_size(description)
    step = grid_step(size)
    lines = int(np.ceil(1.3 * size / step))
    half = lines * step
    along = np.linspace(-half, half, 8 * lines + 1)
    for offset in step * np.arange(-lines, lines + 1):
        for turned in (False, True):
            points = np.stack([along, np.full_like(along, offset), np.zeros_like(along)], axis=1)
            points = points[:, [1, 0, 2]] if turned else points
            ahead = ((points - camera.eye) @ camera.R[2]) > 0.05 * size
            seen = camera.seen(points)[:, :2]
            for k in range(len(seen) - 1):
                fade = np.clip(1 - np.hypot(*points[k : k + 2, :2].mean(axis=0)) / half, 0, 1)
                if fade > 0 and ahead[k] and ahead[k + 1]:
                    color = tuple(int(g + fade * (line - g)) for g, line in zip(GROUND, LINES, strict=True))
                    draw.line([tuple(seen[k]), tuple(seen[k + 1])], fill=color, width=FINE)
    return np.asarray(image)


def _finished(
    image: NDArray[np.uint8], camera: _Camera, description: Description, nodes: Array | None, points: Array
) -> Image:
    """Return a fine image with lines and names over it, at the size asked for."""
    from PIL import Image, ImageDraw, ImageFont

    drawn = Image.fromarray(image)
    draw = ImageDraw.Draw(drawn)
    if len(points) > 1:
        draw.line([tuple(point) for point in camera.seen(points)[:, :2]], fill=PATH, width=2 * FINE, joint="curve")
    names = []
    if nodes is not None:
        length = TRIAD * scene_size(description)
        for T in nodes:
            origin = camera.seen(T[:3, 3])[:2]
            for axis, color in enumerate(AXES):
                end = camera.seen(T[:3, 3] + length * T[:3, axis])[:2]
                draw.line([tuple(origin), tuple(end)], fill=color, width=2 * FINE)
        names = [(label.text, camera.seen(nodes[label.frame][:3, 3])[:2] / FINE) for label in frame_labels(description)]
    small = drawn.resize((camera.size[0] // FINE, camera.size[1] // FINE), Image.Resampling.LANCZOS)
    draw, font = ImageDraw.Draw(small), ImageFont.load_default(max(12, small.height // 36))
    for text, (x, y) in names:
        wide = draw.textlength(text, font=font)
        left = x + 7 if x + 7 + wide + 4 < small.width else x - 7 - wide
        box = draw.textbbox((left, max(3.0, y - 17)), text, font=font)
        draw.rectangle((box[0] - 3, box[1] - 2, box[2] + 3, box[3] + 2), fill=(255, 255, 255))
        draw.text((left, max(3.0, y - 17)), text, fill=(29, 35, 48), font=font)
    return small
