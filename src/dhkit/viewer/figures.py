"""Figures by matplotlib, without pyplot: they need no display and belong to whoever asked for them."""

from __future__ import annotations

from functools import singledispatch
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array, Convention, Description, takes_robot
from dhkit.description.frames import joint_array, world_to_frames, world_to_tool
from dhkit.viewer.motion import check_motion
from dhkit.viewer.notebook_figure import new_figure
from dhkit.viewer.scene import first_configuration, frame_labels, scene_size

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

AXIS_COLORS = ("#e5484d", "#30a46c", "#3b82f6")
"""x, y and z, as in the viewer."""
CURVE_COLORS = ("#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377", "#bbbbbb")
"""Tol's bright scheme (SRON/EPS/TN/09-002, 2021), told apart by colour-blind people too."""
LINK_COLOR, GRID_COLOR, PATH_COLOR = "#3a4252", "#d5d9e0", "#d9480f"
TRIAD = 0.11
"""Length of a triad as a share of the arm's size."""
FLAT = 1e-9
"""An arm whose frames leave a plane by less than this share of its size is drawn in it."""
SLIMMEST = 0.5
"""Shortest edge of the box around an arm, as a share of the longest: slimmer boxes have no room for their ticks."""
ZOOM = 0.86
"""Leaves the labels of a box's axes inside the figure."""


@singledispatch
def plot(value: object, *, q: ArrayLike | None = None) -> Figure:
    """Return a figure of a value; a notebook shows it.

    An arm, or its description, is drawn at joint values ``q``, shape (n,) or a configuration's name; in its ``ready``
    configuration, or at zero, unless given. Other values take no ``q``.

    Raises
    ------
    TypeError
        A type that has no figure; names those that have one.

    Examples
    --------
    >>> from dhkit.description.library import library_robot
    >>> figure = plot(library_robot("puma560"))
    >>> figure.savefig("puma560.png")  # doctest: +SKIP
    """
    description = getattr(value, "description", None)  # an Arm, which this folder does not know
    if isinstance(description, Description):
        return plot(description, q=q)
    known = sorted(kind.__name__ for kind in plot.registry if kind is not object)
    raise TypeError(f"no figure of {type(value).__name__}; expected one of {', '.join(known)}")


@plot.register(Description)
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

    Raises
    ------
    ValueError
        Another shape.
    """
    q = joint_array(description, q)
    if q.ndim != 1:
        raise ValueError(f"q has shape {q.shape}; expected ({description.n},)")
    figure = new_figure(figsize=(6.4, 6.0), layout="constrained")
    axes = space(figure, 111)
    frames = world_to_frames(description, q)
    tool = world_to_tool(description, q)
    line = skeleton(description, frames, tool)
    _draw_links(axes, description, frames, line)
    _draw_triads(axes, description, np.concatenate([frames, tool[None]]))
    frame_space(axes, line, margin=1.4 * TRIAD * scene_size(description))
    axes.set_title(description.name, fontsize=13, fontweight="bold")
    return figure


@takes_robot
def plot_motion(description: Description, times: ArrayLike, q: ArrayLike) -> Figure:
    """Return joint curves over time, revolute ones in degrees and prismatic ones in m, beside the tool's path.

    Parameters
    ----------
    description
        The arm.
    times
        Shape (N,), s, increasing.
    q
        Joint values, shape (N, n), rad and m.

    Raises
    ------
    ValueError
        Other shapes, fewer than two samples, values that are not finite, or times that do not increase.
    """
    times, q = check_motion(description, times, q)
    prismatic = description.numbers.prismatic
    kinds = [(~prismatic, 180 / np.pi, "angle [deg]"), (prismatic, 1.0, "offset [m]")]
    kinds = [kind for kind in kinds if kind[0].any()]
    figure = new_figure(figsize=(11, 4.8), layout="constrained")
    figure.suptitle(description.name, fontsize=13, fontweight="bold")
    grid = figure.add_gridspec(len(kinds), 2, width_ratios=(1.25, 1))
    for row, (chosen, unit, label) in enumerate(kinds):
        axes = figure.add_subplot(grid[row, 0])
        _draw_curves(axes, description, times, q, chosen, unit)
        axes.set_ylabel(label)
    axes.set_xlabel("time [s]")
    draw_path(space(figure, grid[:, 1]), description, q)
    return figure


def _draw_curves(axes: Axes, description: Description, times: Array, q: Array, chosen: Any, unit: float) -> None:
    for i in np.flatnonzero(chosen):
        color, style = CURVE_COLORS[i % len(CURVE_COLORS)], ("-", "--", ":")[i // len(CURVE_COLORS) % 3]
        axes.plot(times, unit * q[:, i], style, color=color, lw=1.8, label=description.joints[i].name)
    axes.margins(x=0.01)
    axes.grid(color=GRID_COLOR, lw=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False, fontsize=9)


def draw_path(axes: Any, description: Description, q: Array) -> None:
    """Draw the tool's path over q, shape (N, n), and the arm where it begins and ends."""
    path = world_to_tool(description, q)[:, :3, 3]
    lines = []
    for state, color, label in ((q[0], "#a9b1bf", "start"), (q[-1], LINK_COLOR, "end")):
        frames, tool = world_to_frames(description, state), world_to_tool(description, state)
        lines.append(skeleton(description, frames, tool))
        axes.plot(*lines[-1].T, color=color, lw=2.5, solid_capstyle="round", solid_joinstyle="round", label=label)
    axes.plot(*path.T, color=PATH_COLOR, lw=1.8, label="tool")
    frame_space(axes, np.concatenate([*lines, path]), margin=0.04 * scene_size(description))
    axes.legend(loc="upper left", frameon=False, fontsize=9)


def _draw_links(axes: Any, description: Description, frames: Array, line: Array) -> None:
    axes.plot(*line.T, color=LINK_COLOR, lw=5, solid_capstyle="round", solid_joinstyle="round", alpha=0.85, zorder=2)
    # Joint i moves about z of the frame before it in the standard table, about its own in the modified one.
    shift = 0 if description.convention is Convention.STANDARD else 1
    origins = frames[shift : shift + description.n, :3, 3]
    for chosen, marker in ((~description.numbers.prismatic, "o"), (description.numbers.prismatic, "s")):
        style = {"marker": marker, "ms": 8, "mfc": "white", "mec": LINK_COLOR, "mew": 1.8, "ls": "none"}
        axes.plot(*origins[chosen].T, zorder=3, **style)


def _draw_triads(axes: Any, description: Description, T: Array) -> None:
    """Draw frames 0 ... n and the tool, T of shape (n + 2, 4, 4)."""
    from matplotlib.patheffects import withStroke

    length = TRIAD * scene_size(description)
    for k, color in enumerate(AXIS_COLORS):
        start = T[:, :3, 3]
        ends = np.stack([start, start + length * T[:, :3, k]], axis=1)
        for end in ends:
            axes.plot(*end.T, color=color, lw=1.5, zorder=4)
        axes.plot([], [], [], color=color, lw=1.5, label="xyz"[k])
    halo = [withStroke(linewidth=3, foreground="white")]
    for label in frame_labels(description):
        place = T[label.frame, :3, 3]
        axes.text(*place, f"   {label.text}", fontsize=9, va="bottom", path_effects=halo, zorder=6)
    axes.legend(loc="upper left", frameon=False, fontsize=9, ncols=3, handlelength=1, columnspacing=1)


def skeleton(description: Description, frames: Array, tool: Array) -> Array:
    """Return the way from the base to the tool as a line, shape (k, 3): by d along z, by a along x of every row."""
    points = [frames[0, :3, 3]]
    for i in range(1, description.n + 1):
        before, after = frames[i - 1], frames[i]
        along = before if description.convention is Convention.STANDARD else after
        step = after[:3, 3] - before[:3, 3]
        if description.convention is Convention.STANDARD:
            corner = before[:3, 3] + along[:3, 2] * (step @ along[:3, 2])
        else:
            corner = after[:3, 3] - along[:3, 2] * (step @ along[:3, 2])
        points += [corner, after[:3, 3]]
    return np.array([*points, tool[:3, 3]])


def space(figure: Figure, place: Any) -> Any:
    """Return new axes of a figure for things in space."""
    axes: Any = figure.add_subplot(place, projection="3d", proj_type="persp", focal_length=0.6)
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color((0.97, 0.975, 0.98, 1.0))
        axis._axinfo["grid"].update(color=GRID_COLOR, linewidth=0.6)
        axis.set_major_locator(_few_ticks())
    axes.tick_params(labelsize=8)
    return axes


def _few_ticks() -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(4, steps=[1, 2, 2.5, 5, 10])


def frame_space(axes: Any, points: Array, margin: float) -> None:
    """Set equal axes around points, shape (k, 3); look at what lies in a plane z = constant from above."""
    low, high = points.min(axis=0), points.max(axis=0)
    flat = high[2] - low[2] <= FLAT * max(float((high - low).max()), 1e-12)
    half = np.maximum((high - low) / 2 + margin, SLIMMEST * float((high - low).max() / 2 + margin))
    centre = (low + high) / 2
    for set_limits, c, h in zip((axes.set_xlim, axes.set_ylim, axes.set_zlim), centre, half, strict=True):
        set_limits(c - h, c + h)
    axes.set_box_aspect(half, zoom=ZOOM)
    axes.view_init(elev=24, azim=-58)
    if flat:
        axes.view_init(elev=90, azim=-90)
        axes.set_proj_type("ortho")
        axes.set_zticks([])
        axes.set_zlabel("")
