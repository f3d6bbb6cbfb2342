"""Figures of where a tool can be and how well it moves: workspaces in two views, manipulability ellipsoids."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import (
    Array,
    Description,
    joint_vector,
    takes_robot,
    world_to_frames,
    world_to_tool,
)
from dhkit.kinematics.boundaries import Boundary, boundaries
from dhkit.kinematics.manipulability import Ellipsoid, velocity_ellipsoid
from dhkit.kinematics.workspace import PIXEL_MARGIN, FlatMap, Projection, Workspace
from dhkit.viewer.diagrams import style_axes
from dhkit.viewer.figures import LINK_COLOR, figure_of, set_space_limits, skeleton, space_axes
from dhkit.viewer.notebook import new_figure
from dhkit.viewer.scene import first_configuration, scene_size

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLORMAP = "viridis"
_BEST_COLOR = "#e5484d"
_ELLIPSOID_COLOR = "#d9480f"
_BOUNDARY_COLOR = "#d9480f"
_BOUNDARY_STYLES = {"outer": "--", "inner": ":", "shoulder": "-."}
"""Line styles of boundaries, by name."""
_TICK_MARGIN = 0.8
"""Width of a view's tick labels and axis label, inches."""
_LEGEND_ROW_HEIGHT = 0.25
"""Height of a row of the legend, two names, inches."""
_MAX_SIZE = (9.5, 5.0)
"""Largest width and height of a figure's views together, inches."""
_LINK_PIECES = 24
"""Pieces of a link: straight in space, it is curved in a section about an axis."""
_SPACE_MARGIN = 0.04
"""Room around the drawing, as a share of its size."""
_ELLIPSOID_SHARE = 0.3
"""Length that the longest half axis of an ellipsoid is drawn with, as a share of the arm's size."""
_MESH_LINES = 33
"""Lines of an ellipsoid's mesh in each direction."""


@dataclass(frozen=True, eq=False)
class _Panel:
    """A flat map of the workspace as it is drawn: smoothed, with a title and labels."""

    title: str
    labels: tuple[str, str]
    projection: Projection
    corner: Array
    """Corner of pixel (0, 0), shape (2,), m."""
    edge: float
    """Edge of a pixel, m."""
    best: Array
    """The best manipulability in each pixel, NaN where no sample is, shape (nx, ny)."""

    def border(self, boundary: Boundary) -> Array:
        """Return the line of a boundary in the view, shape (k, 2), m, NaN between its pieces."""
        # Along axis 1 a surface about that axis is seen as its circle; in a section it is a curve.
        return self.projection(boundary.section if self.projection.is_section else boundary.circle)

    def shape(self, points: Array) -> tuple[float, float]:
        """Return the width and height of the view with points (k, 2) in it, m."""
        ends = np.stack([self.corner, self.corner + self.edge * np.array(self.best.shape)])
        width, height = np.ptp(np.concatenate([points[np.isfinite(points[:, 0])], ends]), axis=0)
        return float(width), float(height)

    def draw(self, axes: Axes, most: float) -> Any:
        """Draw the pixels and the border of the reached set; return the image."""
        x, y = (self.corner[k] + self.edge * np.arange(self.best.shape[k] + 1) for k in range(2))
        pixels = np.ma.masked_invalid(self.best).T
        image = axes.pcolormesh(
            x, y, pixels, cmap=_COLORMAP, vmin=0, vmax=most or 1.0, rasterized=True
        )
        centres = x[:-1] + self.edge / 2, y[:-1] + self.edge / 2
        reached = np.isfinite(self.best).astype(float).T
        axes.contour(*centres, reached, levels=[0.5], colors=LINK_COLOR, linewidths=1.2)
        axes.set(xlabel=self.labels[0], aspect="equal")
        style_axes(axes, self.labels[1])
        axes.set_title(self.title, fontsize=10)
        axes.set_axisbelow(True)
        return image


@figure_of.register(Workspace)
def plot_workspace(workspace: Workspace) -> Figure:
    """Return a figure of an arm's workspace, colored by the best manipulability at each place, with the arm in it.

    An arm in space is seen in a section, as distance from the first joint's axis and height along it, and along that
    axis; an arm with a sliding first joint is seen along y and z. A tool that stays in a plane is seen in it. Thin
    lines are the boundaries of the workspace without limits of revolute joints, where they have a closed form
    (:func:`dhkit.kinematics.boundaries.boundaries`).

    Parameters
    ----------
    workspace
        Samples of :func:`dhkit.kinematics.workspace`.

    Returns
    -------
    Figure
        A figure of matplotlib; a notebook shows it, ``savefig`` writes it.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.kinematics import workspace
    >>> figure = plot_workspace(workspace(library_robot("planar2r"), samples=2000))
    """
    description = workspace.description
    panels = _panels(workspace)
    line = _arm_in_pieces(description, first_configuration(description))
    best = world_to_tool(description, workspace.best)[:3, 3]
    borders = boundaries(description)
    drawn = [np.vstack([panel.projection(line), *map(panel.border, borders)]) for panel in panels]
    widths, heights = np.transpose(
        [panel.shape(points) for panel, points in zip(panels, drawn, strict=True)]
    )
    scale = min(_MAX_SIZE[0] / widths.sum(), _MAX_SIZE[1] / heights.max())
    columns = scale * widths + _TICK_MARGIN
    rows = (len(borders) + 1) // 2
    size = (
        max(columns.sum() + 1.0, 6.4),
        max(scale * heights.max(), 1.5) + 1.6 + _LEGEND_ROW_HEIGHT * rows,
    )
    figure = new_figure(figsize=size, layout="constrained")
    axes = figure.subplots(1, len(panels), width_ratios=columns, squeeze=False)[0]
    for ax, panel in zip(axes, panels, strict=True):
        image = panel.draw(ax, workspace.largest_manipulability)
        _draw_arm(ax, panel.projection(line), panel.projection(best))
        for boundary in borders:
            border = panel.border(boundary)
            dashes = _BOUNDARY_STYLES[boundary.name]
            ax.plot(*border.T, dashes, color=_BOUNDARY_COLOR, lw=1.3, zorder=1.9)  # below the arm
    bar = figure.colorbar(image, ax=axes, shrink=0.9, pad=0.02, aspect=30)
    bar.set_label("best translational manipulability (SI)", fontsize=9)
    bar.outline.set_visible(False)
    name = "ready" if "ready" in description.configurations else "zero"
    handles = axes[0].lines[1:]
    labels = [f"the arm at {name}", "best manipulability", *map(_boundary_label, borders)]
    figure.legend(handles, labels, loc="outside lower center", frameon=False, fontsize=9, ncols=2)
    figure.suptitle(_title(workspace), fontsize=12, fontweight="bold")
    return figure


@takes_robot
def plot_ellipsoid(description: Description, q: ArrayLike) -> Figure:
    """Return a figure of an arm with the velocity ellipsoid of its tool's origin; the title says its scale.

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
        The joint values have another shape or are not finite.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> figure = plot_ellipsoid(library_robot("planar2r"), [0.3, 0.6])
    """
    q = joint_vector(description, q)
    ellipsoid = velocity_ellipsoid(description, q)
    longest = float(ellipsoid.lengths[0])
    figure = new_figure(figsize=(6.4, 6.0), layout="constrained")
    axes = space_axes(figure, 111)
    line = skeleton(description, world_to_frames(description, q), world_to_tool(description, q))
    axes.plot(
        *line.T, color=LINK_COLOR, lw=5, solid_capstyle="round", solid_joinstyle="round", alpha=0.85
    )
    surface = _surface(
        ellipsoid, _ELLIPSOID_SHARE * scene_size(description) / longest if longest else 1.0
    )
    _draw_surface(axes, surface)
    set_space_limits(
        axes,
        np.concatenate([line, surface.reshape(-1, 3)]),
        margin=_SPACE_MARGIN * scene_size(description),
    )
    axes.set_title(
        f"{description.name}: velocity ellipsoid, longest half axis {longest:.3g} m/s", fontsize=12
    )
    return figure


@figure_of.register(Ellipsoid)
def _(value: Ellipsoid) -> Figure:
    batch = zip(
        value.center.reshape(-1, 3),
        value.axes.reshape(-1, 3, 3),
        value.lengths.reshape(-1, 3),
        strict=True,
    )
    surfaces = [_surface(Ellipsoid(*parts), 1.0) for parts in batch]
    surfaces = [surface for surface in surfaces if np.isfinite(surface).all()]
    if not surfaces:
        raise ValueError("no ellipsoid is finite: expected one to draw")
    figure = new_figure(figsize=(6.4, 6.0), layout="constrained")
    axes_3d = space_axes(figure, 111)
    for surface in surfaces:
        _draw_surface(axes_3d, surface)
    points = np.concatenate(surfaces).reshape(-1, 3)
    set_space_limits(axes_3d, points, margin=_SPACE_MARGIN * float(np.ptp(points, axis=0).max()))
    return figure


def _panels(workspace: Workspace) -> list[_Panel]:
    """Return the flat maps of a workspace, smoothed over neighbouring pixels, with their titles and labels."""
    if len(workspace.maps) == 1:
        names = _in_plane(workspace.maps[0].projection.axes)
    elif workspace.maps[0].projection.is_section:
        names = [
            (
                "section, all turns of the first joint in one",
                ("distance from axis 1 [m]", "height [m]"),
            ),
            ("along axis 1", ("x₀ [m]", "y₀ [m]")),
        ]
    else:
        names = [
            ("from the side", ("x [m]", "z [m]")),
            ("from above", ("x [m]", "y [m]")),
        ]
    return [
        _Panel(title, labels, flat.projection, flat.corner, flat.edge, _smoothed(flat))
        for (title, labels), flat in zip(names, workspace.maps, strict=True)
    ]


def _in_plane(axes: Array) -> list[tuple[str, tuple[str, str]]]:
    """Return the title and the labels of the view of a plane; its axes are named where they are the world's."""
    x, y = (
        f"{'xyz'[int(np.argmax(axis))]} [m]" if axis.max() == 1 else "along the plane [m]"
        for axis in axes
    )
    return [("", (x, y))]


def _smoothed(flat: FlatMap) -> Array:
    """Return the best manipulability in each pixel and its neighbours, NaN where no sample is, shape (nx, ny)."""
    from scipy.ndimage import binary_closing, maximum_filter

    # A single pixel has too few samples for the best of them to be smooth, and some have none.
    best = np.nan_to_num(flat.manipulability, nan=-np.inf)
    reached = binary_closing(best >= 0, np.ones((3, 3)), iterations=PIXEL_MARGIN - 1)
    return np.where(reached, maximum_filter(best, 2 * PIXEL_MARGIN - 1), np.nan)


def _draw_arm(axes: Axes, line: Array, best: Array) -> None:
    """Draw an arm's line, shape (k, 2), with a white edge, and the best place, shape (2,)."""
    for color, width in (("white", 6.5), (LINK_COLOR, 3.5)):
        axes.plot(*line.T, color=color, lw=width, solid_capstyle="round", solid_joinstyle="round")
    axes.plot(*best, "*", color=_BEST_COLOR, mec="white", ms=15, zorder=5)


def _boundary_label(boundary: Boundary) -> str:
    if boundary.name == "shoulder":
        return f"least distance of the {boundary.point} from axis 1"
    return f"{boundary.name} boundary of the {boundary.point}, turning freely"


def _arm_in_pieces(description: Description, q: Array) -> Array:
    """Return the line from the base to the tool at joint values (n,) as short pieces, shape (k, 3), m, world."""
    line = skeleton(description, world_to_frames(description, q), world_to_tool(description, q))
    share = np.linspace(0, 1, _LINK_PIECES, endpoint=False)[:, None]
    pieces = line[:-1, None] + share * (line[1:, None] - line[:-1, None])
    return np.concatenate([pieces.reshape(-1, 3), line[-1:]])


def _title(workspace: Workspace) -> str:
    estimate = workspace.estimate
    if estimate is None or workspace.grid is None:
        return workspace.description.name
    return f"{workspace.description.name}: reaches about {estimate}, by cells of {workspace.grid.edge:.2g} m"


def _surface(ellipsoid: Ellipsoid, scale: float) -> Array:
    """Return an ellipsoid's mesh, shape (_MESH_LINES, _MESH_LINES, 3), m."""
    turn, height = np.meshgrid(
        np.linspace(0, math.tau, _MESH_LINES), np.linspace(0, np.pi, _MESH_LINES)
    )
    sphere = np.stack(
        [np.cos(turn) * np.sin(height), np.sin(turn) * np.sin(height), np.cos(height)], axis=-1
    )
    return np.asarray(ellipsoid.center + scale * (sphere * ellipsoid.lengths) @ ellipsoid.axes.T)


def _draw_surface(axes: Any, surface: Array) -> None:
    x, y, z = np.moveaxis(surface, -1, 0)
    axes.plot_surface(
        x, y, z, color=_ELLIPSOID_COLOR, alpha=0.25, linewidth=0, rstride=1, cstride=1, shade=False
    )
    axes.plot_wireframe(x, y, z, color=_ELLIPSOID_COLOR, linewidth=0.5, rstride=4, cstride=4)
