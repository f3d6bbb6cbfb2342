"""What is drawn beside the arm, as the numbers that a page takes: colors, ellipsoids as balls, obstacles as solids."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import Array

if TYPE_CHECKING:
    from dhkit.kinematics.manipulability import Ellipsoid
    from dhkit.planning.obstacles import Scene

GREY = (0.5, 0.55, 0.62)
TINTS = ("#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377", "#ee7733", "#009988")
"""Tol's bright and vibrant schemes (SRON/EPS/TN/09-002, 2021): the eight branches of a wrist-partitioned arm."""
HEAT = ("viridis", 0.87)
"""A scale of even steps, told apart by colour-blind people too, and where to end it: its palest is lost on white."""
FLOOR = 1.2
"""Half an edge of a floor as it is drawn, of the arm's size: it has no end."""
THINNEST = 0.01
"""Half axes below this share of the longest are drawn as this: a ball pressed flat has no normals."""


def color_bytes(colors: ArrayLike | None, count: int, name: str = "colors") -> NDArray[np.uint8]:
    """Return colors as bytes, shape (count, 3).

    Parameters
    ----------
    colors
        Red, green and blue from 0 to 1, shape (count, 3), or (3,) for all; grey if not given.

    Raises
    ------
    ValueError
        Another shape, or values that are not from 0 to 1.
    """
    given = np.asarray(GREY if colors is None else colors, dtype=float)
    if given.shape not in ((3,), (count, 3)):
        raise ValueError(f"{name} has shape {given.shape}; expected (3,) or ({count}, 3)")
    if not np.all((given >= 0) & (given <= 1)):
        raise ValueError(f"{name} has values that are not from 0 to 1")
    return np.broadcast_to(np.rint(255 * given).astype(np.uint8), (count, 3))


def heat_colors(values: ArrayLike) -> Array:
    """Return a color for each value, from dark (0) to bright (the largest): red, green and blue from 0 to 1.

    Parameters
    ----------
    values
        Shape (...), 0 or more, such as a workspace's manipulability; NaN counts as 0.

    Returns
    -------
    Array
        Shape (..., 3).

    Examples
    --------
    >>> heat_colors([0.0, 1.0, 2.0]).shape
    (3, 3)
    """
    import matplotlib

    known = np.nan_to_num(np.asarray(values, dtype=float))
    name, end = HEAT
    share = end * known / (float(known.max(initial=0.0)) or 1.0)
    return np.asarray(matplotlib.colormaps[name](share))[..., :3]


def ghost_tints(count: int) -> NDArray[np.uint8]:
    """Return as many colors, shape (count, 3), eight of them unlike."""
    tints = [list(bytes.fromhex(TINTS[k % len(TINTS)][1:])) for k in range(count)]
    return np.array(tints, dtype=np.uint8).reshape(count, 3)


def ball_transforms(ellipsoid: Ellipsoid, scale: float | None, longest: float) -> Array:
    """Return what maps the unit ball to each of a batch of ellipsoids that is not NaN.

    Parameters
    ----------
    ellipsoid
        Of any shape.
    scale
        What a half axis of length 1 is drawn as, m; if not given, one that makes the longest of all ``longest``.
    longest
        m.

    Returns
    -------
    Array
        Shape (k, 4, 4).

    Raises
    ------
    ValueError
        An infinite half axis, or a scale that is not positive.
    """
    if scale is not None and not (np.isfinite(scale) and scale > 0):
        raise ValueError(f"scale is {scale}; expected a positive number")
    centers, axes = ellipsoid.center.reshape(-1, 3), ellipsoid.axes.reshape(-1, 3, 3)
    lengths = ellipsoid.lengths.reshape(-1, 3)
    if np.isinf(lengths).any():
        raise ValueError("the ellipsoid is infinite in a direction that the tool cannot move in; expected a finite one")
    known = np.isfinite(lengths).all(axis=1)
    centers, axes, lengths = centers[known], axes[known], lengths[known]
    most = lengths.max(axis=1, keepdims=True)
    drawn = np.maximum(lengths, THINNEST * most)
    if scale is None:
        scale = longest / (float(most.max(initial=0.0)) or 1.0)
    T: Array = np.zeros((len(centers), 4, 4))
    T[:, 3, 3] = 1.0
    T[:, :3, 3] = centers
    T[:, :3, :3] = axes * (scale * drawn)[:, None, :]
    return np.asarray(T[most[:, 0] > 0])


def solids(obstacles: Scene, size: float) -> tuple[Array, Array, Array]:
    """Return obstacles as :class:`dhkit.viewer.protocol.Obstacles` has them.

    Parameters
    ----------
    obstacles
        Of :mod:`dhkit.planning`.
    size
        The arm's, m: floors reach a little farther.

    Returns
    -------
    tuple
        Transforms, half edges and radii, shapes (k, 4, 4), (k, 3) and (k,), m.

    Raises
    ------
    TypeError
        Something else than obstacles and floors.
    ValueError
        More than one floor.
    """
    from dhkit.planning.obstacles import Floor, check_obstacles

    scene = check_obstacles(obstacles)
    T, half_edges, radii = np.tile(np.eye(4), (len(scene), 1, 1)), np.zeros((len(scene), 3)), np.zeros(len(scene))
    for k, obstacle in enumerate(scene):
        if isinstance(obstacle, Floor):
            T[k, 2, 3] = obstacle.height
            half_edges[k, :2] = FLOOR * size
        else:
            T[k], half_edges[k], radii[k] = obstacle.T_world_obstacle, obstacle.half_sizes, obstacle.radius
    return T, half_edges, radii
