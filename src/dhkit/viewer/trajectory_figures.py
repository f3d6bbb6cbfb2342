"""Figures of trajectories: joint values, rates and torques over time with their limits, and the tool's path."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from dhkit.trajectories import Samples, Trajectory
from dhkit.viewer.diagrams import (
    LIMIT_STYLE,
    SHARED_COLOR,
    Diagram,
    draw_curves,
    draw_diagram,
    draw_legend,
    joint_kinds,
    limit_handle,
    percent_diagram,
    torque_diagram,
)
from dhkit.viewer.figures import draw_path, figure_of, space_axes
from dhkit.viewer.notebook import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_EVEN_SAMPLES = 401
"""Number of samples of a motion at equal steps, and largest number of breaks (jumps of acceleration) that are sampled
on both sides as well."""
_TICK_MARGIN = 0.06
"""Room beside the tool's path for its tick labels, as a share of its width."""
_MAX_PERCENT = 112.0
"""Largest share that a diagram of shares of limits shows, %."""


@figure_of.register(Trajectory)
def plot_trajectory(trajectory: Trajectory) -> Figure:
    """Return a figure of joint values, rates and torques over time, beside the tool's path.

    Limits near the curves are dashed, in the joint's colour, or in grey where several joints share the limit. Torques
    are drawn as shares of their limits if all joints have one; rates, if all joints have a speed limit and the arm has
    both revolute and prismatic joints. Torques are left out for an arm with a link without body.

    Parameters
    ----------
    trajectory
        The motion.

    Returns
    -------
    Figure
        A figure of matplotlib; a notebook shows it, ``savefig`` writes it.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.trajectories import quintic
    >>> figure = plot_trajectory(quintic(library_robot("planar2r"), [0, 0], [0.5, 1.0], duration=2.0))
    """
    description = trajectory.description
    samples = _samples(trajectory)
    diagrams = _diagrams(trajectory, samples)
    figure = new_figure(figsize=(11.5, 1.6 + 1.75 * len(diagrams)), layout="constrained")
    figure.suptitle(
        f"{description.name}: {trajectory.duration:.3g} s", fontsize=13, fontweight="bold"
    )
    grid = figure.add_gridspec(len(diagrams), 3, width_ratios=(1.3, 1, _TICK_MARGIN))
    first = None
    for row, diagram in enumerate(diagrams):
        axes = figure.add_subplot(grid[row, 0], sharex=first)
        first = first or axes
        draw_diagram(axes, diagram, samples.times)
        axes.tick_params(labelbottom=row == len(diagrams) - 1)
        axes.set_xlim(0.0, trajectory.duration)
    axes.set_xlabel("time [s]")
    draw_legend(figure, description, (limit_handle(),))
    axes = space_axes(figure, grid[:, 1])
    axes.set_title("the arm at both ends, and its tool's path [m]", fontsize=10, color=SHARED_COLOR)
    draw_path(axes, description, samples.q)
    return figure


def plot_uses(motions: Mapping[str, Trajectory]) -> Figure:
    """Return a figure of rates and torques of motions of one arm as shares of their limits, a motion a row.

    Parameters
    ----------
    motions
        Motions by name, all of one arm; each link has a body, each joint a speed limit and a torque limit.

    Returns
    -------
    Figure
        A figure of matplotlib; a notebook shows it, ``savefig`` writes it.

    Raises
    ------
    ValueError
        There is no motion, or a joint has no such limit.
    DescriptionError
        Motions are of different robots, or a link has no body.

    Examples
    --------
    >>> from dhkit import Arm
    >>> arm = Arm.load("puma560")
    >>> ends = [arm.configurations["nominal"], arm.configurations["ready"]]
    >>> motions = {f"{T} s": arm.quintic(*ends, duration=T) for T in (1.0, 2.0)}
    >>> len(plot_uses(motions).axes)
    4
    """
    if not motions:
        raise ValueError("motions is empty; expected trajectories by their names")
    description = next(iter(motions.values())).description
    numbers = description.numbers
    end = max(motion.duration for motion in motions.values())
    for quantity, limits in (("speed", numbers.velocity), ("torque", numbers.effort)):
        if not np.isfinite(limits).all():
            name = description.joints[int(np.argmin(np.isfinite(limits)))].name
            raise ValueError(f"joint {name} has no {quantity} limit; expected one of each joint")
    figure = new_figure(figsize=(11.5, 1.1 + 2.4 * len(motions)), layout="constrained")
    figure.suptitle(
        f"{description.name}: what motions use of the limits", fontsize=13, fontweight="bold"
    )
    grid = figure.subplots(len(motions), 2, sharex=True, sharey=True, squeeze=False)
    for row, (name, motion) in zip(grid, motions.items(), strict=True):
        motion.require(description)
        samples = _samples(motion)
        row[0].set_title(
            f"{name}: {motion.duration:.3f} s", fontsize=11, fontweight="bold", loc="left"
        )
        shares = {"rate": samples.qd / numbers.velocity, "torque": samples.tau / numbers.effort}
        for axes, (quantity, values) in zip(row, shares.items(), strict=True):
            draw_curves(
                axes,
                percent_diagram(f"{quantity} / limit [%]", np.arange(description.n), values),
                samples.times,
            )
            largest = f"up to {100 * float(np.abs(values).max()):.0f} %"
            axes.set_title(largest, fontsize=10, color=SHARED_COLOR, loc="right")
            if motion.duration < end:
                axes.axvline(motion.duration, color=SHARED_COLOR, lw=1.0)
            for limit in (-100, 100):
                axes.axhline(limit, color=SHARED_COLOR, **LIMIT_STYLE)
    grid[0, 0].set_xlim(0.0, end)
    grid[0, 0].set_ylim(-_MAX_PERCENT, _MAX_PERCENT)
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    draw_legend(figure, description, (limit_handle(),))
    return figure


def _samples(trajectory: Trajectory) -> Samples:
    """Return samples of a motion; up to _EVEN_SAMPLES breaks are sampled on both sides, so that jumps are vertical."""
    inside = trajectory.breaks[1:-1] if len(trajectory.breaks) <= _EVEN_SAMPLES else np.zeros(0)
    even = np.setdiff1d(np.linspace(0.0, trajectory.duration, _EVEN_SAMPLES), inside)
    times = np.concatenate([even, inside, inside])
    left = np.repeat([False, True, False], [len(even), len(inside), len(inside)])
    order = np.lexsort((~left, times))
    times = times[order]
    left = left[order, None]
    q, qd, qdd = (
        np.where(left, value(times, "left"), value(times))
        for value in (trajectory.q, trajectory.qd, trajectory.qdd)
    )
    return Samples(
        trajectory.description, times, q, qd, qdd, trajectory.payload, trajectory.friction
    )


def _diagrams(trajectory: Trajectory, samples: Samples) -> list[Diagram]:
    numbers = trajectory.description.numbers
    kinds = joint_kinds(trajectory.description)
    diagrams = [
        Diagram(label, i, unit * samples.q[:, i], unit * numbers.lower[i], unit * numbers.upper[i])
        for i, unit, label, _ in kinds
    ]
    if len(kinds) > 1 and np.isfinite(numbers.velocity).all():
        diagrams.append(
            percent_diagram(
                "rate / limit [%]", np.arange(trajectory.n), samples.qd / numbers.velocity
            )
        )
    else:
        limits = [unit * numbers.velocity[i] for i, unit, _, _ in kinds]
        diagrams += [
            Diagram(label, i, unit * samples.qd[:, i], -limit, limit)
            for (i, unit, _, label), limit in zip(kinds, limits, strict=True)
        ]
    if not np.isfinite(numbers.mass).all():
        return diagrams
    return [*diagrams, torque_diagram(trajectory.description, samples.tau)]
