"""Overlays beside the arm, as the numbers that a page takes: colors, ellipsoids as balls, obstacles as boxes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dhkit.description import Array
from dhkit.packages import imported

if TYPE_CHECKING:
    from dhkit.kinematics.manipulability import Ellipsoid
    from dhkit.planning.obstacles import Scene

_GREY = (0.5, 0.55, 0.62)
AXIS_COLORS = ("#e5484d", "#30a46c", "#3b82f6")
"""Colors of the x, y and z axes of frames, readable on white and on black; the page has them in ``colors.js``."""
TINTS = ("#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377", "#ee7733", "#009988")
"""Tol's bright and vibrant schemes (SRON/EPS/TN/09-002, 2021): the eight branches of a wrist-partitioned arm."""
_HEAT_COLORMAP = "viridis"
"""matplotlib's colormap of even steps, which colour-blind people can tell apart too."""
_HEAT_END = 0.87
"""Share of the colormap that is used: its lightest colors are lost on white."""
_FLOOR_SHARE = 1.2
"""Half an edge of the square that stands for an infinite floor, as a share of the arm's size."""
_MIN_AXIS_SHARE = 0.01
"""Smallest half axis that is drawn, as a share of the longest: a flat ball has no normals, and no light on it."""


def color_bytes(colors: ArrayLike | None, count: int, name: str = "colors") -> NDArray[np.uint8]:
    """Return colors as bytes from 0 to 255, shape (count, 3).

    Parameters
    ----------
    colors
        Red, green and blue from 0 to 1, shape (count, 3), or (3,) for all; grey if not given.
    count
        Number of colors.
    name
        Name of the argument, for messages.

    Raises
    ------
    ValueError
        The colors have another shape, or values that are not from 0 to 1.
    """
    given = np.asarray(_GREY if colors is None else colors, dtype=float)
    if given.shape not in ((3,), (count, 3)):
        raise ValueError(f"{name} has shape {given.shape}; expected (3,) or ({count}, 3)")
    if not np.all((given >= 0) & (given <= 1)):
        raise ValueError(f"{name} has values that are not from 0 to 1")
    return np.broadcast_to(np.rint(255 * given).astype(np.uint8), (count, 3))


def heat_colors(values: ArrayLike) -> Array:
    """Return a color for each value, from dark (0) to bright (the largest value).

    Parameters
    ----------
    values
        Values of 0 or more, shape (...), such as the manipulability of a workspace's points; NaN counts as 0.

    Returns
    -------
    Array
        Red, green and blue from 0 to 1, shape (..., 3).

    Examples
    --------
    >>> heat_colors([0.0, 1.0, 2.0]).shape
    (3, 3)
    """
    matplotlib = imported("matplotlib", "a scale of colors")
    known = np.nan_to_num(np.asarray(values, dtype=float))
    share = _HEAT_END * known / (float(known.max(initial=0.0)) or 1.0)
    return np.asarray(matplotlib.colormaps[_HEAT_COLORMAP](share))[..., :3]


def ghost_tints(count: int) -> NDArray[np.uint8]:
    """Return colors of ghosts as bytes, shape (count, 3); they repeat after eight."""
    return rgb_bytes([TINTS[k % len(TINTS)] for k in range(count)])


def rgb_bytes(colors: Sequence[str]) -> NDArray[np.uint8]:
    """Return colors such as "#e5484d" as bytes from 0 to 255, shape (k, 3)."""
    return np.array([list(bytes.fromhex(color[1:])) for color in colors], dtype=np.uint8).reshape(
        -1, 3
    )


def ball_transforms(ellipsoid: Ellipsoid, scale: float | None, longest: float) -> Array:
    """Return the maps of the unit ball to each of a batch of ellipsoids; those that are NaN or points are left out.

    Parameters
    ----------
    ellipsoid
        Ellipsoids in a batch of any shape.
    scale
        Length that a half axis of 1 is drawn with, m; by default the longest one of all is drawn with ``longest``.
    longest
        Length of the longest half axis, m.

    Returns
    -------
    Array
        The maps, shape (k, 4, 4), m, world.

    Raises
    ------
    ValueError
        A half axis is infinite, or the scale is not positive.
    """
    if scale is not None and not (np.isfinite(scale) and scale > 0):
        raise ValueError(f"scale is {scale}; expected a positive number")
    centers = ellipsoid.center.reshape(-1, 3)
    axes = ellipsoid.axes.reshape(-1, 3, 3)
    lengths = ellipsoid.lengths.reshape(-1, 3)
    if np.isinf(lengths).any():
        raise ValueError(
            "the ellipsoid is infinite in a direction that the tool cannot move in; expected a finite one"
        )
    known = np.isfinite(lengths).all(axis=1)
    centers = centers[known]
    axes = axes[known]
    lengths = lengths[known]
    longest_axes = lengths.max(axis=1, keepdims=True)
    drawn = np.maximum(lengths, _MIN_AXIS_SHARE * longest_axes)
    if scale is None:
        scale = longest / (float(longest_axes.max(initial=0.0)) or 1.0)
    T: Array = np.zeros((len(centers), 4, 4))
    T[:, 3, 3] = 1.0
    T[:, :3, 3] = centers
    T[:, :3, :3] = axes * (scale * drawn)[:, None, :]
    return np.asarray(T[longest_axes[:, 0] > 0])


def rounded_boxes(obstacles: Scene, size: float) -> tuple[Array, Array, Array]:
    """Return obstacles as :func:`dhkit.viewer.protocol.encode_obstacles` takes them: boxes with a radius around them.

    Parameters
    ----------
    obstacles
        Obstacles and floors of :mod:`dhkit.planning`.
    size
        The arm's size, m: floors are drawn a little larger.

    Returns
    -------
    tuple
        Poses in the world, half edges and radii, shapes (k, 4, 4), (k, 3) and (k,), m.

    Raises
    ------
    TypeError
        The scene has something else than obstacles and floors.
    ValueError
        The scene has more than one floor.
    """
    from dhkit.planning.obstacles import Floor, check_obstacles

    scene = check_obstacles(obstacles)
    T = np.tile(np.eye(4), (len(scene), 1, 1))
    half_edges = np.zeros((len(scene), 3))
    radii = np.zeros(len(scene))
    for k, obstacle in enumerate(scene):
        if isinstance(obstacle, Floor):
            T[k, 2, 3] = obstacle.height
            half_edges[k, :2] = _FLOOR_SHARE * size
        else:
            T[k] = obstacle.T_world_obstacle
            half_edges[k] = obstacle.half_sizes
            radii[k] = obstacle.radius
    return T, half_edges, radii
