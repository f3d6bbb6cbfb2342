"""Diagrams over time of a quantity of several joints: a colour for each joint, dashed lines for limits near curves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Description
from dhkit.viewer.overlays import TINTS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CURVE_COLORS = (*TINTS[:6], "#bbbbbb")
"""Tol's bright scheme (SRON/EPS/TN/09-002, 2021), told apart by colour-blind people too."""
GRID_COLOR = "#d5d9e0"
LIMIT_STYLE: dict[str, Any] = {"ls": (0, (5, 3)), "lw": 1.0, "alpha": 0.75}
SHARED_COLOR = "#5b6472"
"""Colour of a limit that several joints have, and of remarks."""
_MARGIN = 0.12
"""Room above and below the curves, as a share of their range."""
_MAX_LIMIT_DISTANCE = 0.35
"""Largest distance of a limit that is drawn from its joint's curve, as a share of the range of all curves: a limit
farther away would flatten them."""
LINE_STYLES = ("-", "-.", ":")
"""Line styles of joints 1 to 7, 8 to 14 and 15 to 21, which have the same colours."""


@dataclass(frozen=True, eq=False)
class Diagram:
    """The curves of one diagram over time.

    Attributes
    ----------
    label
        Label of the vertical axis, with the unit.
    joints
        The k joints, from 0.
    values
        Their values, shape (N, k).
    lower, upper
        Their limits, shape (k,); infinite where there is none.
    """

    label: str
    joints: NDArray[np.intp]
    values: Array
    lower: Array
    upper: Array


def joint_kinds(description: Description) -> list[tuple[NDArray[np.intp], float, str, str]]:
    """Return the revolute and the prismatic joints of an arm, each kind only if there are such joints.

    Returns
    -------
    list
        For each kind the joints, from 0; the factor from rad to degrees, or 1 from m to m; and the labels of joint
        values and of rates.
    """
    prismatic = description.numbers.prismatic
    kinds = [
        (np.flatnonzero(~prismatic), 180 / np.pi, "angle [deg]", "rate [deg/s]"),
        (np.flatnonzero(prismatic), 1.0, "offset [m]", "rate [m/s]"),
    ]
    return [kind for kind in kinds if len(kind[0])]


def percent_diagram(label: str, joints: NDArray[np.intp], shares: Array) -> Diagram:
    """Return a diagram of shares of the limits of k joints, shape (N, k), in percent."""
    hundred = np.full(len(joints), 100.0)
    return Diagram(label, joints, 100.0 * shares, -hundred, hundred)


def torque_diagram(description: Description, tau: Array) -> Diagram:
    """Return a diagram of torques, shape (N, n), N m and N; of shares of their limits if all joints have one."""
    effort = description.numbers.effort
    joints = np.arange(description.n)
    if np.isfinite(effort).all():
        return percent_diagram("torque / limit [%]", joints, tau / effort)
    unit = "N m, N" if description.numbers.prismatic.any() else "N m"
    return Diagram(f"torque [{unit}]", joints, tau, -effort, effort)


def draw_diagram(axes: Axes, diagram: Diagram, times: Array) -> None:
    """Draw a diagram's curves over times, shape (N,), s, and the limits that are near them."""
    low = float(diagram.values.min())
    high = float(diagram.values.max())
    span = max(high - low, 1e-9 * max(abs(low), abs(high)), 1e-12)
    draw_curves(axes, diagram, times)
    distance = _MAX_LIMIT_DISTANCE * span
    lowest = diagram.values.min(axis=0) - distance
    highest = diagram.values.max(axis=0) + distance
    near = []
    for limits in (diagram.lower, diagram.upper):
        for k, i in enumerate(diagram.joints):
            if lowest[k] <= limits[k] <= highest[k]:
                near.append((float(limits[k]), i))
    shared = [limit for limit, _ in near]
    for limit, i in near:
        axes.axhline(
            limit, color=SHARED_COLOR if shared.count(limit) > 1 else joint_color(i), **LIMIT_STYLE
        )
    low = min([low, *(limit for limit, _ in near)])
    high = max([high, *(limit for limit, _ in near)])
    margin = _MARGIN * max(high - low, span)
    axes.set_ylim(low - margin, high + margin)


def draw_curves(axes: Axes, diagram: Diagram, times: Array) -> None:
    """Draw a diagram's curves over times, shape (N,), s, without limits."""
    for k, i in enumerate(diagram.joints):
        axes.plot(times, diagram.values[:, k], joint_style(i), color=joint_color(i), lw=1.8)
    style_axes(axes, diagram.label)


def style_axes(axes: Axes, label: str) -> None:
    """Give axes the style of diagrams over time, and a label of the vertical axis."""
    axes.set_ylabel(label)
    axes.grid(color=GRID_COLOR, lw=0.6)
    axes.spines[["top", "right"]].set_visible(False)


def draw_legend(figure: Figure, description: Description, others: tuple[Any, ...] = ()) -> None:
    """Draw a legend of the joints' lines below a figure, with handles of other lines after them."""
    from matplotlib.lines import Line2D

    names = [joint.name for joint in description.joints]
    joints = [
        Line2D([], [], color=joint_color(i), ls=joint_style(i), lw=1.8, label=name)
        for i, name in enumerate(names)
    ]
    figure.legend(
        handles=[*joints, *others],
        loc="outside lower center",
        ncols=min(len(names) + len(others), 7 + len(others)),
        frameon=False,
        fontsize=9,
        handlelength=1.6,
    )


def limit_handle() -> Any:
    """Return a legend's handle for the dashed lines of limits."""
    from matplotlib.lines import Line2D

    return Line2D([], [], color=SHARED_COLOR, label="limit", **LIMIT_STYLE)


def joint_color(i: int) -> str:
    """Return the colour of a joint, counted from 0."""
    return CURVE_COLORS[i % len(CURVE_COLORS)]


def joint_style(i: int) -> str:
    """Return the line style of a joint, counted from 0."""
    return LINE_STYLES[i // len(CURVE_COLORS) % len(LINE_STYLES)]
