"""Figures of trajectories: joint values, rates and torques over time with their limits, and the tool's path."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from dhkit.trajectories import Samples, Trajectory
from dhkit.viewer.figures import draw_path, plot, space
from dhkit.viewer.notebook_figure import new_figure
from dhkit.viewer.panels import (
    LIMIT_STYLE,
    SHARED_COLOR,
    Panel,
    draw_curves,
    draw_panel,
    kinds_of_joints,
    name_joints,
    percent_panel,
    torque_panel,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SAMPLES = 401
"""Spread evenly; breaks, where accelerations jump, are drawn from both sides."""
EDGE = 0.06
"""Room beside the tool's path for its numbers, of its width."""
WHOLE = 112.0
"""%: what is shown where the limits are the frame."""


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
    description = trajectory.description
    samples = _samples(trajectory)
    panels = _panels(trajectory, samples)
    figure = new_figure(figsize=(11.5, 1.6 + 1.75 * len(panels)), layout="constrained")
    figure.suptitle(f"{description.name}: {trajectory.duration:.3g} s", fontsize=13, fontweight="bold")
    grid = figure.add_gridspec(len(panels), 3, width_ratios=(1.3, 1, EDGE))
    first = None
    for row, panel in enumerate(panels):
        axes = figure.add_subplot(grid[row, 0], sharex=first)
        first = first or axes
        draw_panel(axes, panel, samples.times)
        axes.tick_params(labelbottom=row == len(panels) - 1)
        axes.set_xlim(0.0, trajectory.duration)
    axes.set_xlabel("time [s]")
    name_joints(figure, description)
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
    if not motions:
        raise ValueError("motions is empty; expected trajectories by their names")
    description = next(iter(motions.values())).description
    numbers, end = description.numbers, max(motion.duration for motion in motions.values())
    for what, limits in (("speed", numbers.velocity), ("torque", numbers.effort)):
        if not np.isfinite(limits).all():
            name = description.joints[int(np.argmin(np.isfinite(limits)))].name
            raise ValueError(f"joint {name} has no {what} limit; expected one of each joint")
    figure = new_figure(figsize=(11.5, 1.1 + 2.4 * len(motions)), layout="constrained")
    figure.suptitle(f"{description.name}: what motions use of the limits", fontsize=13, fontweight="bold")
    grid = figure.subplots(len(motions), 2, sharex=True, sharey=True, squeeze=False)
    for row, (name, motion) in zip(grid, motions.items(), strict=True):
        motion.require(description)
        samples = _samples(motion)
        row[0].set_title(f"{name}: {motion.duration:.3f} s", fontsize=11, fontweight="bold", loc="left")
        shares = {"rate": samples.qd / numbers.velocity, "torque": samples.tau / numbers.effort}
        for axes, (what, values) in zip(row, shares.items(), strict=True):
            draw_curves(axes, percent_panel(f"{what} / limit [%]", np.arange(description.n), values), samples.times)
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
    name_joints(figure, description)
    return figure


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
    return Samples(trajectory.description, times, q, qd, qdd, trajectory.payload, trajectory.friction)


def _panels(trajectory: Trajectory, samples: Samples) -> list[Panel]:
    numbers = trajectory.description.numbers
    kinds = kinds_of_joints(trajectory.description)
    panels = [
        Panel(label, i, unit * samples.q[:, i], unit * numbers.lower[i], unit * numbers.upper[i])
        for i, unit, label, _ in kinds
    ]
    if len(kinds) > 1 and np.isfinite(numbers.velocity).all():
        panels.append(percent_panel("rate / limit [%]", np.arange(trajectory.n), samples.qd / numbers.velocity))
    else:
        limits = [unit * numbers.velocity[i] for i, unit, _, _ in kinds]
        panels += [
            Panel(label, i, unit * samples.qd[:, i], -limit, limit)
            for (i, unit, _, label), limit in zip(kinds, limits, strict=True)
        ]
    if not np.isfinite(numbers.mass).all():
        return panels
    return [*panels, torque_panel(trajectory.description, samples.tau)]
