"""Diagrams over time of a quantity of several joints: a colour for each joint, limits dashed where they are near."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Description
from dhkit.viewer.figures import CURVE_COLORS, GRID_COLOR

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LIMIT_STYLE: dict[str, Any] = {"ls": (0, (5, 3)), "lw": 1.0, "alpha": 0.75}
SHARED_COLOR = "#5b6472"
"""Of a limit that several joints have."""
ROOM = 0.12
"""Above and below curves, of what they span."""
NEAR = 0.35
"""A limit farther from its joint's curve than this share of what all curves span is left out: it would flatten them."""
STYLES = ("-", "-.", ":")
"""Of joints behind the seventh colour."""


@dataclass(frozen=True, eq=False)
class Panel:
    """One diagram over time."""

    label: str
    joints: NDArray[np.intp]
    values: Array
    """Shape (N, joints)."""
    lower: Array
    """Limits, shape (joints,)."""
    upper: Array


def kinds_of_joints(description: Description) -> list[tuple[NDArray[np.intp], float, str, str]]:
    """Return for turning and for sliding joints, as far as there are some: which, a factor and labels.

    The factor gives degrees from rad and m from m; the labels are those of joint values and of rates.
    """
    prismatic = description.numbers.prismatic
    kinds = [
        (np.flatnonzero(~prismatic), 180 / np.pi, "angle [deg]", "rate [deg/s]"),
        (np.flatnonzero(prismatic), 1.0, "offset [m]", "rate [m/s]"),
    ]
    return [kind for kind in kinds if len(kind[0])]


def percent_panel(label: str, joints: NDArray[np.intp], shares: Array) -> Panel:
    """Return a panel of shares of limits, shape (N, joints), in percent."""
    hundred = np.full(len(joints), 100.0)
    return Panel(label, joints, 100.0 * shares, -hundred, hundred)


def torque_panel(description: Description, tau: Array) -> Panel:
    """Return a panel of torques, shape (N, n), N m and N: shares of the joints' limits where all have one."""
    effort, joints = description.numbers.effort, np.arange(description.n)
    if np.isfinite(effort).all():
        return percent_panel("torque / limit [%]", joints, tau / effort)
    unit = "N m, N" if description.numbers.prismatic.any() else "N m"
    return Panel(f"torque [{unit}]", joints, tau, -effort, effort)


def draw_panel(axes: Axes, panel: Panel, times: Array) -> None:
    """Draw a panel's curves, and the limits that are near them."""
    low, high = float(panel.values.min()), float(panel.values.max())
    span = max(high - low, 1e-9 * max(abs(low), abs(high)), 1e-12)
    draw_curves(axes, panel, times)
    own = (panel.values.min(axis=0) - NEAR * span, panel.values.max(axis=0) + NEAR * span)
    near = [
        (float(limits[k]), i)
        for limits in (panel.lower, panel.upper)
        for k, i in enumerate(panel.joints)
        if own[0][k] <= limits[k] <= own[1][k]
    ]
    shared = [limit for limit, _ in near]
    for limit, i in near:
        axes.axhline(limit, color=SHARED_COLOR if shared.count(limit) > 1 else joint_color(i), **LIMIT_STYLE)
    low, high = min([low, *(limit for limit, _ in near)]), max([high, *(limit for limit, _ in near)])
    room = ROOM * max(high - low, span)
    axes.set_ylim(low - room, high + room)


def draw_curves(axes: Axes, panel: Panel, times: Array) -> None:
    """Draw a panel's curves without limits."""
    for k, i in enumerate(panel.joints):
        axes.plot(times, panel.values[:, k], joint_style(i), color=joint_color(i), lw=1.8)
    plain_axes(axes, panel.label)


def plain_axes(axes: Axes, label: str) -> None:
    """Give axes the look of diagrams over time, and a label upright."""
    axes.set_ylabel(label)
    axes.grid(color=GRID_COLOR, lw=0.6)
    axes.spines[["top", "right"]].set_visible(False)


def name_joints(figure: Figure, description: Description, others: tuple[Any, ...] = ()) -> None:
    """Write below a figure which joint has which colour, and what other lines mean, given as handles of a legend."""
    from matplotlib.lines import Line2D

    names = [joint.name for joint in description.joints]
    joints = [
        Line2D([], [], color=joint_color(i), ls=joint_style(i), lw=1.8, label=name) for i, name in enumerate(names)
    ]
    figure.legend(
        handles=[*joints, *others],
        loc="outside lower center",
        ncols=min(len(names) + len(others), 7 + len(others)),
        frameon=False,
        fontsize=9,
        handlelength=1.6,
    )


def joint_color(i: int) -> str:
    """Return the colour of a joint, counted from 0."""
    return CURVE_COLORS[i % len(CURVE_COLORS)]


def joint_style(i: int) -> str:
    """Return the line style of a joint, counted from 0."""
    return STYLES[i // len(CURVE_COLORS) % 3]
