"""Joint axes of a chain at zero, and the tidiest Denavit-Hartenberg table through them.

A table is a sequence of common normals: normal i goes from the axis of joint i to that of joint i + 1, has the length
a_i and rotates by alpha_i; along axis i the normals i - 1 and i are d_i apart and differ by theta_i. That holds in both
conventions, which only write alpha and a into other rows and place frame i at the end (standard) or the beginning
(modified) of normal i.

Skew and intersecting axes have one common normal, up to its sign. Between parallel axes its height is free, between
coincident axes its direction too, and the axis of a prismatic joint may be any line parallel to itself. The free
choices are taken from points and directions of the URDF itself. The table with the fewest nonzero entries is chosen,
with right angles preferred to other angles, positive to negative numbers, late offsets to early ones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from dhkit.description import Array

_ENTRY_COST = 1000.0
"""Cost of an entry that is not zero: more than all other preferences of a table together."""
_OBLIQUE_COST = 20.0
"""Extra cost of an angle that is not a multiple of 90 degrees."""
_STRAIGHT_COST = 2.0
"""Extra cost of an angle of 180 degrees."""
_NEGATIVE_COST = 1.0
"""Extra cost of a negative length or angle."""
_LONG = 2.0
"""Length, in units of the longest step, from which an entry is too long."""
_TOO_LONG_COST = 1e5
"""Cost of each unit of length beyond _LONG, so high that no saved entry is worth a long one."""
_EARLY_COST = 0.1
"""Extra cost of an offset d for each row after it, so that the last of parallel axes has the whole offset."""
_ON_AXIS_DISTANCE = 1e-9
"""Distance from an axis, relative to the arm's size, below which a point counts as on the axis."""
ZERO = 1e-10
"""Lengths, relative to the arm's size, and angles, rad, below this number count as zero when tables are compared."""
_MIN_SINE = 1e-3
"""Directions closer to an axis than this sine define no perpendicular direction."""
_MAX_PARTIAL_TABLES = 336
"""Beam width of the search times the number of joints: 48 partial tables are kept at each axis of a 7-joint arm."""


@dataclass(frozen=True, eq=False)
class Axes:
    """The axes of n joints in the base, with every joint at zero.

    Lengths are in units of about the arm's longest step from joint to joint, by which
    :func:`~dhkit.model.extraction.table.tidiest_table` divides.

    Attributes
    ----------
    points, directions
        A point on each axis and its unit vector, shape (n, 3).
    prismatic
        Whether each joint is prismatic, shape (n,).
    T_base_tip
        The tip's pose, shape (4, 4).
    frames
        Unit vectors of the joints' frames, shape (n, 3, 3), one a row.
    feet
        Points where skew neighbouring axes are nearest to each other, shape (k, 3).
    normals
        Directions of their common normals, shape (k, 3).
    parallel_below
        Sine of the largest angle between two neighbouring axes that are treated as parallel.
    """

    points: Array
    directions: Array
    prismatic: Sequence[bool]
    T_base_tip: Array
    frames: Array
    feet: Array
    normals: Array
    parallel_below: float = 1e-10

    @property
    def n(self) -> int:
        """The number of joints."""
        return len(self.points)

    def start_points(self, i: int, on_axis: Array) -> Array:
        """Return points at whose height a normal may begin on axis i (from 0), shape (k, 3).

        They are ``on_axis``, a point on the axis, shape (3,), nearby frames, base, tip, and feet on the axis.
        """
        z = self.directions[i]
        feet = self.feet
        if len(feet):
            # The distance of a point p from the line through o with unit vector z is |(p - o) x z|.
            distances = np.linalg.norm(np.cross(feet - on_axis, z), axis=1)
            feet = feet[distances < _ON_AXIS_DISTANCE]
        nearby = self.points[max(i - 1, 0) : i + 3]
        base = np.zeros((1, 3))
        tip = self.T_base_tip[None, :3, 3]
        return np.vstack([on_axis[None], nearby, base, tip, feet])

    def axis_points(self, i: int, on_previous_axis: Array | None) -> Array:
        """Return points through which the axis of a prismatic joint i (from 0) may go, shape (k, 3).

        ``on_previous_axis`` is a point on the axis before, shape (3,), if there is one.
        """
        own = self.points[i : i + 2]
        previous = own[:0] if on_previous_axis is None else on_previous_axis[None]
        return _distinct(np.vstack([own, previous, np.zeros((1, 3)), self.T_base_tip[None, :3, 3]]))

    def perpendicular(self, i: int, previous: Array | None) -> Array:
        """Return unit vectors that a normal between coincident axes i and i + 1 may have, shape (k, 3), without unit.

        They are parts perpendicular to axis i of the ``previous`` normal's vector, shape (3,), and of directions of
        base, tip, nearby frames and normals.
        """
        nearby = self.frames[i : i + 3].reshape(-1, 3)
        known = [np.eye(3), self.T_base_tip[:3, :3].T, nearby, self.normals]
        directions = np.vstack(known if previous is None else [previous[None], *known])

        # The part of a unit vector v perpendicular to z is v - (v . z) z; its length is the sine of their angle.
        z = self.directions[i]
        parts = directions - (directions @ z)[:, None] * z
        sines = np.linalg.norm(parts, axis=1)
        is_determined = sines > _MIN_SINE
        units: Array = parts[is_determined] / sines[is_determined, None]
        return units


@dataclass(frozen=True, eq=False)
class Normal:
    """A common normal: unit vector x, from ``start`` on the axis of its joint to ``end`` on that of the next; m."""

    x: Array
    start: Array
    end: Array

    @property
    def length(self) -> float:
        """The entry a, m, negative if the end lies against x."""
        return float((self.end - self.start) @ self.x)


class EndRow(NamedTuple):
    """Entries of the first or last row that no inner normal determines, rad and m.

    alpha and a are those of the first row of modified tables (alpha_0, a_0) and of the last row of standard ones.
    """

    theta: float
    d: float
    alpha: float = 0.0
    a: float = 0.0


Choice = tuple[float, EndRow]
"""Entries of an end of the table, with the cost of the whole end."""


@dataclass(frozen=True, eq=False)
class Path:
    """Normals 1 to i, with the cost of their entries and of the ends that were chosen so far."""

    normals: tuple[Normal, ...]
    cost: float
    start: EndRow
    end: EndRow | None = None


def length_costs(lengths: Array) -> Array:
    """Return the costs of entries with these lengths, any shape, in units of about the longest step; same shape."""
    size = np.abs(lengths)
    too_long = _TOO_LONG_COST * np.maximum(size - _LONG, 0.0)
    return np.where(size <= ZERO, 0.0, _ENTRY_COST + _NEGATIVE_COST * (lengths < 0) + too_long)


def angle_costs(angles: Array) -> Array:
    """Return the costs of entries with these angles, rad, any shape; same shape."""
    # 0 costs nothing; +-90 degrees cost an entry; 180 degrees and oblique angles cost more.
    quarter = np.round(angles / (np.pi / 2))
    is_oblique = np.abs(angles - quarter * (np.pi / 2)) > ZERO
    is_straight = ~is_oblique & (np.abs(quarter) == 2)
    is_negative = (angles < 0) & ~is_straight
    costs = (
        _ENTRY_COST
        + _OBLIQUE_COST * is_oblique
        + _STRAIGHT_COST * is_straight
        + _NEGATIVE_COST * is_negative
    )
    return np.where(np.abs(angles) <= ZERO, 0.0, costs)


def angle_about(axis: Array, start: Array, end: Array) -> Array:
    """Return the angles from start to end about an axis perpendicular to both, rad, in (-pi, pi], shape (...).

    All are vectors of shape (..., 3) that broadcast; start s and end e have any length, the axis z is a unit vector:

        angle = atan2((s x e) . z, s . e).
    """
    cosines = np.sum(start * end, axis=-1)
    sines = np.sum(np.cross(start, end) * axis, axis=-1)
    angles = np.arctan2(sines, cosines)
    return np.where(angles <= -np.pi + 1e-15, np.pi, angles)


def tidiest_normals(
    axes: Axes, begin: Callable[[Normal], Choice], finish: Callable[[Normal], Choice]
) -> Path:
    """Return the normals, and the ends, of the table with the lowest cost.

    Parameters
    ----------
    axes
        At least two.
    begin
        From the first normal to the choice of theta_1 and d_1 (modified: of alpha_0 and a_0 too), with its cost.
    finish
        From the last normal to the choice of the last row's theta and d (standard: of a and alpha too), with its cost.
    """
    # A prismatic first axis may be any line parallel to itself.
    lines = axes.axis_points(0, None) if axes.prismatic[0] else axes.points[:1]
    paths: list[Path] = []
    for point in lines:
        for normal in _normals_after(axes, 0, point, None):
            cost, start = begin(normal)
            a = np.array([normal.length])
            alpha = np.array([_alpha(axes, 0, normal)])
            row = length_costs(a)[0] + angle_costs(alpha)[0]
            paths.append(Path((normal,), cost + float(row), start))

    # A beam search: at each axis only the cheapest partial tables are continued.
    count = max(6, _MAX_PARTIAL_TABLES // axes.n)
    paths = _cheapest(paths, count)
    for i in range(1, axes.n - 1):
        longer: list[Path] = []
        for path in paths:
            longer += _extended(axes, i, path)
        paths = _cheapest(longer, count)

    def completed(path: Path) -> Path:
        cost, end = finish(path.normals[-1])
        return replace(path, cost=path.cost + cost, end=end)

    best = completed(paths[0])
    for path in paths[1:]:  # the cheapest first
        if path.cost >= best.cost:
            break
        best = min(best, completed(path), key=attrgetter("cost"))
    return best


def _extended(axes: Axes, i: int, path: Path) -> list[Path]:
    """Return a path with each possible normal from axis i to axis i + 1 (from 0).

    A normal from ``start`` along x adds d and theta between the previous normal and itself, and its own a and alpha.
    """
    previous = path.normals[-1]
    z = axes.directions[i]
    normals = _normals_after(axes, i, previous.end, previous.x)
    x = np.array([normal.x for normal in normals])
    start = np.array([normal.start for normal in normals])

    # d = (start - end of the previous normal) . z, and theta is the angle from its x to the next one about z.
    d = (start - previous.end) @ z
    theta = angle_about(z, previous.x, x)
    a = np.array([normal.length for normal in normals])
    alpha = np.array([_alpha(axes, i, normal) for normal in normals])

    early = np.where(np.abs(d) > ZERO, _EARLY_COST * (axes.n - i), 0.0)
    costs = length_costs(d) + early + angle_costs(theta) + length_costs(a) + angle_costs(alpha)
    return [
        Path((*path.normals, normal), path.cost + float(cost), path.start)
        for normal, cost in zip(normals, costs, strict=True)
    ]


def _alpha(axes: Axes, i: int, normal: Normal) -> float:
    """Return the angle from axis i to axis i + 1 about the normal, rad."""
    return float(angle_about(normal.x, axes.directions[i], axes.directions[i + 1]))


def _cheapest(paths: list[Path], count: int) -> list[Path]:
    """Return the cheapest paths, one for each last normal, the cheapest first."""
    best: dict[tuple[float, ...], Path] = {}
    for path in sorted(paths, key=attrgetter("cost")):
        last = path.normals[-1]
        best.setdefault(tuple(np.round([*last.x, *last.end], 7).tolist()), path)
        if len(best) == count:
            break
    return list(best.values())


def _normals_after(axes: Axes, i: int, on_axis: Array, previous: Array | None) -> list[Normal]:
    """Return the normals from axis i, through a point on it, to axis i + 1.

    Parameters
    ----------
    on_axis
        A point on axis i: the end of the previous normal.
    previous
        The unit vector of the previous normal, if there is one.
    """
    z = axes.directions[i]
    z_next = axes.directions[i + 1]
    lines = axes.axis_points(i + 1, on_axis) if axes.prismatic[i + 1] else axes.points[i + 1][None]
    cross = np.cross(z, z_next)
    sine = float(np.linalg.norm(cross))
    normals: list[Normal] = []
    if sine <= axes.parallel_below:
        for line in lines:
            normals += _parallel_normals(axes, i, on_axis, line, previous)
        return normals

    # The normals of nearly parallel axes may be hundreds of metres away: a point that far would cost digits.
    point = on_axis if axes.prismatic[i] else axes.points[i]
    x = cross / sine
    for line in lines:
        start, end = nearest_points(point, z, line, z_next)
        normals += [Normal(x, start, end), Normal(-x, start, end)]
    return normals


def nearest_points(point: Array, z: Array, other: Array, z_other: Array) -> tuple[Array, Array]:
    """Return the points where two lines that are not parallel are nearest to each other, m, shape (3,) each.

    A line has a point, shape (3,), m, and a unit vector. With lines p + s z and p' + s' z', and the gap g = p' - p,
    the vector between the points, g + s' z' - s z, is parallel to c = z x z'; its product with z' x c and z x c is 0:

        s = (g x z') . c / c.c,    s' = (g x z) . c / c.c.

    Cross products keep the digits that a difference of scalar products loses for nearly parallel lines.
    """
    g = other - point
    c = np.cross(z, z_other)
    square = float(c @ c)
    s = float(np.cross(g, z_other) @ c) / square
    s_other = float(np.cross(g, z) @ c) / square
    return point + s * z, other + s_other * z_other


def _parallel_normals(
    axes: Axes, i: int, on_axis: Array, line: Array, previous: Array | None
) -> list[Normal]:
    """Return normals between parallel axes, at known points' heights; of coincident ones in known directions."""
    z = axes.directions[i]

    # The part of the vector to the other axis that is perpendicular to both: v - (v . z) z.
    gap = line - on_axis
    gap = gap - (gap @ z) * z
    distance = float(np.linalg.norm(gap))
    if distance > ZERO:
        directions = np.array([gap / distance, -gap / distance])
    else:
        gap = np.zeros(3)
        parts = axes.perpendicular(i, previous)
        directions = _distinct(np.vstack([parts, -parts]))

    heights = (axes.start_points(i, on_axis) - on_axis) @ z
    heights[0] = 0.0  # on_axis itself, without rounding
    _, places = np.unique(np.round(heights, 10), return_index=True)
    normals: list[Normal] = []
    for place in np.sort(places):
        start = on_axis + heights[place] * z
        normals += [Normal(x, start, start + gap) for x in directions]
    return normals


def _distinct(rows: Array) -> Array:
    """Return rows without repetitions, in their order."""
    _, places = np.unique(np.round(rows, 9) + 0.0, axis=0, return_index=True)
    return np.asarray(rows[np.sort(places)])
