"""From the axes of a chain to the numbers of its Denavit-Hartenberg table, base and tool, as doubles."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from dhkit.description import Array, Convention
from dhkit.model.extraction.axes import Axes, Normal, Path, nearest_points, tidiest_normals, turn_about
from dhkit.model.extraction.ends import FirstRow, LastRow, Tip, first_row, frame, last_row, screw

OBLIQUE = 1e-6
"""Sine of the angle between axes whose common normal may serve other axes: that of others is far away."""
NEAR = (1e-13, 1e-5)
"""Sine of the angle between two neighbouring axes: below, they are parallel; in between both tables are tried."""


@dataclass(frozen=True, eq=False)
class Table:
    """A table of n joints with its base; the tool is what is left behind frame n.

    Attributes
    ----------
    rows
        theta, d, a, alpha of each row of the convention, shape (n, 4), rad and m.
    T_base_first
        Frame 0 in the base, shape (4, 4).
    """

    convention: Convention
    rows: Array
    T_base_first: Array


def chain_axes(poses: Array, directions: Array, prismatic: list[bool], T_base_tip: Array) -> Axes:
    """Return the axes of joints in the base, with the points and directions that free choices are taken from.

    Parameters
    ----------
    poses
        The joints' frames in the base at zero, shape (n, 4, 4).
    directions
        Their axes in the base, unit vectors, shape (n, 3).
    prismatic
        Whether each joint is.
    T_base_tip
        The tip at zero, shape (4, 4).
    """
    origins = poses[:, :3, 3]
    feet: list[Array] = []
    normals: list[Array] = []
    for i in range(len(poses) - 1):
        cross = np.cross(directions[i], directions[i + 1])
        sine = float(np.linalg.norm(cross))
        if sine > OBLIQUE:
            feet += nearest_points(origins[i], directions[i], origins[i + 1], directions[i + 1])
            normals.append(cross / sine)
    return Axes(
        points=origins,
        directions=directions,
        prismatic=prismatic,
        T_base_tip=T_base_tip,
        frames=np.swapaxes(poses[:, :3, :3], 1, 2),
        feet=np.array(feet).reshape(-1, 3),
        normals=np.array(normals).reshape(-1, 3),
    )


def near_parallel(axes: Axes) -> list[tuple[int, float]]:
    """Return the neighbouring axes that are nearly parallel: the first one's joint, from 1, and the sine between."""
    sines = np.linalg.norm(np.cross(axes.directions[:-1], axes.directions[1:]), axis=1)
    return [(i, float(sine)) for i, sine in enumerate(sines, start=1) if NEAR[0] < sine < NEAR[1]]


def tidiest_table(axes: Axes, convention: Convention) -> Table:
    """Return the table with the fewest nonzero entries through these axes."""
    extent = max(float(np.abs(axes.points).max()), float(np.abs(axes.T_base_tip[:3, 3]).max()))
    # powers of two change no digit; what counts as zero is then a share of the arm's size
    unit = 2.0 ** round(math.log2(extent)) if extent > 0 else 1.0
    table = _tidiest(_scaled(axes, 1 / unit), convention)
    return Table(convention, table.rows * [1.0, unit, unit, 1.0], _stretched(table.T_base_first, unit))


def _scaled(axes: Axes, factor: float) -> Axes:
    tip = _stretched(axes.T_base_tip, factor)
    return replace(axes, points=axes.points * factor, feet=axes.feet * factor, T_base_tip=tip)


def _stretched(T: Array, factor: float) -> Array:
    stretched = T.copy()
    stretched[:3, 3] *= factor
    return stretched


def _tidiest(axes: Axes, convention: Convention) -> Table:
    """Return the table of an arm whose size is about 1."""
    z = axes.directions
    if axes.n == 1:
        path, start, end = _single(axes, convention)
    else:
        path, end = tidiest_normals(
            axes,
            lambda normal: first_row(convention, normal, z[0]),
            lambda normal: last_row(convention, normal, z[-1], Tip(axes.T_base_tip)),
        )
        start = path.start
    rows = _rows(axes, convention, path.normals, start, end)
    first = path.normals[0]
    T = frame(first.x, z[0], first.start) @ np.linalg.inv(screw(2, start.theta, start.d))
    if convention is Convention.MODIFIED:
        T = T @ np.linalg.inv(screw(0, start.alpha, start.a))
    return Table(convention, rows, T)


def _rows(axes: Axes, convention: Convention, normals: tuple[Normal, ...], start: FirstRow, end: LastRow) -> Array:
    """Return theta, d, a, alpha of each row of the convention, shape (n, 4)."""
    z, n = axes.directions, axes.n
    along, across = np.zeros((n, 2)), np.zeros((n + 1, 2))
    along[-1] = end.theta, end.d
    along[0] = start.theta, start.d
    across[0], across[n] = (start.a, start.alpha), (end.a, end.alpha)
    inner = normals if n > 1 else ()
    for i, normal in enumerate(inner, start=1):
        a = float((normal.end - normal.start) @ normal.x)
        across[i] = a, float(turn_about(normal.x, z[i - 1], z[i]))
        if float(np.linalg.norm(np.cross(z[i - 1], z[i]))) <= axes.parallel_below:
            across[i, 1] = 0.0 if z[i - 1] @ z[i] > 0 else np.pi
        if i > 1:
            before = normals[i - 2]
            along[i - 1] = (
                float(turn_about(z[i - 1], before.x, normal.x)),
                float((normal.start - before.end) @ z[i - 1]),
            )
    beside = across[1:] if convention is Convention.STANDARD else across[:-1]
    return np.hstack([along, beside])


def _single(axes: Axes, convention: Convention) -> tuple[Path, FirstRow, LastRow]:
    """Return the cheapest table of one joint: a normal of length zero at a named height in a named direction."""
    z = axes.directions[0]
    best: tuple[float, Path, FirstRow, LastRow] | None = None
    named = axes.crosswise(0, None)
    flat = named - (named @ z)[:, None] * z
    lengths = np.linalg.norm(flat, axis=1)
    directions = flat[lengths > 1e-3] / lengths[lengths > 1e-3, None]
    for x in (*directions, *-directions):
        for point in axes.heights(0, axes.points[0]):
            at = point if axes.prismatic[0] else axes.points[0] + ((point - axes.points[0]) @ z) * z
            normal = Normal(x, at, at)
            begun, start = first_row(convention, normal, z)
            ended, end = last_row(convention, normal, z, Tip(axes.T_base_tip, with_theta=False))
            if best is None or begun + ended < best[0]:
                best = begun + ended, Path((normal,), begun + ended), start, end
    if best is None:
        raise AssertionError("no table of one joint")
    _, path, start, end = best
    return path, start, replace(end, theta=start.theta, d=start.d)
