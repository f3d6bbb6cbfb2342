"""The numbers of a Denavit-Hartenberg table and its base, as doubles, from the axes of a chain."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from dhkit.description import Array, Convention
from dhkit.model.extraction.axes import (
    Axes,
    Normal,
    Path,
    angle_about,
    nearest_points,
    tidiest_normals,
)
from dhkit.model.extraction.ends import first_row, frame, last_row, screw

_MIN_SKEW_SINE = 1e-6
"""Smallest sine of the angle between axes whose common normal may serve other axes: other normals are far away."""
_NEARLY_PARALLEL_SINES = (1e-13, 1e-5)
"""Sines of the angle between two neighbouring axes for which both tables are tried: with parallel and skew axes.

With smaller sines the axes are parallel."""


@dataclass(frozen=True, eq=False)
class Table:
    """A table of n joints with its base; the tool is the transform from frame n to the tip.

    Attributes
    ----------
    rows
        theta, d, a, alpha of each row of the convention, shape (n, 4), rad and m.
    T_base_first
        Frame 0 in the base, shape (4, 4), m.
    """

    rows: Array
    T_base_first: Array


def chain_axes(poses: Array, directions: Array, prismatic: list[bool], T_base_tip: Array) -> Axes:
    """Return the axes of joints in the base, with the points and directions that free choices are taken from.

    Parameters
    ----------
    poses
        The joints' frames in the base at zero, shape (n, 4, 4), m.
    directions
        Their axes in the base, unit vectors, shape (n, 3).
    prismatic
        Whether each joint is.
    T_base_tip
        The tip at zero, shape (4, 4), m.
    """
    origins = poses[:, :3, 3]
    feet: list[Array] = []
    normals: list[Array] = []

    # The common normal of axes z_i and z_(i + 1) has the direction z_i x z_(i + 1), whose length is their angle's sine.
    for i in range(len(poses) - 1):
        cross = np.cross(directions[i], directions[i + 1])
        sine = float(np.linalg.norm(cross))
        if sine > _MIN_SKEW_SINE:
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


def nearly_parallel(axes: Axes) -> list[tuple[int, float]]:
    """Return the neighbouring axes that are nearly parallel: the first one's joint, from 1, and the angle's sine."""
    sines = np.linalg.norm(np.cross(axes.directions[:-1], axes.directions[1:]), axis=1)
    low, high = _NEARLY_PARALLEL_SINES
    return [(i, float(sine)) for i, sine in enumerate(sines, start=1) if low < sine < high]


class MadeParallel(NamedTuple):
    """Two neighbouring axes that a file's rounded angles leave a little from parallel."""

    first: int
    """Number of the first one's joint, from 1."""
    angle: float
    """Angle between them in the file, rad."""


def with_parallel_axes(
    axes: Axes, roundings: Sequence[float]
) -> tuple[Axes, tuple[MadeParallel, ...]]:
    """Return the axes, those parallel that are parallel to within the rounding of a file's angles.

    Parameters
    ----------
    axes
        The axes of n joints.
    roundings
        Bounds on the rounding error of the angle between each axis and the next, n - 1 numbers, rad.
    """
    directions = axes.directions.copy()
    made: list[MadeParallel] = []
    for i, rounding in enumerate(roundings):
        sine = float(np.linalg.norm(np.cross(axes.directions[i], axes.directions[i + 1])))
        # An axis that is parallel in the file follows one that was turned.
        if sine <= max(rounding, _NEARLY_PARALLEL_SINES[0]):
            directions[i + 1] = directions[i] * np.sign(axes.directions[i] @ axes.directions[i + 1])
            if sine > _NEARLY_PARALLEL_SINES[0]:
                made.append(MadeParallel(i + 1, math.asin(sine)))
    return replace(axes, directions=directions), tuple(made)


def tidiest_table(axes: Axes, convention: Convention) -> Table:
    """Return the table with the fewest nonzero entries through these axes."""
    # Costs are compared for an arm whose longest step is about 1; scaling by a power of two changes no digit.
    longest = _longest_step(axes)
    unit = 2.0 ** round(math.log2(longest)) if longest > 0 else 1.0
    tip = _with_lengths_times(1 / unit, axes.T_base_tip)
    table = _unit_table(
        replace(axes, points=axes.points / unit, feet=axes.feet / unit, T_base_tip=tip), convention
    )
    return Table(table.rows * [1.0, unit, unit, 1.0], _with_lengths_times(unit, table.T_base_first))


def _longest_step(axes: Axes) -> float:
    """Return the largest distance between the origins of two joints that follow each other, of base and tip too, m."""
    origins = np.vstack([np.zeros((1, 3)), axes.points, axes.T_base_tip[None, :3, 3]])
    return float(np.linalg.norm(np.diff(origins, axis=0), axis=1).max())


def _with_lengths_times(factor: float, T: Array) -> Array:
    """Return a pose, shape (4, 4), with its translation times a factor."""
    scaled = T.copy()
    scaled[:3, 3] *= factor
    return scaled


def _unit_table(axes: Axes, convention: Convention) -> Table:
    """Return the table of an arm whose size is about 1.

    The frame T of the first normal in the base gives that of the table's frame 0: the entries of the first row are
    taken off, T (Rz(theta_1) Tz(d_1))^-1, and in modified tables (Rx(alpha_0) Tx(a_0))^-1 too.
    """
    z = axes.directions
    if axes.n == 1:
        path = min(_single_joint_paths(axes, convention), key=attrgetter("cost"))
    else:
        path = tidiest_normals(
            axes,
            lambda normal: first_row(convention, normal, z[0]),
            lambda normal: last_row(convention, normal, z[-1], axes.T_base_tip),
        )
    first = path.normals[0]
    start = path.start
    T = frame(first.x, z[0], first.start) @ np.linalg.inv(screw(2, start.theta, start.d))
    if convention is Convention.MODIFIED:
        T = T @ np.linalg.inv(screw(0, start.alpha, start.a))
    return Table(_rows(axes, convention, path), T)


def _rows(axes: Axes, convention: Convention, path: Path) -> Array:
    """Return theta, d, a, alpha of each row of the convention, shape (n, 4).

    Normal i has the length a_i and rotates by alpha_i: standard tables write both into row i, modified ones into row
    i + 1. Between normals i - 1 and i are theta_i and d_i along axis i.
    """
    z = axes.directions
    n = axes.n
    start = path.start
    end = path.end or path.start

    # theta and d of axes 1 to n; a and alpha of normals 0 to n.
    along = np.zeros((n, 2))
    across = np.zeros((n + 1, 2))
    along[-1] = end.theta, end.d
    along[0] = start.theta, start.d
    across[0] = start.a, start.alpha
    across[n] = end.a, end.alpha
    for i, normal in enumerate(path.normals if n > 1 else (), start=1):
        across[i] = normal.length, float(angle_about(normal.x, z[i - 1], z[i]))
        if float(np.linalg.norm(np.cross(z[i - 1], z[i]))) <= axes.parallel_below:
            across[i, 1] = 0.0 if z[i - 1] @ z[i] > 0 else np.pi
        if i > 1:
            previous = path.normals[i - 2]
            theta = float(angle_about(z[i - 1], previous.x, normal.x))
            along[i - 1] = theta, float((normal.start - previous.end) @ z[i - 1])
    return np.hstack([along, across[1:] if convention is Convention.STANDARD else across[:-1]])


def _single_joint_paths(axes: Axes, convention: Convention) -> Iterator[Path]:
    """Yield tables of one joint: a normal of length zero at a known point's height, in a known direction."""
    z = axes.directions[0]
    on_axis = axes.points[0]
    parts = axes.perpendicular(0, None)
    for x in (*parts, *-parts):
        for point in axes.start_points(0, on_axis):
            # A prismatic axis may go through the point; else the normal is at the point's height on the axis.
            origin = point if axes.prismatic[0] else on_axis + ((point - on_axis) @ z) * z
            normal = Normal(x, origin, origin)
            start_cost, start = first_row(convention, normal, z)
            end_cost, end = last_row(convention, normal, z, axes.T_base_tip, with_theta=False)
            yield Path(
                (normal,), start_cost + end_cost, start, end._replace(theta=start.theta, d=start.d)
            )
