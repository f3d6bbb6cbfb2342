"""Distance from a point to the nearest one that the centre of a spherical wrist reaches.

In the arm's plane the wrist's centre has coordinates x and u; it reaches all points whose distance from axis 2, at
(a1, 0), lies in a range. Joint 1 turns the plane, which passes axis 1 at the distance ``offset``. So the centre has the
distance r = sqrt(x^2 + offset^2) from axis 1, and the nearest point minimizes

    (sqrt(x^2 + offset^2) - r)^2 + (u' - u)^2

over that ring. Without offset the nearest point of the ring in the plane is the nearest one; with it, it is not.
"""

from __future__ import annotations

import numpy as np

from dhkit.description import Array
from dhkit.kinematics.closed_form.family import Fit

_DIRECTIONS = 32
"""Number of directions from axis 2 in which the boundary of the ring is tried at first."""
_NEWTON_STEPS = 8
"""Number of Newton steps from such a direction: the last ones change nothing but the rounding."""
_CHUNK = 4096
"""Number of poses at a time."""


def nearest_wrist_distance(fit: Fit, T: Array) -> Array:
    """Return the distances of required wrist centres from the nearest reachable ones, shape (N,), m.

    Parameters
    ----------
    fit
        An arm with ``ring``.
    T
        Poses of the tool in the world that are out of reach, shape (N, 4, 4).
    """
    if len(T) > _CHUNK:
        return np.concatenate(
            [nearest_wrist_distance(fit, T[k : k + _CHUNK]) for k in range(0, len(T), _CHUNK)]
        )
    T_plane_world = np.asarray(fit.parameters["T_plane_world"])
    T_tool_wrist = np.asarray(fit.parameters["T_tool_wrist"])
    a1 = float(np.asarray(fit.parameters["a1"]))
    offset = abs(float(np.asarray(fit.parameters["offset"])))
    least, most = fit.wrist_distances or (0.0, np.inf)

    wanted = T[:, :3, :3] @ T_tool_wrist[:, 3] + T[:, :3, 3]
    seen = wanted @ T_plane_world[:, :3].T + T_plane_world[:, 3]
    r = np.hypot(seen[:, 0], seen[:, 2])
    u = seen[:, 1]

    # The nearest point without regard to the ring has u' = u and x = +-sqrt(r^2 - offset^2), or x = 0 if r < offset;
    # it counts where its distance rho from axis 2 is in the ring.
    x = np.sqrt(np.maximum((r - offset) * (r + offset), 0.0))
    best = np.full(len(T), np.inf)
    for side in (x, -x):
        rho = np.hypot(side - a1, u)
        inside = (rho >= least) & (rho <= most)
        distance = np.abs(np.hypot(side, offset) - r)
        best = np.where(inside, np.minimum(best, distance), best)

    # Otherwise the nearest point is on one of the two circles that bound the ring.
    for bound in (least, most):
        if 0 < bound < np.inf:
            best = np.minimum(best, _distance_of_circle(r, u, a1, offset, bound))
    return best


def _distance_of_circle(r: Array, u: Array, a1: float, offset: float, rho: float) -> Array:
    """Return the distances, shape (N,), from points (r, u) to a circle of radius rho about axis 2 in the plane.

    Its point in direction phi is at the distance g = sqrt((a1 + rho cos(phi))^2 + offset^2) from axis 1 and at the
    height rho sin(phi): the distance to it is sqrt((g - r)^2 + (rho sin(phi) - u)^2).
    """
    step = 2 * np.pi / _DIRECTIONS
    phi: Array = step * np.arange(_DIRECTIONS, dtype=float)
    g = np.hypot(a1 + rho * np.cos(phi), offset)
    values = np.hypot(g - r[:, None], rho * np.sin(phi) - u[:, None])

    # A minimum lies within a step of each direction that is nearer than both its neighbours.
    is_dip = (values <= np.roll(values, 1, axis=1)) & (values <= np.roll(values, -1, axis=1))
    rows, columns = np.nonzero(is_dip)
    nearest = _minimum_near(phi[columns], step, r[rows], u[rows], a1, offset, rho)
    result = values.min(axis=1)
    np.minimum.at(result, rows, nearest)
    return np.asarray(result)


def _minimum_near(
    start: Array, step: float, r: Array, u: Array, a1: float, offset: float, rho: float
) -> Array:
    """Return the smallest distances found by Newton's method within a step of directions ``start``, all (M,)."""
    phi = start
    smallest = np.full(len(start), np.inf)
    for _ in range(_NEWTON_STEPS):
        c = rho * np.cos(phi)
        s = rho * np.sin(phi)
        x = a1 + c
        g = np.hypot(x, offset)
        smallest = np.minimum(smallest, np.hypot(g - r, s - u))
        # Half the derivatives of (g - r)^2 + (s - u)^2, with g' = -x s / g and g'' = (s^2 - x c - g'^2) / g.
        g1 = -x * s / g
        g2 = (s**2 - x * c - g1**2) / g
        slope = (g - r) * g1 + (s - u) * c
        curvature = g1**2 + (g - r) * g2 + c**2 - (s - u) * s

        # Newton's step where the curvature is positive, else a fixed one downhill.
        change = np.divide(-slope, curvature, out=-np.sign(slope) * step / 4, where=curvature > 0)
        phi = np.clip(phi + change, start - step, start + step)
    return np.asarray(smallest)
