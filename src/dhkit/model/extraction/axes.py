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

__all__ = ["Axes", "Normal", "Path", "angle_costs", "length_costs", "nearest_points", "tidiest_normals", "turn_about"]

ENTRY = 1000.0
"""Cost of an entry that is not zero: more than all other preferences of a table together."""
OBLIQUE, STRAIGHT, NEGATIVE = 20.0, 2.0, 1.0
"""Extra costs of an angle that is no multiple of 90 degrees, of one of 180 degrees, and of a negative number."""
EARLY = 0.1
"""Extra cost of an offset d for each row that comes after it: parallel axes share one offset, the last takes it."""
ZERO = 1e-10
"""m or rad: what is smaller counts as zero when tables are compared."""
KEPT = 48
"""Partial tables that are followed up, per axis."""


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
    named_points, named_directions
        Points, m, and unit vectors of the URDF's own frames, from which free choices are taken; shape (k, 3).
    parallel_below
        Sine of the largest angle between two neighbouring axes that are treated as parallel.
    """

    points: Array
    directions: Array
    prismatic: Sequence[bool]
    T_base_tip: Array
    named_points: Array
    named_directions: Array
    parallel_below: float = 1e-10

    @property
    def n(self) -> int:
        """The number of joints."""
        return len(self.points)


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
        lines = _distinct(np.vstack([axes.points[:1], axes.named_points]))
        first = [normal for point in lines for normal in _normals_after(axes, 0, point, None)]
    paths = []
    for normal in first:
        cost, start = begin(normal)
        row = length_costs(np.array([_along(normal)]))[0] + angle_costs(np.array([_bend(axes, 0, normal)]))[0]
        paths.append(Path((normal,), cost + float(row), start))
    paths = _cheapest(paths)
    for i in range(1, axes.n - 1):
        paths = _cheapest([longer for path in paths for longer in _extended(axes, i, path)])
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


def _cheapest(paths: list[Path]) -> list[Path]:
    """Return the best paths, one for each last normal, cheapest first."""
    best: dict[tuple[float, ...], Path] = {}
    for path in sorted(paths, key=lambda one: one.cost):
        last = path.normals[-1]
        best.setdefault(tuple(np.round([*last.x, *last.end], 7).tolist()), path)
    return list(best.values())[:KEPT]


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
    lines = axes.points[i + 1][None]
    if axes.prismatic[i + 1]:
        lines = _distinct(np.vstack([lines, on_axis[None], axes.named_points]))
    cross = np.cross(z, z_next)
    sine = float(np.linalg.norm(cross))
    normals = []
    for line in lines:
        if sine > axes.parallel_below:
            # a point that is hundreds of metres away, as normals of nearly parallel axes are, would cost digits
            point = on_axis if axes.prismatic[i] else axes.points[i]
            normals += _skew(z, z_next, cross / sine, point, line)
        else:
            normals += _parallel(axes, z, on_axis, line, before)
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


def _parallel(axes: Axes, z: Array, on_axis: Array, line: Array, before: Array | None) -> list[Normal]:
    """Return normals between parallel axes, at named points' heights; of coincident ones in named directions."""
    gap = line - on_axis
    gap = gap - (gap @ z) * z
    length = float(np.linalg.norm(gap))
    if length > ZERO:
        directions = np.array([gap / length, -gap / length])
    else:
        gap = np.zeros(3)
        directions = _perpendicular(axes, z, before)
    heights = np.unique(np.round(np.append((axes.named_points - on_axis) @ z, 0.0), 11))
    heights = np.concatenate([[0.0], heights[np.abs(heights) > ZERO]])
    exact = (axes.named_points - on_axis) @ z
    normals = []
    for height in heights:
        # rounding is for telling heights apart, the height itself is taken as it is
        near = exact[np.abs(exact - height) < 1e-10]
        start = on_axis + (near[0] if height and len(near) else height) * z
        normals += [Normal(x, start, start + gap) for x in directions]
    return normals


def _perpendicular(axes: Axes, z: Array, before: Array | None) -> Array:
    """Return the named directions' parts perpendicular to an axis, each with its opposite; shape (k, 3)."""
    named = axes.named_directions if before is None else np.vstack([before[None], axes.named_directions])
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
