"""Distances of points and segments in closed form, as bounds that exclude pairs before exact distances."""

from __future__ import annotations

import numpy as np

from dhkit.description import Array, Box
from dhkit.planning.obstacles.scene import Obstacle

POINTS = 9
"""Number of points of an axis at which its distance from a box is bounded."""

ZERO = 1e-15
"""Squared length (m^2), or that times a squared sine, below which a direction is undefined."""

Bounds = tuple[Array, Array]
"""Lower and upper bounds of a distance, shape (...) each, m."""


def segment_distances(first: Array, second: Array) -> Array:
    """Return the distances of segments (Ericson, Real-Time Collision Detection, 2005, section 5.1.9).

    Parameters
    ----------
    first, second
        Ends of the segments, shape (..., 2, 3), m; batch axes are broadcast. Ends may coincide.

    Returns
    -------
    Array
        Distances, shape (...), m.
    """
    p, d1 = first[..., 0, :], first[..., 1, :] - first[..., 0, :]
    other, d2 = second[..., 0, :], second[..., 1, :] - second[..., 0, :]
    r = p - other
    a, b, e = np.sum(d1 * d1, axis=-1), np.sum(d1 * d2, axis=-1), np.sum(d2 * d2, axis=-1)
    c, f = np.sum(d1 * r, axis=-1), np.sum(d2 * r, axis=-1)
    s = np.clip(_quotient(b * f - c * e, a * e - b * b), 0.0, 1.0)
    t = np.clip(_quotient(b * s + f, e), 0.0, 1.0)
    s = np.clip(_quotient(b * t - c, a), 0.0, 1.0)
    distances: Array = np.linalg.norm(r + s[..., None] * d1 - t[..., None] * d2, axis=-1)
    return distances


def axis_bounds(obstacle: Obstacle, axes: Array) -> Bounds:
    """Return bounds of the signed distances of segments, shape (..., 2, 3), m, from an obstacle."""
    if isinstance(obstacle.geometry, Box):
        return _box_bounds(obstacle, axes)
    distance = segment_distances(axes, obstacle.axis) - obstacle.radius
    return distance, distance


def _box_bounds(obstacle: Obstacle, axes: Array) -> Bounds:
    T = obstacle.T_world_obstacle
    ends = (axes - T[:3, 3]) @ T[:3, :3]
    share = np.linspace(0, 1, POINTS)[:, None]
    points = ends[..., :1, :] + share * (ends[..., 1:, :] - ends[..., :1, :])
    beyond = np.abs(points) - obstacle.half_sizes
    signed = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1) + np.minimum(beyond.max(axis=-1), 0.0)
    length = np.linalg.norm(ends[..., 1, :] - ends[..., 0, :], axis=-1)
    least = signed.min(axis=-1)
    # No point of the segment is farther than half a step from a sampled point. A segment that is partly inside is
    # bounded only by the ball around its middle, since it may have to move its own length to get out.
    outside = least - length / (2 * (POINTS - 1))
    return np.where(outside > 0, outside, signed[..., POINTS // 2] - length / 2), least


def _quotient(numerator: Array, denominator: Array) -> Array:
    """Return a quotient, 0 where the denominator is 0."""
    quotient: Array = np.divide(numerator, denominator, out=np.zeros_like(numerator), where=denominator > ZERO)
    return quotient
