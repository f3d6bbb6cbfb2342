"""What an arm looks like: the shapes that its description gives, and links drawn from the table where it gives none.

A link goes from its joint's axis to the next one: by d along the first, then by a along the common normal of the two.
Drawn, these are a column and a tube. Where it meets the next axis it carries a drum, in which the next link turns on a
slimmer, longer hub. A prismatic joint is a square bar of the stroke's length in a block. All sizes are shares of the
arm's reach, so that an arm looks the same whatever its size.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np

from dhkit.description.assets import inside
from dhkit.description.numbers import Array, matrix
from dhkit.description.parameters import resolved
from dhkit.description.robot import (
    Box,
    Convention,
    Cylinder,
    Description,
    Geometry,
    Mesh,
    Shape,
    Sphere,
)
from dhkit.expressions import Expression, exact, substitute

__all__ = ["Part", "link_parts"]

Solid: TypeAlias = tuple[Geometry, Array]
"""A geometry and its (4, 4) pose in its link's DH frame."""

BASE_COLOR = "#4a4f57"
"""Foot and gripper: dark, so that they are not taken for links."""
PALETTE = ("#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377", "#bbbbbb")
"""Links 1, 2 ...: Tol's bright scheme (SRON/EPS/TN/09-002, 2021), told apart by colour-blind people too."""

ROOT, TIP = 0.05, 0.028
"""Radius of the first and of the last drum, shares of the reach; arms taper."""
TUBE = 0.62
"""Radius of a tube, of the smaller drum at its ends: drums stay seen as drums."""
FLAT = 0.9
"""Half the height of a drum, of its radius: higher than the tube is wide, no higher than the arm."""
HUB_RADIUS, HUB_LENGTH = 0.8, 1.2
"""A hub, of its drum: slimmer, and seen at both faces."""
NESTED_RADIUS, NESTED_HALF = 0.78, 1.25
"""Drums about one point get slimmer and longer than the one before, so that each is seen."""
BLOCK = 1.3
"""Half the length of a slider's block, of its half width."""
BAR, STOP = 0.55, 0.8
"""Half the width of a slider's bar and of the plates at a rail's ends, of its block's."""
PLATE, POST_LENGTH = 1.8, 2.0
"""Radius of the foot's plate and height of the post on it, of the first drum's radius."""
THIN = 0.25
"""Thickness of a plate, of the radius of its drum or the half width of its block."""
UPRIGHT = 0.999
"""Cosine from which an axis counts as vertical."""

ALONG_X = np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
"""Lays what stands along z along x."""


@dataclass(frozen=True, eq=False)
class Part:
    """One solid that moves with a link."""

    link: int
    """The DH frame that it is fixed to: 0 (the base) to n."""
    geometry: Geometry
    """Sizes in m, numbers without parameters; cylinders and capsules lie along z, centred."""
    T_link_part: Array
    """Shape (4, 4): the solid in DH frame ``link``, m."""
    color: str
    """``#rrggbb``."""
    file: Path | None = None
    """The mesh's file; None for other geometry."""


def link_parts(description: Description) -> tuple[Part, ...]:
    """Return the solids of an arm's links, from the base to the tool.

    A link with shapes in its description has those. Without, or with a mesh whose file is missing, it is drawn from
    the table, and so is the tool: a gripper that reaches along the tool's z (along x_n where the arm has no tool and
    ends in a common normal, as planar ones do) and closes along its x.

    Examples
    --------
    >>> from dhkit.description.table import from_dh
    >>> arm = from_dh([(0, 0.4, 0, "pi/2"), (0, 0, 0.3, 0)])
    >>> [part.link for part in link_parts(arm) if isinstance(part.geometry, Cylinder)]
    [0, 0, 1, 1, 1, 2, 2, 2]
    """
    n, T_last_tool = description.n, description.numbers.T_last_tool
    values = resolved(description.parameters)
    arm = _Drawing(description)
    parts: list[Part] = []
    for i in range(n + 1):
        shapes = description.joints[i - 1].shapes if i else description.base.shapes
        color = PALETTE[(i - 1) % len(PALETTE)] if i else BASE_COLOR
        given = _given(description, values, shapes, i, np.eye(4), color)
        parts += given or (Part(i, geometry, T, color) for geometry, T in arm.link(i))
    tool = _given(description, values, description.tool.shapes, n, T_last_tool, BASE_COLOR)
    if not tool and (not given or not np.array_equal(T_last_tool, np.eye(4))):
        tool = [Part(n, geometry, T, BASE_COLOR) for geometry, T in arm.gripper()]
    return (*parts, *tool)


def _given(
    description: Description,
    values: Mapping[str, Expression],
    shapes: Sequence[Shape],
    link: int,
    T_link_frame: Array,
    color: str,
) -> list[Part]:
    """Return shapes placed in a frame of a link as parts; none if a mesh's file is missing."""
    parts = []
    for shape in shapes:
        geometry, file = _known(shape.geometry, values), None
        if isinstance(geometry, Mesh):
            file = inside(description.mesh_folder, geometry.path, "shape")
            if file is None or not file.is_file():
                return []
        T = T_link_frame @ matrix(shape.placement, dict(values))
        parts.append(Part(link, geometry, T, shape.color or color, file))
    return parts


def _known(geometry: Geometry, values: Mapping[str, Expression]) -> Geometry:
    """Return a geometry with the parameters' values in it."""
    match geometry:
        case Mesh(path, scale):
            return Mesh(path, substitute(scale, values))
        case Box((x, y, z)):
            return Box((substitute(x, values), substitute(y, values), substitute(z, values)))
        case Sphere(radius):
            return Sphere(substitute(radius, values))
    return type(geometry)(substitute(geometry.radius, values), substitute(geometry.length, values))


@dataclass(frozen=True, eq=False)
class _Link:
    """The way of a link: along its joint's axis by d to a corner, from there along the common normal by a to its end.

    The base has only the second half. Poses are in the link's DH frame.
    """

    d: float
    """m; that of a prismatic joint at q = 0."""
    a: float
    """m."""
    T_corner: Array
    """Shape (4, 4): z along the link's own joint axis, x along the common normal."""
    T_end: Array
    """Shape (4, 4): z along the next joint's axis, the same x."""

    @property
    def is_parallel(self) -> bool:
        """Whether the axes of its two joints are."""
        return bool(np.array_equal(np.abs(self.T_corner[:3, 2]), np.abs(self.T_end[:3, 2])))

    def is_straight(self, within: float) -> bool:
        """Whether it ends on the axis that it began on, up to a distance in m."""
        return self.is_parallel and abs(self.a) < within


@dataclass(frozen=True)
class _Joint:
    """The sizes of a joint, m, along its axis from the end of the link before it."""

    prismatic: bool
    radius: float
    """Of the drum; half the width of a slider's block."""
    half: float
    """Half the drum's height; half the block's length."""
    lift: float = 0.0
    """Where the drum's centre is."""
    stroke: tuple[float, float] = (0.0, 0.0)
    """Where a slider's corner can be."""
    rod: bool = False
    """Whether the bar slides in a block of the link before, or carries the block."""
    theta: float = 0.0
    """A slider's angle about its axis, rad."""


def _links(description: Description) -> list[_Link]:
    """Return the ways of links 0 to n."""
    numbers = description.numbers
    normals = [np.eye(4) for _ in range(description.n)]
    for T, a, c, s in zip(normals, numbers.a, numbers.cos_alpha, numbers.sin_alpha, strict=True):
        T[:3, 1:] = [[0, 0, a], [c, -s, 0], [s, c, 0]]
    d, none = [0.0, *map(float, numbers.d)], np.eye(4)
    # A row's a and alpha lead to the end of its own link; in the modified convention to that of the link before.
    if description.convention is Convention.STANDARD:
        return [_Link(x, float(T[0, 3]), np.linalg.inv(T), none) for x, T in zip(d, [none, *normals], strict=True)]
    return [_Link(x, float(T[0, 3]), none, T) for x, T in zip(d, [*normals, none], strict=True)]


def _joints(description: Description, links: Sequence[_Link]) -> list[_Joint]:
    """Return the sizes of joints 1 to n."""
    numbers, n = description.numbers, description.n
    scale = description.reach or float(np.linalg.norm(numbers.T_last_tool[:3, 3])) or 1.0
    joints: list[_Joint] = []
    for i, before in enumerate(links[:n]):
        link, prismatic = links[i + 1], bool(numbers.prismatic[i])
        radius = scale * (ROOT + (TIP - ROOT) * i / n)
        half = radius * (BLOCK if prismatic else FLAT)
        lift = 0.0
        if i and abs(before.d) + abs(before.a) < joints[-1].radius and not joints[-1].rod:
            last = joints[-1]
            radius = min(radius, NESTED_RADIUS * last.radius)
            half = max(half, NESTED_HALF * max(last.radius, last.half))
        if i == 0 and abs(link.d) > radius:  # frame 0 is on the floor: the drum stands on it, below the next axis
            half = min(half, 0.3 * abs(link.d))
            lift = float(np.copysign(HUB_LENGTH * half, link.d))
        if not prismatic:
            joints.append(_Joint(False, radius, half, lift))
            continue
        low, high = (
            float(x) if np.isfinite(x) else s * scale for x, s in ((numbers.lower[i], -1), (numbers.upper[i], 1))
        )
        # What goes on along the bar would be inside a rail. But under a column there is no room for a rod.
        rod = link.is_straight(radius) and not all(x.is_straight(radius) for x in links[: i + 1])
        joints.append(_Joint(True, radius, half, 0.0, (link.d + low, link.d + high), rod, float(numbers.theta[i])))
    return joints


class _Drawing:
    """The links of an arm as solids, from its table alone."""

    def __init__(self, description: Description) -> None:
        self.links = _links(description)
        self.joints = _joints(description, self.links)
        self.T_world_base = description.numbers.T_world_base
        self.T_last_tool = description.numbers.T_last_tool

    def link(self, i: int) -> Iterator[Solid]:
        """Draw link i in its DH frame: where it begins, its column and tube, where the next one begins."""
        link = self.links[i]
        joint = self.joints[i - 1] if i else None
        following = self.joints[i] if i < len(self.joints) else None
        tube = TUBE * min(x.radius for x in (joint, following) if x)
        if joint:
            yield from self._beginning(link, joint, tube)
        elif following and not following.prismatic:
            yield from self._foot(link)
        if link.a:
            yield _cylinder(link.T_corner @ ALONG_X, tube, 0.0, link.a)
            if link.d:
                yield Sphere(_size(tube)), link.T_corner
        if following:
            yield from _housing(link, following)

    def _beginning(self, link: _Link, joint: _Joint, tube: float) -> Iterator[Solid]:
        if not joint.prismatic:
            T_start = link.T_corner @ _shift(z=-link.d)
            half = HUB_LENGTH * joint.half
            yield _cylinder(T_start, HUB_RADIUS * joint.radius, joint.lift - half, joint.lift + half)
            if link.d:
                yield _cylinder(T_start, tube, 0.0, link.d)
            return
        T_slider = link.T_corner @ _about_z(-joint.theta)
        if joint.rod:
            near = float(np.clip(0.0, *joint.stroke))
            low, high = _span(near - joint.stroke[1], near - joint.stroke[0], joint.half)
            yield _box(T_slider, BAR * joint.radius, BAR * joint.radius, low, high)
        else:
            yield _box(T_slider, joint.radius, joint.radius, -joint.half, joint.half)

    def _foot(self, link: _Link) -> Iterator[Solid]:
        """Draw what an arm stands on if its first joint turns: a plate on the floor, a post under a raised drum.

        The floor is frame 0's plane if the arm rises from there, the world's z = 0 if frame 0 is above that.
        """
        joint, T_world_end = self.joints[0], self.T_world_base @ link.T_end
        up = -1.0 if joint.lift < 0 else 1.0
        stands = up * T_world_end[2, 2] > UPRIGHT
        raised = T_world_end[2, 3] if stands else 0.0
        depth = max(raised, 0.0 if joint.lift else HUB_LENGTH * joint.half + POST_LENGTH * joint.radius)
        yield _cylinder(link.T_end, PLATE * joint.radius, -up * depth, -up * (depth - THIN * joint.radius))
        if depth:
            yield _cylinder(link.T_end, joint.radius, -up * depth, 0.0)

    def gripper(self) -> Iterator[Solid]:
        """Draw a flange and two fingers at the tool's origin, in DH frame n."""
        last, joint = self.links[-1], self.joints[-1]
        T, size = self.T_last_tool, joint.radius
        offset = float(np.linalg.norm(T[:3, 3]))
        if offset:
            yield _cylinder(_towards(T[:3, 3]), TUBE * size, 0.0, offset)
        if np.array_equal(T, np.eye(4)):
            T = self._approach()
        inner = max(size, HUB_LENGTH * joint.half)
        root = inner if abs(last.d) + abs(last.a) + offset < inner and not joint.rod else 0.0
        if root:
            yield _cylinder(T, TUBE * size, 0.0, root)
        yield _cylinder(T, 0.9 * size, root, root + 0.3 * size)
        yield _box(T, 1.05 * size, 0.45 * size, root + 0.3 * size, root + 0.7 * size)
        for side in (-0.85, 0.85):
            yield _box(T @ _shift(side * size), 0.2 * size, 0.4 * size, root + 0.7 * size, root + 1.9 * size)

    def _approach(self) -> Array:
        """Return the pose of the gripper of an arm without a tool: along x_n if its last stretch is a common normal."""
        before, last = self.links[-2:]
        flat = last if last.a else before
        if last.d or not flat.a or (flat is before and (self.joints[-1].prismatic or not before.is_parallel)):
            return np.eye(4)
        return _about_z(0.0 if flat.a > 0 else np.pi) @ ALONG_X


def _housing(link: _Link, joint: _Joint) -> Iterator[Solid]:
    """Draw what a link holds the next joint in: a drum, a block around a rod, or a rail."""
    if not joint.prismatic:
        yield _cylinder(link.T_end, joint.radius, joint.lift - joint.half, joint.lift + joint.half)
    elif joint.rod:
        near = float(np.clip(0.0, *joint.stroke))
        yield _box(link.T_end, joint.radius, joint.radius, min(-joint.half, near), max(joint.half, near))
    else:
        thick, wide = THIN * joint.radius, STOP * joint.radius
        low, high = _span(*joint.stroke, joint.half + thick)
        yield _box(link.T_end, BAR * joint.radius, BAR * joint.radius, low, high)
        yield _box(link.T_end, wide, wide, low, low + thick)
        yield _box(link.T_end, wide, wide, high - thick, high)


def _span(low: float, high: float, margin: float) -> tuple[float, float]:
    """Return the interval of a bar that begins at 0 and outlasts the block at both ends of its stroke."""
    return min(0.0, low - margin if low < 0 else 0.0), max(0.0, high + margin if high > 0 else 0.0)


def _cylinder(T: Array, radius: float, start: float, end: float) -> Solid:
    """Return a cylinder about z of T, from start to end."""
    return Cylinder(_size(radius), _size(abs(end - start))), T @ _shift(z=(start + end) / 2)


def _box(T: Array, half_x: float, half_y: float, start: float, end: float) -> Solid:
    """Return a box about z of T, from start to end."""
    return Box((_size(2 * half_x), _size(2 * half_y), _size(end - start))), T @ _shift(z=(start + end) / 2)


def _size(value: float) -> Expression:
    """Return a length as a short decimal: six digits are a micrometre of a metre."""
    return exact(float(f"{value:.6g}"))


def _shift(x: float = 0.0, z: float = 0.0) -> Array:
    T = np.eye(4)
    T[[0, 2], 3] = x, z
    return T


def _about_z(angle: float) -> Array:
    T = np.eye(4)
    T[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return T


def _towards(point: Array) -> Array:
    """Return a frame at the origin whose z points to a point other than it."""
    T = np.eye(4)
    T[:3, 2] = point / np.linalg.norm(point)
    across = np.cross(T[:3, 2], np.eye(3)[np.argmin(np.abs(point))])
    T[:3, 0] = across / np.linalg.norm(across)
    T[:3, 1] = np.cross(T[:3, 2], T[:3, 0])
    return T
