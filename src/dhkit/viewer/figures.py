"""Figures by matplotlib, without pyplot: they need no display and belong to whoever asked for them."""

from __future__ import annotations

from functools import singledispatch
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Convention, Description, takes_robot
from dhkit.description.frames import joint_vector, world_to_frames, world_to_tool
from dhkit.viewer.diagrams import CURVE_COLORS, GRID_COLOR, joint_color, joint_kinds, style_axes
from dhkit.viewer.motion import check_motion
from dhkit.viewer.notebook import new_figure
from dhkit.viewer.overlays import AXIS_COLORS
from dhkit.viewer.papers import fit_to_width
from dhkit.viewer.scene import PICTURE_TRIAD_SHARE, first_configuration, frame_labels, scene_size

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINK_COLOR = "#3a4252"
PATH_COLOR = "#d9480f"
_FLATNESS = 1e-9
"""Largest extent across a plane, as a share of the arm's size, of an arm that is drawn in that plane."""
_MIN_EDGE_SHARE = 0.5
"""Shortest edge of the box around an arm, as a share of the longest: slimmer boxes have no room for tick labels."""
_ZOOM = 0.86
"""Zoom that leaves the labels of a box's axes inside the figure."""


def plot(value: object, *, q: ArrayLike | None = None, width: float | None = None) -> Figure:
    """Return a figure of a value; a notebook shows it.

    Parameters
    ----------
    value
        An arm or its description, a trajectory, a simulation, a workspace or another value that has a figure.
    q
        Joint values at which an arm is drawn, shape (n,), rad and m, or a configuration by name; by default its
        ``ready`` configuration, or zero. Other values take no ``q``.
    width
        Width of the figure in a paper, mm: 88 for a column of many journals, 180 for a page. Text has the size of
        print, and in a column diagrams are below each other. Unless given, the figure has the size of a screen.

    Returns
    -------
    Figure
        A figure of matplotlib; a notebook shows it, ``savefig`` writes it.

    Raises
    ------
    TypeError
        The type has no figure; the message names the types that have one.
    ValueError
        ``q`` does not fit; ``width`` is below 60 or above 500 mm.

    Examples
    --------
    >>> from dhkit.description.library import library_robot
    >>> figure = plot(library_robot("puma560"), width=88)
    >>> figure.savefig("puma560.pdf")  # doctest: +SKIP
    """
    figure = figure_of(value) if q is None else figure_of(value, q=q)
    if width is not None:
        fit_to_width(figure, width)
    return figure


@singledispatch
def figure_of(value: object, *, q: ArrayLike | None = None) -> Figure:
    """Return a value's figure in the size of a screen; see :func:`plot`."""
    description = getattr(value, "description", None)  # an Arm, which this package must not import
    if isinstance(description, Description):
        return figure_of(description, q=q)
    known = sorted(kind.__name__ for kind in figure_of.registry if kind is not object)
    raise TypeError(f"no figure of {type(value).__name__}; expected one of {', '.join(known)}")


@figure_of.register(Description)
def _(value: Description, *, q: ArrayLike | None = None) -> Figure:
    return plot_arm(value, first_configuration(value) if q is None else q)


@takes_robot
def plot_arm(description: Description, q: ArrayLike) -> Figure:
    """Return an arm's skeleton with its DH frames.

    Parameters
    ----------
    description
        The arm.
    q
        Joint values, shape (n,), rad and m.

    Returns
    -------
    Figure
        A figure of matplotlib; a notebook shows it, ``savefig`` writes it.

    Raises
    ------
    ValueError
        Another shape, or values that are not finite.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> figure = plot_arm(library_robot("planar2r"), [0.3, 0.6])
    """
    q = joint_vector(description, q)
    figure = new_figure(figsize=(6.4, 6.0), layout="constrained")
    axes = space_axes(figure, 111)
    frames = world_to_frames(description, q)
    tool = world_to_tool(description, q)
    line = skeleton(description, frames, tool)
    _draw_links(axes, description, frames, line)
    _draw_triads(axes, description, np.concatenate([frames, tool[None]]))
    set_space_limits(axes, line, margin=1.4 * PICTURE_TRIAD_SHARE * scene_size(description))
    axes.set_title(description.name, fontsize=13, fontweight="bold")
    return figure


@takes_robot
def plot_motion(description: Description, times: ArrayLike, q: ArrayLike) -> Figure:
    """Return a figure of joint values over time, in degrees and m, beside the tool's path.

    Parameters
    ----------
    description
        The arm.
    times
        Times, shape (N,), s, increasing.
    q
        Joint values, shape (N, n), rad and m.

    Returns
    -------
    Figure
        A figure of matplotlib; a notebook shows it, ``savefig`` writes it.

    Raises
    ------
    ValueError
        Times or joint values have other shapes, are fewer than two or not finite, or times do not increase.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> figure = plot_motion(library_robot("planar2r"), [0.0, 0.5, 1.0], [[0, 0], [0.1, 0.2], [0.2, 0.5]])
    """
    times, q = check_motion(description, times, q)
    kinds = joint_kinds(description)
    figure = new_figure(figsize=(11, 4.8), layout="constrained")
    figure.suptitle(description.name, fontsize=13, fontweight="bold")
    grid = figure.add_gridspec(len(kinds), 2, width_ratios=(1.25, 1))
    for row, (joints, unit, label, _) in enumerate(kinds):
        axes = figure.add_subplot(grid[row, 0])
        for i in joints:
            style = ("-", "--", ":")[i // len(CURVE_COLORS) % 3]
            axes.plot(
                times,
                unit * q[:, i],
                style,
                color=joint_color(i),
                lw=1.8,
                label=description.joints[i].name,
            )
        axes.margins(x=0.01)
        axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False, fontsize=9)
        style_axes(axes, label)
    axes.set_xlabel("time [s]")
    draw_path(space_axes(figure, grid[:, 1]), description, q)
    return figure


def draw_path(axes: Any, description: Description, q: Array) -> None:
    """Draw the tool's path at joint values q, shape (N, n), rad and m, and the arm at the first and the last."""
    path = world_to_tool(description, q)[:, :3, 3]
    lines = []
    for state, color, label in ((q[0], "#a9b1bf", "start"), (q[-1], LINK_COLOR, "end")):
        frames = world_to_frames(description, state)
        tool = world_to_tool(description, state)
        lines.append(skeleton(description, frames, tool))
        axes.plot(
            *lines[-1].T,
            color=color,
            lw=2.5,
            solid_capstyle="round",
            solid_joinstyle="round",
            label=label,
        )
    axes.plot(*path.T, color=PATH_COLOR, lw=1.8, label="tool")
    set_space_limits(axes, np.concatenate([*lines, path]), margin=0.04 * scene_size(description))
    axes.legend(loc="upper left", frameon=False, fontsize=9)


def _draw_links(axes: Any, description: Description, frames: Array, line: Array) -> None:
    axes.plot(
        *line.T,
        color=LINK_COLOR,
        lw=5,
        solid_capstyle="round",
        solid_joinstyle="round",
        alpha=0.85,
        zorder=2,
    )
    # Joint i moves about z of the frame before it in the standard table, about its own in the modified one.
    shift = 0 if description.convention is Convention.STANDARD else 1
    origins = frames[shift : shift + description.n, :3, 3]
    for chosen, marker in (
        (~description.numbers.prismatic, "o"),
        (description.numbers.prismatic, "s"),
    ):
        style = {
            "marker": marker,
            "ms": 8,
            "mfc": "white",
            "mec": LINK_COLOR,
            "mew": 1.8,
            "ls": "none",
        }
        axes.plot(*origins[chosen].T, zorder=3, **style)


def _draw_triads(axes: Any, description: Description, T: Array) -> None:
    """Draw frames 0 ... n and the tool, T of shape (n + 2, 4, 4)."""
    from matplotlib.patheffects import withStroke

    length = PICTURE_TRIAD_SHARE * scene_size(description)
    for k, color in enumerate(AXIS_COLORS):
        start = T[:, :3, 3]
        ends = np.stack([start, start + length * T[:, :3, k]], axis=1)
        for end in ends:
            axes.plot(*end.T, color=color, lw=1.5, zorder=4)
        axes.plot([], [], [], color=color, lw=1.5, label="xyz"[k])
    halo = [withStroke(linewidth=3, foreground="white")]
    for label in frame_labels(description):
        axes.text(
            *T[label.frame, :3, 3],
            f"   {label.text}",
            fontsize=9,
            va="bottom",
            path_effects=halo,
            zorder=6,
        )
    axes.legend(
        loc="upper left", frameon=False, fontsize=9, ncols=3, handlelength=1, columnspacing=1
    )


def skeleton(description: Description, frames: Array, tool: Array) -> Array:
    """Return the line from the base to the tool, shape (k, 3), m, world, along d and a of each row.

    Parameters
    ----------
    description
        The arm.
    frames
        Poses of DH frames 0 ... n, shape (n + 1, 4, 4), m, world.
    tool
        Pose of the tool, shape (4, 4), m, world.
    """
    points = [frames[0, :3, 3]]
    for previous, frame in pairwise(frames):
        step = frame[:3, 3] - previous[:3, 3]
        if description.convention is Convention.STANDARD:
            corner = previous[:3, 3] + previous[:3, 2] * (step @ previous[:3, 2])
        else:
            corner = frame[:3, 3] - frame[:3, 2] * (step @ frame[:3, 2])
        points += [corner, frame[:3, 3]]
    return np.array([*points, tool[:3, 3]])


def space_axes(figure: Figure, place: Any) -> Any:
    """Return new axes in space, in m, at a place of a figure's grid."""
    from matplotlib.ticker import MaxNLocator

    axes: Any = figure.add_subplot(place, projection="3d", proj_type="persp", focal_length=0.6)
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color((0.97, 0.975, 0.98, 1.0))
        axis._axinfo["grid"].update(color=GRID_COLOR, linewidth=0.6)
        axis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))
    axes.tick_params(labelsize=8)
    return axes


def set_space_limits(axes: Any, points: Array, margin: float) -> None:
    """Set limits around points, shape (k, 3), with a margin, m, and equal scales; a flat scene is seen from above."""
    low = points.min(axis=0)
    high = points.max(axis=0)
    is_flat = high[2] - low[2] <= _FLATNESS * max(float((high - low).max()), 1e-12)
    half = np.maximum(
        (high - low) / 2 + margin, _MIN_EDGE_SHARE * float((high - low).max() / 2 + margin)
    )
    centre = (low + high) / 2
    for set_limits, c, h in zip(
        (axes.set_xlim, axes.set_ylim, axes.set_zlim), centre, half, strict=True
    ):
        set_limits(c - h, c + h)
    axes.set_box_aspect(half, zoom=_ZOOM)
    axes.view_init(elev=24, azim=-58)
    if is_flat:
        axes.view_init(elev=90, azim=-90)
        axes.set_proj_type("ortho")
        axes.set_zticks([])
        axes.set_zlabel("")
