"""Joint axes of a chain at zero, and the tidiest Denavit-Hartenberg table through them.

A table is a sequence of common normals: normal i goes from the axis of joint i to that of joint i + 1, has the length
a_i and turns by alpha_i; along axis i the normals i - 1 and i are d_i apart and turn by theta_i. That holds in both
conventions, which only write alpha and a into other rows and place frame i at the end (standard) or the beginning
(modified) of normal i.

Skew and intersecting axes have one common normal, up to its sign. Between parallel axes its height is free, between
coincident axes its direction too, and the axis of a prismatic joint may lie anywhere parallel to itself. The free
choices are taken from points and directions that the URDF itself names, and the table with the fewest nonzero entries
is kept, right angles before other angles, positive before negative numbers, late offsets before early ones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dhkit.description import Array

ENTRY = 1000.0
"""Cost of an entry that is not zero: more than all other preferences of a table together."""
OBLIQUE, STRAIGHT, NEGATIVE = 20.0, 2.0, 1.0
"""Extra costs of an angle that is no multiple of 90 degrees, of one of 180 degrees, and of a negative number."""
EARLY = 0.1
"""Extra cost of an offset d for each row that comes after it: parallel axes share one offset, the last takes it."""
NEAR = 1e-9
"""Distance from an axis at which a point counts as on it, of the arm's size."""
ZERO = 1e-10
"""Of the arm's size, or rad: what is smaller counts as zero when tables are compared."""
KEPT = 336
"""Partial tables that are followed up from axis to axis, over the number of joints: 48 of seven joints."""


@dataclass(frozen=True, eq=False)
class Axes:
    """The axes of n joints in the base, with every joint at zero.

    Attributes
    ----------
    points, directions
        A point on each axis, m, and its unit vector, shape (n, 3).
    prismatic
        Whether each joint is; shape (n,).
    T_base_tip
        The tip's pose, shape (4, 4).
    frames
        Unit vectors of the joints' frames, shape (n, 3, 3), one a row.
    feet
        Where skew neighbouring axes are nearest to each other, m, shape (k, 3).
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

    def heights(self, i: int, on_axis: Array) -> Array:
        """Return points where a normal may begin on axis i (from 0), m, shape (k, 3): frames nearby, and feet."""
        z = self.directions[i]
        feet = (
            self.feet[np.linalg.norm(np.cross(self.feet - on_axis, z), axis=1) < NEAR] if len(self.feet) else self.feet
        )
        return np.vstack(
            [on_axis[None], self.points[max(i - 1, 0) : i + 3], np.zeros((1, 3)), self.T_base_tip[None, :3, 3], feet]
        )

    def lines(self, i: int, on_axis: Array | None) -> Array:
        """Return points that the axis of a prismatic joint i (from 0) may go through, m, shape (k, 3)."""
        own = self.points[i : i + 2]
        before = own[:0] if on_axis is None else on_axis[None]
        return _distinct(np.vstack([own, before, np.zeros((1, 3)), self.T_base_tip[None, :3, 3]]))

    def crosswise(self, i: int, before: Array | None) -> Array:
        """Return directions that a normal between coincident axes i and i + 1 may have, shape (k, 3)."""
        nearby = self.frames[i : i + 3].reshape(-1, 3)
        named = [np.eye(3), self.T_base_tip[:3, :3].T, nearby, self.normals]
        return np.vstack(named if before is None else [before[None], *named])


@dataclass(frozen=True, eq=False)
class Normal:
    """A common normal: unit vector x, from ``start`` on the axis of its joint to ``end`` on that of the next; m."""

    x: Array
    start: Array
    end: Array


@dataclass(frozen=True, eq=False)
class Path:
    """Normals 1 to i, with what their entries cost so far."""

    normals: tuple[Normal, ...]
    cost: float
    start: Any = None
    """What the caller's ``begin`` chose before the first normal."""


def length_costs(lengths: Array) -> Array:
    """Return what entries of these lengths, m, cost in a table."""
    return np.where(np.abs(lengths) <= ZERO, 0.0, ENTRY + NEGATIVE * (lengths < 0))


def angle_costs(angles: Array) -> Array:
    """Return what entries of these angles, rad, cost in a table."""
    quarter = np.round(angles / (np.pi / 2))
    oblique = np.abs(angles - quarter * (np.pi / 2)) > ZERO
    straight = ~oblique & (np.abs(quarter) == 2)
    costs = ENTRY + OBLIQUE * oblique + STRAIGHT * straight + NEGATIVE * ((angles < 0) & ~straight)
    return np.where(np.abs(angles) <= ZERO, 0.0, costs)


def turn_about(axis: Array, start: Array, end: Array) -> Array:
    """Return the angles from one vector to others about an axis that is perpendicular to all, rad, in (-pi, pi]."""
    cosines = np.sum(start * end, axis=-1)
    sines = np.sum(np.cross(start, end) * axis, axis=-1)
    angles = np.arctan2(sines, cosines)
    return np.where(angles <= -np.pi + 1e-15, np.pi, angles)


def tidiest_normals(
    axes: Axes,
    begin: Callable[[Normal], tuple[float, Any]],
    finish: Callable[[Normal], tuple[float, Any]],
) -> tuple[Path, Any]:
    """Return the normals of the table with the lowest cost, and what ``finish`` chose behind the last one.

    Parameters
    ----------
    axes
        At least two.
    begin
        From the first normal to the cost of the base and of theta_1 and d_1 (modified: of alpha_0 and a_0 too).
    finish
        From the last normal to the cost of the tool and of the last row's theta and d (standard: of a and alpha too).
    """
    first = _normals_after(axes, 0, axes.points[0], None)
    if axes.prismatic[0]:  # the first axis may lie anywhere parallel to itself
        first = [normal for point in axes.lines(0, None) for normal in _normals_after(axes, 0, point, None)]
    paths = []
    for normal in first:
        cost, start = begin(normal)
        row = length_costs(np.array([_along(normal)]))[0] + angle_costs(np.array([_bend(axes, 0, normal)]))[0]
        paths.append(Path((normal,), cost + float(row), start))
    kept = max(6, KEPT // axes.n)
    paths = _cheapest(paths, kept)
    for i in range(1, axes.n - 1):
        paths = _cheapest([longer for path in paths for longer in _extended(axes, i, path)], kept)
    best: tuple[Path, Any] | None = None
    for path in paths:
        if best is not None and path.cost >= best[0].cost:
            break
        cost, end = finish(path.normals[-1])
        total = Path(path.normals, path.cost + cost, path.start)
        if best is None or total.cost < best[0].cost:
            best = total, end
    if best is None:
        raise AssertionError("no normals between two axes")
    return best


def _extended(axes: Axes, i: int, path: Path) -> list[Path]:
    """Return a path with each possible normal from axis i to axis i + 1 (from 0)."""
    before, z = path.normals[-1], axes.directions[i]
    normals = _normals_after(axes, i, before.end, before.x)
    x, start = np.array([one.x for one in normals]), np.array([one.start for one in normals])
    d = (start - before.end) @ z
    theta = turn_about(z, before.x, x)
    a, alpha = np.array([_along(one) for one in normals]), np.array([_bend(axes, i, one) for one in normals])
    late = np.where(np.abs(d) > ZERO, EARLY * (axes.n - i), 0.0)
    costs = length_costs(d) + late + angle_costs(theta) + length_costs(a) + angle_costs(alpha)
    return [
        Path((*path.normals, normal), path.cost + float(cost), path.start)
        for normal, cost in zip(normals, costs, strict=True)
    ]


def _along(normal: Normal) -> float:
    return float((normal.end - normal.start) @ normal.x)


def _bend(axes: Axes, i: int, normal: Normal) -> float:
    """Return alpha: the angle from axis i to axis i + 1 about the normal."""
    return float(turn_about(normal.x, axes.directions[i], axes.directions[i + 1]))


def _cheapest(paths: list[Path], kept: int) -> list[Path]:
    """Return the best paths, one for each last normal, cheapest first."""
    best: dict[tuple[float, ...], Path] = {}
    for path in sorted(paths, key=lambda one: one.cost):
        last = path.normals[-1]
        best.setdefault(tuple(np.round([*last.x, *last.end], 7).tolist()), path)
        if len(best) == kept:
            break
    return list(best.values())


def _normals_after(axes: Axes, i: int, on_axis: Array, before: Array | None) -> list[Normal]:
    """Return the normals from axis i, through a point on it, to axis i + 1.

    Parameters
    ----------
    on_axis
        A point on axis i: the end of the normal before.
    before
        The unit vector of the normal before, if there is one.
    """
    z, z_next = axes.directions[i], axes.directions[i + 1]
    lines = axes.lines(i + 1, on_axis) if axes.prismatic[i + 1] else axes.points[i + 1][None]
    cross = np.cross(z, z_next)
    sine = float(np.linalg.norm(cross))
    normals = []
    for line in lines:
        if sine > axes.parallel_below:
            # a point that is hundreds of metres away, as normals of nearly parallel axes are, would cost digits
            point = on_axis if axes.prismatic[i] else axes.points[i]
            normals += _skew(z, z_next, cross / sine, point, line)
        else:
            normals += _parallel(axes, i, on_axis, line, before)
    return normals


def nearest_points(point: Array, z: Array, other: Array, z_other: Array) -> tuple[Array, Array]:
    """Return where two lines that are not parallel are nearest to each other, m.

    Cross products keep the digits that a difference of scalar products loses where the lines are nearly parallel.
    """
    gap, cross = other - point, np.cross(z, z_other)
    square = float(cross @ cross)
    along = float(np.cross(gap, z_other) @ cross) / square
    along_other = float(np.cross(gap, z) @ cross) / square
    return point + along * z, other + along_other * z_other


def _skew(z: Array, z_next: Array, x: Array, on_axis: Array, line: Array) -> list[Normal]:
    """Return the one common normal, in both directions."""
    start, end = nearest_points(on_axis, z, line, z_next)
    return [Normal(sign * x, start, end) for sign in (1.0, -1.0)]


def _parallel(axes: Axes, i: int, on_axis: Array, line: Array, before: Array | None) -> list[Normal]:
    """Return normals between parallel axes, at named points' heights; of coincident ones in named directions."""
    z, gap = axes.directions[i], line - on_axis
    gap = gap - (gap @ z) * z
    length = float(np.linalg.norm(gap))
    if length > ZERO:
        directions = np.array([gap / length, -gap / length])
    else:
        gap = np.zeros(3)
        directions = _perpendicular(axes.crosswise(i, before), z)
    heights = (axes.heights(i, on_axis) - on_axis) @ z
    heights[0] = 0.0
    _, places = np.unique(np.round(heights, 10), return_index=True)
    starts = [on_axis + heights[place] * z for place in np.sort(places)]
    return [Normal(x, start, start + gap) for start in starts for x in directions]


def _perpendicular(named: Array, z: Array) -> Array:
    """Return directions' parts perpendicular to an axis, each with its opposite; shape (k, 3)."""
    flat = named - (named @ z)[:, None] * z
    lengths = np.linalg.norm(flat, axis=1)
    flat = flat[lengths > 1e-3] / lengths[lengths > 1e-3, None]
    if not len(flat):
        least = np.eye(3)[np.argmin(np.abs(z))]
        flat = np.cross(z, least)[None]
        flat /= np.linalg.norm(flat)
    return _distinct(np.vstack([flat, -flat]))


def _distinct(rows: Array) -> Array:
    """Return rows without repetitions, in their order."""
    _, places = np.unique(np.round(rows, 9) + 0.0, axis=0, return_index=True)
    return np.asarray(rows[np.sort(places)])
