"""Figures of trajectories: joint values, rates and torques over time with their limits, and the tool's path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dhkit.description import Array, Description
from dhkit.trajectories import Samples, Trajectory
from dhkit.viewer.figures import CURVE_COLORS, GRID_COLOR, draw_path, plot, space

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["plot_trajectory", "plot_uses"]

SAMPLES = 401
"""Spread evenly; breaks, where accelerations jump, are drawn from both sides."""
LIMIT_STYLE: dict[str, Any] = {"ls": (0, (5, 3)), "lw": 1.0, "alpha": 0.75}
EDGE = 0.06
"""Room beside the tool's path for its numbers, of its width."""
SHARED_COLOR = "#5b6472"
"""Of a limit that several joints have."""
ROOM = 0.12
"""Above and below curves, of what they span."""
NEAR = 0.35
"""A limit farther from its joint's curve than this share of what all curves span is left out: it would flatten them."""
WHOLE = 112.0
"""%: what is shown where the limits are the frame."""
STYLES = ("-", "-.", ":")
"""Of joints behind the seventh colour."""


@dataclass(frozen=True, eq=False)
class _Panel:
    """One diagram over time."""

    label: str
    joints: NDArray[np.intp]
    values: Array
    """Shape (N, joints)."""
    lower: Array
    """Limits, shape (joints,)."""
    upper: Array


@plot.register(Trajectory)
def plot_trajectory(trajectory: Trajectory) -> Figure:
    """Return joint values, rates and torques over time beside the tool's path.

    Limits are dashed, in the joint's colour, where they are near. Torques are shares of the joints' limits where all
    have one, and so are rates where both turning and sliding joints have; torques are left out for an arm with a link
    without body.

    Parameters
    ----------
    trajectory
        The motion.
    """
    from matplotlib.figure import Figure

    description = trajectory.description
    samples = _samples(trajectory)
    panels = _panels(trajectory, samples)
    figure = Figure(figsize=(11.5, 1.6 + 1.75 * len(panels)), layout="constrained")
    figure.suptitle(f"{description.name}: {trajectory.duration:.3g} s", fontsize=13, fontweight="bold")
    grid = figure.add_gridspec(len(panels), 3, width_ratios=(1.3, 1, EDGE))
    first = None
    for row, panel in enumerate(panels):
        axes = figure.add_subplot(grid[row, 0], sharex=first)
        first = first or axes
        _draw(axes, panel, samples.times)
        axes.tick_params(labelbottom=row == len(panels) - 1)
        axes.set_xlim(0.0, trajectory.duration)
    axes.set_xlabel("time [s]")
    _name_joints(figure, description)
    draw_path(space(figure, grid[:, 1]), description, samples.q)
    return figure


def plot_uses(motions: Mapping[str, Trajectory]) -> Figure:
    """Return how much of their limits motions of one arm use: rates and torques, a motion a row, over the same time.

    Parameters
    ----------
    motions
        By what each is called; of an arm with a body, a speed limit and a torque limit on every link.

    Raises
    ------
    ValueError
        No motion, or a joint without one of these limits.
    DescriptionError
        Motions of different robots, or a link without a body.
    """
    from matplotlib.figure import Figure

    if not motions:
        raise ValueError("motions is empty; expected trajectories by their names")
    description = next(iter(motions.values())).description
    numbers, end = description.numbers, max(motion.duration for motion in motions.values())
    for what, limits in (("speed", numbers.velocity), ("torque", numbers.effort)):
        if not np.isfinite(limits).all():
            name = description.joints[int(np.argmin(np.isfinite(limits)))].name
            raise ValueError(f"joint {name} has no {what} limit; expected one of each joint")
    figure = Figure(figsize=(11.5, 1.1 + 2.4 * len(motions)), layout="constrained")
    figure.suptitle(f"{description.name}: what motions use of the limits", fontsize=13, fontweight="bold")
    grid = figure.subplots(len(motions), 2, sharex=True, sharey=True, squeeze=False)
    for row, (name, motion) in zip(grid, motions.items(), strict=True):
        motion.require(description)
        samples = _samples(motion)
        row[0].set_title(f"{name}: {motion.duration:.3f} s", fontsize=11, fontweight="bold", loc="left")
        shares = {"rate": samples.qd / numbers.velocity, "torque": samples.tau / numbers.effort}
        for axes, (what, values) in zip(row, shares.items(), strict=True):
            _curves(axes, _share(f"{what} / limit [%]", np.arange(description.n), values), samples.times)
            largest = f"up to {100 * float(np.abs(values).max()):.0f} %"
            axes.set_title(largest, fontsize=10, color=SHARED_COLOR, loc="right")
            if motion.duration < end:
                axes.axvline(motion.duration, color=SHARED_COLOR, lw=1.0)
            for limit in (-100, 100):
                axes.axhline(limit, color=SHARED_COLOR, **LIMIT_STYLE)
    grid[0, 0].set_xlim(0.0, end)
    grid[0, 0].set_ylim(-WHOLE, WHOLE)
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    _name_joints(figure, description)
    return figure


def _name_joints(figure: Figure, description: Description) -> None:
    names = [joint.name for joint in description.joints]
    figure.legend(
        handles=[_handle(i, name) for i, name in enumerate(names)],
        loc="outside lower center",
        ncols=min(len(names), 7),
        frameon=False,
        fontsize=9,
        handlelength=1.6,
    )


def _samples(trajectory: Trajectory) -> Samples:
    """Return samples on both sides of every break, so that jumps are upright."""
    inside = trajectory.breaks[1:-1] if len(trajectory.breaks) <= SAMPLES else np.zeros(0)
    even = np.setdiff1d(np.linspace(0.0, trajectory.duration, SAMPLES), inside)
    times = np.concatenate([even, inside, inside])
    left = np.repeat([False, True, False], [len(even), len(inside), len(inside)])
    order = np.lexsort((~left, times))
    times, left = times[order], left[order, None]
    q, qd, qdd = (
        np.where(left, value(times, "left"), value(times)) for value in (trajectory.q, trajectory.qd, trajectory.qdd)
    )
    return Samples(trajectory.description, times, q, qd, qdd)


def _panels(trajectory: Trajectory, samples: Samples) -> list[_Panel]:
    numbers = trajectory.description.numbers
    kinds = [
        (~numbers.prismatic, 180 / np.pi, "angle [deg]", "rate [deg/s]"),
        (numbers.prismatic, 1.0, "offset [m]", "rate [m/s]"),
    ]
    kinds = [kind for kind in kinds if kind[0].any()]
    panels = []
    for chosen, unit, label, _ in kinds:
        i = np.flatnonzero(chosen)
        panels.append(_Panel(label, i, unit * samples.q[:, i], unit * numbers.lower[i], unit * numbers.upper[i]))
    everyone = np.arange(trajectory.n)
    if len(kinds) > 1 and np.isfinite(numbers.velocity).all():
        panels.append(_share("rate / limit [%]", everyone, samples.qd / numbers.velocity))
    else:
        for chosen, unit, _, label in kinds:
            i, limit = np.flatnonzero(chosen), unit * numbers.velocity[chosen]
            panels.append(_Panel(label, i, unit * samples.qd[:, i], -limit, limit))
    if not np.isfinite(numbers.mass).all():
        return panels
    if np.isfinite(numbers.effort).all():
        return [*panels, _share("torque / limit [%]", everyone, samples.tau / numbers.effort)]
    unit_name = "N m, N" if numbers.prismatic.any() else "N m"
    return [*panels, _Panel(f"torque [{unit_name}]", everyone, samples.tau, -numbers.effort, numbers.effort)]


def _share(label: str, joints: NDArray[np.intp], shares: Array) -> _Panel:
    hundred = np.full(len(joints), 100.0)
    return _Panel(label, joints, 100.0 * shares, -hundred, hundred)


def _draw(axes: Axes, panel: _Panel, times: Array) -> None:
    low, high = float(panel.values.min()), float(panel.values.max())
    span = max(high - low, 1e-9 * max(abs(low), abs(high)), 1e-12)
    _curves(axes, panel, times)
    own = (panel.values.min(axis=0) - NEAR * span, panel.values.max(axis=0) + NEAR * span)
    near = [
        (float(limits[k]), i)
        for limits in (panel.lower, panel.upper)
        for k, i in enumerate(panel.joints)
        if own[0][k] <= limits[k] <= own[1][k]
    ]
    shared = [limit for limit, _ in near]
    for limit, i in near:
        axes.axhline(limit, color=SHARED_COLOR if shared.count(limit) > 1 else _color(i), **LIMIT_STYLE)
    low, high = min([low, *(limit for limit, _ in near)]), max([high, *(limit for limit, _ in near)])
    room = ROOM * max(high - low, span)
    axes.set_ylim(low - room, high + room)


def _curves(axes: Axes, panel: _Panel, times: Array) -> None:
    for k, i in enumerate(panel.joints):
        axes.plot(times, panel.values[:, k], STYLES[i // len(CURVE_COLORS) % 3], color=_color(i), lw=1.8)
    axes.set_ylabel(panel.label)
    axes.grid(color=GRID_COLOR, lw=0.6)
    axes.spines[["top", "right"]].set_visible(False)


def _handle(i: int, name: str) -> Any:
    from matplotlib.lines import Line2D

    return Line2D([], [], color=_color(i), ls=STYLES[i // len(CURVE_COLORS) % 3], lw=1.8, label=name)


def _color(i: int) -> str:
    return CURVE_COLORS[i % len(CURVE_COLORS)]
