"""Distances from obstacles as smooth CasADi expressions, for an optimizer.

Smoothing makes distances differentiable and inexact: a path is checked with :func:`dhkit.planning.obstacles.distance`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dhkit.description import Array, Description
from dhkit.planning.obstacles.capsules import LinkCapsule, link_capsules
from dhkit.planning.obstacles.pairs import checked_pairs
from dhkit.planning.obstacles.slots import BOX, CAPSULE, SceneSlots, starts
from dhkit.symbolic.differentiable.frames import SymbolicTable

if TYPE_CHECKING:
    import casadi

CLAMP_WIDTH = 1e-2
"""Width of the smooth transitions at 0 and 1, where a parameter of a segment is clamped to [0, 1]."""
EDGE_WIDTH = 1e-2
"""Width of the smooth transitions in the distance from a box, m. At a distance r they add about EDGE_WIDTH^2 / r: 1 mm
at 10 cm."""
PARALLEL = 1e-6
"""Addition to the squared area between two segments' directions, m^4, which is 0 for parallel ones."""
POINT = 1e-8
"""Addition to a segment's squared length, m^2, which is 0 for a sphere."""
ZERO = 1e-12
"""Coordinate (m) below which a value counts as 0."""
MAX_SAG = 1e-2
"""Largest amount by which an axis may be nearer to a box than the points that represent it, m."""


def clearances(description: Description, q: casadi.SX, parameters: casadi.SX, slots: SceneSlots) -> casadi.SX:
    """Return the clearances of an arm from obstacles, each at least 1 if the clearance is kept.

    Parameters
    ----------
    q
        Joint values, n x 1, rad and m.
    parameters
        Parameters of the slots, size x 1, see :meth:`SceneSlots.values`.
    slots
        The slots of the program.

    Returns
    -------
    casadi.SX
        k x 1, dimensionless: for each capsule slot and moving capsule of the arm; for each box slot and some points of
        these capsules; for the floor and each end whose height changes; for each pair of capsules of the arm that may
        meet. Between two capsules, the squared distance of their axes over the squared sum of radii and margin; from a
        box or the floor, the axis's signed distance over the sum of radius and margin.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.symbolic.differentiable.frames import joint_symbols
    >>> slots = SceneSlots(capsules=1)
    >>> q, p = joint_symbols("q", 3), joint_symbols("p", slots.size)
    >>> clearances(library_robot("planar3r"), q, p, slots).shape
    (5, 1)
    """
    import casadi

    pairs, axes = checked_pairs(description), _world_axes(description, q)
    capsules, boxes, floor, itself = starts(slots)
    moving = [axes[i] for i in pairs.moving]
    rows: list[casadi.SX] = []
    for k in capsules:
        slot = parameters[k : k + CAPSULE]
        obstacle = _Axis(slot[0:3], slot[3:6], casadi.sumsqr(slot[3:6]), slot[6])
        rows += [_between(axis, obstacle, 0.0) for axis in moving]
    for k in boxes:
        slot = parameters[k : k + BOX]
        rows += [value for axis in moving for value in _from_box(axis, slot)]
    if slots.floor:
        height, margin = parameters[floor], parameters[floor + 1]
        for i, end in pairs.heights:
            axis = axes[i]
            rows.append((axis.start[2] + end * axis.along[2] - height) / (axis.radius + margin))
    if slots.self_collision:
        rows += [_between(axes[i], axes[j], parameters[itself]) for i, j in pairs.near]
    result: casadi.SX = casadi.vertcat(casadi.SX(0, 1), *rows)
    return result


@dataclass(frozen=True, eq=False)
class _Axis:
    """Axis of a capsule in the world, as expressions or numbers."""

    start: Any
    """Position of the start, 3 x 1, m."""
    along: Any
    """Vector from the start to the end, 3 x 1, m."""
    square: Any
    """Squared length, m^2."""
    radius: Any
    """Radius of the capsule, m."""
    shares: tuple[float, ...] = ()
    """Positions of the points for boxes, from 0 at the start to 1 at the end."""


def _world_axes(description: Description, q: casadi.SX) -> list[_Axis]:
    frames = SymbolicTable.of(description).world_to_frames(q)
    axes = []
    for capsule in link_capsules(description):
        T, along = frames[capsule.link], capsule.end - capsule.start
        start = T[:3, :3] @ _sparse(capsule.start) + T[:3, 3]
        axes.append(_Axis(start, T[:3, :3] @ _sparse(along), float(along @ along), capsule.radius, _shares(capsule)))
    return axes


def _between(first: _Axis, second: _Axis, margin: Any) -> casadi.SX:
    """Return the squared distance of two segments over the squared sum of radii and margin.

    The points are those of Ericson, Real-Time Collision Detection, 2005, section 5.1.9, with smooth clamps. They are
    always on the segments, so that the distance can only be too large.
    """
    import casadi

    d1, d2, r = first.along, second.along, first.start - second.start
    a, b, e = first.square, casadi.dot(d1, d2), second.square
    c, f = casadi.dot(d1, r), casadi.dot(d2, r)
    s = _smooth_clamp((b * f - c * e) / (a * e - b * b + PARALLEL))
    t = _smooth_clamp((b * s + f) / (e + POINT))
    s = _smooth_clamp((b * t - c) / (a + POINT))
    share: casadi.SX = casadi.sumsqr(r + s * d1 - t * d2) / (first.radius + second.radius + margin) ** 2
    return share


def _from_box(axis: _Axis, slot: casadi.SX) -> list[casadi.SX]:
    """Return smooth signed distances of points of a segment from a box over radius and margin."""
    import casadi

    R_box_world = casadi.reshape(slot[0:9], 3, 3).T
    half, margin = slot[12:15], slot[15]
    start, along = R_box_world @ (axis.start - slot[9:12]), R_box_world @ axis.along
    return [_signed_distance(start + s * along, half) / (axis.radius + margin) for s in axis.shares]


def _signed_distance(point: casadi.SX, half: casadi.SX) -> casadi.SX:
    """Return a point's smooth signed distance from a box in the box's frame, m.

    Outside it is the length of the excess over the half sizes, inside the largest excess. One of the two is nearly 0,
    and their sum has a gradient everywhere.
    """
    import casadi

    excess = casadi.sqrt(point**2 + EDGE_WIDTH**2) - half
    beyond = (excess + casadi.sqrt(excess**2 + EDGE_WIDTH**2)) / 2
    x, y, z = casadi.vertsplit(excess)
    inside = _smooth_maximum(_smooth_maximum(x, y), z)
    signed: casadi.SX = casadi.sqrt(casadi.sumsqr(beyond)) + (inside - casadi.sqrt(inside**2 + EDGE_WIDTH**2)) / 2
    return signed


def _shares(capsule: LinkCapsule) -> tuple[float, ...]:
    """Return the positions of an axis's points for distances to boxes, so dense that the error is at most MAX_SAG.

    Halfway between two points whose spheres touch a corner, the axis is nearer to it by sqrt(r^2 + h^2) - r, where h
    is half the step.
    """
    if capsule.length <= MAX_SAG:
        return (0.5,)
    step = 2 * float(np.sqrt(2 * capsule.radius * MAX_SAG + MAX_SAG**2))
    return tuple(np.linspace(0, 1, 1 + int(np.ceil(capsule.length / step))).tolist())


def _smooth_clamp(x: casadi.SX) -> casadi.SX:
    """Return x clamped smoothly to (0, 1)."""
    import casadi

    clamped: casadi.SX = (1 + casadi.sqrt(x**2 + CLAMP_WIDTH**2) - casadi.sqrt((x - 1) ** 2 + CLAMP_WIDTH**2)) / 2
    return clamped


def _smooth_maximum(x: casadi.SX, y: casadi.SX) -> casadi.SX:
    import casadi

    return (x + y + casadi.sqrt((x - y) ** 2 + EDGE_WIDTH**2)) / 2


def _sparse(vector: Array) -> casadi.DM:
    """Return a vector as a sparse matrix without values that are 0 up to rounding, which saves their operations."""
    import casadi

    rounded = np.where(np.abs(vector) < ZERO, 0.0, vector)
    return casadi.sparsify(casadi.DM(rounded))
