"""Small capsules around balls, for bounding the solids of a link."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dhkit.description import Array
from dhkit.planning.obstacles.scene import rotations_onto

RADII = np.concatenate([[1.0], 1 + np.geomspace(2e-3, 0.5, 13)])
"""Radii tried about an axis, relative to the smallest possible: a wider capsule may be shorter and smaller."""
TILT_RATIO = 0.98
"""Largest ratio of volumes with which a tilted axis replaces one of symmetry."""


@dataclass(frozen=True, eq=False)
class Balls:
    """Balls whose convex hull is enclosed; points are balls of radius 0."""

    centres: Array
    """Centres, shape (N, 3), m."""
    radii: Array
    """Radii, shape (N,), m."""


@dataclass(frozen=True, eq=False)
class Enclosure:
    """A capsule around balls."""

    start: Array
    """Centre of one half ball, shape (3,), m."""
    end: Array
    radius: float

    @property
    def volume(self) -> float:
        """Volume, m^3."""
        length = float(np.linalg.norm(self.end - self.start))
        return float(np.pi * self.radius**2 * (length + 4 / 3 * self.radius))


def enclose(balls: Balls) -> Enclosure:
    """Return a small capsule around balls, along a principal or a coordinate axis through the middle of their extent.

    A capsule is convex, so it contains the convex hull of the balls that it contains.
    """
    return min((_about(balls, R[:, 2], _middle(balls, R)) for R in _candidates(balls)), key=lambda c: c.volume)


def refine(balls: Balls) -> Enclosure:
    """Return the capsule of :func:`enclose`, or a smaller one with a tilted axis."""
    from scipy.optimize import minimize

    ranked = sorted(_candidates(balls), key=lambda R: _about(balls, R[:, 2], _middle(balls, R)).volume)
    R = ranked[0]
    middle = _middle(balls, R)
    best = _about(balls, R[:, 2], middle)
    scale = best.radius

    def tilted(x: Array) -> Enclosure:
        direction = R @ np.array([x[0], x[1], 1.0])
        return _about(balls, direction / np.linalg.norm(direction), middle + scale * (R[:, :2] @ x[2:]))

    steps = np.concatenate([np.zeros((1, 4)), 0.1 * np.eye(4)])
    found = minimize(
        lambda x: tilted(x).volume,
        np.zeros(4),
        method="Nelder-Mead",
        options={"initial_simplex": steps, "maxfev": 120, "xatol": 1e-4, "fatol": 0.0},
    )
    other = tilted(found.x)
    return other if other.volume < TILT_RATIO * best.volume else best


def _candidates(balls: Balls) -> list[Array]:
    """Return rotations whose third columns are candidates for the axis."""
    centred = balls.centres - balls.centres.mean(axis=0)
    principal = np.linalg.svd(centred, full_matrices=False)[2] if len(centred) > 2 else np.eye(3)
    axes = [*np.eye(3), *principal]
    # The longest direction of a pair of thin, oblique solids is not a principal axis.
    far = balls.centres[np.argmax(np.linalg.norm(centred, axis=1))]
    along = balls.centres[np.argmax(np.linalg.norm(balls.centres - far, axis=1))] - far
    if np.linalg.norm(along) > 0:
        axes.append(along / np.linalg.norm(along))
    return list(rotations_onto(np.array(axes)))


def _middle(balls: Balls, R: Array) -> Array:
    """Return the middle of the balls' extent along the columns of R."""
    local = balls.centres @ R
    low, high = (local - balls.radii[:, None]).min(axis=0), (local + balls.radii[:, None]).max(axis=0)
    middle: Array = R @ ((low + high) / 2)
    return middle


def _about(balls: Balls, axis: Array, middle: Array) -> Enclosure:
    """Return the smallest capsule about the line through a point along a unit vector."""
    offset = balls.centres - middle
    along = offset @ axis
    aside = np.linalg.norm(offset - along[:, None] * axis, axis=1)
    radii = RADII[:, None] * np.max(aside + balls.radii)
    # A ball at the distance e from the axis is inside if its centre is within r - rho of the segment.
    reach = np.sqrt(np.maximum((radii - balls.radii) ** 2 - aside**2, 0.0))
    low, high = np.min(along + reach, axis=1), np.max(along - reach, axis=1)
    low, high = np.where(low < high, low, (low + high) / 2), np.where(low < high, high, (low + high) / 2)
    best = np.argmin(radii[:, 0] ** 2 * (high - low + 4 / 3 * radii[:, 0]))
    return Enclosure(middle + low[best] * axis, middle + high[best] * axis, float(radii[best, 0]))
