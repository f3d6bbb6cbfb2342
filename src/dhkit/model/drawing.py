"""Solids that links are drawn with, from the table alone.

A link goes from its own joint's axis to the next: by d along the first, then by a along the common normal of the two.
These are drawn as a column and a tube. On the next axis the link has a drum, in which the next link turns on a slimmer,
longer hub. A prismatic joint is a square bar of the stroke's length in a block. Sizes are relative to the arm's reach.
A rod that carries a coaxial joint, such as a SCARA's quill, leaves its block on one side, and the block stands where
this joint never comes: its link is drawn beside the common normal, at the block's height.
Where nearly parallel axes make a and d no sizes of the arm, links are tubes between balls at the joints' centres.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from dhkit.description import Array, Box, Convention, Cylinder, Description, Geometry, Sphere
from dhkit.expressions import Expression, exact

Solid: TypeAlias = tuple[Geometry, Array]
"""A geometry and its pose in its link's DH frame, shape (4, 4), m."""

_FIRST_DRUM_RADIUS = 0.05
"""Radius of the first drum, relative to the reach."""
_LAST_DRUM_RADIUS = 0.028
"""Radius of the last drum, relative to the reach: arms taper."""
_TUBE_RADIUS = 0.62
"""Radius of a tube, relative to the smaller drum at its ends, so that drums stay visible."""
_DRUM_HALF_HEIGHT = 0.9
"""Half the height of a drum, relative to its radius: the tube, which is narrower, ends inside the drum."""
_HUB_RADIUS = 0.8
"""Radius of a hub, relative to its drum."""
_HUB_HALF_LENGTH = 1.2
"""Half length of a hub, relative to its drum's: it is visible at both faces."""
_NESTED_RADIUS = 0.78
"""Radius of a drum relative to the previous drum about the same point: all of them stay visible."""
_NESTED_HALF_HEIGHT = 1.25
"""Half height of a drum relative to the previous drum about the same point."""
_MAX_FIRST_DRUM_HALF = 0.3
"""Half the height of the first drum, at most, relative to the height of the next axis: the drum stays below it."""
_BLOCK_HALF_LENGTH = 1.3
"""Half the length of a slider's block, relative to its half width."""
_BAR_HALF_WIDTH = 0.55
"""Half width of a slider's bar, relative to the block's."""
_HEAD_GAP = 1.25
"""Smallest distance of a block from the end of its rod, relative to the extent of the solids at that end."""
_ROD_HOLD = 0.25
"""Length of such a rod in its block at the far end of the stroke, relative to half the block's length: a longer rod
would reach further into the arm at the near end."""
_MAX_PAST = 0.25
"""Largest length of a stroke beyond the link before for which a block is moved, relative to the reach."""
_HEAD_OFFSET = 2.0
"""Smallest length of the common normal for which a block is moved, relative to the block's half width."""
_STOP_HALF_WIDTH = 0.8
"""Half width of the stops at a rail's ends, relative to the block's."""
_PLATE_RADIUS = 1.8
"""Radius of the foot's plate, relative to the radius of the drum at frame 0."""
_POST_HEIGHT = 2.0
"""Height of the post below the drum at frame 0, relative to the drum's radius."""
_THICKNESS = 0.25
"""Thickness of plates and stops, relative to the radius of the drum or the half width of the block."""
_GRIPPER_START = 1.25
"""Distance at which the gripper begins on an arm that ends in its last drum, relative to the joint's extent."""
_GRIPPER_LENGTH = 1.9
"""Length of the gripper, relative to the radius of the last joint."""
_MIN_NECK_LENGTH = 1e-3
"""Shortest neck that is drawn, relative to its radius."""

_IDENTITY: Array = np.eye(4)
_ALONG_X: Array = np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
"""The rotation that takes z to x."""


@dataclass(frozen=True, eq=False)
class _Link:
    """The path of a link: along its joint's axis by d to a corner, from there along the common normal by a to its end.

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
    rise: float = 0.0
    """Height along the next joint's axis at which the tube along the common normal is drawn, m."""

    @property
    def T_tube(self) -> Array:
        """The corner, moved to the tube's height along the next joint's axis, shape (4, 4)."""
        return _at(self.rise * self.T_end[:3, 2]) @ self.T_corner

    @property
    def column(self) -> float:
        """The height along the link's own joint axis to which it is drawn, m.

        Parallel axes have z_corner . z_end = +1 or -1, and the rise lengthens or shortens the column.
        """
        if not self.is_parallel:
            return self.d
        return self.d + self.rise * float(self.T_corner[:3, 2] @ self.T_end[:3, 2])

    @property
    def is_parallel(self) -> bool:
        """Whether the axes of its two joints are parallel."""
        return np.array_equal(np.abs(self.T_corner[:3, 2]), np.abs(self.T_end[:3, 2]))

    def is_straight(self, within: float) -> bool:
        """Whether the link ends on the axis on which it begins, up to a distance in m."""
        return self.is_parallel and abs(self.a) < within


@dataclass(frozen=True)
class _Joint:
    """The sizes of a joint, m; heights are along its axis, from the end of the link before it."""

    prismatic: bool
    radius: float
    """Radius of the drum; half the width of a slider's block."""
    half: float
    """Half the drum's height; half the block's length."""
    lift: float = 0.0
    """Height of the drum's centre."""
    stroke: tuple[float, float] = (0.0, 0.0)
    """Lowest and highest height of a slider's corner."""
    theta: float = 0.0
    """A slider's angle about its axis, rad."""
    is_rod: bool = False
    """Whether the slider's bar moves, in a block of the link before; otherwise the block moves, on a rail."""
    head: tuple[float, float] = (0.0, 0.0)
    """Lowest and highest height of the block around a rod."""
    rod: tuple[float, float] = (0.0, 0.0)
    """Ends of a rod along the axis, from the corner of the link after it."""

    @property
    def extent(self) -> float:
        """Largest distance of the joint's solids from the corner of the link after it, m."""
        return 0.0 if self.is_rod else max(self.radius, _HUB_HALF_LENGTH * self.half)


def _links(description: Description) -> list[_Link]:
    """Return the paths of links 0 to n."""
    numbers = description.numbers
    rows = np.stack([numbers.a, numbers.cos_alpha, numbers.sin_alpha], axis=1).tolist()
    d = [0.0, *numbers.d.tolist()]
    straight = (0.0, 1.0, 0.0)
    # A row's a and alpha describe the end of its own link, in the modified convention that of the link before. The
    # frame of a standard link stands at its end, with its corner at (Tx(a) Rx(alpha))^-1 = Tx(-a) Rx(-alpha); that of a
    # modified link at its corner, with its end at Tx(a) Rx(alpha).
    if description.convention is Convention.STANDARD:
        return [
            _Link(x, a, _normal_pose(-a, c, -s), _IDENTITY)
            for x, (a, c, s) in zip(d, [straight, *rows], strict=True)
        ]
    return [
        _Link(x, a, _IDENTITY, _normal_pose(a, c, s))
        for x, (a, c, s) in zip(d, [*rows, straight], strict=True)
    ]


def _joints(description: Description, links: Sequence[_Link]) -> list[_Joint]:
    """Return the sizes of joints 1 to n."""
    numbers = description.numbers
    n = description.n
    scale = max(description.reach, float(np.linalg.norm(numbers.T_last_tool[:3, 3]))) or 1.0
    taper = _LAST_DRUM_RADIUS - _FIRST_DRUM_RADIUS
    joints: list[_Joint] = []
    for i, (before, after) in enumerate(pairwise(links)):
        prismatic = bool(numbers.prismatic[i])
        radius = scale * (_FIRST_DRUM_RADIUS + taper * i / n)
        lift = 0.0
        half = radius * (_BLOCK_HALF_LENGTH if prismatic else _DRUM_HALF_HEIGHT)
        if joints and abs(before.d) + abs(before.a) < joints[-1].extent:
            radius = min(radius, _NESTED_RADIUS * joints[-1].radius)
            half = max(half, _NESTED_HALF_HEIGHT * joints[-1].extent / _HUB_HALF_LENGTH)
        # Frame 0 is on the floor: the drum stands on it, not in it.
        if not joints and abs(after.d) > radius:
            half = min(half, _MAX_FIRST_DRUM_HALF * abs(after.d))
            lift = float(np.copysign(_HUB_HALF_LENGTH * half, after.d))
        if not prismatic:
            joints.append(_Joint(False, radius, half, lift))
            continue
        low, high = np.clip((numbers.lower[i], numbers.upper[i]), -scale, scale) + after.d
        # A straight next link would lie inside a rail, so its bar moves instead, unless it would move through a base.
        is_rod = after.is_straight(radius) and not all(
            link.is_straight(radius) for link in links[: i + 1]
        )
        # The block reaches to the height in the stroke nearest to the link before; 0 if the stroke goes past it.
        near = float(np.clip(0.0, low, high))
        head = (min(-half, near), max(half, near))
        rod = _bar_ends(near - high, near - low, half)
        theta = float(numbers.theta[i])
        joints.append(_Joint(True, radius, half, 0.0, (low, high), theta, is_rod, head, rod))
    return joints


def _clear_heads(
    links: list[_Link], joints: list[_Joint], T_last_tool: Array, max_past: float
) -> None:
    """Move the blocks of rods that carry a joint, and the links with these blocks, out of the way of that joint.

    Heights are measured along the axis from the end of the link with the block, positive where the rod leaves it. The
    rod's end moves from ``begin`` to ``far``. The solids that it carries reach back from it by ``back``, so that

        front = begin - gap * back        is the block's highest front,
        rise  = min(0, front - half)      the height of the tube that holds it, and
        rise - half ... front             the block.
    """
    for i, joint in enumerate(joints[:-1]):
        if not joint.is_rod:
            continue
        low, high = joint.stroke
        side = 1.0 if high >= -low else -1.0
        begin = min(side * low, side * high)
        far = max(side * low, side * high)
        back = _extent_behind(links, joints, T_last_tool, i, side)
        front = begin - _HEAD_GAP * back
        rise = min(0.0, front - joint.half)

        # A stroke that goes far past the link, or begins on the axis of the joint before, really passes through it.
        is_past = -begin > max_past
        is_in_the_way = rise < 0 and abs(links[i].a) < _HEAD_OFFSET * joint.radius
        if is_past or is_in_the_way:
            continue

        # At the far end of the stroke, the rod's other end is still in the block.
        head = (side * (rise - joint.half), side * front)
        rod = (side * (front - _ROD_HOLD * joint.half - far), 0.0)
        joints[i] = replace(joint, head=(min(head), max(head)), rod=(min(rod), max(rod)))
        links[i] = replace(links[i], rise=side * rise)


def _extent_behind(
    links: Sequence[_Link], joints: Sequence[_Joint], T_last_tool: Array, i: int, side: float
) -> float:
    """Return how far the solids at the end of rod i reach back towards its block, m.

    They are the drums about the rod's end and, where the last of them carries it, a gripper that points back.
    """
    extent = 0.0
    for after, joint in zip(links[i + 2 :], joints[i + 1 :], strict=True):
        extent = max(extent, joint.extent)
        if abs(after.d) + abs(after.a) > joint.extent:
            break

    # The axes of the rod and of a last joint after it coincide; the tool's z axis is z_n.
    is_last = i + 2 == len(joints)
    axis = links[i + 1].T_corner[:3, 2] @ links[i + 1].T_end[:3, 2]
    axis *= links[-1].T_corner[:3, 2] @ T_last_tool[:3, 2]
    if is_last and side * axis < 0:
        extent = max(extent, _GRIPPER_START * extent + _GRIPPER_LENGTH * joints[-1].radius)
    return extent


class Drawing:
    """The links of an arm as solids, from its table alone."""

    def __init__(self, description: Description) -> None:
        self.links = _links(description)
        self.joints = _joints(description, self.links)
        _clear_heads(
            self.links,
            self.joints,
            description.numbers.T_last_tool,
            _MAX_PAST * description.reach,
        )
        self.T_world_base = description.numbers.T_world_base
        self.T_last_tool = description.numbers.T_last_tool
        self.far_ends = description.numbers.link_ends

    def link(self, i: int) -> Iterator[Solid]:
        """Draw link i in its DH frame."""
        link = self.links[i]
        ends = self.joints[max(i - 1, 0) : i + 1]
        tube = _TUBE_RADIUS * min(joint.radius for joint in ends)
        if self.far_ends is not None:
            yield from self._between(
                self.far_ends.begin[i], self.far_ends.end[i], ends[0].radius, tube
            )
            return
        if i:
            yield from _own_joint_solids(link, self.joints[i - 1], tube)
        elif not self.joints[0].prismatic:
            yield from self._foot()
        if link.a:
            yield _cylinder(link.T_tube @ _ALONG_X, tube, 0.0, link.a)
        # Where the column does not reach a tube beside the common normal, a post at the corner does.
        column_rises = i > 0 and not self.joints[i - 1].prismatic and link.is_parallel
        if link.rise and not column_rises:
            yield _cylinder(link.T_end @ _shift(x=-link.a), tube, 0.0, link.rise)
            yield Sphere(_size(tube)), link.T_tube
        if link.a and (link.column if column_rises else link.d):
            yield Sphere(_size(tube)), link.T_tube if column_rises else link.T_corner
        if i < len(self.joints):
            yield from _next_joint_solids(link, self.joints[i])

    def _between(self, begin: Array, end: Array, radius: float, tube: float) -> Iterator[Solid]:
        """Draw a ball at the centre of a link's own joint, and a tube from it to that of the next."""
        yield Sphere(_size(radius)), _at(begin)
        length = float(np.linalg.norm(end - begin))
        if length > _MIN_NECK_LENGTH * tube:
            yield _cylinder(_at(begin) @ _frame_towards(end - begin), tube, 0.0, length)

    def _foot(self) -> Iterator[Solid]:
        """Draw a plate on the floor, and a post from it to the first drum if that is higher.

        The floor is frame 0's plane if the arm rises from it, the world's z = 0 if frame 0 is above that.
        """
        joint = self.joints[0]
        T_base_end = self.links[0].T_end
        T_world_end = self.T_world_base @ T_base_end
        up = -1.0 if joint.lift < 0 else 1.0
        raised = T_world_end[2, 3] if np.isclose(up * T_world_end[2, 2], 1.0) else 0.0
        depth = max(raised, 0.0 if joint.lift else joint.extent + _POST_HEIGHT * joint.radius)
        yield _cylinder(
            T_base_end,
            _PLATE_RADIUS * joint.radius,
            -up * depth,
            -up * (depth - _THICKNESS * joint.radius),
        )
        if depth:
            yield _cylinder(T_base_end, joint.radius, -up * depth, joint.lift)

    def neck(self) -> Iterator[Solid]:
        """Draw the neck between the last link and the gripper, in DH frame n."""
        if self.far_ends is not None:
            return
        radius = _TUBE_RADIUS * self.joints[-1].radius
        T_end_gripper, root = self._gripper_place()
        offset = self.T_last_tool[:3, 3]
        length = float(np.linalg.norm(offset))
        if length > _MIN_NECK_LENGTH * radius:
            yield _cylinder(_frame_towards(offset), radius, 0.0, length)
        if root:
            yield _cylinder(T_end_gripper, radius, 0.0, root)

    def gripper(self) -> Iterator[Solid]:
        """Draw a flange and two fingers at the tool's origin, in DH frame n."""
        size = self.joints[-1].radius
        T, root = self._gripper_place()

        yield _cylinder(T, 0.9 * size, root, root + 0.3 * size)
        yield _box(T, (1.05 * size, 0.45 * size), root + 0.3 * size, root + 0.7 * size)
        for side in (-0.85, 0.85):
            yield _box(
                T @ _shift(x=side * size),
                (0.2 * size, 0.4 * size),
                root + 0.7 * size,
                root + _GRIPPER_LENGTH * size,
            )

    def _gripper_place(self) -> tuple[Array, float]:
        """Return the gripper's pose, z forwards, and the distance at which it begins, m.

        An arm may end inside its last drum: then the gripper begins outside of it.
        """
        before, last = self.links[-2:]
        joint = self.joints[-1]
        T = self.T_last_tool
        length = abs(last.d) + abs(last.a) + float(np.linalg.norm(T[:3, 3]))
        root = max(0.0, _GRIPPER_START * joint.extent - length)
        if last.d or not np.array_equal(T, _IDENTITY):
            return T, root

        # Without a tool and an offset d, the gripper points along the common normal, away from the arm.
        a = last.a or (before.a if before.is_parallel and not joint.prismatic else 0.0)
        if not a:
            return T, root
        heading = 0.0 if a > 0 else np.pi
        return _about_z(heading) @ _ALONG_X, root


def _own_joint_solids(link: _Link, joint: _Joint, tube: float) -> Iterator[Solid]:
    """Draw a link's part of its own joint: a hub and the column above it, a rod, or a block on a rail."""
    if not joint.prismatic:
        T_start = link.T_corner @ _shift(z=-link.d)
        half = _HUB_HALF_LENGTH * joint.half
        yield _cylinder(T_start, _HUB_RADIUS * joint.radius, joint.lift - half, joint.lift + half)
        if link.column:
            yield _cylinder(T_start, tube, 0.0, link.column)
        return
    T = link.T_corner @ _about_z(-joint.theta)
    wide = joint.radius
    if joint.is_rod:
        yield _box(T, (_BAR_HALF_WIDTH * wide, _BAR_HALF_WIDTH * wide), *joint.rod)
    else:
        yield _box(T, (wide, wide), -joint.half, joint.half)


def _next_joint_solids(link: _Link, joint: _Joint) -> Iterator[Solid]:
    """Draw a link's part of the next joint: a drum, a block around a rod, or a rail with its stops."""
    T = link.T_end
    wide = joint.radius
    if not joint.prismatic:
        yield _cylinder(T, joint.radius, joint.lift - joint.half, joint.lift + joint.half)
    elif joint.is_rod:
        yield _box(T, (wide, wide), *joint.head)
    else:
        low, high = _bar_ends(*joint.stroke, joint.half + _THICKNESS * wide)
        yield _box(T, (_BAR_HALF_WIDTH * wide, _BAR_HALF_WIDTH * wide), low, high)
        yield _box(
            T, (_STOP_HALF_WIDTH * wide, _STOP_HALF_WIDTH * wide), low, low + _THICKNESS * wide
        )
        yield _box(
            T, (_STOP_HALF_WIDTH * wide, _STOP_HALF_WIDTH * wide), high - _THICKNESS * wide, high
        )


def _bar_ends(low: float, high: float, margin: float) -> tuple[float, float]:
    """Return the ends of a bar from 0 over a stroke, with a margin for the block at the ends other than 0."""
    if low == high == 0:
        return -margin, margin
    return min(0.0, low - margin * (low < 0)), max(0.0, high + margin * (high > 0))


def _cylinder(T: Array, radius: float, start: float, end: float) -> Solid:
    """Return a cylinder about the z axis of T, from height start to end, m."""
    return Cylinder(_size(radius), _size(abs(end - start))), T @ _shift(z=(start + end) / 2)


def _box(T: Array, half: tuple[float, float], start: float, end: float) -> Solid:
    """Return a box about the z axis of T, from height start to end, m; half widths along x and y."""
    return Box((_size(2 * half[0]), _size(2 * half[1]), _size(end - start))), T @ _shift(
        z=(start + end) / 2
    )


def _size(value: float) -> Expression:
    """Return a length, m, rounded to six digits: a micrometre in a metre."""
    return exact(float(f"{value:.6g}"))


def _normal_pose(a: float, cos_alpha: float, sin_alpha: float) -> Array:
    # Tx(a) Rx(alpha)
    return np.array(
        [[1, 0, 0, a], [0, cos_alpha, -sin_alpha, 0], [0, sin_alpha, cos_alpha, 0], [0, 0, 0, 1.0]]
    )


def _shift(x: float = 0.0, z: float = 0.0) -> Array:
    return np.array([[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, z], [0, 0, 0, 1.0]])


def _at(point: Array) -> Array:
    T = np.eye(4)
    T[:3, 3] = point
    return T


def _about_z(angle: float) -> Array:
    c = np.cos(angle)
    s = np.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


def _frame_towards(point: Array) -> Array:
    """Return a frame at the origin whose z axis points to another point, shape (3,), m."""
    from scipy.spatial.transform import Rotation

    T = np.eye(4)
    T[:3, :3] = Rotation.align_vectors([point], [(0, 0, 1)])[0].as_matrix()
    return T
