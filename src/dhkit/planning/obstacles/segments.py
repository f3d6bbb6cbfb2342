"""Distances of points and segments in closed form, as bounds that exclude pairs before exact distances."""

from __future__ import annotations

import numpy as np

from dhkit.description import Array
from dhkit.planning.obstacles.scene import Solids

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
    own, theirs = nearest_points(first, second)
    distances: Array = np.linalg.norm(own - theirs, axis=-1)
    return distances


def nearest_points(first: Array, second: Array) -> tuple[Array, Array]:
    """Return the nearest points of segments, shape (..., 3) each, m, on the first and on the second.

    Parameters
    ----------
    first, second
        As in :func:`segment_distances`.
    """
    p, d1 = first[..., 0, :], first[..., 1, :] - first[..., 0, :]
    other, d2 = second[..., 0, :], second[..., 1, :] - second[..., 0, :]
    r = p - other
    a, b, e = _dot(d1, d1), _dot(d1, d2), _dot(d2, d2)
    c, f = _dot(d1, r), _dot(d2, r)
    s = np.clip(_quotient(b * f - c * e, a * e - b * b), 0.0, 1.0)
    t = np.clip(_quotient(b * s + f, e), 0.0, 1.0)
    s = np.clip(_quotient(b * t - c, a), 0.0, 1.0)
    return p + s[..., None] * d1, other + t[..., None] * d2


def nearest_on_box(axes: Array, T_world_box: Array, half_sizes: Array) -> tuple[Array, Array]:
    """Return the nearest points of segments and a box, shape (..., 3) each, m, on the segment and in the box.

    The derivative of the squared distance along a segment is piecewise linear and grows: its zero lies between two of
    the positions at which a coordinate enters or leaves the box.

    Parameters
    ----------
    axes
        Ends of the segments, shape (..., 2, 3), m.
    T_world_box
        Pose of the box, shape (..., 4, 4), m; batch axes are broadcast.
    half_sizes
        Half the edges, shape (..., 3), m; zeros for a point or a segment.
    """
    R, centre, half = T_world_box[..., :3, :3], T_world_box[..., None, :3, 3], half_sizes[..., None, :]
    ends = (axes - centre) @ R
    start, along = ends[..., 0, :], ends[..., 1, :] - ends[..., 0, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossings = np.concatenate([(-half_sizes - start) / along, (half_sizes - start) / along], axis=-1)
    shares = np.clip(np.nan_to_num(crossings, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0)
    edges = np.zeros((*shares.shape[:-1], 1))
    shares = np.sort(np.concatenate([edges, shares, edges + 1], axis=-1), axis=-1)
    points = start[..., None, :] + shares[..., None] * along[..., None, :]
    slopes = np.sum(along[..., None, :] * (points - np.clip(points, -half, half)), axis=-1)
    last = np.maximum(np.sum(slopes < 0, axis=-1, keepdims=True) - 1, 0)
    after = np.minimum(last + 1, shares.shape[-1] - 1)
    (s0, g0), (s1, g1) = (
        [np.take_along_axis(array, k, axis=-1)[..., 0] for array in (shares, slopes)] for k in (last, after)
    )
    s = np.where(g0 >= 0, s0, np.where(g1 < 0, s1, s0 + (s1 - s0) * _quotient(-g0, g1 - g0)))
    own = (start + s[..., None] * along)[..., None, :]
    R_world_box = np.swapaxes(R, -1, -2)
    found = own @ R_world_box + centre, np.clip(own, -half, half) @ R_world_box + centre
    return found[0][..., 0, :], found[1][..., 0, :]


def axis_bounds(solids: Solids, axes: Array) -> Bounds:
    """Return bounds of the signed distances of segments from solids.

    Parameters
    ----------
    solids
        P solids.
    axes
        Ends of the segments, shape (..., P, 2, 3), m: the last batch axis goes with the solids.
    """
    if solids.are_boxes:
        return _box_bounds(solids, axes)
    distance = segment_distances(axes, solids.axes) - solids.radii
    return distance, distance


def _box_bounds(solids: Solids, axes: Array) -> Bounds:
    ends = (axes - solids.centres[:, None]) @ solids.placements[:, :3, :3]
    share = np.linspace(0, 1, POINTS)[:, None]
    points = ends[..., :1, :] + share * (ends[..., 1:, :] - ends[..., :1, :])
    beyond = np.abs(points) - solids.half_sizes[:, None]
    signed = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1) + np.minimum(beyond.max(axis=-1), 0.0)
    length = np.linalg.norm(ends[..., 1, :] - ends[..., 0, :], axis=-1)
    least = signed.min(axis=-1)
    # No point of the segment is farther than half a step from a sampled point. A segment that is partly inside is
    # bounded only by the ball around its middle, since it may have to move its own length to get out.
    outside = least - length / (2 * (POINTS - 1))
    return np.where(outside > 0, outside, signed[..., POINTS // 2] - length / 2), least


def _dot(first: Array, second: Array) -> Array:
    """Return scalar products along the last axis: five times as fast as a product and its sum over three numbers."""
    products: Array = np.einsum("...i,...i->...", first, second)
    return products


def _quotient(numerator: Array, denominator: Array) -> Array:
    """Return a quotient, 0 where the denominator is 0."""
    quotient: Array = np.divide(numerator, denominator, out=np.zeros_like(numerator), where=denominator > ZERO)
    return quotient
